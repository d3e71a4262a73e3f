"""The signals that a cause leaves in the tracking error of an axis.

With r the commanded position and e = r - y the tracking error of an axis,

    lag            ψ_k = L^k r - L^(k+1) r,         L = 1 / (T s + 1)                     (1)
    friction       φ_k = L^k g - L^(k+1) g,         g the friction's side, -1 to 1        (2)
    lost motion    b ∈ [-1, 1], the side of its play on which the axis is                 (3)
    scale          r, about its mean                                                      (4)
    squareness     the position of another axis                                           (5)
    cyclic         sin 2πr/p, cos 2πr/p                                                   (6)

(1) is T s L^(k+1) r: with a few k, any stable servo whose error vanishes at rest, to first order
its lag times the velocity. (2) is what a servo with integral action leaves of a friction force that
reverses with the motion: a peak that dies out. Both are Laguerre's functions, up to a change of
basis; T is found by scanning. After a reversal an axis sticks until the force on it has changed by
twice the friction: g goes from one side to the other while the axis without friction would move by
a distance that is scanned too, as in (3). Where an axis rests at first, g begins at 0 or at either
side, whatever fits.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from contourlab.evaluation.causes.reversals import direction, lost_motion, turning_points

__all__ = [
    "LAGS", "PEAKS", "Stage", "lag_time", "lags_of", "peaks_of", "sides_of", "stage_of",
]  # fmt: skip

LAGS = 4
"""Terms of (1)."""
PEAKS = 3
"""Terms of (2)."""
RESTS = 3
"""Samples that an axis stands still at first, from which it starts from rest."""

Values = NDArray[Any]


class Stage(NamedTuple):
    """A record of one axis, ready for a fit."""

    commanded: Values
    """r, shape (n,) [m]."""
    error: Values
    """e [m]."""
    parts: tuple[slice, ...]
    """Rows between breaks."""
    sample_time: float
    """[s]"""
    least: float
    """Reversals smaller than this are flicker [m]."""


def stage_of(
    commanded: Values, actual: Values, parts: list[slice], dt: float, least: float
) -> Stage:
    """Return a record of one axis.

    Parameters
    ----------
    commanded, actual
        Shape (n,) [m].
    parts
        Rows between breaks.
    dt
        Sample time [s].
    least
        Reversals smaller than this are flicker [m].
    """
    return Stage(commanded, commanded - actual, tuple(parts), dt, least)


def _lowpass(values: Values, parts: tuple[slice, ...], pole: float) -> Values:
    """Return L of a signal, at rest before each of its parts."""
    out = np.empty_like(values)
    for at in parts:
        x = values[at]
        start = [pole * x[0]] if len(x) else [0.0]
        out[at] = lfilter([1.0 - pole], [1.0, -pole], x, zi=start)[0]
    return out


def _differences(values: Values, parts: tuple[slice, ...], pole: float, count: int) -> Values:
    """Return the terms of (1) or (2), shape (n, count)."""
    columns = []
    before = values
    for _ in range(count):
        after = _lowpass(before, parts, pole)
        columns.append(before - after)
        before = after
    return np.column_stack(columns)


def lags_of(stage: Stage, time_constant: float) -> Values:
    """Return (1), shape (n, LAGS).

    Parameters
    ----------
    stage
        The axis.
    time_constant
        T [s].
    """
    pole = float(np.exp(-stage.sample_time / time_constant))
    return _differences(stage.commanded, stage.parts, pole, LAGS)


def peaks_of(
    stage: Stage, moved: Values, time_constant: float, stick: float, before: float = 1.0
) -> Values:
    """Return (2), shape (n, PEAKS).

    Parameters
    ----------
    stage
        The axis.
    moved
        Where the axis is without the causes of (2) and (3): its reversals count [m].
    time_constant
        T [s].
    stick
        Distance over which the friction changes its side [m].
    before
        Friction while an axis rests at first, on the side of its first motion: 1 if the servo holds
        it already, 0 for none, -1 for that of the other way.
    """
    pole = float(np.exp(-stage.sample_time / time_constant))
    sides = sides_of(stage, moved, stick)
    if before != 1.0:
        sides = _started(stage, moved, sides, stick, before)
    return _differences(sides, stage.parts, pole, PEAKS)


def sides_of(stage: Stage, moved: Values, play: float) -> Values:
    """Return (3), or with no play the direction of motion, shape (n,).

    Parameters
    ----------
    stage
        The axis.
    moved
        As in :func:`peaks_of` [m].
    play
        Width of the play [m].
    """
    out = np.zeros(len(moved))
    for at in stage.parts:
        rows, signs = turning_points(moved[at], stage.least)
        if play > 0.0:
            out[at] = lost_motion(moved[at], rows, signs, play)
        else:
            out[at] = direction(len(out[at]), rows, signs)
    return out


def _started(stage: Stage, moved: Values, sides: Values, stick: float, before: float) -> Values:
    """Return the friction's side with what it is before an axis moves for the first time."""
    out = sides.copy()
    for at in stage.parts:
        left = np.flatnonzero(stage.commanded[at] != stage.commanded[at.start])
        if not len(left) or left[0] <= RESTS:
            continue
        start = int(left[0]) - 1
        turns = turning_points(moved[at], stage.least)[0]
        turns = turns[turns > start]
        stop = int(turns[0]) + 1 if len(turns) else at.stop - at.start
        way = np.abs(moved[at][start:stop] - moved[at][start])
        # as after a reversal, which goes from -1 to 1 over the distance of sticking
        gone = 2.0 * way / stick if stick > 0.0 else np.where(way > 0.0, 2.0, 0.0)
        first = out[at][stop - 1]
        out[at.start : at.start + start] = before * first
        out[at.start + start : at.start + stop] = first * np.minimum(before + gone, 1.0)
    return out


def lag_time(coefficients: Values, time_constant: float, sample_time: float) -> float:
    """Return the lag at constant velocity that (1) amounts to [s].

    Parameters
    ----------
    coefficients
        Of the terms of (1).
    time_constant
        T [s].
    sample_time
        [s]
    """
    pole = float(np.exp(-sample_time / time_constant))
    # each term is the sampled low-pass's own lag behind a ramp, which is T - sample_time / 2
    return float(sample_time * pole / (1.0 - pole) * coefficients.sum())
