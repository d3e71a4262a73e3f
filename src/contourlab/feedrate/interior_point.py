"""The fastest pace under the limits of the axes: an interior point method with a banded Hessian.

Along a motion q(u) that is run at the pace w, with c = w², the axes move by

    velocity       q' √c
    acceleration   q'' c + q' c'/2
    jerk           √c (q''' c + 3/2 q'' c' + 1/2 q' c''),

so that the limits V, A, J ask of c, at every place

    q'² c <= V²,   |q'' c + q' c'/2| <= A,   |q''' c + 3/2 q'' c' + 1/2 q' c''| <= J / √c.

c is a spline of degree 2; the limits are asked for at collocation points. The time ∫ du/√c is
convex in c and so is every limit but the last, whose right side is convex where it should be
concave. A barrier -μ Σ log(slack) keeps the iterates inside. In its Hessian the curvature of J/√c,
the only negative term, is left out: then each Newton step goes down, and a search along it keeps
all limits. It ends in a local minimum, which for J = ∞ is the global one.

A spline couples three coefficients, so the Hessian has five diagonals and a step costs O(n). All
stretches are solved at once; each has its own step length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from contourlab.feedrate.retiming import spline_values

__all__ = ["Collocation", "fastest_pace"]

Values = NDArray[Any]

_FIRST_BARRIER = 0.03
_BARRIER_FACTOR = 0.2
_NEWTON_STEPS = 5
_HALVINGS = 24
_INSIDE = 0.9
"""The start takes this share of the limits that bind."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Collocation:
    """Where the limits are asked for, and the motion there; m points of some stretches."""

    stretch: Values
    """Number of each point's stretch, shape (m,)."""
    interval: Values
    """First spline coefficient of the interval that holds the point."""
    place: Values
    """Where in the interval, 0 to 1."""
    piece: Values
    """Piece of the path that holds the point."""
    h: Values
    """Length of the interval [s]."""
    time_weight: Values
    """Share of the point in the time of its stretch; they sum to 1."""
    barrier_weight: Values
    """Share of the point in the barrier of its stretch; they sum to 1."""
    most: Values
    """Largest c for the sake of velocities and feed; inf where nothing moves."""
    first: Values
    """First derivative q' of the axes over own time, shape (m, n_axes) [m/s]."""
    second: Values
    """Second derivative [m/s²]."""
    third: Values
    """Third derivative [m/s³]."""
    acceleration: Values
    """A of each axis [m/s²]."""
    jerk: Values
    """J of each axis [m/s³]."""
    coefficient_stretch: Values
    """Stretch of each coefficient."""

    @property
    def n_stretches(self) -> int:
        """Count of stretches."""
        return int(self.coefficient_stretch[-1]) + 1

    def shares(self, coefficient: Values) -> Values:
        """Return the share of each limit that each point takes, with its sign.

        Columns are speed squared, the acceleration of each axis, the jerk of each axis.

        Parameters
        ----------
        coefficient
            Of c.
        """
        c, d, e = spline_values(self.interval, self.place, self.h, coefficient)[:, :, None]
        acceleration = self.second * c + 0.5 * self.first * d
        jerk = np.sqrt(c) * (self.third * c + 1.5 * self.second * d + 0.5 * self.first * e)
        return np.concatenate(
            [c / self.most[:, None], acceleration / self.acceleration, jerk / self.jerk], axis=1
        )

    def mended_by(self, shares: Values) -> Values:
        """Return by how much c must be divided, place by place, to bring shares down to 1.

        Squared speed and acceleration go with c, jerk with c√c.

        Parameters
        ----------
        shares
            As from ``shares``, shape (m, 1 + 2 n_axes).
        """
        split = shares.shape[1] - len(self.jerk)
        largest = np.abs(shares)
        divisor: Values = np.maximum(
            largest[:, :split].max(axis=1), largest[:, split:].max(axis=1) ** (2.0 / 3.0)
        )
        return divisor


def fastest_pace(points: Collocation, last_barrier: float) -> Values:
    """Return the coefficients of the c of least time, strictly within the limits at the points.

    Parameters
    ----------
    points
        Of all stretches.
    last_barrier
        Smallest μ, as a share of the time: the result is within some ten times that of the best.
    """
    steady = np.ones(len(points.coefficient_stretch))
    worst = np.zeros(points.n_stretches)
    np.maximum.at(worst, points.stretch, points.mended_by(points.shares(steady)))
    x = (_INSIDE / worst)[points.coefficient_stretch]
    barrier = _Barrier(points)
    mu = _FIRST_BARRIER
    while mu > last_barrier:
        for _ in range(_NEWTON_STEPS):
            x, settled = barrier.step(x, mu)
            if settled:
                break
        mu *= _BARRIER_FACTOR
    return x


class _Barrier:
    """The time of each stretch plus its barrier, in units of the time at the pace 1."""

    def __init__(self, points: Collocation) -> None:
        self.points = points
        self.by_acceleration = (
            points.second / points.acceleration,
            0.5 * points.first / points.acceleration,
        )
        self.by_jerk = (
            points.third / points.jerk,
            1.5 * points.second / points.jerk,
            0.5 * points.first / points.jerk,
        )
        s, h = points.place, points.h
        zero = np.zeros_like(s)
        # rows c, c', c'' over the three coefficients of an interval
        self.basis = np.stack(
            [
                [0.5 * (1.0 - s) ** 2, 0.5 + s - s * s, 0.5 * s * s],
                [(s - 1.0) / h, (1.0 - 2.0 * s) / h, s / h],
                [1.0 / h**2 + zero, -2.0 / h**2 + zero, 1.0 / h**2 + zero],
            ]
        )

    def _slacks(
        self, c: Values, d: Values, e: Values, rows: Any = slice(None)
    ) -> tuple[Values, Values, Values]:
        """Return 1 - c/most, and 1 -+ acceleration/A, 1/√c -+ jerk/(J √c), signs side by side."""
        a0, a1 = (value[rows] for value in self.by_acceleration)
        j0, j1, j2 = (value[rows] for value in self.by_jerk)
        a = a0 * c[:, None] + a1 * d[:, None]
        j = j0 * c[:, None] + j1 * d[:, None] + j2 * e[:, None]
        top = (1.0 / np.sqrt(c))[:, None]
        return (
            1.0 - c / self.points.most[rows],
            np.concatenate([1.0 - a, 1.0 + a], axis=1),
            np.concatenate([top - j, top + j], axis=1),
        )

    def _values(self, x: Values, rows: Any = slice(None)) -> Values:
        points = self.points
        return spline_values(points.interval[rows], points.place[rows], points.h[rows], x)

    def merit(self, x: Values, mu: float, asked: Values | None = None) -> Values:
        """Return the merit of each stretch, inf outside; of those asked for, 0 for the others."""
        points = self.points
        rows: Any = slice(None) if asked is None else np.flatnonzero(asked[points.stretch])
        c, d, e = self._values(x, rows)
        inside = c > 0.0
        c = np.where(inside, c, 1.0)
        velocity, acceleration, jerk = self._slacks(c, d, e, rows)
        inside &= (velocity > 0.0) & (acceleration > 0.0).all(axis=1) & (jerk > 0.0).all(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log(velocity) + np.log(acceleration).sum(axis=1) + np.log(jerk).sum(axis=1)
        time, barrier = points.time_weight[rows], points.barrier_weight[rows]
        each = np.where(inside, time / np.sqrt(c) - mu * barrier * logs, np.inf)
        return np.bincount(points.stretch[rows], each, points.n_stretches)

    def step(self, x: Values, mu: float) -> tuple[Values, bool]:
        """Return the next iterate and whether no stretch moved much."""
        points = self.points
        gradient, bands = self._newton(x, mu)
        ridge = 1e-13 * bands[2].max()
        bands[2] += ridge
        move = -solveh_banded(bands, gradient, check_finite=False)
        falls = np.bincount(points.coefficient_stretch, -gradient * move, points.n_stretches)
        if not np.isfinite(move).all():
            return x, True
        here = self.merit(x, mu)
        length = np.ones(points.n_stretches)
        worse = np.ones(points.n_stretches, bool)
        for _ in range(_HALVINGS):
            trial = x + length[points.coefficient_stretch] * move
            falls_short = here - 1e-4 * length * falls
            worse &= ~(self.merit(trial, mu, worse) <= falls_short)
            if not worse.any():
                break
            length[worse] *= 0.5
        length[worse] = 0.0
        return x + length[points.coefficient_stretch] * move, bool((falls < 0.05 * mu).all())

    def _newton(self, x: Values, mu: float) -> tuple[Values, Values]:
        points = self.points
        c, d, e = self._values(x)
        velocity, acceleration, jerk = self._slacks(c, d, e)
        n_axes = points.first.shape[1]
        w = mu * points.barrier_weight
        # gradient of each slack over (c, c', c''), divided by the slack; signs side by side
        a0, a1 = (_both(-value) / acceleration for value in self.by_acceleration)
        j0, j1, j2 = self.by_jerk
        root = -0.5 * c**-1.5
        top = np.broadcast_to(root[:, None], (len(c), 2 * n_axes))
        g0, g1, g2 = ((top + _both(-j0)) / jerk, _both(-j1) / jerk, _both(-j2) / jerk)
        v0 = -1.0 / (points.most * velocity)
        slope = np.stack(
            [
                points.time_weight * root - w * (v0 + a0.sum(axis=1) + g0.sum(axis=1)),
                -w * (a1.sum(axis=1) + g1.sum(axis=1)),
                -w * g2.sum(axis=1),
            ]
        )

        def dot(p: Values, q: Values) -> Values:
            product: Values = np.einsum("ij,ij->i", p, q)
            return product

        hessian = {
            (0, 0): points.time_weight * 0.75 * c**-2.5 + w * (v0**2 + dot(a0, a0) + dot(g0, g0)),
            (0, 1): w * (dot(a0, a1) + dot(g0, g1)),
            (0, 2): w * dot(g0, g2),
            (1, 1): w * (dot(a1, a1) + dot(g1, g1)),
            (1, 2): w * dot(g1, g2),
            (2, 2): w * dot(g2, g2),
        }
        n = len(points.coefficient_stretch)
        gradient, bands = np.zeros(n), np.zeros((3, n))
        for k in range(3):
            local = sum(slope[p] * self.basis[p, k] for p in range(3))
            gradient += np.bincount(points.interval + k, local, n)
            for m in range(k, 3):
                local = sum(
                    value * (self.basis[p, k] * self.basis[q, m])
                    + (value * (self.basis[q, k] * self.basis[p, m]) if p != q else 0.0)
                    for (p, q), value in hessian.items()
                )
                bands[2 - (m - k)] += np.bincount(points.interval + m, local, n)
        return gradient, bands


def _both(value: Values) -> Values:
    """Return a term of the slacks 1 - f and 1 + f side by side, given that of the first."""
    return np.concatenate([value, -value], axis=1)
