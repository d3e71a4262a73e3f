"""Cogging: an effort of the motor that depends on where it stands.

    F(q) = Σ a sin(2π q / p + φ)

one term for each :class:`Cogging`: the pole pitch of a linear motor and its harmonics, or, for a
rotary motor on a screw, the lead divided by the slots per revolution. The effort adds to that of
the drive and acts on the motor side. It is a force of position: over a period it does no work.

In the loop it is evaluated at the predicted middle of each substep, which is of second order.
"""

from __future__ import annotations

import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.machines.base import PerAxis, per_axis
from contourlab.typing import Array, AxisVector

__all__ = ["BoundCogging", "Cogging", "bind_cogging"]


class Cogging(Configuration):
    """One harmonic of the cogging of every axis; a single number holds for every axis."""

    amplitude: PerAxis = real(minimum=0.0, ndim=1)
    """a [effort, the unit of gain × command]."""
    period: PerAxis = real(unit="m", above=0.0, ndim=1)
    """p [m]."""
    phase: PerAxis = real(unit="rad", ndim=1, default=0.0)
    """φ, at position zero of the motor [rad]."""

    def check_axes(self, n_axes: int) -> None:
        """Check that every field has one value per axis or one for all.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """
        for field in dataclasses.fields(self):
            per_axis(f"cogging.{field.name}", getattr(self, field.name), n_axes)


class BoundCogging(eqx.Module):
    """All harmonics of all axes, one row each."""

    amplitude: Float[Array, "n_harmonics n_axes"]
    """[effort]"""
    wave_number: Float[Array, "n_harmonics n_axes"]
    """2π / p [rad/m]."""
    phase: Float[Array, "n_harmonics n_axes"]
    """[rad]"""

    def effort(self, position: AxisVector) -> AxisVector:
        """Return F(q), shape (n_axes,) [effort].

        Parameters
        ----------
        position
            Of the motor, shape (n_axes,) [m].
        """
        return jnp.sum(self.amplitude * jnp.sin(self.wave_number * position + self.phase), axis=0)


def bind_cogging(harmonics: tuple[Cogging, ...], n_axes: int) -> BoundCogging | None:
    """Return the harmonics as one table, None if there are none.

    Parameters
    ----------
    harmonics
        In any order.
    n_axes
        Number of axes.
    """
    if not harmonics:
        return None

    def rows(name: str) -> Array:
        values = [per_axis(name, getattr(h, name), n_axes) for h in harmonics]
        given = all(isinstance(value, np.ndarray) for value in values)
        return np.stack(values) if given else jnp.stack(values)

    return BoundCogging(rows("amplitude"), 2.0 * math.pi / rows("period"), rows("phase"))
