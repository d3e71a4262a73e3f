"""A parabola in the plane, with its arc length in closed form.

References
----------
.. [GhaffariUlsoy] the contour of the simulations, R(θ) = (θ, h_r θ²) with θ from -a_r to a_r.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.level import Level, quadratic_level
from contourlab.contours.placed import PlacedContour
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Derivatives, Scalar

__all__ = ["Parabola"]


class Parabola(PlacedContour):
    """A stretch of a parabola round its vertex; the parameter is x [m], -half_width to half_width.

    Before it is turned and shifted, y = coefficient x². The curvature at the vertex is
    2 coefficient.

    Parameters
    ----------
    coefficient
        Not 0 [1/m]: > 0 turns left, < 0 right.
    half_width
        Distance of the ends from the axis of symmetry, > 0 [m].
    center
        The vertex, shape (2,) [m].
    rotation
        Angle from the x axis to the tangent at the vertex [rad].

    Raises
    ------
    GeometryError
        A coefficient of 0; a centre that is not of 2 coordinates.
    ConfigurationError
        A half width that is not > 0; a number that is not finite.
    """

    coefficient: Float[Array, " ..."] = real(unit="1/m", ndim=0)
    half_width: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)

    def check(self) -> None:
        """Raise GeometryError unless it is a parabola in the plane."""
        super().check()
        if not (self.coefficient != 0.0).all():
            raise GeometryError("coefficient must not be 0 1/m: that is a line")

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """-half_width and half_width [m]."""
        return -self.half_width, self.half_width

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    def own_derivatives(self, parameter: Scalar, order: int) -> Derivatives:
        """Return the point and its derivatives over x, before the curve is turned and shifted.

        Parameters
        ----------
        parameter
            x [m].
        order
            Highest derivative, >= 0.
        """
        h, x = jnp.asarray(self.coefficient), parameter
        none: list[Scalar] = [0.0] * max(order - 2, 0)
        along: list[Scalar] = [x, 1.0, 0.0, *none]
        up: list[Scalar] = [h * x * x, 2.0 * h * x, 2.0 * h, *none]
        return jnp.stack([jnp.stack(along[: order + 1]), jnp.stack(up[: order + 1])], axis=1)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m], in closed form.

        Parameters
        ----------
        start, end
            x [m].
        """

        def from_vertex(x: Scalar) -> Scalar:  # the integral of sqrt(1 + (2 h x)²)
            slope = 2.0 * self.coefficient * x
            return 0.5 * (
                x * jnp.sqrt(1.0 + slope * slope) + jnp.arcsinh(slope) / (2.0 * self.coefficient)
            )

        return from_vertex(end) - from_vertex(start)

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the implicit form coefficient x² - y [m], its gradient and its Hessian.

        Positive on the right of the direction of travel: outside where the parabola turns left,
        inside where it turns right.

        Parameters
        ----------
        position
            Shape (2,) [m].
        """
        x, y = self.own_axes()
        # a coefficient below zero cannot be a square: the sign of the whole carries it
        sign = jnp.sign(self.coefficient)
        rows = jnp.sqrt(jnp.abs(self.coefficient)) * x[None]
        return quadratic_level(
            jnp.asarray(position) - self.center, rows, -sign * y, jnp.asarray(0.0), sign
        )
