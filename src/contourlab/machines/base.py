"""What machines and laws agree on: kinds of command, the nominal model, the tool map."""

from __future__ import annotations

import abc
from typing import Literal, get_args

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real, static
from contourlab.errors import ConfigurationError
from contourlab.typing import Array, AxisVector, Matrix

__all__ = ["COMMAND_KINDS", "CommandKind", "IdentityTool", "LinearTool", "NominalModel", "ToolMap"]

CommandKind = Literal["voltage", "force", "velocity", "position"]
COMMAND_KINDS: tuple[str, ...] = get_args(CommandKind)


class NominalModel(Configuration):
    """What a control law believes of its machine, axis by axis.

        M q'' + B q' + F_c sign(q') = K u

    with u the command of the stated kind. A drive that closes its own velocity loop with a time
    constant τ is the same equation with M = τ, B = 1, K = 1 and u a velocity.
    """

    mass: Float[Array, " n_axes"] = real(above=0.0)
    """M, in effort per m/s²."""
    viscous: Float[Array, " n_axes"] = real(minimum=0.0)
    """B, in effort per m/s."""
    coulomb: Float[Array, " n_axes"] = real(minimum=0.0)
    """F_c, in effort."""
    gain: Float[Array, " n_axes"] = real(above=0.0)
    """K, effort per unit of command."""
    command_limit: Float[Array, " n_axes"] = real(above=0.0, finite=False)
    """Largest magnitude of the command; infinite if there is none."""
    command: CommandKind = static(allowed=COMMAND_KINDS)

    def check(self) -> None:
        """Check that every field has one value per axis."""
        for name in ("mass", "viscous", "coulomb", "gain", "command_limit"):
            if np.shape(getattr(self, name))[-1:] != np.shape(self.mass)[-1:]:
                raise ConfigurationError(
                    f"{name} must have one value per axis, {np.shape(self.mass)[-1:]}, "
                    f"got shape {np.shape(getattr(self, name))}"
                )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(np.shape(self.mass)[-1])

    def feed_forward(self, velocity: AxisVector, acceleration: AxisVector) -> AxisVector:
        """Return the command that the model needs for a motion, friction apart.

        Parameters
        ----------
        velocity
            Shape (n_axes,) [m/s].
        acceleration
            Shape (n_axes,) [m/s²].
        """
        return (self.mass * acceleration + self.viscous * velocity) / self.gain


class ToolMap(Configuration):
    """From axis positions to the tool point."""

    @property
    @abc.abstractmethod
    def n_coordinates(self) -> int | None:
        """Number of coordinates of the tool point; None if as many as there are axes."""

    @abc.abstractmethod
    def tool_from_axes(self, position: AxisVector) -> AxisVector:
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

    def tool_from_axes(self, position: AxisVector) -> AxisVector:
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

    def tool_from_axes(self, position: AxisVector) -> AxisVector:
        """Return the tool point, shape (n_coordinates,) [m].

        Parameters
        ----------
        position
            Axis positions, shape (n_axes,) [m].
        """
        return jnp.asarray(self.matrix) @ position
