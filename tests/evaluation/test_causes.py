"""Causes put into a simulated machine, one at a time and together, are found again.

The judge is the machine itself: what a cause does is the contour error with it minus that without.
"""

import dataclasses
import functools

import numpy as np
import pytest

import contourlab as cl
from contourlab.errors import ConfigurationError
from contourlab.evaluation.causes.periodic import find_bands, find_pitch
from contourlab.evaluation.causes.reversals import direction, lost_motion, turning_points

from . import machines as m

TOOL = {"commanded": "reference_X,reference_Y", "actual": "actual_X,actual_Y"}
MOTOR = {"commanded": "reference_X,reference_Y", "actual": "measured_X,measured_Y"}
GAINS = (30.0, 36.0)


@pytest.fixture(scope="module")
def plain():
    return m.run()


def evaluate(recording, measured="tool"):
    return cl.evaluate(
        recording, measured=measured, circular=False, **(MOTOR if measured == "motor" else TOOL)
    )


@pytest.fixture(scope="module")
def a_turn(everything):
    """One direction at one feed."""
    n = round(2.3 * np.pi * m.RADIUS / m.FAST / m.SAMPLE_TIME)
    return cl.Recording(everything.dataset.isel(time=slice(0, n)))


@pytest.fixture(scope="module")
def judged(everything):
    """The log with every cause in it, evaluated once for each place of measurement."""
    return functools.cache(lambda measured: evaluate(everything, measured))


def by_name(evaluation):
    return {cause.name: cause for cause in evaluation.causes}


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


SINGLE = {
    # the load rattles in its play: on average it does not lie at its ends
    "backlash Y": ({"backlash": m.BACKLASH}, "width", m.BACKLASH, 0.2),
    "scale X": ({"scale": m.SCALE}, "scale", m.SCALE, 0.05),
    "squareness X-Y": ({"angle": m.ANGLE}, "angle", m.ANGLE, 0.05),
    "cyclic error X": ({"amplitude": m.AMPLITUDE}, "amplitude", m.AMPLITUDE, 0.1),
    "vibration Y at 43 Hz": ({"vibration": m.FORCE}, "frequency", m.FREQUENCY, 0.01),
    "friction X": ({"friction": m.FRICTION}, None, None, None),
}


# one of them here, since all together are looked for below; friction and play: test_friction
@pytest.mark.parametrize(
    "name",
    [one if one == "scale X" else pytest.param(one, marks=pytest.mark.slow) for one in SINGLE],
)
def test_one_cause_is_found_and_no_other(plain, name):
    put_in, parameter, true, tolerance = SINGLE[name]
    recording = m.run(**put_in)
    found = by_name(evaluate(recording))
    made = rms(np.asarray(recording["contour_error"]) - np.asarray(plain["contour_error"]))
    np.testing.assert_allclose(found[name].rms, made, rtol=0.1)
    assert found[name].state == "found"
    assert found[name].remedy
    if parameter is not None:
        np.testing.assert_allclose(found[name].parameters[parameter][0], true, rtol=tolerance)
    # the machine itself has lags and friction on Y; nothing else may be made up
    for other, cause in found.items():
        if other not in (name, "lag mismatch", "friction Y", "rest", "alignment"):
            assert cause.state != "found" or cause.rms < 0.15 * made, other


@pytest.mark.slow
def test_lag_mismatch():
    recording = m.run(gains=GAINS)
    found = by_name(evaluate(recording))
    cause = found["lag mismatch"]
    lags = [cause.parameters[f"lag {axis}"][0] for axis in "XY"]
    # K_v of a cascade without feed-forward is its position gain, and a little of viscous friction
    np.testing.assert_allclose(lags, [1 / 30.0, 1 / 36.0], rtol=0.03)
    assert cause.share > 0.97
    assert "velocity gains X 29" in cause.remedy or "velocity gains X 30" in cause.remedy
    np.testing.assert_allclose(
        cause.rms, evaluate(recording).metrics["contour_error_rms"], rtol=0.02
    )


@pytest.fixture(scope="module")
def everything():
    return m.run(
        gains=GAINS, friction=m.FRICTION, backlash=m.BACKLASH, angle=m.ANGLE, scale=m.SCALE,
        amplitude=m.AMPLITUDE, vibration=m.FORCE,
    )  # fmt: skip


def test_all_causes_together(judged):
    evaluation = judged("tool")
    found = by_name(evaluation)
    for name, (_, parameter, true, tolerance) in SINGLE.items():
        assert found[name].state in ("found", "small")
        if parameter is not None:
            value = found[name].parameters[parameter][0]
            np.testing.assert_allclose(value, true, rtol=max(tolerance, 0.1), err_msg=name)
    lags = [found["lag mismatch"].parameters[f"lag {axis}"][0] for axis in "XY"]
    np.testing.assert_allclose(lags, [1 / 30.0, 1 / 36.0], rtol=0.03)
    np.testing.assert_allclose(found["cyclic error X"].parameters["period"][0], m.PERIOD, rtol=0.02)
    assert found["rest"].share < 0.01
    # shares add up to one, and the parts to the whole
    shares = [c.share for c in evaluation.causes if np.isfinite(c.share)]
    np.testing.assert_allclose(sum(shares), 1.0, rtol=0, atol=1e-9)
    whole = sum(c.signal for c in evaluation.causes if c.signal is not None)
    error = np.asarray(evaluation.recording["contour_error"])
    np.testing.assert_allclose(whole[evaluation.judged], error[evaluation.judged], atol=1e-15)


def test_the_motor_does_not_see_what_lies_behind_it(judged):
    found = by_name(judged("motor"))
    for name in ("backlash Y", "scale X", "squareness X-Y", "cyclic error X"):
        assert found[name].state == "unobservable"
        assert "measured on the motor" in found[name].note
        assert np.isnan(found[name].rms)
    lags = [found["lag mismatch"].parameters[f"lag {axis}"][0] for axis in "XY"]
    np.testing.assert_allclose(lags, [1 / 30.0, 1 / 36.0], rtol=0.03)
    assert found["friction X"].state == "found"


def test_where_it_was_measured_matters_and_is_asked_for(everything, a_turn):
    assert any("state measured" in warning for warning in evaluate(a_turn, None).warnings)
    scale = by_name(evaluate(a_turn, "scale"))
    assert scale["squareness X-Y"].state == "unobservable"
    with pytest.raises(ConfigurationError, match="unknown measured 'table'"):
        evaluate(everything, "table")


def test_one_direction_at_one_feed_does_not_separate_lag_from_squareness(a_turn):
    evaluation = evaluate(a_turn)
    found = by_name(evaluation)
    assert found["squareness X-Y"].state == "not separable"
    assert "both directions" in found["squareness X-Y"].note
    assert "squareness" in found["lag mismatch"].note
    assert any("cannot be told apart" in warning for warning in evaluation.warnings)


def test_a_stated_pitch_is_used(everything, a_turn):
    given = cl.evaluate(a_turn, measured="tool", circular=False, pitch="10 mm", **TOOL)
    period = by_name(given)["cyclic error X"].parameters["period"]
    assert period == (0.010, "m")
    with pytest.raises(ConfigurationError, match="pitch must have one value or 2"):
        cl.evaluate(everything, pitch="10 mm, 10 mm, 5 mm", **TOOL)


def test_single_events_are_no_vibration():
    dt, rows = 1e-3, np.arange(6000)
    events = np.zeros(6000)
    events[[700, 4400]] = 1.0
    t = (np.arange(1200) - 600) * dt
    wave = 5e-6 * np.sin(2.0 * np.pi * 9.0 * t) * np.exp(-((t / 0.07) ** 2))
    noise = 2e-8 * np.random.default_rng(4).normal(size=6000)
    steady = 1e-6 * np.sin(2.0 * np.pi * 41.0 * rows * dt)
    whole = (slice(0, 6000),)
    assert find_bands(np.convolve(events, wave, "same") + noise, whole, dt) == []
    assert [round(band.frequency) for band in find_bands(steady + noise, whole, dt)] == [41]


def test_turning_points_ignore_flicker():
    position = np.array([0.0, 1.0, 2.0, 1.9, 2.0, 3.0, 2.0, 1.0, 1.1, 1.0, 0.0, 0.0, 2.0])
    rows, signs = turning_points(position, 0.2)
    assert list(rows) == [5, 11]
    assert list(signs) == [1.0, -1.0, 1.0]
    assert list(direction(13, rows, signs)[[0, 5, 6, 11, 12]]) == [1.0, 1.0, -1.0, -1.0, 1.0]
    # play of 1 is crossed over a way of 1
    side = lost_motion(position, rows, signs, 1.0)
    np.testing.assert_allclose(side[[5, 6, 7]], [1.0, -1.0, -1.0])
    np.testing.assert_allclose(lost_motion(position, rows, signs, 2.0)[6], 0.0)


def test_noise_holds_no_pitch_and_no_vibration():
    found = 0
    for seed in range(40):
        noise = np.random.default_rng(seed).normal(size=4000)
        position = 0.05 * np.sin(np.arange(4000) * 0.004)
        found += find_pitch(position, noise, 4000.0) is not None
        found += bool(find_bands(noise, (slice(0, 4000),), 1e-3))
    assert found <= 2


def test_causes_are_immutable(judged):
    cause = judged("tool").causes[0]
    with pytest.raises(dataclasses.FrozenInstanceError):
        cause.rms = 0.0
    assert cause.json()["parameters"]["lag X"]["unit"] == "s"
