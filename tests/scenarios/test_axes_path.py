"""A part in the space of the axes: stage and scanner from a scenario."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.combined import CombinedAxes
from contourlab.errors import ScenarioError
from contourlab.scenarios import read_scenario_text

EXAMPLE = (Path(__file__).parents[2] / "examples" / "macro_micro.toml").read_text()
SHORT = EXAMPLE.replace('duration = "6 s"', 'duration = "1 s"')


def test_stage_and_scanner_are_compared():
    scenario = read_scenario_text(SHORT)
    contour = scenario.reference.contour
    assert isinstance(contour, CombinedAxes)
    assert (scenario.reference.n_axes, contour.n_axes) == (4, 2)
    found = scenario.compare()
    rms = found.metric("contour_error_max")
    late = {
        name: recording.metrics_between(0.5, 1.0)["contour_error_rms"]
        for name, recording in found.recordings.items()
    }
    assert set(rms) == {"axis_pid", "internal_model_contouring"}
    assert late["internal_model_contouring"] < 0.1 * late["axis_pid"]
    attributes = found.recordings["internal_model_contouring"].dataset.attrs
    assert attributes["master"].startswith("axis 0, the slowest")


def test_a_constant_feed_is_that_of_the_tool():
    text = SHORT.replace('kind = "constant_rate"', 'kind = "constant_feed"').replace(
        "rate = 0.6283185307179586", 'feed = "30 mm/s"'
    )
    reference = read_scenario_text(text).reference
    tool = np.asarray(reference.velocity) @ np.asarray(reference.contour.matrix).T
    assert_allclose(np.linalg.norm(tool, axis=1), 0.03, rtol=1e-9)


def by_axes(law):
    return f"{EXAMPLE.split('[[controller]]')[0]}[[controller]]\n{law}\n"


GAINS = "axis = { type = 'axis_pid', kp = 1e3 }\nkp = 1e3\nestimator = 'tangent'"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (by_axes(f"type = 'cross_coupled'\n{GAINS}"), "4 axes share 2 coordinates.*position dom"),
        (
            by_axes("type = 'first_order_task_frame'\nbandwidth_hz = [10, 10]"),
            "axes that share a coordinate would share a correction",
        ),
        (EXAMPLE.replace("n_axes = 4\n", "").replace(
            '"10 mm", "10 mm", "1 mm", "1 mm"', '"10 mm", "10 mm"'
        ).replace("[1, 1, 20, 20]", "[1, 1]").replace(
            '"90 deg", "0 deg", "90 deg", "0 deg"', '"90 deg", "0 deg"'
        ), "'axes' is for machines whose tool is a combination"),
        (EXAMPLE.replace('"1 mm", "1 mm"]', '"1 mm"]').replace("20, 20]", "20]").replace(
            '"90 deg", "0 deg"]', '"90 deg"]'
        ), "the formula has 3 coordinates, and the machine 4 axes"),
        (EXAMPLE.replace(
            'kind = "constant_rate"\nrate = 0.6283185307179586       # rad/s: one round in 10 s\n'
            'duration = "6 s"', 'kind = "programmed"'
        ), "'programmed' is planned by limits of the tool's coordinates"),
        (EXAMPLE.replace('space = "axes"', 'space = "joints"'), "space"),
        (
            f'[part]\nfile = "part.csv"\nspace = "axes"\n[feed]{EXAMPLE.split("[feed]")[1]}',
            "goes with formula: files are paths of the tool",
        ),
    ],
)  # fmt: skip
def test_mistakes_are_named(text, message):
    with pytest.raises(ScenarioError, match=message):
        read_scenario_text(text)
