"""Predictive laws: the contract, against each other, and where references end."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Circle, Line, Path
from contourlab.controllers import AxisPredictive, PredictiveContouring
from contourlab.machines import Drive, Machine, RigidAxes, StepDisturbance
from contourlab.machines.base import NominalModel
from contourlab.recordings import Reference
from contourlab.testing.controllers import check_controller
from contourlab.testing.samples import make_samples, sample_at

from .predictive_material import (
    BESIDE,
    INPUTS,
    PLAIN,
    SMALL,
    TILTED,
    T,
    by_axis,
    circle_reference,
    law,
    model,
    run,
    stage,
)

# -- the contract -----------------------------------------------------------------------------


EVERY_FIELD = {
    "prediction_horizon": 4, "control_horizon": 2, "disturbance_polynomial": (1.0, -0.3),
    "noise_polynomial": (1.0, -0.4), "servo_polynomial": (1.2, -0.3),
    "input_filter_numerator": (0.7, -0.6), "input_filter_denominator": (1.0, -0.5),
    "holding_polynomial": (1.0, -0.8), "friction_compensation": 0.7, "friction_velocity": 0.02,
}  # fmt: skip


@pytest.mark.overnight
@pytest.mark.slow
def test_conformance():
    told = model(2, coulomb=0.3, limit=1e6, stiffness=np.array([300.0, 200.0]))
    inputs = {"normal_input_weight": 1e-8, "tangential_input_weight": 1e-9}
    check_controller(
        PredictiveContouring(model=told, **inputs, **EVERY_FIELD),
        contour=Circle(radius=0.02), sample_time=T,
        inert={"form"},  # two forms of one law
    )  # fmt: skip


@pytest.mark.overnight
@pytest.mark.slow
def test_conformance_of_the_axis_law():
    told = model(2, coulomb=0.3, limit=1e6)
    check_controller(
        AxisPredictive(model=told, input_weight=1e-8, **EVERY_FIELD),
        contour=Circle(radius=0.02), sample_time=T,
        inert={"form"},  # likewise
    )  # fmt: skip


def primitives(jaxpr):
    """Return every primitive of a jaxpr and of those inside it, with its parameters."""
    for equation in jaxpr.eqns:
        yield equation.primitive.name, equation.params
        for value in jax.tree.leaves(list(equation.params.values()), is_leaf=is_jaxpr):
            if is_jaxpr(value):
                yield from primitives(getattr(value, "jaxpr", value))


def is_jaxpr(value):
    return hasattr(value, "eqns") or hasattr(value, "jaxpr")


ARITHMETIC = {
    "abs", "add", "and", "broadcast_in_dim", "clamp", "concatenate", "convert_element_type",
    "copy", "cumsum", "div", "dot_general", "dynamic_slice", "dynamic_update_slice", "eq", "exp",
    "gather", "ge", "gt", "integer_pow", "iota", "is_finite", "jit", "le", "lt", "max", "min",
    "mul", "ne", "neg", "not", "or", "pad", "pjit", "reduce_and", "reduce_max", "reduce_or",
    "reduce_sum", "reshape", "rev", "scan", "select_n", "sign", "slice", "sqrt", "square",
    "squeeze", "stop_gradient", "sub", "tanh", "transpose", "custom_jvp_call",
}  # fmt: skip
"""Of fixed size and fixed length: no LAPACK, no sorting, no loop without an end."""


@pytest.mark.parametrize("fields", [{}, {"angle": "single"}, {"form": "independent"}, {"n": 3}])
@pytest.mark.parametrize("kind", [PredictiveContouring, AxisPredictive])
def test_a_step_has_nothing_that_cannot_be_exported(kind, fields):
    fields = dict(fields)
    n = fields.pop("n", 2)
    contour = Circle(radius=0.02) if n == 2 else TILTED
    if kind is AxisPredictive:
        fields.pop("angle", None)
    controller = law(n, **fields) if kind is PredictiveContouring else by_axis(n, **fields)
    bound = controller.bind(contour, T)
    sample = sample_at(make_samples(contour, 60, T, controller.needs), 0)
    step = jax.make_jaxpr(bound.step)(bound.init(sample), sample)
    used = dict(primitives(step.jaxpr))
    assert set(used) <= ARITHMETIC
    assert ("scan" in used) == (kind is PredictiveContouring)  # the search goes into what is inside
    solving = jax.make_jaxpr(lambda m: jnp.linalg.solve(m, m))(jnp.eye(2))
    assert not set(dict(primitives(solving.jaxpr))) <= ARITHMETIC


# -- the minimiser of (10) ---------------------------------------------------------------------


# -- the laws among each other -----------------------------------------------------------------


FORCES = tuple(StepDisturbance(axis=k, amplitude=5.0 - 12.0 * k, start=0.3) for k in (0, 1))


@pytest.fixture(scope="module")
def free_of_offset():
    return run(law(), disturbances=FORCES)


def test_the_forms_are_one_law(free_of_offset):
    other = run(law(form="independent"), disturbances=FORCES)
    # 200 steps; the model beside runs away by centimetres, and loses its digits
    scale = float(np.max(np.abs(other["command"])))
    assert_allclose(other["command"], free_of_offset["command"], rtol=0, atol=1e-9 * scale)


def test_equal_weights_leave_every_axis_to_itself():
    even = {"contour_weight": 1.0, "normal_input_weight": 1e-9, "tangential_input_weight": 1e-9}
    one = run(law(**even), disturbances=FORCES)
    other = run(AxisPredictive(model=model(), input_weight=1e-9, **SMALL), disturbances=FORCES)
    scale = float(np.max(np.abs(one["command"])))
    assert_allclose(other["command"], one["command"], rtol=0, atol=1e-10 * scale)
    assert np.max(np.abs(one["contour_error"])) > 1e-7


def test_on_a_line_only_the_ratio_of_weights_across_it_counts():
    """With equal axes J splits into two problems, one across the line and one along it."""
    even = NominalModel(
        mass=np.full(2, 45.0), viscous=np.full(2, 279.0), coulomb=np.zeros(2), gain=np.ones(2),
        command_limit=np.full(2, np.inf), command="force",
    )  # fmt: skip
    machine = Machine(
        names=("X", "Y"), dynamics=RigidAxes(mass=45.0, viscous=279.0), drive=Drive(command="force")
    )
    reference = cl.feedrate.constant_feed(
        Line(start=(0.0, 0.0), end=(0.03, 0.02)), feed=0.03, sample_time=T
    )
    heavy, light = (
        run(law(told=even, **fields), machine, reference=reference, disturbances=FORCES)
        for fields in (
            {"contour_weight": 10.0, "normal_input_weight": 1e-9},
            {"contour_weight": 1.0, "normal_input_weight": 1e-10},
        )
    )
    assert np.max(np.abs(heavy["contour_error"])) > 1e-7
    assert_allclose(heavy["contour_error"], light["contour_error"], rtol=0, atol=1e-15)


def test_a_constant_force_leaves_no_error_only_with_the_integrator(free_of_offset):
    reference = cl.feedrate.constant_feed(
        Line(start=(0.0, 0.0), end=(0.03, 0.02)), feed=0.03, sample_time=T
    )
    removed, left = (
        run(law(**fields), reference=reference, disturbances=FORCES[:1]) for fields in ({}, PLAIN)
    )
    late = slice(180, 220)
    assert np.max(np.abs(removed["contour_error"][late])) < 1e-10
    assert np.min(np.abs(left["contour_error"][late])) > 1e-7


def test_what_was_clipped_is_what_is_remembered():
    """The model beside the machine shows what the machine does, limits or not."""
    controller = law(form="independent", told=model(limit=20.0))
    reference = circle_reference(rate=0.5, duration=0.5)
    recording = run(controller, stage(command_limit=20.0), reference=reference)
    assert np.max(np.abs(recording["command"])) == 20.0
    assert set(np.asarray(recording["status"])) == {0, 1}
    bound = controller.bind(reference.contour, T)
    samples = make_samples(
        reference.contour, 101, T, controller.needs, reference=reference, error=np.zeros(2)
    )
    state = bound.init(sample_at(samples, 0))
    history, actual = state.history, np.asarray(recording["actual"])
    for k in range(100):
        history, _ = bound.predictor.measured(history, actual[k])
        history = bound.predictor.applied(history, np.asarray(recording["command"])[k])
    # (y - y_m) / C is nothing: rounding of 100 steps
    assert_allclose(history.outputs, 0.0, atol=1e-13)
    step = jax.jit(lambda state, sample: bound.step(state, sample))
    for k in range(100):
        sample = sample_at(samples, k)
        sample = jax.tree.map(lambda x: x, sample)
        object.__setattr__(sample, "position", jnp.asarray(actual[k]))
        _, state = step(state, sample)
    assert_allclose(state.history.inputs, history.inputs, rtol=1e-12)


def test_the_delay_of_a_drive_is_foreseen():
    late = stage(computing_delay=2.0 * T)
    known, unknown = (run(law(delay=delay), late) for delay in (2, 0))
    assert known.metrics_between(0.5, 1.1)["contour_error_rms"] < 5e-6
    assert unknown.diverged


def test_friction_is_compensated_along_the_reference():
    nominal = model(coulomb=4.0)
    machine = Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=nominal.mass, viscous=nominal.viscous,
            friction=cl.machines.Friction(coulomb=4.0, smoothing_velocity=1e-3),
        ),
        drive=Drive(command="force"),
    )  # fmt: skip
    error = [
        run(law(told=nominal, friction_compensation=share), machine).metrics_between(0.5, 1.1)
        for share in (1.0, 0.0)
    ]
    # what is left is the held command's on the curve
    assert error[0]["contour_error_max"] < 0.4 * error[1]["contour_error_max"]


# -- references --------------------------------------------------------------------------------


def test_a_reference_shorter_than_the_horizon_ends_at_rest():
    n = 120
    parameter = np.minimum(np.arange(n) * 0.05, 0.2)  # moves for 4 samples, then stands
    rate = np.where(np.arange(n) < 4, 0.05 / T, 0.0)
    zero = np.zeros(n)
    reference = Reference.along(
        Circle(radius=0.02), sample_time=T, parameter=parameter, parameter_rate=rate,
        parameter_acceleration=zero, parameter_jerk=zero,
    )  # fmt: skip
    recording = run(law(), reference=reference)
    assert set(np.asarray(recording["status"])) == {0}
    assert_allclose(recording["actual"][-20:], np.asarray(reference.position)[-20:], atol=1e-8)


@pytest.mark.parametrize("make", [law, by_axis])
@pytest.mark.parametrize("n", [2, 6])
def test_a_moving_reference_that_ends_within_the_horizon_is_one_that_stops_there(make, n):
    moving = circle_reference(duration=(n - 1) * T)
    assert moving.n_samples == n
    k = np.minimum(np.arange(40), n - 1)
    rate = np.where(np.arange(40) < n, np.asarray(moving.parameter_rate)[k], 0.0)
    zero = np.zeros(40)
    standing = Reference.along(
        moving.contour, sample_time=T, parameter=np.asarray(moving.parameter)[k],
        parameter_rate=rate, parameter_acceleration=zero, parameter_jerk=zero,
    )  # fmt: skip
    cut, whole = run(make(), reference=moving), run(make(), reference=standing)
    assert_allclose(cut["command"], whole["command"][:n], rtol=1e-12)
    assert np.all(np.isfinite(cut["command"]))
    said = [text for text in cut.warnings if "the reference ends at 0.08 m/s" in text]
    assert len(said) == 1
    assert f"in the last {min(9, n) * T:g} s" in said[0]
    assert not any("the reference ends" in text for text in whole.warnings)


def test_without_direction_every_error_counts_as_one_across():
    bound = law().bind(Circle(radius=0.02), T)
    samples = make_samples(Circle(radius=0.02), 60, T, law().needs)
    sample = sample_at(samples, 30)
    still = jax.tree.map(lambda x: x, sample)
    for point in (still.reference, still.preview):
        object.__setattr__(point, "velocity", jnp.zeros_like(point.velocity))
    even = law(lag_weight=10.0, tangential_input_weight=INPUTS["normal_input_weight"])
    other = even.bind(Circle(radius=0.02), T)
    command, state = bound.step(bound.init(sample), still)
    wanted, _ = other.step(other.init(sample), sample)
    assert_allclose(command, wanted, rtol=1e-12)
    error = sample.reference.position - sample.position
    assert_allclose(state.estimate, error, rtol=1e-15)


def test_corners_are_nothing_special():
    square = Path.polyline(np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 0.01]]))
    reference = cl.feedrate.constant_feed(square, feed=0.02, sample_time=T)
    recording = run(law(), reference=reference)
    assert not recording.diverged
    assert recording.metrics["contour_error_max"] < 1e-3


def test_an_open_loop_says_so():
    controller = law(**BESIDE, disturbance_integrators=0)
    recording = run(controller, reference=circle_reference(duration=0.1))
    assert set(np.asarray(recording["status"])) == {2}
    assert any("open loop" in text for text in recording.warnings)
