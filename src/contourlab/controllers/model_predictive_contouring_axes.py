"""The axes as predictive contouring sees them: a held model, and what is observed of them.

Each axis is M q'' + B q' + S q = K (u + d), u held over a sample, d what the model does not know
(friction, gravity, a wrong B), in units of the command. With x = (q, v),

    x(k+1) = F x(k) + G (u(k) + d(k)),    d(k+1) = d(k).                                      (1)

The observer sees positions alone, so that it does not matter how a controller finds velocities:

    e = q_measured - q_predicted,   (q, v, d) = predicted + L e                              (2)

with L such that the error has three equal poles at exp(-2π f T). Since d is estimated and stands in
the prediction, a constant disturbance leaves no error.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from contourlab.machines.base import NominalModel
from contourlab.machines.exponential import exponential, phi
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["HeldAxes", "Observed", "Observer", "held_axes", "observer"]


class HeldAxes(eqx.Module):
    """F and G of (1), axis by axis, shape (n_axes,) each."""

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
    """Return the nominal axes for a command that is held; Coulomb friction is left out.

    Parameters
    ----------
    model
        Nominal model.
    sample_time
        T [s].
    """
    mass, viscous, gain = (jnp.asarray(x) for x in (model.mass, model.viscous, model.gain))
    one: Any = jnp.ones_like(mass)
    zero: Any = jnp.zeros_like(mass)
    if model.stiffness is None:
        decay, first, second = phi(-sample_time * viscous / mass)
        push = gain * sample_time / mass
        return HeldAxes(
            one, sample_time * first, zero, decay, push * sample_time * second, push * first
        )
    rows = [
        [zero, one, zero],
        [-model.stiffness / mass, -viscous / mass, gain / mass],
        [zero, zero, zero],
    ]
    held = exponential(sample_time * jnp.stack([jnp.stack(row, -1) for row in rows], -2))
    return HeldAxes(
        held[:, 0, 0], held[:, 0, 1], held[:, 1, 0], held[:, 1, 1], held[:, 0, 2], held[:, 1, 2]
    )


class Observed(eqx.Module):
    """What is believed of the axes, shape (n_axes,) each."""

    position: AxisVector
    """[m]"""
    velocity: AxisVector
    """[m/s]"""
    disturbance: AxisVector
    """d, in units of the command."""


class Observer(eqx.Module):
    """L of (2), shape (n_axes,) each."""

    axes: HeldAxes
    position: Array
    velocity: Array
    """[1/s]"""
    disturbance: Array
    """[command per m]"""

    def correct(self, predicted: Observed, measured: AxisVector) -> Observed:
        """Return what is believed now that positions were measured.

        Parameters
        ----------
        predicted
            For this instant.
        measured
            Positions, shape (n_axes,) [m].
        """
        error = measured - predicted.position  # (2)
        return Observed(
            predicted.position + self.position * error,
            predicted.velocity + self.velocity * error,
            predicted.disturbance + self.disturbance * error,
        )

    def predict(self, now: Observed, command: AxisVector) -> Observed:
        """Return what is expected one sample later.

        Parameters
        ----------
        now
            What is believed.
        command
            What acts from now on, the disturbance apart, shape (n_axes,).
        """
        position, velocity = self.axes.after(
            now.position, now.velocity, command + now.disturbance
        )  # (1)
        return Observed(position, velocity, now.disturbance)


def observer(axes: HeldAxes, bandwidth_hz: Any, sample_time: Scalar) -> Observer:
    """Return the observer with three equal poles on every axis (Ackermann's formula).

    Parameters
    ----------
    axes
        The held model.
    bandwidth_hz
        f > 0 [Hz], one number or one per axis.
    sample_time
        T [s].
    """
    pole = jnp.exp(-2.0 * jnp.pi * bandwidth_hz * sample_time)
    zero, one = jnp.zeros_like(axes.position_from_position), 1.0
    shown = jnp.stack(
        [axes.position_from_position, axes.position_from_velocity, axes.position_from_command], -1
    )  # what is measured next, from (q, v, d) now
    matrix = jnp.stack([
        shown,
        jnp.stack([axes.velocity_from_position, axes.velocity_from_velocity,
                   axes.velocity_from_command], -1),
        jnp.stack([zero, zero, zero + one], -1),
    ], -2)  # fmt: skip

    def on_axis(matrix: Array, shown: Array, pole: Array) -> Array:
        second = shown @ matrix
        third = second @ matrix
        across = jnp.cross(shown, second)
        last = across / (across @ third)  # the last column of the inverse of these three rows
        shifted = matrix - pole * jnp.eye(3)
        return shifted @ (shifted @ (shifted @ last))

    gains = jax.vmap(on_axis)(matrix, shown, jnp.broadcast_to(pole, zero.shape))
    return Observer(axes, gains[:, 0], gains[:, 1], gains[:, 2])
