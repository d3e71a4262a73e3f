"""Machine files: read, written, read again; and every mistake with its file, line and key."""

import re
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import replace
from contourlab.errors import ConfigurationError, OutputError, ScenarioError
from contourlab.machines import (
    BallScrewAxes,
    Cogging,
    Drive,
    Encoder,
    Friction,
    GeometricErrors,
    LinearTool,
    Machine,
    NominalModel,
    PositionError,
    RigidAxes,
    Squareness,
    StateSpaceAxes,
    TwoMassAxes,
    ball_screw_stage,
    iron_core_stage,
    linear_motor_stage,
    machining_centre,
    published,
)
from contourlab.scenarios import machine_schema as schema
from contourlab.scenarios.machine import build_machine
from contourlab.scenarios.machine_file import (
    machine_to_toml,
    read_machine_file,
    read_machine_text,
    write_machine_file,
)
from contourlab.scenarios.machine_schema import MachineSection

MILL = """
title = "A mill"
source = "Data sheets of motor and screw; backlash by dial gauge."
assumed = ["Damping is guessed."]
command = "voltage"
computing_delay = "0.5 ms"
velocity = "difference"
substeps = 8

[[squareness]]
axes = ["X", "Y"]
angle = "0.002 deg"

[[axis]]
name = "X"
coulomb = 120.0
breakaway = 180.0
command_limit = 10.0
travel = ["0 mm", "500 mm"]
resolution = "0.1 um"
measured = "motor"
velocity_limit = "30 m/min"
acceleration_limit = "4 m/s^2"
jerk_limit = "50 m/s^3"

[axis.ball_screw]
lead = "10 mm"
motor_inertia_kg_m2 = 12e-4
screw_inertia_kg_m2 = 6e-4
table_mass_kg = 250
torque_constant_n_m_per_a = 1.2
amplifier_gain_a_per_v = 2.0
stiffness_n_per_m = 4e7
damping_ratio = 0.03
backlash = "4 um"

[axis.ball_screw.motor_friction]
coulomb = 0.5

[axis.screw_error]
scale = 2e-5
amplitude = "1.5 um"
period = "10 mm"
phase = "90 deg"

[[axis.cogging]]
amplitude = 12.0
period = "0.8333 mm"

[[axis]]
name = "Y"
coulomb = 200.0
command_limit = 10.0
travel = ["unlimited", "400 mm"]
measured = "tool"
velocity_measured = "motor"
velocity_limit = "30 m/min"
acceleration_limit = "3 m/s^2"
jerk_limit = "50 m/s^3"

[axis.ball_screw]
lead = "0.5 in"
motor_inertia_kg_m2 = 12e-4
table_mass_kg = 400
torque_constant_n_m_per_a = 1.2
stiffness_n_per_m = 5e7
damping_ratio = 0.02
"""


def test_a_machine_file_becomes_a_machine():
    mill = read_machine_text(MILL)
    assert mill.title == "A mill"
    assert mill.source.startswith("Data sheets")
    assert mill.assumed == ("Damping is guessed.",)
    assert mill.names == ("X", "Y")
    assert mill.command == "voltage"
    assert mill.substeps == 8
    assert mill.drive.computing_delay == 5e-4
    axes = mill.dynamics
    assert isinstance(axes, BallScrewAxes)
    assert_allclose(axes.lead, (0.01, 0.0127), rtol=1e-15)
    assert_allclose(axes.screw_inertia, (6e-4, 0.0))
    assert_allclose(axes.amplifier_gain, (2.0, 1.0))
    assert_allclose(axes.backlash, (4e-6, 0.0), rtol=1e-15)
    assert_allclose(axes.motor_friction.coulomb, (0.5, 0.0))
    assert_allclose(axes.table_friction.coulomb, (120.0, 200.0))
    assert_allclose(axes.table_friction.breakaway, (180.0, 200.0))
    assert_allclose(axes.cogging[0].amplitude, (12.0, 0.0))
    assert mill.sensor.side == ("motor", "tool")
    assert mill.sensor.velocity_side == "motor"
    assert_allclose(mill.travel, ((0.0, 0.5), (-np.inf, 0.4)))
    assert_allclose(mill.limits.velocity, 0.5)
    assert_allclose(mill.errors.screw.phase, (np.pi / 2, 0.0))
    assert_allclose(mill.errors.screw.scale, (2e-5, 0.0))
    assert mill.errors.squareness[0].axes == ("X", "Y")
    assert_allclose(mill.errors.squareness[0].angle, np.radians(0.002))


def every_field():
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=(1 / 3, 2.0), viscous=0.1, gain=np.pi,
            friction=Friction(coulomb=(2.0, 1.0), coulomb_backward=1.5, breakaway=(3.0, 2.5),
                              stribeck_velocity=0.01 / 3, smoothing_velocity=(1e-4, 2e-4)),
            cogging=(Cogging(amplitude=(1.0, 2.0), period=0.01, phase=(0.1, 0.2)),
                     Cogging(amplitude=0.3, period=0.005)),
        ),
        drive=Drive(command="force", command_limit=(10.0, np.inf), computing_delay=1e-3 / 3),
        sensor=Encoder(resolution=(1e-7, 0.0), noise=1e-9, velocity="ideal", side=("tool", "motor"),
                       velocity_side="motor"),
        tool=LinearTool(matrix=np.array(((1.0, 0.1),))),
        errors=GeometricErrors(
            screw=PositionError(scale=(1e-5, 2e-5)),
            scale=PositionError(amplitude=(1e-7, 0.0), period=2e-5, phase=0.3),
            squareness=(Squareness(axes=("Y", "X"), angle=1e-4 / 3),),
        ),
        travel=((-np.inf, 0.3), (-0.1, np.inf)),
        substeps=7,
        nominal_model=NominalModel(
            mass=np.array((1.0, 2.0)), viscous=np.ones(2), coulomb=np.zeros(2), gain=np.ones(2),
            command_limit=np.array((5.0, np.inf)), command="force",
        ),
        title='A "title" with \\ and \t, tab and é',
        source="Line one.\nLine two.",
        assumed=("Nothing is.", "All is."),
    )  # fmt: skip


PAIR = TwoMassAxes(
    motor_mass=1 / 3, load_mass=(2.0, 3.0), stiffness=1e7, damping=(1.0, 0.0), motor_viscous=0.2,
    load_viscous=0.1, gain=2.0, motor_friction=Friction(coulomb=(0.0, 1.0)),
    load_friction=Friction(coulomb=1.0, breakaway=2.0), backlash=(1e-6, 0.0),
)  # fmt: skip
IDENTIFIED = StateSpaceAxes(
    state_matrix=((0.9, 1 / 3), (0.0, 0.85)), input_matrix=((0.1, 0.0), (0.0, 0.15)),
    output_matrix=((1.0, 0.0), (0.03, 1.0)), direct_matrix=((0.0, 0.01), (0.0, 0.0)),
    sample_time=1e-3, output="velocity",
)  # fmt: skip


def two(dynamics):
    return Machine(names=("X", "Y"), dynamics=dynamics, drive=Drive(command="voltage"))


MACHINES = {
    "every field": every_field,
    "two masses": lambda: two(PAIR),
    "identified": lambda: two(IDENTIFIED),
    "continuous": lambda: two(
        StateSpaceAxes(
            state_matrix=np.kron(np.eye(2), ((0.0, 1.0), (0.0, -30.0))),
            input_matrix=np.kron(np.eye(2), ((0.0,), (1.0,))),
            output_matrix=np.kron(np.eye(2), ((1.0, 0.0),)),
        )
    ),
    "machining centre": machining_centre,
    "iron core": iron_core_stage,
    "linear motor": linear_motor_stage,
    "drives with their loops": ball_screw_stage,
    "meng": published.meng_xy_stage,
    "meng, simulated": published.meng_simulated_axes,
}


def spread(value, n_axes):
    return np.broadcast_to(np.asarray(value), np.broadcast_shapes(np.shape(value), (n_axes,)))


@jax.jit
def moved(bound):
    """Return the state after three steps, and where the tool is."""
    n = bound.n_axes

    def step(state, u):
        return bound.advance(state, u * jnp.ones(n), jnp.zeros(n)), None

    start = bound.init(jnp.full(n, 0.01), 1)
    state, _ = jax.lax.scan(step, start, jnp.array([0.5, -0.5, 0.5]))
    return state, bound.tool_position(state)


@pytest.mark.parametrize("name", MACHINES)
def test_what_is_written_is_read_as_the_same_machine(name):
    machine = MACHINES[name]()
    text = machine_to_toml(machine)
    again = read_machine_text(text)
    assert machine_to_toml(again) == text
    for field in ("names", "substeps", "assumed", "title", "source"):
        assert getattr(again, field) == getattr(machine, field), field
    old, new = (dict(jax.tree_util.tree_leaves_with_path(m)) for m in (machine, again))
    assert set(old) <= set(new)
    for path, value in old.items():
        where = jax.tree_util.keystr(path)
        if ".travel" in where:
            assert np.array_equal(np.broadcast_to(value, np.shape(new[path])), new[path])
        elif np.ndim(value) > 1 or np.ndim(new[path]) == 0 or "ators" in where:
            assert np.array_equal(value, new[path]), where
        else:
            assert np.array_equal(spread(value, machine.n_axes), new[path]), where
    one, other = (moved(m.bind(1e-3)) for m in (machine, again))
    for x, y in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert np.array_equal(x, y)
    assert np.array_equal(machine.nominal.mass, again.nominal.mass)


def test_every_text_is_toml():
    text = machine_to_toml(every_field())
    assert tomllib.loads(text)["title"] == every_field().title


def test_files_are_written_once_and_whole(tmp_path):
    path = tmp_path / "mill.toml"
    write_machine_file(machining_centre(), path)
    assert machine_to_toml(read_machine_file(path)) == machine_to_toml(machining_centre())
    with pytest.raises(OutputError, match="exists already"):
        write_machine_file(linear_motor_stage(), path)
    write_machine_file(linear_motor_stage(), path, overwrite=True)
    assert read_machine_file(path).names == ("X", "Y")
    assert [p.name for p in tmp_path.iterdir()] == ["mill.toml"]
    with pytest.raises(OutputError, match="cannot be written"):
        write_machine_file(linear_motor_stage(), tmp_path / "no" / "mill.toml")


def test_what_has_no_place_in_a_file_is_refused():
    class Odd(RigidAxes):
        pass

    stage = linear_motor_stage()
    with pytest.raises(ConfigurationError, match="tool of class Bent cannot be written"):
        machine_to_toml(replace(stage, tool=_other_tool()))
    with pytest.raises(ConfigurationError, match="dynamics of class Odd cannot be written"):
        machine_to_toml(two(Odd(mass=1.0)))
    batch = two(RigidAxes(mass=np.ones((5, 2))))
    with pytest.raises(ConfigurationError, match="a batch of machines cannot be written: mass"):
        machine_to_toml(batch)


def _other_tool():
    from contourlab.machines import ToolMap

    class Bent(ToolMap):
        n_coordinates = None

        def tool_from_axes(self, position):
            return position

    return Bent()


def mended(old, new):
    assert MILL.count(old) >= 1, old
    return MILL.replace(old, new, 1)


MISTAKES = {
    "misspelt key": ("coulomb = 120.0", "coulom = 120.0", r"axis\[0\].coulom", "mean coulomb?"),
    "misspelt inner key": ("damping_ratio = 0.03", "dampin_ratio = 0.03",
                           r"axis\[0\].ball_screw.dampin_ratio", "mean damping_ratio?"),
    "no unit": ('lead = "10 mm"', "lead = 0.01", r"axis\[0\].ball_screw.lead", "has no unit"),
    "wrong unit": ('"4 um"', '"4 ms"', r"axis\[0\].ball_screw.backlash", "not one of length"),
    "out of bounds": ("motor_inertia_kg_m2 = 12e-4", "motor_inertia_kg_m2 = -1",
                      r"axis\[0\].ball_screw.motor_inertia_kg_m2",
                      "motor_inertia must be >= 0"),
    "given for one only": ("torque_constant_n_m_per_a = 1.2\namp", "amp", r"axis\[0\]",
                           "must be for all"),
    "unknown top key": ('title = "A mill"', 'titel = "A mill"', "", "unknown key 'titel'"),
    "two kinds": ("coulomb = 120.0", "mass = 3.0", r"axis\[0\]", "give either mass, or numerator"),
    "flat key with a screw": ("coulomb = 120.0", "viscous = 1.0\ncoulomb = 120.0", r"axis\[0\]",
                              "viscous does not go with ball_screw"),
    "unknown axis": ('axes = ["X", "Y"]', 'axes = ["X", "Z"]', "axis", "no axis 'Z'"),
    "three axes": ('axes = ["X", "Y"]', 'axes = ["X", "Y", "Z"]', r"squareness\[0\]",
                   "two different axes"),
    "unknown side": ('measured = "motor"', 'measured = "table"', r"axis\[0\].measured",
                     "'tool' or 'motor'"),
    "half the limits": ('jerk_limit = "50 m/s^3"\n', "", r"axis\[0\]", "jerk_limit is missing"),
    "a file in a file": ('title = "A mill"', 'file = "b.toml"', "file", "does not name another"),
    "backlash": ('"4 um"', '"-4 um"', r"axis\[0\].ball_screw.backlash", "must be >= 0"),
    "lead": ('lead = "0.5 in"', 'lead = "0 in"', r"axis\[1\].ball_screw.lead", "must be > 0"),
    "command limit": ("coulomb = 200.0\ncommand_limit = 10.0", "command_limit = -1.0",
                      r"axis\[1\].command_limit", "must be > 0"),
    "travel": ('["0 mm", "500 mm"]', '["500 mm", "0 mm"]', r"axis\[0\].travel", "lower < upper"),
    "one end": ('["unlimited", "400 mm"]', '["400 mm"]', r"axis\[1\].travel", "a lower and an"),
    "cogging": ('"0.8333 mm"', '"0 mm"', r"axis\[0\].cogging\[0\].period", "must be > 0"),
    "inner friction": ("coulomb = 0.5", "coulomb = -0.5",
                       r"axis\[0\].ball_screw.motor_friction.coulomb", "must be >= 0"),
    "own friction": ("coulomb = 200.0", "coulomb = -1", r"axis\[1\].coulomb", "must be >= 0"),
    "screw error": ("scale = 2e-5", "scale = 0.5", r"axis\[0\].screw_error.scale", "not a gear"),
    "resolution": ('"0.1 um"', '"-1 um"', r"axis\[0\].resolution", "must be >= 0"),
    "limits": ('"3 m/s^2"', '"0 m/s^2"', r"axis\[1\].acceleration_limit", "must be > 0"),
    "scale on the motor": ("[axis.screw_error]", "[axis.scale_error]", r"axis\[0\].scale_error",
                           "a linear scale, which an axis with measured = \"motor\" does not"),
    "no TOML": ("[[axis]]", "[[axis", "", "not valid TOML"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_have_file_line_and_key(name):
    old, new, key, message = MISTAKES[name]
    with pytest.raises(ScenarioError, match=rf"^mill\.toml(:\d+)?: {key}.*{message}"):
        read_machine_text(mended(old, new), name="mill.toml")


def test_the_line_is_the_right_one():
    text = mended("coulomb = 120.0", "coulom = 120.0")
    line = next(k for k, row in enumerate(text.splitlines(), 1) if row.startswith("coulom "))
    with pytest.raises(ScenarioError) as caught:
        read_machine_text(text, name="mill.toml")
    assert caught.value.line == line
    assert caught.value.key == "axis[0].coulom"


@pytest.mark.parametrize("key", ["measured", "velocity_measured"])
def test_a_motor_side_that_changes_nothing_is_refused(key):
    text = f'command = "force"\n[[axis]]\nname = "X"\nmass = 1.0\n{key} = "motor"\n'
    with pytest.raises(ScenarioError, match=rf"^m:5: axis\[0\]\.{key}: .* changes nothing") as told:
        read_machine_text(text, name="m")
    assert told.value.line == 5
    assert read_machine_text(text + "screw_error = {scale = 1e-5}\n").errors is not None
    other = {"measured": "velocity_measured", "velocity_measured": "measured"}[key]
    scale = f'{other} = "tool"\nscale_error = {{scale = 1e-5}}\n'
    assert read_machine_text(text + scale).errors is not None


@pytest.mark.parametrize(
    ("angle", "radians"),
    [
        ("20 arcsec", np.radians(20 / 3600)), ("0.5 arcmin", np.radians(0.5 / 60)),
        ("0.03 mrad", 3e-5), ("12 urad", 1.2e-5), ("12 \u00b5rad", 1.2e-5),
        ("12 \u03bcrad", 1.2e-5),
    ],
    ids=["arcsec", "arcmin", "mrad", "urad", "micro sign", "mu"],
)  # fmt: skip
def test_squareness_is_written_as_on_data_sheets(angle, radians):
    mill = read_machine_text(mended("0.002 deg", angle))
    assert_allclose(mill.errors.squareness[0].angle, radians, rtol=1e-14)
    with pytest.raises(ScenarioError, match="rad, mrad, urad, deg, arcmin, arcsec"):
        read_machine_text(mended("0.002 deg", "1 grad"))


def section(**values):
    return MachineSection.model_validate(values)


def test_a_scenario_names_a_machine_file(tmp_path):
    (tmp_path / "mill.toml").write_text(MILL)
    machine = build_machine(section(file="mill.toml"), None, tmp_path)
    assert machine.title == "A mill"
    machine = build_machine(
        section(file="mill.toml", set={"table_mass": [300.0, 410.0]}, computing_delay="1 ms",
                velocity="ideal", substeps=5), 3, tmp_path,
    )  # fmt: skip
    assert_allclose(machine.dynamics.table_mass, (300.0, 410.0))
    assert machine.drive.computing_delay == 1e-3
    assert machine.sensor.velocity == "ideal"
    assert machine.substeps == 3


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, r"nothing\.toml: cannot be read \(No such file"),
        (b"\xff", r"mill\.toml:1: not a text in UTF-8"),
        (
            MILL.replace("coulomb = 120.0", "coulom = 1.0").encode(),
            r"mill\.toml:\d+: axis\[0\]\.coulom",
        ),
        (b"#" * ((1 << 20) + 1), "larger than"),
    ],
    ids=["missing", "binary", "wrong", "large"],
)
def test_a_bad_machine_file_is_named_beside_the_key_that_names_it(tmp_path, content, words):
    from contourlab.scenarios.values import KeyedError

    if content is not None:
        (tmp_path / "mill.toml").write_bytes(content)
    name = "nothing.toml" if content is None else "mill.toml"
    with pytest.raises(KeyedError, match=words) as caught:
        build_machine(section(file=name), None, tmp_path)
    assert caught.value.key == ("machine", "file")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"file": "a.toml", "name": "b"}, "give either name"),
        ({"file": "a.toml", "command": "force"}, "command is fixed by the machine file"),
        ({"file": "a.toml", "masse": 1}, "unknown key 'masse'; with file"),
        ({"name": "a", "title": "b"}, "title is fixed by the named machine"),
        ({"axis": [{"name": "X", "mass": 1.0}]}, "axes need command"),
        ({"axis": [{"name": "X"}], "command": "force"}, "axis X: give mass"),
        (
            {"axis": [{"name": "X", "two_mass": {"mass": 1.0, "gain": 1.0}}], "command": "force"},
            "give either motor_mass, load_mass, stiffness",
        ),
        (
            {"axis": [{"name": "X", "mass": 1.0, "screw_error": {"amplitude": "1 um"}}],
             "command": "force"},
            "amplitude needs period",
        ),
        (
            {"axis": [{"name": "X", "state_space": {"state_matrix": [[1.0], [1.0, 2.0]],
             "input_matrix": [[1.0]], "output_matrix": [[1.0]]}}], "command": "force"},
            "rows of one length",
        ),
    ],
    ids=range(9),
)  # fmt: skip
def test_sections_that_contradict_themselves_are_refused(values, words):
    with pytest.raises(ValueError, match=words):
        section(**values)


def test_axes_of_state_spaces_and_of_frequencies():
    model = {"state_matrix": [[0.0, 1.0], [0.0, -50.0]], "input_matrix": [[0.0], [50.0]],
             "output_matrix": [[1.0, 0.0]]}  # fmt: skip
    machine = build_machine(
        section(command="velocity", axis=[{"name": n, "state_space": model} for n in "XY"]), None
    )
    assert machine.dynamics.n_axes == 2
    assert_allclose(machine.nominal.mass / machine.nominal.gain, 0.02, rtol=1e-9)
    machine = build_machine(
        section(command="force", axis=[{"name": "X", "two_mass": {
            "mass": 10.0, "mass_ratio": 1.0, "anti_resonance_hz": 60.0, "damping_ratio": 0.02}}]),
        None,
    )  # fmt: skip
    assert_allclose(machine.dynamics.anti_resonance_hz, 60.0, rtol=1e-13)
    discrete = {"state_matrix": [[1.0, 0.01], [0.0, 0.9]], "input_matrix": [[0.0], [0.1]],
                "output_matrix": [[1.0, 0.0]], "sample_time": "1 ms", "resample": True}  # fmt: skip
    machine = build_machine(
        section(command="velocity", state_space=discrete, axis=[{"name": "X"}]), None
    )
    assert machine.dynamics.sample_time is None


def test_the_worked_example_of_the_documentation():
    page = (Path(__file__).parents[2] / "docs" / "data_sheet.md").read_text()
    text = re.search(r"```toml\n(.*?)```", page, re.DOTALL)[1]
    mill = read_machine_text(text)
    told, r = mill.nominal, 0.01 / (2 * np.pi)
    screw = np.pi * 7850.0 * 0.85 * 0.032**4 / 32
    assert_allclose(mill.dynamics.screw_inertia, screw + 1.2e-4, rtol=1e-3)
    assert_allclose(told.mass, 1167.0, rtol=1e-3)
    assert_allclose(told.gain * 10.0, 21.6 / r, rtol=1e-12)  # ±10 V is the peak torque
    assert_allclose(told.coulomb, 0.45 / r + 60.0, rtol=1e-12)
    assert np.all(np.asarray(mill.limits.acceleration) < 0.5 * 11.3)
    assert_allclose(mill.sensor.resolution, 0.01 / 2**20, rtol=5e-3)
    anti = mill.dynamics.translated.anti_resonance_hz
    assert np.all(np.asarray(mill.limits.jerk) < 5.0 * anti)
    assert_allclose(anti, 94.0 / np.sqrt(2.0), rtol=1e-2)


def test_the_page_names_keys_that_exist():
    page = (Path(__file__).parents[2] / "docs" / "data_sheet.md").read_text()
    cells = [row.split("|")[2] for row in page.splitlines() if row.count("|") >= 4]
    named = {key for cell in cells for key in re.findall(r"`([a-z_0-9.]+)`", cell)}
    known = {"motor_friction.coulomb"} | {
        f"{table}.{key}"
        for table in ("screw_error", "scale_error")
        for key in schema.PositionErrorSection.model_fields
    }
    for section_class in (
        schema.AxisSection, schema.BallScrewSection, schema.MachineSection, schema.CoggingSection
    ):  # fmt: skip
        known |= set(section_class.model_fields)
    assert len(named) > 15
    assert named <= known, named - known


def test_a_side_without_effect_is_not_written():
    """The reader refuses it, and the machine behaves the same without."""
    machine = Machine(
        names=("X",), dynamics=RigidAxes(mass=[2.0], viscous=[1.0]),
        drive=Drive(command="force"), sensor=Encoder(resolution=1e-6, side="motor"),
    )  # fmt: skip
    text = machine_to_toml(machine)
    assert "measured" not in text
    assert read_machine_text(text).dynamics.mass == 2.0


def test_a_stiff_nominal_model_goes_to_a_file_and_back(tmp_path):
    text = (
        'command = "force"\n[[axis]]\nname = "X"\n'
        "numerator = [1.0]\ndenominator = [1.0, 2.0, 9.0]\n"
        "[axis.nominal]\nmass = 1.0\nviscous = 2.0\nstiffness = 9.0\n"
    )
    machine = read_machine_text(text)
    assert_allclose(machine.nominal.stiffness, [9.0])
    write_machine_file(machine, tmp_path / "m.toml")
    assert_allclose(read_machine_file(tmp_path / "m.toml").nominal.stiffness, [9.0])
    plain = read_machine_text(text.replace("stiffness = 9.0\n", ""))
    assert plain.nominal.stiffness is None
