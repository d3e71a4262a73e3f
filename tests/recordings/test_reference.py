"""References along a contour, of any length."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Ellipse
from contourlab.errors import ConfigurationError
from contourlab.recordings import reference as module
from contourlab.recordings.reference import Reference

ELLIPSE = Ellipse(semi_axes=(0.03, 0.01))


def along(n, rates=None, jerk=None):
    time = 1e-3 * np.arange(n)
    rates = np.ones(n) if rates is None else rates
    jerk = 0.1 * time if jerk is None else jerk
    return Reference.along(
        ELLIPSE, sample_time=1e-3, parameter=time, parameter_rate=rates,
        parameter_acceleration=0.3 * time, parameter_jerk=jerk,
    )  # fmt: skip


def test_motions_of_any_length_are_one_program():
    along(2)
    before = module._along._cache_size()
    # two blocks, the second filled up
    found = along(1500)
    assert module._along._cache_size() == before
    d = np.asarray(jax.jit(jax.vmap(lambda p: ELLIPSE.derivatives(p, 3)))(found.parameter))
    v, a, j = (x[:, None] for x in (found.parameter_rate, 0.3 * found.time, 0.1 * found.time))
    # rounding of sums of numbers of this size
    assert_allclose(found.position, d[:, 0], atol=1e-17)
    assert_allclose(found.velocity, d[:, 1] * v, atol=1e-17)
    assert_allclose(found.acceleration, d[:, 2] * v**2 + d[:, 1] * a, atol=1e-16)
    assert_allclose(found.jerk, d[:, 3] * v**3 + 3.0 * d[:, 2] * v * a + d[:, 1] * j, atol=1e-16)


@pytest.mark.parametrize("n", [0, 1])
def test_less_than_two_samples_are_refused(n):
    with pytest.raises(ConfigurationError, match=f"two samples or more, got {n}"):
        along(n)


def test_records_of_other_lengths_are_refused():
    with pytest.raises(ConfigurationError, match=r"parameter_rate must have shape \(5,\)"):
        along(5, rates=np.ones(4))
    with pytest.raises(ConfigurationError, match=r"parameter_jerk must have shape \(5,\)"):
        along(5, jerk=np.zeros(4))
    with pytest.raises(
        ConfigurationError, match=r"parameter_jerk must have shape \(5,\), got \(5, 1"
    ):
        along(5, jerk=np.zeros((5, 1)))
