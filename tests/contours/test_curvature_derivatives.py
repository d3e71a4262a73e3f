"""Derivatives over arc length, of curvature and of torsion: closed forms and other roads."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import real
from contourlab.contours import arc_length_derivatives, curvature_derivatives
from contourlab.contours.base import Contour, derivatives_by_jvp
from contourlab.contours.circle import Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.errors import GeometryError


class Twisted(Contour):
    """A spatial curve whose curvature and torsion vary; straight at 0 when ``inflection``."""

    inflection: jax.Array = real(default=0.0)

    n_axes = property(lambda self: 3)
    domain = property(lambda self: (-1.0, 1.0))
    closed = property(lambda self: False)

    def position(self, parameter, piece=None):
        p = jnp.asarray(parameter)
        bend = jnp.where(self.inflection > 0.0, p**3, p**2)
        return jnp.stack([p + 0.1 * p**2, bend, 0.3 * p**4 + 0.2 * p**3])


class Cusp(Contour):
    """Stands still at 0."""

    n_axes = property(lambda self: 2)
    domain = property(lambda self: (-1.0, 1.0))
    closed = property(lambda self: False)

    def position(self, parameter, piece=None):
        p = jnp.asarray(parameter)
        return jnp.stack([p * p, p * p * p])


@eqx.filter_jit
def over_arc_length(contour, value, parameter, order):
    """Derivatives over arc length by differentiating with 1/σ again and again: another road."""

    def function(p):
        return jnp.atleast_1d(value(contour, p))

    rows = []
    for _ in range(order + 1):
        rows.append(function(parameter))

        def function(p, inner=function):
            slope = jax.jvp(inner, (p,), (1.0,))[1]
            return slope / jnp.linalg.norm(contour.derivatives(p, 1)[1])

    return jnp.stack(rows)


@eqx.filter_jit
def rows_of(contour, parameter):
    return arc_length_derivatives(contour.derivatives(parameter, 5))


@eqx.filter_jit
def curvatures(contour, parameter):
    rows = curvature_derivatives(contour.derivatives(parameter, 5))
    return rows.curvature, rows.torsion


@pytest.mark.parametrize("contour", [Ellipse(semi_axes=(0.03, 0.01)), Twisted()])
def test_rows_are_those_of_repeated_differentiation(contour):
    for p in jnp.array([0.3, -0.7]):
        rows = rows_of(contour, p)
        other = np.asarray(over_arc_length(contour, type(contour).position, p, 5))
        scale = np.abs(other).max(axis=1, keepdims=True)
        # both lose a few digits an order; the loss is relative to the largest term of each row
        assert_allclose(rows / scale, other / scale, rtol=0, atol=1e-11)


def test_curvature_of_an_ellipse_has_the_closed_form():
    a, b = 0.03, 0.01
    for theta in np.linspace(0.0, 6.0, 7):
        rows = curvature_derivatives(Ellipse(semi_axes=(a, b)).derivatives(theta, 4))
        g = np.hypot(a * np.sin(theta), b * np.cos(theta))
        c2, s2 = np.cos(2 * theta), np.sin(2 * theta)
        m = 0.5 * (a * a - b * b)
        # κ = ab/g³, g g' = m sin 2θ; each d/ds is (1/g) d/dθ
        first = -3 * a * b * m * s2 / g**6
        second = -3 * a * b * m * (2 * c2 / g**7 - 6 * m * s2**2 / g**9)
        assert_allclose(rows.curvature, [a * b / g**3, first, second], rtol=1e-11, atol=1e-4)
        with pytest.raises(GeometryError, match="a planar contour has no torsion"):
            _ = rows.torsion


def test_helix_has_constant_curvature_and_torsion():
    r, c = 0.5, 0.7 / (2.0 * np.pi)
    rows = curvature_derivatives(Helix(radius=r, pitch=0.7, turns=1.0).derivatives(0.9, 6))
    w2 = r * r + c * c
    assert_allclose(rows.curvature, [r / w2, 0, 0, 0, 0], rtol=1e-13, atol=1e-10)
    assert_allclose(rows.torsion, [c / w2, 0, 0, 0], rtol=1e-13, atol=1e-10)


def test_twisted_curve_agrees_with_the_frame_differentiated():
    contour = Twisted()

    def both(curve, q):
        frame = curve.frenet(q)
        return jnp.stack([frame.curvature, frame.torsion])

    for p in jnp.array([0.4, -0.6]):
        curvature, torsion = curvatures(contour, p)
        other = over_arc_length(contour, both, p, 3)
        assert_allclose(curvature, other[:, 0], rtol=1e-9)
        assert_allclose(torsion, other[:3, 1], rtol=1e-9)


def test_sign_follows_the_side_and_the_direction():
    left = curvature_derivatives(Ellipse(semi_axes=(0.03, 0.01)).derivatives(0.7, 4)).curvature
    backwards = np.array([1.0, -1.0, 1.0, -1.0, 1.0])[:, None]
    rows = Ellipse(semi_axes=(0.03, 0.01)).derivatives(0.7, 4) * backwards
    reverse = curvature_derivatives(rows).curvature
    # κ → -κ and s → -s: an odd number of signs for even derivatives
    assert_allclose(reverse, left * np.array([-1.0, 1.0, -1.0]), rtol=1e-12)


def test_straight_in_space_is_zero_with_finite_slopes():
    line = Line(start=(0, 0, 0), end=(1.0, 2.0, 2.0))
    for contour, p in ((line, jnp.array(0.3)), (Twisted(inflection=1.0), jnp.array(0.0))):
        curvature, torsion = curvatures(contour, p)
        assert_allclose(curvature, 0.0, atol=0)
        assert_allclose(torsion, 0.0, atol=0)
        slope = jax.jit(jax.jacfwd(lambda q, c=contour: curvatures(c, q)[1]))
        assert np.isfinite(slope(p)).all()


def test_small_curvature_is_not_taken_for_straight():
    normal = (0.0, 0.0, 1.0)
    circle = Circle(center=(0.0, 0.0, 0.0), radius=1e9, normal=normal)
    rows = curvature_derivatives(circle.derivatives(0.3, 3))
    assert_allclose(rows.curvature[0], 1e-9, rtol=1e-12)


def test_a_cusp_gives_zeros():
    rows = Cusp().derivatives(0.0, 4)
    assert_allclose(arc_length_derivatives(rows), 0.0, atol=0)
    slope = jax.jit(jax.jacfwd(lambda p: arc_length_derivatives(Cusp().derivatives(p, 3))))
    assert np.isfinite(slope(0.0)).all()


def test_any_number_of_coordinates():
    def curve(p):
        return jnp.stack([p, p**2, p**3, jnp.sin(p)])

    rows = arc_length_derivatives(derivatives_by_jvp(curve, 0.4, 3))
    assert_allclose(np.linalg.norm(rows[1]), 1.0, rtol=1e-14)
    assert_allclose(rows[1] @ rows[2], 0.0, atol=1e-14)  # perpendicular, to rounding of r_ss ~ 1
    assert_allclose(rows[1] @ rows[3], -rows[2] @ rows[2], rtol=1e-12)


@pytest.mark.parametrize(
    ("shape", "message"),
    [((3, 4), "2 or 3 axes, this one has 4"), ((2, 2), "order 2 at least, got order 1"),
     ((3, 3), "order 3 at least, got order 2")],
)  # fmt: skip
def test_what_cannot_be_asked(shape, message):
    with pytest.raises(GeometryError, match=message):
        curvature_derivatives(np.ones(shape))
