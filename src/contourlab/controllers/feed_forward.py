"""Feed-forward from the reference through the nominal model, with a share of each of its terms.

    u = (share_a M r'' + share_v (B r' + S r) + share_f F_c s(r')) / K

S, the stiffness of axes that are held by a spring, goes with the viscous term: both are what a
steady motion takes.

The sign of the Coulomb term is that of the *reference* velocity: it neither lags nor chatters. It
is smooth, s(v) = tanh(v / v_s): full friction is an even bet while the axis turns round, and a jump
of the command there would excite the machine.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.controllers.axis_controller import per_axis
from contourlab.machines.base import NominalModel
from contourlab.recordings.reference import ReferencePoint
from contourlab.typing import Array, AxisVector

__all__ = ["ModelFeedForward"]


class ModelFeedForward(Configuration):
    """The terms of the nominal model that a law feeds forward, in units of its command.

    Parameters
    ----------
    acceleration
        Command per acceleration, shape (n_axes,).
    velocity
        Command per velocity, shape (n_axes,).
    friction
        Command against Coulomb friction, shape (n_axes,).
    friction_velocity
        Reference speed at which the smooth sign has reached 0.76 [m/s].
    position
        Command per position, shape (n_axes,); None on axes without stiffness.
    """

    acceleration: Float[Array, " ..."] = real(unit="command unit per m/s^2", ndim=1)
    velocity: Float[Array, " ..."] = real(unit="command unit per m/s", ndim=1)
    friction: Float[Array, " ..."] = real(unit="command unit", ndim=1)
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0)
    position: Float[Array, " ..."] | None = real(unit="command unit per m", ndim=1, default=None)

    @staticmethod
    def of_model(
        model: NominalModel,
        *,
        acceleration: Array,
        velocity: Array,
        friction: Array,
        friction_velocity: Array,
    ) -> ModelFeedForward:
        """Return the feed-forward of some share of each term of a model.

        Parameters
        ----------
        model
            The nominal model.
        acceleration, velocity, friction
            Shares of M, B and F_c, 0 to 1, one number or one per axis.
        friction_velocity
            Width of the smooth sign [m/s], one number or one per axis.
        """
        n, stiffness = model.n_axes, model.stiffness
        share = per_axis("velocity_feed_forward", velocity, n)
        return ModelFeedForward(
            acceleration=per_axis("acceleration_feed_forward", acceleration, n)
            * (model.mass / model.gain),
            velocity=share * (model.viscous / model.gain),
            position=None if stiffness is None else share * (stiffness / model.gain),
            friction=per_axis("friction_feed_forward", friction, n) * (model.coulomb / model.gain),
            friction_velocity=per_axis("friction_velocity", friction_velocity, n),
        )

    def command(self, reference: ReferencePoint) -> AxisVector:
        """Return the command for the motion of the reference, shape (n_axes,).

        Parameters
        ----------
        reference
            The reference now.
        """
        held = 0.0 if self.position is None else self.position * reference.position
        return (
            held
            + self.acceleration * reference.acceleration
            + self.velocity * reference.velocity
            + self.friction_command(reference)
        )

    def friction_command(self, reference: ReferencePoint) -> AxisVector:
        """Return the part of the command that is for Coulomb friction, shape (n_axes,).

        Parameters
        ----------
        reference
            The reference now.
        """
        return self.friction * jnp.tanh(reference.velocity / self.friction_velocity)
