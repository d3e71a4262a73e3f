"""Friction of an axis: Coulomb and Stribeck, the sign smoothed.

    F(v) = (F_c + (F_s - F_c) exp(-(v / v_s)²)) tanh(v / v_0)

F_c is the Coulomb level (backwards it may be another), F_s the breakaway level, v_s the Stribeck
velocity. The jump of sign(v) is replaced by tanh(v / v_0): an axis that should stick creeps
instead, at v = v_0 atanh(f / F_s) for a force f below breakaway, which is 0.55 v_0 at half the
level. Presliding and its hysteresis are not modelled. The largest force comes close to F_s when v_0
is well below v_s. Viscous friction belongs to the axis.
"""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration, real, replace
from contourlab.errors import ConfigurationError
from contourlab.machines.base import PerAxis, per_axis
from contourlab.typing import AxisVector

__all__ = ["BoundFriction", "Friction"]


class Friction(Configuration):
    """Coulomb and Stribeck friction of every axis, in effort (the unit of gain × command).

    A single number holds for every axis.
    """

    coulomb: PerAxis = real(minimum=0.0, ndim=1)
    """F_c, sliding friction at speed [effort]."""
    breakaway: PerAxis | None = real(minimum=0.0, ndim=1, default=None)
    """F_s, at the start of sliding [effort]; as large as ``coulomb`` if not given."""
    stribeck_velocity: PerAxis = real(unit="m/s", above=0.0, ndim=1, default=1e-2)
    """v_s, at which the excess over Coulomb has fallen to 1/e [m/s]."""
    smoothing_velocity: PerAxis = real(unit="m/s", above=0.0, ndim=1, default=1e-4)
    """v_0, over which the sign is smoothed [m/s]."""
    coulomb_backward: PerAxis | None = real(minimum=0.0, ndim=1, default=None)
    """F_c at negative velocity [effort]; as forwards if not given."""

    def check(self) -> None:
        """Check that breakaway is not below Coulomb."""
        if self.breakaway is None:
            return
        for name in ("coulomb", "coulomb_backward"):
            level = getattr(self, name)
            if level is not None and not np.all(self.breakaway >= level):
                raise ConfigurationError(
                    f"breakaway must be >= {name}, got breakaway {self.breakaway} and "
                    f"{name} {level}"
                )

    def check_axes(self, n_axes: int, name: str = "friction") -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        name
            What the friction is called there, for messages.
        """
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is not None:
                per_axis(f"{name}.{field.name}", value, n_axes)

    @property
    def mean_coulomb(self) -> PerAxis:
        """Mean of the Coulomb levels forwards and backwards [effort]."""
        if self.coulomb_backward is None:
            return self.coulomb
        return 0.5 * (self.coulomb + self.coulomb_backward)  # type: ignore[operator]

    def scaled(self, factor: PerAxis) -> Friction:
        """Return the same friction with every level multiplied, such as torques made forces.

        Parameters
        ----------
        factor
            One number for every axis or one per axis, > 0.
        """
        levels = {
            name: getattr(self, name) * factor
            for name in ("coulomb", "breakaway", "coulomb_backward")
            if getattr(self, name) is not None
        }
        return replace(self, **levels)

    def bind(self, mass: AxisVector) -> BoundFriction:
        """Return the friction as a deceleration of the given masses.

        Parameters
        ----------
        mass
            Shape (n_axes,) [effort per m/s²].
        """
        n_axes = int(np.shape(mass)[-1])

        def spread(name: str, default: str = "") -> AxisVector:
            value = getattr(self, name)
            return per_axis(name, getattr(self, default) if value is None else value, n_axes)

        forward, backward = spread("coulomb"), spread("coulomb_backward", "coulomb")
        both = self.breakaway is not None
        return BoundFriction(
            forward / mass,
            backward / mass,
            (spread("breakaway") - forward) / mass if both else None,
            (spread("breakaway") - backward) / mass if both else None,
            1.0 / spread("stribeck_velocity"),
            1.0 / spread("smoothing_velocity"),
        )


class BoundFriction(eqx.Module):
    """Friction divided by mass: what the loop evaluates."""

    forward: AxisVector
    """F_c / M at positive velocity [m/s²]."""
    backward: AxisVector
    """F_c / M at negative velocity [m/s²]."""
    excess_forward: AxisVector | None
    """(F_s - F_c) / M [m/s²]."""
    excess_backward: AxisVector | None
    """Likewise."""
    per_stribeck: AxisVector
    """1 / v_s [s/m]."""
    per_smoothing: AxisVector
    """1 / v_0 [s/m]."""

    def deceleration(self, velocity: AxisVector) -> AxisVector:
        """Return F(v) / M, shape (n_axes,) [m/s²].

        Parameters
        ----------
        velocity
            Shape (n_axes,) [m/s].
        """
        return self.secant(velocity) * velocity

    def secant(self, velocity: AxisVector) -> AxisVector:
        """Return F(v) / (M v), shape (n_axes,) [1/s]: never negative, finite at rest.

        Parameters
        ----------
        velocity
            Shape (n_axes,) [m/s].
        """
        # tanh(x) / x is 1 to rounding below the floor; each transcendental function is used once,
        # because XLA cuts its kernels where one is shared
        x = jnp.maximum(jnp.abs(velocity * self.per_smoothing), 1e-9)
        ahead = velocity >= 0.0
        level = jnp.where(ahead, self.forward, self.backward)
        if self.excess_forward is not None and self.excess_backward is not None:
            bump = jnp.exp(-((velocity * self.per_stribeck) ** 2))
            level = level + jnp.where(ahead, self.excess_forward, self.excess_backward) * bump
        return level * self.per_smoothing * (jnp.tanh(x) / x)
