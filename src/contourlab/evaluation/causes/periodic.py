"""What repeats: over the position of an axis (a screw's pitch), or over time (a vibration).

The pitch is looked for in the mean of the residual over bins of position, with as many waves of a
Fourier series as the travel can tell apart; it is then refined by least squares over all samples. A
vibration is a peak of the residual's averaged periodogram that stands out of its neighbourhood.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

__all__ = ["Band", "find_bands", "find_pitch", "waves"]

BINS = 4096
"""Bins of position."""
LEAST_WAVES = 2.5
"""Waves that must lie within the travel."""
LOWEST = 5.0
"""Nothing slower than this is called a vibration [Hz]."""
STANDS_OUT = 8.0
"""A vibration's peak over the median around it, at least."""
FALSE_ALARMS = 1e-3
"""Chance of one in noise without any."""
SIGNIFICANT = 12.0
"""A pitch's reduction of the residual over what chance gives."""
CREST = 6.0
"""Largest value over rms above which a band is made of single events, such as reversals."""
MOST_BANDS = 3

Values = NDArray[Any]


class Band(NamedTuple):
    """A vibration."""

    frequency: float
    """[Hz]"""
    signal: Values
    """What the residual holds around it [m]."""


def waves(position: Values, period: float) -> Values:
    """Return sine and cosine over position, shape (n, 2).

    Parameters
    ----------
    position
        Shape (n,) [m].
    period
        [m]
    """
    phase = 2.0 * np.pi * position / period
    return np.column_stack([np.sin(phase), np.cos(phase)])


def find_pitch(position: Values, residual: Values, n_independent: float) -> float | None:
    """Return the period over which a residual repeats with position, None if it does not.

    Parameters
    ----------
    position, residual
        Shape (n,) [m].
    n_independent
        How many independent samples the residual has, for significance.
    """
    travel = float(np.ptp(position))
    if travel <= 0.0 or len(position) < 32:
        return None
    steps = np.abs(np.diff(position))
    spacing = float(np.quantile(steps[steps > 0.0], 0.9)) if (steps > 0.0).any() else travel
    shortest = max(4.0 * spacing, 4.0 * travel / BINS)
    longest = travel / LEAST_WAVES
    if shortest >= longest:
        return None
    place = np.minimum(((position - position.min()) / travel * BINS).astype(int), BINS - 1)
    count = np.bincount(place, minlength=BINS).astype(float)
    total = np.bincount(place, weights=residual, minlength=BINS)
    seen = count > 0.0
    # weighted by how long the axis was there, so that a place passed once does not rule
    mean = float(residual.mean())
    spectrum = np.fft.rfft(np.where(seen, total - mean * count, 0.0), 8 * BINS)
    wave_number = np.arange(len(spectrum)) / (8.0 * travel)
    inside = (wave_number >= 1.0 / longest) & (wave_number <= 1.0 / shortest)
    if not inside.any():
        return None
    power = np.where(inside, np.abs(spectrum), 0.0)
    if not power.max() > 0.0:
        return None
    start = 1.0 / wave_number[int(power.argmax())]

    def left(period: float) -> float:
        return _left(position, residual, period)

    width = start**2 / travel
    bounds = (max(start - 0.5 * width, shortest), min(start + 0.5 * width, longest * 1.05))
    if bounds[0] >= bounds[1]:
        return None
    found = minimize_scalar(left, bounds=bounds, method="bounded", options={"xatol": 1e-5 * start})
    whole = float(np.sum((residual - mean) ** 2))
    gain = (whole - found.fun) / 2.0
    noise = found.fun / max(n_independent - 3.0, 1.0)
    if whole <= 0.0 or gain < SIGNIFICANT * noise or found.fun > 0.9 * whole:
        return None
    return float(found.x)


def _left(position: Values, residual: Values, period: float) -> float:
    columns = np.column_stack([waves(position, period), np.ones(len(position))])
    gram = columns.T @ columns
    moment = columns.T @ residual
    solution = np.linalg.lstsq(gram, moment, rcond=None)[0]
    return float(residual @ residual - moment @ solution)


def find_bands(residual: Values, parts: tuple[slice, ...], dt: float) -> list[Band]:
    """Return the vibrations in a residual, the largest first.

    Parameters
    ----------
    residual
        Shape (n,) [m].
    parts
        Rows between breaks.
    dt
        Sample time [s].
    """
    longest = max(parts, key=lambda at: at.stop - at.start, default=slice(0, 0))
    n = longest.stop - longest.start
    if n < 128:
        return []
    size = int(np.clip(2 ** np.floor(np.log2(n / 6.0)), 64, 8192))
    window = np.hanning(size)
    power = np.zeros(size // 2 + 1)
    pieces = 0
    for at in parts:
        values = residual[at]
        for start in range(0, len(values) - size + 1, size // 2):
            piece = values[start : start + size]
            power += np.abs(np.fft.rfft((piece - piece.mean()) * window)) ** 2
            pieces += 1
    frequency = np.fft.rfftfreq(size, dt)
    # below, what the servo does along the path; the quietest tenth keeps zeros from dividing
    around = median_filter(power, size=max(size // 16, 9), mode="nearest")
    around = np.maximum(around, 1e-6 * power.max())
    ratio = power / np.where(around > 0.0, around, 1.0)
    ratio[:4] = 0.0
    ratio[frequency < LOWEST] = 0.0
    # of pieces that overlap by half, so many are independent
    freedom = 2.0 * (0.6 * pieces + 0.4)
    needed = max(STANDS_OUT, chi2.isf(FALSE_ALARMS / len(power), freedom) / chi2.median(freedom))
    total = float(power[1:].sum())
    found = []
    for _ in range(MOST_BANDS):
        k = int(ratio.argmax())
        if ratio[k] < needed or total <= 0.0:
            break
        low, high = k, k
        while low > 1 and power[low - 1] < power[low] and low > k - 6:
            low -= 1
        while high < len(power) - 1 and power[high + 1] < power[high] and high < k + 6:
            high += 1
        share = float(power[low : high + 1].sum()) / total
        ratio[max(low - 1, 0) : high + 2] = 0.0
        if share < 0.05:
            continue
        peak = frequency[low : high + 1] @ power[low : high + 1] / power[low : high + 1].sum()
        half = max((high - low + 1) / 2.0, 2.0) / (size * dt)
        signal = _band(residual, parts, dt, float(peak), half)
        if np.abs(signal).max() < CREST * np.sqrt(np.mean(signal**2)):
            found.append(Band(float(peak), signal))
    return found


def _band(
    residual: Values, parts: tuple[slice, ...], dt: float, peak: float, half: float
) -> Values:
    """Return a residual's part within a band of frequencies, without a shift in time."""
    out = np.zeros_like(residual)
    for at in parts:
        values = residual[at]
        n = len(values)
        if n < 16:
            continue
        padded = np.concatenate([values, values[::-1]])  # no step at the ends
        spectrum = np.fft.rfft(padded)
        off = np.abs(np.fft.rfftfreq(2 * n, dt) - peak) / half
        spectrum *= np.clip(1.5 - 0.5 * off, 0.0, 1.0)  # flat within, gone at three times the width
        out[at] = np.fft.irfft(spectrum, 2 * n)[:n]
    return out
