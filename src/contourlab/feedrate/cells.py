"""Cells of arc length, and the spreading of caps over neighbouring places.

Smoothing in time mixes what happens at neighbouring places, so a cap holds for more than its own
place. If the planned speed stays below

    v'(x) = min over y of max(cap(y), 2 |x - y| / T),

its moving average over T stays below cap(y) while passing y. (Let y be the average of the planned
positions in the window, which spans D. Were D > cap(y) T, the window would reach farther than
cap(y) T / 2 from y on one side, say by q. The motion to there from y takes at least
T/2 (1 + log(2 q / (cap T))) and has at least the mean of a motion at cap(y) for T/2; what is left
of the window on the other side of y, less than T/2 and not faster, cannot balance it: the mean
would not be y.) Likewise the accelerations that enter the average at y are planned within
cap(y) T of y.

All of it is done on cells with constant caps, taking for a cell what holds for its worst point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Cells", "spread_acceleration", "spread_speed", "subdivide"]

Values = np.ndarray[Any, Any]

_GROWTH = 1.3
_FINEST = 0.125
_REACH = 1.0 + 1e-9


@dataclass(frozen=True, eq=False)
class Cells:
    """Consecutive cells; those of one stretch, from stop to stop, stand together."""

    edges: Values
    """Arc lengths, shape (n + 1,) [m]."""
    segment: Values
    """Segment that each cell is part of, shape (n,)."""
    stretch: Values
    """Stretch of each cell, shape (n,)."""
    first: Values
    """First cell of each stretch, and n."""


def subdivide(edges: Values, stop: Values, speed: Values, joint_speed: Values, window: Values) -> Cells:
    """Return cells that are fine, in units of speed times window, where caps meet.

    Parameters
    ----------
    edges
        Of the segments, shape (m + 1,) [m].
    stop
        Whether the motion stops at an edge, shape (m + 1,); both ends do.
    speed
        Cap of each segment, shape (m,) [m/s].
    joint_speed
        Cap at each edge, shape (m + 1,) [m/s].
    window
        T of each segment, shape (m,) [s].
    """
    length = np.diff(edges)
    m = len(length)
    beside = np.full(m + 1, np.inf)
    beside[1:-1] = np.minimum(np.minimum(speed[:-1], speed[1:]), joint_speed[1:-1])
    fine_left = np.where(stop[:-1], np.inf, _FINEST * beside[:-1] * window)
    fine_right = np.where(stop[1:], np.inf, _FINEST * beside[1:] * window)
    both = np.isfinite(fine_left) & np.isfinite(fine_right)
    reach = np.where(both, 0.5 * length, length)
    added: list[Values] = []
    owner: list[Values] = []
    for fine, sign, origin in ((fine_left, 1.0, edges[:-1]), (fine_right, -1.0, edges[1:])):
        finite = np.flatnonzero(np.isfinite(fine))
        at, step = fine[finite].copy(), fine[finite].copy()
        while len(finite):
            # the last step before the end of the reach would leave a sliver
            inside = at + 0.5 * step < reach[finite]
            finite, at, step = finite[inside], at[inside], step[inside]
            added.append(origin[finite] + sign * at)
            owner.append(finite)
            step = step * _GROWTH
            at = at + step
    all_edges = np.concatenate([edges[:-1], *added])
    all_owner = np.concatenate([np.arange(m), *owner])
    order = np.lexsort((all_edges, all_owner))
    begin, segment = all_edges[order], all_owner[order]
    keep = np.append(np.diff(begin) > 0.0, begin[-1] < edges[-1])
    # where two cuts coincide the later one stays, which starts its own segment if it is an edge
    begin, segment = begin[keep], segment[keep]
    starts = np.append(True, np.diff(segment) != 0)
    stretch_start = starts & stop[segment]
    stretch = np.cumsum(stretch_start) - 1
    first = np.append(np.flatnonzero(stretch_start), len(begin))
    return Cells(np.append(begin, edges[-1]), segment, stretch, first)


def spread_speed(
    cells: Cells, cap: Values, window: Values, place: Values, place_cap: Values
) -> Values:
    """Return the caps v' on the planned speed of each cell, shape (n,) [m/s].

    Parameters
    ----------
    cells
        Where.
    cap
        Cap of each cell, shape (n,) [m/s].
    window
        T of each cell, shape (n,) [s].
    place, place_cap
        Further caps at single places: arc length [m] and speed [m/s].
    """
    radius = 0.5 * cap * window * _REACH
    low, high = _cells_within(cells, cells.edges[:-1] - radius, cells.edges[1:] + radius,
                              cells.stretch)  # fmt: skip
    lows, highs, values = [low], [high], [cap]
    if len(place):
        k = np.clip(np.searchsorted(cells.edges, place, side="right") - 1, 0, len(cap) - 1)
        radius = 0.5 * place_cap * window[k] * _REACH
        # both cells that touch the place, even if the reach is nothing
        left = np.where(cells.edges[k] == place, np.maximum(k - 1, 0), k)
        a, b = _cells_within(cells, place - radius, place + radius, cells.stretch[k])
        lows.append(np.minimum(a, np.maximum(left, cells.first[cells.stretch[k]])))
        highs.append(np.maximum(b, k + 1))
        values.append(place_cap)
    flat = _least_over(np.concatenate(lows), np.concatenate(highs), np.concatenate(values), len(cap))
    slope = (2.0 * np.diff(cells.edges) / window).tolist()
    stretch = cells.stretch.tolist()
    forward = _cone(flat.tolist(), slope, stretch)
    backward = _cone(flat[::-1].tolist(), slope[::-1], stretch[::-1])[::-1]
    return np.minimum(np.array(forward), np.array(backward))


def _cone(flat: list[float], slope: list[float], stretch: list[int]) -> list[float]:
    """Limit the rise from cell to cell; the gap to a cell's neighbour's neighbour is its length."""
    out, least, current = [], np.inf, -1
    for cap, rise, at in zip(flat, slope, stretch, strict=True):
        if at != current:
            least, current = np.inf, at
        out.append(cap if cap < least else least)
        least += rise
        if cap < least:
            least = cap
    return out


def spread_acceleration(cells: Cells, cap: Values, speed: Values, window: Values) -> Values:
    """Return the caps on the planned acceleration of each cell, shape (n,) [m/s²].

    Parameters
    ----------
    cells
        Where.
    cap
        Cap of each cell on the smoothed acceleration, shape (n,) [m/s²].
    speed
        Cap of each cell on the smoothed speed, shape (n,) [m/s].
    window
        T of each cell, shape (n,) [s].
    """
    radius = speed * window * _REACH
    low, high = _cells_within(cells, cells.edges[:-1] - radius, cells.edges[1:] + radius,
                              cells.stretch)  # fmt: skip
    return _least_over(low, high, cap, len(cap))


def _cells_within(
    cells: Cells, start: Values, end: Values, stretch: Values
) -> tuple[Values, Values]:
    low = np.searchsorted(cells.edges[1:], start, side="right")
    high = np.searchsorted(cells.edges[:-1], end, side="left")
    low = np.maximum(low, cells.first[stretch])
    high = np.minimum(high, cells.first[stretch + 1])
    return low, np.maximum(high, low + 1)


def _least_over(low: Values, high: Values, value: Values, n: int) -> Values:
    """Return for each of n cells the least value of the ranges [low, high) that hold it."""
    level = np.floor(np.log2(high - low)).astype(int)
    top = int(level.max())
    table = np.full((top + 1, n), np.inf)
    flat = table.reshape(-1)
    np.minimum.at(flat, level * n + low, value)
    np.minimum.at(flat, level * n + high - (1 << level), value)
    for k in range(top, 0, -1):
        half = 1 << (k - 1)
        np.minimum(table[k - 1], table[k], out=table[k - 1])
        np.minimum(table[k - 1][half:], table[k][:-half], out=table[k - 1][half:])
    return table[0]
