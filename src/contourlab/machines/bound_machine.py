"""A machine at one sample time: what the loop calls at every control step."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.errors import ConfigurationError
from contourlab.machines.base import BoundDynamics, ToolMap
from contourlab.machines.encoder import BoundEncoder, Measurement
from contourlab.machines.geometric_errors import BoundErrors
from contourlab.typing import Array, AxisVector, Scalar, Vector

__all__ = ["BoundMachine", "MachineState"]


class MachineState(eqx.Module):
    """Everything about a machine that evolves."""

    axes: Any
    """State of the dynamics."""
    waiting: Float[Array, "n_waiting n_axes"]
    """Clipped commands that were given and do not act yet, the oldest first."""
    measurement: Measurement
    """What the sensors say at this sampling instant."""
    other: AxisVector | None
    """Measured position on the side of the velocity, where that is another side [m]; or None."""
    key: Any
    """Random key, two 32-bit words; None on a machine without noise."""


class BoundMachine(eqx.Module):
    """A machine at one sample time: pure functions of its state."""

    dynamics: BoundDynamics
    sensor: BoundEncoder
    tool: ToolMap
    errors: BoundErrors | None
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
        are those that keep it. At rest no drive train is bent, and a motor with backlash stands in
        the middle of it.

        Parameters
        ----------
        position
            What ideal encoders show at rest, shape (n_axes,) [m]; in motion, a motor is ahead of
            it by what the drive train bends. The true position differs by the geometric errors.
        key
            Random key or seed; needed by a sensor with noise.
        velocity
            Axis velocities, shape (n_axes,) [m/s].

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
        load = position
        if self.errors is not None:
            behind = self.errors.behind(position)
            load = self.sensor.seen(self.sensor.on_motor, position, behind)
        axes, command = self.dynamics.steady(load, velocity)
        waiting = jnp.broadcast_to(self._clip(command), (self.n_waiting, self.n_axes))
        shown, other = self._read(axes, now)
        return MachineState(axes, waiting, Measurement(shown, velocity), other, key)

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
        position, other = self._read(axes, now)
        if self.sensor.velocity == "ideal":
            velocity = self._ideal_velocity(axes)
        elif other is None or state.other is None:
            velocity = (position - state.measurement.position) * self.sample_rate
        else:
            velocity = (other - state.other) * self.sample_rate
        return MachineState(axes, queue[1:], Measurement(position, velocity), other, key)

    def measure(self, state: MachineState) -> Measurement:
        """Return what the sensors say at this instant.

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return state.measurement

    def shown_position(self, state: MachineState) -> AxisVector:
        """Return what ideal encoders show: no noise, no counts; shape (n_axes,) [m].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return self._shown(state.axes, self.sensor.on_motor)

    def true_position(self, state: MachineState) -> AxisVector:
        """Return the true axis positions: of the tool, in square axes; shape (n_axes,) [m].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        load = self.dynamics.position(state.axes)
        return load if self.errors is None else self.errors.tool(load)

    def true_velocity(self, state: MachineState) -> AxisVector:
        """Return the true axis velocities, shape (n_axes,) [m/s].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        velocity = self.dynamics.velocity(state.axes)
        if self.errors is None:
            return velocity
        load = self.dynamics.position(state.axes)
        return jax.jvp(self.errors.tool, (load,), (velocity,))[1]  # type: ignore[no-any-return]

    def tool_position(self, state: MachineState) -> Vector:
        """Return the true tool point [m].

        Parameters
        ----------
        state
            State at a sampling instant.
        """
        return self.tool.tool_from_axes(self.true_position(state))

    def _shown(self, axes: Any, on_motor: tuple[bool, ...]) -> AxisVector:
        load = self.dynamics.position(axes)
        scale = load if self.errors is None else self.errors.shown(load)
        return self.sensor.seen(on_motor, self.dynamics.motor_position(axes), scale)

    def _read(self, axes: Any, key: Any) -> tuple[AxisVector, AxisVector | None]:
        """The measured positions, and those on the side of the velocity if that is another."""
        position = self.sensor.position(self._shown(axes, self.sensor.on_motor), key)
        if not self.sensor.two_sided or self.sensor.velocity == "ideal":
            return position, None
        key = None if key is None else jax.random.fold_in(key, 1)
        other = self._shown(axes, self.sensor.velocity_on_motor)
        return position, self.sensor.position(other, key)

    def _ideal_velocity(self, axes: Any) -> AxisVector:
        velocity = self.dynamics.velocity(axes)
        if self.errors is not None:
            load = self.dynamics.position(axes)
            velocity = jax.jvp(self.errors.shown, (load,), (velocity,))[1]
        motor = self.dynamics.motor_velocity(axes)
        return self.sensor.seen(self.sensor.velocity_on_motor, motor, velocity)

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
