"""The whole of LinuxCNC running a part by an exported controller; and the axes that it moves."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contourlab as cl
from contourlab.export.linuxcnc_session import build_component, missing_linuxcnc
from contourlab.export.linuxcnc_thread import through_thread
from contourlab.machines.rigid import RigidState

pytestmark = [
    pytest.mark.linuxcnc,
    pytest.mark.skipif(missing_linuxcnc() is not None, reason=str(missing_linuxcnc())),
]
EXAMPLE = Path(__file__).parents[2] / "examples" / "linuxcnc"


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("linuxcnc_example", EXAMPLE / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_simulated_axis_is_that_of_contourlab(example, tmp_path):
    """Mass, viscous and Stribeck friction, encoder: both integrate the same rule."""
    machine = cl.machines.linear_motor_stage()
    shutil.copy(EXAMPLE / "simulated_axis.comp", tmp_path)
    module = build_component(tmp_path / "simulated_axis.comp")
    n, period, substeps = 400, 1e-3, 10
    rng = np.random.default_rng(5)
    force = np.repeat(rng.uniform(-40.0, 40.0, (n // 20, 2)), 20, axis=0)
    force[:40] = 5.0  # below breakaway: it creeps
    enabled = np.ones((n, 1))
    out = through_thread(
        np.concatenate([force, enabled], axis=1),
        pins_in=[("axis-x.command", "f"), ("axis-y.command", "f"), ("axis-x.enable", "b")],
        pins_out=[(f"axis-{a}.{p}", "f") for p in ("position", "position-fb") for a in "xy"],
        functions=["axis-x.move", "axis-y.move"], modules=[module], period=period, folder=tmp_path,
        lines=[
            "loadrt simulated_axis names=axis-x,axis-y",
            "net in2 axis-y.enable",
            *(line for line in example.axes_hal(machine).splitlines() if line.startswith("setp")),
        ],
    )  # fmt: skip
    bound = machine.dynamics.bind(2, (period,), substeps)

    @jax.jit
    def moved(force):
        def step(state, one):
            after = bound.advance(state, (one,), np.zeros(2))
            return after, after.position

        return jax.lax.scan(step, RigidState(jnp.zeros(2), jnp.zeros(2)), force)[1]

    expected = np.asarray(moved(force)) * 1e3
    assert np.abs(expected).max() > 1.0
    # the secant of friction near rest is 1e5 N s/m: rounding grows, not the rule
    assert_allclose(out[:, :2], expected, rtol=0, atol=1e-9)
    assert_array_equal(out[:, 2:], np.floor(out[:, :2] * 1e-3 / 1e-7 + 0.5) * 1e-7 / 1e-3)


@pytest.fixture(scope="module")
def run(example, tmp_path_factory):
    """One run of the script, as a user starts it."""
    folder = tmp_path_factory.mktemp("machine")
    log = folder / "log.csv"
    done = subprocess.run(
        [sys.executable, str(EXAMPLE / "run.py"), "--log", str(log), "--work", str(folder)],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    table = pd.read_csv(log)
    difference, out = example.replay(table, folder / "controller")
    return done.stdout, table, difference, out, folder


@pytest.mark.slow
def test_the_run_is_replayed_to_identity(run):
    said, table, difference, out, _ = run
    assert difference == 0.0
    assert_array_equal(out["running"], table["running"])
    assert_array_equal(out["law"]["status"] * out["running"], table["status"])
    assert (table["fault code"] == 0).all()
    assert table["running"].sum() > 2000
    assert np.abs(table[["X force [N]", "Y force [N]"]].to_numpy()).max() > 5.0
    assert "largest difference to the logged commands 0 N" in said


@pytest.mark.slow
def test_the_path_seen_from_the_motion_is_that_of_the_program(run):
    """Arcs of 10, 6 and 4 mm and lines, as part.ngc has them."""
    _, _, _, out, _ = run
    given = out["law_inputs"][out["running"] == 1]
    geometry = given["geometry"].reshape(len(given), -1, 2)
    curvature = np.linalg.norm(geometry[:, 2], axis=1)
    for radius in (0.010, 0.006, 0.004):
        assert (np.abs(curvature * radius - 1.0) < 1e-4).sum() > 50
    assert (curvature < 1e-3).sum() > 300
    known = np.concatenate([[0.0], 1.0 / np.array([0.010, 0.006, 0.004])])
    apart = np.abs(curvature[:, None] - known).min(axis=1)
    # elsewhere: where pieces meet, for the length of LinuxCNC's interpolation, and blended corners
    assert (apart > 1e-3 * known.max()).mean() < 0.1


@pytest.mark.slow
def test_the_tool_keeps_to_the_programmed_path(run, example):
    """Judged by contourlab's own metrics; the law's estimate against the exact contour error."""
    from contourlab.scenarios import read_scenario

    _, table, _, out, _ = run
    scenario = read_scenario(EXAMPLE / "stage.toml")
    contour = next(iter(scenario.setups.values())).reference.contour
    recording = example.judge(table, contour)
    assert recording.n_samples == table["running"].sum()
    assert 1e-7 < recording.metrics["contour_error_rms"] < 20e-6
    exact = np.asarray(recording["contour_error_vector"])
    shown = out["law"]["contour_error_estimate"][out["running"] == 1]
    # encoder counts of 0.1 um; G64 P0.01: the planner leaves the program by up to 10 um
    assert np.median(np.abs(shown - exact)) < 0.5e-6
    assert np.abs(shown - exact).max() < 15e-6
