"""The conformance check finds each kind of broken contour, and says what is broken."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contourlab.configuration import real
from contourlab.contours.base import Contour
from contourlab.testing.contours import check_contour


class Wave(Contour):
    """A sound contour; each broken one below changes one thing."""

    height: jax.Array = real(default=0.2)

    n_axes = property(lambda self: 2)
    domain = property(lambda self: (0.0, 2.0))
    closed = property(lambda self: False)

    def position(self, parameter, piece=None):
        p = jnp.asarray(parameter)
        return jnp.stack([p, self.height * jnp.sin(p)])


class ThirdDerivative(Wave):
    def derivatives(self, parameter, order, piece=None):
        rows = super().derivatives(parameter, order, piece)
        return rows.at[3].multiply(1.0 + 1e-4) if order >= 3 else rows


class Shape(Wave):
    def position(self, parameter, piece=None):
        return super().position(parameter)[None]


class Single(Wave):
    def position(self, parameter, piece=None):
        return super().position(parameter).astype(jnp.float32)


class NotClosed(Wave):
    closed = property(lambda self: True)


class Hole(Wave):
    def position(self, parameter, piece=None):
        return super().position(parameter) + 0.0 * jnp.sqrt(1.9 - jnp.asarray(parameter))


class Length(Wave):
    def arc_length(self, start, end):
        return 1.001 * super().arc_length(start, end)


class NotAdditive(Wave):
    def arc_length(self, start, end):
        return jnp.abs(super().arc_length(start, end)) ** 1.1


class Domain(Wave):
    domain = property(lambda self: (2.0, 0.0))


class Wrap(Wave):
    def wrap(self, parameter):
        return jnp.asarray(parameter)


class Piece(Wave):
    def position(self, parameter, piece=None):
        return super().position(parameter) * (1.0 if piece is None else 1.001)


class Hint(Wave):
    def locate(self, parameter, piece):
        return jnp.asarray(piece, jnp.int32) + 1


class Blocked(Wave):
    def position(self, parameter, piece=None):
        return jax.lax.stop_gradient(super().position(parameter))

    def derivatives(self, parameter, order, piece=None):
        return Wave(height=self.height).derivatives(parameter, order)


class Gradient(Wave):
    def position(self, parameter, piece=None):
        return super().position(parameter) + jnp.sqrt(self.height - 0.2)


class Skew(Wave):
    def frenet(self, parameter, piece=None):
        frame = super().frenet(parameter, piece)
        return type(frame)(frame.tangent, frame.tangent, frame.curvature)


def test_a_sound_contour_passes():
    check_contour(Wave())
    check_contour(Wave(), parameters=[0.5, 1.0], seed=3)


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (ThirdDerivative, "derivative 3 differs from the finite difference of derivative 2"),
        (Shape, r"position must have shape \(2,\), got \(1, 2\)"),
        (Single, "position must be float64, got float32"),
        (NotClosed, "says that it is closed|must repeat"),
        (Hole, "not finite at parameter"),
        (Length, "the integral of the speed"),
        (NotAdditive, "does not add up|must be -arc_length"),
        (Domain, "end > start"),
        (Wrap, "must return into the domain"),
        (Piece, "with the located piece differ"),
        (Hint, "depends on where the search starts"),
        (Blocked, "jacfwd is not derivative 1"),
        (Gradient, "gradient through its fields is not finite"),
        (Skew, "not orthonormal"),
    ],
)
def test_a_broken_contour_is_found(broken, message):
    with pytest.raises(AssertionError, match=message):
        check_contour(broken())


def test_parameters_outside_the_domain_are_refused():
    with pytest.raises(AssertionError, match="must lie in the domain"):
        check_contour(Wave(), parameters=np.array([3.0]))
