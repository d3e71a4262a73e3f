"""An ellipse in the plane, with its arc length in closed form.

References
----------
.. [Carlson1995] numerical computation of real elliptic integrals: the duplication theorem and
   the series at its end. Equation numbers not checked; judged against scipy in the tests.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.base import ClosedFormContour
from contourlab.contours.circle import TURN, turning
from contourlab.contours.level import Level, quadratic_level
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["Ellipse", "elliptic_arc_length"]

_DUPLICATIONS = 16
"""Each brings Carlson's arguments four times closer together; enough for ratios to 1e12."""


class Ellipse(ClosedFormContour):
    """An ellipse; the parameter is the eccentric angle θ [rad], 0 to 2π, and goes round.

    It runs counter-clockwise. Before it is turned and shifted, x = a cos θ, y = b sin θ.

    Parameters
    ----------
    semi_axes
        a and b, shape (2,), > 0 [m]; either may be the longer.
    center
        Shape (2,) [m].
    rotation
        Angle from the x axis to the first semi-axis [rad].

    Raises
    ------
    GeometryError
        Semi-axes or a centre that are not of 2 coordinates.
    ConfigurationError
        A semi-axis that is not > 0; a number that is not finite.
    """

    semi_axes: Float[Array, "... n_semi_axes"] = real(unit="m", above=0.0, ndim=1)
    center: Float[Array, "... n_axes"] = real(unit="m", ndim=1, default=(0.0, 0.0))
    rotation: Float[Array, " ..."] = real(unit="rad", ndim=0, default=0.0)

    def check(self) -> None:
        """Raise GeometryError unless the ellipse is in the plane."""
        for name, value in (("semi_axes", self.semi_axes), ("center", self.center)):
            if value.ndim == 0 or value.shape[-1] != 2:
                raise GeometryError(f"{name} must have 2 coordinates, got shape {value.shape}")

    @property
    def n_axes(self) -> int:
        """2."""
        return 2

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and 2π [rad]."""
        return 0.0, TURN

    @property
    def closed(self) -> bool:
        """Always."""
        return True

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m], by elliptic integrals: exact to rounding.

        Parameters
        ----------
        start, end
            Eccentric angles [rad].
        """
        a, b = self.semi_axes[0], self.semi_axes[1]
        return elliptic_arc_length(a, b, end) - elliptic_arc_length(a, b, start)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the eccentric angle, in closed form.

        Parameters
        ----------
        parameter
            Eccentric angle [rad].
        order
            Highest derivative, >= 0.
        piece
            Not needed.

        Returns
        -------
        Derivatives
            Shape (order + 1, 2) [m/rad^k].
        """
        del piece
        first, second = self._arms()
        rows = turning(first, second, parameter, order)
        return jnp.stack([self.center + rows[0], *rows[1:]])

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the implicit form x²/a² + y²/b² - 1, its gradient and its Hessian.

        0 on the ellipse, > 0 outside, which is on the right of the direction of travel.

        Parameters
        ----------
        position
            Shape (2,) [m].
        """
        first, second = self._arms()
        rows = jnp.stack([first / (first @ first), second / (second @ second)])
        return quadratic_level(
            jnp.asarray(position) - self.center, rows, jnp.zeros(2), jnp.asarray(-1.0)
        )

    def _arms(self) -> tuple[AxisVector, AxisVector]:
        cosine, sine = jnp.cos(self.rotation), jnp.sin(self.rotation)
        a, b = self.semi_axes[0], self.semi_axes[1]
        return a * jnp.stack([cosine, sine]), b * jnp.stack([-sine, cosine])


def elliptic_arc_length(a: Scalar, b: Scalar, angle: Scalar) -> Scalar:
    """Return the arc length of an ellipse from the end of its shorter semi-axis.

    With the angle φ counted from the shorter semi-axis, of length q, and the longer of length p,
    the speed is ``q sqrt(cos² φ + (p/q)² sin² φ)``, and its integral

        q (s R_F(c², t², 1) + (p²/q² - 1) s³ R_D(c², t², 1) / 3),  t² = c² + (p/q)² s²

    with s = sin φ, c = cos φ. Neither term is negative, so nothing cancels. Two values that are to
    be subtracted share one origin.

    Parameters
    ----------
    a, b
        Semi-axes along x and y [m].
    angle
        Eccentric angle [rad], any.
    """
    tall = b > a
    longer, shorter = jnp.maximum(a, b), jnp.minimum(a, b)
    # the quarter at which the tangent is along the longer semi-axis and the speed is least
    angle = jnp.where(tall, angle - 0.5 * jnp.pi, angle)
    half_turns = jnp.round(angle / jnp.pi)
    angle = angle - jnp.pi * half_turns
    ratio = longer / shorter
    quarter = _from_vertex(ratio, 1.0, 0.0)
    return shorter * (
        _from_vertex(ratio, jnp.sin(angle), jnp.cos(angle)) + 2.0 * half_turns * quarter
    )


def _from_vertex(ratio: Scalar, s: Scalar, c: Scalar) -> Scalar:
    across = jnp.sqrt(c * c + (ratio * s) ** 2)
    first, second = _carlson(jnp.abs(c), across)
    return s * first + (ratio * ratio - 1.0) * s**3 * second / 3.0


def _carlson(root_x: Scalar, root_y: Scalar) -> tuple[Scalar, Scalar]:
    """Return R_F(x, y, 1) and R_D(x, y, 1) from the square roots of x and y."""

    def duplicate(roots: Array) -> Array:
        return roots[0] * roots[1] + roots[1] * roots[2] + roots[2] * roots[0]

    def step(state: Any, _: None) -> tuple[Any, None]:
        values, total, power = state
        roots = jnp.sqrt(values)
        mean = duplicate(roots)
        total = total + power / (roots[2] * (values[2] + mean))
        return (0.25 * (values + mean), total, 0.25 * power), None

    # the first step takes the roots as given: the square root of 0 has no derivative
    roots = jnp.stack([root_x, root_y, jnp.ones_like(root_x + root_y)])
    mean = duplicate(roots)
    state = (0.25 * (roots**2 + mean), 1.0 / (1.0 + mean), 0.25 * jnp.ones_like(mean))
    (values, total, power), _ = jax.lax.scan(step, state, None, length=_DUPLICATIONS)
    middle = jnp.mean(values)
    x, y, z = 1.0 - values / middle
    second, third = x * y + y * z + z * x, x * y * z
    first_kind = (1.0 - second / 10.0 + third / 14.0) / jnp.sqrt(middle)
    # R_D weighs z three times
    middle = (values[0] + values[1] + 3.0 * values[2]) / 5.0
    x, y, z = 1.0 - values / middle
    second = x * y - 6.0 * z * z
    second_kind = 3.0 * total + power * (1.0 - 3.0 * second / 14.0) / (middle * jnp.sqrt(middle))
    return first_kind, second_kind
