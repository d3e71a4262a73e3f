"""Local foot points of many points on a path: a few rows together, long stretches by blocks.

A chunk of points looks at the rows of their reference points together. Points whose stretch goes on
are gathered, both ways of each a lane of its own, and take one row more; those that are done drop
out. After some rows what is still going is a long stretch, and goes by blocks of rows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.blocks import Blocks, far_feet
from contourlab.contours.foot_points.certified import Places, dot, keep_nearer
from contourlab.contours.foot_points.path_table import PathTable
from contourlab.contours.foot_points.row_feet import AHEAD, BEHIND, BOTH, Balls, row_feet

__all__ = ["path_feet"]

_ROUNDS = 6
"""Rows of a stretch that are looked at one by one."""

Values = NDArray[Any]


def path_feet(table: PathTable, points: Values, near: Values, blocks: Blocks) -> Places:
    """Return the local feet of a chunk of points.

    Parameters
    ----------
    table
        The path.
    points
        Shape (n_axes, n) [m].
    near
        Reference parameters, shape (n,).
    blocks
        Of the path.
    """
    row, s, lap = table.place(near)
    centre = table.look(row, np.nan_to_num(s), np.zeros_like(points), 0)[0]
    with np.errstate(invalid="ignore", over="ignore"):
        off = centre - points
        error2 = dot(off, off)
        fit = np.isfinite(error2) & np.isfinite(near)
    best = Places(np.where(fit, error2, np.nan), row, np.where(fit, s, 0.0), lap)
    lanes = np.flatnonzero(fit & (error2 > 0.0))
    if not len(lanes):
        return best
    balls, at, begin = Balls(points, centre, error2).of(lanes), row[lanes], s[lanes]
    found = row_feet(table, balls, at, begin, BOTH, error2[lanes])
    keep_nearer(best, lanes, (found.squared, at, found.s, lap[lanes]))
    going = []
    for way, out in ((AHEAD, found.out_ahead), (BEHIND, found.out_behind)):
        lane = _Lanes(lanes, balls, at, lap[lanes], np.zeros(len(lanes), int))
        going.append(_onward(table, lane.of(np.flatnonzero(~out)), way))
    for way, lane in zip((AHEAD, BEHIND), going, strict=True):
        for _ in range(_ROUNDS):
            if not len(lane.own):
                break
            begin = np.zeros(len(lane.own)) if way == AHEAD else table.extent[lane.row]
            found = row_feet(table, lane.balls, lane.row, begin, way, best.squared[lane.own])
            keep_nearer(best, lane.own, (found.squared, lane.row, found.s, lane.lap))
            out = found.out_ahead if way == AHEAD else found.out_behind
            lane = _onward(table, lane.of(np.flatnonzero(~out)), way)
        if len(lane.own):
            far_feet(
                table, blocks, lane.balls, lane.row, lane.lap, lane.walked, way, lane.own, best
            )
    return best


class _Lanes(NamedTuple):
    """Ways that go on: whose they are, the row that comes next, and rows walked."""

    own: Values
    balls: Balls
    row: Values
    lap: Values
    walked: Values

    def of(self, some: Values) -> _Lanes:
        return _Lanes(
            self.own[some], self.balls.of(some), self.row[some], self.lap[some], self.walked[some]
        )


def _onward(table: PathTable, lane: _Lanes, way: int) -> _Lanes:
    """Return the lanes whose stretch goes on, at their next rows."""
    ahead = way == AHEAD
    row = lane.row + way
    beyond = (row < 0) | (row >= table.n_rows)
    some = np.ones(len(row), bool) if table.closed else ~beyond
    some &= lane.walked <= table.n_rows
    some = np.flatnonzero(some)
    off = table.joint(lane.row[some], ahead) - lane.balls.centre[:, some]
    some = some[dot(off, off) <= 4.0 * lane.balls.error2[some]]
    lane = lane.of(some)
    return lane._replace(
        row=row[some] % table.n_rows,
        lap=lane.lap + np.where(beyond[some], way, 0),
        walked=lane.walked + 1,
    )
