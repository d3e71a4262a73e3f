"""Friction of an axis: Coulomb and Stribeck, the sign smoothed.

    F(v) = (F_c + (F_s - F_c) exp(-(v / v_s)²) + A tanh(v / v_0)) tanh(v / v_0)

F_c is the Coulomb level, F_s the breakaway level, v_s the Stribeck velocity, A the asymmetry (half
the difference between the levels forwards and backwards). The jump of sign(v) is replaced by
tanh(v / v_0): an axis that should stick creeps instead, at v = v_0 atanh(f / F_s) for a force f
below breakaway, which is 0.55 v_0 at half the level. Presliding and its hysteresis are not modelled.
The largest force comes close to F_s when v_0 is well below v_s. Viscous friction belongs to the axis.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.errors import ConfigurationError
from contourlab.machines.base import per_axis
from contourlab.typing import Array, AxisVector

__all__ = ["BoundFriction", "Friction"]


class Friction(Configuration):
    """Coulomb and Stribeck friction of every axis, in effort (the unit of gain × command).

    A single number holds for every axis.
    """

    coulomb: Float[Array, "..."] = real(minimum=0.0, ndim=1)
    """F_c, sliding friction at speed [effort]."""
    breakaway: Float[Array, "..."] | None = real(minimum=0.0, ndim=1, default=None)
    """F_s, at the start of sliding [effort]; as large as ``coulomb`` if not given."""
    stribeck_velocity: Float[Array, "..."] = real(unit="m/s", above=0.0, ndim=1, default=1e-2)
    """v_s, at which the excess over Coulomb has fallen to 1/e [m/s]."""
    smoothing_velocity: Float[Array, "..."] = real(unit="m/s", above=0.0, ndim=1, default=1e-4)
    """v_0, over which the sign is smoothed [m/s]."""
    asymmetry: Float[Array, "..."] = real(ndim=1, default=0.0)
    """A, half the Coulomb level forwards minus backwards [effort]."""

    def check(self) -> None:
        """Check that breakaway is not below Coulomb, and that no level is negative."""
        if self.breakaway is not None and not np.all(self.breakaway >= self.coulomb):
            raise ConfigurationError(
                f"breakaway must be >= coulomb, got breakaway {self.breakaway} and "
                f"coulomb {self.coulomb}"
            )
        if not np.all(np.abs(self.asymmetry) <= self.coulomb):
            raise ConfigurationError(
                f"asymmetry must not exceed coulomb in magnitude, got asymmetry {self.asymmetry} "
                f"and coulomb {self.coulomb}"
            )

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        for name in ("coulomb", "breakaway", "stribeck_velocity", "smoothing_velocity", "asymmetry"):
            if getattr(self, name) is not None:
                per_axis(f"friction.{name}", getattr(self, name), n_axes)

    def bind(self, mass: AxisVector) -> BoundFriction:
        """Return the friction as a deceleration of the given masses.

        Parameters
        ----------
        mass
            Shape (n_axes,) [effort per m/s²].
        """
        breakaway = self.coulomb if self.breakaway is None else self.breakaway
        n_axes = int(np.shape(mass)[-1])

        def spread(name: str, value: Array) -> AxisVector:
            return per_axis(name, value, n_axes)

        return BoundFriction(
            spread("coulomb", self.coulomb) / mass,
            (spread("breakaway", breakaway) - spread("coulomb", self.coulomb)) / mass,
            spread("asymmetry", self.asymmetry) / mass,
            1.0 / spread("stribeck_velocity", self.stribeck_velocity),
            1.0 / spread("smoothing_velocity", self.smoothing_velocity),
        )


class BoundFriction(eqx.Module):
    """Friction divided by mass: what the loop evaluates."""

    level: AxisVector
    """F_c / M [m/s²]."""
    excess: AxisVector
    """(F_s - F_c) / M [m/s²]."""
    asymmetry: AxisVector
    """A / M [m/s²]."""
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
        x = velocity * self.per_smoothing
        near = jnp.abs(x) < 1e-3  # the next term of the series is 2e-19
        sign = jnp.tanh(x)
        ratio = jnp.where(near, 1.0 - x * x * (1.0 / 3.0 - x * x * (2.0 / 15.0)),
                          sign / jnp.where(near, 1.0, x))  # fmt: skip
        bump = jnp.exp(-((velocity * self.per_stribeck) ** 2))
        return (self.level + self.excess * bump + self.asymmetry * sign) * self.per_smoothing * ratio
