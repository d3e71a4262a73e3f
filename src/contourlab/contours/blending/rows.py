"""The rows of a path in which pieces are shortened and blends stand between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.bezier_rows import SERIES, bezier_rows, elevated
from contourlab.contours.blending.pieces import Pieces
from contourlab.contours.path import Path
from contourlab.contours.path_rows import path_fields

__all__ = ["blended_path"]

Rows = NDArray[Any]


def blended_path(
    path: Path, pieces: Pieces, low: Rows, high: Rows, joint: Rows, control: Rows
) -> tuple[Path, Rows, Rows]:
    """Return the new path, the piece that each row belongs to and the blend that it is, or -1.

    Parameters
    ----------
    path, pieces
        The path.
    low, high
        What is kept of each piece, shape (n_pieces,) [m].
    joint, control
        Joints that are blended, ascending, and the blends' Bézier points (n, 6, n_axes) [m].
    """
    kept = high > low
    whole = (low <= 0.0) & (high >= pieces.length)
    helical = np.flatnonzero(kept & (pieces.row < 0))
    same = np.flatnonzero(kept & whole & (pieces.row >= 0))
    cut = np.flatnonzero(kept & ~whole & (pieces.row >= 0))
    degree = max(
        pieces.control.shape[1] if len(same) + len(cut) else 2, 6 if len(joint) else 2
    )  # fmt: skip
    fresh = []
    if len(cut):
        fresh.append(elevated(pieces.bezier_between(cut, low[cut], high[cut]), degree))
    if len(joint):
        weight = np.ones((*control.shape[:2], 1))
        fresh.append(elevated(np.concatenate([control, weight], axis=2), degree))
    n_axes = pieces.origin.shape[1]
    rows, inverse = np.zeros((0, degree, n_axes + 1)), np.zeros((0, SERIES))
    length, owner = np.zeros(0), np.zeros(0, int)
    if fresh:
        rows, inverse, length, owner = bezier_rows(np.concatenate(fresh))
    of_cut = owner < len(cut)
    blend = np.where(of_cut, -1, owner - len(cut))
    piece = np.where(of_cut, np.append(cut, 0)[np.minimum(owner, len(cut))], 0)
    piece = np.where(of_cut, piece, np.append(joint, 0)[np.maximum(blend, 0)] + 1)
    old, lines = pieces.row[same], np.asarray(path.source_line)
    tables = np.concatenate([elevated(pieces.control[old], degree), rows])
    width = max(SERIES, pieces.inverse.shape[1])
    series = np.concatenate([
        np.pad(pieces.inverse[old], ((0, 0), (0, width - pieces.inverse.shape[1]))),
        np.pad(inverse, ((0, 0), (0, width - inverse.shape[1]))),
    ])  # fmt: skip
    begin, u, v, w = pieces.helical_from(helical, low[helical])
    begin = np.where((low[helical] > 0.0)[:, None], begin, pieces.origin[helical])
    curved = np.zeros((len(tables), n_axes))
    # a blend comes before the piece that it leads into
    place = np.concatenate([2 * helical + 1, 2 * same + 1, 2 * piece + (blend < 0)])
    order = np.argsort(place, kind="stable")
    owned = np.concatenate([helical, same, piece])[order]
    n_helical = len(helical)
    which = np.concatenate([np.full(n_helical + len(same), -1), blend])[order]
    u, v, w = (np.concatenate([part, curved])[order] for part in (u, v, w))
    fields = path_fields(
        np.concatenate([begin, tables[:, 0, :-1] / tables[:, 0, -1:]])[order],
        u, v, w,
        np.concatenate([pieces.rate[helical], np.zeros(len(tables))])[order],
        np.concatenate([high[helical] - low[helical], pieces.length[same], length])[order],
        np.concatenate([np.full(n_helical, -1), np.arange(len(tables))])[order].astype(np.int32),
        tables, series, lines[owned], path.closed,
    )  # fmt: skip
    return Path(**fields), owned.astype(np.int32), which.astype(np.int32)
