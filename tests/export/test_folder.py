"""The folder of an export: its files, its replay, what is refused, from Python and the shell."""

import dataclasses
import json
import subprocess
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from typer.testing import CliRunner

import contourlab as cl
from contourlab.cli.main import app
from contourlab.errors import ConfigurationError, ExportError, OutputError, ScenarioError
from contourlab.export import GeneratedC, check_parity, find_compiler
from contourlab.export.compiled import CompiledController
from contourlab.export.golden import RecordedLoop
from contourlab.export.stack import array_bytes, says_stack, stack_bytes
from contourlab.scenarios import read_scenario

from .loops import loop

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is installed")
FILES = {
    "README.md", "Makefile", "main.c", "golden.csv", "export.json", "push.h", "push.c",
    "push_replay.c",
}  # fmt: skip
SCENARIO = """
[part]
formula = "ellipse"
semi_axes = ["30 mm", "10 mm"]
center = ["100 mm", "100 mm"]
[feed]
kind = "constant_rate"
rate = 6.0
duration = "0.3 s"
[machine]
name = "ball_screw_stage"
n_axes = 2
[simulation]
sample_time = "1 ms"
[[controller]]
name = "push"
type = "push.py:PushToPath"
k = 20.0
c = 30.0
[[controller]]
name = "inverse"
type = "push.py:Inverse"
k = 20.0
"""
LAW = """
import jax.numpy as jnp

import contourlab as cl
from contourlab.configuration import part, real
from contourlab.controllers import BoundController, Controller
from contourlab.controllers.base import Needs


class PushToPath(Controller):
    model: cl.machines.NominalModel = part()
    k: object = real(unit="V/m", minimum=0.0)
    c: object = real(unit="V/m", minimum=0.0, default=0.0)

    @property
    def needs(self):
        return Needs(command=self.model.command, derivatives=1)

    @property
    def n_axes(self):
        return self.model.n_axes

    def bind(self, contour, sample_time):
        return BoundPushToPath(law=self)


class BoundPushToPath(BoundController):
    law: PushToPath = part()

    def init(self, sample):
        return jnp.zeros(self.law.n_axes)

    def step(self, state, sample):
        error = sample.reference.position - sample.position
        tangent = cl.contours.unit(sample.geometry[1])
        estimate = error - tangent * (tangent @ error)
        return self.law.k * error + self.law.c * estimate, estimate

    def telemetry(self, state):
        return {"contour_error_estimate": state}


class Inverse(PushToPath):
    def bind(self, contour, sample_time):
        return BoundInverse(law=self)


class BoundInverse(BoundPushToPath):
    def step(self, state, sample):
        command, state = super().step(state, sample)
        return jnp.linalg.inv(jnp.eye(2) + state[0]) @ command, state


def helper():
    return 1
"""


def line_of(words):
    """Where something stands in the user's file."""
    return f"push.py:{LAW[: LAW.index(words)].count(chr(10)) + 1}"


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenario")
    (folder / "push.py").write_text(LAW)
    (folder / "scenario.toml").write_text(SCENARIO)
    return folder / "scenario.toml"


@pytest.fixture(scope="module")
def exported(scenario, tmp_path_factory):
    output = tmp_path_factory.mktemp("out") / "c"
    return cl.export(read_scenario(scenario), controller="push", output=output)


def test_a_law_of_the_users_own_is_exported_with_its_files(exported):
    assert set(exported.files) == FILES
    assert {path.name for path in exported.output.iterdir()} == FILES
    assert f"/* {line_of('estimate = error')} */" in (exported.output / "push.c").read_text()
    assert exported.warnings == () or find_compiler() is None


@needs_compiler
def test_it_replays_what_was_recorded(exported, tmp_path):
    done = subprocess.run(
        ["make", "-C", exported.output, "all", "test"], capture_output=True, text=True, check=True
    )
    assert "300 steps, largest difference" in done.stdout or "301 steps" in done.stdout
    subprocess.run([exported.output / "example"], check=True, capture_output=True)
    rows = (exported.output / "golden.csv").read_text().splitlines()
    wrong = tmp_path / "wrong.csv"
    names, first = rows[0].split(","), rows[9].split(",")
    place = names.index("command[0]")
    first[place] = repr(float(first[place]) + 1e-6)
    wrong.write_text("\n".join([*rows[:9], ",".join(first), *rows[10:]]) + "\n")
    replay = [exported.output / "push_replay", wrong]
    assert subprocess.run(replay, check=False, capture_output=True).returncode == 1
    first[place] = rows[9].split(",")[place]
    place = names.index("contour_error_estimate[1]")
    first[place] = "nan"
    wrong.write_text("\n".join([*rows[:9], ",".join(first), *rows[10:]]) + "\n")
    done = subprocess.run(replay, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "contour_error_estimate: inf of its peak" in done.stdout
    wrong.write_text("\n".join(rows[:-3]) + "\n")
    assert subprocess.run(replay, check=False, capture_output=True).returncode == 2
    subprocess.run(["make", "-C", exported.output, "clean"], check=True, capture_output=True)


def test_the_manifest_says_what_is_there(exported):
    said = json.loads((exported.output / "export.json").read_text())
    assert set(said["files"]) == FILES
    assert [one["name"] for one in said["parameters"]] == ["law_k", "law_c"]
    assert said["parameters"][0]["unit"] == "V/m"
    assert said["operations"] == exported.generated.operations > 10
    assert said["sample_time"] == 1e-3
    if find_compiler() is not None:
        assert [one["name"] for one in said["parity"]["telemetry"]] == ["contour_error_estimate"]
        assert said["parity"]["telemetry"][0]["holds"]
        assert 0.0 < said["parity"]["telemetry"][0]["peak"] < 0.03


def test_telemetry_that_a_rounding_makes_no_number_is_told():
    """It moves infinitely far then, and a bound of that would always hold."""
    names = ("command", "estimate")
    outputs = {name: np.ones((3, 2)) for name in names}
    spoilt = {**outputs, "estimate": np.array([[1.0, np.nan]] * 3)}
    generated = Mock(
        spec=GeneratedC, inputs=(), precision="double", iterates=False,
        outputs=[SimpleNamespace(name=n, path=n, dtype="float64") for n in names],
    )  # fmt: skip
    compiled = Mock(spec=CompiledController, stack=None)
    compiled.replay.side_effect = (outputs, spoilt)
    recorded = Mock(spec=RecordedLoop, outputs=spoilt, n_steps=3)
    recorded.inputs.return_value = {}
    (one,) = check_parity(generated, compiled, recorded).telemetry
    assert np.isfinite(one.bound.relative)
    assert not one.holds


def test_telemetry_that_is_not_jax_s_is_told(exported):
    parity = exported.parity
    if parity is None:
        pytest.skip("no C compiler is installed")
    (one,) = parity.telemetry
    off = dataclasses.replace(one, difference=2.0 * one.bound.relative * one.peak)
    worse = dataclasses.replace(exported, parity=dataclasses.replace(parity, telemetry=(off,)))
    assert parity.holds
    assert not worse.parity.holds
    (warning,) = worse.warnings
    assert warning.startswith("contour_error_estimate of the exported law differs from JAX")


ARRAYS = """
void law_step(const law_parameters *parameters)
{
    law_real a0[40];
    int32_t i1[3] = {0};
    const law_real v2 = parameters->a[7];
    for (int32_t k = 0; k < 2; ++k) {
        law_real a3[5];
        bool b4[2];
    }
}
"""


def test_the_stack_is_said(exported, tmp_path):
    compiler = find_compiler()
    if compiler is not None and says_stack(compiler):
        said = json.loads((exported.output / "export.json").read_text())
        assert 0 < said["stack_bytes"] < 1000
        text = (exported.output / "README.md").read_text()
        assert f"| stack of a call | {said['stack_bytes']} bytes at the most" in text
    law = dataclasses.replace(exported.generated, prefix="law", source=ARRAYS)
    assert array_bytes(law) == 8 * 40 + 4 * 3 + 8 * 5 + 2
    assert array_bytes(dataclasses.replace(law, precision="single")) == 4 * 45 + 4 * 3 + 2
    assert stack_bytes(law, tmp_path) is None
    usage = tmp_path / "law.so-law.su"
    usage.write_text(
        "law.c:1:6:law_init\t700\tstatic\nlaw.c:2:6:law_step\t900\tstatic\n"
        "law.c:3:6:law_helper\t16\tdynamic,bounded\n"
    )
    assert stack_bytes(law, tmp_path) == 916
    usage.write_text(usage.read_text() + "law.c:3:6:law_other\t16\tdynamic\n")
    assert stack_bytes(law, tmp_path) is None  # as much as it likes


def test_readme_speaks_of_this_export(exported):
    text = (exported.output / "README.md").read_text()
    for word in ("PushToPath", "`law_k`", "0.001", "16 bytes", "`geometry` | real | 2 x 2"):
        assert word in text


def test_a_folder_that_is_not_ours_is_left_alone(scenario, exported, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("years of work")
    ready = read_scenario(scenario)
    for force in (False, True):
        with pytest.raises(OutputError, match="not an export of contourlab"):
            cl.export(ready, controller="push", output=mine, force=force)
    (mine / "export.json").write_text('{"schema": "something else"}')
    with pytest.raises(OutputError, match="not an export of contourlab"):
        cl.export(ready, controller="push", output=mine, force=True)
    assert (mine / "thesis.txt").read_text() == "years of work"
    with pytest.raises(OutputError, match="--force"):
        cl.export(ready, controller="push", output=exported.output)
    with pytest.raises(OutputError, match="is a file"):
        cl.export(ready, controller="push", output=mine / "thesis.txt")


def test_an_export_that_fails_leaves_nothing(scenario, tmp_path):
    where = line_of("return jnp.linalg.inv")
    with pytest.raises(ExportError, match=f"primitive lu cannot be exported; .* {where}"):
        cl.export(read_scenario(scenario), controller="inverse", output=tmp_path / "no")
    assert list(tmp_path.iterdir()) == []


def test_what_there_is_not(scenario, tmp_path):
    ready = read_scenario(scenario)
    with pytest.raises(ConfigurationError, match="unknown controller 'pull'"):
        cl.export(ready, controller="pull", output=tmp_path / "x")
    with pytest.raises(ConfigurationError, match="several controllers"):
        cl.export(ready, output=tmp_path / "x")
    with pytest.raises(ConfigurationError, match="unknown target 'plc'"):
        cl.export(ready, controller="push", output=tmp_path / "x", target="plc")
    with pytest.raises(ConfigurationError, match="precision must be double or single"):
        cl.export(ready, controller="push", output=tmp_path / "x", precision="half")
    with pytest.raises(ConfigurationError, match="prefix must be"):
        cl.export(ready, controller="push", output=tmp_path / "x", prefix="2fast")
    with pytest.raises(ExportError, match="machine= and reference="):
        cl.export(loop("AxisPid")[1], output=tmp_path / "x")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("type_", "message"), [
    ("pull.py:Pull", "no file 'pull.py'"),
    ("push.py:Pull", "no class 'Pull' in push.py; "),
    ("push.py:helper", "'helper' in push.py is not a control law"),
    ("push.py", "has several laws"),
    ("broken.py:Law", r"broken.py:3 fails: NameError"),
    ("wrong.py:Law", r"wrong.py:1 fails: SyntaxError"),
])  # fmt: skip
def test_a_law_that_cannot_be_had_is_refused(scenario, type_, message):
    (scenario.parent / "broken.py").write_text("x = 1\n\ny = z\n")
    (scenario.parent / "wrong.py").write_text("def\n")
    text = SCENARIO.replace('"push.py:PushToPath"', f'"{type_}"')
    other = scenario.with_name("other.toml")
    other.write_text(text)
    with pytest.raises(ScenarioError, match=message) as caught:
        read_scenario(other)
    assert caught.value.key == "controller[0].type"


def test_the_command_line(scenario, tmp_path):
    output = tmp_path / "c"
    arguments = ["export", str(scenario), "--controller", "push", "--output", str(output)]
    done = CliRunner().invoke(app, [*arguments, "--prefix", "mine", "--json"])
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said["schema"] == "contourlab.export/1"
    assert said["target"] == "c"
    assert "mine.c" in said["files"]
    if find_compiler() is not None:
        assert said["parity"]["holds"]
        assert said["parity"]["relative"] <= 1e-12
    assert (Path(said["output"]) / "mine.c").is_file()
    done = CliRunner().invoke(app, arguments)
    assert isinstance(done.exception, OutputError)


def test_without_a_compiler_it_says_so(scenario, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    found = cl.export(read_scenario(scenario), controller="push", output=tmp_path / "c", steps=20)
    assert found.parity is None
    assert "no C compiler" in found.warnings[0]
    assert "not measured" in (tmp_path / "c" / "README.md").read_text()
