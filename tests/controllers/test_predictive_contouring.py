"""Predictive laws: against brute force, closed forms, each other, and what they refuse."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Circle, Ellipse, Line, Path
from contourlab.controllers import AxisPredictive, PredictiveContouring
from contourlab.controllers.held_model import held_polynomials
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines import Drive, Machine, RigidAxes, StepDisturbance
from contourlab.machines.base import NominalModel
from contourlab.recordings import Reference
from contourlab.testing.controllers import check_controller
from contourlab.testing.protocol import outputs
from contourlab.testing.samples import make_samples, sample_at

from . import predictive_judge as judge

T = 5e-3
SMALL = {"prediction_horizon": 9, "control_horizon": 3}
WEIGHTS = {"contour_weight": 10.0, "lag_weight": 1.0}
INPUTS = {"normal_input_weight": 1e-9, "tangential_input_weight": 1e-10}
PLAIN = {"disturbance_integrators": 0, "input_filter_numerator": (1.0,)}
BESIDE = {"form": "independent", "disturbance_plant": False}


def model(n=2, *, stiffness=None, limit=np.inf, coulomb=0.0):
    return NominalModel(
        mass=np.array([45.0, 44.9, 60.0])[:n], viscous=np.array([279.0, 280.0, 200.0])[:n],
        coulomb=np.full(n, coulomb), gain=np.ones(n), command_limit=np.full(n, limit),
        command="force", stiffness=stiffness,
    )  # fmt: skip


def law(n=2, *, told=None, **changes):
    return PredictiveContouring(model=told or model(n), **(SMALL | WEIGHTS | INPUTS | changes))


def stage(n=2, **drive):
    nominal = model(n)
    return Machine(
        names=("X", "Y", "Z")[:n],
        dynamics=RigidAxes(mass=nominal.mass, viscous=nominal.viscous),
        drive=Drive(command="force", **drive),
    )


def circle_reference(rate=4.0, duration=1.2):
    return cl.feedrate.constant_rate(
        Circle(radius=0.02), rate=rate, duration=duration, sample_time=T
    )


# -- the contract -----------------------------------------------------------------------------


EVERY_FIELD = {
    "prediction_horizon": 4, "control_horizon": 2, "disturbance_polynomial": (1.0, -0.3),
    "noise_polynomial": (1.0, -0.4), "servo_polynomial": (1.2, -0.3),
    "input_filter_numerator": (0.7, -0.6), "input_filter_denominator": (1.0, -0.5),
    "holding_polynomial": (1.0, -0.8), "friction_compensation": 0.7, "friction_velocity": 0.02,
}  # fmt: skip


@pytest.mark.slow
def test_conformance():
    told = model(2, coulomb=0.3, limit=1e6, stiffness=np.array([300.0, 200.0]))
    inputs = {"normal_input_weight": 1e-8, "tangential_input_weight": 1e-9}
    check_controller(
        PredictiveContouring(model=told, **inputs, **EVERY_FIELD),
        contour=Circle(radius=0.02), sample_time=T,
        inert={"form"},  # two forms of one law
    )  # fmt: skip


@pytest.mark.slow
def test_conformance_of_the_axis_law():
    told = model(2, coulomb=0.3, limit=1e6)
    check_controller(
        AxisPredictive(model=told, input_weight=1e-8, **EVERY_FIELD),
        contour=Circle(radius=0.02), sample_time=T,
        inert={"form"},  # likewise
    )  # fmt: skip


def test_a_step_has_nothing_that_cannot_be_exported():
    bound = law().bind(Circle(radius=0.02), T)
    sample = sample_at(make_samples(Circle(radius=0.02), 60, T, law().needs), 0)
    text = str(jax.make_jaxpr(bound.step)(bound.init(sample), sample))
    for name in ("cholesky", "lu", "triangular_solve", "qr", "eigh", "svd", "while", "sort"):
        assert f" {name}[" not in text, name


# -- the minimiser of (10) ---------------------------------------------------------------------


CASES = {
    "free of offset": {},
    "every polynomial": {
        "noise_polynomial": (1.0, -1.2, 0.4), "servo_polynomial": (1.2, -0.3),
        "input_filter_numerator": (0.7, -0.6), "input_filter_denominator": (1.0, -0.5),
        "holding_polynomial": (1.0, -1.5, 0.56), "delay": 2, "minimum_horizon": 2,
        "disturbance_polynomial": (1.0, -0.9), "stiffness": np.array([2000.0, 3000.0]),
    },
    "past commands hold": {
        "control_horizon": 1, "holding_polynomial": (1.0, -1.5, 0.56),
        "servo_polynomial": (1.0, 0.2, 0.1), **PLAIN,
    },
    "beside the plant": {**BESIDE, "noise_polynomial": (1.0, -0.5), "delay": 1, "n": 3},
    "one angle": {"angle": "single", "form": "independent"},
}  # fmt: skip


def brute_force(controller, contour, samples, commands, k):
    """Return what the first command at sample k has to be, from rest at the first sample."""
    numerator, denominator = (np.asarray(p) for p in controller.plant(T))
    position = np.asarray(samples.position)
    origin, n = position[0], controller.n_axes
    still = controller.model.stiffness is not None
    holding = np.asarray(controller.model.stiffness) * origin if still else np.zeros(n)
    polynomial = {
        name: np.asarray(getattr(controller, name))
        for name in (
            "noise_polynomial", "servo_polynomial", "input_filter_numerator",
            "input_filter_denominator", "holding_polynomial", "disturbance_polynomial",
        )
    }  # fmt: skip
    axes = []
    for axis in range(n):
        d = polynomial["disturbance_polynomial"]
        for _ in range(controller.disturbance_integrators):
            d = np.convolve(d, (1.0, -1.0))
        if controller.disturbance_plant:
            d = np.convolve(d, denominator[axis])
        axes.append(
            judge.Axis(
                denominator[axis], np.append(np.zeros(controller.delay), numerator[axis]),
                polynomial["noise_polynomial"], d, polynomial["servo_polynomial"],
                polynomial["input_filter_numerator"], polynomial["input_filter_denominator"],
                polynomial["holding_polynomial"], commands[:k, axis] - holding[axis],
                position[: k + 1, axis] - origin[axis],
            )
        )  # fmt: skip
    sample = sample_at(samples, k)
    velocity = np.vstack([sample.reference.velocity, sample.preview.velocity])
    if controller.angle == "single":
        velocity[:] = velocity[0]
    q_1 = np.sum(polynomial["input_filter_numerator"]) / np.sum(
        polynomial["input_filter_denominator"]
    )
    free = judge.minimise(
        axes, np.asarray(sample.preview.position) - origin,
        velocity / np.linalg.norm(velocity, axis=1)[:, None],
        (10.0, 1.0, *INPUTS.values()),
        (controller.minimum_horizon, controller.prediction_horizon, controller.control_horizon),
        controller.delay, q_1 * holding,
    )  # fmt: skip
    return free[:, 0] + holding


@pytest.mark.parametrize("case", CASES)
def test_the_command_is_the_brute_force_minimiser(case):
    fields = dict(CASES[case])
    n = fields.pop("n", 2)
    controller = law(n, told=model(n, stiffness=fields.pop("stiffness", None)), **fields)
    contour = Ellipse(semi_axes=(0.03, 0.01))
    if n == 3:
        contour = Circle(radius=0.02, center=(0.0, 0.01, 0.0), normal=(0.2, -0.3, 1.0))
    samples = make_samples(contour, 60, T, controller.needs)
    commands = np.asarray(outputs(controller.bind(contour, T), samples))
    for k in (0, 7, 40):
        if k == 0 and not np.any(np.asarray(samples.reference.velocity)[0]):
            continue  # no direction yet
        wanted = brute_force(controller, contour, samples, commands, k)
        # the judge solves a least squares problem of condition 1e3 and divides by A twice
        assert_allclose(commands[k], wanted, rtol=0, atol=1e-10 * np.max(np.abs(commands)))


def test_one_step_ahead_without_weights_arrives_at_once():
    """H_p = H_c = 1, ρ = 0: the next measured position is the next reference, after one sample."""
    short = {"prediction_horizon": 1, "control_horizon": 1}
    free = {"normal_input_weight": 0.0, "tangential_input_weight": 0.0}
    reference = circle_reference(duration=0.3)
    recording = cl.simulate(stage(), law(**short, **free), reference)
    # two roundings of b_0, amplified by the zero of B near -1
    assert_allclose(recording["actual"][1:], reference.position[1:], rtol=0, atol=1e-12)


# -- the laws among each other -----------------------------------------------------------------


def run(controller, machine=None, **settings):
    settings.setdefault("reference", circle_reference())
    return cl.simulate(machine or stage(), controller, **settings)


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
        history = bound.predictor.measured(history, actual[k])
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


# -- the sampled model -------------------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [None, 2000.0])
@pytest.mark.parametrize("viscous", [0.0, 279.0, 4e5])
def test_the_sampled_model_is_the_zero_order_hold(stiffness, viscous):
    from scipy.signal import cont2discrete

    told = NominalModel(
        mass=np.array([45.0]), viscous=np.array([viscous]), coulomb=np.zeros(1),
        gain=np.array([2.0]), command_limit=np.full(1, np.inf), command="force",
        stiffness=None if stiffness is None else np.array([stiffness]),
    )  # fmt: skip
    numerator, denominator = held_polynomials(told, T)
    b, a, _ = cont2discrete(([2.0], [45.0, viscous, stiffness or 0.0]), T)
    assert_allclose(denominator[0], a, rtol=1e-9, atol=1e-12)
    assert_allclose(numerator[0], b[0, 1:], rtol=1e-7, atol=1e-7 * np.max(b))


# -- refusals ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"prediction_horizon": 0}, "prediction_horizon must be a whole number >= 1, got 0"),
        ({"control_horizon": 10}, "control_horizon must be <= prediction_horizon - delay = 9"),
        ({"delay": 7}, "control_horizon must be <= prediction_horizon - delay = 2, got 3"),
        ({"delay": 9}, "delay must be < prediction_horizon = 9, got 9"),
        ({"minimum_horizon": 10}, "minimum_horizon must be <= prediction_horizon = 9, got 10"),
        ({"contour_weight": 0.0}, "contour_weight must be > 0, got 0"),
        ({"lag_weight": -1.0}, "lag_weight must be > 0, got -1"),
        ({"normal_input_weight": -1.0}, "normal_input_weight must be >= 0"),
        ({"tangential_input_weight": np.nan}, "tangential_input_weight must be finite"),
        ({"normal_input_weight": 0.0, "minimum_horizon": 8}, "control_horizon must be <= 2"),
        ({"disturbance_plant": False}, "form 'realigned' needs disturbance_plant=True"),
        ({"noise_polynomial": (1.0, -1.0)}, "noise_polynomial must have its roots inside"),
        ({"noise_polynomial": 1.0}, "noise_polynomial must list coefficients"),
        ({"input_filter_denominator": (1.0, -1.1)}, "input_filter_denominator must have its roots"),
        ({"holding_polynomial": (0.0, 1.0)}, "holding_polynomial must not begin with 0"),
        ({"plant_numerator": (1.0,)}, "plant_numerator and plant_denominator must be given tog"),
        (
            {"plant_numerator": (1.0, -1.0), "plant_denominator": (1.0, -1.0)},
            "plant_numerator must not add up to 0",
        ),
        ({"angle": "both"}, "angle must be one of the allowed values"),
    ],
)
def test_what_cannot_be_is_said(changes, message):
    with pytest.raises(ConfigurationError, match=message.replace("(", r"\(")):
        law(**changes)


def test_what_cannot_be_bound_is_said():
    contour = Circle(radius=0.02)
    with pytest.raises(RefusedError, match="needs one axis for each coordinate"):
        law(3).bind(contour, T)
    with pytest.raises(ConfigurationError, match="one for each of the 2 axes, got shape"):
        law(noise_polynomial=np.ones((3, 1))).bind(contour, T)
    with pytest.raises(ConfigurationError, match="sample_time must be > 0 s"):
        law().bind(contour, 0.0)
    told = cl.replace(model(), command="position")
    with pytest.raises(RefusedError, match="needs that loop as plant_numerator"):
        law(told=told)
    fields = {"plant_numerator": (0.3, 0.1), "plant_denominator": (1.0, -0.6)}
    assert law(told=told, **fields).needs.command == "position"
    with pytest.raises(ConfigurationError, match="model must be a NominalModel"):
        law(told=3.0)


def test_axes_may_have_polynomials_of_their_own():
    both = (1.0, -0.5), (1.0, -0.2)
    contour = Circle(radius=0.02)
    samples = make_samples(contour, 60, T, law().needs)

    def commands(**fields):
        even = {"contour_weight": 1.0, "normal_input_weight": 1e-9}
        even |= {"tangential_input_weight": 1e-9, "noise_polynomial": fields["c"]}
        return np.asarray(outputs(law(**even).bind(contour, T), samples))

    mixed = commands(c=both)
    for axis, own in enumerate(both):
        assert_allclose(mixed[:, axis], commands(c=own)[:, axis], rtol=1e-9)
