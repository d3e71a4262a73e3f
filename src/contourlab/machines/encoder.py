"""Encoders: what the controller sees of the axes, and from which side.

A *motor*-side encoder sits on the motor; its angle is shown as travel of the axis. It sees neither
how the drive train bends nor the errors of the screw. A *tool*-side encoder is a linear scale on
the table; it sees both, and not its own scale error. Machines with scales often take the position
from the scale and the velocity from the motor: ``side="tool", velocity_side="motor"``.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration, real, static
from contourlab.errors import ConfigurationError, choices
from contourlab.machines.base import PerAxis, per_axis
from contourlab.typing import Array, AxisVector

__all__ = ["BoundEncoder", "Encoder", "Measurement", "Side", "straight_through_round"]

Side = Literal["tool", "motor"]
SIDES: tuple[str, ...] = get_args(Side)


@jax.custom_jvp
def straight_through_round(value: Array) -> Array:
    """Return the nearest whole numbers, with the derivative of the identity.

    The true derivative of rounding is zero, which cuts the loop open in a gradient.

    Parameters
    ----------
    value
        Any shape.
    """
    return jnp.round(value)


@straight_through_round.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    return straight_through_round(primals[0]), tangents[0]


class Measurement(eqx.Module):
    """What the sensors say at one sampling instant."""

    position: AxisVector
    """[m]"""
    velocity: AxisVector
    """[m/s]"""


class Encoder(Configuration):
    """Position with noise, then rounded to the grid; velocity from it or ideal.

    A single number holds for every axis.
    """

    resolution: PerAxis = real(unit="m", minimum=0.0, ndim=1, default=0.0)
    """Distance between counts [m]; 0 for none."""
    noise: PerAxis | None = real(unit="m", minimum=0.0, ndim=1, default=None)
    """Standard deviation of the normal noise before rounding [m]; not given: none is drawn."""
    velocity: Literal["difference", "ideal"] = static(
        allowed=("difference", "ideal"), default="difference"
    )
    """``difference`` of the last two measured positions, or the true velocity."""
    side: str | tuple[str, ...] = static(default="tool")
    """Where the position is measured: ``tool`` (a scale on the table) or ``motor``, for all axes or
    one per axis. The same on axes that do not bend."""
    velocity_side: str | tuple[str, ...] | None = static(default=None)
    """Where the velocity is measured, with the same resolution and noise; as ``side`` if not
    given."""

    def __check_init__(self) -> None:
        for name in ("side", "velocity_side"):
            value = getattr(self, name)
            if value is None and name == "velocity_side":
                continue
            for one in value if isinstance(value, tuple) else (value,):
                if one not in SIDES:
                    raise ConfigurationError(f"unknown {name} {one!r}; {choices(one, SIDES)}")

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        per_axis("resolution", self.resolution, n_axes)
        if self.noise is not None:
            per_axis("noise", self.noise, n_axes)
        for name in ("side", "velocity_side"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != n_axes:
                raise ConfigurationError(
                    f"{name} must have one value per axis, {n_axes}, got {len(value)}"
                )

    def bind(self, n_axes: int) -> BoundEncoder:
        """Return the encoder with one value per axis.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        noise = None if self.noise is None else per_axis("noise", self.noise, n_axes)
        sides = _on_motor(self.side, n_axes)
        velocity = sides if self.velocity_side is None else _on_motor(self.velocity_side, n_axes)
        return BoundEncoder(
            per_axis("resolution", self.resolution, n_axes), noise, self.velocity, sides, velocity
        )


def _on_motor(side: str | tuple[str, ...], n_axes: int) -> tuple[bool, ...]:
    sides = side if isinstance(side, tuple) else (side,) * n_axes
    return tuple(one == "motor" for one in sides)


class BoundEncoder(eqx.Module):
    """An encoder with one value per axis."""

    resolution: AxisVector
    noise: AxisVector | None
    velocity: str = eqx.field(static=True)
    on_motor: tuple[bool, ...] = eqx.field(static=True)
    """Per axis, whether the position is that of the motor."""
    velocity_on_motor: tuple[bool, ...] = eqx.field(static=True)
    """Likewise for the velocity."""

    @property
    def two_sided(self) -> bool:
        """Whether the velocity of some axis is that of the other side than its position."""
        return self.on_motor != self.velocity_on_motor

    @staticmethod
    def seen(on_motor: tuple[bool, ...], motor: AxisVector, tool: AxisVector) -> AxisVector:
        """Return each axis's value from the side where it is measured.

        Parameters
        ----------
        on_motor
            Per axis, whether that is the motor.
        motor, tool
            Both, shape (n_axes,).
        """
        if all(on_motor):
            return motor
        if not any(on_motor):
            return tool
        return jnp.where(np.asarray(on_motor), motor, tool)

    def position(self, true_position: AxisVector, key: Any) -> AxisVector:
        """Return the measured axis positions [m].

        Parameters
        ----------
        true_position
            What an ideal encoder shows, shape (n_axes,) [m].
        key
            Key of this instant; unused without noise.
        """
        value = true_position
        if self.noise is not None:
            value = value + self.noise * jax.random.normal(key, value.shape, value.dtype)
        grid = jnp.where(self.resolution > 0.0, self.resolution, 1.0)
        counted = straight_through_round(value / grid) * grid
        return jnp.where(self.resolution > 0.0, counted, value)
