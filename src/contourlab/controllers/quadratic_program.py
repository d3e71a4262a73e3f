"""A quadratic program over stages, solved by an interior point with a Riccati recursion.

The program is (1) of :mod:`~contourlab.controllers.quadratic_program_stages`. One whose hard rows
can always be met by the inputs alone has a solution whatever x_0 is.

**Method.** Mehrotra's predictor and corrector on the optimality conditions with a barrier μ; for
one inequality, with slack t, multiplier λ and excess e (0 if it is hard),

    a y + t - e = h,    t λ = μ,    e (ρ - λ) = μ.                                            (2)

Eliminating t and e leaves Δλ = w (a Δy + ...), w = 1 / (t/λ + e/(ρ - λ)), so that inequalities of
both kinds only add w a a' to the Hessians of their stage, and the Newton step is a linear-quadratic
problem without constraints, solved by one backward sweep and one forward sweep: O(N) work
(:mod:`~contourlab.controllers.quadratic_program_riccati`). Predictor and corrector share the
factors.

μ ends at ``barrier`` and not at 0: the answer is then a smooth function of the program. Its cost
exceeds the least by at most μ for each of the pairs of (2).

**In loops.** The number of iterations is bounded; all is plain arithmetic on arrays of fixed size.

**Derivatives** are those of the answer at ``barrier``, forwards and backwards, by the conditions
(2) that it meets: they do not go through the iterations and cost one more Newton step. Where a row
is clearly active or clearly not they are the program's own. Where that changes, the program's
answer has a kink, one derivative to its left and another to its right; the answer at ``barrier``
is rounded there, over a width of the order of μ over the multipliers, and its derivative is between
the two. Differences over more than that width do not see it.

**Scaling** is the caller's: variables, costs and rows of order 1. Multipliers start at that order.

Predictor and corrector as Mehrotra chose them, and the Riccati recursion inside an interior point,
are common knowledge; all is derived from the optimality conditions.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.controllers.quadratic_program_riccati import factor, sweep
from contourlab.controllers.quadratic_program_stages import StagedProgram
from contourlab.typing import Array, Count, Flag, Scalar

__all__ = ["Solution", "solve_program"]

START = 0.1
"""Slacks and barrier of a cold start."""
WARM = 1e-3
"""Least barrier of a warm start."""
MISFIT = 0.03
"""Barrier of a warm start over the largest slope that its multipliers leave."""
SETTLED = 0.5
"""Greatest relative change of a multiplier in the last step."""
BOUNDARY = 0.999
"""Share of the way to the boundary that a step may go."""
REFINED = 4
"""Newton steps before derivatives are taken: the last of the iterations is not exact enough."""


class Solution(NamedTuple):
    """What was found."""

    states: Float[Array, "n_stages_plus_one n_x"]
    inputs: Float[Array, "n_stages n_u"]
    multipliers: Float[Array, " n_inequalities"]
    """λ, in the order of the program's inequalities."""
    excess: Float[Array, " n_soft"]
    """e of the soft ones."""
    iterations: Count
    """Newton steps with two directions each; int32."""
    converged: Flag
    """Whether the last step was full and of less than ``tolerance``."""


class _Iterate(NamedTuple):
    """Where the iteration stands; e and ρ - λ are of the soft inequalities, which come last."""

    states: Array
    inputs: Array
    slack: Array
    multiplier: Array
    excess: Array
    margin: Array
    """ρ - λ, which rounding would take from their difference."""


class _Inequalities(NamedTuple):
    bound: Array
    """h, 0 where there is none."""
    penalty: Array
    """ρ of the soft ones."""
    on: Array
    """1 where there is a bound, 0 elsewhere."""
    soft: Array
    """``on`` of the soft ones."""


def solve_program(
    program: StagedProgram,
    inputs: Array,
    *,
    warm: Array | None = None,
    max_iterations: int = 30,
    barrier: float = 1e-8,
    tolerance: float = 3e-4,
) -> Solution:
    """Return the solution of a program.

    Parameters
    ----------
    program
        Scaled to order 1.
    inputs
        Where to start, shape (N, n_u); need not be feasible.
    warm
        Multipliers of a program much like this one; with them the start is as near to the boundary
        as they. Zeros are no worse than none.
    max_iterations
        Bound on the Newton steps; static.
    barrier
        μ at the end.
    tolerance
        Greatest change of a variable in the last step; what is left is of the order of its square.

    Returns
    -------
    Solution
        Not to be used if it has not converged, or is not finite.
    """
    fixed: StagedProgram = jax.lax.stop_gradient(program)
    what = _inequalities(fixed)
    first = _start(fixed, what, jax.lax.stop_gradient(inputs), jax.lax.stop_gradient(warm))

    def go_on(carry: Any) -> Any:
        _, count, done = carry
        return ~done & (count < max_iterations)

    def iterate(carry: Any) -> Any:
        now, count, _ = carry
        after, done = _step(fixed, what, now, barrier, tolerance)
        return after, count + 1, done

    begin = (first, jnp.zeros((), jnp.int32), jnp.zeros((), bool))
    last, count, done = jax.lax.while_loop(go_on, iterate, begin)
    end = _with_derivatives(program, jax.lax.stop_gradient(last), barrier)
    return Solution(end.states, end.inputs, end.multiplier, end.excess, count, done)


def _inequalities(program: StagedProgram) -> _Inequalities:
    bound, penalty = program.bounds()
    on = jnp.isfinite(bound)
    soft = on[len(bound) - len(penalty) :]
    return _Inequalities(jnp.where(on, bound, 0.0), penalty, on.astype(float), soft.astype(float))


def _of_soft(values: Array, like: Array) -> Array:
    """Return a vector of the soft inequalities as one of all."""
    return jnp.concatenate([jnp.zeros(len(like) - len(values)), values])


def _start(
    program: StagedProgram, what: _Inequalities, inputs: Array, warm: Array | None
) -> _Iterate:
    states = _roll_out(program, inputs)
    gap = what.bound - program.values(states, inputs)
    first = len(gap) - len(what.penalty)
    on = what.on > 0.0
    soft = _of_soft(what.soft, gap) > 0.0
    penalty = _of_soft(what.penalty, gap)
    lam = jnp.zeros_like(gap) if warm is None else jnp.where(on, warm, 0.0)
    size = jnp.max(jnp.abs(_slope(program, states, inputs, lam)))
    if warm is None:
        excess = jnp.where(soft, jnp.maximum(-gap, 0.0) + START, 0.0)
        slack = jnp.maximum(gap, 0.0) + jnp.where(soft | (gap < START), START, 0.0)
        multiplier = START * jnp.maximum(size, 1.0) / slack
    else:
        level = jnp.maximum(WARM, MISFIT * size)
        multiplier = jnp.maximum(lam, level / jnp.maximum(gap, 1.0))
        slack = jnp.maximum(gap, level / multiplier)
        dear = jnp.where(soft, penalty, 1.0)
        excess = jnp.where(soft, jnp.maximum(slack - gap, level / dear), 0.0)
        slack = jnp.where(soft, gap + excess, slack)
    multiplier = jnp.where(soft, jnp.minimum(multiplier, 0.5 * penalty), multiplier)
    multiplier = jnp.where(on, multiplier, 0.0)
    return _Iterate(
        states, inputs, jnp.where(on, slack, 1.0), multiplier, excess[first:],
        jnp.where(what.soft > 0.0, what.penalty - multiplier[first:], 1.0),
    )  # fmt: skip


def _slope(program: StagedProgram, states: Array, inputs: Array, multiplier: Array) -> Array:
    """Return the slope of cost and multipliers over the inputs, through the dynamics."""
    n_x = program.dynamics.n_states

    def stage(slope: Any, force: Any) -> tuple[Any, Any]:
        state, own = force
        ahead = slope.at[: len(state)].add(state)
        whole = own + program.dynamics.back(ahead)
        return whole[:n_x], whole[n_x:]

    slopes: Array = jax.lax.scan(
        stage, jnp.zeros(n_x), _forces(program, states, inputs, multiplier), reverse=True
    )[1]
    return slopes


def _roll_out(program: StagedProgram, inputs: Array) -> Array:
    def stage(x: Any, u: Any) -> tuple[Any, Any]:
        after = program.dynamics.ahead(jnp.concatenate([x, u]))
        return after, after

    _, states = jax.lax.scan(stage, program.start, inputs)
    return jnp.concatenate([program.start[None], states])


def _forces(
    program: StagedProgram, states: Array, inputs: Array, multiplier: Array
) -> tuple[Array, Array]:
    """Return the gradient of cost and multipliers over z_(j+1) and over y_j."""
    on_state, on_stage = program.pull(multiplier)
    y = jnp.concatenate([states[:-1], inputs], axis=1)
    n_z = program.state_hessian.shape[-1]
    own = program.state_gradient + jnp.sum(program.state_hessian * states[1:, None, :n_z], axis=2)
    more = jnp.zeros((len(own), on_state.shape[1] - n_z))
    return (
        on_state + jnp.concatenate([own, more], axis=1),
        on_stage + program.stage_gradient + y @ program.stage_hessian,
    )


class _Newton:
    """The linear equations of (2) about an iterate, and their solutions."""

    def __init__(self, program: StagedProgram, what: _Inequalities, now: _Iterate) -> None:
        self.program, self.what, self.now = program, what, now
        self.inverse = 1.0 / jnp.where(what.on > 0.0, now.multiplier, 1.0)
        self.thin = 1.0 / now.margin
        loose = now.slack * self.inverse + _of_soft(now.excess * self.thin, now.slack)
        self.weight = what.on / loose
        self.factors = factor(program, self.weight)
        values = program.values(now.states, now.inputs)
        excess = _of_soft(now.excess, values)
        self.gap = what.on * (values + now.slack - excess - what.bound)
        self.forces = _forces(program, now.states, now.inputs, now.multiplier)

    def direction(
        self, slack_product: Array, excess_product: Array,
        left: tuple[Array, Array] | None = None,
    ) -> _Iterate:  # fmt: skip
        """Return the step that takes products t λ and e (ρ - λ) away, and what is ``left``."""
        program, now = self.program, self.now
        of_excess = _of_soft(excess_product * self.thin, self.gap)
        known = self.gap - slack_product * self.inverse + of_excess
        state, stage = program.pull(self.weight * known)
        dx, du = sweep(
            program.dynamics, self.factors, self.forces[0] + state, self.forces[1] + stage, left
        )
        d_lam = self.weight * (program.values(dx, du) + known)
        of_soft = d_lam[len(d_lam) - len(now.margin) :]
        return _Iterate(
            dx, du, self.what.on * (-slack_product - now.slack * d_lam) * self.inverse, d_lam,
            (-excess_product + now.excess * of_soft) * self.thin, -self.what.soft * of_soft,
        )  # fmt: skip

    def longest(self, d: _Iterate) -> Array:
        """Return how much of a step keeps t, λ, e and ρ - λ above 0, at most all of it."""
        now = self.now

        def reach(value: Array, change: Array) -> Array:
            # where there is no bound nothing changes
            falling = change < 0.0
            return jnp.min(
                jnp.where(falling, value / jnp.where(falling, -change, 1.0), jnp.inf),
                initial=jnp.inf,
            )

        share = jnp.minimum(
            jnp.minimum(reach(now.slack, d.slack), reach(now.multiplier, d.multiplier)),
            jnp.minimum(reach(now.excess, d.excess), reach(now.margin, d.margin)),
        )
        return jnp.minimum(1.0, BOUNDARY * share)

    def products(self, d: _Iterate, share: Array) -> Array:
        """Return the sum of t λ and e (ρ - λ) after a share of a step."""
        now = self.now
        a = (now.slack + share * d.slack) * (now.multiplier + share * d.multiplier)
        b = (now.excess + share * d.excess) * (now.margin + share * d.margin)
        return jnp.sum(self.what.on * a) + jnp.sum(self.what.soft * b)


def _step(
    program: StagedProgram, what: _Inequalities, now: _Iterate, barrier: float, tolerance: float
) -> tuple[_Iterate, Array]:
    """Return the iterate after one predictor and corrector, and whether it ends here."""
    newton = _Newton(program, what, now)
    pairs = jnp.maximum(jnp.sum(what.on) + jnp.sum(what.soft), 1.0)
    whole, over = now.slack * now.multiplier, now.excess * now.margin
    mean = (jnp.sum(what.on * whole) + jnp.sum(what.soft * over)) / pairs
    guess = newton.direction(whole, over)
    share = newton.longest(guess)
    centring = (newton.products(guess, share) / pairs / jnp.maximum(mean, 1e-300)) ** 3
    target = jnp.maximum(jnp.minimum(centring, 1.0) * mean, barrier)
    # on the last steps the guess is of a point beyond the end: its curvature would lead off it
    # and of a guess that only a short step can follow only the share of that step counts
    bent = share**2 * (mean > 10.0 * barrier)
    d = newton.direction(
        whole + bent * guess.slack * guess.multiplier - target,
        what.soft * (over + bent * guess.excess * guess.margin - target),
    )
    share = newton.longest(d)
    after = _Iterate(*(value + share * change for value, change in zip(now, d, strict=True)))
    moved = jnp.maximum(jnp.max(jnp.abs(d.states)), jnp.max(jnp.abs(d.inputs)))
    turned = jnp.max(jnp.abs(d.multiplier) * newton.inverse)
    turned = jnp.maximum(turned, jnp.max(jnp.abs(d.margin) * newton.thin, initial=0.0))
    settled = (moved <= tolerance) & (turned <= SETTLED) & (target <= barrier)
    return after, settled


def _newton_step(program: StagedProgram, now: _Iterate, barrier: Scalar) -> _Iterate:
    """Return the iterate after a whole Newton step to μ = ``barrier``."""
    what = _inequalities(program)
    newton = _Newton(program, what, now)
    y = jnp.concatenate([now.states[:-1], now.inputs], axis=1)
    left = program.start - now.states[0], jax.vmap(program.dynamics.ahead)(y) - now.states[1:]
    dearer = what.penalty - jax.lax.stop_gradient(what.penalty)  # 0, with a derivative
    d = newton.direction(
        now.slack * now.multiplier - barrier,
        what.soft * (now.excess * (now.margin + dearer) - barrier),
        left,
    )
    return _Iterate(*(value + change for value, change in zip(now, d, strict=True)))


@jax.custom_jvp
def _with_derivatives(program: StagedProgram, now: _Iterate, barrier: Any) -> _Iterate:
    """Return the iterate, as a function of the program."""
    del program, barrier
    return now


@_with_derivatives.defjvp
def _tangent(primals: Any, tangents: Any) -> tuple[_Iterate, _Iterate]:
    program, now, barrier = primals
    exact = jax.lax.fori_loop(0, REFINED, lambda _, z: _newton_step(program, z, barrier), now)
    exact = jax.lax.stop_gradient(exact)
    _, along = jax.jvp(lambda p: _newton_step(p, exact, barrier), (program,), (tangents[0],))
    return now, along
