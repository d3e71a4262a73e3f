"""Disturbances: efforts that act on the axes on a schedule.

A disturbance is an effort in the unit of gain × command (N on a force-driven machine; the unit of
the command itself on axes given by transfer functions), added to that of the drive and held over a
control period at its value at the period's start. Several are given as a tuple and add up.
"""

from __future__ import annotations

import abc
import math

import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration, real, static
from contourlab.errors import ConfigurationError
from contourlab.typing import AxisVector, Scalar

__all__ = ["Disturbance", "SineDisturbance", "StepDisturbance"]


class Disturbance(Configuration):
    """An effort on one axis between two instants."""

    axis: int = static(minimum=0)
    """Which axis, counted from 0."""
    amplitude: Scalar = real(ndim=0)
    """Effort [unit of gain × command]."""
    start: Scalar = real(ndim=0, unit="s", default=0.0)
    """First instant [s]."""
    stop: Scalar = real(ndim=0, unit="s", finite=False, default=math.inf)
    """Instant from which it is gone [s]."""

    def check(self) -> None:
        """Check that it starts before it stops."""
        if not np.all(np.asarray(self.start) < np.asarray(self.stop)):
            raise ConfigurationError(
                f"start must be < stop, got start {self.start} s and stop {self.stop} s"
            )

    @abc.abstractmethod
    def shape(self, time: Scalar) -> Scalar:
        """Return the course over time, to be multiplied by the amplitude.

        Parameters
        ----------
        time
            Time from the start of the run [s].
        """

    def value(self, time: Scalar, n_axes: int) -> AxisVector:
        """Return the effort on every axis, shape (n_axes,).

        Parameters
        ----------
        time
            Time from the start of the run [s].
        n_axes
            Number of axes of the machine.

        Raises
        ------
        ConfigurationError
            The machine has no such axis.
        """
        if self.axis >= n_axes:
            raise ConfigurationError(
                f"axis must be < {n_axes}, the number of axes, got {self.axis} (axes count from 0)"
            )
        acts = (time >= self.start) & (time < self.stop)
        effort = jnp.where(acts, self.amplitude * self.shape(time), 0.0)
        return jnp.zeros(n_axes).at[self.axis].set(effort)


class StepDisturbance(Disturbance):
    """A constant effort between two instants."""

    def shape(self, time: Scalar) -> Scalar:
        """Return one.

        Parameters
        ----------
        time
            Time from the start of the run [s].
        """
        del time
        return jnp.ones(())


class SineDisturbance(Disturbance):
    """A sinusoidal effort between two instants: amplitude × sin(2π f (t - start) + phase)."""

    frequency_hz: Scalar = real(ndim=0, unit="Hz", above=0.0)
    """f [Hz]."""
    phase: Scalar = real(ndim=0, unit="rad", default=0.0)
    """Phase at the start [rad]."""

    def shape(self, time: Scalar) -> Scalar:
        """Return the sine.

        Parameters
        ----------
        time
            Time from the start of the run [s].
        """
        return jnp.sin(2.0 * math.pi * self.frequency_hz * (time - self.start) + self.phase)
