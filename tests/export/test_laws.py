"""Every law in C against JAX, over the inputs of a whole loop; clean under warnings, sanitizers."""

import re
import subprocess

import numpy as np
import pytest

import contourlab as cl
from contourlab import controllers
from contourlab.export import check_parity, compile_c, find_compiler, generate, record_loop
from contourlab.export.c_target import write_c

from .loops import NAMES, loop

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is installed")
STRICT = ("-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-pedantic")
SLOW = {
    "CrossCoupled, tangent", "CrossCoupled, natural_local", "CrossCoupled, foot_point",
    "CrossCoupled, extended_natural_local", "CrossCoupled, variable_gain",
    "CrossCoupled, global_task_frame", "IntegratedAdaptiveRobust", "ModelPredictiveContouring",
    "NewtonCrossCoupled", "FirstOrderTaskFrame", "PositionDomainPid",
}  # fmt: skip
LOOSER = {
    "AxisPredictive", "PredictiveContouring", "ModelPredictiveContouring",
    "InternalModelContouring",
}  # fmt: skip
"""Laws that make a command of small differences of positions, with high gains."""


def marked(names):
    return [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in names]


@pytest.fixture(scope="module")
def made():
    found = {}

    def one(name):
        if name not in found:
            machine, law, reference = loop(name)
            recorded = record_loop(machine, law, reference)
            found[name] = (
                recorded,
                generate(
                    recorded.law,
                    recorded.first(),
                    sample_time=recorded.sample_time,
                    prefix="law",
                    command=law.needs.command,
                ),
            )
        return found[name]

    return one


def test_no_law_is_left_out():
    concrete = {
        name
        for name in controllers.__all__
        if isinstance(getattr(controllers, name), type)
        and issubclass(getattr(controllers, name), controllers.Controller)
        and name not in ("Controller", "AxisController", "TaskFrameController")
    }
    assert concrete == {name.partition(",")[0] for name in NAMES}


@needs_compiler
@pytest.mark.parametrize("name", marked(NAMES))
def test_parity(name, made, tmp_path):
    recorded, generated = made(name)
    found = check_parity(generated, compile_c(generated, tmp_path, flags=STRICT), recorded)
    assert found.peak > 0.0
    assert found.steps > 200
    assert found.flipped == ()
    assert [one.name for one in found.telemetry if not one.holds] == []
    # a looser bound only where one rounding of the inputs moves the command by as much
    assert found.relative <= (found.bound.relative if name in LOOSER else 1e-12)
    assert found.bound.relative <= 1e-9


@needs_compiler
@pytest.mark.parametrize("name", ["CrossCoupled, newton"])
def test_single_precision(name, made, tmp_path):
    recorded, _ = made(name)
    single = generate(
        recorded.law, recorded.first(), sample_time=1e-3, prefix="law", precision="single"
    )
    assert "double" not in single.source + single.header
    found = check_parity(single, compile_c(single, tmp_path, flags=STRICT), recorded)
    assert 1e-8 < found.relative <= found.bound.relative < 0.05
    assert found.bound.reason.startswith("single precision")


@needs_compiler
@pytest.mark.parametrize("name", marked(["AxisPid", "InternalModelContouring",
                                         "ModelPredictiveContouring"]))  # fmt: skip
def test_no_sanitizer_complains(name, made, tmp_path):
    """Out of bounds, overflow, misaligned, leaks: the replay program under both sanitizers."""
    recorded, generated = made(name)
    write_c(generated, recorded, tmp_path, None)
    done = subprocess.run(
        ["make", "-C", tmp_path, "sanitize"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 decisions came out otherwise" in done.stdout


@needs_compiler
def test_what_is_not_a_number_stays_where_jax_has_it(made, tmp_path):
    recorded, generated = made("CrossCoupled")
    compiled = compile_c(generated, tmp_path, flags=STRICT)
    inputs = {k: v[:3].copy() for k, v in recorded.inputs(generated.inputs).items()}
    inputs["position"][1, 0] = np.nan
    command = compiled.replay(inputs)["command"]
    assert np.isfinite(command[0]).all()
    assert np.isnan(command[1]).any()


@needs_compiler
def test_a_gain_that_is_changed_acts_like_one_that_was_bound(made, tmp_path):
    recorded, generated = made("AxisPid")
    compiled = compile_c(generated, tmp_path, flags=STRICT)
    _, law, reference = loop("AxisPid")
    other = cl.replace(law, kp=0.5 * np.asarray(law.kp))
    compiled.set_parameters(kp=0.5 * np.asarray(law.kp))
    theirs = other.bind(reference.contour, 1e-3)
    first = recorded.first()
    state, wanted = theirs.init(first), []
    for k in range(5):
        command, state = theirs.step(state, recorded.at(k))
        wanted.append(command)
    ours = compiled.replay({k: v[:5] for k, v in recorded.inputs(generated.inputs).items()})
    np.testing.assert_allclose(ours["command"], wanted, rtol=1e-13)


def test_only_what_the_law_reads_is_an_input(made):
    _, generated = made("AxisPid")
    assert [field.name for field in generated.inputs] == [
        "reference_position", "reference_velocity", "reference_acceleration", "position",
    ]  # fmt: skip
    units = {field.name: field.unit for field in generated.parameters}
    assert units["kp"] == "N/m"
    assert re.search(r"law_real kp\[2\]; /\* Proportional gain, >= 0 \[N/m\] \*/", generated.header)
    assert re.search(r"law_real command\[2\]; /\* [^*]*\[N\] \*/", generated.header)
    assert {field.name: field.unit for field in generated.inputs}["position"] == "m"


@pytest.mark.parametrize(("name", "wanted"), [
    ("AxisPid", {"kp": "N/m", "kd": "N s/m", "command_limit": "N", "integral": "m s",
                 "derivative.value": "m/s", "feed_forward.acceleration": "N s^2/m"}),
    ("CrossCoupled", {"derivative.signal": "m", "integral": "m s", "kp": "N/m"}),
    pytest.param(
        "NewtonCrossCoupled", {"derivative.signal": "1", "integral": "s", "kp": "N"},
        marks=pytest.mark.slow,
    ),
])  # fmt: skip
def test_gains_state_and_command_have_units(name, wanted, made):
    _, generated = made(name)
    units = {one.path: one.unit for one in (*generated.parameters, *generated.state)}
    assert {path: units[path] for path in wanted} == wanted
    outputs = {one.path: one for one in generated.outputs}
    assert outputs["command"].unit == "N"
    assert outputs["status"].text == "0 normal, 1 saturated"


def test_loops_that_end_by_themselves_are_counted_apart(made):
    assert made("AxisPid")[1].operations_once == made("AxisPid")[1].operations
    searching = made("DirectAdaptiveRobust")[1]
    assert 100 < searching.operations_once < 10_000 < searching.operations


def test_the_contour_and_the_sample_time_are_in_the_code(made):
    _, generated = made("CrossCoupled, newton")
    names = {field.name for field in generated.parameters}
    assert not any("semi_axes" in name or "sample_time" in name for name in names)
    assert "0.029999999999999999" in generated.source


def test_every_statement_has_a_line_of_the_law_and_no_path_of_a_machine(made):
    _, generated = made("AxisPid")
    assert "/* controllers/axis_pid.py:" in generated.source
    assert "/home" not in generated.source
    assert str(cl.__file__).rpartition("/")[0] not in generated.source


@needs_compiler
def test_nothing_is_exported_but_the_three_functions(made, tmp_path):
    _, generated = made("DirectAdaptiveRobust")
    compile_c(generated, tmp_path)
    subprocess.run(
        [find_compiler(), "-std=c99", "-O1", "-c", tmp_path / "law.c", "-o", tmp_path / "law.o"],
        check=True,
    )
    shown = subprocess.run(
        ["nm", "--extern-only", tmp_path / "law.o"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    defined = {line.split()[-1] for line in shown if line.split()[-2] != "U"}
    undefined = {line.split()[-1] for line in shown if line.split()[-2] == "U"}
    assert defined == {"law_default_parameters", "law_init", "law_step"}
    assert undefined <= {"sin", "cos", "sincos", "tanh", "sqrt", "fmod", "floor", "ceil",
                         "memcpy", "atan", "atan2", "round", "rint", "exp", "pow"}  # fmt: skip
    # neither data that changes nor memory that is asked for
    assert not any(" d " in line.lower() or " b " in line.lower() for line in shown)
