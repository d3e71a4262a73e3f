"""Axes whose drive answers late: a first-order lag between the command and what acts.

    τ a' + a = u,    a drives the axes in place of u        (each axis on its own)

u is held between samples, a then follows an exponential; it is handed to the axes as its exact mean
over each of ``pieces`` parts of the interval. What that leaves is of second order in their length.
The lag stands for the current loop or the amplifier; the clip of the drive is before it.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.machines.base import BoundDynamics, Dynamics, NominalModel, PerAxis, per_axis
from contourlab.machines.drive import Drive
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundLaggedAxes", "LaggedAxes", "LaggedState"]


class LaggedState(eqx.Module):
    """Motion of the axes, and what drives them now."""

    axes: Any
    acting: AxisVector
    """a, in units of the command."""


class LaggedAxes(Dynamics):
    """Axes behind a lagging drive."""

    axes: Dynamics = part()
    """The axes that are driven."""
    time_constant: PerAxis = real(unit="s", above=0.0, ndim=1)
    """τ."""
    pieces: int = static(minimum=1, default=4)
    """Parts of a control period over which a is averaged."""

    @property
    def uses_substeps(self) -> bool:
        """Whether those of the axes do."""
        return self.axes.uses_substeps

    def check_axes(self, n_axes: int) -> None:
        """Check that the lag and the axes are for this many axes.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        per_axis("time_constant", self.time_constant, n_axes)
        self.axes.check_axes(n_axes)

    def bind(self, n_axes: int, durations: tuple[Scalar, ...], substeps: int) -> BoundLaggedAxes:
        """Return the axes discretised for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period of the axes.
        """
        short = tuple(d / self.pieces for d in durations for _ in range(self.pieces))
        lengths = jnp.stack([jnp.asarray(d, float) for d in durations])[:, None] / self.pieces
        z = lengths / per_axis("time_constant", self.time_constant, n_axes)
        decay = jnp.exp(-z)
        return BoundLaggedAxes(
            self.axes.bind(n_axes, short, substeps), decay, -jnp.expm1(-z) / z, self.pieces
        )

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return what a law may know of the axes; it is not told of the lag.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """
        return self.axes.nominal(n_axes, drive)


class BoundLaggedAxes(BoundDynamics):
    """Lagging axes for one sample time."""

    axes: BoundDynamics
    decay: Float[Array, "n_parts n_axes"]
    """e^(-h/τ) over one piece of each part."""
    mean: Float[Array, "n_parts n_axes"]
    """Mean of e^(-t/τ) over it."""
    pieces: int = eqx.field(static=True)

    def steady(self, position: AxisVector, velocity: AxisVector) -> tuple[LaggedState, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        axes, command = self.axes.steady(position, velocity)
        return LaggedState(axes, command), command

    def advance(
        self, state: LaggedState, commands: tuple[AxisVector, ...], disturbance: AxisVector
    ) -> LaggedState:
        """Return the state one control period later.

        Parameters
        ----------
        state
            State at its start.
        commands
            One per part of the period, shape (n_axes,) each.
        disturbance
            Effort over the whole period, shape (n_axes,).
        """
        acting, means = state.acting, []
        for row, command in enumerate(commands):
            for _ in range(self.pieces):
                behind = acting - command
                means.append(command + behind * self.mean[row])
                acting = command + behind * self.decay[row]
        return LaggedState(self.axes.advance(state.axes, tuple(means), disturbance), acting)

    def position(self, state: LaggedState) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.axes.position(state.axes)

    def velocity(self, state: LaggedState) -> AxisVector:
        """Return the true axis velocities [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.axes.velocity(state.axes)

    def motor_position(self, state: LaggedState) -> AxisVector:
        """Return what an ideal encoder on the motor shows [m].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.axes.motor_position(state.axes)

    def motor_velocity(self, state: LaggedState) -> AxisVector:
        """Return the velocity of the motor in travel of the axis [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.axes.motor_velocity(state.axes)
