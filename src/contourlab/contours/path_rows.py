"""The arrays of a path: put together and checked on the host."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.bezier_rows import elevated, end_derivatives
from contourlab.contours.helical import check_helical, helical_end_points
from contourlab.errors import GeometryError

if TYPE_CHECKING:
    from contourlab.contours.path import Path

__all__ = ["JOIN_TOLERANCE", "joined_fields", "path_fields", "positive_lengths"]

JOIN_TOLERANCE = 1e-9
"""Pieces must meet within this fraction of the largest coordinate, or 1 nm."""

Rows = NDArray[Any]


def positive_lengths(length: Rows) -> None:
    """Raise GeometryError unless every piece has a length.

    Parameters
    ----------
    length
        Shape (n_pieces,) [m].
    """
    if not np.isfinite(length).all():
        raise GeometryError(f"piece {int(np.argmin(np.isfinite(length)))} is not finite")
    if not (length > 0).all():
        at = int(np.argmin(length > 0))
        raise GeometryError(f"piece {at} must have a length > 0 m, got {length[at]:g}")


def path_fields(
    start: Any, u: Any, v: Any, w: Any, rate: Any, length: Any, bezier_row: Any,
    control: Any, inverse: Any, source_line: Any, closed: bool,
) -> dict[str, Any]:  # fmt: skip
    """Return the checked fields of a path.

    Parameters
    ----------
    start, u, v, w, rate
        Origins, vectors and angle rates of the helical formula, one row for each piece.
    length
        Arc lengths [m].
    bezier_row, control, inverse
        Row of the Bézier tables or -1 for each piece; the tables.
    source_line
        Lines, or None if unknown.
    closed
        Whether the end is the start.

    Raises
    ------
    GeometryError
        Not finite, a length of 0, pieces that do not meet, or vectors that are no directions.
    """
    n, shape = len(start), start.shape
    if start.ndim != 2 or shape[1] == 0:
        raise GeometryError(f"start must have shape (n_pieces, n_axes), got {shape}")
    if source_line is None:
        source_line = np.zeros(n, np.int32)
    for name, value, wanted in (
        ("tangent_vector", u, shape), ("normal_vector", v, shape), ("axial_vector", w, shape),
        ("angle_rate", rate, (n,)), ("length", length, (n,)), ("source_line", source_line, (n,)),
    ):  # fmt: skip
        if np.shape(value) != wanted:
            raise GeometryError(f"{name} must have shape {wanted}, got {np.shape(value)}")
    if n == 0:
        raise GeometryError("a path needs one piece or more")
    for name, value in (("start", start), ("tangent_vector", u), ("normal_vector", v),
                        ("axial_vector", w), ("angle_rate", rate)):  # fmt: skip
        if not np.isfinite(value).all():
            raise GeometryError(f"{name} must be finite")
    positive_lengths(length)
    helical = np.asarray(bezier_row) < 0
    check_helical(u[helical], v[helical], w[helical], rate[helical])
    end = helical_end_points(start, u, v, w, rate, length)
    if not helical.all():
        end[~helical] = end_derivatives(control[bezier_row[~helical]], at_end=True)[0]
    following = np.concatenate([start[1:], start[:1]]) if closed else start[1:]
    gap = np.linalg.norm(end[: len(following)] - following, axis=1)
    size = max(float(np.max(np.abs(start))), float(np.max(np.abs(end))))
    if len(gap) and gap.max() > max(JOIN_TOLERANCE * size, 1e-9):
        at = int(np.argmax(gap))
        raise GeometryError(f"piece {at} ends {gap[at]:.3g} m away from the start of the next")
    breaks = np.concatenate([[0.0], np.cumsum(length)])
    lost = np.diff(breaks) <= 0.0
    if lost.any():
        raise GeometryError(
            f"piece {int(np.argmax(lost))} is too short for the path: {length[lost][0]:.3g} m of "
            f"{breaks[-1]:.3g} m is below rounding"
        )
    return {
        "breaks": breaks,
        "origin": start,
        "tangent_vector": u,
        "normal_vector": v,
        "axial_vector": w,
        "angle_rate": rate,
        "bezier_row": np.asarray(bezier_row),
        "control_points": control,
        "inverse_length": inverse,
        "source_line": np.asarray(source_line, np.int32),
        "kinds": "helical" if helical.all() else "mixed" if helical.any() else "bezier",
        "is_closed": closed,
    }


def joined_fields(paths: Sequence[Path], closed: bool) -> dict[str, Any]:
    """Return the fields of several paths end to end.

    Parameters
    ----------
    paths
        Each begins where the one before ends.
    closed
        Whether the end of the last is the start of the first.

    Raises
    ------
    GeometryError
        None given, different numbers of axes, or ends that do not meet.
    """
    if not paths:
        raise GeometryError("a path needs one piece or more")
    if len({path.n_axes for path in paths}) > 1:
        raise GeometryError("the paths have different numbers of axes")
    degree = max(p.control_points.shape[1] for p in paths)
    width = max(p.inverse_length.shape[1] for p in paths)
    rows = [elevated(np.asarray(p.control_points), degree) for p in paths]
    inverse = [
        np.pad(np.asarray(p.inverse_length), ((0, 0), (0, width - p.inverse_length.shape[1])))
        for p in paths
    ]
    offset, bezier_row = 0, []
    for path in paths:
        own = np.asarray(path.bezier_row)
        bezier_row.append(np.where(own >= 0, own + offset, -1))
        offset += len(path.control_points)
    return path_fields(
        np.concatenate([p.origin for p in paths]),
        np.concatenate([p.tangent_vector for p in paths]),
        np.concatenate([p.normal_vector for p in paths]),
        np.concatenate([p.axial_vector for p in paths]),
        np.concatenate([p.angle_rate for p in paths]),
        np.concatenate([np.diff(p.breaks) for p in paths]),
        np.concatenate(bezier_row).astype(np.int32),
        np.concatenate(rows),
        np.concatenate(inverse),
        np.concatenate([p.source_line for p in paths]),
        closed,
    )
