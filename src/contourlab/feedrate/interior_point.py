"""The fastest pace under the limits of the axes: an interior point method with a banded Hessian.

Along a motion q(u) that is run at the pace w, with c = w², the axes move by

    velocity       q' √c
    acceleration   q'' c + q' c'/2
    jerk           √c (q''' c + 3/2 q'' c' + 1/2 q' c''),

so that the limits V, A, J ask of c, at every place

    q'² c <= V²,   |q'' c + q' c'/2| <= A,   |q''' c + 3/2 q'' c' + 1/2 q' c''| <= J / √c.

c is a spline of degree 2; the limits are asked for at collocation points. The time ∫ du/√c is
convex in c and so is every limit but the last, whose right side is convex where it should be
concave. The method is primal-dual and starts, and stays, inside the limits; in its Hessian the
curvature of J/√c, the only negative term, is left out. It ends in a local minimum, which for J = ∞
is the global one; the fastest iterate is returned.

A spline couples three coefficients, so the Hessian has five diagonals and a step costs O(n). All
stretches are solved at once; each has its own step length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from contourlab.feedrate.retiming import spline_values

__all__ = ["Collocation", "fastest_pace"]

Values = NDArray[Any]

_FIRST = 0.05
"""First product of slack and multiplier, per constraint, in units of the time."""
_CENTRING, _LEAST_CENTRING = 0.5, 0.05
_MOST_STEPS = 60
_BOUNDARY = 0.98
_ROUNDING = 1e-13
"""A slack is a difference of numbers about 1: less of it is rounding, and checked elsewhere."""
_RIDGES = (1e-14, 1e-11, 1e-8, 1e-5)
_INSIDE = 0.9
"""The start takes this share of the limits that bind."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Collocation:
    """Where the limits are asked for, and the motion there; m points of some stretches."""

    stretch: Values
    """Number of each point's stretch, shape (m,)."""
    own_time: Values
    """Own time of each point, ascending in a stretch [s]."""
    interval: Values
    """First spline coefficient of the interval that holds the point."""
    basis: Values
    """What its three coefficients give of c, c' and c'' at the point, shape (3, 3, m)."""
    piece: Values
    """Piece of the path that holds the point."""
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
        c, d, e = spline_values(self.basis, self.interval, coefficient)[:, :, None]
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


def fastest_pace(points: Collocation, gap: float) -> Values:
    """Return the coefficients of the c of least time, strictly within the limits at the points.

    Parameters
    ----------
    points
        Of all stretches.
    gap
        How much longer than the least the time may be, as a share of it.
    """
    steady = np.ones(len(points.coefficient_stretch))
    worst = np.zeros(points.n_stretches)
    np.maximum.at(worst, points.stretch, points.mended_by(points.shares(steady)))
    iteration = _PrimalDual(points, (_INSIDE / worst)[points.coefficient_stretch])
    for _ in range(_MOST_STEPS):
        if iteration.stuck or (iteration.gap() < gap * iteration.time()).all():
            break
        iteration.step()
    return iteration.best


class _PrimalDual:
    """Iterates strictly inside the limits, with a multiplier z for each slack s.

    A step solves (H + Σ z/s g gᵀ) dx = -(∇T - Σ μ/s g), g being the gradient of a slack, and moves
    z by μ/s - z - z/s g·dx. All stretches step at once, each by its own length and with its own μ.
    """

    def __init__(self, points: Collocation, x: Values) -> None:
        self.points, self.x, self.best = points, x, x.copy()
        self.least = np.full(points.n_stretches, np.inf)
        self.stuck = False
        self.by_acceleration = (
            points.second / points.acceleration,
            0.5 * points.first / points.acceleration,
        )
        self.by_jerk = (
            points.third / points.jerk,
            1.5 * points.second / points.jerk,
            0.5 * points.first / points.jerk,
        )
        self.values = self._values(x)
        self.slack = self._slack(self.values)
        self.columns = self.slack.shape[1]
        weight = points.barrier_weight[:, None]
        self.multiplier = _FIRST * weight / self.slack
        self.centring = np.full(points.n_stretches, _CENTRING)

    def time(self) -> Values:
        """Return the time of each stretch, in units of its own time."""
        each = self.points.time_weight / np.sqrt(self.values[0])
        return np.bincount(self.points.stretch, each, self.points.n_stretches)

    def gap(self) -> Values:
        """Return how much longer than the least the time of each stretch is at most, likewise."""
        each = (self.multiplier * self.slack).sum(axis=1)
        return np.bincount(self.points.stretch, each, self.points.n_stretches)

    def _values(self, x: Values) -> Values:
        return spline_values(self.points.basis, self.points.interval, x)

    def _slack(self, values: Values) -> Values:
        """Return 1 - c/most, 1 -+ acceleration/A and 1/√c -+ jerk/(J √c), column by column."""
        c, d, e = values
        a0, a1 = self.by_acceleration
        j0, j1, j2 = self.by_jerk
        top = (1.0 / np.sqrt(c))[:, None]
        c = c[:, None]
        a = a0 * c + a1 * d[:, None]
        j = j0 * c + j1 * d[:, None] + j2 * e[:, None]
        most = self.points.most[:, None]
        return np.concatenate([1.0 - c / most, 1.0 - a, 1.0 + a, top - j, top + j], axis=1)

    def step(self) -> None:
        """Take one step on every stretch."""
        points, s, z = self.points, self.slack, self.multiplier
        mu = (self.centring * self.gap() / self.columns)[points.stretch][:, None]
        target = mu * points.barrier_weight[:, None]
        gradient, bands = self._newton(target / s, z / s)
        move = _solved(bands, -gradient)
        if not np.isfinite(move).all():
            self.stuck = True
            return
        along = self._along(move)
        change = target / s - z - z / s * along
        dual = self._reach(z, change)
        # 1/√c is convex, so its slack falls short of nothing that its tangent promises
        c, dc = self.values[0][:, None], self._values(move)[0][:, None]
        primal = np.minimum(self._reach(s, along), self._reach(c, dc))
        self.x = self.x + primal[points.coefficient_stretch] * move
        self.multiplier = z + dual[points.stretch][:, None] * change
        self.values = self._values(self.x)
        self.slack = np.maximum(self._slack(self.values), _ROUNDING)
        good = np.minimum(primal, dual)
        self.centring = np.clip((1.0 - good) ** 2, _LEAST_CENTRING, 0.8)
        time = self.time()
        better = time < self.least
        self.least = np.where(better, time, self.least)
        self.best = np.where(better[points.coefficient_stretch], self.x, self.best)

    def _along(self, move: Values) -> Values:
        """Return the first-order change of each slack."""
        dc, dd, de = self._values(move)[:, :, None]
        a0, a1 = self.by_acceleration
        j0, j1, j2 = self.by_jerk
        a = a0 * dc + a1 * dd
        j = j0 * dc + j1 * dd + j2 * de
        top = -0.5 * (self.values[0] ** -1.5)[:, None] * dc
        return np.concatenate([-dc / self.points.most[:, None], -a, a, top - j, top + j], axis=1)

    def _reach(self, value: Values, change: Values) -> Values:
        """Return the longest step of each stretch, at most 1, that keeps its values positive."""
        points = self.points
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where(change < 0.0, -value / change, np.inf).min(axis=1)
        least = np.full(points.n_stretches, np.inf)
        np.minimum.at(least, points.stretch, most)
        return np.minimum(1.0, _BOUNDARY * least)

    def _newton(self, pull: Values, ratio: Values) -> tuple[Values, Values]:
        """Return gradient and Hessian, the multipliers being replaced by μ/s and z/s."""
        points, n_axes = self.points, self.points.first.shape[1]
        c = self.values[0]
        cuts = [1, 1 + n_axes, 1 + 2 * n_axes, 1 + 3 * n_axes]
        pv, pa, pb, pj, pk = np.split(pull, cuts, axis=1)
        rv, ra, rb, rj, rk = np.split(ratio, cuts, axis=1)
        a0, a1 = self.by_acceleration
        j0, j1, j2 = self.by_jerk
        root = -0.5 * c**-1.5
        v0 = -1.0 / points.most

        def dot(*factors: Values) -> Values:
            product: Values = np.einsum(",".join(["ij"] * len(factors)) + "->i", *factors)
            return product

        a_pull, j_pull = pb - pa, pk - pj
        slope = np.stack(
            [
                points.time_weight * root - v0 * pv[:, 0] - dot(a_pull, a0) - dot(j_pull, j0)
                - root * (pj + pk).sum(axis=1),
                -dot(a_pull, a1) - dot(j_pull, j1),
                -dot(j_pull, j2),
            ]
        )  # fmt: skip
        a_sum, j_sum, j_difference = ra + rb, rj + rk, rk - rj
        hessian = {
            (0, 0): points.time_weight * 0.75 * c**-2.5 + v0**2 * rv[:, 0] + dot(a_sum, a0, a0)
            + dot(j_sum, j0, j0) + root**2 * j_sum.sum(axis=1)
            + 2.0 * root * dot(j_difference, j0),
            (0, 1): dot(a_sum, a0, a1) + dot(j_sum, j0, j1) + root * dot(j_difference, j1),
            (0, 2): dot(j_sum, j0, j2) + root * dot(j_difference, j2),
            (1, 1): dot(a_sum, a1, a1) + dot(j_sum, j1, j1),
            (1, 2): dot(j_sum, j1, j2),
            (2, 2): dot(j_sum, j2, j2),
        }  # fmt: skip
        n = len(points.coefficient_stretch)
        gradient, bands = np.zeros(n), np.zeros((3, n))
        for k in range(3):
            local = sum(slope[p] * points.basis[p, k] for p in range(3))
            gradient += np.bincount(points.interval + k, local, n)
            for m in range(k, 3):
                local = sum(
                    value * (points.basis[p, k] * points.basis[q, m])
                    + (value * (points.basis[q, k] * points.basis[p, m]) if p != q else 0.0)
                    for (p, q), value in hessian.items()
                )
                bands[2 - (m - k)] += np.bincount(points.interval + m, local, n)
        return gradient, bands


def _solved(bands: Values, right: Values) -> Values:
    """Return the solution of a symmetric system of five diagonals, scaled to a unit diagonal."""
    scale = 1.0 / np.sqrt(np.maximum(bands[2], 1e-300))
    scaled = bands * scale
    scaled[1, 1:] *= scale[:-1]
    scaled[0, 2:] *= scale[:-2]
    for ridge in _RIDGES:  # what rounding has made indefinite gets a larger one
        scaled[2] = 1.0 + ridge
        try:
            solution: Values = solveh_banded(scaled, right * scale, check_finite=False)
        except LinAlgError:
            continue
        scaled_back: Values = solution * scale
        return scaled_back
    return np.full_like(right, np.nan)
