"""Encoders: what the controller sees of the axes."""

from __future__ import annotations

from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp

from contourlab.configuration import Configuration, real, static
from contourlab.machines.base import PerAxis, per_axis
from contourlab.typing import Array, AxisVector

__all__ = ["BoundEncoder", "Encoder", "Measurement", "straight_through_round"]


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

    def bind(self, n_axes: int) -> BoundEncoder:
        """Return the encoder with one value per axis.

        Parameters
        ----------
        n_axes
            Number of axes.
        """
        noise = None if self.noise is None else per_axis("noise", self.noise, n_axes)
        return BoundEncoder(per_axis("resolution", self.resolution, n_axes), noise, self.velocity)


class BoundEncoder(eqx.Module):
    """An encoder with one value per axis."""

    resolution: AxisVector
    noise: AxisVector | None
    velocity: str = eqx.field(static=True)

    def position(self, true_position: AxisVector, key: Any) -> AxisVector:
        """Return the measured axis positions [m].

        Parameters
        ----------
        true_position
            Shape (n_axes,) [m].
        key
            Key of this instant; unused without noise.
        """
        value = true_position
        if self.noise is not None:
            value = value + self.noise * jax.random.normal(key, value.shape, value.dtype)
        grid = jnp.where(self.resolution > 0.0, self.resolution, 1.0)
        counted = straight_through_round(value / grid) * grid
        return jnp.where(self.resolution > 0.0, counted, value)
