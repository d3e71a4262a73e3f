"""Long stretches of a path: balls about blocks of 1, 2, 4, ... rows.

A block that lies in the ball of the stretch is passed without looking at its rows; the nearest
point is then looked for among the blocks passed, from the largest down, leaving out those whose
ball is no nearer than what is known. So the work of a stretch grows with the logarithm of its rows,
and not with their number.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.certified import Places, dot, keep_nearer
from contourlab.contours.foot_points.path_table import PathTable
from contourlab.contours.foot_points.row_feet import AHEAD, Balls, row_feet

__all__ = ["Blocks", "far_feet"]

_TOGETHER = 1 << 12

Values = NDArray[Any]


class Blocks:
    """Balls about blocks of rows, made when they are first asked for."""

    def __init__(self, table: PathTable) -> None:
        self._table, self._lock = table, threading.Lock()
        self._levels: list[tuple[Values, Values]] | None = None

    @property
    def levels(self) -> list[tuple[Values, Values]]:
        """Of every level, centres (n_axes, n) and radii (n,); block k of level l begins at k 2^l.

        Only whole blocks are there.
        """
        with self._lock:
            if self._levels is None:
                self._levels = self._made()
        return self._levels

    def _made(self) -> list[tuple[Values, Values]]:
        table = self._table
        # a row lies in the ellipsoid of its ends, whose half axis is half its length
        rows = np.arange(table.n_rows)
        ends = table.look(rows, table.extent, np.zeros_like(table.origin), 0)[0]
        centre, radius = 0.5 * (table.origin + ends), 0.5 * table.length + table.rounding
        levels = [(centre, radius)]
        while radius.shape[0] >= 2:
            n = len(radius) // 2 * 2
            a, b = centre[:, 0:n:2], centre[:, 1:n:2]
            middle = 0.5 * (a + b)
            radius = 0.5 * np.sqrt(dot(a - b, a - b)) + np.maximum(radius[0:n:2], radius[1:n:2])
            centre = middle
            levels.append((centre, radius))
        return levels


def far_feet(
    table: PathTable,
    blocks: Blocks,
    balls: Balls,
    row: Values,
    lap: Values,
    walked: Values,
    way: int,
    own: Values,
    best: Places,
) -> None:
    """Write the feet of long stretches, one way, into the best ones known.

    Parameters
    ----------
    table, blocks
        The path.
    balls
        One per lane.
    row, lap
        Of the row that comes next.
    walked
        Rows behind a lane.
    way
        ``AHEAD`` or ``BEHIND``.
    own
        The point that a lane belongs to; none comes twice.
    best
        Feet of all points.
    """
    for at in range(0, len(own), _TOGETHER):
        some = slice(at, at + _TOGETHER)
        passed = _passed(
            table, blocks, balls.of(some), row[some], lap[some], walked[some], way, own[some], best
        )
        _descend(table, blocks, balls.of(some), passed, own[some], best)


def _passed(
    table: PathTable,
    blocks: Blocks,
    balls: Balls,
    row: Values,
    lap: Values,
    walked: Values,
    way: int,
    own: Values,
    best: Places,
) -> list[list[Any]]:
    """Return, level by level, lane, block and lap of the blocks that a stretch has passed."""
    n, levels = table.n_rows, blocks.levels
    passed: list[list[Any]] = [[] for _ in levels]
    lane, left = np.arange(len(row)), n + 1 - walked
    level = np.zeros(len(row), int)
    radius = 2.0 * np.sqrt(balls.error2)
    while len(lane):
        # the largest block allowed that begins (or ends) at the row
        edge = row if way == AHEAD else row + 1
        largest = np.where(edge > 0, _trailing(edge), len(levels) - 1)
        room = np.minimum(n - edge if way == AHEAD else edge, left)
        largest = np.minimum(largest, np.frexp(np.maximum(room, 1))[1] - 1)
        level = np.clip(level, 0, largest)
        step = 1 << level
        block = (edge if way == AHEAD else edge - step) >> level
        done, inside = np.zeros(len(lane), bool), np.zeros(len(lane), bool)
        for k in np.unique(level):
            at = np.flatnonzero(level == k)
            centre, size = (x[..., block[at]] for x in levels[k])
            off = centre - balls.centre[:, at]
            inside[at] = np.sqrt(dot(off, off)) + size <= radius[at]
            through = at[inside[at]]
            passed[k].append((lane[through], block[through], lap[through]))
        stuck = np.flatnonzero(~inside & (level == 0))
        if len(stuck):
            done[stuck] = ~_through(table, balls, row, lap, way, lane, own, best, stuck)
        moved = inside.copy()
        moved[stuck] = True
        step = np.where(moved, step, 0)
        new = row + way * step
        over = (new >= n) | (new < 0)
        if not table.closed:
            done |= moved & over
        lap = lap + np.where(over, way, 0)
        row = np.where(new >= n, 0, np.where(new < 0, n - 1, new))
        left = left - step
        done |= left <= 0
        level = np.where(inside, level + 1, level - 1)
        going = np.flatnonzero(~done)
        lane, row, lap, left, level = (x[going] for x in (lane, row, lap, left, level))
        balls, radius = balls.of(going), radius[going]
    return passed


def _trailing(values: Values) -> Values:
    """Return how often 2 divides numbers > 0."""
    low = values & -values
    result: Values = np.frexp(np.maximum(low, 1).astype(float))[1] - 1
    return result


def _through(
    table: PathTable,
    balls: Balls,
    row: Values,
    lap: Values,
    way: int,
    lane: Values,
    own: Values,
    best: Places,
    some: Values,
) -> Values:
    """Look at one row of some lanes; return whether the stretch goes on behind it."""
    at, given = row[some], balls.of(some)
    begin = np.zeros(len(at)) if way == AHEAD else table.extent[at]
    who = own[lane[some]]
    found = row_feet(table, given, at, begin, way, best.squared[who])
    keep_nearer(best, who, (found.squared, at, found.s, lap[some]))
    off = table.joint(at, way == AHEAD) - given.centre
    out = found.out_ahead if way == AHEAD else found.out_behind
    on: Values = ~out & (dot(off, off) <= 4.0 * given.error2)
    return on


def _descend(
    table: PathTable, blocks: Blocks, balls: Balls, passed: list[list[Any]], own: Values, best: Any
) -> None:
    """Look for nearer points in the blocks passed, from the largest down."""
    levels = blocks.levels
    lane, block, lap = (np.zeros(0, int) for _ in range(3))
    for k in range(len(levels) - 1, -1, -1):
        new = [(lane, block, lap), *passed[k]]
        lane, block, lap = (np.concatenate(part).astype(int) for part in zip(*new, strict=True))
        if not len(lane):
            continue
        centre, size = (x[..., block] for x in levels[k])
        off = centre - balls.q[:, lane]
        bound = np.sqrt(dot(off, off)) - size
        first = block << k
        away = table.origin[:, first] - balls.q[:, lane]
        keep_nearer(best, own[lane], (dot(away, away), first, np.zeros(len(lane)), lap))
        hope = np.flatnonzero(bound < np.sqrt(best.squared[own[lane]]))
        lane, block, lap = lane[hope], block[hope], lap[hope]
        if k == 0:
            s, squared = table.nearest(
                balls.q[:, lane], block, np.zeros(len(lane)), table.extent[block],
                best.squared[own[lane]],
            )  # fmt: skip
            keep_nearer(best, own[lane], (squared, block, s, lap))
        else:
            lane, lap = np.tile(lane, 2), np.tile(lap, 2)
            block = np.concatenate([2 * block, 2 * block + 1])
