"""Both predictive laws from scenarios: the shipped example, in space, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers import AxisPredictive, PredictiveContouring
from contourlab.errors import ContourlabError
from contourlab.scenarios import read_scenario, read_scenario_text

EXAMPLE = Path(__file__).parents[2] / "examples" / "predictive" / "figure_eight.toml"
SPACE = """
[part]
formula = "helix"
radius = "5 mm"
pitch = "2 mm"
turns = 1.0
[feed]
kind = "constant_feed"
feed = "360 mm/min"
duration = "1 s"
[machine]
name = "el_khalick_feed_drive"
n_axes = 3
[simulation]
sample_time = "5 ms"
[[controller]]
name = "by axis"
type = "axis_predictive"
input_weight = [1e-11, 1e-11, 2e-11]
noise_polynomial = [1.0, -0.5]
[[controller]]
name = "contour"
type = "predictive_contouring"
normal_input_weight = 1e-12
tangential_input_weight = 1e-11
angle = "single"
form = "independent"
prediction_horizon = 16
control_horizon = 8
holding_polynomial = [1.0, -2.0, 1.0]
input_filter_numerator = [1.0]
disturbance_integrators = 0
"""


def test_the_example_compares_both_laws():
    scenario = read_scenario(EXAMPLE)
    recordings = scenario.compare().recordings
    assert list(recordings) == ["by axis", "contour", "contour, light"]
    error = []
    for recording in recordings.values():
        assert recording.status == "normal"
        assert recording.dataset.sizes["time"] > 1500  # once around
        error.append(recording.metrics_between(1.0, 7.5)["contour_error_rms"])
    # what the page of the laws says of this run: each less than half of the one before
    assert error[1] < 0.5 * error[0]
    assert error[2] < 0.5 * error[1]


def test_three_axes_with_polynomials_of_their_own():
    scenario = read_scenario_text(SPACE, name="s.toml")
    by_axis, contour = scenario.controllers.values()
    assert isinstance(by_axis, AxisPredictive)
    assert isinstance(contour, PredictiveContouring)
    assert contour.horizons == (1, 16, 8, 16)
    assert_allclose(contour.holding_polynomial, [1.0, -2.0, 1.0])
    assert (contour.angle, contour.form) == ("single", "independent")
    for recording in scenario.compare().recordings.values():
        assert recording.dataset.sizes["axis"] == 3
        assert np.max(np.abs(recording["contour_error"])[100:]) < 1e-5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("control_horizon = 8", "control_horizon = 17", "control_horizon must be <= prediction_h"),
        ("normal_input_weight = 1e-12", "normal_input_weight = -1e-12", "normal_input_weight must"),
        ('angle = "single"', 'angle = "both"', "angle must be one of the allowed values, got"),
        ("[1e-11, 1e-11, 2e-11]", "[1e-11, 2e-11]", "input_weight must be one number or one for"),
    ],
)
def test_what_cannot_be_is_named(old, new, message):
    with pytest.raises(ContourlabError, match=message):
        read_scenario_text(SPACE.replace(old, new, 1), name="s.toml").compare()
