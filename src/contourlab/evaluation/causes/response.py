"""How a servo loop answers its command and a force: the terms of an axis' tracking error.

With r the commanded position, g the friction's side and e = r - y the tracking error, a linear loop
of order N leaves

    e = (1 - z⁻¹) / D(z) [ Σ_k a_k (1 - z⁻¹)^k r + Σ_k b_k (1 - z⁻¹)^k g ] + D(1) / D(z) c g     (1)

with one denominator D for all: its roots are the poles of the closed loop. An error that vanishes
at rest has the zero in front; to first order it is the lag times the velocity. A loop with integral
action has c = 0: a friction force that reverses leaves a peak that dies out. Without, it leaves an
offset that changes its sign with the motion. The poles are a real one and a pair, or two pairs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from contourlab.evaluation.causes.basis import Stage

__all__ = [
    "ORDERS", "PEAKS", "bounds_of", "decay_time", "denominator", "lag_time", "lags_of", "peaks_of",
    "richer", "start_of",
]  # fmt: skip

ORDERS = {"pair and pole": 3, "two pairs": 4}
"""Order of the loop by its poles."""
PEAKS = 2
"""Terms b of (1): a force reaches the position two integrators later, so few of them count."""
SLOWEST = 0.3
"""Smallest pole [rad/s]."""
FASTEST = 1.5
"""Largest pole times the sample time: a faster one is gone within a sample."""
DAMPING = (0.05, 3.0)
"""Of a pair; above, its poles are real and apart."""

Values = NDArray[Any]


def start_of(kind: str, rate: float) -> Values:
    """Return parameters of poles that lie together: logarithms of rates and damping ratios.

    Parameters
    ----------
    kind
        One of :data:`ORDERS`.
    rate
        Where they lie [rad/s].
    """
    pair = [np.log(1.5 * rate), 0.0]
    return np.array({"pair and pole": [*pair, np.log(rate)],
                     "two pairs": [*pair, np.log(3.0 * rate), 0.0]}[kind])  # fmt: skip


def richer(kind: str, poles: Values) -> tuple[str, Values] | None:
    """Return the next higher order, with its first guess of poles; None if there is none.

    Parameters
    ----------
    kind, poles
        Those that are known.
    """
    if kind == "pair and pole":
        return "two pairs", np.append(poles, 0.2)
    return None


def bounds_of(kind: str, sample_time: float) -> tuple[Values, Values]:
    """Return the least and largest parameters of poles.

    Parameters
    ----------
    kind
        One of :data:`ORDERS`.
    sample_time
        [s]
    """
    rate = (np.log(min(SLOWEST, 0.01 / sample_time)), np.log(FASTEST / sample_time))
    ratio = (np.log(DAMPING[0]), np.log(DAMPING[1]))
    rows = {"pair and pole": (rate, ratio, rate),
            "two pairs": (rate, ratio, rate, ratio)}[kind]  # fmt: skip
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])


def denominator(kind: str, poles: Values, sample_time: float) -> Values:
    """Return D of (1), coefficients of powers of z⁻¹.

    Parameters
    ----------
    kind
        One of :data:`ORDERS`.
    poles
        Parameters, see :func:`start_of`.
    sample_time
        [s]
    """
    out = _pair(poles[0], poles[1], sample_time)
    if kind == "pair and pole":
        return np.convolve(out, [1.0, -np.exp(-np.exp(poles[2]) * sample_time)])
    return np.convolve(out, _pair(poles[2], poles[3], sample_time))


def _pair(rate: float, ratio: float, sample_time: float) -> Values:
    w, z = np.exp(rate) * sample_time, np.exp(ratio)
    apart = w * np.sqrt(abs(z * z - 1.0))
    if z <= 1.0:
        return np.array([1.0, -2.0 * np.exp(-z * w) * np.cos(apart), np.exp(-2.0 * z * w)])
    both = np.exp(apart - z * w) + np.exp(-apart - z * w)
    return np.array([1.0, -both, np.exp(-2.0 * z * w)])


def _differences(values: Values, stage: Stage, d: Values, count: int) -> Values:
    out = np.empty((len(values), count))
    for at in stage.parts:
        column = lfilter([1.0], d, np.diff(values[at], prepend=values[at][:1]))
        for k in range(count):
            out[at, k] = column
            column = np.diff(column, prepend=0.0)
    return out


def lags_of(stage: Stage, d: Values) -> Values:
    """Return the terms a of (1), shape (n, order).

    Parameters
    ----------
    stage
        The axis.
    d
        D.
    """
    return _differences(stage.commanded, stage, d, len(d) - 1)


def peaks_of(stage: Stage, side: Values, d: Values, count: int = PEAKS) -> Values:
    """Return the terms b of (1) and, as the last one, that of c; shape (n, count + 1).

    Parameters
    ----------
    stage
        The axis.
    side
        g, shape (n,).
    d
        D.
    count
        How many terms b.
    """
    out = np.empty((len(side), count + 1))
    out[:, :count] = _differences(side, stage, d, count)
    for at in stage.parts:
        first = side[at][:1]
        out[at, count] = first + lfilter([d.sum()], d, side[at] - first) if len(first) else 0.0
    return out


def lag_time(coefficients: Values, d: Values, sample_time: float) -> float:
    """Return the lag at constant velocity that (1) amounts to [s].

    Parameters
    ----------
    coefficients
        a.
    d
        D.
    sample_time
        [s]
    """
    return float(coefficients[0] * sample_time / d.sum())


def decay_time(coefficients: Values, d: Values, sample_time: float) -> float:
    """Return how long a peak of friction lasts: until it stays below 1 / e of its height [s].

    Parameters
    ----------
    coefficients
        b, without c.
    d
        D.
    sample_time
        [s]
    """
    slowest = float(np.abs(np.roots(d)).max())
    n = int(min(8.0 / max(-np.log(slowest), 1e-6), 20_000.0)) + 20
    step = np.zeros(n)
    step[0] = 1.0
    answer = lfilter([1.0], d, step)
    total = np.zeros(n)
    for b in coefficients:
        total += b * answer
        answer = np.diff(answer, prepend=0.0)
    size = np.abs(total)
    above = np.flatnonzero(size > np.exp(-1.0) * size.max())
    return float((above[-1] + 1 if len(above) else 0) * sample_time)
