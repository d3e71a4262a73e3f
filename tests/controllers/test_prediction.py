"""What predictive laws minimise: against brute force, whatever the polynomials."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Circle
from contourlab.controllers import AxisPredictive
from contourlab.testing.protocol import outputs
from contourlab.testing.samples import make_samples, sample_at

from . import predictive_judge as judge
from .predictive_material import (
    BESIDE,
    PATHS,
    PLAIN,
    T,
    by_axis,
    circle_reference,
    law,
    model,
    stage,
)

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
    "one axis": {"n": 1, "delay": 1, "noise_polynomial": (1.0, -0.8)},
    "three axes": {
        "n": 3, "delay": 1, "noise_polynomial": (1.0, -0.6), "angle": "single",
        "holding_polynomial": (1.0, -2.0, 1.0), "stiffness": np.array([2000.0, 0.0, 500.0]),
    },
}  # fmt: skip


@pytest.mark.parametrize("n", [1, 3])
def test_the_axis_law_is_the_brute_force_minimiser(n):
    fields = {name: CASES["every polynomial"][name] for name in (
        "noise_polynomial", "servo_polynomial", "input_filter_numerator", "delay",
        "input_filter_denominator", "holding_polynomial", "minimum_horizon",
    )}  # fmt: skip
    judge_by_brute_force(by_axis(n, **fields))


def brute_force(controller, samples, commands, k):
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
    if getattr(controller, "angle", "") == "single":
        velocity[:] = velocity[0]
    tangents = velocity / np.linalg.norm(velocity, axis=1)[:, None]
    ahead = np.asarray(sample.preview.position) - origin
    horizons = (
        controller.minimum_horizon, controller.prediction_horizon, controller.control_horizon
    )  # fmt: skip
    held = holding * np.sum(polynomial["input_filter_numerator"]) / np.sum(
        polynomial["input_filter_denominator"]
    )  # fmt: skip
    if isinstance(controller, AxisPredictive):  # (9): every axis by itself
        rho = np.broadcast_to(np.asarray(controller.input_weight), (n,))
        free = [
            judge.minimise(
                axes[i : i + 1], ahead[:, i : i + 1], np.zeros((len(ahead) + 1, 1)),
                (1.0, 1.0, rho[i], rho[i]), horizons, controller.delay, held[i : i + 1],
            )[0, 0]
            for i in range(n)
        ]  # fmt: skip
        return np.array(free) + holding
    weights = (
        controller.contour_weight, controller.lag_weight,
        controller.normal_input_weight, controller.tangential_input_weight,
    )  # fmt: skip
    free = judge.minimise(axes, ahead, tangents, weights, horizons, controller.delay, held)
    return free[:, 0] + holding


def judge_by_brute_force(controller, instants=(1, 7, 40)):  # at 0 there is no direction yet
    samples = make_samples(PATHS[controller.n_axes], 60, T, controller.needs)
    bound = controller.bind(PATHS[controller.n_axes], T)
    commands = np.asarray(outputs(bound, samples))
    for k in instants:
        wanted = brute_force(controller, samples, commands, k)
        # the judge solves a least squares problem of condition 1e3 and divides by A twice
        scale = np.max(np.abs(commands[: k + 1]))
        assert_allclose(commands[k], wanted, rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("case", CASES)
def test_the_command_is_the_brute_force_minimiser(case):
    fields = dict(CASES[case])
    n = fields.pop("n", 2)
    told = model(n, stiffness=fields.pop("stiffness", None))
    judge_by_brute_force(law(n, told=told, **fields))


def drawn(seed):
    """Return a law with polynomials, horizons, delay and axes by chance."""
    rng = np.random.default_rng(seed)

    def polynomial(highest, radius=0.9):
        roots = rng.uniform(-radius, radius, rng.integers(0, highest + 1))
        return tuple(np.poly(roots)) if roots.size else (1.0,)

    delay, n_free = int(rng.integers(0, 3)), int(rng.integers(1, 5))
    beside = rng.random() < 0.4
    fields = {
        "delay": delay, "control_horizon": n_free,
        "prediction_horizon": delay + n_free + int(rng.integers(1, 6)),
        "minimum_horizon": delay + 1,
        "noise_polynomial": polynomial(2, 0.7), "servo_polynomial": polynomial(2, 0.5),
        "disturbance_polynomial": polynomial(1), "holding_polynomial": polynomial(3),
        "disturbance_integrators": int(rng.integers(0, 3)),
        "input_filter_numerator": polynomial(2), "input_filter_denominator": polynomial(1),
        "form": "independent" if beside or rng.random() < 0.3 else "realigned",
        "disturbance_plant": not beside,
    }  # fmt: skip
    kind, n = (law, by_axis)[int(rng.random() < 0.3)], int(rng.integers(1, 4))
    return kind(n, **fields)


@pytest.mark.parametrize("seed", [0, 4, 5, 6, 7, 23])  # 1 to 3 axes, both laws, both forms
def test_whatever_the_polynomials_the_command_is_the_minimiser(seed):
    # early: with positions that no loop has closed, commands may grow without end
    judge_by_brute_force(drawn(seed), (1, 4, 7))


def test_one_step_ahead_without_weights_arrives_at_once():
    """H_p = H_c = 1, ρ = 0: the next measured position is the next reference, after one sample."""
    short = {"prediction_horizon": 1, "control_horizon": 1}
    free = {"normal_input_weight": 0.0, "tangential_input_weight": 0.0}
    reference = circle_reference(duration=0.3)
    recording = cl.simulate(stage(), law(**short, **free), reference)
    # two roundings of b_0, amplified by the zero of B near -1
    assert_allclose(recording["actual"][1:], reference.position[1:], rtol=0, atol=1e-12)


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
