"""A contour of the tool, made by more axes than it has coordinates: a stage and a scanner on it.

The path is given in the space of the axes, and the tool point is a linear combination of them,
``tool = matrix @ axes``, over the same parameter. Redundant axes leave open how they share the
motion; the path in axes is where it is decided.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from contourlab.configuration import as_leaf, part, real
from contourlab.contours.base import Contour
from contourlab.contours.wrapped import by_component
from contourlab.errors import GeometryError
from contourlab.typing import AxisVector, Count, Derivatives, Matrix, Scalar

__all__ = ["CombinedAxes", "combined"]


class CombinedAxes(Contour):
    """The tool's path of several axes; made by :func:`combined`."""

    axes: Contour = part()
    """The path in the space of the axes."""
    matrix: Matrix = real(ndim=2)
    """From axes to tool, shape (n_coordinates, n_axes of the path)."""

    @property
    def n_axes(self) -> int:
        """Number of coordinates of the tool."""
        return int(np.shape(self.matrix)[0])

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Of the path in axes."""
        return self.axes.domain

    @property
    def closed(self) -> bool:
        """Whether the path in axes is."""
        return self.axes.closed

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the tool point at one parameter, shape (n_coordinates,) [m].

        Parameters
        ----------
        parameter
            One scalar.
        piece
            As from ``locate``.
        """
        return self.derivatives(parameter, 0, piece)[0]

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the tool point and its derivatives over the parameter.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0; static.
        piece
            As from ``locate``.
        """
        rows = self.axes.derivatives(parameter, order, piece)
        return by_component(rows, jnp.asarray(self.matrix))

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the piece of the path in axes that holds a parameter.

        Parameters
        ----------
        parameter, piece
            As of the path in axes.
        """
        return self.axes.locate(parameter, piece)


def combined(axes: Contour, matrix: Any) -> CombinedAxes:
    """Return the path of a tool at ``matrix @ axes``.

    Parameters
    ----------
    axes
        The path in the space of the axes.
    matrix
        Shape (n_coordinates, axes.n_axes); that of the machine's ``LinearTool``.

    Raises
    ------
    GeometryError
        A matrix of another shape.
    """
    leaf = as_leaf(matrix)
    if np.ndim(leaf) != 2 or np.shape(leaf)[1] != axes.n_axes:
        raise GeometryError(
            f"matrix must have one column for each of the {axes.n_axes} axes, "
            f"got shape {np.shape(leaf)}"
        )
    return CombinedAxes(axes=axes, matrix=leaf)
