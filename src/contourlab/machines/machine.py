"""A machine: axes, drives, sensors and tool put together; and what it becomes at a sample time.

Timing of one control period, which is that of the whole house: at t_k the sensors are read, the law
answers with command k, and that acts on [t_k + delay, t_k+1 + delay). ``bind`` does once what does
not change in the loop; the loop calls ``measure`` and ``advance`` of the bound machine.

Four positions of an axis are told apart: that of its motor and that of its load, which the dynamics
hold; what an ideal encoder shows, which comes from one of them by ``Encoder.side`` and
``GeometricErrors``; and the true one, that of the tool in square coordinates. They are the same on
rigid axes without errors. The tool map leads on from the true one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, is_concrete, part, real, static
from contourlab.errors import ConfigurationError
from contourlab.feedrate.limits import AxisLimits
from contourlab.machines.base import (
    CommandKind,
    Dynamics,
    IdentityTool,
    NominalModel,
    ToolMap,
    per_axis,
)
from contourlab.machines.bound_machine import BoundMachine, MachineState
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import Encoder, Measurement
from contourlab.machines.geometric_errors import GeometricErrors
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundMachine", "Machine", "MachineState"]

Ends: TypeAlias = Float[Array, "... 2"] | Sequence[float] | Sequence[Sequence[float]]


class Machine(Configuration):
    """A machine: what really happens when a command is given."""

    names: tuple[str, ...] = static()
    """Axis names, such as ("X", "Y")."""
    dynamics: Dynamics = part()
    """How the axes answer."""
    drive: Drive = part()
    """Command kind, limit and delay."""
    sensor: Encoder = part(default=Encoder())
    """What is measured."""
    tool: ToolMap = part(default=IdentityTool())
    """From axes to tool point: nominal, laws may know it."""
    errors: GeometricErrors | None = part(default=None)
    """Geometric errors, of which laws know nothing; none if not given."""
    travel: Ends = real(unit="m", finite=False, default=(-np.inf, np.inf))
    """Lower and upper end of each axis, shape (n_axes, 2), or (2,) for all [m]."""
    limits: AxisLimits | None = part(default=None)
    """What planning may ask of the axes; nothing is known if not given."""
    substeps: int = static(minimum=1, default=10)
    """Substeps per control period for dry friction, cogging and backlash; else without effect."""
    nominal_model: NominalModel | None = part(default=None)
    """What laws are told instead of the truth; if not given, the truth without its details."""
    assumed: tuple[str, ...] = static(default=())
    """What stands here without a measurement or a source, in sentences; reports show it."""
    title: str = static(default="")
    """What the machine is, for people."""
    source: str = static(default="")
    """Where its numbers come from: a data sheet, an identification, a date."""

    def __check_init__(self) -> None:
        for field in ("names", "assumed"):
            value = getattr(self, field)
            if not isinstance(value, tuple) or any(not isinstance(item, str) for item in value):
                raise ConfigurationError(f"{field} must be a tuple of texts, got {value!r}")
        for field in ("title", "source"):
            if not isinstance(getattr(self, field), str):
                raise ConfigurationError(f"{field} must be a text, got {getattr(self, field)!r}")
        if not self.names or not all(self.names):
            raise ConfigurationError(f"names must name one axis or more, got {self.names!r}")
        if len(set(self.names)) != len(self.names):
            raise ConfigurationError(f"names must differ from each other, got {self.names!r}")

    def check(self) -> None:
        """Check that every part is for the same axes and that no travel is reversed."""
        n_axes = self.n_axes
        self.dynamics.check_axes(n_axes)
        self.sensor.check_axes(n_axes)
        if self.errors is not None:
            self.errors.check_axes(self.names)
        per_axis("command_limit", self.drive.command_limit, n_axes)
        shape = np.shape(self.travel)
        if shape[-1:] != (2,) or (len(shape) > 1 and shape[-2] != n_axes):
            raise ConfigurationError(
                f"travel must have a lower and an upper end per axis, shape ({n_axes}, 2), "
                f"got {shape}"
            )
        ends = np.broadcast_to(np.asarray(self.travel), (*shape[:-2], n_axes, 2))
        wrong = np.argwhere(~(ends[..., 0] < ends[..., 1]))
        if wrong.size:
            low, high = ends[tuple(wrong[0])]
            raise ConfigurationError(
                f"travel of axis {self.names[wrong[0][-1]]} must have lower < upper, "
                f"got {low:g} to {high:g} m"
            )
        matrix = getattr(self.tool, "matrix", None)
        if matrix is not None and np.shape(matrix)[-1] != n_axes:
            raise ConfigurationError(
                f"tool must take one position per axis, {n_axes}, got {np.shape(matrix)[-1]}"
            )
        if self.limits is not None:
            for name in ("velocity", "acceleration", "jerk"):
                per_axis(f"limits.{name}", getattr(self.limits, name), n_axes)
        if self.nominal_model is not None:
            if self.nominal_model.n_axes != n_axes:
                raise ConfigurationError(
                    f"nominal_model must have one value per axis, {n_axes}, "
                    f"got {self.nominal_model.n_axes}"
                )
            if self.nominal_model.command != self.drive.command:
                raise ConfigurationError(
                    f"nominal_model must take the drive's command, {self.drive.command}, "
                    f"got {self.nominal_model.command}"
                )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return len(self.names)

    @property
    def command(self) -> CommandKind:
        """Kind of command that the drives take."""
        return self.drive.command

    @property
    def nominal(self) -> NominalModel:
        """What a control law may be told of this machine."""
        if self.nominal_model is not None:
            return self.nominal_model
        return self.dynamics.nominal(self.n_axes, self.drive)

    def bind(self, sample_time: Scalar) -> BoundMachine:
        """Return the machine discretised for one sample time; traceable over every leaf.

        Parameters
        ----------
        sample_time
            Time between samples [s]. May be traced only if the drive has no delay.

        Raises
        ------
        ConfigurationError
            The sample time is not positive, or is traced although the drive delays.
        """
        if is_concrete(sample_time) and not np.all(np.asarray(sample_time) > 0.0):
            raise ConfigurationError(f"sample_time must be > 0 s, got {sample_time}")
        waiting, fractions = self.drive.split(sample_time)
        durations = tuple(fraction * sample_time for fraction in fractions)
        n_axes = self.n_axes
        return BoundMachine(
            self.dynamics.bind(n_axes, durations, self.substeps),
            self.sensor.bind(n_axes),
            self.tool,
            None if self.errors is None else self.errors.bind(self.names),
            per_axis("command_limit", self.drive.command_limit, n_axes),
            jnp.asarray(1.0 / sample_time, float),
            n_axes,
            waiting,
            len(fractions),
        )

    def init(self, position: Any, key: Any = None, dt: float | None = None) -> MachineState:
        """Return the state at rest; a convenience, ``bind`` is for loops.

        Parameters
        ----------
        position
            Axis positions as ideal encoders show them, shape (n_axes,) [m].
        key
            Random key or seed, for a sensor with noise.
        dt
            Sample time [s]; needed only by a drive with a delay.
        """
        if dt is None and self.drive.computing_delay > 0.0:
            raise ConfigurationError(
                f"dt must be given: the drive delays by {self.drive.computing_delay:g} s, and the "
                "number of commands that wait depends on the sample time"
            )
        return self.bind(1e-3 if dt is None else dt).init(position, key)

    def advance(
        self, state: MachineState, command: AxisVector, disturbance: AxisVector, dt: float
    ) -> MachineState:
        """Return the state one control period later; a convenience that discretises anew.

        Parameters
        ----------
        state
            State at t_k.
        command
            Command k, shape (n_axes,).
        disturbance
            Effort over the period, shape (n_axes,).
        dt
            Sample time [s].
        """
        return self.bind(dt).advance(state, command, disturbance)

    def measure(self, state: MachineState) -> Measurement:
        """Return what the sensors say.

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return state.measurement

    def true_position(self, state: MachineState) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return self.bind(max(1e-3, self.drive.computing_delay)).true_position(state)
