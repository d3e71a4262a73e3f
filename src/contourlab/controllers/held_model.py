"""The nominal model for a command that is held over each sample time T, exactly.

Each axis M q'' + B q' + S q = K u goes in a sample from (q, v) to F (q, v) + G u. As a difference
equation that is

    y(k) = B(q⁻¹) / A(q⁻¹) u(k-1),   A = 1 - tr F q⁻¹ + det F q⁻²,
                                     B = G_q + (F_qv G_v - F_vv G_q) q⁻¹                  (1)

with det F = exp(-T B / M). Coulomb friction is left out. Without stiffness, with z = -T B / M,

    F = [1, T φ₁(z); 0, e^z],   G = (K T / M) [T φ₂(z); φ₁(z)].                           (2)
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.errors import RefusedError
from contourlab.machines.base import NominalModel
from contourlab.machines.exponential import LARGEST_NORM, exponential, phi
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["HeldAxes", "held_axes", "held_polynomials"]


class HeldAxes(eqx.Module):
    """What is next from what is now, axis by axis, shape (n_axes,) each."""

    position_from_position: Array
    position_from_velocity: Array
    """[s]"""
    velocity_from_position: Array
    """[1/s]"""
    velocity_from_velocity: Array
    position_from_command: Array
    """[m per unit of command]"""
    velocity_from_command: Array
    """[m/s per unit of command]"""

    def after(
        self, position: AxisVector, velocity: AxisVector, command: AxisVector
    ) -> tuple[AxisVector, AxisVector]:
        """Return position and velocity one sample later.

        Parameters
        ----------
        position, velocity
            Now, shape (n_axes,).
        command
            What acts, the disturbance included.
        """
        return (
            self.position_from_position * position
            + self.position_from_velocity * velocity
            + self.position_from_command * command,
            self.velocity_from_position * position
            + self.velocity_from_velocity * velocity
            + self.velocity_from_command * command,
        )


def held_axes(model: NominalModel, sample_time: Scalar) -> HeldAxes:
    """Return the nominal axes for a command that is held.

    Parameters
    ----------
    model
        Nominal model.
    sample_time
        T [s].

    Raises
    ------
    RefusedError
        An axis with a stiffness whose modes are too fast for the sample time.
    """
    mass, viscous, gain = (jnp.asarray(x) for x in (model.mass, model.viscous, model.gain))
    one: Any = jnp.ones_like(mass)
    zero: Any = jnp.zeros_like(mass)
    if model.stiffness is None:
        decay, first, second = phi(-sample_time * viscous / mass)
        push = gain * sample_time / mass
        return HeldAxes(
            one, sample_time * first, zero, decay, push * sample_time * second, push * first
        )  # (2)
    rows = [
        [zero, one, zero],
        [-model.stiffness / mass, -viscous / mass, gain / mass],
        [zero, zero, zero],
    ]
    block = sample_time * jnp.stack([jnp.stack(row, -1) for row in rows], -2)
    size = jnp.max(jnp.sum(jnp.abs(block), -1))
    if is_concrete(size) and not size <= LARGEST_NORM:
        raise RefusedError(
            f"an axis is too fast for the sample time: a mode times sample time must be <= "
            f"{LARGEST_NORM:g}, got {float(np.asarray(size)):g}"
        )
    held = exponential(block)
    return HeldAxes(
        held[:, 0, 0], held[:, 0, 1], held[:, 1, 0], held[:, 1, 1], held[:, 0, 2], held[:, 1, 2]
    )


def held_polynomials(model: NominalModel, sample_time: Scalar) -> tuple[jax.Array, jax.Array]:
    """Return numerator and denominator of the sampled model, axis by axis.

    Parameters
    ----------
    model
        Nominal model.
    sample_time
        T [s].

    Returns
    -------
    numerator
        b_0, b_1, shape (n_axes, 2) [m per unit of command].
    denominator
        1, a_1, a_2, shape (n_axes, 3).

    Raises
    ------
    RefusedError
        As :func:`held_axes`.
    """
    held = held_axes(model, sample_time)
    later = (
        held.position_from_velocity * held.velocity_from_command
        - held.velocity_from_velocity * held.position_from_command
    )
    trace = held.position_from_position + held.velocity_from_velocity
    # det exp(X) = exp(tr X), without the cancellation
    determinant = jnp.exp(-sample_time * jnp.asarray(model.viscous) / jnp.asarray(model.mass))
    numerator = jnp.stack([held.position_from_command, later], -1)  # (1)
    return numerator, jnp.stack([jnp.ones_like(trace), -trace, determinant], -1)
