"""What machines and laws agree on: kinds of command, nominal model, dynamics, tool map."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.configuration import Configuration, real, static
from contourlab.errors import ConfigurationError
from contourlab.typing import Array, AxisVector, Matrix, Scalar, Vector

if TYPE_CHECKING:
    from contourlab.machines.drive import Drive

__all__ = [
    "COMMAND_KINDS",
    "BoundDynamics",
    "CommandKind",
    "Dynamics",
    "IdentityTool",
    "LinearModel",
    "LinearTool",
    "NominalModel",
    "PerAxis",
    "ToolMap",
    "per_axis",
]

CommandKind = Literal["voltage", "force", "velocity", "position"]
PerAxis: TypeAlias = Float[Array, "..."] | float | Sequence[float]
"""One number for every axis, or one per axis; an array once the configuration is made."""
COMMAND_KINDS: tuple[str, ...] = get_args(CommandKind)


def per_axis(name: str, value: Any, n_axes: int) -> Array:
    """Return one value per axis, spreading a single number over all axes.

    Leading dimensions of a batch are kept.

    Parameters
    ----------
    name
        What the value is, for the message.
    value
        A number, or an array of shape (..., n_axes).
    n_axes
        Number of axes.

    Raises
    ------
    ConfigurationError
        The value has another number of axes; names both.
    """
    shape = np.shape(value)
    if shape and shape[-1] not in (1, n_axes):
        raise ConfigurationError(
            f"{name} must have one value per axis, {n_axes}, got {shape[-1]} (shape {shape})"
        )
    spread = (*shape[:-1], n_axes)
    if isinstance(value, jax.Array):
        return jnp.broadcast_to(value, spread)
    return np.broadcast_to(np.asarray(value, np.float64), spread).copy()


class NominalModel(Configuration):
    """What a control law believes of its machine, axis by axis.

        M q'' + B q' + S q + F_c sign(q') = K u

    with u the command of the stated kind. S is the stiffness of axes that a spring, or a loop of
    their own, holds at q = 0; most have none. A drive that closes its own velocity loop with a time
    constant τ is the same equation with M = τ, B = 1, K = 1 and u a velocity.
    """

    mass: Float[Array, " ..."] = real(above=0.0)
    """M, in effort per m/s²."""
    viscous: Float[Array, " ..."] = real(minimum=0.0)
    """B, in effort per m/s."""
    coulomb: Float[Array, " ..."] = real(minimum=0.0)
    """F_c, in effort."""
    gain: Float[Array, " ..."] = real(above=0.0)
    """K, effort per unit of command."""
    command_limit: Float[Array, " ..."] = real(above=0.0, finite=False)
    """Largest magnitude of the command; infinite if there is none."""
    command: CommandKind = static(allowed=COMMAND_KINDS)
    stiffness: Float[Array, " ..."] | None = real(minimum=0.0, default=None)
    """S, in effort per m; none if not given."""

    def check(self) -> None:
        """Check that every field has one value per axis."""
        for name in ("mass", "viscous", "coulomb", "gain", "command_limit", "stiffness"):
            value = getattr(self, name)
            if value is not None and np.shape(value)[-1:] != np.shape(self.mass)[-1:]:
                raise ConfigurationError(
                    f"{name} must have one value per axis, {np.shape(self.mass)[-1:]}, "
                    f"got shape {np.shape(value)}"
                )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(np.shape(self.mass)[-1])

    def feed_forward(self, velocity: AxisVector, acceleration: AxisVector) -> AxisVector:
        """Return the command that the model needs for a motion, friction and stiffness apart.

        Parameters
        ----------
        velocity
            Shape (n_axes,) [m/s].
        acceleration
            Shape (n_axes,) [m/s²].
        """
        return (self.mass * acceleration + self.viscous * velocity) / self.gain


class Dynamics(Configuration):
    """How the axes answer to a command: a configuration without a sample time."""

    @property
    def uses_substeps(self) -> bool:
        """Whether the number of substeps matters: not where the solution is exact."""
        return False

    def linear(self, n_axes: int) -> LinearModel:
        """Return the linear part as matrices of known numbers; friction and the like left out.

        Parameters
        ----------
        n_axes
            Number of axes.

        Raises
        ------
        ConfigurationError
            These dynamics have no linear part to give.
        """
        raise ConfigurationError(f"{type(self).__name__} offers no linear model")

    @abc.abstractmethod
    def check_axes(self, n_axes: int) -> None:
        """Raise ConfigurationError unless the dynamics are those of this many axes.

        Parameters
        ----------
        n_axes
            Number of axes of the machine.
        """

    @abc.abstractmethod
    def bind(self, n_axes: int, durations: tuple[Scalar, ...], substeps: int) -> BoundDynamics:
        """Return the dynamics discretised for one sample time.

        Parameters
        ----------
        n_axes
            Number of axes.
        durations
            Length of each part of a control period over which the command is constant [s].
        substeps
            Substeps per control period, for what has no closed form.
        """

    @abc.abstractmethod
    def nominal(self, n_axes: int, drive: Drive) -> NominalModel:
        """Return what a law may know of these axes.

        Parameters
        ----------
        n_axes
            Number of axes.
        drive
            Kind and limit of the command.
        """


class LinearModel(NamedTuple):
    """State space from commands to positions: x' = A x + B u, or x(k+1) if it has a sample time."""

    state: NDArray[Any]
    """A, shape (n, n)."""
    input: NDArray[Any]
    """B, shape (n, n_axes)."""
    output: NDArray[Any]
    """C to the true axis positions (load side), shape (n_axes, n)."""
    motor_output: NDArray[Any]
    """C to the positions of the motors, shape (n_axes, n)."""
    sample_time: float | None = None
    """[s]; None for continuous time."""


class BoundDynamics(eqx.Module):
    """Dynamics discretised for one sample time: pure functions of a state of their own."""

    @abc.abstractmethod
    def steady(self, position: AxisVector, velocity: AxisVector) -> tuple[Any, AxisVector]:
        """Return the state in steady motion and the command that keeps it.

        Parameters
        ----------
        position
            Shape (n_axes,) [m].
        velocity
            Shape (n_axes,) [m/s]; zero is rest.
        """

    @abc.abstractmethod
    def advance(self, state: Any, commands: tuple[AxisVector, ...], disturbance: AxisVector) -> Any:
        """Return the state one control period later.

        Parameters
        ----------
        state
            State at its start.
        commands
            One per part of the period, shape (n_axes,) each.
        disturbance
            Effort over the whole period, shape (n_axes,).
        """

    @abc.abstractmethod
    def position(self, state: Any) -> AxisVector:
        """Return the true axis positions [m].

        Parameters
        ----------
        state
            State of the axes.
        """

    @abc.abstractmethod
    def velocity(self, state: Any) -> AxisVector:
        """Return the true axis velocities [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """

    def motor_position(self, state: Any) -> AxisVector:
        """Return what an ideal encoder on the motor shows [m]: the same on axes that do not bend.

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.position(state)

    def motor_velocity(self, state: Any) -> AxisVector:
        """Return the velocity of the motor in travel of the axis [m/s].

        Parameters
        ----------
        state
            State of the axes.
        """
        return self.velocity(state)


class ToolMap(Configuration):
    """From axis positions to the tool point."""

    @property
    @abc.abstractmethod
    def n_coordinates(self) -> int | None:
        """Number of coordinates of the tool point; None if as many as there are axes."""

    @abc.abstractmethod
    def tool_from_axes(self, position: AxisVector) -> Vector:
        """Return the tool point [m].

        Parameters
        ----------
        position
            Axis positions, shape (n_axes,) [m].
        """


class IdentityTool(ToolMap):
    """The axes are the coordinates of the tool point."""

    @property
    def n_coordinates(self) -> int | None:
        """As many as there are axes."""
        return None

    def tool_from_axes(self, position: AxisVector) -> Vector:
        """Return the axis positions themselves [m].

        Parameters
        ----------
        position
            Axis positions, shape (n_axes,) [m].
        """
        return position


class LinearTool(ToolMap):
    """The tool point is a linear combination of the axes: ``matrix @ position``.

    A stage that carries a scanner is ``[[1, 0, 1, 0], [0, 1, 0, 1]]``.
    """

    matrix: Matrix = real()
    """Shape (n_coordinates, n_axes)."""

    @property
    def n_coordinates(self) -> int | None:
        """Rows of the matrix."""
        return int(np.shape(self.matrix)[-2])

    def tool_from_axes(self, position: AxisVector) -> Vector:
        """Return the tool point, shape (n_coordinates,) [m].

        Parameters
        ----------
        position
            Axis positions, shape (n_axes,) [m].
        """
        return jnp.asarray(self.matrix) @ position
