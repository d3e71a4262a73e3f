"""The reserve that a plan keeps for a mass that is more than the model's."""

import runpy
from pathlib import Path as FilePath

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Path
from contourlab.controllers import ModelPredictiveContouring
from contourlab.controllers.held_model import held_axes
from contourlab.controllers.model_predictive_contouring_axes import Observed, observer
from contourlab.controllers.model_predictive_contouring_reserve import (
    reserve_commands,
    reserve_rows,
)
from contourlab.errors import ConfigurationError
from contourlab.machines.base import NominalModel

T, N = 5e-3, 5
MASS, LIMIT = np.array([40.0, 50.0]), 20.0
LINE = Path.polyline(np.array([[0.0, 0.0], [0.02, 0.01]]))


def model(mass=MASS, **changes):
    fields = {"viscous": 250.0, "coulomb": 0.0, "gain": 1.0, "command_limit": LIMIT} | changes
    each = {name: np.full(2, value) for name, value in fields.items()}
    return NominalModel(mass=mass, command="voltage", **each)


def law(uncertainty, **changes):
    return ModelPredictiveContouring(
        model=model(**changes), speed_limit=0.03, horizon=N, mass_uncertainty=uncertainty
    )


@pytest.fixture(scope="module")
def bound():
    """Bound once: it compiles how fast the path may be."""
    return law((0.2, 0.3)).bind(LINE, T)


def a_plan(planner, inputs, disturbance=None):
    zero = jnp.zeros((N, 2)) if disturbance is None else disturbance
    velocity = jnp.array([0.012, 0.006])
    return planner.roll_out(jnp.array([1e-3, 5e-4]), velocity, jnp.asarray(1e-3), inputs, zero)


def inputs(rng):
    return jnp.asarray(np.column_stack([rng.normal(size=(N, 2)), 0.01 + 0.01 * rng.random(N)]))


def reserve_of(bound, plan, disturbance):
    """Normals and values of the reserve's rows: those over stages, of a law without other ones."""
    points = bound.path.points(plan.progress[1:], jnp.zeros((), jnp.int32))
    rows = bound.planner._rows(plan, points, jnp.zeros(3), bound.path.length, None, disturbance)
    (one,) = [one for one in rows if one.over == "stage"]
    return one.normals, 1.0 - one.upper


def test_the_commands_of_the_reserve_move_the_heavy_axes_as_planned():
    """By the held axes themselves, with a stiffness, so that every entry counts."""
    stiff = {"stiffness": 3e3}
    rng = np.random.default_rng(1)
    positions, velocities = jnp.asarray(rng.normal(size=(2, N + 1, 2)))
    disturbance = jnp.asarray(rng.normal(size=(N, 2)))
    heavy = held_axes(model(1.4 * MASS, **stiff), T)
    command = reserve_commands(heavy, positions, velocities, disturbance)
    for k in range(N):
        _, velocity = heavy.after(positions[k], velocities[k], command[k] + disturbance[k])
        assert_allclose(velocity, velocities[k + 1], rtol=1e-9)


def test_nothing_is_kept_for_what_the_observer_has_found():
    """At a steady acceleration both masses ask for the command that the plan has: (1)."""
    free = model(viscous=0.0)
    true = held_axes(model(1.3 * MASS, viscous=0.0), T)
    heavier = cl.replace(free, mass=np.full(2, 56.0))
    looking = [observer(held_axes(one, T), 20.0, T) for one in (free, heavier)]
    command, zero = jnp.array([8.0, -5.0]), jnp.zeros(2)
    q, v = zero, zero
    seen = [Observed(zero, zero, zero) for _ in looking]
    for _ in range(60):
        seen = [one.predict(one.correct(now, q), command)
                for one, now in zip(looking, seen, strict=True)]  # fmt: skip
        q, v = true.after(q, v, command)
    steady = np.asarray(command) / (1.3 * MASS)
    nominal, heavy = seen
    assert_allclose(
        heavy.disturbance - nominal.disturbance, (56.0 - MASS) * steady, rtol=1e-6
    )  # d' = d + (M' - M) a_f / K
    for ahead in (steady, 0.5 * steady, -steady):
        velocities = jnp.asarray(np.outer(np.arange(N + 1) * T, ahead))
        asked = reserve_commands(
            looking[1].axes, velocities, velocities, jnp.tile(heavy.disturbance, (N, 1))
        )
        planned = MASS * ahead - nominal.disturbance
        assert_allclose(asked[-1] - planned, (56.0 - MASS) * (ahead - steady), atol=1e-6)


def test_its_rows_are_what_a_plan_that_moves_changes(bound):
    rng = np.random.default_rng(3)
    start = inputs(rng)
    disturbance = jnp.asarray(rng.normal(size=(N, 2)))
    plan = a_plan(bound.planner, start)
    normals, value = reserve_of(bound, plan, disturbance)
    asked = reserve_commands(bound.planner.heavy, plan.positions, plan.velocities, disturbance)
    assert_allclose(value[1:], asked[1:] / LIMIT, rtol=1e-12)
    by = jnp.asarray(rng.normal(size=(N, 3))) * jnp.array([1.0, 1.0, 1e-3])
    moved = a_plan(bound.planner, start + by)
    after = reserve_commands(
        bound.planner.heavy, moved.positions, moved.velocities, disturbance
    ) / LIMIT  # fmt: skip
    before = jnp.concatenate([jnp.zeros((1, 3)), by[:-1]])
    states = jnp.column_stack([
        (moved.positions - plan.positions)[:-1], (moved.velocities - plan.velocities)[:-1],
        (moved.progress - plan.progress)[:-1], before,
    ])  # fmt: skip
    y = jnp.column_stack([states / bound.planner.state_scale, by / bound.planner.input_scale])
    changed = jnp.sum(normals * y[:, None], axis=2)
    assert_allclose(changed[1:], (after - value)[1:], atol=1e-12)
    # what is applied may use all of the limit
    assert not np.any(normals[0])
    assert not np.any(value[0])
    assert np.all(np.any(np.asarray(normals[1:]) != 0.0, axis=2))


def test_it_reckons_with_the_mass_once_held_and_once_made_up(bound):
    heavy = held_axes(model(MASS * np.array([1.4, 1.6])), T)  # M' = M (1 + 2 δ)
    assert_allclose(bound.planner.heavy.velocity_from_command, heavy.velocity_from_command)
    braking = 0.8 * np.min(LIMIT / (MASS * np.array([1.4, 1.6])))
    assert_allclose(bound.planner.limits.braking, braking)
    # weights follow from the model as it is: 5e4 rewards for an error of V²/a
    unit = (0.03**2 / np.min(LIMIT / MASS)) ** 2
    assert_allclose(bound.planner.weights.contour, 5e4 / unit)


def test_none_costs_no_rows_and_what_is_traced_keeps_them():
    kept = []

    def bind(uncertainty):
        found = law(uncertainty).bind(LINE, T)
        kept.append(found.heavy is not None)
        return found.planner.limits.braking

    jax.eval_shape(bind, 0.0)
    jax.eval_shape(lambda: bind(0.0))
    jax.eval_shape(lambda: bind((0.0, 0.1)))
    assert kept == [True, False, True]


def test_without_a_limit_of_the_command_there_is_nothing_to_keep():
    heavy = held_axes(model(1.4 * MASS), T)
    one = jnp.ones((2, 4))
    assert not np.any(reserve_rows(heavy, one, one, one, jnp.full(2, jnp.inf)))


def test_it_has_derivatives_by_the_uncertainty():
    positions, velocities = jnp.asarray(np.random.default_rng(5).normal(size=(2, N + 1, 2)))

    def asked(uncertainty):
        heavy = held_axes(model(MASS * (1.0 + 2.0 * uncertainty)), T)
        return jnp.sum(reserve_commands(heavy, positions, velocities, jnp.zeros((N, 2))))

    step = 1e-4
    slope = (asked(0.2 + step) - asked(0.2 - step)) / (2.0 * step)
    assert_allclose(jax.grad(asked)(0.2), slope, rtol=1e-6)


@pytest.mark.parametrize(("uncertainty", "message"), [
    (-0.1, "mass_uncertainty must be >= 0"), ((0.1, 0.2, 0.3), "one for each of the 2 axes"),
])  # fmt: skip
def test_bad_uncertainties_are_refused(uncertainty, message):
    with pytest.raises(ConfigurationError, match=message):
        law(uncertainty).bind(LINE, T)


# 45 whole runs
@pytest.mark.overnight
@pytest.mark.slow
def test_a_mass_within_what_is_stated_costs_micrometres_and_not_a_millimetre():
    """The table of docs/mpcc.md."""
    file = FilePath(__file__).parents[2] / "benchmarks" / "predictive_robustness.py"
    rows = {
        (row["mass_uncertainty"], row["heavier"]): row
        for row in runpy.run_path(str(file))["reserves"]()
    }
    exact = rows[0.0, 0.0]
    for stated in (0.1, 0.2, 0.3, 0.5):
        for heavier in (0.0, 0.1, 0.2, 0.3, 0.5):
            row = rows[stated, heavier]
            assert row["unsolved"] == 0
            if heavier <= stated:
                assert row["max_um"] < 15.0
                assert row["samples_of_status_1"] == 0
                assert row["cycle_s"] < 1.08 * exact["cycle_s"]
            if heavier > 0.0:  # without the reserve it is far worse and later
                assert row["max_um"] < 0.75 * rows[0.0, heavier]["max_um"]
                assert row["cycle_s"] < rows[0.0, heavier]["cycle_s"]
    assert rows[0.1, 0.0]["cycle_s"] < 1.01 * exact["cycle_s"]  # what the default costs
    assert rows[0.0, 0.1]["max_um"] > 200.0
