"""Rigid axes with presliding: before it slides, dry friction is a spring with hysteresis.

    M q'' + B q' + F(q') z = K u + F_c(q) + d,    dz/dq = (1 - z sign q') / x_0          (1)

z in [-1, 1] is the share of the friction level that acts: a contact that is pushed one way over
some x_0 slides, and turned round it is first unloaded as a spring of stiffness F / x_0 (Dahl's
model). F(v) = F_c + (F_s - F_c) exp(-(v / v_s)²) is the level. With a reversal of an axis the
friction does not jump but turns round over some x_0, which a law that takes it for a function of
velocity does not know.

Over a substep of displacement Δ, (1) is solved in closed form, z⁺ = σ + (z - σ) e^(-|Δ| / x_0) with
σ the sign of Δ; the force is held at its value in the predicted middle (of second order, explicit):
a substep must be short beside the period of the spring, 2π sqrt(M x_0 / F).

References
----------
.. [HuYaoWang] has no presliding: this is for machines that are said to have it.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real
from contourlab.errors import ConfigurationError
from contourlab.machines.base import BoundDynamics, Dynamics, NominalModel, PerAxis, per_axis
from contourlab.machines.cogging import BoundCogging, Cogging, bind_cogging
from contourlab.machines.drive import Drive
from contourlab.machines.exponential import phi_2
from contourlab.machines.substeps import lengths_of, share
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundPreslidingAxes", "PreslidingAxes", "PreslidingState"]


class PreslidingState(eqx.Module):
    """True motion of the axes, and how far their contacts are bent."""

    position: AxisVector
    """[m]"""
    velocity: AxisVector
    """[m/s]"""
    bend: AxisVector
    """z, share of the friction level that acts."""


class PreslidingAxes(Dynamics):
    """Independent masses with viscous friction and dry friction with presliding.

    A single number holds for every axis.
    """

    mass: PerAxis = real(above=0.0, ndim=1)
    """M [effort per m/s²]."""
    viscous: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """B [effort per m/s]."""
    gain: PerAxis = real(above=0.0, ndim=1, default=1.0)
    """K [effort per unit of command]."""
    coulomb: PerAxis = real(minimum=0.0, ndim=1)
    """F_c, sliding friction at speed [effort]."""
    breakaway: PerAxis | None = real(minimum=0.0, ndim=1, default=None)
    """F_s [effort]; as large as ``coulomb`` if not given."""
    stribeck_velocity: PerAxis = real(unit="m/s", above=0.0, ndim=1, default=1e-2)
    """v_s [m/s]."""
    presliding_distance: PerAxis = real(unit="m", above=0.0, ndim=1)
    """x_0 [m]."""
    cogging: tuple[Cogging, ...] = part(default=())
    """Harmonics of the cogging."""

    @property
    def uses_substeps(self) -> bool:
        """Always."""
        return True

    def check(self) -> None:
        """Check that breakaway is not below Coulomb."""
        if self.breakaway is not None and not np.all(
            np.asarray(self.breakaway) >= np.asarray(self.coulomb)
        ):
            raise ConfigurationError(
                f"breakaway must be >= coulomb, got breakaway {self.breakaway} and coulomb "
                f"{self.coulomb}"
            )

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        for name in (
            "mass", "viscous", "gain", "coulomb", "stribeck_velocity", "presliding_distance"
        ):  # fmt: skip
            per_axis(name, getattr(self, name), n_axes)
        if self.breakaway is not None:
            per_axis("breakaway", self.breakaway, n_axes)
        for harmonic in self.cogging:
            harmonic.check_axes(n_axes)

    def bind(
        self, n_axes: int, durations: tuple[Scalar, ...], substeps: int
    ) -> BoundPreslidingAxes:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period, shared between the parts.
        """
        mass = per_axis("mass", self.mass, n_axes)
        viscous = per_axis("viscous", self.viscous, n_axes)
        gain = per_axis("gain", self.gain, n_axes)
        level = per_axis("coulomb", self.coulomb, n_axes)
        top = level if self.breakaway is None else per_axis("breakaway", self.breakaway, n_axes)
        counts = share(substeps, durations)
        return BoundPreslidingAxes(
            gain / mass, 1.0 / mass, viscous / mass, lengths_of(durations, counts), gain, viscous,
            level / mass, (top - level) / mass,
            1.0 / per_axis("stribeck_velocity", self.stribeck_velocity, n_axes),
            1.0 / per_axis("presliding_distance", self.presliding_distance, n_axes),
            bind_cogging(self.cogging, n_axes), counts,
        )  # fmt: skip

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return what a law may know of these axes: mass, viscous, Coulomb, gain.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """
        return NominalModel(
            mass=per_axis("mass", self.mass, n_axes),
            viscous=per_axis("viscous", self.viscous, n_axes),
            coulomb=per_axis("coulomb", self.coulomb, n_axes),
            gain=per_axis("gain", self.gain, n_axes),
            command_limit=per_axis("command_limit", drive.command_limit, n_axes),
            command=drive.command,
        )


class BoundPreslidingAxes(BoundDynamics):
    """Axes with presliding for one sample time."""

    gain_per_mass: AxisVector
    """K / M."""
    per_mass: AxisVector
    """1 / M."""
    damping: AxisVector
    """B / M [1/s]."""
    step: Float[Array, " n_parts"]
    """Length of a substep in each part of a control period [s]."""
    gain: AxisVector
    viscous: AxisVector
    level: AxisVector
    """F_c / M [m/s²]."""
    excess: AxisVector
    """(F_s - F_c) / M [m/s²]."""
    per_stribeck: AxisVector
    """1 / v_s [s/m]."""
    per_distance: AxisVector
    """1 / x_0 [1/m]."""
    cogging: BoundCogging | None
    counts: tuple[int, ...] = eqx.field(static=True)
    """Substeps of each part."""

    def steady(
        self, position: AxisVector, velocity: AxisVector
    ) -> tuple[PreslidingState, AxisVector]:
        """Return the state in steady motion and the command that keeps it; at rest z = 0.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        bend = jnp.sign(velocity)
        effort = self.viscous * velocity + self._friction(velocity) * bend / self.per_mass
        if self.cogging is not None:
            effort = effort - self.cogging.effort(position)
        return PreslidingState(position, velocity, bend), effort / self.gain

    def advance(
        self, state: PreslidingState, commands: tuple[AxisVector, ...], disturbance: AxisVector
    ) -> PreslidingState:
        """Return the state one control period later.

        Parameters
        ----------
        state
            Motion at its start.
        commands
            One per part of the period, shape (n_axes,) each.
        disturbance
            Effort over the whole period, shape (n_axes,).
        """
        push = disturbance * self.per_mass
        for piece, command in enumerate(commands):
            drive = self.gain_per_mass * command + push
            state = self._slide(state, drive, self.step[piece], self.counts[piece])
        return state

    def _friction(self, velocity: AxisVector) -> AxisVector:
        return self.level + self.excess * jnp.exp(-((velocity * self.per_stribeck) ** 2))

    def _bent(self, bend: Array, way: Array) -> Array:
        """Return z after a displacement."""
        side = jnp.sign(way)
        return side + (bend - side) * jnp.exp(-jnp.abs(way) * self.per_distance)

    def _slide(
        self, state: PreslidingState, drive: AxisVector, h: Scalar, count: int
    ) -> PreslidingState:
        def substep(carry: PreslidingState, _: None) -> tuple[PreslidingState, None]:
            q, v, bend = carry.position, carry.velocity, carry.bend
            push = drive
            if self.cogging is not None:
                push = drive + self.per_mass * self.cogging.effort(q + 0.5 * h * v)
            now = push - self.damping * v - self._friction(v) * bend
            middle = self._bent(bend, 0.5 * h * (v + 0.25 * h * now))
            push = push - self._friction(v + 0.5 * h * now) * middle
            w = v + h * phi_2(-h * self.damping) * (push - self.damping * v)
            after = PreslidingState(
                q + h * w, v + h * (push - self.damping * w), self._bent(bend, h * w)
            )
            return after, None

        return jax.lax.scan(substep, state, None, length=count)[0]

    def position(self, state: PreslidingState) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.position

    def velocity(self, state: PreslidingState) -> AxisVector:
        """Return the true axis velocities [m/s].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.velocity
