"""Position loop around a velocity loop on every axis, as drives run it.

On a machine that takes a force or a voltage, P in position sets the velocity for a PI loop:

    v_set = k_v e + share_v r',                       e = reference - measured position
    u     = k_p (v_set - v) + k_i ∫(v_set - v) dt + feed-forward

with v the measured velocity. On a machine that takes a velocity the drive closes the inner loop
itself; the law is the outer loop alone,

    u     = (B / K) k_v e + feed-forward,

and the gains of a velocity loop must not be given. In both, feed-forward is that of
:mod:`contourlab.controllers.feed_forward`: B r', M r'' and Coulomb friction over K, each with its
share. (A drive with B = K = 1 and M = τ takes v_set + share_a τ r'' + ...)

Without velocity feed-forward an axis follows a constant velocity v with the lag v / k_v. On
a straight line axes with equal k_v lag together and the contour error is 0; on a circle of radius R
they run on a smaller one, by v² / (2 k_v² R) to leading order if the inner loop is fast.

The command is clipped at the model's limit. The integral (forward Euler) is held while it would
push the command further beyond it (conditional integration).

References
----------
.. [Koren1980] axes of equal lag as the starting point of contouring; the paper was not at hand,
   equation numbers not checked.

Differences from common drives
------------------------------
The velocity share also feeds the model's viscous effort forward; most drives leave that to the
integral. There is no filter between the loops and no limit of v_set.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    checked_per_axis,
    held_integral,
    per_axis,
    refuse_no_model,
    refuse_position_command,
)
from contourlab.controllers.base import Needs
from contourlab.controllers.feed_forward import ModelFeedForward
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["BoundCascade", "Cascade", "CascadeState"]


class CascadeState(NamedTuple):
    """What the law remembers."""

    integral: AxisVector
    """Integral of the velocity error, shape (n_axes,) [m]; 0 where there is no velocity loop."""
    saturated: Count
    """1 if the last command was beyond a limit, int32."""


class Cascade(AxisController):
    """P in position around PI in velocity on every axis; see the module.

    Every gain is one number or one per axis.

    Parameters
    ----------
    model
        Nominal model: kind and limit of the command, and the feed-forward.
    position_gain
        k_v, >= 0 [1/s].
    velocity_proportional
        k_p, >= 0 [command unit per m/s]. For machines that take a force or a voltage only.
    velocity_integral
        k_i, >= 0 [command unit per m]. For machines that take a force or a voltage only.
    velocity_feed_forward, acceleration_feed_forward, friction_feed_forward
        Shares, 0 to 1: of the reference velocity in v_set and of the model's viscous effort; of its
        inertia; of its Coulomb friction.
    friction_velocity
        Width of the smooth sign of the Coulomb term, > 0 [m/s].

    Raises
    ------
    ConfigurationError
        A gain that is negative or not finite; a share outside 0 to 1; a velocity loop that is
        missing, or one on a machine that takes a velocity.
    RefusedError
        The model is commanded by positions.
    """

    position_gain: Float[Array, " ..."] = real(unit="1/s", minimum=0.0)
    velocity_proportional: Float[Array, " ..."] | None = real(
        unit="command unit per m/s", minimum=0.0, default=None
    )
    velocity_integral: Float[Array, " ..."] | None = real(
        unit="command unit per m", minimum=0.0, default=None
    )
    velocity_feed_forward: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=0.0)
    acceleration_feed_forward: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=0.0)
    friction_feed_forward: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=0.0)
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0, default=1e-3)

    def check(self) -> None:
        """Check that the velocity loop is given where there is one, and only there."""
        refuse_position_command(type(self).__name__, self.model)
        gains = {
            "velocity_proportional": self.velocity_proportional,
            "velocity_integral": self.velocity_integral,
        }
        if self.model.command == "velocity" and not np.all(np.asarray(self.model.viscous) > 0.0):
            raise ConfigurationError(
                "viscous must be > 0 in the model of a machine that takes a velocity, got "
                f"{self.model.viscous}: B / K is the command that holds a velocity"
            )
        for name, gain in gains.items():
            if self.model.command == "velocity" and gain is not None:
                raise ConfigurationError(
                    f"{name} must not be given, got {gain}: the machine takes a velocity, its "
                    "drive closes the velocity loop itself"
                )
            if self.model.command != "velocity" and gain is None:
                raise ConfigurationError(
                    f"{name} must be given: the machine takes a {self.model.command}, so the "
                    "velocity loop is this law's (0 switches a part off)"
                )

    @staticmethod
    def by_bandwidth(
        model: NominalModel,
        velocity_bandwidth_hz: Any,
        position_gain: Any,
        damping: Any = 1.0,
        **settings: Any,
    ) -> Cascade:
        """Return the law whose velocity loop has two chosen poles.

        On the nominal model without Coulomb friction, M s² + (B + K k_p) s + K k_i is made
        M (s² + 2 ζ ω s + ω²):

            k_p = (2 ζ ω M - B) / K,   k_i = ω² M / K.

        With ζ = 1 the whole loop is stable for every position gain in continuous time; take
        position_gain <= ω / 4 for a step without much overshoot, and keep ω [rad/s] some 10 times
        below the sampling rate.

        Parameters
        ----------
        model
            Nominal model of a machine that takes a force or a voltage.
        velocity_bandwidth_hz
            ω / 2π, > 0 [Hz], one number or one per axis.
        position_gain
            k_v [1/s].
        damping
            ζ, > 0.
        **settings
            The other fields of the law.

        Raises
        ------
        ConfigurationError
            A value that is not > 0, or neither one number nor one per axis; a bandwidth so low
            that k_p would be negative.
        RefusedError
            The model is commanded by velocities or positions, or has stiffness.
        """
        refuse_no_model(model)
        refuse_position_command("Cascade", model)
        if model.command == "velocity":
            raise RefusedError(
                "by_bandwidth is for machines that take a force or a voltage; this one takes a "
                "velocity, its drive closes the velocity loop itself: use "
                "Cascade(position_gain=...)"
            )
        if model.stiffness is not None and np.any(np.asarray(model.stiffness) > 0.0):
            raise RefusedError(
                "by_bandwidth is for axes without stiffness: against a spring the velocity loop "
                "does not have these poles; give the gains"
            )
        n = model.n_axes
        bandwidth = checked_per_axis("velocity_bandwidth_hz", velocity_bandwidth_hz, n, above=0.0)
        checked_per_axis("position_gain", position_gain, n, minimum=0.0)
        zeta = checked_per_axis("damping", damping, n, above=0.0)
        omega = 2.0 * np.pi * bandwidth
        mass, viscous, gain = (np.asarray(x) for x in (model.mass, model.viscous, model.gain))
        proportional = (2.0 * zeta * omega * mass - viscous) / gain
        if np.any(proportional < 0.0):
            least = np.max(viscous / (2.0 * zeta * mass)) / (2.0 * np.pi)
            raise ConfigurationError(
                f"velocity_bandwidth_hz must be >= {least:.3g} Hz, got {velocity_bandwidth_hz}: "
                "below that the axis's own damping is more than the poles ask for and "
                "velocity_proportional would be negative"
            )
        return Cascade(
            model=model,
            position_gain=position_gain,
            velocity_proportional=proportional,
            velocity_integral=omega**2 * mass / gain,
            **settings,
        )

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and nothing of the contour."""
        return Needs(command=self.model.command)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundCascade:
        """Return the law for one sample time.

        Parameters
        ----------
        contour
            Not used: axes know no contour.
        sample_time
            Time between samples [s].

        Raises
        ------
        ConfigurationError
            A gain that is neither one number nor one per axis.
        """
        del contour
        n, model = self.n_axes, self.model
        proportional: Array
        integral: Array
        position_gain = per_axis("position_gain", self.position_gain, n)
        velocity_share = per_axis("velocity_feed_forward", self.velocity_feed_forward, n)
        outer_only = model.command == "velocity"
        if outer_only:
            proportional, integral = model.viscous / model.gain, jnp.zeros(n)
        else:
            proportional = per_axis("velocity_proportional", self.velocity_proportional, n)
            integral = per_axis("velocity_integral", self.velocity_integral, n)
        return BoundCascade(
            command_limit=model.command_limit,
            position_gain=position_gain,
            velocity_share=velocity_share,
            proportional=proportional,
            integral=integral,
            sample_time=sample_time,
            feed_forward=ModelFeedForward.of_model(
                model,
                acceleration=self.acceleration_feed_forward,
                velocity=self.velocity_feed_forward,
                friction=self.friction_feed_forward,
                friction_velocity=self.friction_velocity,
            ),
            outer_only=outer_only,
        )


class BoundCascade(BoundAxisController):
    """The discretised law; made by :meth:`Cascade.bind`."""

    position_gain: Float[Array, " ..."] = real(unit="1/s", ndim=1)
    velocity_share: Float[Array, " ..."] = real(unit="1", ndim=1)
    proportional: Float[Array, " ..."] = real(unit="command unit per m/s", ndim=1)
    integral: Float[Array, " ..."] = real(unit="command unit per m", ndim=1)
    sample_time: Scalar = real(unit="s", above=0.0)
    feed_forward: ModelFeedForward = part()
    outer_only: bool = static(flag=True)

    def init(self, sample: Sample) -> CascadeState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        return CascadeState(jnp.zeros_like(sample.position), jnp.zeros((), jnp.int32))

    def propose(
        self, state: CascadeState, sample: Sample
    ) -> tuple[AxisVector, tuple[AxisVector, CascadeState]]:
        """Return the command before the limit, and what to settle with.

        Parameters
        ----------
        state
            As ``init`` or the last ``settle`` returned it.
        sample
            This instant.
        """
        reference = sample.reference
        fed_forward = self.feed_forward.command(reference)
        correction = self.position_gain * (reference.position - sample.position)
        if self.outer_only:
            return self.proportional * correction + fed_forward, (jnp.zeros_like(correction), state)
        v_set = correction + self.velocity_share * reference.velocity
        error = v_set - sample.velocity
        wanted = self.proportional * error + self.integral * state.integral + fed_forward
        return wanted, (error, state)

    def settle(
        self, proposal: tuple[AxisVector, CascadeState], wanted: AxisVector, applied: AxisVector
    ) -> CascadeState:
        """Return the new state, now that it is known what was applied.

        Parameters
        ----------
        proposal
            What ``propose`` returned.
        wanted, applied
            The whole command before and after the limit.
        """
        error, state = proposal
        return CascadeState(
            held_integral(state.integral, error * self.sample_time, wanted, applied),
            jnp.any(wanted != applied).astype(jnp.int32),
        )
