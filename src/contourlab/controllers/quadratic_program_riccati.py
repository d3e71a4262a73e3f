"""The Newton step of a program over stages: a linear-quadratic problem, by a Riccati recursion.

With the weights of the inequalities in its Hessians, the step is the minimum of a quadratic cost
over (x, u) under the dynamics alone. Backwards over the stages, V being the cost to go without that
of the stage's own end,

    W = D' (V_(j+1) + C_(j+1)) D + R,      V_j = W with u eliminated                           (1)

where inputs are eliminated one after the other, the last first: with the row (g', p) of u_k in what
is left of W, u_k = -(g' y + q_k) / p, and what is left loses g g' / p. No inverse is formed, and
dividing is all that is asked of a pivot: each is at least the least eigenvalue of W over u.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from contourlab.controllers.quadratic_program_stages import Dynamics, StagedProgram, widened
from contourlab.typing import Array

__all__ = ["Factors", "factor", "sweep"]


class Factors(NamedTuple):
    """Of a step, whatever its right-hand side."""

    gains: Array
    """g / p of each input, over (x, u before it), 0 beyond; (N, n_u, n_y)."""
    inverse: Array
    """1 / p, (N, n_u)."""
    cost: Array
    """V + C at the end of each stage, (N, n_x, n_x)."""


def factor(program: StagedProgram, weights: Array) -> Factors:
    """Return the factors for weights on the inequalities.

    Parameters
    ----------
    program
        Hessians and normals.
    weights
        Shape (n_inequalities,), >= 0.
    """
    d = program.dynamics
    n_x, n_y = d.n_states, program.stage_hessian.shape[0]
    on_state, diagonal, on_stage = program.weighted(weights)
    on_state = on_state + widened(program.state_hessian, on_state.shape[-1], 2)

    def stage(cost: Any, here: Any) -> tuple[Any, Any]:
        state, diagonal, more = here
        cost = cost + widened(state, n_x, 2)
        whole = program.stage_hessian + d.back(d.back(cost).T)  # (1)
        left = whole if more is None else whole + more
        gains, inverses = [], []
        for k in range(n_y - 1, n_x - 1, -1):
            inverse = 1.0 / (left[k, k] + diagonal[k - n_x])
            row = left[k, :k]
            gain = row * inverse
            left = left[:k, :k] - gain[:, None] * row
            gains.append(widened(gain, n_y, 1))
            inverses.append(inverse)
        out = jnp.stack(gains[::-1]), jnp.stack(inverses[::-1]), cost
        return 0.5 * (left + left.T), out

    _, factors = jax.lax.scan(
        stage, jnp.zeros((n_x, n_x)), (on_state, diagonal, on_stage), reverse=True
    )
    return Factors(*factors)


def sweep(
    dynamics: Dynamics, factors: Factors, on_state: Array, on_stage: Array,
    left: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the step of states and inputs.

    Parameters
    ----------
    dynamics
        D.
    factors
        Of the Hessians.
    on_state, on_stage
        Forces: the gradient over z_(j+1) and over y_j, shapes (N, n) and (N, n_y).
    left
        What x_0 and the dynamics lack, shapes (n_x,) and (N, n_x); nothing if not given.
    """
    n_x, n_u = dynamics.n_states, factors.inverse.shape[1]
    first: Array = jnp.zeros(n_x) if left is None else left[0]
    lack = None if left is None else left[1]

    def backwards(slope: Any, here: Any) -> tuple[Any, Any]:
        state, stage, gains, inverse, cost, short = here
        ahead = slope + widened(state, n_x, 1)
        ahead = ahead if short is None else ahead + cost @ short
        whole = stage + dynamics.back(ahead)
        pushes = []
        for k in range(n_u - 1, -1, -1):
            force = whole[n_x + k]
            pushes.append(-inverse[k] * force)
            whole = whole - force * gains[k]
        return whole[:n_x], jnp.stack(pushes[::-1])

    def forwards(x: Any, here: Any) -> tuple[Any, Any]:
        push, gains, short = here
        y = x
        for k in range(n_u):
            u = push[k] - gains[k, : n_x + k] @ y
            y = jnp.append(y, u)
        after = dynamics.ahead(y)
        after = after if short is None else after + short
        return after, (after, y[n_x:])

    costs = None if left is None else factors.cost
    _, pushes = jax.lax.scan(
        backwards, jnp.zeros(n_x),
        (on_state, on_stage, factors.gains, factors.inverse, costs, lack), reverse=True,
    )  # fmt: skip
    _, (states, inputs) = jax.lax.scan(forwards, first, (pushes, factors.gains, lack))
    return jnp.concatenate([first[None], states]), inputs
