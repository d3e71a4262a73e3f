"""The adaptive robust laws: conformance, a step by hand, limits, bounds, mistakes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.configuration import replace
from contourlab.contours import Circle, Ellipse, Line, Path
from contourlab.controllers import (
    DirectAdaptiveRobust,
    FilteredLeastSquares,
    GlobalTaskFrame,
    IntegratedAdaptiveRobust,
    LocalTaskFrame,
    parameter_bounds,
)
from contourlab.controllers.parameter_bounds import nominal_parameters
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines import NominalModel
from contourlab.machines.published import hu_gantry
from contourlab.testing import check_controller
from contourlab.testing.samples import make_samples, sample_at

T = 1e-3
NEEDS = cl.controllers.Needs(command="voltage", derivatives=3, contour=True)
MODEL = NominalModel(
    mass=np.array([0.12, 0.55]), viscous=np.array([0.35, 0.5]), coulomb=np.array([0.1, 0.13]),
    gain=np.array([1.0, 1.1]), command_limit=np.array([60.0, 60.0]), command="voltage",
)  # fmt: skip
GAINS = {"model": MODEL, "error_decay": (30.0, 50.0), "feedback_gain": (10.0, 12.0)}
LOWER = np.array([[0.06, 0.4], [0.2, 0.3], [0.05, 0.08], [-0.5, -0.5]])
UPPER = np.array([[0.25, 0.7], [0.6, 0.6], [0.15, 0.25], [0.5, 0.5]])
BOUNDS = {"parameter_lower": LOWER, "parameter_upper": UPPER}
START = np.array([[0.1, 0.55], [0.3, 0.4], [0.1, 0.15], [0.02, -0.01]])


# the derivatives of every field through the search for the foot point take long to compile
FRAMES = [
    LocalTaskFrame(),
    pytest.param(GlobalTaskFrame(), marks=[pytest.mark.slow, pytest.mark.overnight]),
]


@pytest.mark.parametrize("frame", FRAMES)
def test_the_direct_law_conforms(frame):
    check_controller(
        DirectAdaptiveRobust(
            **GAINS, uncertainty=(0.5, 0.4, 0.3), disturbance_limit=2.0, robust_accuracy=20.0,
            unmodelled_limit=0.5, frame=frame,
            adaptation_rate=(10.0, 10.0, 10.0, 300.0), friction_velocity=1e-2,
        ),
        contour=Circle(radius=np.array(0.02), center=np.array([0.01, -0.005])),
    )  # fmt: skip


@pytest.mark.parametrize("frame", FRAMES)
def test_the_integrated_law_conforms(frame):
    # the norm of the covariance is 52 at the start and stays below its limit
    # X of the model is outside the bounds: the estimates start at them
    lower, upper = LOWER.copy(), UPPER.copy()
    lower[1, 0], upper[2, 0] = 0.4, 0.09
    law = IntegratedAdaptiveRobust(
        **GAINS, parameter_lower=lower, parameter_upper=upper, frame=frame,
        least_squares=FilteredLeastSquares(
            initial_covariance=(10.0, 10.0, 10.0, 49.0), covariance_limit=60.0, cutoff_hz=80.0,
            forgetting=2.0, friction_velocity=1e-2,
        ),
        compensation_rate=600.0, compensation_limit=0.02,
    )  # fmt: skip
    inert = {"least_squares.at_limit"}
    check_controller(law, contour=Circle(radius=np.array(0.02)), inert=inert)


def one_step(law, contour, error=(1e-4, -2e-4)):
    law = law.bind(contour, T)
    samples = make_samples(contour, 800, T, NEEDS, error=np.array(error))
    first = sample_at(samples, 200)
    command, state = stepped(law, first)
    return first, np.asarray(command), state


@jax.jit
def stepped(law, sample):
    return law.step(law.init(sample), sample)


def test_one_command_by_hand():
    """On a line, where every frame is the same: u = M a + B v + A S(v) - d - Jᵀ K s."""
    line = Line(start=(0.0, 0.0), end=(0.03, 0.04))
    law = IntegratedAdaptiveRobust(**GAINS, **BOUNDS, initial_parameters=START)
    sample, command, _ = one_step(law, line)
    t, n = np.array([0.6, 0.8]), np.array([0.8, -0.6])
    reference = sample.reference
    q, v = np.asarray(sample.position), np.asarray(sample.velocity)
    j = np.stack([t, n])
    e, rate = j @ (q - reference.position), j @ (v - reference.velocity)
    decay, gain = np.array([30.0, 50.0]), np.array([10.0, 12.0])
    s = rate + decay * e
    a = np.asarray(reference.acceleration) - j.T @ (decay * rate)
    m, b, c, d = START
    wanted = m * a + b * v + c * 2 / np.pi * np.arctan(9000 * v) - d - j.T @ (gain * s)
    assert_allclose(command, wanted, rtol=1e-12)


@pytest.mark.parametrize("frame", [GlobalTaskFrame(), LocalTaskFrame()])
def test_the_command_clips_and_what_adapts_directly_waits(frame):
    circle = Circle(radius=0.05)
    tight = replace(MODEL, command_limit=np.array([0.05, 0.05]))
    law = IntegratedAdaptiveRobust(**(GAINS | {"model": tight}), **BOUNDS, frame=frame)
    _, command, state = one_step(law, circle, error=(5e-3, 5e-3))
    assert_allclose(np.abs(command), 0.05)
    assert int(state.status) == 1
    assert_allclose(state.adaptation.compensation, 0.0)  # it would only push further out
    free = IntegratedAdaptiveRobust(**GAINS, **BOUNDS, frame=frame)
    _, _, state = one_step(free, circle, error=(5e-3, 5e-3))
    assert np.all(np.asarray(state.adaptation.compensation) != 0.0)
    direct = DirectAdaptiveRobust(**(GAINS | {"model": tight}), **BOUNDS, frame=frame)
    _, _, state = one_step(direct, circle, error=(5e-3, 5e-3))
    assert_allclose(state.adaptation, direct.bind(circle, T).initial)


def test_the_robust_gain_meets_its_conditions():
    """(20): whatever the parameters within their bounds, sᵀ(...) is η at most."""
    rng = np.random.default_rng(5)
    law = IntegratedAdaptiveRobust(
        **GAINS, **BOUNDS, robust_accuracy=1e4, unmodelled_limit=0.3, compensation_limit=1.0
    ).bind(Circle(radius=0.05), T)
    for _ in range(50):
        y = rng.normal(size=(4, 2)) * np.array([3.0, 0.5, 1.0, 1.0])[:, None]
        gain, limited = law.robust_gain(jnp.asarray(y))
        assert not bool(limited)
        assert np.all(np.asarray(gain) > 0.0)
        # everything that is unknown at its worst, and all of it one way
        theta, hat = np.where(y > 0, LOWER, UPPER), np.where(y > 0, UPPER, LOWER)
        compensation = -np.ones(2)
        unknown = np.sum(y * (hat - theta), 0) - compensation
        unknown *= 1.0 + 0.3 / np.linalg.norm(unknown)
        # the worst s is along the unknown
        direction = unknown / np.linalg.norm(unknown)
        sizes = np.linspace(0.0, 4.0 * np.linalg.norm(unknown) / gain[0], 200)
        worst = sizes * np.linalg.norm(unknown) - gain[0] * sizes**2
        assert worst.max() <= 1e4 * (1 + 1e-9)
        assert worst.max() > 0.6e4  # and not by far
        assert direction @ (-np.asarray(gain) * direction) <= 0.0  # ii


def test_the_sampling_holds_the_robust_gain_and_says_so():
    law = DirectAdaptiveRobust(**GAINS, **BOUNDS, robust_accuracy=1e-6)
    bound = law.bind(Circle(radius=0.05), T)
    gain, limited = bound.robust_gain(jnp.ones((4, 2)))
    assert bool(limited)
    assert_allclose(np.asarray(gain) + np.array([10.0, 12.0]), 0.5 * 0.06 / T)
    _, _, state = one_step(law, Circle(radius=0.05))
    assert int(state.status) == 2
    assert "sample time" in bound.statuses[2]


def test_bounds_come_from_the_model_and_its_uncertainty():
    lower, upper = parameter_bounds(MODEL, (0.5, 0.2, 2.0), (0.4, 0.6))
    per_command = np.stack([MODEL.mass, MODEL.viscous, MODEL.coulomb]) / MODEL.gain
    assert_allclose(lower, np.array([0.5, 0.8, 0.0, 0.0])[:, None] * [*per_command, [0, 0]]
                    - np.array([[0] * 2] * 3 + [[0.4, 0.6]]))  # fmt: skip
    assert_allclose(upper[:3], np.array([1.5, 1.2, 3.0])[:, None] * per_command)
    lower, upper = parameter_bounds(MODEL, 1.5)
    assert np.all(np.asarray(lower[0]) > 0.0)
    assert_allclose(upper[3], 15.0)  # a quarter of the command limit
    law = DirectAdaptiveRobust(**GAINS)
    assert_allclose(law.bounds()[1][0], 1.5 * per_command[0])


def test_tuning_by_bandwidth():
    law = IntegratedAdaptiveRobust.by_bandwidth(MODEL, (5.0, 10.0), uncertainty=0.2)
    decay = 2 * np.pi * np.array([5.0, 10.0])
    assert_allclose(law.error_decay, decay)
    assert_allclose(law.feedback_gain, 2 * decay * 0.5)
    with pytest.raises(ConfigurationError, match=r"bandwidth_hz must be \(tangential, normal\)"):
        DirectAdaptiveRobust.by_bandwidth(MODEL, 5.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"error_decay": (30.0, -1.0)}, "error_decay must be > 0 1/s, got -1"),
        ({"feedback_gain": 3.0}, r"feedback_gain must be \(tangential, normal\)"),
        ({"parameter_lower": LOWER}, "parameter_lower and parameter_upper go together"),
        ({**BOUNDS, "uncertainty": 0.3}, "uncertainty has no effect beside"),
        ({"parameter_lower": UPPER, "parameter_upper": LOWER}, "must be <= parameter_upper"),
        ({"parameter_lower": 0 * LOWER, "parameter_upper": UPPER}, "> 0 for the masses"),
        ({"initial_parameters": START[0]}, r"initial_parameters must have shape \(4, 2\)"),
        (
            {**BOUNDS, "initial_parameters": np.where(START == 0.55, 0.75, START)},
            "within the bounds of the parameters: mass of axis 1 in 0.4 to 0.7, got 0.75",
        ),
        ({"unmodelled_limit": 0.1}, "unmodelled_limit has no effect without robust_accuracy"),
        ({"frame": "global"}, "frame must be a task frame"),
        ({"model": None}, "model must be a NominalModel"),
    ],
)
def test_mistakes_are_named(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        DirectAdaptiveRobust(**(GAINS | changes))


def test_a_start_beyond_bounds_that_follow_from_the_model_is_refused_when_bound():
    start = START.copy()
    start[0, 0] = 0.3  # of a mass of 0.12
    law = DirectAdaptiveRobust(
        **GAINS, uncertainty=0.5, disturbance_limit=2.0, initial_parameters=start
    )
    with pytest.raises(ConfigurationError, match=r"mass of axis 0 in 0\.06 to 0\.18, got 0\.3"):
        law.bind(Circle(radius=0.02), T)
    fine = replace(law, initial_parameters=START).bind(Circle(radius=0.02), T)
    assert_allclose(fine.initial, START)


def test_what_the_laws_cannot_take_is_refused():
    stiff = replace(MODEL, stiffness=np.ones(2))
    with pytest.raises(RefusedError, match="knows no stiffness"):
        DirectAdaptiveRobust(**(GAINS | {"model": stiff}))
    with pytest.raises(RefusedError, match="takes a position"):
        DirectAdaptiveRobust(**(GAINS | {"model": replace(MODEL, command="position")}))
    spatial = NominalModel(
        mass=np.ones(3), viscous=np.ones(3), coulomb=np.ones(3), gain=np.ones(3),
        command_limit=np.ones(3), command="force",
    )  # fmt: skip
    with pytest.raises(RefusedError, match="two axes in a plane, the model has 3"):
        DirectAdaptiveRobust(**(GAINS | {"model": spatial}))
    corner = Path.join(
        [Line(start=(0.0, 0.0), end=(0.1, 0.0)), Line(start=(0.1, 0.0), end=(0.1, 0.1))]
    )
    with pytest.raises(RefusedError, match="corner"):
        IntegratedAdaptiveRobust(**GAINS).bind(corner, T)
    endless = replace(MODEL, command_limit=np.full(2, np.inf))
    law = IntegratedAdaptiveRobust(**(GAINS | {"model": endless}))
    with pytest.raises(ConfigurationError, match="disturbance_limit must be given"):
        law.bind(Circle(radius=0.05), T)
    with pytest.raises(ConfigurationError, match=r"adaptation_rate must have shape \(4,\)"):
        DirectAdaptiveRobust(**GAINS, adaptation_rate=(1.0, 2.0)).bind(Circle(radius=0.05), T)


def test_the_estimates_are_recorded():
    machine = hu_gantry()
    contour = Ellipse(semi_axes=(0.05, 0.03))
    reference = cl.feedrate.constant_feed(contour, feed=0.1, sample_time=T, duration=0.2)
    law = IntegratedAdaptiveRobust.by_bandwidth(machine.nominal, (5.0, 15.0))
    recording = cl.simulate(machine, law, reference)
    for name in ("mass", "viscous", "coulomb", "disturbance"):
        assert recording[f"{name}_estimate"].dims == ("time", "axis")
    assert_allclose(recording["mass_estimate"][0], machine.nominal.mass, rtol=1e-3)
    assert recording["compensation"].dims == ("time", "axis")
    assert recording["covariance_norm"].dims == ("time", "axis")
    estimate = recording["contour_error_estimate"] - recording["contour_error_vector"]
    assert np.abs(np.asarray(estimate)).max() < 1e-6  # half a count of the encoders
    assert recording.metrics["contour_error_max"] < 1e-3
    # what the law learned is what the estimator learns of the recording: command k acts from k on
    estimator = law.least_squares.bind(*law.bounds(), T)
    measured, command = np.asarray(recording["measured"]), np.asarray(recording["command"])
    before = np.concatenate([np.zeros((1, 2)), command[:-1]])
    start = estimator.init(measured[0], nominal_parameters(machine.nominal))
    learned = replayed(estimator, start, measured, before)
    for row, name in enumerate(("mass", "viscous", "coulomb", "disturbance")):
        assert_allclose(recording[f"{name}_estimate"], learned[:, row], rtol=1e-6, atol=1e-9)


@jax.jit
def replayed(estimator, state, positions, commands):
    def step(state, row):
        state = estimator.step(state, *row)
        return state, state.estimate

    return jax.lax.scan(step, state, (positions, commands))[1]


def primitives(jaxpr):
    for equation in jaxpr.eqns:
        yield equation.primitive.name
        for value in jax.tree.leaves(
            list(equation.params.values()), is_leaf=lambda x: hasattr(x, "eqns")
        ):
            inner = getattr(value, "jaxpr", value)
            if hasattr(inner, "eqns"):
                yield from primitives(inner)


@pytest.mark.parametrize("kind", [DirectAdaptiveRobust, IntegratedAdaptiveRobust])
def test_a_step_needs_no_linear_algebra_library(kind):
    """So that it can be exported: no factorisation, and without a foot point no loop either."""
    law = kind(**GAINS, **BOUNDS, frame=LocalTaskFrame(), robust_accuracy=1.0)
    bound = law.bind(Circle(radius=0.05), T)
    sample = sample_at(make_samples(Circle(radius=0.05), 10, T, NEEDS), 3)
    state = bound.init(sample)
    found = set(primitives(jax.make_jaxpr(bound.step)(state, sample).jaxpr))
    assert {"mul", "clamp" if "clamp" in found else "min"} <= found
    library = {
        "cholesky",
        "eig",
        "eigh",
        "lu",
        "qr",
        "svd",
        "triangular_solve",
        "custom_linear_solve",
    }
    assert not found & (library | {"while", "scan", "pure_callback"})


@pytest.mark.parametrize(("low", "high"), [(-0.5, 0.0), (0.0, 0.5), (-0.5, 0.1)])
def test_the_compensation_may_be_twice_the_largest_disturbance(low, high):
    """Also where d is known to have one sign."""
    lower, upper = LOWER.copy(), UPPER.copy()
    lower[3], upper[3] = low, high
    start = np.clip(START, lower, upper)
    law = IntegratedAdaptiveRobust(
        **GAINS, parameter_lower=lower, parameter_upper=upper, initial_parameters=start
    )
    assert_allclose(law.bind(Circle(radius=0.02), T).compensation_bound, 1.0)


def test_a_disturbance_without_range_asks_for_what_is_measured_by_it():
    lower, upper = LOWER.copy(), UPPER.copy()
    lower[3] = upper[3] = 0.0
    fields = {**GAINS, "parameter_lower": lower, "parameter_upper": upper}
    given = FilteredLeastSquares(initial_covariance=(10.0,) * 4)
    for law, name in (
        (DirectAdaptiveRobust(**fields), "adaptation_rate"),
        (IntegratedAdaptiveRobust(**fields, least_squares=given), "compensation_limit"),
        (IntegratedAdaptiveRobust(**fields, compensation_limit=1.0), "initial_covariance"),
    ):
        with pytest.raises(ConfigurationError, match=f"{name} must be given where"):
            law.bind(Circle(radius=0.02), T)
