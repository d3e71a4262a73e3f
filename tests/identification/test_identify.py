"""What a record tells and what it does not, against closed forms and a loop of another kind."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.controllers import FilteredLeastSquares
from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification import identify
from contourlab.recordings import Reference

from .loops import COULOMB, PUSH, TRUE, VISCOUS, T, motions, of_velocity, recording, run

TIME = np.arange(4001) * T


def record_of(velocity, **options):
    motion = of_velocity(np.stack(velocity, axis=1))
    measured, command = run(motion, **options)
    return recording(measured[0], command[0], motion[0])


def varied_circle(machine, duration=5.0):
    """A record of a machine of the library on a circle at a varied rate."""
    t = np.arange(round(duration / T) + 1) * T
    reference = Reference.along(
        cl.contours.Circle(radius=0.05), sample_time=T,
        parameter=4 * t + 1.5 * np.sin(2.3 * t), parameter_rate=4 + 3.45 * np.cos(2.3 * t),
        parameter_acceleration=-7.935 * np.sin(2.3 * t),
        parameter_jerk=-18.2505 * np.cos(2.3 * t),
    )  # fmt: skip
    law = cl.controllers.AxisPid.by_pole_placement(machine.nominal, bandwidth_hz=20.0)
    return cl.simulate(machine, law, reference)


@pytest.fixture(scope="module")
def stage():
    """With Stribeck friction, counts of 1 µm and a computing delay that the law does not know."""
    machine = cl.machines.linear_motor_stage(encoder=1e-6, computing_delay=1.3e-3)
    return varied_circle(machine)


def test_without_noise_the_values_are_the_truth():
    motion = motions()
    measured, command = run(motion, noise=0.0, resolution=0.0)
    found = identify(recording(measured[0], command[0], motion[0]))
    # what is left: B (T M⁻¹ B)² / 12 of the mean over an interval, and what the filter has not
    # forgotten of the reversals
    assert_allclose(found.values, TRUE, rtol=2e-5, atol=2e-5)
    assert found.warnings == ()


def test_a_machine_of_the_library_is_found_through_stribeck_friction(stage):
    found = identify(stage, computing_delay=1.3e-3)
    nominal = cl.machines.linear_motor_stage().nominal
    truth = np.stack([nominal.mass, nominal.viscous, nominal.coulomb])
    assert_allclose(found.values[:3], truth, rtol=2e-4)
    assert_allclose(found.values[3], 0.0, atol=1e-3)
    assert found.warnings == ()
    for axis in found.axes:
        assert axis.lag.low < 2e-6
        assert axis.lag.high > -2e-6


def test_a_delay_that_was_not_told_is_found(stage):
    found = identify(stage)
    for axis in found.axes:
        assert_allclose(axis.lag.value, 1.3e-3, rtol=0.02)
        assert any(
            f"axis {axis.axis}: the command seems to act 1.29 ms later" in sentence
            or f"axis {axis.axis}: the command seems to act 1.3 ms later" in sentence
            for sentence in found.warnings
        )


def test_other_friction_at_low_speed_is_noticed(stage):
    machine = cl.machines.linear_motor_stage(encoder=1e-7)
    friction = cl.replace(machine.dynamics.friction, breakaway=(9.0, 6.0), stribeck_velocity=0.03)
    slow = cl.replace(machine, dynamics=cl.replace(machine.dynamics, friction=friction))
    record = varied_circle(slow)
    said = identify(record).warnings
    assert any("friction differs by" in s and "raise minimum_speed" in s for s in said)
    above = identify(record, minimum_speed=0.1)
    assert not any("friction differs" in s for s in above.warnings)
    assert np.all(
        np.abs(above.values[2] - [6.0, 4.0]) < np.abs(identify(record).values[2] - [6.0, 4.0])
    )


def test_the_gantry_has_the_bias_that_the_closed_form_predicts():
    """M̂/M = S / (S + σ²) with counts of 0.5 µm, S of the ellipse, σ² of white rounding."""
    machine = cl.machines.published.hu_gantry()
    ellipse = cl.contours.Ellipse(semi_axes=(0.2, 0.1), center=(0.0, 0.1))
    reference = cl.feedrate.constant_rate(ellipse, rate=4.0, duration=5.0, sample_time=2e-4)
    law = cl.controllers.AxisPid.by_pole_placement(machine.nominal, bandwidth_hz=20.0)
    record = cl.simulate(machine, law, reference)
    found = identify(
        record, law=FilteredLeastSquares(cutoff_hz=(250.0, 150.0)), minimum_speed=0.01,
        window=(1.0, 5.0),
    )  # fmt: skip
    nominal = machine.nominal
    assert_allclose(found.values[:3], [nominal.mass, nominal.viscous, nominal.coulomb], rtol=1e-3)
    omega = 2 * np.pi * np.array([250.0, 150.0])
    # of the filter's gain ω^4 (f/f_c)^4 / |...|² over white noise of one count², by quadrature
    f = np.linspace(0.0, 2500.0, 200001)
    s = 1e4 * 1j * np.tan(np.pi * f * 2e-4)[:-1]
    for axis, w, amplitude in zip(found.axes, omega, (0.2, 0.1), strict=True):
        gain = np.abs(s**2 * w**2 / (s**2 + 1.4 * w * s + w**2)) ** 2
        sigma2 = gain.mean() * (0.5e-6) ** 2 / 12
        square = (amplitude * 16.0) ** 2 / 2
        assert_allclose(axis.encoder_noise, 0.5e-6 / np.sqrt(12), rtol=0.03)
        # rows near reversals do not count, where the acceleration of a sine is largest
        assert_allclose(1 - axis.noise_ratio, sigma2 / (square + sigma2), rtol=0.15)
        mass = axis["mass"].value
        assert_allclose(axis.least_squares[0] - mass, axis.encoder_bias[0], rtol=0.1)
        assert_allclose(axis.encoder_bias[0] / mass, axis.noise_ratio - 1, rtol=0.05)


def test_one_velocity_tells_nothing_apart():
    record = record_of((np.full_like(TIME, 0.1), np.full_like(TIME, 0.2)))
    for instrument in ("reference", "delayed", "none"):
        found = identify(record, instrument=instrument)
        assert np.isnan(found.values).all()
        for axis in found.axes:
            assert axis.unexcited == ("mass",)
            assert axis.inseparable == ("viscous", "coulomb", "disturbance")
        text = "\n".join(found.warnings)
        assert "axis X: viscous, coulomb and disturbance cannot be told apart" in text
        assert "mass was not found" in text
        assert "they take 6.5 N at 0.1 m/s" in text  # 25 * 0.1 + 6 - 2
        assert "not found" in str(found)


def test_one_speed_both_ways_leaves_viscous_and_coulomb_together():
    there = np.sign(np.sin(2 * TIME + 0.1))
    found = identify(record_of((0.1 * there, -0.2 * there)))
    for axis, push, effort in zip(found.axes, PUSH, (8.5, 7.6), strict=True):
        assert axis.inseparable == ("viscous", "coulomb")
        assert np.isnan([axis["viscous"].value, axis["coulomb"].value]).all()
        assert axis["disturbance"].low < push < axis["disturbance"].high
        speed = 0.1 if axis.axis == "X" else 0.2
        assert any(f"they take {effort:g} N at {speed:g} m/s" in s for s in found.warnings)


def test_one_direction_leaves_coulomb_and_disturbance_together():
    record = record_of((0.1 + 0.05 * np.sin(8 * TIME), 0.2 * np.cos(5 * TIME)))
    x, y = identify(record).axes
    assert x.inseparable == ("coulomb", "disturbance")
    assert y.inseparable == ()
    assert_allclose([x["mass"].value, x["viscous"].value], [5.0, 25.0], rtol=2e-3)
    told = identify(record, known={"disturbance": PUSH})
    assert_allclose(told["X"]["coulomb"].value, 6.0, rtol=2e-3)
    assert told["X"]["disturbance"].known
    assert told["X"]["disturbance"].value == 2.0


def test_an_axis_at_rest_is_named_and_the_other_found():
    found = identify(record_of((0.0 * TIME, 0.2 * np.cos(5 * TIME))))
    assert np.isnan(found.values[:, 0]).all()
    assert_allclose(found.values[:3, 1], TRUE[:3, 1], rtol=2e-3)
    assert any("axis X: it never moved faster" in s for s in found.warnings)
    with pytest.raises(RecordingError, match="no axis moved faster than"):
        identify(record_of((0.0 * TIME, 0.0 * TIME)))


def test_what_is_known_is_not_looked_for():
    record = record_of((0.2 * np.sin(7 * TIME), 0.2 * np.cos(5 * TIME)))
    found = identify(record, known={"viscous": VISCOUS, "coulomb": COULOMB})
    assert_allclose(found.values[1:3], [VISCOUS, COULOMB], rtol=0)
    assert_allclose(found.values[0], TRUE[0], rtol=1e-3)
    wrong = identify(record, known={"viscous": 2 * VISCOUS})
    assert abs(wrong["X"]["coulomb"].value - 6.0) > 1.0


def test_a_velocity_loop_is_a_mass_too():
    """τ q'' + q' = u: mass τ, viscous 1."""
    t = np.arange(6001) * T
    u = np.stack([0.2 * np.sin(7 * t) + 0.1 * np.sin(17 * t), 0.2 * np.cos(5 * t)], axis=1)
    tau, q, v = np.array([0.010, 0.012]), np.zeros((len(t), 2)), np.zeros(2)
    decay = np.exp(-T / tau)
    for k in range(len(t) - 1):
        q[k + 1] = q[k] + u[k] * T + (v - u[k]) * tau * (1 - decay)
        v = u[k] + (v - u[k]) * decay
    found = identify(recording(q, u, kind="velocity"), instrument="none")
    # the mean over an interval and Tustin's rule: (T / τ)² / 12
    assert_allclose(found.values[0], tau, rtol=3e-3)
    assert_allclose(found.values[1], 1.0, rtol=1e-4)
    assert found["X"]["mass"].unit == "s"
    assert found.model().command == "velocity"


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"instrument": "refernce"}, ConfigurationError, "did you mean reference"),
        ({"confidence": 1.0}, ConfigurationError, "confidence must be > 0 and < 1, got 1.0"),
        ({"condition_limit": 1.0}, ConfigurationError, "condition_limit must be > 1"),
        ({"minimum_speed": 0.0}, ConfigurationError, "minimum_speed must be > 0 m/s, got 0.0"),
        ({"computing_delay": -1e-3}, ConfigurationError, "computing_delay must be >= 0 s"),
        ({"known": {"inertia": 1.0}}, ConfigurationError, "no parameter 'inertia'"),
        ({"known": {"mass": (1.0, 2.0, 3.0)}}, ConfigurationError, "one value per axis, 2, got 3"),
        ({"known": {"mass": np.nan}}, ConfigurationError, "known mass must be finite"),
        (
            {"known": dict.fromkeys(("mass", "viscous", "coulomb", "disturbance"), 1.0)},
            ConfigurationError,
            "known leaves nothing to find",
        ),
        ({"command_kind": "position"}, RecordingError, "from a position command"),
        ({"window": (5.0, 6.0)}, RecordingError, "8 samples or more are needed, got 0"),
    ],
)
def test_mistakes_are_named(options, error, message):
    record = record_of((0.2 * np.sin(7 * TIME[:400]), 0.2 * np.cos(5 * TIME[:400])))
    with pytest.raises(error, match=message):
        identify(record, **options)
