"""Dry friction on axes that are known as a linear system only.

    u_acting = u - F(v)

with F of :mod:`~contourlab.machines.friction`, in units of the command, and v the axis's velocity.
What an identification gives has no place inside where friction acts; at the input is where a force
on a rigid axis stands.

Friction is held over a substep h at F(v), v being the velocity that the substep ends at: a backward
Euler step for friction alone, of first order in h, and exact in everything else,

    v = v_f - g F(v),                                                                   (1)

with v_f the end without friction and g the velocity that one unit of command makes in h. (1) is
solved for a sign that is straight within the smoothing velocity v_0 and flat beyond,

    v_a = v_f / (1 + g L / v_0)  if that is within v_0,  else  v_f - g L sign v_f,      (2)

L being the level at v_f, and then once with the secant k = F(v_a) / v_a: v = v_f / (1 + g k). Where
the axis slides this is (1) exactly, where it sticks it creeps as F says to the second order of
v / v_0. Since 0 <= v / v_f <= 1 friction only ever brakes, however long the substep.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import part
from contourlab.errors import ConfigurationError
from contourlab.machines.base import BoundDynamics, Dynamics, LinearModel, NominalModel
from contourlab.machines.drive import Drive
from contourlab.machines.friction import BoundFriction, Friction
from contourlab.machines.state_space import StateSpaceAxes
from contourlab.machines.state_space_motion import BoundStateSpaceAxes
from contourlab.machines.substeps import share
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundInputFriction", "InputFriction"]


class InputFriction(Dynamics):
    """An identified state space with dry friction at its input.

    Parameters
    ----------
    axes
        A continuous state space without cross-talk; a discrete one gives ``continuous()``.
    friction
        In units of the command.

    Raises
    ------
    ConfigurationError
        Axes that are no continuous state space, or one with cross-talk.
    """

    axes: StateSpaceAxes = part()
    friction: Friction = part()

    def __check_init__(self) -> None:
        if not isinstance(self.axes, StateSpaceAxes) or self.axes.sample_time is not None:
            raise ConfigurationError(
                "axes must be a continuous StateSpaceAxes: friction acts between the samples; "
                "take the continuous() form of a discrete one"
            )

    def check(self) -> None:
        """Check that a command moves its own axis only."""
        push = np.asarray(_pushes(self.axes.bind(self.axes.n_axes, (1e-3,), 1)))
        if np.any(push - np.eye(len(push)) * push):
            raise ConfigurationError("axes must be without cross-talk, each with its own friction")

    @property
    def uses_substeps(self) -> bool:
        """Always."""
        return True

    def check_axes(self, n_axes: int) -> None:
        """Check that friction and axes are for this many axes.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        self.axes.check_axes(n_axes)
        self.friction.check_axes(n_axes)

    def bind(self, n_axes: int, durations: tuple[Scalar, ...], substeps: int) -> BoundInputFriction:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period.
        """
        counts = share(substeps, durations)
        parts = tuple(
            self.axes.bind(n_axes, (d / count,), 1)
            for d, count in zip(durations, counts, strict=True)
        )
        pushes = jnp.stack([jnp.diagonal(_pushes(part)) for part in parts])
        return BoundInputFriction(parts, pushes, self.friction.bind(np.ones(n_axes)), counts)

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return what a law may know of the axes; it is not told of the friction.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """
        return self.axes.nominal(n_axes, drive)

    def linear(self, n_axes: int) -> LinearModel:
        """Return the axes without friction.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        return self.axes.linear(n_axes)


def _pushes(axes: BoundStateSpaceAxes) -> Array:
    """Return the velocities that one unit of each command makes in an interval, (n, n)."""
    n = int(axes.output.shape[0])
    rest, _ = axes.steady(jnp.zeros(n), jnp.zeros(n))
    rows = [axes.velocity(axes.advance(rest, (unit,), jnp.zeros(n))) for unit in jnp.eye(n)]
    return jnp.stack(rows, 1)


class BoundInputFriction(BoundDynamics):
    """Axes with friction at the input, for one sample time."""

    parts: tuple[BoundStateSpaceAxes, ...]
    """The axes over a substep of each part of the period."""
    pushes: Array
    """g of (1), per part and axis."""
    friction: BoundFriction
    counts: tuple[int, ...] = eqx.field(static=True)

    def steady(self, position: AxisVector, velocity: AxisVector) -> tuple[Any, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        state, command = self.parts[0].steady(position, velocity)
        return state, command + self.friction.deceleration(velocity)

    def advance(self, state: Any, commands: tuple[AxisVector, ...], disturbance: AxisVector) -> Any:
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
        for row, (axes, command) in enumerate(zip(self.parts, commands, strict=True)):
            push = self.pushes[row]

            def substep(
                now: Any,
                _: None,
                axes: BoundStateSpaceAxes = axes,
                push: Array = push,
                command: AxisVector = command,
            ) -> tuple[Any, None]:
                free = axes.velocity(axes.advance(now, (command,), disturbance))
                reach = 1.0 / self.friction.per_smoothing
                level = self.friction.secant(free) * jnp.abs(free)
                near = free / (1.0 + push * level / reach)
                slides = jnp.abs(near) > reach
                near = jnp.where(slides, free - push * level * jnp.sign(free), near)  # (2)
                slope = self.friction.secant(near)
                held = slope * free / (1.0 + push * slope)  # (1)
                return axes.advance(now, (command - held,), disturbance), None

            state = jax.lax.scan(substep, state, None, length=self.counts[row])[0]
        return state

    def position(self, state: Any) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.parts[0].position(state)

    def velocity(self, state: Any) -> AxisVector:
        """Return the true axis velocities [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.parts[0].velocity(state)
