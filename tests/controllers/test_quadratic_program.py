"""The quadratic program: optimality conditions of the dense problem, closed forms, derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.controllers.quadratic_program import StagedProgram, solve_program

N, N_X, N_U, N_ROWS = 12, 5, 2, 6
HARD = 2  # rows that bound the inputs
solve = jax.jit(solve_program)


def program(seed=0, *, far=1.0, penalty=10.0, bound=1.0):
    """Bounded inputs, soft bounds on combinations of states and inputs, one side left out."""
    rng = np.random.default_rng(seed)
    n_y = N_X + N_U
    factors = rng.normal(size=(N, 3, n_y))
    hessian = np.swapaxes(factors, 1, 2) @ factors
    hessian[:, np.arange(N_X, n_y), np.arange(N_X, n_y)] += 1e-2
    end = rng.normal(size=(2, N_X))
    rows = 0.3 * rng.normal(size=(N, N_ROWS, n_y))
    rows[:, :HARD] = np.eye(n_y)[N_X:]
    lower = np.full((N, N_ROWS), -bound)
    lower[:, HARD] = -np.inf
    return StagedProgram(
        hessian=jnp.asarray(hessian),
        gradient=jnp.asarray(rng.normal(size=(N, n_y))),
        terminal_hessian=jnp.asarray(end.T @ end),
        terminal_gradient=jnp.asarray(rng.normal(size=N_X)),
        dynamics=jnp.asarray(
            np.hstack([np.eye(N_X), np.zeros((N_X, N_U))]) + 0.1 * rng.normal(size=(N_X, n_y))
        ),
        start=jnp.asarray(0.3 * far * rng.normal(size=N_X)),
        rows=jnp.asarray(rows),
        lower=jnp.asarray(lower),
        upper=jnp.asarray(np.full((N, N_ROWS), bound)),
        penalty=jnp.asarray(np.where(np.arange(N_ROWS) < HARD, np.inf, penalty)),
    )


def dense(p):
    """The program in the inputs alone: y = a u + c stage by stage, and the end x = a u + c."""
    d = np.asarray(p.dynamics)
    a, c = np.zeros((N_X, N * N_U)), np.asarray(p.start)
    stages = []
    for j in range(N):
        pick = np.zeros((N_U, N * N_U))
        pick[:, j * N_U : (j + 1) * N_U] = np.eye(N_U)
        y_a, y_c = np.vstack([a, pick]), np.concatenate([c, np.zeros(N_U)])
        stages.append((y_a, y_c))
        a, c = d @ y_a, d @ y_c
    return stages, (a, c)


def slope_of_cost(p, inputs):
    """Gradient of the cost over all inputs, and the rows' values and slopes."""
    stages, (a, c) = dense(p)
    u = np.asarray(inputs).reshape(-1)
    slope = a.T @ (np.asarray(p.terminal_hessian) @ (a @ u + c) + np.asarray(p.terminal_gradient))
    values, slopes = [], []
    for j, (y_a, y_c) in enumerate(stages):
        y = y_a @ u + y_c
        slope = slope + y_a.T @ (np.asarray(p.hessian)[j] @ y + np.asarray(p.gradient)[j])
        values.append(np.asarray(p.rows)[j] @ y)
        slopes.append(np.asarray(p.rows)[j] @ y_a)
    return slope, np.stack(values), np.stack(slopes)


# One soft row in three is exceeded with the low penalty; the others hold.
@pytest.mark.parametrize(
    ("seed", "penalty", "bound"), [(0, 10.0, 1.0), (1, 0.3, 0.5), (2, 3.0, 0.2)]
)
def test_the_solution_meets_the_optimality_conditions(seed, penalty, bound):
    p = program(seed, penalty=penalty, bound=bound)
    found = solve(p, jnp.zeros((N, N_U)))
    assert bool(found.converged)
    slope, values, slopes = slope_of_cost(p, found.inputs)
    lam = np.asarray(found.multipliers.multiplier)
    balance = slope + np.einsum("jm,jmu->u", lam[1] - lam[0], slopes)
    # stationarity to rounding; the rest to the barrier, 1e-8, over multipliers of order 1
    assert_allclose(balance, 0.0, atol=1e-9)
    assert np.all(lam >= 0.0)
    rho = np.asarray(p.penalty)
    assert np.all(lam <= rho * (1.0 + 1e-12))
    over = np.stack([np.asarray(p.lower) - values, values - np.asarray(p.upper)])
    assert np.max(over[:, :, :HARD]) <= 0.0  # hard rows hold
    for side in range(2):
        within = over[side] < -1e-3
        assert np.max(lam[side][within], initial=0.0) < 1e-4  # slack rows do not push
        beyond = over[side] > 1e-3
        pushed = np.broadcast_to(rho, beyond.shape)[beyond] - lam[side][beyond]
        assert np.max(np.abs(pushed), initial=0.0) < 1e-4  # exceeded rows push fully
    assert np.max(lam[:, :, :HARD]) > 0.1  # the case has active hard rows
    if penalty < 1.0:
        assert np.max(over) > 1e-2  # and exceeded soft ones


def test_without_bounds_it_is_the_dense_least_squares_solution():
    p = program(3)
    free = eqx.tree_at(
        lambda q: (q.lower, q.upper), p, (jnp.full((N, N_ROWS), -jnp.inf),
                                          jnp.full((N, N_ROWS), jnp.inf))
    )  # fmt: skip
    found = solve(free, jnp.ones((N, N_U)))
    zero, _, _ = slope_of_cost(free, np.zeros((N, N_U)))
    columns = [slope_of_cost(free, e.reshape(N, N_U))[0] - zero for e in np.eye(N * N_U)]
    wanted = np.linalg.solve(np.stack(columns, axis=1), -zero)
    assert_allclose(found.inputs.reshape(-1), wanted, atol=1e-10 * np.max(np.abs(wanted)))
    assert not np.any(found.multipliers.multiplier)


def test_one_input_at_its_bound_in_closed_form():
    """x1 = x0 + u, cost (x1 - 3)²/2 + u²/2, |u| <= 1: u = 1, its multiplier 3 - x0 - 2 = 1."""
    p = StagedProgram(
        hessian=jnp.diag(jnp.array([0.0, 1.0]))[None], gradient=jnp.zeros((1, 2)),
        terminal_hessian=jnp.eye(1), terminal_gradient=jnp.array([-3.0]),
        dynamics=jnp.ones((1, 2)), start=jnp.zeros(1),
        rows=jnp.array([[[0.0, 1.0]]]), lower=-jnp.ones((1, 1)), upper=jnp.ones((1, 1)),
        penalty=jnp.array([jnp.inf]),
    )  # fmt: skip
    found = solve(p, jnp.zeros((1, 1)))
    assert_allclose(found.inputs, 1.0, atol=2e-8)  # the barrier over the multiplier
    assert_allclose(found.multipliers.multiplier[1], 1.0, atol=1e-7)
    soft = eqx.tree_at(lambda q: q.penalty, p, jnp.array([0.5]))
    # now u gives way until 3 - 2 u = 0.5
    assert_allclose(solve(soft, jnp.zeros((1, 1))).inputs, 1.25, atol=1e-7)


def test_a_warm_start_needs_fewer_iterations_and_finds_the_same():
    p = program(1, penalty=0.3, bound=0.5)
    before = solve(p, jnp.zeros((N, N_U)))
    moved = eqx.tree_at(lambda q: q.start, p, p.start + 1e-3)
    cold = solve(moved, before.inputs)
    warm = solve(moved, before.inputs, warm=before.multipliers)
    assert int(warm.iterations) < int(cold.iterations)
    assert_allclose(warm.inputs, cold.inputs, atol=1e-9)


def test_a_failed_solve_says_so():
    p = program(0)
    few = solve_program(p, jnp.zeros((N, N_U)), max_iterations=3)
    assert not bool(few.converged)
    assert int(few.iterations) == 3
    lost = eqx.tree_at(lambda q: q.start, p, p.start.at[0].set(jnp.nan))
    assert not bool(solve(lost, jnp.zeros((N, N_U))).converged)


def test_a_start_with_the_multiplier_of_a_hard_row_at_one_is_no_accident():
    """The cold start's multiplier of a row at its bound: 1, which is also its idle penalty."""
    p = program(0)
    still = eqx.tree_at(
        lambda q: (q.start, q.gradient, q.terminal_gradient, q.lower), p,
        (0.0 * p.start, 1e-3 * p.gradient, 0.0 * p.terminal_gradient, p.lower.at[:, 0].set(0.0)),
    )  # fmt: skip
    assert bool(solve(still, jnp.zeros((N, N_U))).converged)


def test_a_batch_is_its_members():
    several = [program(1, far=far) for far in (0.0, 1.0, 4.0)]
    together = jax.tree.map(lambda *leaves: jnp.stack(leaves), *several)
    batch = jax.jit(jax.vmap(solve_program, in_axes=(0, None)))(together, jnp.zeros((N, N_U)))
    for k, p in enumerate(several):
        alone = solve(p, jnp.zeros((N, N_U)))
        assert int(alone.iterations) == int(batch.iterations[k])
        assert_allclose(batch.inputs[k], alone.inputs, atol=1e-10)


@pytest.mark.parametrize("name", ["start", "gradient", "hessian", "rows", "upper", "penalty"])
def test_derivatives_are_implicit_and_right_both_ways(name):
    p = program(1, penalty=0.3, bound=0.5)
    weights = np.random.default_rng(5).normal(size=(N, N_U))
    value = getattr(p, name)
    along = np.random.default_rng(6).normal(size=value.shape)
    if name == "hessian":
        along = along + np.swapaxes(along, 1, 2)
    along = np.where(np.isfinite(value), along, 0.0)

    @jax.jit
    def of(shift):
        changed = eqx.tree_at(lambda q: getattr(q, name), p, value + shift * along)
        return jnp.sum(weights * solve_program(changed, jnp.zeros((N, N_U)), barrier=1e-5).inputs)

    forward = float(jax.jit(lambda: jax.jvp(of, (0.0,), (1.0,))[1])())
    # a barrier of 1e-5 rounds the kinks, so that differences over 1e-6 are those of the slope
    difference = (float(of(1e-6)) - float(of(-1e-6))) / 2e-6
    assert abs(forward) > 1e-4
    assert_allclose(forward, difference, rtol=1e-4)
    assert_allclose(float(jax.jit(jax.grad(of))(0.0)), forward, rtol=1e-9)


def test_nothing_in_it_needs_lapack():
    text = str(jax.make_jaxpr(solve_program)(program(0), jnp.zeros((N, N_U))))
    for name in ("cholesky", "lu", "triangular_solve", "custom_linear_solve", "eigh", "svd"):
        assert f" {name}[" not in text
