"""Many points at a time: chunks of few sizes, and what is done with their lanes on the host."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.local import Foot, Start

__all__ = [
    "FEW",
    "LARGE",
    "SMALL",
    "chunks",
    "in_chunks",
    "padded",
    "rows_of",
    "side_by_side",
    "walkers_of",
    "write_nearer",
]

LARGE, SMALL, FEW = 1 << 13, 1 << 11, 1 << 8
"""Lanes of a chunk: of these sizes only, so that nothing is compiled for a new number of points."""

Values = NDArray[Any]


def padded(values: Any, size: int) -> Any:
    """Return arrays with their last rows repeated up to a size; none may be empty."""

    def one(x: Values) -> Values:
        x = np.asarray(x)
        more = size - len(x)
        return np.concatenate([x, np.repeat(x[-1:], more, axis=0)]) if more else x

    return jax.tree.map(one, values)


def rows_of(tree: Any, which: Any) -> Any:
    """Return some rows of every array."""
    return jax.tree.map(lambda x: x[which], tree)


def chunks(n: int, size: int | None = None) -> list[tuple[slice, int]]:
    """Return slices that cover n points, each with the size that it is padded to.

    Parameters
    ----------
    n
        Number of points.
    size
        Lanes of a chunk; ``SMALL`` or ``LARGE``, whichever suits n, when None. It is one size for
        all chunks, because to compile for a second one takes longer than to pad.
    """
    size = size or (SMALL if n <= 2 * SMALL else LARGE)
    return [(slice(at, min(at + size, n)), size) for at in range(0, n, size)]


def side_by_side(work: Callable[..., None], jobs: Sequence[tuple[Any, ...]]) -> None:
    """Do jobs, as many at a time as there are processors.

    Parameters
    ----------
    work
        Takes what is in a job.
    jobs
        Arguments of each call.
    """
    if len(jobs) < 2:
        for job in jobs:
            work(*job)
        return
    with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
        list(pool.map(work, *zip(*jobs, strict=True)))


def in_chunks(work: Callable[..., Any], given: Any, size: int | None = None) -> Any:
    """Return what a compiled function of some lanes makes of many, as NumPy arrays.

    Parameters
    ----------
    work
        Takes arrays of the rows of a chunk.
    given
        Its arguments, of any number of rows but 0.
    size
        As in :func:`chunks`.
    """
    parts = []
    for at, lanes in chunks(len(given[0]), size):
        done = work(*padded(rows_of(given, at), lanes))
        parts.append(jax.tree.map(lambda x, m=at.stop - at.start: np.asarray(x)[:m], done))
    return parts[0] if len(parts) == 1 else jax.tree.map(lambda *x: np.concatenate(x), *parts)


def walkers_of(begun: Start, q: Values, lanes: Values) -> tuple[Values, Any]:
    """Return whose the lanes are that go on, both ways, and point, ball, foot and walker of each.

    Parameters
    ----------
    begun, q
        Starts and points of a chunk.
    lanes
        Those that count.
    """
    ways = [lanes[np.asarray(w.left)[lanes] > 0] for w in (begun.ahead, begun.behind)]
    owner = np.concatenate(ways)
    walker = jax.tree.map(
        lambda a, b: np.concatenate([np.asarray(a)[ways[0]], np.asarray(b)[ways[1]]]),
        begun.ahead,
        begun.behind,
    )
    rest = (q, begun.centre, begun.reach, begun.foot)
    return owner, (*jax.tree.map(lambda x: np.asarray(x)[owner], rest), walker)


def write_nearer(best: Foot, owner: Values, foot: Foot) -> None:
    """Write into ``best`` what is nearer; both ways of one point may be among the lanes.

    Parameters
    ----------
    best
        One foot per point.
    owner, foot
        The point of every lane, in two rising runs, and its foot.
    """
    # in each half no owner comes twice
    turn = np.flatnonzero(np.diff(owner) <= 0)
    first = np.arange(len(owner)) <= (turn[0] if len(turn) else len(owner))
    for half in (first, ~first):
        at = owner[half]
        nearer = foot.squared[half] < best.squared[at]
        for whole, part in zip(best, foot, strict=True):
            whole[at[nearer]] = part[half][nearer]
