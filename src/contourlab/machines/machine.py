"""A machine: axes, drives, sensors and tool put together; and what it becomes at a sample time.

Timing of one control period, which is that of the whole house: at t_k the sensors are read, the law
answers with command k, and that acts on [t_k + delay, t_k+1 + delay). ``bind`` does once what does
not change in the loop; the loop calls ``measure`` and ``advance`` of the bound machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, is_concrete, part, real, static
from contourlab.errors import ConfigurationError
from contourlab.feedrate.limits import AxisLimits
from contourlab.machines.base import (
    BoundDynamics,
    CommandKind,
    Dynamics,
    IdentityTool,
    NominalModel,
    ToolMap,
    per_axis,
)
from contourlab.machines.drive import Drive
from contourlab.machines.encoder import BoundEncoder, Encoder, Measurement
from contourlab.typing import Array, AxisVector, Scalar, Vector

__all__ = ["BoundMachine", "Machine", "MachineState"]

Ends: TypeAlias = Float[Array, "... 2"] | Sequence[float] | Sequence[Sequence[float]]


class MachineState(eqx.Module):
    """Everything about a machine that evolves."""

    axes: Any
    """State of the dynamics."""
    waiting: Float[Array, "n_waiting n_axes"]
    """Clipped commands that were given and do not act yet, the oldest first."""
    measurement: Measurement
    """What the sensors say at this sampling instant."""
    key: Any
    """Random key, two 32-bit words; None on a machine without noise."""


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
    """From axes to tool point."""
    travel: Ends = real(unit="m", finite=False, default=(-np.inf, np.inf))
    """Lower and upper end of each axis, shape (n_axes, 2), or (2,) for all [m]."""
    limits: AxisLimits | None = part(default=None)
    """What planning may ask of the axes; nothing is known if not given."""
    substeps: int = static(minimum=1, default=10)
    """Substeps per control period for dry friction; nothing else needs them."""
    nominal_model: NominalModel | None = part(default=None)
    """What laws are told instead of the truth; if not given, the truth without its details."""
    assumed: tuple[str, ...] = static(default=())
    """What stands here without a measurement or a source, in sentences; reports show it."""

    def __check_init__(self) -> None:
        for field in ("names", "assumed"):
            value = getattr(self, field)
            if not isinstance(value, tuple) or any(not isinstance(item, str) for item in value):
                raise ConfigurationError(f"{field} must be a tuple of texts, got {value!r}")
        if not self.names or not all(self.names):
            raise ConfigurationError(f"names must name one axis or more, got {self.names!r}")
        if len(set(self.names)) != len(self.names):
            raise ConfigurationError(f"names must differ from each other, got {self.names!r}")

    def check(self) -> None:
        """Check that every part is for the same axes and that no travel is reversed."""
        n_axes = self.n_axes
        self.dynamics.check_axes(n_axes)
        self.sensor.check_axes(n_axes)
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
            Axis positions, shape (n_axes,) [m].
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


class BoundMachine(eqx.Module):
    """A machine at one sample time: pure functions of its state."""

    dynamics: BoundDynamics
    sensor: BoundEncoder
    tool: ToolMap
    command_limit: AxisVector
    sample_rate: Scalar
    n_axes: int = eqx.field(static=True)
    n_waiting: int = eqx.field(static=True)
    """Commands that wait, the one on its way included."""
    n_parts: int = eqx.field(static=True)
    """Commands that act within one control period."""

    def init(self, position: Any, key: Any = None, velocity: Any = None) -> MachineState:
        """Return the state at t_0, at rest unless a velocity is given.

        With a velocity the axes are in steady motion, and commands that still act from before t_0
        are those that keep it.

        Parameters
        ----------
        position
            True axis positions, shape (n_axes,) [m].
        key
            Random key or seed; needed by a sensor with noise.
        velocity
            True axis velocities, shape (n_axes,) [m/s].

        Raises
        ------
        ConfigurationError
            The sensor is noisy and there is no key.
        """
        position = jnp.asarray(position, float)
        velocity = jnp.zeros_like(position) if velocity is None else jnp.asarray(velocity, float)
        for name, value in (("position", position), ("velocity", velocity)):
            if value.shape != (self.n_axes,):
                raise ConfigurationError(
                    f"{name} must have one value per axis, ({self.n_axes},), got {value.shape}"
                )
        now = None
        if self.sensor.noise is None:
            key = None
        elif key is None:
            raise ConfigurationError("the sensor has noise: a random key or seed must be given")
        else:
            key, now = _next(_words(key))
        axes, command = self.dynamics.steady(position, velocity)
        waiting = jnp.broadcast_to(self._clip(command), (self.n_waiting, self.n_axes))
        measured = Measurement(self.sensor.position(self.dynamics.position(axes), now), velocity)
        return MachineState(axes, waiting, measured, key)

    def advance(
        self, state: MachineState, command: AxisVector, disturbance: AxisVector
    ) -> MachineState:
        """Return the state at t_k+1.

        Parameters
        ----------
        state
            State at t_k.
        command
            Command k as the law gave it, shape (n_axes,).
        disturbance
            Effort on each axis over [t_k, t_k+1), in the unit of gain × command, shape (n_axes,).
        """
        clipped = self._clip(command)
        queue = jnp.concatenate([state.waiting, clipped[None]])
        acting = tuple(queue[part] for part in range(self.n_parts))
        axes = self.dynamics.advance(state.axes, acting, disturbance)
        key, now = (None, None) if state.key is None else _next(state.key)
        position = self.sensor.position(self.dynamics.position(axes), now)
        if self.sensor.velocity == "ideal":
            velocity = self.dynamics.velocity(axes)
        else:
            velocity = (position - state.measurement.position) * self.sample_rate
        return MachineState(axes, queue[1:], Measurement(position, velocity), key)

    def measure(self, state: MachineState) -> Measurement:
        """Return what the sensors say at this instant.

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return state.measurement

    def true_position(self, state: MachineState) -> AxisVector:
        """Return the true axis positions, shape (n_axes,) [m].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return self.dynamics.position(state.axes)

    def true_velocity(self, state: MachineState) -> AxisVector:
        """Return the true axis velocities, shape (n_axes,) [m/s].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return self.dynamics.velocity(state.axes)

    def tool_position(self, state: MachineState) -> Vector:
        """Return the true tool point [m].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return self.tool.tool_from_axes(self.true_position(state))

    def _clip(self, command: AxisVector) -> AxisVector:
        return jnp.clip(command, -self.command_limit, self.command_limit)


def _words(key: Any) -> Array:
    """Two 32-bit words from a seed, a typed key or raw key data."""
    if isinstance(key, int | np.integer):
        key = jax.random.key(int(key))
    if jnp.issubdtype(jnp.asarray(key).dtype, jax.dtypes.prng_key):
        return jax.random.bits(key, (2,), jnp.uint32)
    key = jnp.asarray(key)  # raw words, or a seed
    if key.ndim == 0:  # a seed that varies over a batch
        return jax.random.bits(jax.random.key(key), (2,), jnp.uint32)
    return jax.random.bits(jax.random.wrap_key_data(key), (2,), jnp.uint32)


def _next(words: Array) -> tuple[Array, Any]:
    """The words of the next instant, and the key of this one."""
    following, now = jax.random.split(jax.random.wrap_key_data(jnp.asarray(words)))
    return jax.random.key_data(following), now
