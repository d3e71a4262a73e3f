"""A straight line between two points, in any number of axes."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.base import ClosedFormContour, left_normal
from contourlab.contours.level import Level
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["Line"]


class Line(ClosedFormContour):
    """A straight line; the parameter is arc length [m], 0 at the start.

    Beyond its ends the line goes on.

    Parameters
    ----------
    start, end
        The end points, shape (n_axes,) with one axis or more [m].

    Raises
    ------
    GeometryError
        The points are equal, or have different numbers of axes.
    ConfigurationError
        A coordinate is not finite.
    """

    start: Float[Array, "... n_axes"] = real(unit="m", ndim=1)
    end: Float[Array, "... n_axes_of_end"] = real(unit="m", ndim=1)

    def check(self) -> None:
        """Raise GeometryError unless the points are two different ones of the same space."""
        start, end = np.asarray(self.start), np.asarray(self.end)
        if start.ndim == 0 or end.ndim == 0 or start.shape[-1] != end.shape[-1]:
            raise GeometryError(
                "start and end must be points with the same number of axes, "
                f"got shapes {start.shape} and {end.shape}"
            )
        if not np.all(np.linalg.norm(end - start, axis=-1) > 0.0):
            raise GeometryError("a line needs a length > 0 m: start and end are the same point")

    @property
    def n_axes(self) -> int:
        """Number of coordinates."""
        return int(self.start.shape[-1])

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Start and end of the parameter: 0 and the length [m]."""
        return 0.0, self.length

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    @property
    def length(self) -> Scalar:
        """Length [m]."""
        step = jnp.asarray(self.end) - jnp.asarray(self.start)
        return jnp.sqrt(step @ step)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m]: their difference.

        Parameters
        ----------
        start, end
            Parameters [m].
        """
        return end - start

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over arc length, in closed form.

        Parameters
        ----------
        parameter
            Arc length from the start [m].
        order
            Highest derivative, >= 0.
        piece
            Not needed.

        Returns
        -------
        Derivatives
            Shape (order + 1, n_axes) [m^(1-k)].
        """
        del piece
        if order < 0:
            raise GeometryError(f"order must be >= 0, got {order}")
        start = jnp.asarray(self.start)
        tangent = (jnp.asarray(self.end) - start) / self.length
        rows = [start + tangent * parameter, tangent]
        rows += [jnp.zeros_like(tangent)] * (order - 1)
        return jnp.stack(rows[: order + 1])

    @property
    def has_level(self) -> bool:
        """Whether the line is planar."""
        return self.n_axes == 2

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the distance from the endless line [m], > 0 on its right, and its derivatives.

        Parameters
        ----------
        position
            Shape (2,) [m].

        Raises
        ------
        GeometryError
            The line is not planar.
        """
        if self.n_axes != 2:
            raise GeometryError("only a planar line has an implicit form")
        start = jnp.asarray(self.start)
        right = -left_normal((jnp.asarray(self.end) - start) / self.length)
        return Level(right @ (jnp.asarray(position) - start), right, jnp.zeros((2, 2)))
