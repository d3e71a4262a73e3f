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

from contourlab.controllers.held_model import HeldAxes
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["Observed", "Observer", "observer"]


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


def observer(
    axes: HeldAxes, bandwidth_hz: Any, sample_time: Scalar, *, disturbance: bool = True
) -> Observer:
    """Return the observer with three equal poles on every axis (Ackermann's formula).

    Parameters
    ----------
    axes
        The held model.
    bandwidth_hz
        f > 0 [Hz], one number or one per axis.
    sample_time
        T [s].
    disturbance
        Whether d is observed; without there are two poles, and d stays 0.
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

    def without(matrix: Array, shown: Array, pole: Array) -> Array:
        first, then = shown[:2], shown[:2] @ matrix[:2, :2]
        last = jnp.stack([-first[1], first[0]]) / (first[0] * then[1] - first[1] * then[0])
        shifted = matrix[:2, :2] - pole * jnp.eye(2)
        return jnp.append(shifted @ (shifted @ last), 0.0)

    rule = on_axis if disturbance else without
    gains = jax.vmap(rule)(matrix, shown, jnp.broadcast_to(pole, zero.shape))
    return Observer(axes, gains[:, 0], gains[:, 1], gains[:, 2])
