"""Contours turned, shifted, scaled, reversed, and stretches of them, with exact derivatives.

A contour is wrapped; wrappers of wrappers are merged. A :class:`Path` gives a path again, so that
foot points and feed plans stay as fast: under a similarity its rows are transformed exactly, and
under an affine transformation arcs become rational Bézier pieces, which are exact too.

The functions are the contour's methods: ``contour.rotated(angle)``.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, part, real, static
from contourlab.contours.base import Contour, unit
from contourlab.contours.level import Level, transformed_level
from contourlab.contours.path import Path
from contourlab.contours.placed import first_row
from contourlab.contours.transformed_path import (
    affine_path,
    reversed_path,
    similar_path,
    stretch_of_path,
)
from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Count, Derivatives, Scalar

__all__ = [
    "Reversed",
    "Stretch",
    "Transformed",
    "between",
    "reversed_contour",
    "rotated",
    "scaled",
    "translated",
]


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


class Transformed(Contour):
    """Another contour after ``x -> matrix x + offset``, over the same parameter.

    Made by :meth:`Contour.translated`, :meth:`Contour.rotated` and :meth:`Contour.scaled`.
    """

    inner: Contour = part()
    matrix: Float[Array, "n_axes n_axes_"] = real(ndim=2)
    offset: Float[Array, " n_axes"] = real(unit="m", ndim=1)
    similarity: bool = static(flag=True)
    """Whether the matrix is known to be a rotation or reflection times a factor."""

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

    def locate(self, parameter: Scalar, piece: Count) -> Count:
        """Return the piece of the other contour that holds a parameter.

        Parameters
        ----------
        parameter, piece
            As of the other contour.
        """
        return self.inner.locate(parameter, piece)

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
            return super().arc_length(start, end)
        return _factor(self.matrix) * self.inner.arc_length(start, end)

    @property
    def has_level(self) -> bool:
        """Whether the other contour has one."""
        return self.inner.has_level

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


class Reversed(Contour):
    """Another contour run from its end to its start, over the same domain.

    Made by :meth:`Contour.reversed`. At a kink in the other contour the derivatives are left-sided;
    a path is reversed piece by piece instead, and stays right-sided.
    """

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

    @property
    def has_level(self) -> bool:
        """Whether the other contour has one."""
        return self.inner.has_level

    def level_derivatives(self, position: AxisVector) -> Level:
        """Return the other contour's implicit form with the other sign, and its derivatives.

        Parameters
        ----------
        position
            Shape (2,) [m].
        """
        return transformed_level(self.inner.level_derivatives(position), jnp.eye(2), -1.0)


class Stretch(Contour):
    """A stretch of another contour, open, over the same parameter.

    Made by :meth:`Contour.between`.
    """

    inner: Contour = part()
    start: Float[Array, " ..."] = real(ndim=0)
    end: Float[Array, " ..."] = real(ndim=0)

    @property
    def n_axes(self) -> int:
        """Of the other contour."""
        return self.inner.n_axes

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """Start and end of the stretch."""
        return self.start, self.end

    @property
    def closed(self) -> bool:
        """Never."""
        return False

    def position(self, parameter: Scalar, piece: Count | None = None) -> AxisVector:
        """Return the point at one parameter, shape (n_axes,) [m].

        Parameters
        ----------
        parameter
            Of the other contour.
        piece
            As from ``locate``.
        """
        return self.inner.position(parameter, piece)

    def derivatives(self, parameter: Scalar, order: int, piece: Count | None = None) -> Derivatives:
        """Return the point and its derivatives over the parameter.

        Parameters
        ----------
        parameter
            Of the other contour.
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


def translated(contour: Contour, offset: Any) -> Contour:
    """Return a contour shifted; see :meth:`Contour.translated`.

    Parameters
    ----------
    contour
        Any.
    offset
        Shape (n_axes,) [m].

    Raises
    ------
    GeometryError
        An offset of another shape, or not finite.
    """
    shift = _point(contour, "offset", offset)
    return _transformed(contour, np.eye(contour.n_axes), shift, similarity=True)


def rotated(contour: Contour, angle: Any, *, axis: Any = None, center: Any = None) -> Contour:
    """Return a contour turned; see :meth:`Contour.rotated`.

    Parameters
    ----------
    contour
        Any with 2 or 3 axes.
    angle
        [rad].
    axis
        In space.
    center
        Point that stays [m].

    Raises
    ------
    GeometryError
        An axis that is missing, superfluous or zero; a contour of neither 2 nor 3 axes.
    """
    angle = _finite("angle", angle)
    if angle.ndim:
        raise GeometryError(f"angle must be one number, got shape {angle.shape}")
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    if contour.n_axes == 2:
        if axis is not None:
            raise GeometryError("axis is for contours in space: this one has 2 axes")
        matrix = jnp.stack([jnp.stack([cosine, -sine]), jnp.stack([sine, cosine])])
    elif contour.n_axes == 3:
        if axis is None:
            raise GeometryError("a contour in space needs axis=(x, y, z) to be turned about")
        vector = _point(contour, "axis", axis)
        if is_concrete(vector) and not np.linalg.norm(vector) > 0.0:
            raise GeometryError("axis must not be the zero vector")
        direction = unit(jnp.asarray(vector))
        across = jnp.stack([jnp.cross(direction, column) for column in jnp.eye(3)], axis=1)
        along = direction[:, None] * direction
        matrix = cosine * jnp.eye(3) + sine * across + (1.0 - cosine) * along
    else:
        raise GeometryError(
            f"only a contour of 2 or 3 axes can be turned, this one has {contour.n_axes}"
        )
    return _about(contour, matrix, center, similarity=True)


def scaled(contour: Contour, factor: Any, *, center: Any = None) -> Contour:
    """Return a contour scaled; see :meth:`Contour.scaled`.

    Parameters
    ----------
    contour
        Any.
    factor
        One number, or one for each axis, none 0.
    center
        Point that stays [m].

    Raises
    ------
    GeometryError
        A factor of 0, not finite or of another shape; a path with helices scaled by different
        factors.
    """
    factor = _finite("factor", factor)
    if factor.shape not in ((), (contour.n_axes,)):
        raise GeometryError(
            f"factor must be one number or {contour.n_axes}, got shape {factor.shape}"
        )
    if is_concrete(factor) and not np.all(np.asarray(factor) != 0.0):
        raise GeometryError("factor must not be 0")
    alike = factor.ndim == 0
    if not alike and is_concrete(factor):
        sizes = np.abs(np.asarray(factor))
        alike = bool(np.all(sizes == sizes[0]))
    matrix = jnp.diag(jnp.broadcast_to(jnp.asarray(factor), (contour.n_axes,)))
    return _about(contour, matrix, center, similarity=alike)


def reversed_contour(contour: Contour) -> Contour:
    """Return a contour run from its end to its start; see :meth:`Contour.reversed`.

    Parameters
    ----------
    contour
        Any.
    """
    if isinstance(contour, Path):
        return reversed_path(contour)
    return contour.inner if isinstance(contour, Reversed) else Reversed(inner=contour)


def between(contour: Contour, start: Any, end: Any) -> Contour:
    """Return the stretch between two parameters; see :meth:`Contour.between`.

    Parameters
    ----------
    contour
        Any.
    start, end
        Parameters.

    Raises
    ------
    GeometryError
        Parameters out of order or out of the domain.
    """
    start, end = _finite("start", start), _finite("end", end)
    low, high = contour.domain
    if all(is_concrete(value) for value in (start, end, low, high)):
        first, last = float(low), float(high)
        a, b = float(start), float(end)
        if not a < b:
            raise GeometryError(f"start must be < end, got {a:g} and {b:g}")
        # what is one rounding outside is meant to be the end
        slack = 1e-12 * (abs(first) + abs(last))
        if contour.closed and b - a > last - first + slack:
            raise GeometryError(
                f"start and end must be at most one round ({last - first:g}) apart, got "
                f"{a:g} and {b:g}"
            )
        if not contour.closed and (a < first - slack or b > last + slack):
            raise GeometryError(
                f"start and end must lie in the domain, {first:g} to {last:g}, got {a:g} and {b:g}"
            )
    if isinstance(contour, Path):
        return stretch_of_path(contour, float(start), float(end))
    inner = contour.inner if isinstance(contour, Stretch) else contour
    return Stretch(inner=inner, start=start, end=end)


def _factor(matrix: Array) -> Scalar:
    """Return the factor by which a similarity changes lengths."""
    matrix = jnp.asarray(matrix)
    return jnp.sqrt(jnp.sum(matrix * matrix) / matrix.shape[-1])


def _finite(name: str, value: Any) -> Array:
    values: Array = value if not is_concrete(value) else np.asarray(value, float)
    if is_concrete(values) and not np.isfinite(values).all():
        raise GeometryError(f"{name} must be finite, got {values}")
    return values


def _point(contour: Contour, name: str, value: Any) -> Array:
    values = _finite(name, value)
    if values.shape != (contour.n_axes,):
        raise GeometryError(
            f"{name} must have {contour.n_axes} coordinates, as the contour has axes, "
            f"got shape {values.shape}"
        )
    return values


def _about(contour: Contour, matrix: Array, center: Any, *, similarity: bool) -> Contour:
    """Transform about a point that stays."""
    if center is None:
        return _transformed(contour, matrix, np.zeros(contour.n_axes), similarity=similarity)
    stays = _point(contour, "center", center)
    return _transformed(contour, matrix, stays - matrix @ stays, similarity=similarity)


def _transformed(contour: Contour, matrix: Array, offset: Array, *, similarity: bool) -> Contour:
    if isinstance(contour, Path):
        if similarity:
            return similar_path(contour, matrix, offset, _factor(matrix))
        return affine_path(contour, matrix, offset)
    if isinstance(contour, Transformed):
        offset = jnp.asarray(matrix) @ jnp.asarray(contour.offset) + offset
        matrix = jnp.asarray(matrix) @ jnp.asarray(contour.matrix)
        similarity = similarity and contour.similarity
        contour = contour.inner
    return Transformed(
        inner=contour, matrix=_known(matrix), offset=_known(offset), similarity=similarity
    )


def _known(values: Array) -> Array:
    """Return a NumPy array unless the values are traced."""
    return np.asarray(values) if is_concrete(values) else values
