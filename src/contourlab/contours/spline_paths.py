"""Bézier curves as a path, with lines where a curve is straight but its parameter stands still."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.bezier_rows import bezier_rows
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

__all__ = ["path_of_pieces", "straight_rows"]

_STRAIGHT = 1e-14
"""How far from its chord a straight curve's control points are, as a fraction of the chord."""

Rows = NDArray[Any]


def straight_rows(rows: Rows) -> NDArray[np.bool_]:
    """Return which Bézier curves run straight from first to last control point, never backwards.

    Parameters
    ----------
    rows
        Homogeneous control points, shape (n_curves, degree + 1, n_axes + 1).
    """
    points = rows[..., :-1] / rows[..., -1:]
    chord = points[:, -1] - points[:, 0]
    length = np.linalg.norm(chord, axis=1)
    direction = chord / np.where(length > 0.0, length, 1.0)[:, None]
    offset = points - points[:, :1]
    along = np.einsum("ijk,ik->ij", offset, direction)
    beside = np.linalg.norm(offset - along[..., None] * direction[:, None], axis=2)
    # coordinates are rounded to this
    size = _STRAIGHT * length + 4e-16 * np.max(np.abs(points), axis=(1, 2))
    forwards = np.min(np.diff(along, axis=1), axis=1) >= -size
    return (length > 0.0) & (np.max(beside, axis=1) <= size) & forwards  # type: ignore[no-any-return]


def path_of_pieces(
    rows: Rows, spans: Sequence[tuple[float, float]], *, closed: bool = False
) -> Path:
    """Return Bézier curves end to end as a path.

    Parameters
    ----------
    rows
        Homogeneous control points, shape (n_curves, degree + 1, n_axes + 1).
    spans
        First and last parameter of each curve, for messages.
    closed
        Whether the end is the start.

    Raises
    ------
    GeometryError
        A curve that stands still (a cusp), with its parameters.
    """
    points = rows[..., :-1] / rows[..., -1:]
    if rows.shape[1] == 2:
        corners = np.concatenate([points[:1, 0], points[:, 1]])
        if closed:
            corners[-1] = corners[0]
        return Path.polyline(corners, closed=closed)
    try:
        return Path.from_bezier(points, rows[..., -1], closed=closed)
    except GeometryError:
        straight = straight_rows(rows)
        if straight.any():
            return _mixed(rows, straight, spans, closed)
        raise _named(rows, spans) from None


def _mixed(
    rows: Rows, straight: NDArray[np.bool_], spans: Sequence[tuple[float, float]], closed: bool
) -> Path:
    paths = []
    for line, group in groupby(range(len(rows)), key=lambda k: bool(straight[k])):
        at = np.array(list(group))
        points = rows[at, :, :-1] / rows[at, :, -1:]
        if line:
            paths.append(Path.polyline(np.concatenate([points[:1, 0], points[:, -1]])))
            continue
        try:
            paths.append(Path.from_bezier(points, rows[at, :, -1]))
        except GeometryError:
            raise _named(rows[at], [spans[k] for k in at]) from None
    return Path.join(paths, closed=closed)


def _named(rows: Rows, spans: Sequence[tuple[float, float]]) -> GeometryError:
    """Return the error of the first curve that cannot be part of a path."""
    for row, (start, end) in zip(rows, spans, strict=True):
        try:
            bezier_rows(row[None])
        except GeometryError as error:
            reason = str(error).partition("0 ")[2] or str(error)
            return GeometryError(f"between the knots {start:g} and {end:g} the curve {reason}")
    return GeometryError("the pieces of the spline do not meet")
