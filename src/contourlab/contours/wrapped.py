"""Contours that wrap another one: transformed, reversed, a stretch of it; exact derivatives.

Made by :mod:`contourlab.contours.transformations`.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contours.base import Contour
from contourlab.contours.level import Level, transformed_level
from contourlab.contours.placed import first_row
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = ["Reversed", "Stretch", "Transformed", "WrappedContour"]


def by_component(rows: Array, matrix: Array) -> Array:
    """Return ``rows @ matrix.T``, by component: XLA makes one loop of it over a batch.

    Parameters
    ----------
    rows
        Shape (n, n_in).
    matrix
        Shape (n_out, n_in).
    """
    columns: list[Array] = [rows[:, k : k + 1] * matrix[:, k] for k in range(rows.shape[1])]
    return sum(columns[1:], columns[0])


def similarity_factor(matrix: Array) -> Scalar:
    """Return the factor by which a similarity changes lengths.

    Parameters
    ----------
    matrix
        A rotation or reflection times a factor, shape (n_axes, n_axes).
    """
    matrix = jnp.asarray(matrix)
    return jnp.sqrt(jnp.sum(matrix * matrix) / matrix.shape[-1])


class WrappedContour(Contour):
    """A contour made of another one, over the same parameter; by itself the same as that."""

    inner: Contour = part()

    @property
    def n_axes(self) -> int:
        """Of the other contour."""
        return self.inner.n_axes

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Of the other contour."""
        return self.inner.domain

    @property
    def closed(self) -> bool:
        """Whether the other contour is."""
        return self.inner.closed

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            One scalar.
        piece
            As from ``locate``.
        """
        return self.inner.position(parameter, piece)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0; static.
        piece
            As from ``locate``.
        """
        return self.inner.derivatives(parameter, order, piece)

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the piece of the other contour that holds a parameter.

        Parameters
        ----------
        parameter
            One scalar.
        piece
            Where to start, int32.
        """
        return self.inner.locate(parameter, piece)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m].

        Parameters
        ----------
        start, end
            Parameters.
        """
        return self.inner.arc_length(start, end)

    @property
    def has_level(self) -> bool:
        """Whether the other contour has one."""
        return self.inner.has_level

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the other contour's implicit form and its derivatives.

        Parameters
        ----------
        position
            Shape (2,) [m].
        """
        return self.inner.level_derivatives(position)


class Transformed(WrappedContour):
    """Another contour after ``x -> matrix x + offset``, over the same parameter.

    Made by :meth:`Contour.translated`, :meth:`Contour.rotated` and :meth:`Contour.scaled`.
    """

    matrix: Float[Array, "n_axes n_axes_"] = real(ndim=2)
    offset: Float[Array, " n_axes"] = real(unit="m", ndim=1)
    similarity: bool = static(flag=True)
    """Whether the matrix is known to be a rotation or reflection times a factor."""

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            One scalar.
        piece
            As from ``locate``.
        """
        return self.derivatives(parameter, 0, piece)[0]

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0; static.
        piece
            As from ``locate``.
        """
        rows, matrix = self.inner.derivatives(parameter, order, piece), jnp.asarray(self.matrix)
        return by_component(rows, matrix) + first_row(order) * self.offset

    def wrap(self, parameter: Scalar) -> Scalar:
        """Return the parameter inside the domain.

        Parameters
        ----------
        parameter
            One scalar.
        """
        return self.inner.wrap(parameter)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m].

        Under a similarity that of the other contour times the factor, else by quadrature.

        Parameters
        ----------
        start, end
            Parameters.
        """
        if not self.similarity:
            return Contour.arc_length(self, start, end)
        return similarity_factor(self.matrix) * self.inner.arc_length(start, end)

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the other contour's implicit form at the position taken back, and its derivatives.

        Parameters
        ----------
        position
            Shape (2,) [m].
        """
        (a, b), (c, d) = jnp.asarray(self.matrix)
        determinant = a * d - b * c
        inverse = jnp.stack([jnp.stack([d, -b]), jnp.stack([-c, a])]) / determinant
        level = self.inner.level_derivatives(inverse @ (jnp.asarray(position) - self.offset))
        return transformed_level(level, inverse, jnp.sign(determinant))


class Reversed(WrappedContour):
    """Another contour run from its end to its start, over the same domain.

    Made by :meth:`Contour.reversed`. At a kink in the other contour the derivatives are left-sided;
    a path is reversed piece by piece instead, and stays right-sided.
    """

    def _mirrored(self, parameter: Scalar) -> Scalar:
        start, end = self.inner.domain
        return start + (end - parameter)

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            One scalar.
        piece
            As from ``locate``.
        """
        return self.inner.position(self._mirrored(parameter), piece)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter.

        Parameters
        ----------
        parameter
            One scalar.
        order
            Highest derivative, >= 0; static.
        piece
            As from ``locate``.
        """
        rows = self.inner.derivatives(self._mirrored(parameter), order, piece)
        return rows * jnp.asarray((-1.0) ** np.arange(order + 1))[:, None]

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the piece of the other contour that holds a parameter.

        Parameters
        ----------
        parameter
            One scalar.
        piece
            Where to start, int32.
        """
        return self.inner.locate(self._mirrored(parameter), piece)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m].

        Parameters
        ----------
        start, end
            Parameters.
        """
        return self.inner.arc_length(self._mirrored(end), self._mirrored(start))

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the other contour's implicit form with the other sign, and its derivatives.

        Parameters
        ----------
        position
            Shape (2,) [m].
        """
        return transformed_level(self.inner.level_derivatives(position), jnp.eye(2), -1.0)


class Stretch(WrappedContour):
    """A stretch of another contour, open, over the same parameter.

    Made by :meth:`Contour.between`.
    """

    start: Float[Array, " ..."] = real(ndim=0)
    end: Float[Array, " ..."] = real(ndim=0)

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Start and end of the stretch."""
        return self.start, self.end

    @property
    def closed(self) -> bool:
        """Never."""
        return False
