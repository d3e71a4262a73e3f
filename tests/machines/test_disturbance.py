"""Disturbances against their formula."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError
from contourlab.machines import SineDisturbance, StepDisturbance

TIMES = np.array((0.0, 0.0999, 0.1, 0.15, 0.2, 0.3))


def at(disturbance, n_axes=2):
    return np.array([disturbance.value(t, n_axes) for t in TIMES])


def test_step_acts_from_start_until_before_stop():
    values = at(StepDisturbance(axis=1, start=0.1, stop=0.2, amplitude=-7.0))
    assert np.array_equal(values[:, 1], [0.0, 0.0, -7.0, -7.0, 0.0, 0.0])
    assert np.all(values[:, 0] == 0.0)


def test_sine_counts_its_phase_from_the_start():
    values = at(SineDisturbance(axis=0, amplitude=2.0, frequency_hz=3.0, phase=0.4, start=0.1))
    expected = np.where(TIMES >= 0.1, 2.0 * np.sin(2 * np.pi * 3.0 * (TIMES - 0.1) + 0.4), 0.0)
    assert_allclose(values[:, 0], expected, rtol=1e-13)


def test_disturbances_add_up_and_can_be_traced():
    sine = SineDisturbance(axis=0, amplitude=2.0, frequency_hz=1.0)

    def total(amplitude, time):
        first = StepDisturbance(axis=0, amplitude=amplitude)
        return first.value(time, 3) + sine.value(time, 3)

    traced = jax.jit(jax.vmap(total, in_axes=(0, None)))(jnp.array((1.0, 4.0)), 0.25)
    assert_allclose(traced[:, 0], (3.0, 6.0), rtol=1e-14)
    assert_allclose(jax.jacfwd(total)(1.0, 0.25), (1.0, 0.0, 0.0))


def test_wrong_values_are_named():
    with pytest.raises(ConfigurationError, match=r"start must be < stop, got start 0.2 s"):
        StepDisturbance(axis=0, amplitude=1.0, start=0.2, stop=0.1)
    with pytest.raises(ConfigurationError, match=r"axis must be < 2, .* got 2"):
        StepDisturbance(axis=2, amplitude=1.0).value(0.0, 2)
    with pytest.raises(ConfigurationError, match="axis must be a whole number >= 0, got -1"):
        StepDisturbance(axis=-1, amplitude=1.0)
    with pytest.raises(ConfigurationError, match="frequency_hz must be > 0 Hz, got 0"):
        SineDisturbance(axis=0, amplitude=1.0, frequency_hz=0.0)
