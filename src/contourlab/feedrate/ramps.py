"""The fastest planned motion under caps that are constant on cells: ramps of constant acceleration.

A forward and a backward pass over the cells, in squared speeds, then inside each cell up, along
and down. Last, every peak is cut so low that it lasts at least the window T of the smoothing.
Valleys do that by themselves: they stand on caps that were spread, and a cap c is spread over c T
(:mod:`contourlab.feedrate.cells`). A window then never holds accelerations of both signs, and no
smoothed |jerk| exceeds |a|max / T.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.feedrate.cells import Cells, limit_rise

__all__ = ["Ramps", "plan_ramps"]

Values = NDArray[Any]

_LASTING = 1.0 + 1e-7
"""Peaks last a little longer than the window, so that they do in spite of rounding."""


@dataclass(frozen=True, eq=False)
class Ramps:
    """Intervals of constant acceleration, in order, none of length 0."""

    start: Values
    """Arc length at the start of each, shape (n,) [m]."""
    length: Values
    """[m]."""
    speed: Values
    """At its start [m/s]."""
    end_speed: Values
    """At its end [m/s]."""
    acceleration: Values
    """[m/s²]."""
    duration: Values
    """[s]."""
    stretch: Values
    """Stretch of each."""

    def stretch_times(self, n_stretches: int) -> Values:
        """Return the duration of each stretch, shape (n_stretches,) [s].

        Parameters
        ----------
        n_stretches
            Count of stretches.
        """
        return np.bincount(self.stretch, self.duration, n_stretches)


def plan_ramps(cells: Cells, speed: Values, acceleration: Values, window: Values) -> Ramps:
    """Return the fastest ramps under the caps, at rest at both ends of each stretch.

    Parameters
    ----------
    cells
        Where.
    speed, acceleration
        Caps of each cell, spread, shape (n,) [m/s, m/s²].
    window
        T of each stretch, shape (n_stretches,) [s].
    """
    length = np.diff(cells.edges)
    node = np.empty(len(length) + 1)
    node[1:-1] = np.minimum(speed[:-1], speed[1:]) ** 2
    node[cells.first] = 0.0
    node[-1] = 0.0
    gain = 2.0 * acceleration * length
    node = limit_rise(node, gain)
    node = limit_rise(node[::-1], gain[::-1])[::-1]
    before, after = node[:-1], node[1:]
    top = np.minimum(speed**2, 0.5 * (before + after + gain))
    higher = np.maximum(before, after)
    top = np.where(top <= higher * (1.0 + 1e-12), higher, top)  # no ramps made of rounding
    up = np.minimum((top - before) / (2.0 * acceleration), length)
    down = np.minimum((top - after) / (2.0 * acceleration), length - up)
    x = np.stack([cells.edges[:-1], cells.edges[:-1] + up, cells.edges[1:] - down], axis=1)
    begin = x.reshape(-1)
    end = np.append(begin[1:], cells.edges[-1])
    u = np.stack([before, top, top], axis=1).reshape(-1)
    u_end = np.stack([top, top, after], axis=1).reshape(-1)
    rising, falling = np.where(up > 0, acceleration, 0.0), np.where(down > 0, -acceleration, 0.0)
    a = np.stack([rising, np.zeros_like(up), falling], axis=1).reshape(-1)
    end = np.maximum(end, begin)
    stretch = np.repeat(cells.stretch, 3)
    _cut_peaks(begin, end, u, u_end, a, _LASTING * window[stretch], stretch)
    keep = end > begin
    begin, end, u, u_end, a = (values[keep] for values in (begin, end, u, u_end, a))
    v, v_end = np.sqrt(u), np.sqrt(u_end)
    with np.errstate(divide="ignore"):
        duration = 2.0 * (end - begin) / (v + v_end)
    return Ramps(begin, end - begin, v, v_end, a, duration, stretch[keep])


def _cut_peaks(
    begin: Values, end: Values, u: Values, u_end: Values, a: Values, window: Values, stretch: Values
) -> None:
    """Lower each peak, in place, until it lasts its window."""
    moving = np.flatnonzero((a != 0.0) & (end > begin))
    rising = a[moving] > 0
    pair = rising[:-1] & ~rising[1:] & (stretch[moving[:-1]] == stretch[moving[1:]])
    left, right = moving[:-1][pair], moving[1:][pair]
    short = begin[right] - end[left] < np.sqrt(u_end[left]) * window[left]
    left, right = left[short], right[short]
    if not len(left):
        return
    # most peaks are cut within the two ramps that meet there
    w = _cut(begin[left], end[right], u[left], u_end[right], a[left], -a[right], window[left])
    easy = w**2 >= np.maximum(u[left], u_end[right])
    i, j, level = left[easy], right[easy], w[easy] ** 2
    _lower(begin, end, u, u_end, i, j, level, a)
    # spare rows between the two ramps hold what was cut off
    wide = np.flatnonzero(j - i > 2)
    for k in wide.tolist():
        _flatten(begin, end, u, u_end, a, int(i[k]), int(j[k]))
    for i_, j_ in zip(left[~easy].tolist(), right[~easy].tolist(), strict=True):
        _descend(begin, end, u, u_end, a, window, i_, j_)


def _cut(x0: Any, x1: Any, u0: Any, u1: Any, up: Any, down: Any, window: Any) -> Any:
    """Return the speed w at which two ramps, to be met from u0 at x0 and u1 at x1, are T apart."""
    bend = 0.5 / up + 0.5 / down
    reach = x1 - x0 + 0.5 * u0 / up + 0.5 * u1 / down
    return 2.0 * reach / (window + np.sqrt(window**2 + 4.0 * bend * reach))


def _lower(
    begin: Values, end: Values, u: Values, u_end: Values, i: Any, j: Any, level: Any, a: Values
) -> None:
    """End ramp i and start ramp j at a level, with the row after i level in between."""
    xl = np.minimum(begin[i] + (level - u[i]) / (2.0 * a[i]), end[i])
    xr = np.maximum(end[j] - (level - u_end[j]) / (-2.0 * a[j]), begin[j])
    end[i], u_end[i] = xl, level
    begin[j], u[j] = xr, level
    m = i + 1
    begin[m], end[m], u[m], u_end[m], a[m] = xl, xr, level, level, 0.0


def _flatten(
    begin: Values, end: Values, u: Values, u_end: Values, a: Values, i: int, j: int
) -> None:
    """Empty the rows between the level row after ramp i and ramp j."""
    rest = slice(i + 2, j)
    begin[rest] = end[rest] = begin[j]
    u[rest] = u_end[rest] = u[j]
    a[rest] = 0.0


def _descend(
    begin: Values, end: Values, u: Values, u_end: Values, a: Values, window: Values, i: int, j: int
) -> None:
    """Walk down both sides of a peak until the level is found at which it lasts its window."""
    lasting = float(window[i])
    while True:
        w = float(_cut(begin[i], end[j], u[i], u_end[j], a[i], -a[j], lasting))
        floor = max(float(u[i]), float(u_end[j]))
        level = max(w * w, floor)
        if w * w >= floor:
            break
        below = _next(begin, end, a, i, -1) if u[i] >= floor else i
        beyond = _next(begin, end, a, j, 1) if u_end[j] >= floor else j
        if below < 0 or beyond < 0 or a[below] < 0 or a[beyond] > 0:
            break  # a valley, which lasts its window
        i, j = below, beyond
        left = end[i] - (u_end[i] - floor) / (2.0 * a[i])
        right = begin[j] + (u[j] - floor) / (-2.0 * a[j])
        if right - left >= np.sqrt(floor) * lasting:
            break  # a shoulder at this level makes it long enough
    _lower(begin, end, u, u_end, i, j, level, a)
    _flatten(begin, end, u, u_end, a, i, j)


def _next(begin: Values, end: Values, a: Values, k: int, step: int) -> int:
    """Return the next ramp that is neither empty nor level, -1 if there is none."""
    k += step
    while 0 <= k < len(a):
        if a[k] != 0.0 and end[k] > begin[k]:
            return k
        k += step
    return -1
