"""A quadratic program over stages, solved by an interior point with a Riccati recursion.

With y_j = (x_j, u_j), over N stages,

    min  sum_j (y_j' H_j y_j / 2 + g_j' y_j) + x_N' H_N x_N / 2 + g_N' x_N
    x_0 given,  x_(j+1) = D y_j,  lower_j <= E_j y_j <= upper_j,            j = 0 .. N - 1   (1)

A row of E is *hard*, or *soft*: it may be exceeded by e >= 0 at the cost of ``penalty`` e. Up to
the penalty, which bounds its multiplier, a soft row acts as a hard one; beyond, it gives way. A
program whose hard rows can always be met by the inputs alone has a solution whatever x_0 is.

**Method.** Mehrotra's predictor and corrector on the optimality conditions of (1) with a barrier μ;
for one side of a row, with slack t, multiplier λ and excess e,

    a y + t - e = h,    t λ = μ,    e (ρ - λ) = μ.                                            (2)

Eliminating t and e leaves Δλ = w (a Δy + ...), w = 1 / (t/λ + e/(ρ - λ)), so that rows of both
kinds only add w a a' to the Hessians of their stage, and the Newton step is a linear-quadratic
problem without constraints, solved by one backward sweep and one forward sweep: O(N) work.
Predictor and corrector share the factors.

μ ends at ``barrier`` and not at 0: the answer is then a smooth function of the program. Its cost
exceeds the least by at most μ for each of the pairs of (2).

**In loops.** The number of iterations is bounded; all is plain arithmetic on arrays of fixed size,
the inverse of n_u x n_u matrices written out. Derivatives do not go through the iterations: these
see constants, and one Newton step follows at their end, the derivative of which is the implicit
one, forwards and backwards.

**Scaling** is the caller's: variables, costs and rows of order 1. Multipliers start at that order.

Predictor and corrector as Mehrotra chose them, and the Riccati recursion inside an interior point,
are common knowledge; all is derived from the optimality conditions.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.typing import Array, Count, Flag

__all__ = ["Multipliers", "Solution", "StagedProgram", "solve_program"]

START = 0.1
"""Slacks and barrier of a cold start."""
WARM = 1e-3
"""Barrier of a warm start."""
SETTLED = 1e-3
"""Greatest relative change of a multiplier in the last step but one."""
BOUNDARY = 0.995
"""Share of the way to the boundary that a step may go."""


class StagedProgram(eqx.Module):
    """The data of (1); bounds may be infinite, rows without either bound do nothing."""

    hessian: Float[Array, "n_stages n_y n_y"]
    """H_j, symmetric, positive semidefinite, and definite in the inputs."""
    gradient: Float[Array, "n_stages n_y"]
    """g_j."""
    terminal_hessian: Float[Array, "n_x n_x"]
    """H_N."""
    terminal_gradient: Float[Array, " n_x"]
    """g_N."""
    dynamics: Float[Array, "n_x n_y"]
    """D."""
    start: Float[Array, " n_x"]
    """x_0."""
    rows: Float[Array, "n_stages n_rows n_y"]
    """E_j."""
    lower: Float[Array, "n_stages n_rows"]
    upper: Float[Array, "n_stages n_rows"]
    penalty: Float[Array, " n_rows"]
    """ρ > 0 of a soft row, infinite for a hard one."""


class Multipliers(NamedTuple):
    """Where a solution stands against its bounds: sides lower and upper, shape (2, N, n_rows)."""

    slack: Array
    """t."""
    multiplier: Array
    """λ."""
    excess: Array
    """e, 0 where hard."""
    margin: Array
    """ρ - λ, which rounding would take from their difference; 1 where hard."""


class Solution(NamedTuple):
    """What was found."""

    states: Float[Array, "n_stages_plus_one n_x"]
    inputs: Float[Array, "n_stages n_u"]
    multipliers: Multipliers
    iterations: Count
    """Newton steps with two directions each; int32."""
    converged: Flag
    """Whether the last step was full and of less than ``tolerance``."""


class _Sides(NamedTuple):
    """Rows as inequalities, both sides: shape (2, N, n_rows)."""

    bound: Array
    """h, 0 where there is none."""
    penalty: Array
    """ρ, 1 where hard."""
    on: Array
    """1 where there is a bound, 0 elsewhere."""
    soft: Array
    """1 where it is soft, too."""


class _Iterate(NamedTuple):
    states: Array
    inputs: Array
    multipliers: Multipliers


class _Factors(NamedTuple):
    gain: Array
    """K, (N, n_u, n_x)."""
    inverse: Array
    """Inverse of the inputs' Hessian of the cost to go, (N, n_u, n_u)."""
    cost: Array
    """P after each stage, (N, n_x, n_x)."""


def solve_program(
    program: StagedProgram,
    inputs: Array,
    *,
    warm: Multipliers | None = None,
    max_iterations: int = 30,
    barrier: float = 1e-8,
    tolerance: float = 1e-6,
) -> Solution:
    """Return the solution of a program.

    Parameters
    ----------
    program
        Scaled to order 1.
    inputs
        Where to start, shape (N, n_u); need not be feasible.
    warm
        Of a program much like this one; with them the start is as near to the boundary as they.
    max_iterations
        Bound on the Newton steps; static.
    barrier
        μ at the end.
    tolerance
        Greatest change of a variable in the last step but one; what is left is its square.

    Returns
    -------
    Solution
        Not to be used if it has not converged, or is not finite.
    """
    fixed: StagedProgram = jax.lax.stop_gradient(program)
    sides = _sides(fixed)
    first = _start(fixed, sides, jax.lax.stop_gradient(inputs), jax.lax.stop_gradient(warm))

    def go_on(carry: Any) -> Any:
        _, count, done = carry
        return ~done & (count < max_iterations)

    def iterate(carry: Any) -> Any:
        now, count, _ = carry
        after, done = _step(fixed, sides, now, barrier, tolerance)
        return after, count + 1, done

    begin = (first, jnp.zeros((), jnp.int32), jnp.zeros((), bool))
    last, count, done = jax.lax.while_loop(go_on, iterate, begin)
    last = jax.lax.stop_gradient(last)
    end = _last_step(program, last, barrier)
    return Solution(end.states, end.inputs, end.multipliers, count, done)


def _sides(program: StagedProgram) -> _Sides:
    bound = jnp.stack([-program.lower, program.upper])
    on = jnp.isfinite(bound)
    soft = jnp.broadcast_to(jnp.isfinite(program.penalty), on.shape) & on
    penalty = jnp.where(jnp.isfinite(program.penalty), program.penalty, 1.0)
    return _Sides(
        jnp.where(on, bound, 0.0), jnp.broadcast_to(penalty, on.shape),
        on.astype(float), soft.astype(float),
    )  # fmt: skip


def _both(values: Array) -> Array:
    """Return rows as sides: what must not exceed ``bound``."""
    return jnp.stack([-values, values])


def _start(
    program: StagedProgram, sides: _Sides, inputs: Array, warm: Multipliers | None
) -> _Iterate:
    states = _roll_out(program, inputs)
    y = jnp.concatenate([states[:-1], inputs], axis=1)
    gap = sides.bound - _both(_times(program.rows, y))
    soft = sides.soft > 0.0
    lam = jnp.zeros_like(gap) if warm is None else jnp.where(sides.on > 0.0, warm.multiplier, 0.0)
    size = jnp.max(jnp.abs(_slope(program, y, states[-1], lam)))
    if warm is None:
        excess = jnp.where(soft, jnp.maximum(-gap, 0.0) + START, 0.0)
        slack = jnp.maximum(gap, 0.0) + jnp.where(soft | (gap < START), START, 0.0)
        multiplier = START * jnp.maximum(size, 1.0) / slack
    else:
        level = jnp.maximum(WARM, START * size)
        multiplier = jnp.maximum(lam, level / jnp.maximum(gap, 1.0))
        slack = jnp.maximum(gap, level / multiplier)
        excess = jnp.where(soft, jnp.maximum(slack - gap, level / sides.penalty), 0.0)
        slack = jnp.where(soft, gap + excess, slack)
    multiplier = jnp.where(soft, jnp.minimum(multiplier, 0.5 * sides.penalty), multiplier)
    on = sides.on > 0.0
    multiplier = jnp.where(on, multiplier, 0.0)
    return _Iterate(
        states, inputs,
        Multipliers(
            jnp.where(on, slack, 1.0), multiplier, excess,
            jnp.where(soft, sides.penalty - multiplier, 1.0),
        ),
    )  # fmt: skip


def _slope(program: StagedProgram, y: Array, end: Array, multiplier: Array) -> Array:
    """Return the slope of cost and multipliers over the inputs, through the dynamics."""
    forces, terminal = _forces(program, y, end, multiplier)
    n_x = end.shape[0]

    def stage(slope: Any, force: Any) -> tuple[Any, Any]:
        whole = force + slope @ program.dynamics
        return whole[:n_x], whole[n_x:]

    slopes: Array = jax.lax.scan(stage, terminal, forces, reverse=True)[1]
    return slopes


def _roll_out(program: StagedProgram, inputs: Array) -> Array:
    def stage(x: Any, u: Any) -> tuple[Any, Any]:
        after = program.dynamics @ jnp.concatenate([x, u])
        return after, after

    _, states = jax.lax.scan(stage, program.start, inputs)
    return jnp.concatenate([program.start[None], states])


def _times(rows: Array, y: Array) -> Array:
    """Return E_j y_j."""
    return jnp.sum(rows * y[:, None, :], axis=2)


def _transposed(rows: Array, values: Array) -> Array:
    """Return E_j' v_j."""
    return jnp.sum(rows * values[:, :, None], axis=1)


def _step(
    program: StagedProgram, sides: _Sides, now: _Iterate, barrier: float, tolerance: float
) -> tuple[_Iterate, Array]:
    """Return the iterate after one predictor and corrector, and whether it ends here."""
    t, lam, excess, nu = now.multipliers
    safe = jnp.where(sides.on > 0.0, lam, 1.0)
    weight = sides.on / (t / safe + excess / nu)
    factors = _factor(program, weight)
    pairs = jnp.sum(sides.on) + jnp.sum(sides.soft)
    y = jnp.concatenate([now.states[:-1], now.inputs], axis=1)
    gap = sides.on * (_both(_times(program.rows, y)) + t - excess - sides.bound)
    forces, terminal = _forces(program, y, now.states[-1], lam)

    def direction(products: tuple[Array, Array]) -> tuple[Array, Array, Multipliers]:
        r_t, r_e = products
        known = gap - r_t / safe + r_e / nu
        both = weight * known
        pull = _transposed(program.rows, both[1] - both[0])
        dx, du = _sweep(program, factors, forces + pull, terminal)
        dy = jnp.concatenate([dx[:-1], du], axis=1)
        d_lam = weight * (_both(_times(program.rows, dy)) + known)
        d_t = sides.on * (-r_t - t * d_lam) / safe
        d_e = (-r_e + excess * d_lam) / nu
        return dx, du, Multipliers(d_t, d_lam, d_e, -sides.soft * d_lam)

    def longest(d: Multipliers) -> Array:
        def reach(value: Array, change: Array, mask: Array) -> Array:
            falling = (mask > 0.0) & (change < 0.0)
            return jnp.min(jnp.where(falling, value / jnp.where(falling, -change, 1.0), jnp.inf))

        shares = [
            reach(t, d.slack, sides.on), reach(lam, d.multiplier, sides.on),
            reach(excess, d.excess, sides.soft), reach(nu, d.margin, sides.soft),
        ]  # fmt: skip
        return jnp.minimum(1.0, BOUNDARY * jnp.min(jnp.stack(shares)))

    def mean_product(d: Multipliers, share: Array) -> Array:
        a = sides.on * (t + share * d.slack) * (lam + share * d.multiplier)
        b = (excess + share * d.excess) * (nu + share * d.margin)
        return (jnp.sum(a) + jnp.sum(b)) / jnp.maximum(pairs, 1.0)

    *_, guess = direction((t * lam, excess * nu))
    share = longest(guess)
    none = jax.tree.map(jnp.zeros_like, guess)
    mean = mean_product(none, share)
    centring = (mean_product(guess, share) / jnp.maximum(mean, 1e-300)) ** 3
    target = jnp.maximum(jnp.minimum(centring, 1.0) * mean, barrier)
    # on the last steps the guess is of a point beyond the end: its curvature would lead off it
    # and of a guess that only a short step can follow only the share of that step counts
    bent = share**2 * (mean > 10.0 * barrier)
    dx, du, d = direction(
        (
            t * lam + bent * guess.slack * guess.multiplier - target,
            sides.soft * (excess * nu + bent * guess.excess * guess.margin - target),
        )
    )
    share = longest(d)
    after = _Iterate(
        now.states + share * dx, now.inputs + share * du,
        jax.tree.map(lambda value, change: value + share * change, now.multipliers, d),
    )  # fmt: skip
    moved = jnp.maximum(jnp.max(jnp.abs(dx)), jnp.max(jnp.abs(du)))
    turned = jnp.max(jnp.abs(d.multiplier) / safe + jnp.abs(d.margin) / nu)
    settled = (moved <= tolerance) & (turned <= SETTLED) & (target <= barrier)
    return after, settled


def _last_step(program: StagedProgram, now: _Iterate, barrier: float) -> _Iterate:
    """Return the iterate after a Newton step to μ = ``barrier``: the part that has derivatives."""
    sides = _sides(program)
    t, lam, excess, nu = now.multipliers
    safe = jnp.where(sides.on > 0.0, lam, 1.0)
    weight = sides.on / (t / safe + excess / nu)
    factors = _factor(program, weight)
    y = jnp.concatenate([now.states[:-1], now.inputs], axis=1)
    left = program.start - now.states[0], y @ program.dynamics.T - now.states[1:]
    gap = _both(_times(program.rows, y)) + t - excess - sides.bound
    dearer = sides.penalty - jax.lax.stop_gradient(sides.penalty)  # 0, with a derivative
    r_t = t * lam - barrier
    r_e = sides.soft * (excess * (nu + dearer) - barrier)
    known = gap - r_t / safe + r_e / nu
    both = weight * known
    forces, terminal = _forces(program, y, now.states[-1], lam)
    pull = _transposed(program.rows, both[1] - both[0])
    dx, du = _sweep(program, factors, forces + pull, terminal, left)
    dy = jnp.concatenate([dx[:-1], du], axis=1)
    d_lam = weight * (_both(_times(program.rows, dy)) + known)
    return _Iterate(
        now.states + dx, now.inputs + du,
        Multipliers(
            t + sides.on * (-r_t - t * d_lam) / safe, lam + d_lam,
            excess + (-r_e + excess * d_lam) / nu, nu - sides.soft * d_lam,
        ),
    )  # fmt: skip


def _forces(program: StagedProgram, y: Array, end: Array, multiplier: Array) -> tuple[Array, Array]:
    """Return the gradient of the cost with the rows' multipliers, per stage and at the end."""
    own = jnp.sum(program.hessian * y[:, None, :], axis=2) + program.gradient
    pull = _transposed(program.rows, multiplier[1] - multiplier[0])
    return own + pull, program.terminal_hessian @ end + program.terminal_gradient


def _factor(program: StagedProgram, weight: Array) -> _Factors:
    """Return the factors of a step: the Riccati recursion."""
    scaled = (weight[0] + weight[1])[:, :, None] * program.rows
    hessian = program.hessian + jnp.einsum("jma,jmb->jab", scaled, program.rows)
    d = program.dynamics
    n_x = d.shape[0]

    def stage(cost: Any, here: Any) -> tuple[Any, Any]:
        whole = here + d.T @ (cost @ d)
        inverse = _inverse(whole[n_x:, n_x:])
        gain = -inverse @ whole[n_x:, :n_x]
        before = whole[:n_x, :n_x] + whole[:n_x, n_x:] @ gain
        return 0.5 * (before + before.T), (gain, inverse, cost)

    _, factors = jax.lax.scan(stage, program.terminal_hessian, hessian, reverse=True)
    return _Factors(*factors)


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a small positive definite matrix, by Gauss and Jordan.

    Without exchanging rows, which a definite matrix does not need.
    """
    n = matrix.shape[0]
    left, right = matrix, jnp.eye(n)
    for k in range(n):
        pivot = 1.0 / left[k, k]
        mask = jnp.eye(n)[k]
        row, other = left[k] * pivot, right[k] * pivot
        column = (left[:, k] * (1.0 - mask))[:, None]
        left = left * (1.0 - mask)[:, None] + mask[:, None] * row - column * row
        right = right * (1.0 - mask)[:, None] + mask[:, None] * other - column * other
    return right


def _sweep(
    program: StagedProgram, factors: _Factors, forces: Array, terminal: Array,
    left: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the step of states and inputs; ``left`` is what the dynamics lack, if anything."""
    d = program.dynamics
    n_x = d.shape[0]
    first: Array = jnp.zeros(n_x) if left is None else left[0]
    lack = jnp.zeros((len(forces), n_x)) if left is None else left[1]

    def backwards(slope: Any, here: Any) -> tuple[Any, Any]:
        force, gain, inverse, cost, short = here
        ahead = slope if left is None else slope + cost @ short
        whole = force + ahead @ d
        return whole[:n_x] + whole[n_x:] @ gain, -inverse @ whole[n_x:]

    def forwards(x: Any, here: Any) -> tuple[Any, Any]:
        push, gain, short = here
        u = gain @ x + push
        after = d @ jnp.concatenate([x, u])
        after = after if left is None else after + short
        return after, (after, u)

    _, pushes = jax.lax.scan(
        backwards,
        terminal,
        (forces, factors.gain, factors.inverse, factors.cost, lack),
        reverse=True,
    )
    _, (states, inputs) = jax.lax.scan(forwards, first, (pushes, factors.gain, lack))
    return jnp.concatenate([first[None], states]), inputs
