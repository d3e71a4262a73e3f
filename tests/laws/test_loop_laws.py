"""Properties of the closed loop that hold for every control law on a linear machine."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab import controllers
from contourlab.contour_errors import OsculatingCircleEstimator, TangentEstimator
from contourlab.contours import Ellipse, Line
from contourlab.controllers import (
    AxisPid,
    AxisPredictive,
    Cascade,
    CrossCoupled,
    DirectAdaptiveRobust,
    FirstOrderTaskFrame,
    IntegralSlidingMode,
    IntegratedAdaptiveRobust,
    NaturalLocalTaskFrame,
    NewtonCrossCoupled,
    PredictiveContouring,
    VariableGainCrossCoupled,
)
from contourlab.machines import Drive, Encoder, Machine, RigidAxes
from contourlab.recordings import Reference


def stage(masses=(4.0, 4.0)):
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(mass=list(masses), viscous=[20.0, 20.0], gain=[1.0, 1.0]),
        drive=Drive(command="force"),
        sensor=Encoder(velocity="ideal"),
    )


def pid(model):
    return AxisPid.by_pole_placement(model, 20.0, derivative_cutoff_hz=200.0)


HORIZONS = {"prediction_horizon": 16, "control_horizon": 4}
LAWS = {
    "AxisPid": pid,
    "Cascade": lambda model: Cascade.by_bandwidth(model, 40.0, 60.0),
    "CrossCoupled": lambda model: CrossCoupled(
        axis=pid(model), estimator=OsculatingCircleEstimator(), kp=2e5, ki=1e6, kd=200.0
    ),
    "CrossCoupled, tangent": lambda model: CrossCoupled(
        axis=pid(model), estimator=TangentEstimator(), kp=2e5, kd=200.0
    ),
    # learning mass and friction of each axis prefers directions: only the disturbance is learned
    "DirectAdaptiveRobust": lambda model: DirectAdaptiveRobust.by_bandwidth(
        model, (15.0, 25.0), uncertainty=0.0, disturbance_limit=100.0
    ),
    "IntegratedAdaptiveRobust": lambda model: IntegratedAdaptiveRobust.by_bandwidth(
        model, (15.0, 25.0), uncertainty=0.0, disturbance_limit=100.0
    ),
    "FirstOrderTaskFrame": lambda model: FirstOrderTaskFrame(
        model=model, bandwidth_hz=(15.0, 40.0)
    ),
    # the layer is never left: saturation of each axis by itself prefers directions
    "IntegralSlidingMode": lambda model: IntegralSlidingMode(
        model=model,
        error_rate=60.0,
        integral_rate=60.0,
        boundary_layer=1.0,
        disturbance_bound=200.0,
    ),
    "NaturalLocalTaskFrame": lambda model: NaturalLocalTaskFrame(
        model=model, bandwidth_hz=(15.0, 40.0)
    ),
    "NewtonCrossCoupled": lambda model: NewtonCrossCoupled(
        axis=pid(model), guard=1e-4, kp=20.0, ki=100.0, kd=0.02, derivative_cutoff_hz=200.0
    ),
    "VariableGainCrossCoupled": lambda model: VariableGainCrossCoupled(
        axis=pid(model), kp=2e5, ki=1e6, kd=200.0
    ),
    "AxisPredictive": lambda model: AxisPredictive(model=model, input_weight=1e-14, **HORIZONS),
    "PredictiveContouring": lambda model: PredictiveContouring(
        model=model, normal_input_weight=1e-14, tangential_input_weight=1e-13, **HORIZONS
    ),
}
MACHINE = stage()
OWN_TESTS = ("ModelPredictiveContouring", "InternalModelContouring", "PositionDomainPid")


def test_no_law_is_left_out():
    concrete = {
        name
        for name in controllers.__all__
        if isinstance(getattr(controllers, name), type)
        and issubclass(getattr(controllers, name), controllers.Controller)
        and name not in ("Controller", "AxisController", "TaskFrameController")
        # one plans its own time, for the others one axis leads: their tests are their own
        and name not in OWN_TESTS
    }
    assert concrete == {name.partition(",")[0] for name in LAWS}


def run(law, reference, machine=MACHINE):
    return cl.simulate(machine, LAWS[law](MACHINE.nominal), reference)


def along(contour, rate, duration, sample_time=1e-3, start=None):
    return cl.feedrate.constant_rate(
        contour, rate=rate, duration=duration, sample_time=sample_time, start=start
    )


def turned(values, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(values) @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("law", LAWS)
def test_a_turned_world_is_a_turned_run(law):
    """Equal axes: nothing prefers a direction."""
    plain = run(law, along(Ellipse(semi_axes=(0.03, 0.01)), 6.0, 0.4))
    angle = 0.7
    other = run(law, along(Ellipse(semi_axes=(0.03, 0.01), rotation=angle), 6.0, 0.4))
    # rounding, amplified by the loop over 400 steps
    assert_allclose(other["actual"], turned(plain["actual"], angle), rtol=0, atol=1e-13)
    assert_allclose(other["contour_error"], plain["contour_error"], rtol=0, atol=1e-13)


@pytest.mark.parametrize("law", LAWS)
def test_a_reversed_contour_changes_the_sign_alone(law):
    ellipse = Ellipse(semi_axes=(0.03, 0.01))
    forwards = run(law, along(ellipse, 6.0, 0.4, start=0.0))
    backwards = run(law, along(ellipse, -6.0, 0.4, start=0.0))
    mirror = np.array([1.0, -1.0])  # the ellipse is its own mirror image
    assert_allclose(backwards["actual"], np.asarray(forwards["actual"]) * mirror, atol=1e-15)
    # the sign is along the left normal of the contour, which did not turn round
    assert_allclose(backwards["contour_error"], forwards["contour_error"], rtol=0, atol=1e-15)


@pytest.mark.parametrize("law", LAWS)
def test_equal_axes_keep_on_a_line(law):
    recording = run(law, along(Line(start=(0.0, 0.0), end=(0.03, 0.02)), 0.03, 0.5))
    assert recording.metrics["tracking_error_max"] > 1e-6
    assert recording.metrics["contour_error_max"] < 1e-15


@pytest.mark.parametrize("law", LAWS)
def test_one_axis_slower_leaves_the_line_and_the_coupling_pulls_it_back(law):
    reference = along(Line(start=(0.0, 0.0), end=(0.03, 0.02)), 0.03, 0.5)
    recording = run(law, reference, stage((4.0, 5.0)))
    assert recording.metrics["contour_error_max"] > 1e-6
    if "CrossCoupled" in law:
        alone = run("AxisPid", reference, stage((4.0, 5.0)))
        assert recording.metrics["contour_error_rms"] < 0.8 * alone.metrics["contour_error_rms"]


@pytest.mark.parametrize("law", LAWS)
def test_nothing_moves_at_zero_feed(law):
    n = 50
    zero = np.zeros(n)
    reference = Reference.along(
        Ellipse(semi_axes=(0.03, 0.01)), sample_time=1e-3, parameter=np.full(n, 0.3),
        parameter_rate=zero, parameter_acceleration=zero, parameter_jerk=zero,
    )  # fmt: skip
    recording = run(law, reference)
    assert_allclose(recording["actual"], np.asarray(reference.position), rtol=0, atol=0)
    assert_allclose(recording["command"], 0.0, atol=0)


@pytest.mark.parametrize("law", ["AxisPid", "Cascade"])
def test_finer_sampling_converges(law):
    """Towards the continuous loop at least linearly: the difference halves or better."""
    ends = [
        np.asarray(run(law, along(Ellipse(semi_axes=(0.03, 0.01)), 6.0, 0.2, dt))["actual"])[-1]
        for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4)
    ]
    steps = [np.linalg.norm(b - a) for a, b in itertools.pairwise(ends)]
    slopes = np.log2(np.array(steps[:-1]) / steps[1:])
    assert (slopes > 0.8).all(), slopes
