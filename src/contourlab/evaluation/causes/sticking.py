"""On which side the friction of an axis is, found by moving the axis.

The loop of an axis is known from its answers (:mod:`.response`): with y₀ the position that it would
have without friction, the axis is at y = y₀ - G g, G the loop's answer to friction. Each sample is
solved for the side g that goes with its motion:

    while it slides     g = ± (1 + β exp(-(v/v_s)²))                                         (1)
    while it sticks     g such that y stays, until that takes more than (1) at rest
    before it slides    dg/dy = (g of (1) - g) / d                                           (2)

or it creeps            g = (1) tanh(v/v₀)                                                       (3)

(2) is the presliding friction of rolling elements, in the form of Dahl; with d = 0 it is Coulomb's.
β is how much higher friction is at rest (Stribeck).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi

from contourlab.evaluation.causes.basis import Stage

__all__ = ["RESTS", "Sliding", "slide"]

BLOCK = 256
"""Samples of steady sliding that are computed at once."""
FULL = 0.999
"""Side from which an axis slides."""
SLOW = 3.0
"""Speed in units of v_s below which (1) counts: exp(-9) is nothing."""
HALVINGS = 12
RESTS = 3
"""Samples that an axis stands still at first, from which it starts from rest."""

Values = NDArray[Any]


class Sliding(NamedTuple):
    """How friction sets in."""

    distance: float = 0.0
    """d of (2) [m]."""
    creep: float = 0.0
    """v₀ of (3) [m/s]."""
    rise: float = 0.0
    """β of (1)."""
    speed: float = 1.0
    """v_s of (1) [m/s]."""
    none: bool = False
    """Whether there is no friction."""
    before: float = 0.0
    """Side while an axis rests at first, in units of that of its first motion."""


def slide(
    stage: Stage, free: Values, d: Values, coefficients: Values, how: Sliding
) -> Values | None:
    """Return g, shape (n,); None if the loop's answer lets a force move the axis against it.

    Parameters
    ----------
    stage
        The axis.
    free
        y₀ [m].
    d
        The loop's denominator.
    coefficients
        Of its answer to friction, as of :func:`~.response.peaks_of` [m].
    how
        How friction sets in.
    """
    top = np.zeros(len(d))
    term = np.array([1.0, -1.0])
    for b in coefficients[:-1]:
        top[: len(term)] += b * term
        term = np.convolve(term, [1.0, -1.0])[: len(d)]
    top[0] += coefficients[-1] * d.sum()
    if not top[0] > 0.0:
        return None
    side = np.zeros(len(free))
    for at in stage.parts:
        gone = stage.commanded[at] - stage.commanded[at.start]
        moves = np.flatnonzero(np.abs(gone) > stage.least)
        if not len(moves):
            continue
        way = float(np.sign(gone[moves[0]]))
        begins = int(np.flatnonzero(gone)[0])
        first = way if begins <= RESTS else way * how.before  # else it begins in motion
        side[at] = _moved(free[at], top, d, how, first, stage.sample_time)
    return side


def _moved(
    free: Values, top: Values, d: Values, how: Sliding, first: float, sample_time: float
) -> Values:
    n, order = len(free), len(d) - 1
    out = np.empty(n)
    b, a, values = top.tolist(), d.tolist(), free.tolist()
    state = (lfilter_zi(top, d) * first).tolist()  # at rest, with that friction
    side = first
    at = values[0] - float(top.sum() / d.sum()) * first
    speed = how.speed * sample_time
    k, step, slides = 0, 0.0, False
    while k < n:
        if slides and not (how.rise and abs(step) < SLOW * speed):
            side = math.copysign(1.0, side)
            stop = min(k + BLOCK, n)
            answer, _ = lfilter(top, d, np.full(stop - k, side), zi=state)
            y = free[k:stop] - answer
            ahead = np.diff(y, prepend=at) * side
            turned = np.flatnonzero(ahead <= (SLOW * speed if how.rise else 0.0))
            count = int(turned[0]) if len(turned) else stop - k
            if count:
                _, left = lfilter(top, d, np.full(count, side), zi=state)
                state, at = left.tolist(), float(y[count - 1])
                step = float(ahead[count - 1]) * side
                out[k : k + count] = side
                k += count
            slides = False
            continue
        rest = values[k] - state[0]  # y = rest - b[0] g
        wanted = (rest - at) / b[0]
        most = 1.0
        if how.rise:
            slow = step / speed if wanted * step > 0.0 else 0.0
            most += how.rise * math.exp(-min(slow * slow, 50.0))
        if how.distance > 0.0:
            side = _presliding(side, rest - at, b[0], how.distance, most)
        elif how.creep > 0.0:
            side = _creeping(rest - at, b[0], how.creep * sample_time, most)
        else:
            side = max(-most, min(most, wanted))
        answer = state[0] + b[0] * side
        for i in range(order - 1):
            state[i] = state[i + 1] + b[i + 1] * side - a[i + 1] * answer
        state[order - 1] = b[order] * side - a[order] * answer
        step = values[k] - answer - at
        at += step
        out[k] = side
        k += 1
        slides = abs(side) >= FULL and step * side > 0.0
    return out


def _presliding(side: float, ahead: float, gain: float, distance: float, most: float) -> float:
    """Return g of (2) after a sample in which y would go ahead without friction."""
    end = most if ahead - gain * side > 0.0 else -most
    way_of = 1.0 if end > 0.0 else -1.0
    low, high = side, end
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        way = (ahead - gain * middle) * way_of
        there = end + (side - end) * math.exp(-way / distance) if way > 0.0 else side
        if (there - middle) * way_of > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _creeping(ahead: float, gain: float, step: float, most: float) -> float:
    """Return g of (3) after a sample in which y would go ahead without friction."""
    low, high = -most, most
    for _ in range(HALVINGS + 8):
        middle = 0.5 * (low + high)
        if most * math.tanh((ahead - gain * middle) / step) > middle:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
