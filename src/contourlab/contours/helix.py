"""A circular helix in space."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.base import ClosedFormContour, unit
from contourlab.contours.circle import TURN, check_direction, plane_axes, turning
from contourlab.errors import GeometryError
from contourlab.typing import Array, Count, Derivatives, Scalar

__all__ = ["Helix"]


class Helix(ClosedFormContour):
    """A helix round an axis; the parameter is the angle turned [rad], 0 to 2π turns.

    It starts at ``center + radius e``, with e the first of
    :func:`~contourlab.contours.circle.plane_axes` of its axis (x for the axis z), turns
    counter-clockwise as seen from the tip of the axis, and climbs along the axis. Its curvature is
    r / (r² + c²) and its torsion c / (r² + c²), with r the radius and c = pitch / 2π.

    Parameters
    ----------
    radius
        > 0 [m].
    pitch
        Climb along the axis in one turn [m]: > 0 right-handed, < 0 left-handed.
    turns
        How many, > 0; any real number.
    center
        Foot of the axis, shape (3,) [m].
    axis
        Direction, shape (3,), of any length.

    Raises
    ------
    GeometryError
        A centre or axis that is not of 3 coordinates; an axis of zero length.
    ConfigurationError
        A radius or number of turns that is not > 0; a number that is not finite.
    """

    radius: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    pitch: Float[Array, " ..."] = real(unit="m", ndim=0)
    turns: Float[Array, " ..."] = real(above=0.0, ndim=0)
    center: Float[Array, "... n_axes"] = real(unit="m", ndim=1, default=(0.0, 0.0, 0.0))
    axis: Float[Array, "... n_axes_of_axis"] = real(ndim=1, default=(0.0, 0.0, 1.0))

    def check(self) -> None:
        """Raise GeometryError unless centre and axis are of three coordinates."""
        if self.center.ndim == 0 or self.center.shape[-1] != 3:
            raise GeometryError(f"center must have 3 coordinates, got shape {self.center.shape}")
        check_direction("axis", self.axis)

    @property
    def n_axes(self) -> int:
        """3."""
        return 3

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and 2π turns [rad]."""
        return 0.0, TURN * self.turns

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m], in closed form.

        Parameters
        ----------
        start, end
            Parameters [rad].
        """
        return jnp.hypot(self.radius, self.pitch / TURN) * (end - start)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the angle, in closed form.

        Parameters
        ----------
        parameter
            Angle from the start [rad].
        order
            Highest derivative, >= 0.
        piece
            Not needed.

        Returns
        -------
        Derivatives
            Shape (order + 1, 3) [m/rad^k].
        """
        del piece
        x, y = plane_axes(self.axis)
        climb = unit(jnp.asarray(self.axis)) * (self.pitch / TURN)
        rows = turning(self.radius * x, self.radius * y, parameter, order)
        rows[0] = self.center + rows[0] + climb * parameter
        if order >= 1:
            rows[1] = rows[1] + climb
        return jnp.stack(rows)
