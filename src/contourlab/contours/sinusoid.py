"""A sinusoid in the plane, with its arc length in closed form."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.circle import TURN
from contourlab.contours.ellipse import elliptic_arc_length
from contourlab.contours.placed import PlacedContour, harmonic
from contourlab.typing import Array, Derivatives, Scalar

__all__ = ["Sinusoid"]


class Sinusoid(PlacedContour):
    """A sine wave; the parameter is x [m], 0 to ``periods wavelength``.

    Before it is turned and shifted, y = amplitude sin(2π x / wavelength + phase).

    Parameters
    ----------
    amplitude
        > 0 [m].
    wavelength
        > 0 [m].
    periods
        How many, > 0; any real number.
    phase
        At x = 0 [rad].
    center
        Where x and y are 0: the start of the middle line, shape (2,) [m].
    rotation
        Angle from the x axis to the middle line [rad].

    Raises
    ------
    GeometryError
        A centre that is not of 2 coordinates.
    ConfigurationError
        An amplitude, wavelength or number of periods that is not > 0; a number that is not finite.
    """

    amplitude: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    wavelength: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    periods: Float[Array, " ..."] = real(above=0.0, ndim=0, default=1.0)
    phase: Float[Array, " ..."] = real(unit="rad", ndim=0, default=0.0)

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and ``periods wavelength`` [m]."""
        return 0.0, self.periods * self.wavelength

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
        rate = TURN / self.wavelength
        along = jnp.stack([parameter, *np.eye(1, max(order, 1))[0]][: order + 1])
        up = harmonic(0.0, self.amplitude, rate, parameter, order, self.phase)
        return jnp.stack([along, up], axis=1)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m], by elliptic integrals: exact to rounding.

        With m the steepest slope, the speed is that of an ellipse of semi-axes 1 and
        sqrt(1 + m²) at the eccentric angle 2π x / wavelength + phase.

        Parameters
        ----------
        start, end
            x [m].
        """
        rate = TURN / self.wavelength
        taller = jnp.sqrt(1.0 + (rate * self.amplitude) ** 2)

        def travelled(x: Scalar) -> Scalar:
            return elliptic_arc_length(1.0, taller, rate * x + self.phase)

        return (travelled(end) - travelled(start)) / rate
