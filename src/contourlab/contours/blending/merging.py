"""Runs of short lines merged into one line: the naive cam detector of G64 Q.

The rule is LinuxCNC's [LinuxCNC]_: a run of lines begins at a point B and takes in the next point M
as long as every point skipped lies within the tolerance of the segment from B to M, M is not B, and
no more than 100 points have been skipped. The first point that does not fit begins the next run.
The points skipped lie within the tolerance of a convex set, so the lines between them do too, and
the merged line is no farther from them than that.

References
----------
.. [LinuxCNC] ``linkable``, ``see_segment`` and ``flush_segments`` of ``emccanon.cc``, read.

Differences from the source
---------------------------
Works in any number of axes; LinuxCNC ends a run at any rotary or UVW motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from contourlab.contours.blending.pieces import Pieces
from contourlab.contours.joints import piece_ends
from contourlab.contours.path import Path
from contourlab.contours.path_rows import path_fields
from contourlab.errors import GeometryError
from contourlab.typing import Array

__all__ = ["MOST_SKIPPED", "Merged", "merge_lines"]

MOST_SKIPPED = 100
"""Points that one line may skip."""

_SAME = 1e-12
"""Points nearer than this, over the largest coordinate, are one."""

Rows = NDArray[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class Merged:
    """A path with fewer lines; NumPy arrays."""

    path: Path
    """The new path."""
    piece_first: Int[NDArray[Any], " n_rows"]
    """First piece of the old path that each row stands for."""
    piece_last: Int[NDArray[Any], " n_rows"]
    """Last one."""
    deviation: Float[NDArray[Any], " n_rows"]
    """Greatest distance of a skipped point from its line [m]."""


def merge_lines(path: Path, *, tolerance: Any, apart: Any = None) -> Merged:
    """Return the path with runs of lines merged where the points skipped stay within a tolerance.

    Parameters
    ----------
    path
        Any path; pieces other than lines are kept as they are and end a run.
    tolerance
        Of each piece, shape (n_pieces,), or one for all [m]; NaN or 0 merges nothing. Pieces of
        different tolerances are not merged.
    apart
        Joints over which nothing is merged, shape (n_joints,); none if not given.

    Returns
    -------
    Merged
        The source line of a merged line is that of its last piece, as in LinuxCNC.

    Raises
    ------
    GeometryError
        A negative or infinite tolerance, or arrays of a wrong shape.
    """
    n = path.n_pieces
    limit = np.asarray(tolerance, float)
    if limit.shape not in ((), (n,)):
        raise GeometryError(f"tolerance must be one number or of shape ({n},), got {limit.shape}")
    if (limit < 0.0).any() or np.isinf(limit).any():
        raise GeometryError(f"tolerance must be >= 0 m and finite, got {np.nanmin(limit):g}")
    limit = np.array(np.broadcast_to(limit, (n,)))
    pieces = Pieces(path)
    allowed = pieces.straight & (limit > 0.0)
    linked = allowed[1:] & allowed[:-1] & (limit[1:] == limit[:-1])
    if apart is not None:
        held = np.asarray(apart, bool)
        if held.shape not in ((n - 1,), (n,)) or len(held) != len(path.joints().parameter):
            raise GeometryError(f"apart must have one value for each joint, got {held.shape}")
        linked &= ~held[: n - 1]
    if not linked.any():
        whole = np.arange(n, dtype=np.int32)
        return Merged(path=path, piece_first=whole, piece_last=whole, deviation=np.zeros(n))
    ends = piece_ends(path, at_end=True)[0]
    ends[:-1] = pieces.origin[1:]  # as written, without the rounding of start + tangent · length
    begins = _runs(pieces.origin, ends, np.append(False, linked), limit)
    return _merged(path, pieces, ends, np.flatnonzero(begins))


def _runs(starts: Rows, ends: Rows, linked: Rows, limit: Rows) -> Rows:
    """Return which pieces begin a run, by one pass over all of them."""
    n = len(starts)
    size = 1 << int(np.ceil(np.log2(n)))  # compiled for few lengths
    pad = size - n
    scale = float(np.abs(ends).max())
    return np.asarray(
        _scan(
            (_SAME * scale) ** 2,
            jnp.asarray(np.pad(starts, ((0, pad), (0, 0)))),
            jnp.asarray(np.pad(ends, ((0, pad), (0, 0)), constant_values=scale)),
            jnp.asarray(np.pad(linked, (0, pad))),
            jnp.asarray(np.pad(np.nan_to_num(limit), (0, pad))),
        )
    )[:n]


@partial(jax.jit)
def _scan(same: Array | float, starts: Array, ends: Array, linked: Array, limit: Array) -> Array:
    slots = jnp.arange(MOST_SKIPPED + 1)

    def step(carry: Any, row: Any) -> Any:
        begin, skipped, count = carry
        start, end, joined, within = row
        line = end - begin
        size = jnp.sum(line * line)
        offset = skipped - begin
        along = jnp.clip(offset @ line / jnp.where(size > 0.0, size, 1.0), 0.0, 1.0)
        gap = offset - along[:, None] * line
        near = jnp.sum(gap * gap, axis=1) <= within * within
        joined = joined & (count <= MOST_SKIPPED) & (size > same)
        joined = joined & jnp.all(near | (slots >= count))
        begin = jnp.where(joined, begin, start)
        place = jnp.where(joined, count, 0)
        skipped = jax.lax.dynamic_update_slice(skipped, end[None], (place, 0))
        return (begin, skipped, place + 1), ~joined

    first = (starts[0], jnp.zeros((MOST_SKIPPED + 1, starts.shape[1])), jnp.zeros((), int))
    return jax.lax.scan(step, first, (starts, ends, linked, limit))[1]  # type: ignore[no-any-return]


def _merged(path: Path, pieces: Pieces, ends: Rows, first: Rows) -> Merged:
    last = np.append(first[1:], len(ends)) - 1
    many = last > first
    start, end = pieces.origin[first], ends[last]
    chord = end - start
    length = np.linalg.norm(chord, axis=1)
    safe = np.where(many, length, 1.0)[:, None]
    tangent = np.where(many[:, None], chord / safe, pieces.u[first])
    owner = np.repeat(np.arange(len(first)), last - first + 1)
    offset = ends - start[owner]
    along = np.sum(offset * tangent[owner], axis=1)
    along = np.clip(along, 0.0, length[owner])
    away = np.linalg.norm(offset - along[:, None] * tangent[owner], axis=1)
    deviation = np.zeros(len(first))
    np.maximum.at(deviation, owner, np.where(many[owner], away, 0.0))
    fields = path_fields(
        start,
        tangent,
        np.where(many[:, None], 0.0, pieces.v[first]),
        np.where(many[:, None], 0.0, pieces.w[first]),
        pieces.rate[first],
        np.where(many, length, pieces.length[first]),
        pieces.row[first],
        pieces.control,
        pieces.inverse,
        np.asarray(path.source_line)[last],
        path.closed,
    )
    return Merged(
        path=Path(**fields),
        piece_first=first.astype(np.int32),
        piece_last=last.astype(np.int32),
        deviation=deviation,
    )
