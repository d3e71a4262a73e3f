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

from contourlab.configuration import is_concrete
from contourlab.contours.base import Contour, unit
from contourlab.contours.path import Path
from contourlab.contours.transformed_path import (
    affine_path,
    reversed_path,
    similar_path,
    stretch_of_path,
)
from contourlab.contours.wrapped import Reversed, Stretch, Transformed, similarity_factor
from contourlab.errors import GeometryError
from contourlab.typing import Array

__all__ = [
    "between",
    "reversed_contour",
    "rotated",
    "scaled",
    "translated",
]


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
            return similar_path(contour, matrix, offset, similarity_factor(matrix))
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
