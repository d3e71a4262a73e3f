"""Every estimator can be named in a scenario, with its options, and closes a loop."""

import numpy as np
import pytest

import contourlab as cl
from contourlab.errors import ContourlabError
from contourlab.scenarios import read_scenario_text, registry

SCENARIO = """
[part]
formula = "ellipse"
semi_axes = ["30 mm", "10 mm"]

[feed]
kind = "constant_rate"
rate = 5.0
duration = "0.2 s"

[machine]
command = "force"
velocity = "ideal"

[[machine.axis]]
name = "X"
mass = 5.0
viscous = 20.0

[[machine.axis]]
name = "Y"
mass = 3.0
viscous = 15.0

[[controller]]
name = "coupled"
type = "cross_coupled"
estimator = {estimator}
kp = 2.0e5
kd = 200.0
derivative_cutoff_hz = 500

[controller.axis]
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 15
"""
OPTIONS = {
    "extended_natural_local": '{ type = "extended_natural_local", perpendicular = true }',
    "foot_point": '{ type = "foot_point", near = "last_foot" }',
    "newton": '{ type = "newton", form = "projected", convergence_rate = 800, filter_rate = 2000 }',
}


def controller_of(estimator):
    scenario = read_scenario_text(SCENARIO.replace("{estimator}", estimator))
    return scenario, scenario.controllers["coupled"]


def test_every_estimator_closes_a_loop_that_keeps_nearer_to_the_path():
    scenario, law = controller_of('"tangent"')
    alone = cl.simulate(scenario.machine, law.axis, scenario.reference)
    alone = float(alone.metrics["contour_error_max"])
    for name, cls in registry.estimators().items():
        scenario, law = controller_of(OPTIONS.get(name, f'"{name}"'))
        assert type(law.estimator) is cls
        recording = cl.simulate(scenario.machine, law, scenario.reference)
        assert recording.metrics["contour_error_max"] < 0.5 * alone, name
        estimate = np.linalg.norm(recording["contour_error_estimate"], axis=1)
        off = np.max(np.abs(estimate - np.abs(np.asarray(recording["contour_error"]))))
        lag = float(recording.metrics["tracking_error_max"])
        if name == "newton":  # it misses by its own lag, V/k', here 5/s * 30 mm / 800/s
            lag = 0.15 / 800.0
        # κ t² / 2 with the largest curvature, 300 per metre: what the tangent may be off
        assert off < (1e-14 if name == "foot_point" else 300.0 * lag**2 / 2.0), name


def test_options_reach_the_estimator():
    newton = controller_of(OPTIONS["newton"])[1].estimator
    assert (newton.form, float(newton.convergence_rate)) == ("projected", 800.0)
    assert controller_of(OPTIONS["extended_natural_local"])[1].estimator.perpendicular is True
    assert controller_of(OPTIONS["foot_point"])[1].estimator.near == "last_foot"


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        ('{ type = "newton", form = "exact" }', "converged"),
        ('{ type = "newton", gain = 3 }', "convergence_rate"),
        ('{ type = "newton", filter_rate = 3 }', "filter_rate has no effect"),
        ('"newtons"', "newton"),
    ],
)
def test_mistakes_are_named_with_the_choices(estimator, message):
    with pytest.raises(ContourlabError, match=message):
        controller_of(estimator)
