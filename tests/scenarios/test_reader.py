"""Scenario files become objects, and every mistake is one sentence with its place."""

import tomllib

import jaxtyping
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from contourlab.contours import Ellipse, Path
from contourlab.controllers import AxisPid, Cascade, CrossCoupled
from contourlab.errors import ContourlabError, ScenarioError
from contourlab.scenarios import read_scenario, read_scenario_text

GOOD = """
[part]
formula = "ellipse"
semi_axes = ["30 mm", "10 mm"]

[feed]
kind = "constant_rate"
rate = 5.0
duration = "0.05 s"

[machine]
command = "force"
computing_delay = "0.5 ms"
velocity = "ideal"

[[machine.axis]]
name = "X"
mass = 5.0
viscous = 20.0
coulomb = 8.0
breakaway = 10.0
command_limit = 200.0
travel = ["-100 mm", "100 mm"]
resolution = "0.1 um"
velocity_limit = "1 m/s"
acceleration_limit = "10 m/s^2"
jerk_limit = "500 m/s^3"

[[machine.axis]]
name = "Y"
mass = 3.0
viscous = 15.0
velocity_limit = "1 m/s"
acceleration_limit = "10 m/s^2"
jerk_limit = "500 m/s^3"

[[controller]]
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 20

[[controller]]
name = "cascade"
type = "cascade"
position_gain = [50, 60]
velocity_proportional = 900
velocity_integral = 50000

[[controller]]
name = "ccc"
type = "cross-coupled"
estimator = "osculating_circle"
kp = 1e5
axis = { type = "axis_pid", kp = 1e5, kd = 500 }

[simulation]
sample_time = "0.5 ms"
substeps = 4
seed = 7

[[simulation.disturbance]]
type = "sine"
axis = "Y"
amplitude = 2.0
frequency_hz = 50.0
start = "10 ms"

[report]
title = "An ellipse"
magnification = 100.0
"""


def read(text):
    return read_scenario_text(text, name="s.toml")


def test_a_good_file_becomes_objects():
    scenario = read(GOOD)
    machine = scenario.machine
    assert machine.names == ("X", "Y")
    assert machine.command == "force"
    assert machine.substeps == 4
    assert machine.drive.computing_delay == 5e-4
    assert machine.sensor.velocity == "ideal"
    np.testing.assert_allclose(machine.dynamics.mass, [5.0, 3.0])
    np.testing.assert_allclose(machine.dynamics.friction.breakaway, [10.0, 0.0])
    np.testing.assert_allclose(machine.travel, [[-0.1, 0.1], [-np.inf, np.inf]])
    np.testing.assert_allclose(machine.sensor.resolution, [1e-7, 0.0])
    assert list(scenario.controllers) == ["axis_pid", "cascade", "ccc"]
    pid, cascade, ccc = scenario.controllers.values()
    assert isinstance(pid, AxisPid)
    assert isinstance(cascade, Cascade)
    assert isinstance(ccc, CrossCoupled)
    np.testing.assert_allclose(cascade.position_gain, [50.0, 60.0])
    np.testing.assert_allclose(pid.model.mass, [5.0, 3.0])
    assert isinstance(scenario.reference.contour, Ellipse)
    np.testing.assert_allclose(scenario.reference.contour.semi_axes, [0.03, 0.01])
    assert scenario.reference.n_samples == 101
    assert scenario.seed == 7
    assert scenario.disturbances[0].axis == 1
    assert scenario.magnification == 100.0
    assert scenario.text == GOOD


def changed(old, new):
    assert GOOD.count(old) >= 1, old
    return GOOD.replace(old, new, 1)


def line_with(text, piece):
    return next(k for k, line in enumerate(text.splitlines(), 1) if piece in line)


MISTAKES = {
    "misspelt key": ("coulomb = 8.0", "coulom = 8.0", "coulom", "did you mean coulomb?"),
    "misspelt section": ("[feed]", "[fead]", "fead", "did you mean feed?"),
    "no unit": ('"1 m/s"', "1", "velocity_limit", "has no unit"),
    "unit of another kind": ('"1 m/s"', '"1 kg"', "velocity_limit", "not one of velocity"),
    "unknown unit in a formula": ('"30 mm"', '"30 furlong"', "semi_axes", "not one of length"),
    "bare length in a formula": ('["30 mm", "10 mm"]', "[0.03, 0.01]", "semi_axes", "has no unit"),
    "unknown controller": ('"axis_pid"\ntuning', '"axis_pd"\ntuning', "type", "mean axis_pid?"),
    "unknown estimator": ('"osculating_circle"', '"circle"', "estimator", "osculating_circle"),
    "unknown formula": ('"ellipse"', '"elipse"', "formula", "did you mean ellipse?"),
    "unknown gain": ("bandwidth_hz = 20", "bandwith_hz = 20", "bandwith_hz", "mean bandwidth_hz?"),
    "unknown tuning": ('"pole_placement"', '"ziegler"', "tuning", "Allowed: pole_placement"),
    "gain out of bounds": ("kd = 500", "kd = -500", "kd", "must be >= 0"),
    "gain as text": ("kp = 1e5\n", 'kp = "big"\n', "kp", "must be a number, got 'big'"),
    "wrong number of gains": (
        "[50, 60]", "[50, 60, 70]", "controller[1]", "position_gain must be one number or one for",
    ),
    "same name twice": ('name = "ccc"', 'name = "cascade"', "name", "stands already"),
    "negative time": ('"0.5 ms"\nsub', '"-0.5 ms"\nsub', "sample_time", "greater than 0"),
    "no time": ('"0.5 ms"\nsub', '"0 ms"\nsub', "sample_time", "greater than 0"),
    "negative delay": ('"0.5 ms"\nvel', '"-0.5 ms"\nvel', "computing_delay", "or equal to 0"),
    "a rate of zero": ("rate = 5.0", "rate = 0.0", "feed", "rate must be finite and not 0"),
    "too short": ('"0.05 s"', '"0.05 ms"', "feed", "duration must be >= sample_time"),
    "off the table": ('"100 mm"]', '"20 mm"]', "part", "travel"),
    "units of a formula": (
        '"ellipse"', '"ellipse"\ndefault_units = "mm"', "default_units", "goes with file",
    ),
    "stribeck without breakaway": (
        "breakaway = 10.0", 'stribeck_velocity = "1 mm/s"', "axis[0]", "goes with breakaway",
    ),
    "smoothing without friction": (
        "mass = 3.0", 'mass = 3.0\nsmoothing_velocity = "1 mm/s"', "axis[1]", "goes with coulomb",
    ),
    "friction of a transfer function": (
        "mass = 3.0\nviscous = 15.0",
        'numerator = [1.0]\ndenominator = [1.0, 0.0]\nstribeck_velocity = "1 mm/s"',
        "axis[1]", "does not go with a transfer",
    ),
    "substeps without friction": (
        "coulomb = 8.0\nbreakaway = 10.0\n", "", "substeps", "does not have; remove it",
    ),
    "seed of another kind": ("seed = 7", 'seed = "7"', "seed", "valid integer"),
    "unknown axis": ('axis = "Y"', 'axis = "Z"', "axis", "Allowed: X, Y"),
    "one axis only mass": ("mass = 3.0\n", "", "axis[1]", "either mass, or numerator"),
    "no such feed": ('"constant_rate"', '"fast"', "kind", "'programmed', 'constant_rate'"),
    "feed key of another kind": ("rate = 5.0", 'feed = "1 m/s"', "feed", "does not go with kind"),
    "travel reversed": ('["-100 mm", "100 mm"]', '["100 mm", "-100 mm"]', "axis", "lower < upper"),
    "file and formula": (
        'formula = "ellipse"', 'formula = "ellipse"\nfile = "a.ngc"', "part", "either file",
    ),
    "magnification zero": ("tion = 100.0", "tion = 0.0", "magnification", "greater than 0"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_name_file_line_key_and_choices(mistake):
    old, new, key, message = MISTAKES[mistake]
    text = changed(old, new)
    with pytest.raises(ScenarioError) as caught:
        read(text)
    shown = str(caught.value)
    assert "\n" not in shown
    assert message in shown, shown
    assert shown.startswith("s.toml:"), shown
    assert key in shown, shown
    assert caught.value.line > 0


def test_the_line_is_that_of_the_key():
    text = changed("kd = 500", "kd = -500")
    with pytest.raises(ScenarioError) as caught:
        read(text)
    assert caught.value.line == line_with(text, "kd = -500")
    text = changed("bandwidth_hz = 20", "bandwith_hz = 20")
    with pytest.raises(ScenarioError) as caught:
        read(text)
    assert caught.value.line == line_with(text, "bandwith_hz")


def test_missing_sections_and_keys():
    with pytest.raises(ScenarioError, match=r"s\.toml: part: is missing"):
        read("")
    with pytest.raises(ScenarioError, match="AxisPid needs kp"):
        read(changed('tuning = "pole_placement"\nbandwidth_hz = 20', "ki = 3.0"))
    with pytest.raises(ScenarioError, match="needs bandwidth_hz"):
        read(changed("bandwidth_hz = 20", "damping = 0.5"))


def test_what_is_no_toml(tmp_path):
    with pytest.raises(ScenarioError, match=r"s\.toml: not valid TOML.*line 2"):
        read("[part]\na = = 1")
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_scenario(tmp_path / "none.toml")
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_scenario(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"[part]\nfile = \xff")
    with pytest.raises(ScenarioError, match=r"binary\.toml:2: not a text in UTF-8"):
        read_scenario(tmp_path / "binary.toml")


def test_a_part_beside_the_scenario(tmp_path):
    (tmp_path / "p.ngc").write_text("G21 G90\nG0 X1 Y1\nG1 X5 Y1 F600\nM2\n")
    start, end = GOOD.index("[part]"), GOOD.index("[machine]")
    text = GOOD[:start] + '[part]\nfile = "p.ngc"\n' + GOOD[end:]
    (tmp_path / "s.toml").write_text(text)
    scenario = read_scenario(tmp_path / "s.toml")
    assert isinstance(scenario.reference.contour, Path)
    assert scenario.part.axes == ("X", "Y")
    assert len(scenario.stops) >= 1
    (tmp_path / "other.ngc").write_text("G21 G90\nG1 X1 Y2 F600\nM2\n")
    other = read_scenario(tmp_path / "s.toml", part=tmp_path / "other.ngc")
    assert other.part.path.n_pieces == 1
    with pytest.raises(ContourlabError, match=r"none\.ngc"):
        read_scenario(tmp_path / "s.toml", part=tmp_path / "none.ngc")


def test_named_machines_take_arguments_and_changes():
    start, end = GOOD.index("[machine]"), GOOD.index("[[controller]]")

    def with_machine(section):
        return GOOD[:start] + section + GOOD[end:]

    machine = read(
        with_machine(
            '[machine]\nname = "linear_motor_stage"\nencoder = "1 um"\n'
            '[machine.set]\nmass = [6.0, 4.0]\n"drive.command_limit" = 80.0\n'
        )
    ).machine
    np.testing.assert_allclose(machine.dynamics.mass, [6.0, 4.0])
    np.testing.assert_allclose(machine.drive.command_limit, 80.0)
    np.testing.assert_allclose(machine.sensor.resolution, 1e-6)
    for name, value, message in (
        ("encoder", "1e-6", "has no unit"),
        ("encoder", '"1 ms"', "not one of length"),
        ("encoder", '["1 um", "1 um"]', "must be a single value"),
        ("encoder", '"-1 um"', "resolution must be >= 0"),
        ("computing_delay", '"-1 ms"', "greater than or equal to 0"),
    ):
        with pytest.raises(ScenarioError, match=rf"s\.toml:\d+: machine\.{name}: .*{message}"):
            read(with_machine(f'[machine]\nname = "linear_motor_stage"\n{name} = {value}\n'))
    for value in ("4", "2.0", "true", '"two"'):
        with pytest.raises(ScenarioError, match=r"s\.toml:\d+: machine\.n_axes: "):
            read(with_machine(f'[machine]\nname = "ball_screw_stage"\nn_axes = {value}\n'))
    with pytest.raises(ScenarioError, match="did you mean linear_motor_stage"):
        read(with_machine('[machine]\nname = "linear_motor_stag"\n'))
    with pytest.raises(ScenarioError, match=r"s\.toml:\d+: machine\.encodr.*did you mean encoder"):
        read(with_machine('[machine]\nname = "linear_motor_stage"\nencodr = "1 um"\n'))
    with pytest.raises(ScenarioError, match=r"machine\.set\.masss.*no field"):
        read(with_machine('[machine]\nname = "linear_motor_stage"\n[machine.set]\nmasss = 1.0\n'))
    with pytest.raises(ScenarioError, match="mass must be > 0"):
        read(with_machine('[machine]\nname = "linear_motor_stage"\n[machine.set]\nmass = -1.0\n'))


@pytest.fixture(scope="module")
def as_for_a_user():
    """Shape annotations are not live for users: what they catch in tests must be caught anyway."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)


FUZZ = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)


@pytest.mark.usefixtures("as_for_a_user")
@FUZZ
@given(st.text(max_size=300))
def test_any_text_gives_an_error_of_ours(text):
    with pytest.raises(ContourlabError):
        read(text)


NAMED = """
[part]
file = "p.ngc"
start = ["0 mm", "0 mm", "0 mm"]
axes = ["X", "Y"]

[feed]
feed = "600 mm/min"
corner_angle = "1 deg"

[machine]
name = "linear_motor_stage"
encoder = "0.1 um"
computing_delay = "0.1 ms"

[machine.set]
mass = [5.2, 3.1]
names = ["X", "Y"]
travel = [["-100 mm", "100 mm"], ["-100 mm", "100 mm"]]

[simulation]
sample_time = "1 ms"
substeps = 2

[[controller]]
type = "cascade"
tuning = "bandwidth"
velocity_bandwidth_hz = 60
position_gain = 90
"""
PROGRAM = "G21 G90\nM3 S100\nG0 X1 Y1\nG1 X2 Y1 F600\nY2\nM2\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario")
    (path / "p.ngc").write_text(PROGRAM)
    return path


def test_mistakes_beside_a_program_name_their_place(folder):
    read_scenario_text(NAMED, name="s.toml", folder=folder)
    for old, new, place in (
        ('axes = ["X", "Y"]', 'axes = ["x", "y"]', r"s\.toml:5: part\.axes: axes must be"),
        ('names = ["X", "Y"]', 'names = ["A", "B"]\n', None),
        ('"600 mm/min"', '"-600 mm/min"', r"s\.toml:\d+: feed: "),
        ('["-100 mm", "100 mm"]]', '["-100 mm", "1 mm"]]', r"s\.toml:2: part: .*axis Y"),
        ('axes = ["X", "Y"]\n', 'axes = ["X", "Z"]\n', r"p\.ngc:\d+: "),
    ):
        assert old in NAMED
        text = NAMED.replace(old, new)
        if place is None:
            text = text.replace('axes = ["X", "Y"]\n', "")
            place = r"s\.toml:2: part\.axes: axes must be"
        with pytest.raises(ContourlabError, match=place):
            read_scenario_text(text, name="s.toml", folder=folder)


def test_a_machine_that_has_no_nominal_model_is_named():
    text = changed("mass = 3.0\nviscous = 15.0", "numerator = [1.0]\ndenominator = [1.0, 1.0]")
    text = text.replace(
        "mass = 5.0\nviscous = 20.0\ncoulomb = 8.0\nbreakaway = 10.0",
        "numerator = [1.0]\ndenominator = [1.0, 1.0, 0.0]",
    )
    text = text.replace("substeps = 4\n", "")
    with pytest.raises(ScenarioError, match=r"s\.toml:\d+: machine: axis 1 is not close to"):
        read(text)


def test_what_is_not_used_of_a_program_is_said(folder):
    plain = read_scenario_text(NAMED, name="s.toml", folder=folder).reference.warnings
    assert "words that do not move the tool were ignored: M3 (line 2), S (line 2)" in plain
    text = NAMED.replace('corner_angle = "1 deg"', 'kind = "constant_feed"')
    said = " ".join(read_scenario_text(text, name="s.toml", folder=folder).reference.warnings)
    assert "does not use the program's feeds, rapids, dwells and stops" in said
    assert "turns at 2 corners" in said
    assert "M3 (line 2)" in said


WORDS = st.sampled_from(GOOD.split())
VALUES = st.one_of(
    st.integers(), st.floats(), st.booleans(), st.text(max_size=8), WORDS,
    st.lists(st.one_of(st.integers(), st.text(max_size=3)), max_size=3),
    st.dictionaries(st.text(max_size=5), st.integers(), max_size=2),
    st.sampled_from(["30 mm", "1e400 mm", "nan mm", "-1 s", "inf m/s", "0 s", "1e-300 s"]),
)  # fmt: skip


def _paths(value, path=()):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in items:
        yield (*path, key)
        if isinstance(inner, dict | list):
            yield from _paths(inner, (*path, key))


SEVERAL = NAMED.replace("[machine]\n", '[[machine]]\nlabel = "a"\n').replace(
    "[simulation]\n",
    """
[[machine]]
name = "linear_motor_stage"
[vary]
samples = 2
"machine.mass" = { relative = 0.2, distribution = "uniform", common = true }
"controller.position_gain" = { std = 0.1 }
seed = 3
[simulation]
""",
)
BASES = {"axes": GOOD, "named": NAMED, "several": SEVERAL}
PATHS = [
    (base, path)
    for base, text in BASES.items()
    for path in sorted(_paths(tomllib.loads(text)), key=str)
]


@pytest.mark.usefixtures("as_for_a_user")
@FUZZ
@given(st.sampled_from(PATHS), VALUES)
def test_any_value_anywhere_gives_a_scenario_or_an_error_of_ours(folder, place, value):
    import json

    from contourlab.scenarios import reader

    base, path = place
    text = BASES[base]
    raw = tomllib.loads(text)
    if base == "axes":
        raw["feed"]["duration"] = "0.002 s"
    inner = raw
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    if path[0] == "simulation" and "sample_time" in path and value in ("1e-300 s",):
        value = "x"
    json.dumps(raw)
    try:
        reader._from_raw(raw, text, "s.toml", folder)
    except ContourlabError as error:
        message = str(error)
    else:
        message = ""
    assert "\n" not in message


def test_laws_in_the_task_frame_go_by_their_names():
    text = """
[part]
formula = "figure_eight"
half_sizes = ["30 mm", "30 mm"]
[feed]
kind = "constant_feed"
feed = "3 m/min"
[machine]
name = "meng_xy_stage"
[[controller]]
type = "first_order_task_frame"
bandwidth_hz = [15.0, 100.0]
[[controller]]
type = "natural_local_task_frame"
bandwidth_hz = [15.0, 100.0]
estimate = "natural"
curvature_rates = false
"""
    first, natural = (setup for setup in read_scenario_text(text).controllers.values())
    assert type(first).__name__ == "FirstOrderTaskFrame"
    assert (natural.estimate, natural.curvature_rates) == ("natural", False)
    np.testing.assert_array_equal(natural.bandwidth_hz, [15.0, 100.0])
    with pytest.raises(ScenarioError, match=r"bandwidth_hz must be \(tangential, normal\)"):
        read_scenario_text(text.replace("[15.0, 100.0]", "[15.0]"))
