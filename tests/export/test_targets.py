"""``export`` with targets linuxcnc and fmu: options, folders, files, and the command line."""

import json
import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pytest

import contourlab as cl
from contourlab.errors import ConfigurationError, OutputError, RefusedError
from contourlab.export.linuxcnc_servo import ServoLayer

T = 1e-3
pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("gcc", "clang", "cc"))), reason="needs a C compiler"
)


@pytest.fixture(scope="module")
def loop():
    machine = cl.machines.linear_motor_stage()
    reference = cl.feedrate.constant_rate(
        cl.contours.Circle(radius=0.02), rate=2.0, duration=0.1, sample_time=T
    )
    controller = cl.controllers.AxisPid.by_pole_placement(machine.nominal, 25.0)
    return {"what": controller, "machine": machine, "reference": reference, "prefix": "pid"}


@pytest.fixture(scope="module")
def component(loop, tmp_path_factory):
    output = tmp_path_factory.mktemp("targets") / "hal"
    result = cl.export(
        **loop, target="linuxcnc", output=output, license="GPL", length_unit="inch",
        command_limit=(20.0, 30.0),
    )  # fmt: skip
    return result, output


def test_a_component_is_an_export(component):
    result, output = component
    assert result.parity.holds
    assert sorted(result.files) == sorted(p.name for p in output.iterdir())
    manifest = json.loads((output / "export.json").read_text())
    assert manifest["target"] == "linuxcnc"
    assert manifest["linuxcnc"]["command"] == "force"
    assert manifest["linuxcnc"]["license"] == "GPL"


def test_its_servo_layer_is_called_from_python(component):
    _, output = component
    servo = ServoLayer.of_export(output)
    assert servo.settings["command_limit"].tolist() == [20.0, 30.0]
    rows = servo.inputs(20, T)
    rows["enable"] = 1
    rows["reference_position"] = 1.0  # inch
    rows["position"] = 0.999
    out = servo.run(rows)
    assert out["running"].all()
    kp = servo.settings["law"]["kp"]
    np.testing.assert_allclose(out["command"][0], kp * 0.0254 * (1.0 - 0.999), rtol=1e-9)


def test_what_is_no_component_is_refused(tmp_path):
    from contourlab.errors import ExportError

    (tmp_path / "export.json").write_text("{}")
    with pytest.raises(ExportError, match="is not a folder that export --target linuxcnc wrote"):
        ServoLayer.of_export(tmp_path)


def test_the_licence_is_asked_for_before_anything_is_done(loop, tmp_path):
    with pytest.raises(RefusedError, match="--license"):
        cl.export(**loop, target="linuxcnc", output=tmp_path / "hal")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("target", "options", "says"),
    [
        ("linuxcnc", {"license": "GPL", "fmi": 3}, "no option 'fmi'"),
        ("fmu", {"license": "GPL"}, "no option 'license'"),
        ("fmu", {"output_": 1}, "no option 'output_'"),
        ("fmu", {"fmi": 1}, "fmi must be 2 or 3"),
        ("c", {"fmi": 3}, "no option 'fmi'"),
    ],
)
def test_an_option_of_another_target_is_refused(loop, tmp_path, target, options, says):
    with pytest.raises(ConfigurationError, match=says):
        cl.export(**loop, target=target, output=tmp_path / "out", **options)
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_folder_is_refused(loop, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    for force in (False, True):
        with pytest.raises(OutputError, match="not an export of contourlab"):
            cl.export(**loop, target="linuxcnc", output=tmp_path, license="GPL", force=force)
    assert [p.name for p in tmp_path.iterdir()] == ["letter.txt"]


def test_an_export_is_replaced_only_when_told(loop, component, tmp_path):
    output = tmp_path / "hal"
    shutil.copytree(component[1], output)
    with pytest.raises(OutputError, match="--force"):
        cl.export(**loop, target="linuxcnc", output=output, license="GPL")
    cl.export(**loop, target="linuxcnc", output=output, license="GPL", force=True)
    assert ServoLayer.of_export(output).settings["scale"].tolist() == [1e-3, 1e-3]
    assert [p.name for p in tmp_path.iterdir()] == ["hal"]


def test_a_law_that_the_target_refuses_leaves_nothing(loop, tmp_path):
    model = cl.replace(loop["machine"].nominal, command_limit=np.full(2, np.inf))
    controller = cl.replace(loop["what"], model=model)
    with pytest.raises(RefusedError, match="has no command limit"):
        cl.export(
            **{**loop, "what": controller}, target="linuxcnc", output=tmp_path / "hal",
            license="GPL",
        )  # fmt: skip
    assert list(tmp_path.iterdir()) == []


def test_a_unit_is_written(loop, tmp_path):
    file = tmp_path / "pid.fmu"
    result = cl.export(**loop, target="fmu", output=file, fmi=2)
    with zipfile.ZipFile(file) as archive:
        assert sorted(archive.namelist()) == sorted(result.files)
        assert 'fmiVersion="2.0"' in archive.read("modelDescription.xml").decode()
    with pytest.raises(OutputError, match="exists already"):
        cl.export(**loop, target="fmu", output=file)


SCENARIO = """
[part]
formula = "circle"
radius = "20 mm"
[feed]
kind = "programmed"
feed = "40 mm/s"
[machine]
name = "linear_motor_stage"
[simulation]
sample_time = "1 ms"
[[controller]]
name = "pid"
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 25
"""


def command_line(*words, cwd):
    return subprocess.run(
        [sys.executable, "-m", "contourlab", "export", "scenario.toml", *words],
        cwd=cwd, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_from_the_command_line(tmp_path):
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    without = command_line("--target", "linuxcnc", "--output", "hal", cwd=tmp_path)
    assert without.returncode == 2
    assert "--license" in without.stderr
    done = command_line(
        "--target", "linuxcnc", "--output", "hal", "--license", "GPL", "--joints", "1,0",
        "--command-limit", "40,50", "--following-error-limit", "0.5 mm", "--json", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "pid.comp" in json.loads(done.stdout)["files"]
    text = (tmp_path / "hal" / "pid.hal").read_text()
    assert "setp pid.command-limit-1 50.0" in text
    assert "setp pid.following-error-limit-0 0.5" in text
    assert "joint.1.motor-pos-cmd => pid.reference-position-0" in text
