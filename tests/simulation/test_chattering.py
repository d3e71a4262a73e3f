"""The chattering study: against the linear limit of the guard, and what it reports."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers import IntegralSlidingMode, NewtonCrossCoupled
from contourlab.errors import SimulationError
from contourlab.machines.published import ghaffari_two_axes
from contourlab.reports import chattering_table, write_chattering_figure
from contourlab.simulation import Chattering, chattering, limit_cycle

MACHINE = ghaffari_two_axes()
CUTOFF = 100.0
KP, KI, KD = 1.0, 10.0, 0.1
RATE, LAYER = 12.0, 80.0


def law():
    per_mass = np.asarray(MACHINE.nominal.gain) / np.asarray(MACHINE.nominal.mass)
    axis = IntegralSlidingMode(
        model=MACHINE.nominal, error_rate=RATE, integral_rate=RATE, boundary_layer=1e-3,
        disturbance_bound=0.1, switching_gain=LAYER / per_mass, disturbance_estimate="none",
    )  # fmt: skip
    return NewtonCrossCoupled(
        axis=axis, guard=1e-6, kp=KP, ki=KI, kd=KD, derivative_cutoff_hz=CUTOFF / (2.0 * np.pi)
    )


def linear_limit(sample_time):
    """The guard at which a loop that crosses far above all its rates has no phase left.

    Well above the filter the coupling is the gain G = kp + kd N with the lead
    (kd N² - ki) / (G ω); the axis law's velocity feedback, (a + b) + κ K/M, gives that much over ω;
    a held command is late by ω T / 2; and ω² = K G / (M δ).
    """
    push = KP + KD * CUTOFF
    lead = 2.0 * RATE + LAYER + (KD * CUTOFF**2 - KI) / push
    per_mass = np.max(np.asarray(MACHINE.nominal.gain) / np.asarray(MACHINE.nominal.mass))
    return 0.5 * sample_time * per_mass * push / lead


@pytest.fixture(scope="module")
def study():
    times = np.array([2e-4, 1e-3])
    values = np.concatenate([linear_limit(t) * np.array([0.7, 1.4]) for t in times])
    seen = []
    found = chattering(
        MACHINE, law(), values=values, sample_times=times[::-1], duration=1.5,
        progress=seen.append,
    )  # fmt: skip
    assert seen == [0.5, 1.0]
    return found


def test_the_limit_of_the_guard_is_that_of_the_linear_loop(study):
    for row, sample_time in enumerate(study.sample_times):
        limit = linear_limit(sample_time)
        assert np.all(study.quiet[row] == (study.values > limit))
        assert_allclose(study.least_quiet[row], 1.4 * limit, rtol=1e-9)


def test_a_loud_loop_says_how_much_and_how_fast(study):
    loud = ~study.quiet
    assert np.all(study.amplitude[loud] > 1e-8)
    assert np.all(study.frequency_hz[loud] > 20.0)
    assert np.all(np.isnan(study.frequency_hz[study.quiet]))
    # the push of a relay with a filter: never more than the coupling can give, kp + 2 kd N
    assert np.all(study.command_ripple[loud] < 1.2 * (KP + 2.0 * KD * CUTOFF))
    # from the mean, which is itself no further than the largest
    assert np.all(2.0 * study.contour_error_max >= study.amplitude)
    # slower sampling: larger and slower
    assert study.amplitude[1, 0] > study.amplitude[0, 0]
    assert study.frequency_hz[1, 0] < study.frequency_hz[0, 0]


def test_amplitude_and_frequency_of_a_known_signal():
    time = np.arange(2000) * 1e-3
    wave = 2e-6 * np.sin(2.0 * np.pi * 37.0 * time + 0.3)
    signal = np.stack([3.0 + 0.6 * wave, -1.0 - 0.8 * wave], axis=1)
    amplitude, frequency = limit_cycle(signal, 1e-3)
    assert_allclose(amplitude, 2e-6, rtol=5e-3)  # the samples beside the top
    assert_allclose(frequency, 37.0, atol=0.5)  # one over two seconds
    assert limit_cycle(np.ones((100, 2)), 1e-3)[0] == 0.0


def invented():
    nan = np.nan
    return Chattering(
        field="guard", values=np.array([1e-6, 2e-6, 4e-6]), sample_times=np.array([1e-4, 1e-3]),
        amplitude=np.array([[3e-7, 1e-11, 1e-11], [nan, 2e-6, 1e-6]]),
        frequency_hz=np.array([[310.0, nan, nan], [nan, 80.0, 90.0]]),
        command_ripple=np.ones((2, 3)), contour_error_max=np.full((2, 3), 5e-6), quiet_below=1e-9,
    )  # fmt: skip


def test_where_nothing_is_quiet_there_is_no_least_value():
    assert_allclose(invented().least_quiet, [2e-6, np.nan])


def test_table_and_figure(tmp_path):
    table = chattering_table(invented())
    columns = [list(column.cells) for column in table.columns]
    assert columns[1] == ["0.3 at 310", "diverged"]
    assert columns[2] == ["quiet", "2 at 80"]
    assert columns[-1] == ["2", "-"]
    write_chattering_figure(invented(), tmp_path / "c.png")
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")


def test_messages():
    with pytest.raises(SimulationError, match="at least one value and one sample time"):
        chattering(MACHINE, law(), values=[], sample_times=[1e-3])
    with pytest.raises(SimulationError, match="direction must have one number for each of the 2"):
        chattering(MACHINE, law(), values=[1e-6], sample_times=[1e-3], direction=(1.0, 0.0, 0.0))
