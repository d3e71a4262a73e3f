"""Rows that count, the encoder's noise, and what the filter makes of it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers import FilteredLeastSquares, filtered_regressors
from contourlab.identification.rows import (
    FORGOTTEN,
    memory,
    position_noise,
    regressor_noise,
    row_weights,
)

T = 1e-3


def test_rows_near_a_reversal_do_not_count():
    velocity = np.linspace(-1.0, 1.0, 2001)
    weights = row_weights(velocity, 0.1005, 50)
    slow = np.flatnonzero(np.abs(velocity) < 0.1005)
    # a memory on either side nothing counts, over another the weight rises
    gap = np.flatnonzero(weights == 0.0)
    gap = gap[(gap > 500) & (gap < 1500)]
    assert (gap[0], gap[-1]) == (slow[0] - 50, slow[-1] + 50)
    assert_allclose(weights[[slow[-1] + 75, slow[-1] + 100]], [0.5, 1.0])
    assert_allclose(weights[slow[0] - 75], 0.5)
    assert_allclose(weights[500:1501], weights[1500:499:-1], atol=1e-12)


def test_rows_at_the_ends_do_not_count():
    weights = row_weights(np.ones(400), 0.1, 50, waiting=3)
    assert not weights[:54].any()
    assert weights[54] > 0.0
    assert_allclose(weights[110:340], 1.0)
    assert weights[-1] < 0.01  # the weight falls to the end, so that no sum ends sharply


@pytest.mark.parametrize("damping", [0.7, 1.0, 2.0])
def test_the_filter_has_forgotten_after_its_memory(damping):
    law = FilteredLeastSquares(
        cutoff_hz=40.0, filter_damping=damping, initial_covariance=(1.0,) * 4
    )
    n = int(memory(law, T, 1)[0])
    free = np.full((4, 1), np.inf)
    command = np.zeros((4 * n, 1))
    command[1] = 1.0
    response = filtered_regressors(law.bind(-free, free, T), 0.0 * command, command)[1][:, 0]
    peak = np.abs(response).max()
    # critically damped the response is t e^-ωt, which at ωt = 9.2 is 25 times e^-9.2 of its peak
    assert np.abs(response[n + 2 :]).max() < 30.0 * FORGOTTEN * peak
    assert np.abs(response[n // 3]) > FORGOTTEN * peak or damping == 0.7


def test_the_noise_of_an_encoder_is_found_beneath_a_motion():
    rng = np.random.default_rng(0)
    t = np.arange(20000) * T
    motion = 0.1 * np.sin(9 * t) + 0.01 * np.sin(60 * t)
    noisy = motion + 2e-6 * rng.standard_normal(len(t))
    assert_allclose(position_noise(noisy), 2e-6, rtol=0.03)
    counted = np.round(motion / 5e-6) * 5e-6
    assert_allclose(position_noise(counted), 5e-6 / np.sqrt(12), rtol=0.03)


def test_what_noise_adds_to_the_regressor():
    """Against the filter fed with noise: variances of s² H q and s H q, and nothing between."""
    law = FilteredLeastSquares(cutoff_hz=(30.0, 60.0), initial_covariance=(1.0,) * 4)
    free = np.full((4, 2), np.inf)
    bound = law.bind(-free, free, T)
    found = regressor_noise(bound, 400, 2)
    noise = np.random.default_rng(1).standard_normal((60000, 2))
    rows = filtered_regressors(bound, noise, 0 * noise)[0][500:, :2]
    drawn = np.einsum("kpa,kqa->apq", rows, rows) / len(rows)
    diagonal = np.sqrt(np.einsum("app->ap", found))
    assert_allclose(
        drawn / diagonal[:, :, None] / diagonal[:, None], found / diagonal[:, :, None]
        / diagonal[:, None], atol=0.03,
    )  # fmt: skip
    assert np.abs(found[:, 0, 1]).max() < 1e-3 * (diagonal[:, 0] * diagonal[:, 1]).min()
