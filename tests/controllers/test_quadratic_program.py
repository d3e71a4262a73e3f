"""The quadratic program: optimality conditions of the dense problem, closed forms, derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers.quadratic_program import solve_program
from contourlab.controllers.quadratic_program_stages import DenseDynamics, Rows, StagedProgram
from contourlab.testing.condensed_program import condensed_program

from .exportable import refuse_what_c_has_not

N, N_X, N_U = 12, 5, 2
solve = jax.jit(solve_program)


def program(seed=0, *, far=1.0, penalty=10.0, bound=1.0):
    """Bounded inputs, a hard row on both, soft rows of every kind, with one side and with two."""
    rng = np.random.default_rng(seed)
    n_y = N_X + N_U
    stage = rng.normal(size=(3, n_y))
    after = rng.normal(size=(N, 3, 4))
    stage_hessian = stage.T @ stage
    stage_hessian[np.arange(N_X, n_y), np.arange(N_X, n_y)] += 1e-2
    limit = np.full((N, N_U), bound)
    both = np.zeros((N, 1, n_y))
    both[:, 0, N_X:] = 1.0
    soft = penalty * np.ones(2)
    rows = (
        Rows("state", jnp.asarray(0.3 * rng.normal(size=(N, 2, 4))), jnp.full((N, 2), bound),
             jnp.full((N, 2), -bound), jnp.asarray(soft)),
        Rows("stage", jnp.asarray(both), jnp.full((N, 1), 1.5 * bound),
             jnp.full((N, 1), -1.5 * bound)),
        Rows("stage", jnp.asarray(0.3 * rng.normal(size=(N, 2, n_y))), jnp.full((N, 2), bound),
             None, jnp.asarray(soft)),
        Rows("end", jnp.asarray(0.3 * rng.normal(size=(2, 5))),
             jnp.array([-20.0, 0.1]) * bound, None, jnp.asarray(soft)),
    )  # fmt: skip
    return StagedProgram(
        state_hessian=jnp.asarray(np.swapaxes(after, 1, 2) @ after),
        state_gradient=jnp.asarray(rng.normal(size=(N, 4))),
        stage_hessian=jnp.asarray(stage_hessian),
        stage_gradient=jnp.asarray(rng.normal(size=(N, n_y))),
        dynamics=DenseDynamics(jnp.asarray(
            np.hstack([np.eye(N_X), np.zeros((N_X, N_U))]) + 0.1 * rng.normal(size=(N_X, n_y))
        )),
        start=jnp.asarray(0.3 * far * rng.normal(size=N_X)),
        lower=jnp.asarray(-limit), upper=jnp.asarray(limit), rows=rows,
    )  # fmt: skip


def cost(p, inputs):
    """What a soft program costs, excesses at their least; rows are not looked at if hard."""
    d = condensed_program(p)
    u = np.asarray(inputs).reshape(-1)
    over = np.maximum(np.maximum(d.lower - d.rows @ u, d.rows @ u - d.upper), 0.0)
    soft = np.isfinite(d.penalty)
    return 0.5 * u @ d.hessian @ u + d.gradient @ u + d.penalty[soft] @ over[soft]


# One soft row in three is exceeded with the low penalty; the others hold.
@pytest.mark.parametrize(
    ("seed", "penalty", "bound"), [(0, 10.0, 0.2), (1, 0.3, 0.5), (2, 3.0, 0.2)]
)
def test_the_solution_meets_the_optimality_conditions(seed, penalty, bound):
    p = program(seed, penalty=penalty, bound=bound)
    found = solve(p, jnp.zeros((N, N_U)))
    assert bool(found.converged)
    d = condensed_program(p)
    u = np.asarray(found.inputs).reshape(-1)
    upper, lower, parts = p.parts(found.multipliers)
    # the same order as the dense rows: stage by stage, inputs first, then the rows
    lam = [[], []]
    for j in range(N):
        lam[0].append(upper[j])
        lam[1].append(lower[j])
        for rows, part in zip(p.rows, parts, strict=True):
            if rows.over != "end" or j == N - 1:
                here = part if rows.over == "end" else part[:, j]
                lam[0].append(here[0])
                lam[1].append(here[1] if rows.lower is not None else 0.0 * here[0])
    above, below = (np.concatenate(side) for side in lam)
    balance = d.hessian @ u + d.gradient + d.rows.T @ (above - below)
    # stationarity to the square of the last step's tolerance
    assert_allclose(balance, 0.0, atol=1e-7)
    hard = ~np.isfinite(d.penalty)
    for side, over in ((above, d.rows @ u - d.upper), (below, d.lower - d.rows @ u)):
        assert np.all(side >= 0.0)
        assert np.all(side[~hard] <= d.penalty[~hard] * (1.0 + 1e-12))
        assert np.max(over[hard]) <= 0.0
        assert np.max(side[over < -1e-3], initial=0.0) < 1e-4  # slack rows do not push
        beyond = over > 1e-3
        assert_allclose(side[beyond], d.penalty[beyond], atol=1e-4)  # exceeded rows push fully
    assert np.max((above + below)[hard]) > 0.1  # the case has active hard rows
    if penalty < 1.0:
        assert np.max((d.rows @ u - d.upper)[~hard]) > 1e-2  # and exceeded soft ones


def test_without_bounds_it_is_the_dense_least_squares_solution():
    p = program(3)
    free = eqx.tree_at(
        lambda q: (q.lower, q.upper, q.rows), p,
        (jnp.full((N, N_U), -jnp.inf), jnp.full((N, N_U), jnp.inf), ()),
    )  # fmt: skip
    found = solve(free, jnp.ones((N, N_U)))
    d = condensed_program(eqx.tree_at(lambda q: q.rows, p, ()))
    wanted = np.linalg.solve(d.hessian, -d.gradient)
    assert_allclose(found.inputs.reshape(-1), wanted, atol=1e-10 * np.max(np.abs(wanted)))
    assert not np.any(found.multipliers)


def scalar(penalty=None):
    """x1 = x0 + u, cost (x1 - 3)²/2 + u²/2, |u| <= 1 by the inputs' bounds or by a soft row."""
    one = jnp.ones((1, 1))
    soft = Rows("stage", jnp.array([[[0.0, 1.0]]]), one, -one, jnp.array([penalty or 1.0]))
    bound = jnp.inf if penalty else 1.0
    return StagedProgram(
        state_hessian=one[None], state_gradient=-3.0 * one,
        stage_hessian=jnp.diag(jnp.array([0.0, 1.0])), stage_gradient=jnp.zeros((1, 2)),
        dynamics=DenseDynamics(jnp.ones((1, 2))), start=jnp.zeros(1), lower=-bound * one,
        upper=bound * one, rows=(soft,) if penalty else (),
    )  # fmt: skip


def test_one_input_at_its_bound_in_closed_form():
    """U = 1, its multiplier 3 - x0 - 2 = 1; a row of penalty 0.5 gives way until 3 - 2 u = 0.5."""
    found = solve(scalar(), jnp.zeros((1, 1)))
    assert_allclose(found.inputs, 1.0, atol=2e-8)  # the barrier over the multiplier
    assert_allclose(found.multipliers, [1.0, 0.0], atol=1e-7)
    soft = solve(scalar(0.5), jnp.zeros((1, 1)))
    assert_allclose(soft.inputs, 1.25, atol=1e-7)
    assert_allclose(soft.excess, [0.25, 0.0], atol=1e-7)


def test_a_warm_start_needs_fewer_iterations_and_finds_the_same():
    p = program(1, penalty=0.3, bound=0.5)
    before = solve(p, jnp.zeros((N, N_U)))
    moved = eqx.tree_at(lambda q: q.start, p, p.start + 1e-3)
    cold = solve(moved, before.inputs)
    warm = solve(moved, before.inputs, warm=before.multipliers)
    assert int(warm.iterations) < int(cold.iterations)
    assert_allclose(warm.inputs, cold.inputs, atol=1e-6)
    none = solve(moved, before.inputs, warm=jnp.zeros_like(before.multipliers))
    assert bool(none.converged)
    assert_allclose(none.inputs, cold.inputs, atol=1e-6)


def test_multipliers_move_on_by_a_stage():
    p = program(1)
    flat = jnp.arange(float(len(p.bounds()[0])))
    upper, lower, parts = p.parts(flat)
    later = p.parts(p.shifted(flat))
    assert_allclose(later[0], np.vstack([upper[1:], upper[-1:]]))
    assert_allclose(later[1], np.vstack([lower[1:], lower[-1:]]))
    for rows, now, then in zip(p.rows, parts, later[2], strict=True):
        wanted = now if rows.over == "end" else np.concatenate([now[:, 1:], now[:, -1:]], axis=1)
        assert_allclose(then, wanted)


def test_a_failed_solve_says_so():
    p = program(0)
    few = solve_program(p, jnp.zeros((N, N_U)), max_iterations=3)
    assert not bool(few.converged)
    assert int(few.iterations) == 3
    lost = eqx.tree_at(lambda q: q.start, p, p.start.at[0].set(jnp.nan))
    assert not bool(solve(lost, jnp.zeros((N, N_U))).converged)


@pytest.mark.parametrize("power", [-6, 6])
def test_wide_weights_are_borne(power):
    """Costs of states against those of inputs, 1e-6 to 1e6 of what they were."""
    p = program(1, bound=0.5)
    p = eqx.tree_at(
        lambda q: (q.state_hessian, q.state_gradient), p,
        (10.0**power * p.state_hessian, 10.0 ** min(power, 0) * p.state_gradient),
    )  # fmt: skip
    found = solve(p, jnp.zeros((N, N_U)))
    assert bool(found.converged)
    least = cost(p, found.inputs)
    d = condensed_program(p)
    rng = np.random.default_rng(2)
    hard = ~np.isfinite(d.penalty)
    for size in (1e-1, 1e-3):
        for _ in range(50):
            # no allowed point nearby is better by more than the barrier of all pairs
            other = np.clip(found.inputs + size * rng.normal(size=(N, N_U)), p.lower, p.upper)
            values = d.rows @ other.reshape(-1)
            if np.all((values <= d.upper)[hard] & (values >= d.lower)[hard]):
                assert cost(p, other) > least - 1e-8 * 300 - 1e-12 * abs(least)


def test_a_batch_is_its_members():
    several = [program(1, far=far) for far in (0.0, 1.0, 4.0)]
    together = jax.tree.map(lambda *leaves: jnp.stack(leaves), *several)
    batch = jax.jit(jax.vmap(solve_program, in_axes=(0, None)))(together, jnp.zeros((N, N_U)))
    for k, p in enumerate(several):
        alone = solve(p, jnp.zeros((N, N_U)))
        assert int(alone.iterations) == int(batch.iterations[k])
        assert_allclose(batch.inputs[k], alone.inputs, atol=1e-10)


CHANGED = {
    "start": lambda q: q.start,
    "gradient": lambda q: q.stage_gradient,
    "hessian": lambda q: q.state_hessian,
    "dynamics": lambda q: q.dynamics.matrix,
    "normals": lambda q: q.rows[0].normals,
    "upper": lambda q: q.upper,
    "end": lambda q: q.rows[3].normals,
    "penalty": lambda q: q.rows[0].penalty,
}


def test_derivatives_are_implicit_and_right_both_ways():
    p = program(2, penalty=0.3, bound=0.3)
    weights = np.random.default_rng(5).normal(size=(N, N_U))
    rng = np.random.default_rng(6)
    along = {name: rng.normal(size=get(p).shape) for name, get in CHANGED.items()}
    along["hessian"] = along["hessian"] + np.swapaxes(along["hessian"], 1, 2)

    def of(shifts):
        changed = p
        for k, (name, get) in enumerate(CHANGED.items()):
            changed = eqx.tree_at(get, changed, get(changed) + shifts[k] * along[name])
        found = solve_program(changed, jnp.zeros((N, N_U)), barrier=1e-5, tolerance=1e-7)
        return jnp.sum(weights * found.inputs)

    none = jnp.zeros(len(CHANGED))
    forward = np.asarray(jax.jit(jax.jacfwd(of))(none))
    # a barrier of 1e-5 rounds the kinks, so that differences over 1e-6 are those of the slope
    moved = jax.jit(jax.vmap(of))(1e-6 * np.vstack([np.eye(len(none)), -np.eye(len(none))]))
    difference = (moved[: len(none)] - moved[len(none) :]) / 2e-6
    assert np.min(np.abs(forward)) > 1e-4, dict(zip(CHANGED, forward, strict=True))
    assert_allclose(forward, difference, rtol=1e-4)
    assert_allclose(jax.jit(jax.grad(of))(none), forward, rtol=1e-9)


def test_the_derivative_at_an_active_bound_is_the_bound_s_and_at_a_kink_between_two():
    """U is the least of 1.5 and the bound: slope 1 below, 0 above, their mean where both meet."""

    @jax.jit
    def slope(bound):
        def of(b):
            p = eqx.tree_at(lambda q: q.upper, scalar(), b * jnp.ones((1, 1)))
            return solve_program(p, jnp.zeros((1, 1))).inputs[0, 0]

        return jax.grad(of)(bound)

    # off the kink by 0.1 and the barrier's share: μ over the square of a slack of 0.1
    assert_allclose(slope(1.4), 1.0, atol=1e-5)
    assert_allclose(slope(1.6), 0.0, atol=1e-5)
    assert_allclose(slope(1.5), 0.5, atol=1e-3)


def test_it_can_go_to_c():
    refuse_what_c_has_not(jax.make_jaxpr(solve_program)(program(0), jnp.zeros((N, N_U))))
