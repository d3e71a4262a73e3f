"""Every published machine is found from its own log, and what a motion does not tell is said."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification import identify_machine

from .loops import TRUE, motions, of_velocity, recording, run
from .loops import T as STEP
from .machines import log_of, open_loop, varied_reference
from .published import CASES


def tracked(machine, size, sample_time, bandwidth, seed=3, **motion):
    law = cl.controllers.AxisPid.by_pole_placement(machine.nominal, bandwidth_hz=bandwidth)
    return cl.simulate(machine, law, varied_reference(size, sample_time, **motion), seed=seed)


ONE_OF_EACH = (
    "meng_xy_stage", "meng_emulated_stage", "el_khalick_feed_drive", "ghaffari_two_axes",
    "hu_gantry", "cao_zhang_stage",
)  # fmt: skip


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_a_published_machine_is_found_from_its_own_log(name):
    case = CASES[name]()
    log = cl.simulate(case.machine, case.law(), case.reference(), seed=3)
    found = identify_machine(log, **case.options)
    for k, axis in enumerate(found.axes):
        assert axis.method == "simulation error"
        for parameter, values in case.truth().items():
            one = axis[parameter]
            if parameter == "delay" and not one.identified:
                continue  # taken for 0, and that is said
            half = 0.5 * (one.high - one.low)
            # one log: 95 of 100 intervals hold the truth, nearly all of half their width more do
            assert abs(one.value - values[k]) < 1.5 * half, (parameter, one, values[k])
        assert axis["mass"].high - axis["mass"].low < 0.02 * axis["mass"].value
        assert axis.residual_rms < 1.3 * axis.encoder_noise


@pytest.fixture(scope="module")
def delayed_stage():
    machine = cl.machines.linear_motor_stage(encoder=1e-6, computing_delay=1.3e-3)
    return tracked(machine, (0.08, 0.05), 1e-3, 20.0)


@pytest.fixture(scope="module")
def delayed(delayed_stage):
    return identify_machine(delayed_stage)


def test_the_delay_is_found_with_the_rest(delayed):
    found = delayed
    assert found.warnings == ()
    for axis, mass, viscous in zip(found.axes, (5.0, 3.0), (25.0, 18.0), strict=True):
        assert_allclose(axis["mass"].value, mass, rtol=1e-5)
        assert_allclose(axis["viscous"].value, viscous, rtol=1e-4)
        assert_allclose(axis["delay"].value, 1.3e-3, atol=2e-6)
        assert not axis["stiffness"].identified


def test_a_delay_that_is_given_is_not_looked_for(delayed_stage):
    found = identify_machine(delayed_stage, known={"delay": 1.3e-3})
    for axis, mass in zip(found.axes, (5.0, 3.0), strict=True):
        assert axis["delay"].known
        assert "delay" not in axis.free
        assert_allclose(axis["mass"].value, mass, rtol=1e-5)


def test_counts_bias_plain_least_squares_and_not_this():
    """M̂/M = S / (S + σ²) of least squares: 0.35 % here; refined it is not seen."""
    position, *_ = motion = motions()
    measured, command = run(motion, noise=1e-6, resolution=1e-6, seed=4)
    found = identify_machine(recording(measured[0], command[0], position))
    plain = cl.identification.identify(
        recording(measured[0], command[0], position), instrument="none"
    )
    for k, axis in enumerate(found.axes):
        true, bias = TRUE[0, k], axis.noise_ratio - 1.0
        assert bias < -1e-3
        assert_allclose(plain.axes[k]["mass"].value / true - 1.0, bias, rtol=0.2)
        assert abs(axis["mass"].value / true - 1.0) < 0.01 * abs(bias)


def test_without_a_reference_white_noise_does_no_harm():
    measured, command = run(motions(), noise=1e-6, seed=5)
    found = identify_machine(recording(measured[0], command[0]), known={"delay": 0.0})
    assert found.instrument == "none"
    for k, axis in enumerate(found.axes):
        assert_allclose(axis["mass"].value, TRUE[0, k], rtol=5e-5)
        assert_allclose(axis.coulomb, TRUE[2, k], rtol=5e-4)
        assert_allclose(axis.constant_force, TRUE[3, k], atol=2e-3)


def moved(velocity):
    motion = of_velocity(np.stack(velocity, axis=1))
    measured, command = run(motion, noise=1e-6)
    return recording(measured[0], command[0], motion[0])


TIME = np.arange(6001) * STEP


def test_what_a_motion_does_not_tell_has_no_value():
    one_way = identify_machine(
        moved((0.1 + 0.05 * np.sin(8 * TIME), 0.2 * np.cos(5 * TIME) + 0.1 * np.cos(13 * TIME)))
    )
    x, y = one_way.axes
    assert x.unexcited == ("coulomb_backward",)
    assert not x["coulomb_backward"].identified
    assert_allclose(x["mass"].value, 5.0, rtol=1e-3)
    assert_allclose(x["coulomb_forward"].value, 4.0, rtol=2e-2)  # A - d = 6 - 2
    assert any("axis X: coulomb_backward was not found" in s for s in one_way.warnings)
    assert y.unexcited == ()
    steady = identify_machine(
        moved((np.full_like(TIME, 0.1), 0.2 * np.cos(5 * TIME) + 0.1 * np.cos(13 * TIME)))
    )
    assert not steady["X"]["mass"].identified
    assert any("axis X: mass was not found" in s for s in steady.warnings)
    there = np.sign(np.sin(2 * TIME + 0.1))
    speed = identify_machine(moved((0.1 * there, 0.2 * np.cos(5 * TIME))))
    assert not speed["X"]["viscous"].identified
    resting = identify_machine(moved((0.0 * TIME, 0.2 * np.cos(5 * TIME))))
    assert resting["X"].method == "none"
    assert any("axis X: it never moved faster" in s for s in resting.warnings)


def test_a_position_loop_is_a_mass_on_a_spring():
    """q + 2 ζ q'/ω + q''/ω² = u: what a log of commanded and actual positions tells."""
    omega, zeta, step = np.array([60.0, 45.0]), 0.8, 1e-3
    machine = cl.machines.Machine(
        names=("X", "Y"),
        dynamics=cl.machines.TransferFunctionAxes(
            numerators=((1.0,), (1.0,)),
            denominators=tuple((1 / w**2, 2 * zeta / w, 1.0) for w in omega),
        ),
        drive=cl.machines.Drive(command="position", computing_delay=2.4e-3),
        sensor=cl.machines.Encoder(noise=0.3e-6),
    )
    wanted = np.asarray(varied_reference((0.05, 0.04), step, 3.0, rate=12.0).position)
    wanted = wanted - wanted[0]
    measured = open_loop(machine, wanted, step, seed=2)
    found = identify_machine(log_of(measured, wanted, step, "position"))
    for axis, w in zip(found.axes, omega, strict=True):
        assert_allclose(axis["mass"].value, 1 / w**2, rtol=1e-3)
        assert_allclose(axis["viscous"].value, 2 * zeta / w, rtol=1e-3)
        assert_allclose(axis["stiffness"].value, 1.0, rtol=1e-5)
        assert_allclose(axis["delay"].value, 2.4e-3, atol=1e-5)


def test_forces_that_nobody_knows_of_widen_the_intervals():
    motion = motions(2.5)
    calm, rough = (
        identify_machine(recording(measured[0], command[0], motion[0]))
        for measured, command in (
            run(motion, noise=1e-6, seed=7),
            run(motion, noise=1e-6, force=2.0, time=0.03, seed=7),
        )
    )
    for k in range(2):
        narrow, wide = (f.axes[k]["mass"] for f in (calm, rough))
        assert wide.high - wide.low > 100 * (narrow.high - narrow.low)
        assert rough.axes[k].corner_hz > 10.0
        assert calm.axes[k].corner_hz < 2.0
    assert any("misses the measured one" in s for s in rough.warnings)


def test_options_are_refused_that_say_nothing(delayed_stage):
    for options, text in (
        ({"instrument": "guess"}, "unknown instrument"),
        ({"confidence": 1.0}, "confidence must be > 0 and < 1"),
        ({"condition_limit": 1.0}, "condition_limit must be > 1"),
        ({"minimum_speed": 0.0}, "minimum_speed must be > 0"),
        ({"piece_time": -1.0}, "piece_time must be > 0"),
        ({"known": {"weight": 1.0}}, "known has no parameter 'weight'"),
        ({"known": {"mass": np.nan}}, "known mass must be finite"),
    ):
        with pytest.raises(ConfigurationError, match=text):
            identify_machine(delayed_stage, **options)
    bare = cl.Recording(delayed_stage.dataset.drop_vars("reference"))
    with pytest.raises(RecordingError, match="no reference to be an instrument"):
        identify_machine(bare, instrument="reference")


def test_more_confidence_is_a_wider_interval(delayed_stage, delayed):
    some = identify_machine(delayed_stage, confidence=0.8)["X"]["mass"]
    more = delayed["X"]["mass"]
    assert more.low < some.low < some.high < more.high
    assert_allclose(some.value, more.value, rtol=1e-9)
