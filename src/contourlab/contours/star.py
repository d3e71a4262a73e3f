"""A star with rounded tips and valleys, in the plane."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real, static
from contourlab.contours.circle import TURN
from contourlab.contours.placed import PlacedContour, harmonic
from contourlab.errors import ConfigurationError
from contourlab.typing import Array, Derivatives, Scalar

__all__ = ["Star"]


class Star(PlacedContour):
    """A smooth star; the parameter is the polar angle φ [rad], 0 to 2π, and goes round.

    The distance from the centre is R + A cos(points φ), with R the mean and A half the difference
    of the two radii. It runs counter-clockwise and starts at a tip. With n points, the curvature
    at a tip of radius r is (r + n² A) / r², in a valley (r - n² A) / r²: valleys are hollow where
    n² A > r. No published contour is meant: the papers that this project reproduces have none.

    Parameters
    ----------
    outer_radius
        Of the tips, > 0 [m].
    inner_radius
        Of the valleys, > 0, no more than the outer one [m].
    points
        Number of tips, >= 2.
    center
        Shape (2,) [m].
    rotation
        Angle from the x axis to the first tip [rad].

    Raises
    ------
    GeometryError
        A centre that is not of 2 coordinates.
    ConfigurationError
        A radius that is not > 0, an inner one above the outer one; fewer than 2 points; a number
        that is not finite.
    """

    outer_radius: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    inner_radius: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    points: int = static(minimum=2, default=5)

    def check(self) -> None:
        """Raise ConfigurationError unless the valleys are no further out than the tips."""
        super().check()
        if not (self.inner_radius <= self.outer_radius).all():
            raise ConfigurationError(
                f"inner_radius must be <= outer_radius, got {self.inner_radius} m "
                f"and {self.outer_radius} m"
            )

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and 2π [rad]."""
        return 0.0, TURN

    @property
    def closed(self) -> bool:
        """Always."""
        return True

    def own_derivatives(self, parameter: Scalar, order: int) -> Derivatives:
        """Return the point and its derivatives over the angle, before it is turned and shifted.

        Parameters
        ----------
        parameter
            φ [rad].
        order
            Highest derivative, >= 0.
        """
        mean = 0.5 * (self.outer_radius + self.inner_radius)
        quarter = 0.25 * (self.outer_radius - self.inner_radius)
        x, y = jnp.eye(2)
        # the product of the radius and the direction, as a sum of three turning arms
        return (
            harmonic(mean * x, mean * y, 1.0, parameter, order)
            + harmonic(quarter * x, quarter * y, 1.0 + self.points, parameter, order)
            + harmonic(quarter * x, -quarter * y, self.points - 1.0, parameter, order)
        )
