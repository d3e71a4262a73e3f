"""Drives: the kind of command they take, its limit, and the time before it acts."""

from __future__ import annotations

import math

import numpy as np

from contourlab.configuration import Configuration, is_concrete, real, static
from contourlab.errors import ConfigurationError
from contourlab.machines.base import COMMAND_KINDS, CommandKind, PerAxis
from contourlab.typing import Scalar

__all__ = ["Drive"]


class Drive(Configuration):
    """What stands between the command and the axes: a clip and a delay.

    Command k, given at t_k, is clipped and acts on [t_k + delay, t_k+1 + delay). Before the first
    one acts, the drive holds the command of steady motion: zero at rest for voltage, force and
    velocity, the starting point for position.
    """

    command: CommandKind = static(allowed=COMMAND_KINDS)
    """Kind of command."""
    command_limit: PerAxis = real(above=0.0, finite=False, ndim=1, default=np.inf)
    """Largest magnitude, per axis or one for all; infinite if there is none [V, N, m/s or m]."""
    computing_delay: float = static(default=0.0)
    """From measuring to acting [s]: any multiple or fraction of the sample time."""

    def __check_init__(self) -> None:
        delay = self.computing_delay
        if not isinstance(delay, int | float) or not (math.isfinite(delay) and delay >= 0.0):
            raise ConfigurationError(f"computing_delay must be >= 0 s and finite, got {delay!r}")

    def split(self, sample_time: Scalar) -> tuple[int, tuple[float, ...]]:
        """Return the delay as a number of commands that wait, and where the period is cut.

        Parameters
        ----------
        sample_time
            Time between samples [s].

        Returns
        -------
        waiting
            Commands that have been given but do not act yet.
        fractions
            Parts of the control period, each with a constant command: (1.0,) or two parts.

        Raises
        ------
        ConfigurationError
            The delay is not zero and the sample time is traced: the number of waiting commands
            must be known before tracing.
        """
        if self.computing_delay == 0.0:
            return 0, (1.0,)
        if not is_concrete(sample_time):
            raise ConfigurationError(
                f"computing_delay = {self.computing_delay:g} s needs a sample time that is a "
                "number: bind the machine outside jit, vmap and grad over the sample time"
            )
        periods = self.computing_delay / float(sample_time)
        whole = math.floor(periods + 1e-9)
        fraction = periods - whole
        if fraction < 1e-9:  # a multiple of the sample time, to rounding
            return whole, (1.0,)
        return whole + 1, (fraction, 1.0 - fraction)
