"""Weights for any machine: what they are where none are given.

A machine has a speed limit V and a deceleration a that its weakest axis can give, and with them a
time τ = V/a and a way V²/a. In these units, and in the reward of one sample at full speed,

    contour   5e4 per (V²/a)²,    lag   a tenth of it,
    command   5e-5 (τ/T)² per (command limit)²,    speed   4e-4 (τ/T)² per V²                 (1)

An error of V²/a / 220 then costs as much as a sample at full speed earns, and a command that goes
from limit to limit within τ costs the reward of a few samples, whatever the units, the size of the
machine and the sample time T are. The numbers are ours, chosen on a feed drive with ball screws.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.controllers.model_predictive_contouring_program import Weights
from contourlab.typing import Array, Scalar

__all__ = ["natural_weights"]

CONTOUR, LAG_SHARE = 5e4, 0.1
COMMAND, SPEED = 5e-5, 4e-4


def natural_weights(
    speed: Scalar,
    deceleration: Scalar,
    commands: Array,
    sample_time: Scalar,
    *,
    contour: Scalar | None,
    lag: Scalar | None,
    reward: Scalar | None,
    command_change: Array | None,
    speed_change: Scalar | None,
) -> Weights:
    """Return weights, those not given by (1).

    Parameters
    ----------
    speed
        V [m/s].
    deceleration
        a [m/s²].
    commands
        The commands' ranges, shape (n_axes,).
    sample_time
        T [s].
    contour, lag, reward, command_change, speed_change
        As the law has them, or None.
    """
    gain = jnp.asarray(1.0 / speed if reward is None else reward)
    unit = gain * speed
    slowness = (speed / (deceleration * sample_time)) ** 2  # (τ/T)²
    if contour is None:
        contour = CONTOUR * unit * (deceleration / speed**2) ** 2
    if lag is None:
        lag = LAG_SHARE * contour
    if command_change is None:
        command_change = COMMAND * slowness * unit / commands**2
    if speed_change is None:
        speed_change = SPEED * slowness * unit / speed**2
    return Weights(
        contour=contour, lag=lag, reward=gain,
        change=jnp.append(jnp.asarray(command_change), jnp.asarray(speed_change)),
    )  # fmt: skip
