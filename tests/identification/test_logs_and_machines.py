"""From uneven logs to machine files that simulate as the machine that made the log."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.errors import ConfigurationError, OutputError, RecordingError
from contourlab.identification import (
    FrequencyModel,
    Parameter,
    even_recording,
    exciting_motion,
    identified_machine,
    identify_machine,
)
from contourlab.machines import RigidAxes, TwoMassAxes
from contourlab.scenarios import machine_to_toml, read_machine_file, write_machine_file

from .loops import T, motions, of_velocity, recording, run
from .machines import log_of, varied_reference


@pytest.fixture(scope="module")
def stage():
    return cl.machines.linear_motor_stage(encoder=1e-6, computing_delay=0.8e-3)


@pytest.fixture(scope="module")
def tracked(stage):
    law = cl.controllers.AxisPid.by_pole_placement(stage.nominal, bandwidth_hz=20.0)
    return cl.simulate(stage, law, varied_reference((0.08, 0.05), T, duration=4.0), seed=3)


@pytest.fixture(scope="module")
def machine(tracked):
    return identified_machine(identify_machine(tracked, source="a log"))


def test_the_machine_is_the_one_that_made_the_log(machine, stage):
    for name in ("mass", "viscous"):
        assert_allclose(getattr(machine.nominal, name), getattr(stage.nominal, name), rtol=1e-3)
    assert_allclose(machine.dynamics.friction.coulomb, (6.0, 4.0), rtol=1e-2)
    assert_allclose(machine.drive.computing_delay, 0.8e-3, atol=2e-6)
    assert_allclose(machine.sensor.resolution, 1e-6, rtol=1e-6)
    assert_allclose(machine.drive.command_limit, (150.0, 90.0))
    assert machine.source == "a log"
    assert any("do" in s and "input gain" in s for s in machine.assumed)


def test_the_machine_file_gives_it_back_and_it_moves_alike(machine, stage, tmp_path):
    file = tmp_path / "machine.toml"
    write_machine_file(machine, file)
    again = read_machine_file(file)
    assert machine_to_toml(again) == machine_to_toml(machine)
    law = cl.controllers.AxisPid.by_pole_placement(stage.nominal, bandwidth_hz=20.0)
    reference = varied_reference((0.06, 0.04), T, duration=2.0)
    one, other = (cl.simulate(m, law, reference, seed=1) for m in (stage, again))
    # Stribeck friction of the stage is what the model lacks
    assert_allclose(other["actual"], one["actual"], atol=2e-5)


def test_what_has_no_mass_is_no_machine():
    time = np.arange(6001) * T
    motion = of_velocity(np.stack([np.full_like(time, 0.1), 0.2 * np.cos(5 * time)], axis=1))
    measured, command = run(motion)
    found = identify_machine(recording(measured[0], command[0], motion[0]))
    with pytest.raises(RecordingError, match="axis X: mass could not be found"):
        identified_machine(found)


@pytest.mark.parametrize("lacks", ["", "damping"])
def test_two_masses_that_are_left_out_are_told(lacks):
    motion = motions(2.0)
    measured, command = run(motion, seed=7)
    found = identify_machine(
        recording(measured[0], command[0], motion[0]), simulate=False, known={"delay": 0.0}
    )
    values = {"motor_mass": 3.0, "load_mass": 2.0, "stiffness": 2e5, "damping": 20.0,
              "motor_viscous": 25.0, "delay": 1e-3}  # fmt: skip
    parameters = {n: Parameter(value=v, low=v, high=v, unit="1") for n, v in values.items()}
    if lacks:
        parameters[lacks] = Parameter(value=np.nan, low=np.nan, high=np.nan, unit="1")
    models = [
        FrequencyModel(
            axis=axis.axis, model="two_mass", side="motor", parameters=parameters, derived={},
            misfit=1.0, frequency=np.ones(3), response=np.ones(3),
        )
        for axis in found.axes
    ]  # fmt: skip
    made = identified_machine(found, models=models)
    said = [text for text in made.assumed if "shows two masses" in text]
    if lacks:
        assert isinstance(made.dynamics, RigidAxes)
        assert ["does not tell damping" in text for text in said] == [True, True]
    else:
        assert isinstance(made.dynamics, TwoMassAxes)
        assert not said


def test_the_suggested_motion_keeps_its_limits_and_tells_everything(stage, tmp_path):
    limits = {"stroke": (0.1, 0.06), "speed": (0.4, 0.3), "acceleration": (6.0, 8.0)}
    motion = exciting_motion(("X", "Y"), middle=(0.02, 0.0), duration=5.0, **limits)
    step = motion.time[1]
    rate = np.diff(motion.position, axis=0) / step
    assert np.all(np.abs(motion.position - [0.02, 0.0]) <= np.array(limits["stroke"]) / 2)
    assert np.all(np.abs(rate).max(axis=0) < limits["speed"])
    assert np.all(np.abs(np.diff(rate, axis=0)).max(axis=0) / step < limits["acceleration"])
    assert_allclose(motion.position[[0, -1]], [[0.02, 0.0]] * 2, atol=1e-9)
    velocity = np.gradient(motion.position, step, axis=0)
    whole = motion.position, velocity, np.gradient(velocity, step, axis=0)
    measured, command = run(whole, noise=1e-6)
    found = identify_machine(recording(measured[0], command[0], motion.position))
    assert found.warnings == ()
    for axis, mass in zip(found.axes, (5.0, 3.0), strict=True):
        assert "delay" in axis.free
        assert_allclose(axis["mass"].value, mass, rtol=1e-3)
    motion.to_csv(tmp_path / "motion.csv")
    rows = np.loadtxt(tmp_path / "motion.csv", delimiter=",", skiprows=1)
    assert_allclose(rows[:, 1:], 1e3 * motion.position, atol=1e-8)
    with pytest.raises(OutputError):
        motion.to_csv(tmp_path / "motion.csv")
    for wrong in ({"stroke": 0.0}, {"speed": -1.0}, {"acceleration": np.inf}):
        with pytest.raises(ConfigurationError):
            exciting_motion(("X", "Y"), **{**limits, **wrong})
    with pytest.raises(ConfigurationError, match="duration"):
        exciting_motion(("X",), stroke=0.1, speed=0.1, acceleration=1.0, duration=1e-3)


def test_a_log_of_linuxcnc_gives_the_axes_that_it_moved():
    """Their friction rises below 5 mm/s, in a motion of 50 mm/s; forces are written to 1 µN."""
    file = Path(__file__).parents[2] / "examples" / "linuxcnc" / "logs" / "cam_plate.csv"
    log = cl.logs.read_log(file, command="X force [N],Y force [N]").recording()
    found = identify_machine(log)
    true = cl.machines.linear_motor_stage()
    for k, axis in enumerate(found.axes):
        assert axis.method == "simulation error"
        assert axis.minimum_speed > 5e-3
        # nothing is left but counts of 0.1 um
        assert axis.residual_rms < 1.5 * 0.1e-6 / np.sqrt(12.0)
        friction = true.dynamics.friction.coulomb[k]
        for name, value in (
            ("mass", true.dynamics.mass[k]), ("viscous", true.dynamics.viscous[k]),
            ("coulomb_forward", friction), ("coulomb_backward", friction), ("delay", 0.0),
        ):  # fmt: skip
            # of ten intervals one misses by a little more often than not
            half = 0.5 * (axis[name].high - axis[name].low)
            assert abs(axis[name].value - value) < 2.0 * half, (axis.axis, name)
    assert sum("Stribeck" in warning for warning in found.warnings) == 2


def uneven(time):
    rows = np.zeros((len(time), 2))
    log = log_of(rows, rows, 1.0, "force")
    return cl.Recording(log.dataset.assign_coords(time=("time", np.asarray(time, float))))


def test_gaps_and_rattling_clocks_are_said():
    time = np.arange(100) * 1e-3
    even, said = even_recording(uneven(time))
    assert said == ()
    assert even.n_samples == 100
    gap = time.copy()
    gap[70:] += 0.5
    even, said = even_recording(uneven(gap))
    assert even.n_samples == 70
    assert "1 gaps" in said[0]
    rattling = time + 2e-4 * np.random.default_rng(0).uniform(-1, 1, 100)
    even, said = even_recording(uneven(rattling))
    assert np.ptp(np.diff(np.asarray(even["time"]))) < 1e-12
    assert "rattle" in said[0]
    for wrong, text in (
        (time[::-1], "time must rise"),
        (np.where(np.arange(100) == 5, np.nan, time), "not a finite number"),
        (time[:4], "8 samples or more"),
    ):
        with pytest.raises(RecordingError, match=text):
            even_recording(uneven(wrong))
