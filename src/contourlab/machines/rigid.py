"""Rigid axes: mass, viscous and dry friction, driven by an effort that is held between samples.

    M q'' + B q' + F(q') = K u + F_c(q) + d        (each axis on its own)

with F the dry friction and F_c the cogging. Without either, the motion over one interval is the
closed form (zero-order hold, exact at the sampling instants, B = 0 included). With one, the
interval is cut into substeps. In each, friction is written F(v) = k(v) v with the secant slope
k ≥ 0; k is frozen at a midpoint velocity that one backward-Euler half step predicts, and the linear
equation that remains is solved in closed form (exponential midpoint rule).

The rule is of second order, exact in M, B, K, u and d, and unconditionally stable: k ≥ 0 can only
take energy out, so no substep is too long for the steep slope of friction near rest, and an axis
that should stop stops (an explicit method chatters about zero, or needs substeps below
2.8 M v_0 / F_s). Its fixed points are the true ones: an axis at rest under a force below breakaway
moves at the smoothed friction's creep and no faster. Cogging is held over a substep at its value in
the predicted middle: of second order too, explicit, and harmless while a substep is short beside
the period that the axis swings with in a cogging well, 2π √(M p / (2π a)).
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real
from contourlab.machines.base import (
    BoundDynamics,
    Dynamics,
    LinearModel,
    NominalModel,
    PerAxis,
    per_axis,
)
from contourlab.machines.cogging import BoundCogging, Cogging, bind_cogging
from contourlab.machines.drive import Drive
from contourlab.machines.exponential import phi, phi_2
from contourlab.machines.friction import BoundFriction, Friction
from contourlab.machines.substeps import lengths_of, share
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundRigidAxes", "RigidAxes", "RigidState"]


class RigidState(eqx.Module):
    """True motion of the axes."""

    position: AxisVector
    """[m]"""
    velocity: AxisVector
    """[m/s]"""


class RigidAxes(Dynamics):
    """Independent masses with viscous and, if given, dry friction.

    A single number holds for every axis. *Effort* is whatever unit the equation is written in: N
    for a force, V if the paper divides by the motor constant.
    """

    mass: PerAxis = real(above=0.0, ndim=1)
    """M [effort per m/s²]."""
    viscous: PerAxis = real(minimum=0.0, ndim=1, default=0.0)
    """B [effort per m/s]."""
    gain: PerAxis = real(above=0.0, ndim=1, default=1.0)
    """K [effort per unit of command]."""
    friction: Friction | None = part(default=None)
    """Dry friction; none if not given."""
    cogging: tuple[Cogging, ...] = part(default=())
    """Harmonics of the cogging; without them and without dry friction substeps do not matter."""

    @property
    def uses_substeps(self) -> bool:
        """Whether there is dry friction or cogging."""
        return self.friction is not None or bool(self.cogging)

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        for name in ("mass", "viscous", "gain"):
            per_axis(name, getattr(self, name), n_axes)
        if self.friction is not None:
            self.friction.check_axes(n_axes)
        for harmonic in self.cogging:
            harmonic.check_axes(n_axes)

    def bind(self, n_axes: int, durations: tuple[Scalar, ...], substeps: int) -> BoundRigidAxes:
        """Return the axes for intervals of known length.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period, shared between the parts; used with dry friction or
            cogging only.
        """
        mass = per_axis("mass", self.mass, n_axes)
        viscous = per_axis("viscous", self.viscous, n_axes)
        gain = per_axis("gain", self.gain, n_axes)
        friction = None if self.friction is None else self.friction.bind(mass)
        counts = share(substeps, durations) if self.uses_substeps else (1,) * len(durations)
        lengths = lengths_of(durations, counts)[:, None]
        decay, first, second = phi(-lengths * viscous / mass)
        return BoundRigidAxes(
            gain / mass, 1.0 / mass, viscous / mass, lengths[:, 0], decay, lengths * first,
            lengths**2 * second, gain, viscous, friction,
            bind_cogging(self.cogging, n_axes), counts,
        )  # fmt: skip

    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return what a law may know of these axes: mass, viscous, Coulomb, gain.

        Coulomb friction is the mean of both directions, which the model does not tell apart.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """
        coulomb: Any = 0.0 if self.friction is None else self.friction.mean_coulomb
        return NominalModel(
            mass=per_axis("mass", self.mass, n_axes),
            viscous=per_axis("viscous", self.viscous, n_axes),
            coulomb=per_axis("coulomb", coulomb, n_axes),
            gain=per_axis("gain", self.gain, n_axes),
            command_limit=per_axis("command_limit", drive.command_limit, n_axes),
            command=drive.command,
        )

    def linear(self, n_axes: int) -> LinearModel:
        """Return mass and viscous friction; dry friction and cogging left out.

        States per axis: position, velocity.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        mass, viscous, gain = (
            np.asarray(per_axis(name, getattr(self, name), n_axes))
            for name in ("mass", "viscous", "gain")
        )
        at = np.arange(n_axes)
        state, drive = np.zeros((2 * n_axes, 2 * n_axes)), np.zeros((2 * n_axes, n_axes))
        output = np.zeros((n_axes, 2 * n_axes))
        state[2 * at, 2 * at + 1] = 1.0
        state[2 * at + 1, 2 * at + 1] = -viscous / mass
        drive[2 * at + 1, at] = gain / mass
        output[at, 2 * at] = 1.0
        return LinearModel(state, drive, output, output)


class BoundRigidAxes(BoundDynamics):
    """Rigid axes for one sample time; rows of the tables are the parts of a control period."""

    gain_per_mass: AxisVector
    """K / M."""
    per_mass: AxisVector
    """1 / M."""
    damping: AxisVector
    """B / M [1/s]."""
    step: Float[Array, " n_parts"]
    """Length of a substep [s]."""
    decay: Float[Array, "n_parts n_axes"]
    """e^z."""
    first: Float[Array, "n_parts n_axes"]
    """h φ₁(z) [s]."""
    second: Float[Array, "n_parts n_axes"]
    """h² φ₂(z) [s²]."""
    gain: AxisVector
    """K."""
    viscous: AxisVector
    """B."""
    friction: BoundFriction | None
    cogging: BoundCogging | None
    counts: tuple[int, ...] = eqx.field(static=True)
    """Substeps of each part."""

    def steady(self, position: AxisVector, velocity: AxisVector) -> tuple[RigidState, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s].
        """
        effort = self.viscous * velocity
        if self.friction is not None:
            effort = effort + self.friction.deceleration(velocity) / self.per_mass
        if self.cogging is not None:  # what holds the axis at this place
            effort = effort - self.cogging.effort(position)
        return RigidState(position, velocity), effort / self.gain

    def advance(
        self, state: RigidState, commands: tuple[AxisVector, ...], disturbance: AxisVector
    ) -> RigidState:
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
        q, v = state.position, state.velocity
        push = disturbance * self.per_mass
        drives = [self.gain_per_mass * command + push for command in commands]
        if self.friction is None and self.cogging is None:
            for part, a in enumerate(drives):
                q = q + self.first[part] * v + self.second[part] * a
                v = self.decay[part] * v + self.first[part] * a
            return RigidState(q, v)
        for part, a in enumerate(drives):
            state = self._slide(state, a, self.step[part], self.counts[part])
        return state

    def _slide(self, state: RigidState, a: AxisVector, h: Array, count: int) -> RigidState:
        friction, cogging = self.friction, self.cogging

        def damping(v: Array) -> Array:
            return self.damping if friction is None else self.damping + friction.secant(v)

        def substep(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
            q, v = carry
            push = a
            if cogging is not None:
                push = a + self.per_mass * cogging.effort(q + 0.5 * h * v)
            middle = (v + 0.5 * h * push) / (1.0 + 0.5 * h * damping(v))
            slope = damping(middle)
            # the mean velocity over the substep gives both: q moves by h w, v by h (a - slope w)
            w = v + h * phi_2(-h * slope) * (push - slope * v)
            return (q + h * w, v + h * (push - slope * w)), None

        (q, v), _ = jax.lax.scan(substep, (state.position, state.velocity), None, length=count)
        return RigidState(q, v)

    def position(self, state: RigidState) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.position

    def velocity(self, state: RigidState) -> AxisVector:
        """Return the true axis velocities [m/s].

        Parameters
        ----------
        state
            Motion of the axes.
        """
        return state.velocity
