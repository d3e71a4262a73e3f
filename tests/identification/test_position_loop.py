"""Logs of commanded and actual positions: what they tell of a loop, and that they tell no mass."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification import Parameter, identified_machine, identify_position_loops
from contourlab.identification.pieces import cut_pieces, smooth_velocity
from contourlab.identification.position_loop_fit import fit_loop

from .machines import log_of, open_loop
from .position_loops import DRY, GAIN, MASS, RATE, VISCOUS, cascade, program

T = 2e-3
WANTED = program(T, 6.0)
SHARE = 0.7


def logged(positions, noise=1e-6, count=1e-6, seed=0):
    random = np.random.default_rng(seed)
    measured = positions + noise * random.standard_normal(positions.shape)
    return log_of(np.round(measured / count) * count, WANTED, T, "position")


@pytest.fixture(scope="module")
def proportional():
    """Proportional velocity loop, delayed by one sample."""
    return cascade(WANTED, T, feed_forward=SHARE, integral=0.0, later=1)


@pytest.fixture(scope="module")
def found(proportional):
    return identify_position_loops(logged(proportional))


def test_a_loop_with_feed_forward_is_told_one_by_one(found):
    assert found.warnings == ()
    # viscous friction slows a proportional velocity loop: all of it is divided by 1 + B / k_p
    slower = 1.0 + VISCOUS / (MASS * RATE)
    lag = (slower - SHARE) / GAIN + T  # at a constant velocity, in closed form
    for axis, c, gain, dry in zip(found.axes, lag, GAIN, DRY / (MASS * RATE * GAIN), strict=True):
        assert_allclose(axis["velocity_lag"].value, c, atol=1e-6)
        # that the velocity command is held makes the gain larger by K_v T / 2, 5 %
        assert_allclose(axis["velocity_gain"].value, gain, rtol=0.08)
        assert_allclose(axis["feed_forward"].value, SHARE, atol=0.03)
        assert_allclose(axis["time_constant"].value, 1.0 / RATE, rtol=0.1)
        assert_allclose(axis["delay"].value, 1.5 * T, atol=0.1 * T)  # half a sample of the hold
        for way in ("forward", "backward"):
            assert_allclose(axis[f"friction_{way}"].value, dry, rtol=0.01)
        assert not axis["integral_rate"].identified
        assert axis.residual_rms < 1.2 * axis.encoder_noise
    assert any("Mass and friction in N need a column" in note for note in found.notes)
    assert any("of the 95 % intervals held it" in note for note in found.notes)


def test_an_integral_of_the_velocity_loop_is_found():
    positions = cascade(WANTED, T, feed_forward=SHARE, integral=100.0, speed=200.0)
    loop = identify_position_loops(logged(positions))
    for axis, gain in zip(loop.axes, GAIN, strict=True):
        # the integral takes viscous friction away
        assert_allclose(axis["velocity_lag"].value, (1.0 - SHARE) / gain, atol=1e-6)
        assert_allclose(axis["velocity_gain"].value, gain, rtol=0.1)
        assert_allclose(axis["feed_forward"].value, SHARE, atol=0.05)
        assert_allclose(axis["integral_rate"].value, 100.0, rtol=0.1)
        assert not axis["friction_forward"].identified


def test_the_machine_of_a_loop_follows_as_the_loop_does(found, proportional):
    machine = identified_machine(found)
    moved = open_loop(machine, WANTED - WANTED[0], T, seed=1) + WANTED[0]
    # friction is in no such machine: it holds the axis back by 30 um
    assert np.abs(moved - proportional).max() < 60e-6
    assert np.abs(WANTED - proportional).max() > 2e-3


def test_laws_are_told_of_what_follows_alike_at_low_frequency(found):
    """With an integral of the velocity loop too, which takes τ / K_v away."""
    for rate in (np.nan, 100.0):
        told = {"velocity_gain": 40.0, "feed_forward": 0.0, "time_constant": 5e-3,
                "integral_rate": rate}  # fmt: skip
        parameters = {
            name: Parameter(value=value, low=value, high=value, unit="1")
            for name, value in told.items()
        }
        axes = tuple(replace(a, parameters={**a.parameters, **parameters}) for a in found.axes)
        machine = identified_machine(replace(found, axes=axes))
        laws = machine.nominal
        s = 2j * np.pi
        top, bottom = (
            np.polyval(np.asarray(rows[0]), s)
            for rows in (machine.dynamics.numerators, machine.dynamics.denominators)
        )
        mass, viscous, spring = (
            float(np.asarray(row)[0]) for row in (laws.mass, laws.viscous, laws.stiffness)
        )
        # at 1 Hz a mass of τ / K_v that is not there would leave 5e-3, the least mass 3e-4
        assert abs((mass * s**2 + viscous * s + spring) * top / bottom - 1.0) < 1e-3


def test_the_machine_of_a_loop_says_which_part_of_a_delay_it_holds(found):
    machine = identified_machine(found)
    delay = float(machine.drive.computing_delay)
    assert_allclose(delay, T, atol=0.1 * T)  # of 1.5 T; a held command adds the rest
    text = " ".join(machine.assumed)
    assert f"Delay {1e3 * delay:.4g} ms is less half a log sample, 1 ms" in text
    assert "it holds in a loop of 2 ms" in text
    assert "later than the log" not in text
    early = Parameter(value=0.3e-3, low=0.2e-3, high=0.4e-3, unit="s")
    axes = tuple(replace(a, parameters={**a.parameters, "delay": early}) for a in found.axes)
    sooner = identified_machine(replace(found, axes=axes))
    assert float(sooner.drive.computing_delay) == 0.0
    assert any("the machine is 0.7 ms later than the log" in said for said in sooner.assumed)


def test_slow_motion_tells_the_lag_alone():
    t = T * np.arange(len(WANTED))
    slow = np.stack([0.05 * np.sin(1.5 * t), 0.04 * np.cos(2.0 * t)], axis=1)
    lag = np.array([0.011, 0.007])
    random = np.random.default_rng(3)
    late = np.stack([0.05 * np.sin(1.5 * (t - lag[0])), 0.04 * np.cos(2.0 * (t - lag[1]))], axis=1)
    log = log_of(late + 2e-6 * random.standard_normal(late.shape), slow, T, "position")
    found = identify_position_loops(log)
    for axis, true in zip(found.axes, lag, strict=True):
        one = axis["velocity_lag"]
        assert one.low - 1e-5 < true < one.high + 1e-5
        assert_allclose(one.value, true, atol=1e-4)
        assert not axis["velocity_gain"].identified
        assert axis.inseparable == ("velocity_gain", "feed_forward", "delay")
    # a fraction of a long delay has a negative feed-forward
    assert any("feed-forward came out negative" in text for text in found.warnings)
    assert any("only the velocity lag is told; velocity gain" in text for text in found.warnings)
    with pytest.raises(RecordingError, match="one by one"):
        identified_machine(found)


def test_a_slow_log_does_not_take_motion_for_noise(proportional):
    """Fourth differences at 20 ms are motion: judged by these, gains 20 % off were believed."""
    random = np.random.default_rng(0)
    measured = proportional + 1e-6 * random.standard_normal(proportional.shape)
    for every, told in ((2, True), (10, False)):
        rows = (np.round(x[::every], 6) for x in (measured, WANTED))
        found = identify_position_loops(log_of(*rows, every * T, "position"))
        slower = 1.0 + VISCOUS / (MASS * RATE)
        for axis, c in zip(found.axes, (slower - SHARE) / GAIN + T, strict=True):
            # what a spline does not know between samples: a hundredth of one
            assert_allclose(axis["velocity_lag"].value, c, atol=0.01 * every * T)
            for name in ("velocity_gain", "feed_forward", "delay"):
                assert axis[name].identified == told, (every, name)
            assert axis.encoder_noise < 1e-5
        said = sum("do not tell noise from motion" in text for text in found.warnings)
        assert said == (0 if told else 2), found.warnings


def test_what_is_known_is_held_as_it_was_given(proportional):
    """Beyond the bounds of the search too, which are for what is looked for."""
    measured, n = proportional[:1000, 0], 1000
    velocity = smooth_velocity(measured, T)
    way = np.where(np.abs(velocity) > 0.01, np.sign(velocity), 0.0)
    pieces = cut_pieces(velocity, 0.01, longest=250)
    given = {"velocity_gain": 0.1, "time_constant": 0.01 * T, "delay": 0.0}
    fit = fit_loop(WANTED[:n, 0], measured, way, T, pieces, given, 4)
    assert {name: fit.values[name] for name in given} == given


def test_a_log_that_is_too_coarse_says_so():
    still = log_of(0.0 * WANTED, WANTED, T, "position")
    with pytest.raises(RecordingError, match="no axis moved one way for 24 samples"):
        identify_position_loops(still)
    one = np.round(WANTED[:1000, :1], 5)
    copied = identify_position_loops(log_of(one, one, T, "position"))
    assert any("too coarse to show how the loop follows" in text for text in copied.warnings)


def test_options_that_make_no_sense_are_refused(proportional):
    log = logged(proportional)
    for options, text in (
        ({"confidence": 0.0}, "confidence must be > 0 and < 1"),
        ({"known": {"mass": 1.0}}, "known has no parameter 'mass' of a position loop"),
        ({"known": {"velocity_gain": 0.0}}, "known velocity_gain must be > 0"),
        ({"known": {"delay": -1.0}}, "known delay must be >= 0"),
    ):
        with pytest.raises(ConfigurationError, match=text):
            identify_position_loops(log, **options)
