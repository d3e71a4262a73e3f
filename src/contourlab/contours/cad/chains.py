"""Runs of segments put end to end: the chains of a drawing, in order.

Ends nearer than a gap are one place. Where two runs meet they are one chain; where more meet the
order is not the drawing's, and it is refused. A chain runs the way its first run was drawn; an open
one begins at its free end, a loop where its first run begins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from contourlab.contours.cad.segments import Run, Segment
from contourlab.contours.moves import Moves
from contourlab.errors import PartError

__all__ = ["Chain", "chains_of", "chosen", "moves_of"]

_SHOWN = 12
_MOST_TOUCHING = 50_000
"""Pairs of ends that touch, beyond those of a path through all."""

Rows = NDArray[Any]


@dataclass(eq=False)
class Chain:
    """Segments end to end, each with the entity that it comes from."""

    segments: list[Segment]
    entity: list[int]
    layers: tuple[str, ...]
    closed: bool

    @property
    def length(self) -> float:
        """Length, that of control polygons for curves [m]."""
        return sum(segment.length for segment in self.segments)

    def describe(self) -> str:
        """Return what a user sees of it."""
        x, y = (f"{1e3 * value:.4g}" for value in self.segments[0].start[:2])
        kind = "loop" if self.closed else "open"
        where = f" on {', '.join(sorted(set(self.layers)))}" if any(self.layers) else ""
        return (
            f"{kind}, {len(self.segments)} segments, {1e3 * self.length:.4g} mm from "
            f"({x}, {y}) mm{where}"
        )


def chains_of(runs: list[Run], gap: float, name: str) -> list[Chain]:
    """Return the chains of a drawing, in the order of their first runs.

    Parameters
    ----------
    runs
        Each with one segment or more, none of no length.
    gap
        Ends nearer than this meet [m].
    name
        Of the file, for messages.

    Raises
    ------
    PartError
        No runs, or a place at which more than two meet.
    """
    if not runs:
        raise PartError(f"{name}: nothing in it can be followed, so there is no contour")
    for run in runs:
        if sum(segment.length for segment in run.segments) <= gap:
            raise PartError(
                f"{name}: entity {run.entity} is not longer than gap, {gap:.3g} m, within which "
                "ends are one place: choose a smaller gap"
            )
    ends = np.array([[run.segments[0].start, run.segments[-1].end] for run in runs])
    place = _places(ends.reshape(-1, 3), gap, name).reshape(-1, 2)
    loop = place[:, 0] == place[:, 1]
    count = np.bincount(place[~loop].reshape(-1), minlength=int(place.max()) + 1)
    loops = np.bincount(place[loop, 0], minlength=len(count))
    wrong = (count > 2) | ((loops > 0) & (count + loops > 1))
    if wrong.any():
        node = int(np.argmax(wrong))
        run, side = np.argwhere(place == node)[0]
        x, y, _ = 1e3 * ends[run, side]
        entities = sorted({runs[k].entity for k in np.flatnonzero((place == node).any(axis=1))})
        raise PartError(
            f"{name}: at ({x:.6g}, {y:.6g}) mm more than two ends meet, of entities "
            f"{', '.join(map(str, entities[:_SHOWN]))}: the order is not clear; choose layers"
        )
    at: dict[int, list[tuple[int, int]]] = {}
    for k in np.flatnonzero(~loop):
        for side in (0, 1):
            at.setdefault(int(place[k, side]), []).append((int(k), side))
    used = np.zeros(len(runs), bool)
    chains = []
    for first in range(len(runs)):
        if used[first]:
            continue
        if loop[first]:
            used[first] = True
            chains.append(_chain([(first, False)], runs, gap, closed=True, name=name))
            continue
        ordered, closed = _follow(first, place, at)
        used[[k for k, _ in ordered]] = True
        chains.append(_chain(ordered, runs, gap, closed=closed, name=name))
    return chains


def _places(points: Rows, gap: float, name: str) -> Rows:
    """Return which points are one place."""
    tree = cKDTree(points)
    if tree.count_neighbors(tree, gap) > 4 * len(points) + _MOST_TOUCHING:
        raise PartError(
            f"{name}: too many ends lie within {gap:.3g} m of each other: the unit or gap is wrong"
        )
    pairs = tree.query_pairs(gap, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    return connected_components(graph, directed=False)[1]  # type: ignore[no-any-return]


def _follow(
    first: int, place: Rows, at: dict[int, list[tuple[int, int]]]
) -> tuple[list[tuple[int, bool]], bool]:
    """Return the runs of a chain in order, each with whether it is turned; and whether it closes.

    Walks from the first run forwards to a free end or round to it, then backwards.
    """
    ahead, closed = _walk(first, 1, place, at)
    if closed:
        return [(first, False), *ahead], True
    behind, _ = _walk(first, 0, place, at)
    back = [(k, not turned) for k, turned in reversed(behind)]
    return [*back, (first, False), *ahead], False


def _walk(
    first: int, side: int, place: Rows, at: dict[int, list[tuple[int, int]]]
) -> tuple[list[tuple[int, bool]], bool]:
    """Return the runs met from one end of a run, turned so that each leads away from it."""
    found: list[tuple[int, bool]] = []
    run, out = first, side
    while True:
        others = [(k, s) for k, s in at[int(place[run, out])] if (k, s) != (run, out)]
        if not others:
            return found, False
        run, entered = others[0]
        if run == first:
            return found, True
        found.append((run, entered == 1))
        out = 1 - entered


def _chain(
    ordered: list[tuple[int, bool]], runs: list[Run], gap: float, *, closed: bool, name: str
) -> Chain:
    segments: list[Segment] = []
    entity: list[int] = []
    for k, turned in ordered:
        run = runs[k].reversed() if turned else runs[k]
        segments += run.segments
        entity += [run.entity] * len(run.segments)
    joints = len(segments) - (not closed)
    starts, ends = [s.start for s in segments], [s.end for s in segments]
    for i in range(joints):  # neighbours meet in the middle of what is between them
        j = (i + 1) % len(segments)
        if not np.array_equal(ends[i], starts[j]):
            ends[i] = starts[j] = 0.5 * (ends[i] + starts[j])
    try:
        segments = [
            segment.moved(start, end, gap)
            for segment, start, end in zip(segments, starts, ends, strict=True)
        ]
    except PartError as error:
        raise PartError(f"{name}: {error}") from None
    for segment, number in zip(segments, entity, strict=True):
        if not segment.length > 0.0:
            raise PartError(
                f"{name}: a segment of entity {number} vanishes when ends within gap, "
                f"{gap:.3g} m, are joined: choose a smaller gap"
            )
    return Chain(segments, entity, tuple({runs[k].layer for k, _ in ordered}), closed)


def chosen(chains: list[Chain], chain: int | None, reverse: bool, name: str) -> Chain:
    """Return the chain that is wanted.

    Parameters
    ----------
    chains
        Of the drawing.
    chain
        Which, from 0; None if there is only one.
    reverse
        Whether it is run the other way.
    name
        Of the file, for messages.

    Raises
    ------
    PartError
        Several, and none was chosen; no such one. The message lists them.
    """
    listed = "; ".join(f"{k}: {one.describe()}" for k, one in enumerate(chains[:_SHOWN]))
    more = f"; and {len(chains) - _SHOWN} more" if len(chains) > _SHOWN else ""
    if chain is None and len(chains) > 1:
        raise PartError(
            f"{name}: holds {len(chains)} chains that do not meet; choose one with chain: "
            f"{listed}{more}"
        )
    number = 0 if chain is None else chain
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(chains):
        raise PartError(f"{name}: has no chain {chain!r}: {listed}{more}")
    one = chains[number]
    if not reverse:
        return one
    turned = [segment.reversed() for segment in reversed(one.segments)]
    return Chain(turned, one.entity[::-1], one.layers, one.closed)


def moves_of(chain: Chain) -> Moves:
    """Return a chain as moves without feeds.

    Parameters
    ----------
    chain
        Of a drawing.
    """
    segments, n = chain.segments, len(chain.segments)
    curved = [segment.control for segment in segments]
    number = np.cumsum([control is not None for control in curved]) - 1
    spline = np.where([control is not None for control in curved], number, -1)
    entity = np.array(chain.entity, np.int32)
    nothing = np.full(n, np.nan)
    return Moves(
        start=np.array([s.start for s in segments]),
        end=np.array([s.end for s in segments]),
        center=np.array([s.center for s in segments]),
        normal=np.array([s.normal for s in segments]),
        angle=np.array([s.angle for s in segments]),
        spline=spline.astype(np.int32),
        control_points=tuple(control for control in curved if control is not None),
        source_line=entity,
        file=np.zeros(n, np.int32),
        file_line=entity,
        feed=nothing,
        rapid=np.zeros(n, bool),
        blend=nothing,
        merge=nothing,
        dwell=np.zeros(n),
        dwell_before=0.0,
    )
