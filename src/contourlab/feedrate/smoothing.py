"""A motion in time, smoothed by a moving average: exact, piecewise cubic, limited in jerk.

The average over a window T of a motion with piecewise constant acceleration a₀ has

    v(t) = (s₀(t) - s₀(t - T)) / T
    a(t) = (v₀(t) - v₀(t - T)) / T
    j(t) = (a₀(t) - a₀(t - T)) / T,

so that j is constant between instants of {t_k} and {t_k + T}. A stretch takes T longer than
planned.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.feedrate.profile import CubicProfile
from contourlab.feedrate.ramps import Ramps

__all__ = ["smooth"]

Values = NDArray[Any]

_SAME = 1e-9
"""Instants closer than this, in windows, are taken as one."""


def smooth(
    ramps: Ramps, window: Values, edges: Values, dwell: Values, dwell_before: float
) -> tuple[CubicProfile, Values]:
    """Return the smoothed motion over all stretches.

    Parameters
    ----------
    ramps
        The planned motion.
    window
        T of each stretch, shape (n_stretches,) [s].
    edges
        Arc lengths of the stops, shape (n_stretches + 1,) [m].
    dwell
        Time at rest after each stretch, shape (n_stretches,) [s].
    dwell_before
        Time at rest before the first [s].

    Returns
    -------
    CubicProfile
        The motion.
    Values
        Instants at which each stretch arrives [s].
    """
    n = len(window)
    planned = ramps.stretch_times(n)
    ends = dwell_before + np.cumsum(planned + window + dwell)
    begins = np.concatenate([[dwell_before], ends[:-1]])
    arrives = np.where(dwell > 0.0, begins + planned + window, ends)

    # every stretch as a table of ramps that ends with a row at rest; times from its own start
    own = np.concatenate([ramps.stretch, np.arange(n)])
    order = np.argsort(own, kind="stable")
    own = own[order]

    def table(values: Values, last: Values) -> Values:
        return np.concatenate([values, last])[order]

    zero = np.zeros(n)
    s0 = table(ramps.start - edges[ramps.stretch], np.diff(edges))
    v0, a0 = table(ramps.speed, zero), table(ramps.acceleration, zero)
    took = table(ramps.duration, zero)
    total = np.cumsum(took) - took
    first = np.searchsorted(own, np.arange(n))
    t0 = _within(took, own, first, total)

    m = len(own)
    instant = np.concatenate([t0, t0 + window[own]])
    stretch = np.concatenate([own, own])
    order = np.lexsort((instant, stretch))
    instant, stretch = instant[order], stretch[order]
    leading = order < m
    head = np.cumsum(leading) - 1  # row that holds the instant
    tail = np.cumsum(~leading) - 1  # row that holds the instant a window earlier
    # instants that differ by rounding are one: in between, one change of jerk would lack the other
    rounding = _SAME * window[stretch[1:]] + 2e-15 * instant[1:]
    apart = np.append(np.diff(instant) > rounding, True)
    apart |= np.append(stretch[1:] != stretch[:-1], True)
    instant, stretch, head, tail = (x[apart] for x in (instant, stretch, head, tail))
    waiting = tail < first[stretch]  # the window reaches before the start
    tail = np.maximum(tail, 0)
    h = np.maximum(instant - t0[head], 0.0)
    g = np.where(waiting, 0.0, np.maximum(instant - window[stretch] - t0[tail], 0.0))

    def state(row: Values, h: Values) -> tuple[Values, Values, Values]:
        return s0[row] + h * (v0[row] + 0.5 * h * a0[row]), v0[row] + h * a0[row], a0[row]

    ahead = state(head, h)
    behind = tuple(np.where(waiting, 0.0, value) for value in state(tail, g))
    speed, acceleration, jerk = (
        (x - y) / window[stretch] for x, y in zip(ahead, behind, strict=True)
    )
    last = np.append(stretch[1:] != stretch[:-1], True)
    starts = np.append(True, last[:-1])
    speed = np.where(last | starts, 0.0, np.maximum(speed, 0.0))
    acceleration = np.where(last | starts, 0.0, acceleration)
    jerk = np.where(last, 0.0, jerk)

    h = np.where(last, 0.0, np.append(np.diff(instant), 0.0))
    step = np.maximum(h * (speed + h * (0.5 * acceleration + h * jerk / 6.0)), 0.0)
    arc = _within(step, stretch, np.flatnonzero(starts), np.cumsum(step) - step)
    length = np.diff(edges)
    arc = arc * (length / arc[last])[stretch]  # rounding only: the sum is the length
    arc = np.where(last, edges[stretch + 1], np.minimum(edges[stretch] + arc, edges[stretch + 1]))
    time = np.minimum(begins[stretch] + instant, arrives[stretch])
    time[last] = arrives
    duration = float(ends[-1])
    if dwell_before > 0.0:
        zero = np.zeros(1)
        time, arc = np.concatenate([zero, time]), np.concatenate([edges[:1], arc])
        speed, acceleration, jerk = (np.concatenate([zero, x]) for x in (speed, acceleration, jerk))
    return CubicProfile(time, arc, speed, acceleration, jerk, duration), arrives


def _within(step: Values, group: Values, first: Values, total: Values) -> Values:
    """Return running sums that start anew in each group, without the rounding of a long sum."""
    if len(first) == 1:
        return total
    sizes = np.diff(np.append(first, len(step)))
    if int(sizes.max()) > 4096 or len(first) * int(sizes.max()) > 8 * len(step) + 4096:
        return np.concatenate([np.cumsum(part) - part for part in np.split(step, first[1:])])
    width = int(sizes.max())
    table = np.zeros((len(first), width))
    column = np.arange(len(step)) - first[group]
    table[group, column] = step
    sums = np.cumsum(table, axis=1) - table
    return sums[group, column]
