"""How axes given by a state space move: one product per part of a control period."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.machines.base import BoundDynamics
from contourlab.typing import Array, AxisVector, Scalar, Vector

__all__ = ["BoundStateSpaceAxes", "StateSpaceState"]


class StateSpaceState(eqx.Module):
    """States of the model, and what drove it last."""

    modes: Vector
    drive: AxisVector
    """Command plus disturbance just before this instant."""
    velocity: AxisVector
    """Over the last period, of a discrete model that gives positions; else at this instant."""


class BoundStateSpaceAxes(BoundDynamics):
    """A state space for one sample time."""

    transition: Float[Array, "n_parts order order"]
    drive: Float[Array, "n_parts order n_axes"]
    output: Float[Array, "n_axes order"]
    """C to positions."""
    rate: Float[Array, "n_axes order"] | None
    """From states to velocity; None where only the difference is known."""
    feed: Float[Array, "n_axes n_axes"] | None
    """From commands to velocity."""
    whole: Float[Array, "size size"]
    """[[A, B], [C, 0]], with A - I in discrete time."""
    inverse: Float[Array, "size size"]
    """Of it."""
    period: Scalar | None
    """Of a discrete model [s]."""

    def steady(
        self, position: AxisVector, velocity: AxisVector
    ) -> tuple[StateSpaceState, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        Steady motion is x(t) = x₀ + w t under u(t) = u₀ + r t, in discrete time per period:
        A w + B r = 0 and C w = v, then A x₀ + B u₀ = w and C x₀ = q.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        order = self.transition.shape[-1]
        per_step = velocity if self.period is None else velocity * self.period

        def solve(right: Array) -> Array:
            found = self.inverse @ right
            return found + self.inverse @ (right - self.whole @ found)  # refined once

        moving = solve(jnp.concatenate([jnp.zeros(order), per_step]))
        found = solve(jnp.concatenate([moving[:order], position]))
        modes, command = found[:order], found[order:]
        return StateSpaceState(modes, command, velocity), command

    def advance(
        self,
        state: StateSpaceState,
        commands: tuple[AxisVector, ...],
        disturbance: AxisVector,
    ) -> StateSpaceState:
        """Return the state one control period later.

        Parameters
        ----------
        state
            State at its start.
        commands
            One per part of the period, shape (n_axes,) each.
        disturbance
            Added to the commands, shape (n_axes,).
        """
        modes, drive = state.modes, state.drive
        for part, command in enumerate(commands):
            drive = command + disturbance
            # products and sums: XLA fuses these, while a small matrix product is a call
            modes = jnp.sum(self.transition[part] * modes, -1)
            modes = modes + jnp.sum(self.drive[part] * drive, -1)
        if self.period is None or (self.rate is not None and self.feed is not None):
            assert self.rate is not None
            assert self.feed is not None
            velocity = jnp.sum(self.rate * modes, -1) + jnp.sum(self.feed * drive, -1)
        else:
            velocity = jnp.sum(self.output * (modes - state.modes), -1) / self.period
        return StateSpaceState(modes, drive, velocity)

    def position(self, state: StateSpaceState) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            State of the axes.
        """
        return jnp.sum(self.output * state.modes, -1)

    def velocity(self, state: StateSpaceState) -> AxisVector:
        """Return the true axis velocities just before this instant [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """
        return state.velocity
