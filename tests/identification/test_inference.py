"""The covariance of sums of coloured scores, and the estimate, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter
from scipy.stats import kstest
from scipy.stats import t as student

from contourlab.identification.inference import corrected_covariance, fit, long_run_covariance


def test_the_long_run_covariance_of_a_coloured_series():
    """x_k = ρ x_k-1 + e_k: the variance of the sum of n is n / (1 - ρ)²."""
    rng = np.random.default_rng(1)
    rho, n, runs, cosines = 0.8, 4000, 400, 12
    x = lfilter([1.0], [1.0, -rho], rng.standard_normal((runs, n)), axis=1)
    found = [long_run_covariance(row[:, None], cosines)[0, 0] for row in x]
    # the mean of 400 chi-squares of 12 degrees: relative deviation √(2/12/400) = 2 %
    assert_allclose(np.mean(found) / n, 1 / (1 - rho) ** 2, rtol=0.08)
    assert_allclose(np.var(found) / np.mean(found) ** 2, 2 / cosines, rtol=0.25)


def test_two_series_that_go_together():
    rng = np.random.default_rng(2)
    x = rng.standard_normal((20000, 1)) @ np.array([[1.0, -2.0]])
    found = long_run_covariance(x, 12)
    assert_allclose(found, found[0, 0] * np.array([[1, -2], [-2, 4]]), atol=1e-9 * found[0, 0])


def test_a_constant_has_no_spread():
    assert_allclose(long_run_covariance(np.ones((100, 1)), 12), 0.0, atol=1e-20)


def test_without_other_instruments_it_is_weighted_least_squares():
    rng = np.random.default_rng(3)
    y, w = rng.standard_normal((500, 3)) * [1.0, 1e3, 1e-3], rng.uniform(size=500)
    u = y @ [1.0, 2e-3, -3e3] + 0.1 * rng.standard_normal(500)
    found = fit(y, u, y, w, 12)
    root = np.sqrt(w)
    assert_allclose(found.estimate, np.linalg.lstsq(y * root[:, None], u * root)[0], rtol=1e-10)
    assert_allclose(found.residual, u - y @ found.estimate, atol=1e-12)


def test_the_covariance_is_that_of_white_noise():
    """σ² (Yᵀ Y)⁻¹, in the mean over many draws."""
    rng = np.random.default_rng(4)
    y = np.column_stack([np.sin(np.arange(2000) / 7.0), rng.standard_normal(2000)])
    found = np.mean(
        [
            fit(
                y, y @ [1.0, 2.0] + 0.3 * rng.standard_normal(2000), y, np.ones(2000), 12
            ).covariance
            for _ in range(300)
        ],
        axis=0,
    )
    exact = 0.09 * np.linalg.inv(y.T @ y)
    assert_allclose(found, exact, atol=0.1 * exact[0, 0])


@pytest.mark.parametrize("noisy", [False, True])
def test_noise_in_the_regressor_does_not_bias_with_an_instrument(noisy):
    rng = np.random.default_rng(5)
    true = np.sin(np.arange(40000) / 11.0)[:, None]
    seen = true + rng.standard_normal(true.shape)
    found = fit(seen, 3.0 * true[:, 0], seen if noisy else true, np.ones(40000), 12)
    # errors in variables: S / (S + σ²) = 0.5 / 1.5
    assert_allclose(found.estimate, [1.0 if noisy else 3.0], rtol=0.05)


def corrected(y, z, e, cosines):
    """Estimate of 0, the covariance of the scores alone and the corrected one, degrees."""
    n = len(y)
    inverse = np.linalg.inv(z.T @ y)
    estimate = inverse @ (z.T @ e)
    left = e - y @ estimate
    plain = inverse @ long_run_covariance(z * left[:, None], cosines) @ inverse.T
    found = corrected_covariance(plain, inverse, y, z, left, np.arange(n), n, cosines)
    return estimate, plain, *found


def test_white_noise_gives_exactly_students_t_whatever_the_motion():
    """Four parameters, two of which act in one direction each, six cosines over six turns."""
    rng = np.random.default_rng(6)
    n, cosines, draws = 240, 6, 1500
    t = np.arange(n) / n
    way = np.sign(np.sin(2.0 * np.pi * 3.2 * t + 0.3))
    y = np.column_stack([way > 0.0, way < 0.0, np.sin(7.0 * t) * way, t]).astype(float)
    z = y + 0.1 * rng.standard_normal(y.shape)  # which knows of no draw
    found = [corrected(y, z, e, cosines) for e in rng.standard_normal((draws, n))]
    assert {one[3] for one in found} == {cosines}
    variance, plain = (np.array([np.diagonal(one[k]) for one in found]) for k in (2, 1))
    inverse = np.linalg.inv(z.T @ y)
    exact = np.diagonal(inverse @ z.T @ z @ inverse.T)
    # the mean of 1500 chi-squares of 6 degrees, over 6: deviation √(2/6/1500) = 1.5 %
    assert_allclose(variance.mean(axis=0), exact, rtol=0.06)
    t_values = np.array([one[0] for one in found]) / np.sqrt(variance)
    assert all(kstest(row, student(cosines).cdf).pvalue > 1e-3 for row in t_values.T)
    assert np.all(plain.mean(axis=0) < 0.9 * exact)  # what the correction is for


def test_on_a_long_record_that_repeats_nothing_needs_correction():
    """The residual is coloured, and its size rises threefold over the record."""
    rng = np.random.default_rng(7)
    n, cosines = 40_000, 6
    t = np.arange(n)
    y = np.column_stack([np.sin(t / 7.0), np.sign(np.sin(t / 50.0)), np.ones(n)])
    e = lfilter([1.0], [1.0, -0.9], rng.standard_normal(n) * (1.0 + 2.0 * t / n))
    _, plain, found, degrees = corrected(y, y, e, cosines)
    assert degrees == cosines
    assert_allclose(np.diagonal(found), np.diagonal(plain), rtol=0.01)


def test_cosines_that_fitting_takes_out_are_no_degrees_of_freedom():
    """The parameters are those of the first two cosines themselves."""
    rng = np.random.default_rng(8)
    turns = np.pi * (np.arange(300) + 0.5) / 300
    y = np.cos(turns[:, None] * np.arange(3))
    # of a constant, fitting takes out the first two of five cosines
    assert corrected(y, y, rng.standard_normal(300), 5)[3] == 3
