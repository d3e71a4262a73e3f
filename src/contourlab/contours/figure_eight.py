"""A figure of eight in the plane.

References
----------
.. [MengLouZhou] the second contour of the experiments, x = 0.03 (1 - cos ωt), y = 0.03 sin 2ωt.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.circle import TURN
from contourlab.contours.placed import PlacedContour, harmonic
from contourlab.errors import GeometryError
from contourlab.typing import Array, Derivatives, Scalar

__all__ = ["FigureEight"]


class FigureEight(PlacedContour):
    """A figure of eight; the parameter is an angle φ [rad], 0 to 2π, and goes round.

    Before it is turned and shifted, x = -a cos(φ + φ0), y = b sin 2(φ + φ0): it starts at the left
    end, going up, turns right in the left half and left in the right half, and crosses itself in
    its centre at φ + φ0 = π/2 and 3π/2, where its curvature is 0. The published one has
    ``half_sizes=(0.03, 0.03)`` and ``center=(0.03, 0.0)``. The one written x = a sin φ,
    y = b sin 2φ starts in the crossing: ``rotation=π``, ``start_angle=-π/2``.

    Parameters
    ----------
    half_sizes
        a and b, half of its extents in its own x and y, shape (2,), > 0 [m].
    start_angle
        φ0, which point is the start [rad].
    center
        The crossing, shape (2,) [m].
    rotation
        Angle from the x axis to the line through both lobes [rad].

    Raises
    ------
    GeometryError
        Half sizes or a centre that are not of 2 coordinates.
    ConfigurationError
        A half size that is not > 0; a number that is not finite.
    """

    half_sizes: Float[Array, "... n_half_sizes"] = real(unit="m", above=0.0, ndim=1)
    start_angle: Float[Array, " ..."] = real(unit="rad", ndim=0, default=0.0)

    def check(self) -> None:
        """Raise GeometryError unless the curve is in the plane."""
        super().check()
        if np.ndim(self.half_sizes) == 0 or self.half_sizes.shape[-1] != 2:
            raise GeometryError(
                f"half_sizes must have 2 coordinates, got shape {self.half_sizes.shape}"
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
        x, y = jnp.eye(2) * jnp.asarray(self.half_sizes)[:, None]
        angle = parameter + self.start_angle
        return harmonic(-x, 0.0 * x, 1.0, angle, order) + harmonic(0.0 * y, y, 2.0, angle, order)
