"""The response of an axis in a position loop to its commanded position.

The cascade of most drives: a position gain K_v, a velocity loop with a PI law, and a share F of the
commanded velocity fed forward,

    v_w = K_v (r - q) + F r',    m q'' = k_p (v_w - q') + k_p x ∫(v_w - q') - friction       (1)

so that, with τ = m / k_p, whatever friction does while it does not change,

    q = (K_v + F s)(s + x) / (s (τ s² + s + x) + K_v (s + x)) r                             (2)

x = 0 is a velocity loop without integral, and a position loop of proportional and derivative action
too, whose damping takes a share F of the commanded velocity. Then (2) loses a factor s, and
constant friction holds the axis back by φ / K_v, with φ friction over k_p. r acts later by δ.
Between samples it is taken for a cubic spline, which a drive that interpolates finely follows; a
drive that holds its command acts half a sample later, which is then in δ.

(2) is solved exactly for signals that are linear between samples. F, friction and what a piece of
the record begins with are linear in q.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

__all__ = ["LoopResponse", "loop_polynomials", "loop_response"]

Rows = NDArray[Any]


class LoopResponse(NamedTuple):
    """q of (2) from rest is ``position`` and F times ``feed_forward``."""

    position: Rows
    """Without feed-forward [m], shape (n_samples,)."""
    feed_forward: Rows
    """Likewise."""
    start: Rows
    """Spans what a piece begins with, shape (length, n_states)."""


def loop_polynomials(gain: float, lag: float, integral: float) -> tuple[Rows, Rows, Rows]:
    """Return the polynomials of (2): of r, of F r, and the denominator.

    Parameters
    ----------
    gain
        K_v [1/s].
    lag
        τ [s].
    integral
        x [1/s]; 0 takes the factor s out.
    """
    if integral == 0.0:
        return np.array([gain]), np.array([1.0, 0.0]), np.array([lag, 1.0, gain])
    return (
        np.array([gain, gain * integral]),
        np.array([1.0, integral, 0.0]),
        np.array([lag, 1.0, integral + gain, gain * integral]),
    )


def loop_response(
    command: Rows, sample_time: float, gain: float, lag: float, integral: float, length: int
) -> LoopResponse:
    """Return (2) in parts.

    Parameters
    ----------
    command
        r as it acts, from 0 [m], shape (n_samples,).
    sample_time
        [s].
    gain, lag, integral
        As in :func:`loop_polynomials`.
    length
        Of the longest piece [samples].
    """
    of_r, of_f, bottom = loop_polynomials(gain, lag, integral)
    top, poles = _held_linear(bottom, sample_time)
    powers = np.stack([lfilter(row, poles, command) for row in top])
    start = lfilter([1.0], poles, np.eye(len(top), length), axis=1).T
    position, feed = (row[::-1] @ powers[: len(row)] for row in (of_r, of_f))
    return LoopResponse(position, feed, start)


def _held_linear(bottom: Rows, sample_time: float) -> tuple[Rows, Rows]:
    """Return s⁰ to sⁿ⁻¹ over a polynomial of order n as filters of samples, for signals that are
    linear between these: numerators, shape (n, n + 1), and the denominator."""
    order = len(bottom) - 1
    block = np.zeros((order + 2, order + 2))
    block[: order - 1, 1:order] = np.eye(order - 1)
    block[order - 1, :order] = -bottom[:0:-1] / bottom[0]
    block[order - 1, order] = 1.0 / bottom[0]
    block[order, order + 1] = 1.0 / sample_time
    whole = expm(block * sample_time)
    step, begin, rise = whole[:order, :order], whole[:order, order], whole[:order, order + 1]
    # states after 0, 1, ... samples of a single 1: it rises to it, and falls from it
    states = [rise]
    states.append(step @ rise + begin - rise)
    for _ in range(order - 1):
        states.append(step @ states[-1])
    poles = np.real(np.poly(step))
    markov = np.array(states).T
    # at the instant of the 1 the state has felt the rise before it
    top = np.stack([np.convolve(poles, row)[: order + 1] for row in markov])
    return top, poles
