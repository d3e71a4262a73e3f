"""Several machines, values that vary and shares of a part in a scenario."""

import numpy as np
import pytest

from contourlab.errors import ContourlabError, ScenarioError
from contourlab.scenarios import read_scenario_text
from contourlab.simulation import Listed, Normal, Uniform

SEVERAL = """
[part]
file = "p.ngc"

[[machine]]
label = "mill"
name = "linear_motor_stage"
[machine.set]
mass = [6.0, 4.0]

[[machine]]
command = "force"
label = "old mill"
[[machine.axis]]
name = "X"
mass = 9.0
velocity_limit = "1 m/s"
acceleration_limit = "1 m/s^2"
jerk_limit = "500 m/s^3"
[[machine.axis]]
name = "Y"
mass = 7.0
coulomb = 4.0
velocity_limit = "1 m/s"
acceleration_limit = "1 m/s^2"
jerk_limit = "500 m/s^3"

[[controller]]
name = "pid"
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 20

[[controller]]
name = "p"
type = "axis_pid"
machines = ["old mill"]
kp = 1e5
kd = 500

[simulation]
sample_time = "1 ms"
seed = 3
"""
PROGRAM = "G21 G90 G17\nG0 X10 Y10 Z0\nG1 X20 F3000\nG1 Y20\nG1 X10\nG0 X0 Y0\nM2\n"
DEEP = "G21 G90 G17\nG0 Z5\nG0 X10 Y10\nG1 Z-1 F600\nG1 X20 F3000\nG1 Y20\nG0 Z5\nG0 X0 Y0\nM2\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("several")
    (path / "p.ngc").write_text(PROGRAM)
    (path / "deep.ngc").write_text(DEEP)
    return path


@pytest.fixture(scope="module")
def read(folder):
    return lambda text: read_scenario_text(text, name="s.toml", folder=folder)


def changed(old, new, text=SEVERAL):
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1)


def test_each_machine_has_controllers_of_its_own_model(read):
    scenario = read(SEVERAL)
    assert list(scenario.setups) == ["mill", "old mill"]
    mill, old = scenario.setups.values()
    np.testing.assert_allclose(mill.machine.dynamics.mass, [6.0, 4.0])
    np.testing.assert_allclose(mill.controllers["pid"].model.mass, [6.0, 4.0])
    np.testing.assert_allclose(old.controllers["pid"].model.mass, [9.0, 7.0])
    assert list(mill.controllers) == ["pid"]
    assert scenario.runs == ("pid on mill", "pid on old mill", "p on old mill")
    assert scenario.machine is mill.machine
    assert scenario.controllers is mill.controllers


def test_by_default_all_follow_the_motion_that_all_can(read):
    scenario = read(SEVERAL)
    mill, old = scenario.setups.values()
    assert mill.reference is old.reference
    assert np.abs(np.asarray(mill.reference.acceleration)).max() <= 1.0 + 1e-9
    assert "tightest limit" in dict(scenario.notes)["axis limits"]
    own = read(changed("[[machine]]", '[feed]\nlimits = "own"\n[[machine]]'))
    mill, old = own.setups.values()
    assert mill.reference.duration < 0.8 * old.reference.duration
    assert np.abs(np.asarray(old.reference.acceleration)).max() <= 1.0 + 1e-9
    assert "times and errors" in dict(own.notes)["axis limits"]
    result = own.compare()
    assert set(result.references) == {"mill", "old mill"}
    with pytest.raises(ScenarioError, match=r"limits does not go with kind"):
        read(changed("[[machine]]", '[feed]\nkind = "constant_feed"\nfeed = "1 mm/s"\n'
                     'limits = "own"\n[[machine]]'))  # fmt: skip


def test_one_table_is_one_machine(read):
    start, end = SEVERAL.index("[[machine]]\ncommand"), SEVERAL.index("[[controller]]")
    text = SEVERAL[:start] + SEVERAL[end:]
    text = text.replace("[[machine]]", "[machine]").replace('machines = ["old mill"]\n', "")
    scenario = read(text)
    assert list(scenario.setups) == ["mill"]
    assert scenario.runs == ("pid", "p")
    assert scenario.notes == ()
    assert list(read(text.replace('label = "mill"\n', "")).setups) == ["linear_motor_stage"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('label = "old mill"', 'label = "mill"', r"s\.toml:13: machine\[1\]\.label: 'mill' stands"),
        ('label = "mill"', 'label = ""', r"machine\[0\]\.label: must be a name"),
        ('label = "mill"', "label = 3", r"machine\[0\]\.label: must be a name, got 3"),
        ("mass = [6.0", "masss = [6.0", r"s\.toml:9: machine\[0\]\.set\.masss: "),
        ("mass = 7.0", "mass = 7.0\nfoo = 1", r"s\.toml:\d+: machine\[1\]\.axis\[1\]\.foo: unkn"),
        ('name = "Y"', 'name = "Z"', r"s\.toml:11: machine\[1\]: machine old mill has axes X, Z"),
        ('["old mill"]', '["old mil"]', r"controller\[1\]\.machines: no machine 'old mil'; "),
        ('["old mill"]', "[]", r"controller\[1\]\.machines: must be a list of machines"),
        ('["old mill"]', '"old mill"', r"controller\[1\]\.machines: must be a list of machines"),
        ('["old mill"]', '["mill", "mill"]', r"names a machine twice"),
        ("bandwidth_hz = 20", 'bandwidth_hz = 20\nmachines = ["mill"]\n[[controller]]\nname = "q"\n'
         'type = "axis_pid"\nkp = 1\nmachines = ["mill"]', None),
        ("bandwidth_hz = 20", "bandwidth_hz = -1", r"bandwidth_hz must be .* \(on machine mill\)"),
        ('name = "linear_motor_stage"', 'name = "linear_motor_stage"\nfoo = 1', r"\[0\]\.foo"),
    ],
    ids=lambda value: None if value is None else value[:18],
)  # fmt: skip
def test_mistakes_with_machines(read, old, new, message):
    if message is None:
        text = changed(old, new).replace('machines = ["old mill"]', 'machines = ["mill"]')
        message = r"s\.toml:11: machine\[1\]: no controller runs on machine old mill"
    else:
        text = changed(old, new)
    with pytest.raises(ScenarioError, match=message) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_an_empty_list_of_machines(read):
    start, end = SEVERAL.index("[[machine]]"), SEVERAL.index("[[controller]]")
    with pytest.raises(ScenarioError, match=r"s\.toml:1: machine: .*at least 1"):
        read("machine = []\n" + SEVERAL[:start] + SEVERAL[end:])
    with pytest.raises(ScenarioError, match=r"machine: .*valid list"):
        read("machine = 3\n" + SEVERAL[:start] + SEVERAL[end:])
    with pytest.raises(ScenarioError, match=r"machine"):
        read("machine = [3]\n" + SEVERAL[:start] + SEVERAL[end:])


VARY = """
[vary]
samples = 12
seed = 9
"simulation.seed" = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]
"machine.mass" = { relative = 0.2, distribution = "uniform" }
"machine.old mill.viscous" = { between = [1.0, 2.0], common = true }
"controller.p.kp" = { relative_std = 0.1 }
controller.pid.kd = { factors = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6] }
"""


def test_what_varies(read):
    variation = read(SEVERAL + VARY).variation
    assert variation.n_samples == 12
    assert variation.seed == 9
    assert list(variation.changes["seed"].values_of) == list(range(1, 13))
    changes = variation.changes
    assert changes["machine.mass"] == Uniform(relative=0.2)
    assert changes["machine.old mill.viscous"] == Uniform(between=(1.0, 2.0), common=True)
    assert changes["controller.p.kp"] == Normal(relative=0.1)
    assert isinstance(changes["controller.pid.kd"], Listed)
    grid = """
[vary]
grid = true
seed = 1
[vary.machine]
mass = { factors = [0.9, 1.0, 1.1] }
resolution = { values = ["1 um", "2 um"] }
"""
    variation = read(SEVERAL + grid).variation
    assert variation.n_samples == 6
    np.testing.assert_allclose(variation.changes["machine.resolution"].values_of, [1e-6, 2e-6])
    assert read(SEVERAL).variation is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("samples = 0", r"vary\.samples: .*greater than or equal to 1, got 0"),
        ("samples = 12\nseed = -1", r"vary\.seed: .*greater than or equal to 0"),
        ("samples = 12", r"vary: vary names nothing to vary"),
        ('"machine.mass" = { relative = 0.2 }', r"vary: samples is missing"),
        ('samples = 12\n"machine.mas" = { relative = 0.2 }',
         r"s\.toml:\d+: vary\.machine\.mas: machine\.mas \(machine mill\): .*no field 'mas'"),
        ('samples = 12\n"mashine.mass" = { relative = 0.2 }', "did you mean machine"),
        ('samples = 12\n"controller.ki" = { relative = 0.2 }', None),
        ('samples = 12\n"controller.p.kpp" = { relative = 0.2 }',
         r"controller\.p\.kpp \(controller p\): .*did you mean kp"),
        ('samples = 12\n"machine.mass" = { relativ = 0.2 }', "unknown key 'relativ'; did you mean"),
        ('samples = 12\n"machine.mass" = { relative = 0.2, std = 1.0 }', "exactly one of"),
        ('samples = 12\n"machine.mass" = {}', "exactly one of"),
        ('samples = 12\n"machine.mass" = 5.0', "must be a list of values or a table"),
        ('samples = 12\n"machine.mass" = { relative = 0.2, distribution = "normal" }',
         "relative goes with uniform, not with distribution 'normal'"),
        ('samples = 12\n"machine.mass" = { relative = 0.2, distribution = "norml" }',
         "unknown distribution 'norml'; did you mean normal"),
        ('samples = 12\n"machine.mass" = { absolute = 100.0 }', "mass must be > 0"),
        ('samples = 12\n"machine.mass" = { relative = -0.2 }', "relative must be finite and > 0"),
        ('samples = 12\n"machine.mass" = { relative = [0.2] }', "relative must be a single value"),
        ('samples = 12\n"machine.mass" = { factors = [1.0, 2.0] }', "need one for each sample"),
        ('samples = 12\n"machine.resolution" = { absolute = 1.0 }', "has no unit"),
        ('samples = 12\n"machine.resolution" = { absolute = "1 kg" }', "not one of length"),
        ('samples = 12\n"machine.mass" = { between = [3.0, 2.0] }', "lower < upper"),
        ('samples = 12\n"machine.mass" = { between = [3.0] }', "a lower and an upper end"),
        ('grid = true\n"machine.mass" = { relative = 0.2 }', "machine.mass is drawn"),
        ('samples = 12\n"machine.names" = { relative = 0.2 }', "not a number that can be varied"),
        ('"simulation.seed" = [1, 2]\n"machine.mass" = [1.0, 2.0, 3.0]', "seed has 2, machine"),
        ('"simulation.seed" = [1.5, 2.0]', "values of seed must be whole numbers"),
        ('samples = 12\n"machine.mass" = { relative = 0.2, common = 1 }', "true or false"),
        ('samples = 12\n"machine.mill.mass" = [1.0]', "need one for each sample"),
        ('samples = 1\n"machine.mill.mass" = [1.0]\n"machine.mass" = { relative = 0.2 }',
         "machine.mass and machine.mill.mass name the same value"),
        ('"machine.mass" = { values = [[1.0, 2.0], [1.0]] }',
         r"s\.toml:\d+: vary\.machine\.mass: listed values must all be numbers, or"),
        ('samples = 2\n"disturbances.0.amplitude" = { std = 2.0 }',
         "there is no disturbance here$"),
        ('samples = 2\n"machine.limits.velocity" = { relative = 0.1 }', "limits cannot vary"),
    ],
    ids=lambda value: None if value is None else value[-28:],
)  # fmt: skip
def test_mistakes_with_what_varies(read, line, message):
    text = SEVERAL
    if message is None:  # a law that has no such gain is named
        text = changed(
            'type = "axis_pid"\nmachines = ["old mill"]\nkp = 1e5\nkd = 500',
            'type = "cascade"\nposition_gain = 20\nvelocity_proportional = 900\n'
            "velocity_integral = 0",
        )
        message = r"controller\.ki \(controller p\): .*no field 'ki'"
    with pytest.raises(ScenarioError, match=message) as caught:
        read(f"{text}\n[vary]\n{line}\n")
    assert "\n" not in str(caught.value)
    assert "vary" in str(caught.value)


def test_shares_of_a_part(read):
    whole = read(SEVERAL)
    cut = read(changed('"p.ngc"', '"p.ngc"\nskip_rapids = true'))
    assert whole.part.n_pieces == 5
    assert cut.part.n_pieces == 3
    assert dict(cut.notes)["only a share of the part"].startswith("without the rapids")
    lines = read(changed('"p.ngc"', '"p.ngc"\nlines = [3, 4]'))
    assert lines.part.n_pieces == 2
    assert "lines 3 to 4 of 7" in dict(lines.notes)["only a share of the part"]
    plane = read(changed('"p.ngc"', '"deep.ngc"\nplane = "XY"'))
    assert plane.part.axes == ("X", "Y")
    assert plane.part.n_pieces == 2
    assert "the XY plane" in dict(plane.notes)["only a share of the part"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("lines = [4]", r"s\.toml:2: part: lines must be the first and the last"),
        ("lines = [4, 3]", "lines must be the first and the last"),
        ("lines = [0, 3]", "lines must be the first and the last"),
        ("lines = [7, 7]", r"p\.ngc: lines 7 to 7 move nothing"),
        ('plane = "XZ"', r"s\.toml:\d+: part\.plane: .*'XY'"),
        ('plane = "ZX"', r"part\.plane: ZX is not the plane of the machine's axes"),
        ('plane = "XY"\naxes = ["X", "Y"]', "plane gives the coordinates itself"),
        ("skip_rapids = 1", r"part\.skip_rapids: "),
    ],
)
def test_mistakes_with_shares(read, keys, message):
    with pytest.raises(ContourlabError, match=message):
        read(changed('"p.ngc"', f'"p.ngc"\n{keys}'))
    formula = changed('file = "p.ngc"', 'formula = "circle"\nradius = "5 mm"\nskip_rapids = true')
    with pytest.raises(ScenarioError, match="goes with file, not with formula"):
        read(formula)


TASK_FRAME = """
[[controller]]
name = "frame"
type = "natural_local_task_frame"
bandwidth_hz = [15, 60]
"""


def test_a_law_that_a_machine_does_not_take_is_refused_there(read):
    """The part has corners, which a task frame does not take; its own refusal names the line."""
    text = changed("[simulation]", f"{TASK_FRAME}\n[simulation]")
    scenario = read(text)
    assert scenario.runs == ("pid on mill", "pid on old mill", "p on old mill")
    error = scenario.setups["mill"].refused["frame"]
    line = text[: text.index(TASK_FRAME) + 2].count("\n") + 1
    assert f"s.toml:{line}: controller[2]: NaturalLocalTaskFrame controls errors" in str(error)
    result = scenario.compare()
    assert result.rows == (
        "pid on mill", "frame on mill", "pid on old mill", "p on old mill", "frame on old mill"
    )  # fmt: skip
    assert result.status("frame on mill") == f"refused: {error.message}"


def test_a_machine_that_is_too_small_or_too_different_for_a_law_is_refused(read):
    small = changed("mass = [6.0, 4.0]", 'mass = [6.0, 4.0]\ntravel = ["0 mm", "15 mm"]')
    scenario = read(small)
    assert scenario.runs == ("pid on old mill", "p on old mill")
    assert "leaves the travel of axis X" in scenario.setups["mill"].refused["pid"].message
    # a rule for gains that cannot be made for one machine: before there is a law
    soft = changed('command = "force"', 'command = "velocity"')
    rule = 'tuning = "bandwidth"\nvelocity_bandwidth_hz = 40\nposition_gain = 10'
    pid = 'type = "axis_pid"\ntuning = "pole_placement"\nbandwidth_hz = 20'
    soft = changed(pid, f'type = "cascade"\n{rule}', soft)
    scenario = read(soft)
    assert scenario.runs == ("pid on mill", "p on old mill")
    assert (
        "by_bandwidth is for machines that take a force"
        in scenario.setups["old mill"].refused["pid"].message
    )


def test_what_varies_of_a_refused_law_is_left_out(read):
    text = changed("[simulation]", f"{TASK_FRAME}\n[simulation]")
    vary = '\n[vary]\nsamples = 2\n"controller.frame.bandwidth_hz" = { relative = 0.1 }\n'
    assert read(text + vary).variation is None
    assert any(
        "left out, as no law that runs has it" in said for _, said in read(text + vary).notes
    )
    mass = '"machine.mass" = { relative = 0.1 }\n'
    assert list(read(text + vary + mass).variation.changes) == ["machine.mass"]


def test_a_scenario_without_a_law_that_runs_is_a_mistake(read):
    start, end = SEVERAL.index("[[controller]]"), SEVERAL.index("[simulation]")
    with pytest.raises(ScenarioError, match=r"controller\[0\]: frame on machine mill: NaturalLoc"):
        read(SEVERAL[:start] + TASK_FRAME + SEVERAL[end:])
