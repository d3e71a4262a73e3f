"""Cells of arc length, and the spreading of caps over neighbouring places.

Smoothing in time mixes what happens at neighbouring places, so a cap holds for more than its own
place. Let y be the smoothed position at some instant, c the cap at y, x(τ) the planned position
minus y in the window of T before the instant (its mean is 0), and D the way that x goes in the
window: the smoothed speed is D / T. If the planned speed at each x is at most

    max(c, 2 |x| / T),

then D <= c T, and the smoothed speed keeps the cap. For let x run from -p to q. If p and q are at
most c T / 2, D <= c T. If both are more, the way between takes more than T: no window has that. If
q > c T / 2 >= p: from its zero at τ₀ the way to q takes at least T/2 (1 + log(2 q / (c T))), so
τ₀ < T/2. Up to there the integral of |x| is at most c τ₀² / 2 < c T² / 8, being no faster than c.
After it the integral is at least that of the fastest motion that ends in q, which is more than
c T² / 8. The mean would not be 0. The other case is its mirror image.

The accelerations that are averaged at y are planned within D <= c T of y. Both are done on cells
with constant caps, taking for a cell what holds for its worst point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Cells",
    "affected",
    "limit_rise",
    "spread_acceleration",
    "spread_speed",
    "subdivide",
    "whole",
]

Values = NDArray[Any]

_GROWTH = 1.3
_FINEST = 0.125
_REACH = 1.0 + 1e-7
"""Reaches are a little larger, so that what must outlast a window does in spite of rounding."""
_AFFECTED = 0.98
"""Segments whose neighbours lower a cap by less than 2 % are not divided."""


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


def whole(edges: Values, stop: Values) -> Cells:
    """Return one cell for each segment.

    Parameters
    ----------
    edges
        Of the segments, shape (m + 1,) [m].
    stop
        Whether the motion stops at an edge, shape (m + 1,); both ends do.
    """
    m = len(edges) - 1
    stretch = np.cumsum(stop[:-1]) - 1
    return Cells(edges, np.arange(m), stretch, np.append(np.flatnonzero(stop[:-1]), m))


def subdivide(
    edges: Values, stop: Values, speed: Values, joint_speed: Values, window: Values, divide: Values
) -> Cells:
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
    divide
        Whether each segment is worth it, shape (m,).
    """
    length = np.diff(edges)
    m = len(length)
    beside = np.full(m + 1, np.inf)
    beside[1:-1] = np.minimum(np.minimum(speed[:-1], speed[1:]), joint_speed[1:-1])
    fine_left = np.where(stop[:-1] | ~divide, np.inf, _FINEST * beside[:-1] * window)
    fine_right = np.where(stop[1:] | ~divide, np.inf, _FINEST * beside[1:] * window)
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
    low, high = np.concatenate(lows), np.concatenate(highs)
    flat = _least_over(low, high, np.concatenate(values), len(cap))
    rise = 2.0 * np.diff(cells.edges) / window
    forward = _cone(flat, rise, cells.first)
    backward = _cone(flat[::-1], rise[::-1], len(cap) - cells.first[::-1])[::-1]
    return np.minimum(forward, backward)


def _cone(flat: Values, rise: Values, first: Values) -> Values:
    """Limit the rise from cell to cell, by the length of the cells in between."""
    ahead = np.concatenate([[np.inf], flat[:-1]])
    ahead[first[:-1]] = np.inf
    apart = rise[:-1].copy()
    apart[first[1:-1] - 1] = np.inf  # nothing crosses a stop
    return np.minimum(flat, limit_rise(ahead, apart))


def limit_rise(value: Values, gain: Values) -> Values:
    """Return the largest sequence below another that rises by no more than the gains.

    Parameters
    ----------
    value
        Shape (n,).
    gain
        Allowed rise from each to the next, shape (n - 1,).
    """
    out = value.copy()
    last = len(out) - 1
    too_steep = np.flatnonzero(out[1:] > out[:-1] + gain)
    if len(too_steep) == 0:
        return out
    # lowering one may make the next too steep: follow it until it does not
    values, gains = out.tolist(), gain.tolist()
    for k in too_steep.tolist():
        limit = values[k] + gains[k]
        while values[k + 1] > limit:
            k += 1
            values[k] = limit
            if k == last:
                break
            limit += gains[k]
    return np.array(values)


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
    least: Values = table[0]
    return least


def affected(own: Values, spread: Values) -> Values:
    """Return which cells are lowered noticeably by their neighbours.

    Parameters
    ----------
    own, spread
        Caps before and after spreading, shape (n,).
    """
    return spread < _AFFECTED * own
