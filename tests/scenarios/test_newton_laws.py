"""Sliding mode, Newton and variable-gain coupling from scenarios, in the plane and in space."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers import IntegralSlidingMode, NewtonCrossCoupled
from contourlab.errors import ContourlabError
from contourlab.scenarios import read_scenario_text

PLANE = """
[part]
formula = "ellipse"
semi_axes = ["30 mm", "10 mm"]
[feed]
kind = "constant_feed"
feed = "20 mm/s"
duration = "0.2 s"
[machine]
name = "ghaffari_two_axes"
[simulation]
sample_time = "0.2 ms"
[[controller]]
name = "sliding"
type = "integral_sliding_mode"
error_rate = 12.5
integral_rate = [12.5, 11.1]
boundary_layer = "1 mm/s"
disturbance_bound = 0.15
"""
NEWTON = """
[[controller]]
name = "newton"
type = "newton_cross_coupled"
guard = "3 um"
kp = 1.0
ki = 10.0
kd = 0.1
derivative_cutoff_hz = 16.0
[controller.axis]
type = "integral_sliding_mode"
tuning = "bandwidth"
bandwidth_hz = 2.0
disturbance_bound = 0.2
disturbance_estimate = "matched"
"""
VARIABLE = """
[[controller]]
type = "variable_gain_cross_coupled"
kp = 8e3
ki = 80e3
kd = 600.0
derivative_cutoff_hz = 16.0
[controller.axis]
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 3.0
"""
SPACE = PLANE.replace("ghaffari_two_axes", "ghaffari_three_axes").replace(
    'formula = "ellipse"\nsemi_axes = ["30 mm", "10 mm"]',
    'formula = "helix"\nradius = "20 mm"\npitch = "10 mm"\nturns = 2.0',
).replace("[12.5, 11.1]", "11.0")  # fmt: skip


def test_all_of_them_in_the_plane():
    read = read_scenario_text(PLANE + NEWTON + VARIABLE)
    comparison = read.compare()
    errors = {name: run.metrics["contour_error_max"] for name, run in comparison.recordings.items()}
    assert list(errors) == ["sliding", "newton", "variable_gain_cross_coupled"]
    assert all(np.isfinite(value) for value in errors.values())
    assert errors["newton"] < 0.1 * errors["sliding"]


def test_in_space_without_the_planar_law():
    comparison = read_scenario_text(SPACE + NEWTON).compare()
    errors = [run.metrics["contour_error_max"] for run in comparison.recordings.values()]
    assert errors[1] < 0.1 * errors[0]
    (setup,) = read_scenario_text(SPACE + VARIABLE).setups.values()
    assert "law for the plane" in str(setup.refused["variable_gain_cross_coupled"])


def test_fields_are_those_of_the_scenario():
    controllers = read_scenario_text(PLANE + NEWTON).controllers
    sliding, newton = controllers.values()
    assert isinstance(sliding, IntegralSlidingMode)
    assert_allclose(sliding.boundary_layer, 1e-3)
    assert isinstance(newton, NewtonCrossCoupled)
    assert_allclose(newton.guard, 3e-6)


def test_a_gain_that_is_too_small_is_refused_with_its_line():
    text = PLANE + "switching_gain = 150.0\n"
    with pytest.raises(ContourlabError, match=r"switching_gain of axis 0 .* must be >= 198"):
        read_scenario_text(text)
