"""A stretch of a part as a part of its own: some lines of the program, or what lies in a plane.

Pieces are only left out at the ends, so that the contour stays connected; where that cannot be done
the lines between which it breaks are named.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.contours.path_rows import path_fields
from contourlab.errors import ConfigurationError, PartError

__all__ = ["IN_PLANE", "restricted_part"]

IN_PLANE = 1e-9
"""A piece lies in a plane when the other coordinate changes by no more than this [m]."""

_SHOWN = 8


def restricted_part(
    part: Part, *, lines: tuple[int, int] | None, plane: str | None, feed_only: bool
) -> Part:
    """Return the part made of some consecutive pieces of another one.

    Parameters
    ----------
    part
        The whole.
    lines, plane, feed_only
        As in :meth:`Part.restricted`.

    Raises
    ------
    PartError
        Nothing is left, or pieces that are not connected.
    ConfigurationError
        An option that is not allowed.
    """
    kept = np.ones(part.n_pieces, bool)
    if lines is not None:
        first, last = _checked_lines(part, lines)
        kept &= (part.source_line >= first) & (part.source_line <= last)
        if not kept.any():
            raise PartError(f"{part.source}: lines {first} to {last} move nothing")
    columns = list(range(len(part.axes)))
    if plane is not None:
        columns = _checked_plane(part, plane)
        for axis in set(range(len(part.axes))) - set(columns):
            kept &= _extent(part.path, axis) <= IN_PLANE
    runs = _runs(kept)
    if plane is not None:
        runs = [run for run in runs if not part.rapid[run[0] : run[1]].all()]
    if feed_only:
        runs = [run for run in (_trimmed(part, *run) for run in runs) if run[0] < run[1]]
    if not runs:
        what = "of the pieces asked for " if lines is not None else ""
        where = f"cuts in the plane {plane}" if plane is not None else "cuts"
        raise PartError(f"{part.source}: nothing {what}{where}")
    if len(runs) > 1:
        named = [f"{part.source_line[a]} to {part.source_line[b - 1]}" for a, b in runs[:_SHOWN]]
        more = f" and {len(runs) - _SHOWN} more" if len(runs) > _SHOWN else ""
        raise PartError(
            f"{part.source}: the pieces form {len(runs)} separate stretches, in lines "
            f"{', '.join(named)}{more}; choose one with lines=(first, last)"
        )
    return _stretch(part, *runs[0], columns)


def _checked_lines(part: Part, lines: tuple[int, int]) -> tuple[int, int]:
    try:
        first, last = (int(line) for line in lines)
    except (TypeError, ValueError):
        first, last = 1, 0
    if not 1 <= first <= last:
        raise ConfigurationError(
            f"lines must be the first and the last line, 1 <= first <= last, got {lines!r}"
        )
    return first, last


def _checked_plane(part: Part, plane: str) -> list[int]:
    names = list(plane) if isinstance(plane, str) else []
    if len(names) != 2 or len(set(names)) != 2 or not set(names) <= set(part.axes):
        raise ConfigurationError(
            f"plane must name two different ones of the part's axes {', '.join(part.axes)}, "
            f"such as {''.join(part.axes[:2])}, got {plane!r}"
        )
    return [part.axes.index(name) for name in names]


def _extent(path: Path, axis: int) -> NDArray[Any]:
    """Return a bound on how far each piece moves in one coordinate [m]."""
    length = np.diff(np.asarray(path.breaks))
    slope = sum(
        np.abs(np.asarray(vector)[:, axis])
        for vector in (path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    extent = np.asarray(slope * length, float)
    rows = np.asarray(path.bezier_row)
    curved = rows >= 0
    if curved.any():
        control = np.asarray(path.control_points)[rows[curved]]
        extent[curved] = np.ptp(control[:, :, axis] / control[:, :, -1], axis=1)
    return extent


def _runs(kept: NDArray[Any]) -> list[tuple[int, int]]:
    """Return first and one past the last of every row of neighbours that are kept."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], kept.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _trimmed(part: Part, first: int, end: int) -> tuple[int, int]:
    cutting = np.flatnonzero(~part.rapid[first:end])
    if not len(cutting):
        return first, first
    return first + int(cutting[0]), first + int(cutting[-1]) + 1


def _stretch(part: Part, first: int, end: int, columns: list[int]) -> Part:
    path, at = part.path, slice(first, end)
    rows = np.asarray(path.bezier_row)[at]
    curved = rows >= 0
    if curved.any():
        control = np.asarray(path.control_points)[rows[curved]][..., [*columns, -1]]
        inverse = np.asarray(path.inverse_length)[rows[curved]]
    else:
        control, inverse = np.zeros((0, 2, len(columns) + 1)), np.zeros((0, 1))
    numbers = np.full(end - first, -1, np.int32)
    numbers[curved] = np.arange(int(curved.sum()), dtype=np.int32)
    start, u, v, w = (
        np.asarray(vector)[at][:, columns]
        for vector in (path.origin, path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    length = np.diff(np.asarray(path.breaks))[at]
    fields = path_fields(
        start, u, v, w, np.asarray(path.angle_rate)[at], length, numbers, control, inverse,
        part.source_line[at], False,
    )  # fmt: skip
    arrays = {
        name: getattr(part, name)[at]
        for name in ("source_line", "feed", "rapid", "blend", "merge", "dwell", "file", "file_line")
    }
    return replace(
        part,
        path=Path(**fields),
        axes=tuple(part.axes[k] for k in columns),
        dwell_before=part.dwell_before if first == 0 else 0.0,
        **arrays,
    )
