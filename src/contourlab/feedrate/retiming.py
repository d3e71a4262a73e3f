"""Running along a motion at another pace: exact, with a squared pace that is piecewise quadratic.

A motion is given over a time of its own, u. It is run at the pace w = du/dt, whose square c(u) is a
spline of degree 2. Since 2 w dw/dt = c' w, on each of its intervals

    d²u/dt² = c'(u) / 2 = (c'₀ + c'' (u - u₀)) / 2,

a linear equation, so that u(t) is known in closed form: with k = c''/2

    u(t) = u₀ + w₀ S(t) + c'₀/2 C(t),  S = sinh(√k t) / √k,  C = (cosh(√k t) - 1) / k = 2 S(t/2)²,

and the interval of length h takes the time T for which h = (w₀ + w₁) tanh(√k T/2) / √k. For k < 0
these are sine, cosine and tangent, for k = 0 their common limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Retiming", "spline_basis", "spline_values"]

Values = NDArray[Any]

_SERIES = 1e-3


@dataclass(frozen=True, eq=False)
class Retiming:
    """Own time u over real time, interval by interval; rows in ascending order."""

    time: Values
    """Real time at the start of each interval, shape (n,) [s]."""
    duration: Values
    """Real time that it takes [s]."""
    start: Values
    """u at its start [s]."""
    length: Values
    """Own time that passes [s]."""
    square: Values
    """c at its start."""
    slope: Values
    """c' there [1/s]."""
    bend: Values
    """c'' in it [1/s²]."""

    @staticmethod
    def of_spline(knots: Values, coefficient: Values, begin: float) -> Retiming:
        """Return the pace of one stretch.

        Parameters
        ----------
        knots
            u, ascending, shape (n + 1,) [s].
        coefficient
            Of the B-splines of degree 2 whose sum is c, shape (n + 2,).
        begin
            Real time at the first knot [s].
        """
        h = np.diff(knots)
        interval = np.arange(len(h))
        rows = spline_basis(knots, interval, np.zeros(len(h)))
        square, slope, bend = spline_values(rows, interval, coefficient)
        last = spline_basis(knots, interval[-1:], np.ones(1))
        end = spline_values(last, interval[-1:], coefficient)[0]
        ends = np.sqrt(np.append(square, end))
        took = _duration(h, ends[:-1], ends[1:], 0.5 * bend)
        time = begin + np.concatenate([[0.0], np.cumsum(took[:-1])])
        return Retiming(time, took, knots[:-1], h, square, slope, bend)

    @staticmethod
    def join(rows: Sequence[Retiming]) -> Retiming:
        """Return the intervals of several in one.

        Parameters
        ----------
        rows
            In ascending order.
        """
        return Retiming(
            *(
                np.concatenate([getattr(row, field.name) for row in rows])
                for field in fields(Retiming)
            )
        )

    def at(self, time: Values) -> tuple[Values, Values, Values, Values]:
        """Return u, c, c' and c'' at some instants.

        Parameters
        ----------
        time
            Shape (n,) [s]; beyond an interval the value at its end.
        """
        i = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.square) - 1)
        t = np.clip(time - self.time[i], 0.0, self.duration[i])
        k = 0.5 * self.bend[i]
        half = _hyperbolic(0.5 * t, k)
        step = np.sqrt(self.square[i]) * _hyperbolic(t, k) + self.slope[i] * half * half
        step = np.clip(step, 0.0, self.length[i])
        slope = self.slope[i] + self.bend[i] * step
        square = self.square[i] + step * (self.slope[i] + 0.5 * self.bend[i] * step)
        return self.start[i] + step, square, slope, self.bend[i]


def spline_basis(knots: Values, interval: Values, place: Values) -> Values:
    """Return value, slope and bend of the three B-splines of degree 2 at some places, (3, 3, m).

    With h_i the length of interval i, beyond both ends that of its neighbour, and x the
    coefficients, c(u_i) = (h_i x_i + h_i-1 x_i+1) / (h_i-1 + h_i) at knot i and
    c'(u_i) = 2 (x_i+1 - x_i) / (h_i-1 + h_i).

    Parameters
    ----------
    knots
        Ascending, shape (n + 1,) [s].
    interval
        Which interval, shape (m,).
    place
        Where in it, 0 to 1.
    """
    h = np.diff(knots)
    h = np.concatenate([h[:1], h, h[-1:]])
    here = h[interval + 1]
    first, second = 1.0 / (h[interval] + here), 1.0 / (here + h[interval + 2])
    zero = np.zeros_like(here)
    value = np.stack([here * first, h[interval] * first, zero])
    slope = np.stack([-2.0 * first, 2.0 * first, zero])
    bend = np.stack([2.0 * first, -2.0 * (first + second), 2.0 * second]) / here
    into = place * here
    return np.stack([value + into * (slope + 0.5 * into * bend), slope + into * bend, bend])


def spline_values(basis: Values, first: Values, coefficient: Values) -> Values:
    """Return c, c' and c'', shape (3, m).

    Parameters
    ----------
    basis
        As from ``spline_basis``.
    first
        First of the three coefficients of each place, shape (m,).
    coefficient
        All of them.
    """
    x = np.stack([coefficient[first + k] for k in range(3)])
    values: Values = np.einsum("pkm,km->pm", basis, x)
    return values


def _hyperbolic(t: Values, k: Values) -> Values:
    """Return sinh(√k t)/√k, for any sign of k."""
    z = k * t * t
    size = np.sqrt(np.abs(z))
    safe = np.where(size > 0.0, size, 1.0)
    series = 1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z / 5040.0))
    full = np.where(z > 0.0, np.sinh(np.minimum(safe, 700.0)), np.sin(safe)) / safe
    result: Values = t * np.where(np.abs(z) < _SERIES, series, full)
    return result


def _duration(h: Values, w0: Values, w1: Values, k: Values) -> Values:
    """Return T with h = (w₀ + w₁) tanh(√k T/2) / √k."""
    x = h / (w0 + w1)
    z = k * x * x
    size = np.sqrt(np.abs(z))
    safe = np.where(size > 0.0, size, 1.0)
    series = 1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z / 9.0)))
    full = np.where(z > 0.0, np.arctanh(np.minimum(safe, 1.0 - 1e-16)), np.arctan(safe)) / safe
    result: Values = 2.0 * x * np.where(np.abs(z) < _SERIES, series, full)
    return result
