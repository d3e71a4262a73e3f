"""Friction and lost motion of an axis that was made apart from the library are found again.

What each does is known at every sample, so the found signal is compared with it, not its size. The
machines differ in loop, friction and sampling.
"""

import numpy as np
import pytest

from contourlab.evaluation.causes.basis import stage_of
from contourlab.evaluation.causes.regression import fit_axis
from contourlab.evaluation.causes.response import decay_time

from .axes import Dry, Loop, behind_play, followed, there_and_back


def rms(values):
    return float(np.sqrt(np.mean(np.square(values - np.mean(values)))))


def found(commanded, actual, dt, grid=0.0, play=True):
    if grid:
        actual = np.round(actual / grid) * grid
    stage = stage_of(commanded, actual, [slice(0, len(actual))], dt, 2.0 * grid)
    return fit_axis(stage, np.arange(len(actual)), {}, play=play)


MACHINES = {
    "cascade": (2e-3, Loop(mass=55.0, position_gain=24.0, velocity_gain=7000.0), Dry(21.0), 11e-6,
                0.0),
    "fed forward, delayed, higher at rest": (
        1e-3, Loop(mass=30.0, position_gain=40.0, feed_forward=0.9, delay=1, integral_gain=8e5),
        Dry(16.0, rest=22.0, speed=4e-3), 7e-6, 1e-7),
    "presliding": (2e-3, Loop(position_gain=35.0, velocity_gain=6500.0), Dry(24.0, distance=12e-6),
                   13e-6, 2e-7),
}  # fmt: skip


LONG = pytest.param("presliding", marks=[pytest.mark.slow, pytest.mark.overnight])


@pytest.mark.parametrize("name", [*(one for one in MACHINES if one != "presliding"), LONG])
def test_friction_and_play_together(name):
    dt, loop, dry, width, grid = MACHINES[name]
    commanded = there_and_back(dt)
    free, motor = followed(commanded, dt, loop), followed(commanded, dt, loop, dry)
    tool = behind_play(motor, width)
    fit = found(commanded, tool, dt, grid)
    # a tenth of what each makes, and hardly anything is left
    for group, true in (("peaks", free - motor), ("sides", motor - tool)):
        assert rms(fit.contributions[group] - true) < 0.1 * rms(true), group
    np.testing.assert_allclose(2.0 * fit.coefficients["sides"], width, rtol=0.03)
    assert rms(fit.residual) < 0.08 * rms(free - motor)
    # on the motor there is friction alone
    seen = found(commanded, motor, dt, grid, play=False)
    assert rms(seen.contributions["peaks"] - (free - motor)) < 0.1 * rms(free - motor)


def test_each_alone_is_not_taken_for_the_other():
    dt, loop, dry, width, grid = MACHINES["cascade"]
    commanded = there_and_back(dt)
    free, motor = followed(commanded, dt, loop), followed(commanded, dt, loop, dry)
    friction = found(commanded, motor, dt, grid)
    assert rms(friction.contributions["peaks"] - (free - motor)) < 0.1 * rms(free - motor)
    assert rms(friction.contributions.get("sides", np.zeros(1))) < 0.03 * rms(free - motor)
    tool = behind_play(free, width)
    play = found(commanded, tool, dt, grid)
    assert rms(play.contributions["sides"] - (free - tool)) < 0.05 * rms(free - tool)
    assert rms(play.contributions.get("peaks", np.zeros(1))) < 0.05 * rms(free - tool)


def test_a_loop_that_does_not_integrate_has_steady_friction_and_no_play():
    dt = 2e-3
    loop = Loop(integral_gain=0.0, position_gain=28.0, velocity_gain=6000.0)
    commanded = there_and_back(dt)
    free, motor = followed(commanded, dt, loop), followed(commanded, dt, loop, Dry(15.0))
    fit = found(commanded, motor, dt)
    assert fit.shape.steady
    assert "sides" not in fit.contributions
    # F / (K_p K_v) in front of either direction
    np.testing.assert_allclose(fit.coefficients["peaks"][-1], 15.0 / (6000.0 * 28.0), rtol=0.03)
    assert rms(fit.contributions["peaks"] - (free - motor)) < 0.05 * rms(free - motor)


@pytest.mark.parametrize(
    "way", [1.0, pytest.param(-1.0, marks=[pytest.mark.slow, pytest.mark.overnight])]
)
def test_friction_that_a_servo_holds_at_rest_is_known_from_the_start(way):
    """A log that begins after a stop: the loop holds the friction of the motion before it."""
    dt, loop, dry = 2e-3, Loop(), Dry(20.0)
    before = np.concatenate([np.linspace(-way * 0.01, 0.0, 250), np.zeros(200)])
    commanded = np.concatenate([before, there_and_back(dt) - there_and_back(dt)[0]])
    free, motor = followed(commanded, dt, loop), followed(commanded, dt, loop, dry)
    cut = 400
    fit = found(commanded[cut:], motor[cut:], dt)
    goes = np.sign(commanded[cut:][np.flatnonzero(commanded[cut:])[0]])
    assert fit.shape.how.before == way * goes
    true = (free - motor)[cut:]
    assert rms(fit.contributions["peaks"] - true) < 0.1 * rms(true)


def test_how_long_a_peak_lasts_is_told_of_a_slow_pole_too():
    dt, slow, fast = 1e-3, np.exp(-2.0 * 1e-3), np.exp(-450.0 * 1e-3)
    d = np.convolve([1.0, -slow], np.convolve([1.0, -fast], [1.0, -fast]))
    # the slow one alone: half a second from its peak, which comes some fast time constants late
    np.testing.assert_allclose(decay_time(np.array([1.0]), d, dt), 0.5 + 0.018, rtol=0.01)
