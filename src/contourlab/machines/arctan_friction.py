"""Coulomb friction whose sign is smoothed by an arc tangent.

    F(v) = (F_c + (F_s - F_c) exp(-(v / v_s)²)) (2/π) arctan(v / v_0)

As :class:`Friction` but for the smooth sign, which comes near ±1 only as v_0 / v: laws and
published machines that were identified with it mean this curve.

References
----------
.. [HuYaoWang] section IV.B, v_0 = 1/9000 m/s.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from contourlab.machines.friction import BoundFriction, Friction
from contourlab.typing import AxisVector

__all__ = ["ArctanFriction", "BoundArctanFriction"]


class ArctanFriction(Friction):
    """Coulomb and Stribeck friction, the sign smoothed by an arc tangent; see the module."""

    def bind(self, mass: AxisVector) -> BoundArctanFriction:
        """Return the friction as a deceleration of the given masses.

        Parameters
        ----------
        mass
            Shape (n_axes,) [effort per m/s²].
        """
        same = super().bind(mass)
        return BoundArctanFriction(
            same.forward, same.backward, same.excess_forward, same.excess_backward,
            same.per_stribeck, same.per_smoothing,
        )  # fmt: skip


class BoundArctanFriction(BoundFriction):
    """The friction divided by mass: what the loop evaluates."""

    def secant(self, velocity: AxisVector) -> AxisVector:
        """Return F(v) / (M v), shape (n_axes,) [1/s]: never negative, finite at rest.

        Parameters
        ----------
        velocity
            Shape (n_axes,) [m/s].
        """
        x = jnp.maximum(jnp.abs(velocity * self.per_smoothing), 1e-9)
        ahead = velocity >= 0.0
        level = jnp.where(ahead, self.forward, self.backward)
        if self.excess_forward is not None and self.excess_backward is not None:
            bump = jnp.exp(-((velocity * self.per_stribeck) ** 2))
            level = level + jnp.where(ahead, self.excess_forward, self.excess_backward) * bump
        return level * self.per_smoothing * (2.0 / np.pi * jnp.arctan(x) / x)
