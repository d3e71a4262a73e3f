"""Functional mock-up units: valid for FMPy, and the numbers of the same C called from Python."""

import shutil
import sys
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contourlab.errors import ConfigurationError, OutputError
from contourlab.export.compiled import compile_c
from contourlab.export.fmu import fmu_files, write_fmu

from .probe_law import KD, KP, START, T, probe

fmpy = pytest.importorskip("fmpy", reason="needs FMPy, of the extra test")
pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("gcc", "clang", "cc"))), reason="needs a C compiler"
)
VERSIONS = pytest.mark.parametrize("fmi", [2, 3])


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    """One unit of each version."""
    folder = tmp_path_factory.mktemp("fmu")
    for fmi in (2, 3):
        write_fmu(probe(), folder / f"probe{fmi}.fmu", fmi=fmi)
    return {fmi: folder / f"probe{fmi}.fmu" for fmi in (2, 3)}


class Running:
    """An instance of a unit, stepped by hand, numbers by the variables' names."""

    def __init__(self, file, folder, fmi):
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        self.fmi, self.description = fmi, read_model_description(str(file))
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        kind = FMU2Slave if fmi == 2 else FMU3Slave
        self.unit = kind(
            guid=self.description.guid, instanceName="one",
            unzipDirectory=extract(str(file), str(folder)),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.unit.instantiate()
        self.start()

    def start(self):
        if self.fmi == 2:
            self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def set(self, values):
        names, numbers = list(values), list(values.values())
        put = self.unit.setReal if self.fmi == 2 else self.unit.setFloat64
        put([self.reference[name] for name in names], numbers)

    def get(self, *names):
        take = self.unit.getReal if self.fmi == 2 else self.unit.getFloat64
        return take([self.reference[name] for name in names])

    def whole(self, name):
        take = self.unit.getInteger if self.fmi == 2 else self.unit.getInt32
        return take([self.reference[name]])[0]

    def step(self, time, size=T):
        self.unit.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def end(self):
        self.unit.terminate()
        self.unit.freeInstance()


@pytest.fixture(params=[2, 3])
def running(request, units, tmp_path):
    one = Running(units[request.param], tmp_path, request.param)
    yield one
    one.end()


def flat(values):
    """Name every number of the inputs as the unit does, indices from 1."""
    return {
        f"{name}[{','.join(str(k + 1) for k in index)}]" if index else name: float(array[index])
        for name, array in ((name, np.asarray(value)) for name, value in values.items())
        for index in np.ndindex(array.shape)
    }


@VERSIONS
def test_fmpy_finds_nothing_wrong(units, fmi):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(units[fmi])) == []


def test_it_gives_the_numbers_of_the_same_c(running, tmp_path):
    law = compile_c(probe(), tmp_path)
    rng = np.random.default_rng(7)
    for k in range(200):
        values = {
            field.name: rng.normal(size=field.shape)
            for field in law.generated.inputs
            if field.path != "time"
        }
        given = {**values, "time": k * T}
        if k == 0:
            law.init(given)
        expected = law.step(given)
        running.set(flat(values))
        running.step(k * T)
        assert_array_equal(running.get("command[1]", "command[2]"), expected["command"])
        assert running.get("telemetry.steps") == [expected["steps"]]
        assert running.whole("status") == expected["status"]


@VERSIONS
def test_fmpy_simulates_it(units, fmi):
    """As a user would: an input signal, a gain, and the law's answer to both."""
    signal = np.array(
        [(0.0, 0.0), (1.0, 1.0)], dtype=[("time", float), ("reference_position[1]", float)]
    )
    found = fmpy.simulate_fmu(
        str(units[fmi]), stop_time=0.1, output_interval=T, input=signal,
        start_values={"parameters.kp[1]": 10.0},
    )  # fmt: skip
    # row k + 1 holds what the step from k gave
    np.testing.assert_allclose(found["command[1]"][1:], 10.0 * found["time"][:-1], atol=1e-9)
    assert found["telemetry.steps"][-1] == START + 100.0


def test_gains_are_tunable(running):
    kinds = {v.name: (v.causality, v.variability) for v in running.description.modelVariables}
    assert kinds["parameters.kp[2]"] == ("parameter", "tunable")
    assert running.get("parameters.kp[1]", "parameters.kd[2]") == [KP, KD]
    running.set({"reference_position[1]": 1.0})
    running.step(0.0)
    running.set({"parameters.kp[1]": 2.0 * KP})
    running.step(T)
    assert running.get("command[1]") == [2.0 * KP]


def test_another_step_size_is_an_error(running):
    with pytest.raises(Exception, match=r"(?i)error|status"):
        running.step(0.0, 2.0 * T)


def test_a_command_that_is_not_finite_is_an_error(running):
    running.set({"position[1]": np.nan})
    with pytest.raises(Exception, match=r"(?i)error|status"):
        running.step(0.0)


def test_an_output_cannot_be_set(running):
    with pytest.raises(Exception, match=r"(?i)error|status"):
        running.set({"command[1]": 1.0})


def test_the_state_can_be_taken_back(running):
    names = {2: ("getFMUstate", "setFMUstate", "freeFMUstate", "serializeFMUstate",
                 "deSerializeFMUstate"),
             3: ("getFMUState", "setFMUState", "freeFMUState", "serializeFMUState",
                 "deserializeFMUState")}[running.fmi]  # fmt: skip
    take, put, free, pack, unpack = (getattr(running.unit, name) for name in names)
    running.step(0.0)
    state = take()
    packed = pack(state)
    running.step(T)
    assert running.get("telemetry.steps") == [START + 2.0]
    put(state)
    running.step(T)
    assert running.get("telemetry.steps") == [START + 2.0]
    again = unpack(packed)
    put(again)
    assert running.get("telemetry.steps") == [START + 1.0]
    free(state)
    free(again)


def test_reset_starts_anew(running):
    running.set({"parameters.kp[1]": 1.0})
    running.step(0.0)
    running.unit.reset()
    running.start()
    assert running.get("parameters.kp[1]", "telemetry.steps") == [KP, 0.0]


@VERSIONS
def test_sources_are_inside_and_compile_without_warnings(units, fmi, tmp_path):
    import subprocess

    with zipfile.ZipFile(units[fmi]) as archive:
        archive.extractall(tmp_path)
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only"]
    subprocess.run(
        [shutil.which("gcc") or "cc", *strict, f"probe_fmi{fmi}.c"],
        check=True, cwd=tmp_path / "sources",
    )  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="reads an ELF library with nm")
@VERSIONS
def test_only_the_standards_functions_are_visible(units, fmi, tmp_path):
    import subprocess

    with zipfile.ZipFile(units[fmi]) as archive:
        binary = next(name for name in archive.namelist() if name.endswith(".so"))
        archive.extract(binary, tmp_path)
    symbols = subprocess.run(
        ["nm", "-D", "--defined-only", str(tmp_path / binary)],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    names = {line.split()[-1] for line in symbols.splitlines()}
    assert f"fmi{fmi}DoStep" in names
    assert all(name.startswith(f"fmi{fmi}") for name in names)


@VERSIONS
def test_every_function_of_the_standard_is_there(units, fmi, tmp_path):
    """Against the headers that FMPy ships."""
    import re
    import subprocess
    from pathlib import Path

    headers = Path(fmpy.__file__).parent / "c-code"
    text = (headers / f"fmi{fmi}Functions.h").read_text()
    named = set(re.findall(rf"FMI{fmi}_Export\s+fmi{fmi}(\w+)TYPE", text))
    with zipfile.ZipFile(units[fmi]) as archive:
        binary = next(name for name in archive.namelist() if name.endswith(".so"))
        archive.extract(binary, tmp_path)
    symbols = subprocess.run(
        ["nm", "-D", "--defined-only", str(tmp_path / binary)],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    there = set(re.findall(rf"fmi{fmi}(\w+)$", symbols, re.M))
    continuous = {
        "EnterEventMode",
        "NewDiscreteStates",
        "EnterContinuousTimeMode",
        "CompletedIntegratorStep",
        "SetTime",
        "SetContinuousStates",
        "GetDerivatives",
        "GetEventIndicators",
        "GetContinuousStates",
        "GetNominalsOfContinuousStates",
    }  # of FMI 2.0 for model exchange alone
    assert named - there == (continuous if fmi == 2 else set())


@VERSIONS
def test_declarations_are_those_of_the_standard(units, fmi, tmp_path):
    """The unit's source, compiled behind FMPy's copy of the headers, has the same prototypes."""
    import re
    import subprocess
    from pathlib import Path

    headers = Path(fmpy.__file__).parent / "c-code"
    with zipfile.ZipFile(units[fmi]) as archive:
        archive.extractall(tmp_path)
    source = (tmp_path / "sources" / f"probe_fmi{fmi}.c").read_text()
    own = re.sub(
        rf"^typedef (?:(?!{{|;)[^;])*fmi{fmi}\w+(?:\)\([^;]*\))?;$", "", source, flags=re.M
    )
    own = re.sub(rf"^typedef (?:enum|struct) {{[^}}]*}} fmi{fmi}\w+;$", "", own, flags=re.M)
    own = re.sub(rf"^typedef void \(\*fmi{fmi}\w+\)\([^;]*\);$", "", own, flags=re.M)
    assert f"}} fmi{fmi}Status;" not in own
    (tmp_path / "sources" / "checked.c").write_text(f'#include "fmi{fmi}Functions.h"\n{own}')
    subprocess.run(
        ["gcc", "-std=c99", f"-I{headers}", "-fsyntax-only", "checked.c"],
        check=True, cwd=tmp_path / "sources",
    )  # fmt: skip


def test_the_same_law_gives_the_same_file(units, tmp_path):
    write_fmu(probe(), tmp_path / "again.fmu")
    assert (tmp_path / "again.fmu").read_bytes() == units[3].read_bytes()


def test_another_law_has_another_token():
    one, two = fmu_files(probe()), fmu_files(probe(order=3))
    find = r'instantiationToken="([^"]+)"'
    import re

    tokens = [re.search(find, files["modelDescription.xml"])[1] for files in (one, two)]
    assert tokens[0] != tokens[1]


def test_another_version_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="fmi must be 2 or 3, got 1"):
        write_fmu(probe(), tmp_path / "one.fmu", fmi=1)


def test_what_exists_is_not_replaced_unless_told(units, tmp_path):
    mine = tmp_path / "mine.fmu"
    shutil.copy(units[2], mine)
    with pytest.raises(OutputError, match="exists already"):
        write_fmu(probe(), mine)
    write_fmu(probe(), mine, force=True)
    assert mine.read_bytes() == units[3].read_bytes()


@pytest.mark.parametrize("content", [b"a letter to my mother", b""])
def test_what_is_not_ours_is_never_replaced(tmp_path, content):
    letter = tmp_path / "letter.fmu"
    letter.write_bytes(content)
    with pytest.raises(OutputError, match="was not made by contourlab"):
        write_fmu(probe(), letter, force=True)
    assert letter.read_bytes() == content
    assert sorted(p.name for p in tmp_path.iterdir()) == ["letter.fmu"]


def test_a_failed_compiler_leaves_nothing(tmp_path, monkeypatch):
    import dataclasses

    from contourlab.errors import ExportError

    broken = dataclasses.replace(probe(), source="this is no C\n")
    with pytest.raises(ExportError, match="refused"):
        write_fmu(broken, tmp_path / "broken.fmu")
    assert list(tmp_path.iterdir()) == []
