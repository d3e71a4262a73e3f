"""Whole runs of predictive contouring: against rivals, over machines, over weights, a trade-off."""

import runpy
from pathlib import Path as FilePath

import numpy as np
import pytest

import contourlab as cl
from contourlab.contours import FigureEight, Line
from contourlab.controllers import ModelPredictiveContouring
from contourlab.machines import Drive, Encoder, Machine, RigidAxes
from contourlab.reports import trade_off_rows
from contourlab.scenarios import read_scenario

EXAMPLES = FilePath(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_it_beats_laws_that_follow_a_plan_in_both_time_and_error():
    """Published claim of the kind: planning under the voltage limit wins on both counts."""
    runs = read_scenario(EXAMPLES / "figure_eight_mpcc.toml").compare().recordings
    metrics = {name: run.metrics for name, run in runs.items()}
    rivals = {name: found for name, found in metrics.items() if not name.startswith("mpcc")}
    assert len(rivals) == 3
    for name in ("mpcc", "mpcc, precise"):
        assert runs[name].status == "normal"
        # 1.44 s and 0.5 µm rms here: of the length over the speed limit, 0.786 s, most of the rest
        # is starting, stopping and turning under 20 V, a tenth of the mass in reserve
        assert 1.3 < metrics[name]["cycle_time"] < 1.5
        assert metrics[name]["contour_error_rms"] < 7e-7
        for other in rivals.values():
            assert metrics[name]["cycle_time"] < 0.85 * other["cycle_time"]
            # the rivals count on a right mass, as these did without a reserve: 0.16 of the best
            assert metrics[name]["contour_error_rms"] < 0.3 * other["contour_error_rms"]
    ratio = metrics["mpcc"]["contour_error_rms"] / metrics["mpcc, precise"]["contour_error_rms"]
    assert ratio > 3.0
    assert metrics["mpcc, precise"]["cycle_time"] <= 1.02 * metrics["mpcc"]["cycle_time"]


MACHINES = {
    "meng": (cl.machines.published.meng_xy_stage, 0.1, 1e-3, 0.003),
    "hu": (cl.machines.published.hu_gantry, 0.2, 1e-3, 0.01),
    "el_khalick": (cl.machines.published.el_khalick_feed_drive, 0.03, 5e-3, 0.005),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_nothing_but_a_speed_need_be_set_on_a_published_machine(name):
    make, speed, sample_time, size = MACHINES[name]
    machine, contour = make(), FigureEight(half_sizes=(size, size))
    law = ModelPredictiveContouring(model=machine.nominal, speed_limit=speed)
    start = cl.feedrate.constant_feed(contour, feed=speed, sample_time=sample_time)
    run = cl.simulate(machine, law, start)
    assert run.status == "normal"
    # within a thousandth of the path's size, and no slower than twice the length over the speed
    assert run.metrics["contour_error_max"] < 1e-3 * size
    assert run.metrics["cycle_time"] < 2.0 * float(contour.length) / speed
    assert np.max(np.asarray(run["iterations"])) < 30


def drive():
    return Machine(
        names=("X", "Y"), dynamics=RigidAxes(mass=44.8844, viscous=278.255),
        drive=Drive(command="voltage", command_limit=20.0), sensor=Encoder(),
    )  # fmt: skip


def test_weights_six_decades_away_are_solved():
    """Each weight a million times more and less than by itself, all in one batch."""
    machine = drive()
    line = Line(start=(0.0, 0.0), end=(0.004, 0.002))
    law = ModelPredictiveContouring(model=machine.nominal, speed_limit=0.03, horizon=16)
    planner = law.bind(line, 5e-3).planner
    natural = {
        "contour_weight": float(planner.weights.contour),
        "lag_weight": float(planner.weights.lag),
        "command_change_weight": float(planner.weights.change[0]),
        "speed_change_weight": float(planner.weights.change[-1]),
    }
    law = cl.replace(law, **natural)
    vary = {name: [] for name in natural}
    for one in natural:
        for factor in (1e-6, 1e6):
            for name, value in natural.items():
                vary[name].append(value * (factor if name == one else 1.0))
    reference = cl.feedrate.constant_feed(line, feed=0.03, sample_time=5e-3)
    batch = cl.simulate_many(
        machine, law, reference, vary={f"controller.{k}": np.array(v) for k, v in vary.items()},
        metrics=["contour_error_max"], record=["status", "actual"],
    )  # fmt: skip
    status = np.asarray(batch["status"])
    assert not np.any(status == 3)  # no program without a solution
    error = dict(
        zip(((one, f) for one in natural for f in (1e-6, 1e6)),
            np.asarray(batch["contour_error_max"]), strict=True)
    )  # fmt: skip
    # With the contour error all but free, both axes start at their limit of 20 V and leave the
    # line; with the lag all but free, the tool overshoots the end along the line. With every
    # other weight there is nothing on a straight line to trade the contour error for.
    assert 1e-4 < error.pop(("contour_weight", 1e-6)) < 1e-3
    assert 1e-6 < error.pop(("lag_weight", 1e-6)) < 2e-4
    assert max(error.values()) < 1e-6
    # with any weight on the two errors it arrives; dear changes only slow it down
    last = np.asarray(batch["actual"])[:4, -1]
    assert np.max(np.linalg.norm(last - np.array([0.004, 0.002]), axis=-1)) < 1e-5


@pytest.mark.slow
def test_a_tighter_bound_costs_time_on_the_bracket():
    example = runpy.run_path(str(EXAMPLES / "bracket" / "trade_off.py"))
    rows = trade_off_rows(dict(example["trade_off"]((200.0, 50.0))))
    loose, tight = rows
    assert tight["cycle_time"] > loose["cycle_time"]
    assert tight["contour_error_max"] < 0.5 * loose["contour_error_max"]
    for row in rows:
        # the bound is of the plan: what the model does not know comes on top
        assert row["contour_error_max"] < 1.25 * row["bound"]
        assert row["beyond"] < 0.05
