"""Thresholds of change detection for a false-alarm rate that is stated, by Monte Carlo.

A series of estimates θ_i with standard deviations s_i, found with ν_i degrees of freedom, is
compared with a baseline, the mean of its first ones. For each later one

    t_i = (θ_i - θ_0) / √(s_i² + s_0²)                                                    (1)
    S⁺_i = max(0, S⁺_i-1 + t_i - k),    S⁻_i = max(0, S⁻_i-1 - t_i - k)                   (2)

(1) sees a jump at once, (2), a cumulative sum, a drift that no single estimate shows. How large
either gets without any change has no closed form: the t_i share the baseline, have Student's tails,
and are looked at many times. So series without a change are drawn, of the very lengths and degrees
of freedom, and the thresholds are what only a share of α of them exceeds in any parameter at any
time, each of (1) and (2) as seldom as the other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError

__all__ = ["LEAST_RATE", "SLACK", "Thresholds", "refuse_rate", "statistics", "thresholds"]

SLACK = 0.5
"""k of (2)."""
EXCEEDING = 50
"""Series that alarm: the rate is then known to a seventh of itself."""
LEAST_DRAWS, MOST_DRAWS = 4000, 100_000
LEAST_RATE = EXCEEDING / MOST_DRAWS
"""Of a seldomer alarm less than that many series would be drawn."""
Rows = NDArray[Any]


class Thresholds(NamedTuple):
    """What the statistics exceed in a share of α of all series without a change."""

    jump: float
    """Of |t|."""
    drift: float
    """Of S⁺ and S⁻."""


def refuse_rate(rate: float, least: float = LEAST_RATE) -> None:
    """Raise ConfigurationError unless a rate of false alarms can be held.

    Parameters
    ----------
    rate
        Of :func:`thresholds`.
    least
        Below which it cannot.
    """
    if not 0.0 < rate < 1.0:
        raise ConfigurationError(f"rate must be > 0 and < 1, got {rate!r}")
    if rate < least:
        raise ConfigurationError(
            f"rate must be >= {least:g}, below which it would not be held, got {rate!r}"
        )


def statistics(values: Rows, deviations: Rows, n_baseline: int) -> tuple[Rows, Rows, Rows, Rows]:
    """Return (1), the larger of (2), the baseline and its standard deviation.

    Estimates that are not there (NaN) leave a gap: they are in no baseline, and the sums stand.

    Parameters
    ----------
    values, deviations
        θ and s, shape (..., n_times).
    n_baseline
        How many of the first estimates that are there make the baseline.

    Returns
    -------
    tuple
        t and S, shape (..., n_times), NaN for the baseline's own; θ_0 and s_0, shape (...).
    """
    there = np.isfinite(values) & np.isfinite(deviations) & (deviations > 0.0)
    base = there & (np.cumsum(there, axis=-1) <= n_baseline)
    with np.errstate(all="ignore"):
        weight = np.where(base, 1.0 / np.where(there, deviations, 1.0) ** 2, 0.0)
        total = weight.sum(axis=-1)
        mean = (weight * np.where(base, values, 0.0)).sum(axis=-1) / total
        spread = 1.0 / np.sqrt(total)
        t = (values - mean[..., None]) / np.sqrt(deviations**2 + spread[..., None] ** 2)
    t = np.where(there & ~base, t, np.nan)
    up = np.zeros(values.shape[:-1])
    down = np.zeros(values.shape[:-1])
    sums = np.full(values.shape, np.nan)
    for k in range(values.shape[-1]):
        now = t[..., k]
        seen = np.isfinite(now)
        change = np.where(seen, now, 0.0)
        up = np.where(seen, np.maximum(0.0, up + change - SLACK), up)
        down = np.where(seen, np.maximum(0.0, down - change - SLACK), down)
        sums[..., k] = np.where(seen, np.maximum(up, down), np.nan)
    return t, sums, mean, spread


def thresholds(
    there: Rows, degrees: Rows, n_baseline: int, *, rate: float, draws: int | None = None,
    seed: int = 0,
) -> Thresholds:  # fmt: skip
    """Return the thresholds for a rate of false alarms over all series together.

    Parameters
    ----------
    there
        Which estimates are there, shape (n_series, n_times).
    degrees
        Degrees of freedom of their standard deviations, likewise.
    n_baseline
        As for :func:`statistics`.
    rate
        α, share of all series without a change in which there is any alarm, 0 < α < 1.
    draws
        How often; if None, so that 50 series alarm, and 4000 times at least. Rates below
        ``LEAST_RATE`` would take more than can be drawn in a short time.
    seed
        Of the draws.

    Raises
    ------
    ConfigurationError
        A rate that is not between 0 and 1, or below ``LEAST_RATE`` where draws are None.
    """
    refuse_rate(rate, 0.0 if draws is not None else LEAST_RATE)
    if not np.any(there.sum(axis=1) > n_baseline):
        return Thresholds(np.inf, np.inf)
    if draws is None:
        draws = max(int(np.ceil(EXCEEDING / rate)), LEAST_DRAWS)
    random = np.random.default_rng(seed)
    jumps, drifts = np.zeros(draws), np.zeros(draws)
    block = max(1, int(2_000_000 / max(there.size, 1)))
    nu = np.maximum(degrees, 1.0)
    for begin in range(0, draws, block):
        n = min(block, draws - begin)
        shape = (n, *there.shape)
        values = np.where(there, random.standard_normal(shape), np.nan)
        spread = np.sqrt(random.chisquare(np.broadcast_to(nu, shape)) / nu)
        t, sums, _, _ = statistics(values, np.where(there, spread, np.nan), n_baseline)
        jumps[begin : begin + n] = np.nanmax(np.abs(np.nan_to_num(t)), axis=(1, 2))
        drifts[begin : begin + n] = np.nanmax(np.nan_to_num(sums), axis=(1, 2))
    # one share of the series for each, so large that both together alarm in the rate of them
    rank = np.maximum(*(np.argsort(np.argsort(x)) / (draws - 1.0) for x in (jumps, drifts)))
    share = float(np.quantile(rank, 1.0 - rate))
    return Thresholds(float(np.quantile(jumps, share)), float(np.quantile(drifts, share)))
