"""Windowed excitation against closed forms, and the bias that encoder counts make."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from contourlab.controllers import (
    FilteredLeastSquares,
    filtered_regressors,
    windowed_excitation,
)
from contourlab.errors import ConfigurationError

T = 2e-4
WIDE = np.full((4, 2), 1e3)


def law(**changes):
    fields = {"cutoff_hz": (250.0, 150.0), "initial_covariance": (10.0, 10.0, 10.0, 5000.0)}
    return FilteredLeastSquares(**(fields | changes)).bind(-WIDE, WIDE, T)


def test_sinusoids_over_whole_periods():
    """∫ sin² = T/2, ∫ sin cos = 0, and what never moves has none and is named."""
    n = 5000
    angle = 2 * np.pi * np.arange(3 * n) / n
    y = np.zeros((3 * n, 4, 2))
    y[:, 0, 0], y[:, 1, 0], y[:, 2, 0] = 3 * np.sin(angle), 2 * np.cos(angle), np.sin(2 * angle)
    y[:, 0, 1], y[:, 1, 1], y[:, 2, 1] = np.sin(angle), np.cos(angle), np.sin(2 * angle)
    y[:, 3, 1] = -0.1
    found = windowed_excitation(y, T, n * T, stride=500)
    assert_allclose(found.time, np.arange(0, 2 * n + 1, 500) * T)
    assert_allclose(found.smallest[:, 0], 0.0, atol=1e-12)
    assert_allclose(np.abs(found.weakest[:, 3, 0]), 1.0)
    assert_allclose(found.largest[:, 0], 4.5 * n * T)
    assert_allclose(found.smallest[:, 1], 0.01 * n * T, rtol=1e-9)
    scaled = windowed_excitation(y, T, n * T, scale=(1.0, 1.0, 1.0, 20.0), stride=n)
    assert_allclose(scaled.smallest[:, 1], 0.5 * n * T, rtol=1e-9)


def test_constant_speed_does_not_tell_viscous_from_coulomb():
    """Nor either of them from d: two eigenvalues are zero, as the weakest direction says."""
    q = np.stack([0.1 * np.arange(6000) * T] * 2, 1)
    y, _ = filtered_regressors(law(), q, np.zeros_like(q))
    found = windowed_excitation(y[1000:], T, 0.5, stride=1000)
    assert np.all(found.smallest < 1e-9 * found.largest)
    assert_allclose(y[-1, 1], 0.1, rtol=1e-9)
    assert_allclose(y[-1, 3], -1.0, rtol=1e-9)


@pytest.mark.parametrize(("axis", "cutoff"), [(0, 250.0), (1, 150.0)])
def test_encoder_counts_bias_the_mass(axis, cutoff):
    """M̂ / M = S / (S + σ²) for a sinusoid, with σ² from the filter's response to white rounding."""
    amplitude, omega, count, n = 0.2, 4.0, 0.5e-6, 60000
    time = np.arange(n) * T
    q = np.stack([amplitude * (1 - np.cos(omega * time))] * 2, 1)
    a = np.stack([amplitude * omega**2 * np.cos(omega * time)] * 2, 1)
    # the command acts over the sample that follows: mean acceleration there
    u = 0.5 * (a + np.roll(a, -1, axis=0))
    y, wanted = filtered_regressors(law(), np.round(q / count) * count, u)
    rows = slice(2000, None)
    ratio = np.sum(y[rows, 0] * wanted[rows], 0) / np.sum(y[rows, 0] ** 2, 0)
    w, c = 2 * np.pi * cutoff, 2 / T
    whole = c**2 + 1.4 * w * c + w**2
    top = w**2 * c**2 / whole * np.array([1.0, -2.0, 1.0])
    bottom = np.array([1.0, 2 * (w**2 - c**2) / whole, (c**2 - 1.4 * w * c + w**2) / whole])
    response = lfilter(top, bottom, np.r_[1.0, np.zeros(2000)])
    noise = count**2 / 12 * np.sum(response**2)
    signal = (amplitude * omega**2) ** 2 / 2
    assert_allclose(ratio[axis], signal / (signal + noise), rtol=2e-3)
    assert ratio[0] < 0.985  # some two per cent on the light axis


def test_mistakes_are_named():
    y = np.zeros((100, 4, 2))
    with pytest.raises(ConfigurationError, match=r"window must be >= 0.0002 s and <= 0.02 s"):
        windowed_excitation(y, T, 1.0)
    for window in (np.nan, np.inf, 0.0):
        with pytest.raises(ConfigurationError, match="window must be >="):
            windowed_excitation(y, T, window)
    for stride in (0, -1, True):
        with pytest.raises(ConfigurationError, match="stride must be a whole number >= 1"):
            windowed_excitation(y, T, 10 * T, stride=stride)
    for wrong in (y[0], y[:, :3], np.zeros((100, 2, 4))):
        with pytest.raises(ConfigurationError, match="regressor must have shape"):
            windowed_excitation(wrong, T, 10 * T)
    with pytest.raises(ConfigurationError, match="scale must be a number or have shape"):
        windowed_excitation(y, T, 10 * T, scale=np.ones(3))
    with pytest.raises(ConfigurationError, match="sample_time must be > 0 s"):
        windowed_excitation(y, 0.0, 10 * T)
    with pytest.raises(ConfigurationError, match="position and command must have one shape"):
        filtered_regressors(law(), np.zeros((10, 2)), np.zeros((9, 2)))
