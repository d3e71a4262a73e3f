"""Parameters of a position loop that leave least of the simulated position.

The record is cut where an axis turns (:mod:`~contourlab.identification.pieces`), and each piece
begins anew: what friction does near a reversal is in none. Velocity gain, time constant, integral
and delay are looked for from several starts; feed-forward, friction and what the
pieces begin with are linear and eliminated in every step (variable projection). A velocity loop
with integral is taken where it leaves clearly less. Standard deviations come from the scores of the
simulated error (:mod:`~contourlab.identification.inference`).
"""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from contourlab.identification.inference import long_run_covariance
from contourlab.identification.pieces import Pieces
from contourlab.identification.position_loop_response import LoopResponse, loop_response

__all__ = ["LoopFit", "fit_loop"]

GAINS = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
"""Velocity gains that the search starts from [1/s]: those of machines lie between."""
LAGS = (0.1, 0.4)
"""Time constants that it starts from, times the gain: a fast velocity loop, and a slow one."""
FOLLOWED = 2
"""Starts that are followed to their end."""
INTEGRAL_GAINS = (20.0, 50.0, 120.0)
"""...with an integral, which slow loops do without..."""
INTEGRAL_STARTS = (0.6, 3.0)
"""...at these rates, relative to the velocity gain."""
INTEGRAL = 0.9
"""Share of the residual that a loop with integral has to stay below: one more parameter always
leaves a little less."""
SEARCHED = 2500
"""Rows that the search looks at, at least, before all of them are."""
MOST_STEPS = 40
SOLVED = 1e-3
"""Squares that a step promises to take away, relative to what noise leaves for each parameter,
below which there is none: a thirtieth of a standard deviation."""
DIFFERENCE = 1e-6
"""Step of a difference quotient, relative: of what rounding leaves it takes the same share."""
LONGEST_DELAY = 0.02
"""[s]; three samples where that is more."""
AHEAD = 2.0
"""Samples by which the actual position may be logged earlier than the command."""
SINGULAR = 1e10
"""Condition of the derivatives from which rounding decides what is found."""
NONLINEAR = ("velocity_gain", "time_constant", "integral_rate", "delay")
Rows = NDArray[Any]


class LoopFit(NamedTuple):
    """Of one axis."""

    values: dict[str, float]
    """By name; friction in m, as it holds the axis back."""
    names: tuple[str, ...]
    """Those that were found, in the order of the covariance."""
    covariance: Rows
    """Of directions that the motion tells apart, shape (p, p)."""
    directions: Rows
    """From the parameters to these, shape (p, p)."""
    residual: Rows
    """Measured less simulated, NaN outside the pieces, shape (n_samples,) [m]."""
    rms: float
    """Of the residual [m]."""

    def deviation(self, gradient: dict[str, float]) -> float:
        """Return the standard deviation of a function of the parameters.

        Parameters
        ----------
        gradient
            Its derivatives, by name.
        """
        # by directions: what is well told of parameters that are not, one by one, is not lost in
        # the rounding of their covariance
        row = self.directions @ np.array([gradient.get(name, 0.0) for name in self.names])
        # a few cosines may see too little of a residual that is white: no less than that
        return float(np.sqrt(max(row @ self.covariance @ row, self.rms**2 * (row @ row))))


def fit_loop(
    commanded: Rows, measured: Rows, way: Rows, sample_time: float, pieces: Pieces,
    given: dict[str, float], cosines: int,
) -> LoopFit:  # fmt: skip
    """Return what fits the record of one axis.

    Parameters
    ----------
    commanded, measured
        Positions, shape (n_samples,) [m].
    way
        1 where the axis moves forwards, -1 backwards, likewise.
    sample_time
        [s].
    pieces
        Rows that count.
    given
        Parameters that are known, by name.
    cosines
        Of the covariance.
    """
    search = _Search(commanded, measured, way, sample_time, pieces, given)
    plain = search.best(
        [
            {"velocity_gain": gain, "time_constant": share / gain, "integral_rate": 0.0}
            for gain, share in product(GAINS, LAGS)
        ],
        FOLLOWED,
    )
    with_integral = search.best(
        [
            {"velocity_gain": gain, "time_constant": share / gain, "integral_rate": rate * gain}
            for gain, share, rate in product(INTEGRAL_GAINS, LAGS, INTEGRAL_STARTS)
        ],
        FOLLOWED,
    )
    left = [float(np.sum(search.look(x).left ** 2)) for x in (plain, with_integral)]
    chosen = with_integral if left[1] < INTEGRAL**2 * left[0] else plain
    return search.result(chosen, cosines)


class _Look(NamedTuple):
    left: Rows
    """Measured less simulated in the pieces, what these begin with taken out, shape (n, l)."""
    linear: dict[str, float]
    derivatives: Rows
    """Of q, likewise, by the nonlinear parameters and then the linear ones, shape (n, l, p)."""


class _Search:
    def __init__(
        self, commanded: Rows, measured: Rows, way: Rows, sample_time: float, pieces: Pieces,
        given: dict[str, float],
    ) -> None:  # fmt: skip
        self.step, self.pieces, self.given = sample_time, pieces, given
        self.time = sample_time * np.arange(len(commanded))
        self.spline = CubicSpline(self.time, commanded - commanded[0])
        self.measured = measured - commanded[0]
        self.friction = {
            "friction_forward": np.where(way > 0.0, -1.0, 0.0),
            "friction_backward": np.where(way < 0.0, 1.0, 0.0),
        }
        self.bounds = {
            "velocity_gain": (0.2, 3.0 / sample_time), "time_constant": (0.1 * sample_time, 1.0),
            "integral_rate": (0.05, 3.0 / sample_time),
            "delay": (-AHEAD * sample_time, max(LONGEST_DELAY, 3.0 * sample_time)),
        }  # fmt: skip
        # rows that the search looks at: motion between samples is much alike
        self.every = max(1, int(pieces.counts.sum()) // SEARCHED)

    def free(self, x: dict[str, float]) -> list[str]:
        """Return the nonlinear parameters that are looked for."""
        return [
            name for name in NONLINEAR
            if name not in self.given and not (name == "integral_rate" and x[name] == 0.0)
        ]  # fmt: skip

    def respond(self, x: dict[str, float]) -> LoopResponse:
        """Return the simulated response."""
        # before the record the command stands where that begins
        later = np.clip(self.time - x["delay"], 0.0, self.time[-1])
        return loop_response(
            self.spline(later), self.step, x["velocity_gain"], x["time_constant"],
            x["integral_rate"], self.pieces.rows.shape[1],
        )  # fmt: skip

    def look(self, x: dict[str, float], every: int = 1) -> _Look:
        """Return what is left, with the linear parameters that leave least."""
        rows, counts = self.pieces.rows[:, ::every], self.pieces.counts[:, ::every]
        share = self.given.get("feed_forward", 0.0)
        found = self.respond(x)
        q, _ = np.linalg.qr(found.start[None, ::every] * counts[:, :, None])

        def project(signals: list[Rows]) -> Rows:
            here = np.stack([signal[rows] for signal in signals], -1) * counts[:, :, None]
            return np.asarray(here - q @ (np.swapaxes(q, 1, 2) @ here))

        linear = {}
        if "feed_forward" not in self.given:
            linear["feed_forward"] = found.feed_forward
        if x["integral_rate"] == 0.0:
            linear |= {n: c for n, c in self.friction.items() if np.any(c[rows] * counts)}
        else:  # the integral takes friction away; where zero is, stays
            linear["offset"] = np.ones(len(self.time))
        y = project([*linear.values()])
        wanted = project([self.measured - found.position - share * found.feed_forward])[:, :, 0]
        size = np.sqrt(np.sum(y**2, axis=(0, 1)))
        size = np.where(size > 0.0, size, 1.0)
        flat = (y / size).reshape(-1, y.shape[-1])
        values = np.linalg.pinv(flat.T @ flat, hermitian=True) @ (flat.T @ wanted.ravel()) / size
        values_by_name = dict(zip(linear, values.tolist(), strict=True))
        share = values_by_name.get("feed_forward", share)
        here = found.position + share * found.feed_forward
        z = []
        for name in self.free(x):
            change = DIFFERENCE * (self.step if name == "delay" else x[name])
            moved = self.respond({**x, name: x[name] + change})
            z.append((moved.position + share * moved.feed_forward - here) / change)
        everything = np.concatenate([project(z), y], axis=-1) if z else y
        return _Look(wanted - y @ values, values_by_name, everything)

    def best(self, starts: list[dict[str, float]], followed: int) -> dict[str, float]:
        """Return the nonlinear parameters that leave least, from the most promising starts."""
        tried = []
        for start in starts:
            x = {**start, "delay": 0.0}
            x |= {k: v for k, v in self.given.items() if k in NONLINEAR}
            for name in {"velocity_gain", "time_constant"} - set(self.given):
                x[name] = float(np.clip(x[name], *self.bounds[name]))
            tried.append((float(np.sum(self.look(x, self.every).left ** 2)), x))
        tried.sort(key=lambda pair: pair[0])
        ends = [self.follow(x, self.every) for _, x in tried[:followed]]
        end = min(ends, key=lambda pair: pair[0])[1]
        return end if self.every == 1 else self.follow(end, 1)[1]

    def follow(self, x: dict[str, float], every: int) -> tuple[float, dict[str, float]]:
        """Return what is left at the end of a start, and the parameters there: Levenberg and
        Marquardt's method, the linear parameters best at every step."""
        names = self.free(x)
        found = self.look(x, every)
        cost, damping = float(np.sum(found.left**2)), 1e-6
        if not names:
            return cost, x
        told, values, turned, size = _decomposed(found.derivatives)
        for _ in range(MOST_STEPS):
            along = told.T @ found.left.ravel()
            if np.sum(along**2) < SOLVED * cost / max(found.left.size, 1) * len(size):
                break
            step = turned.T @ (values / (values**2 + damping * values[0] ** 2) * along) / size
            moved = self.moved(x, dict(zip(names, step[: len(names)].tolist(), strict=True)))
            new = self.look(moved, every)
            left = float(np.sum(new.left**2))
            if left < cost:
                x, cost, found, damping = moved, left, new, max(damping / 6.0, 1e-22)
                told, values, turned, size = _decomposed(found.derivatives)
            else:
                damping *= 8.0
                if damping > 1e3:
                    break
        return cost, x

    def moved(self, x: dict[str, float], step: dict[str, float]) -> dict[str, float]:
        """Return the parameters after a step, within their bounds; positive ones by a factor."""
        new = dict(x)
        for name, change in step.items():
            if name == "delay":
                value = x[name] + change
            else:
                value = x[name] * float(np.exp(np.clip(change / x[name], -1.0, 1.0)))
            new[name] = float(np.clip(value, *self.bounds[name]))
        return new

    def result(self, x: dict[str, float], cosines: int) -> LoopFit:
        """Return parameters with their covariance."""
        left, linear, derivatives = self.look(x)
        told, values, turned, size = _decomposed(derivatives)
        values = np.maximum(values, values[0] / SINGULAR)
        there = self.pieces.counts > 0.0
        scores = np.zeros((len(self.time), len(size)))
        scores[self.pieces.rows[there]] = (told * left.reshape(-1, 1)).reshape(derivatives.shape)[
            there
        ]
        residual = np.full(len(self.time), np.nan)
        residual[self.pieces.rows[there]] = left[there]
        return LoopFit(
            values={**self.given, **x, **linear}, names=(*self.free(x), *linear),
            covariance=long_run_covariance(scores, cosines),
            directions=turned / values[:, None] / size, residual=residual,
            rms=float(np.sqrt(np.nanmean(residual**2))),
        )  # fmt: skip


def _decomposed(derivatives: Rows) -> tuple[Rows, Rows, Rows, Rows]:
    """Return the singular value decomposition of columns brought to one size, and their sizes."""
    flat = derivatives.reshape(-1, derivatives.shape[-1])
    size = np.linalg.norm(flat, axis=0)
    size = np.where(size > 0.0, size, np.inf)
    return *np.linalg.svd(flat / size, full_matrices=False), size
