"""A PID controller on every axis, with feed-forward from the nominal model.

    u = kp e + ki ∫e dt + kd D + feed-forward,    e = reference - measured position

clipped at the model's command limit. The integral holds the error between samples (forward Euler)
and is held while it would push the command further beyond the limit (conditional integration). The
derivative D passes a first-order filter with a state of its own, discretised exactly
(:mod:`contourlab.controllers.filtered_derivative`). It acts on the error, or on the measurement so
that jumps of the reference do not kick the machine. It is the difference of positions, or the
machine's own velocity measurement where that is the better sensor.

Exact tracking needs the model to be right and all feed-forward at 1. The integral removes the error
that a constant disturbance makes; without it and without feed-forward a ramp is followed with a
constant error. The contour error is whatever the tracking errors of the axes make of it.

References
----------
.. [AstromMurray2008] PID control, filtered derivatives and anti-windup; the book was not at hand,
   equation numbers not checked.
.. [GhaffariUlsoy] pole placement of the axis loops, whose numbers the tests reproduce.

Differences from the book
-------------------------
Anti-windup by conditional integration in place of back-calculation, which needs one more gain and
has no natural one when kp is 0.
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
from contourlab.controllers.filtered_derivative import DerivativeState, FilteredDerivative
from contourlab.errors import ConfigurationError
from contourlab.machines.base import NominalModel
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["AxisPid", "AxisPidState", "BoundAxisPid"]


class AxisPidState(NamedTuple):
    """What the law remembers."""

    integral: AxisVector
    """Integral of the error, shape (n_axes,) [m s]."""
    derivative: DerivativeState
    """Of the error, or of minus the measured position [m], [m/s]."""
    saturated: Count
    """1 if the last command was beyond a limit, int32."""


class AxisPid(AxisController):
    """PID on every axis; see the module. Every gain is one number or one per axis.

    Parameters
    ----------
    model
        Nominal model: kind and limit of the command, and the feed-forward.
    kp
        Proportional gain, >= 0 [command unit per m].
    ki
        Integral gain, >= 0 [command unit per m s].
    kd
        Derivative gain, >= 0 [command unit per m/s].
    derivative_cutoff_hz
        Cut-off frequency of the derivative's filter, > 0 [Hz]; infinite for no filter.
    derivative_on
        ``"error"`` or ``"measurement"``. On the measurement the derivative brakes a steady motion
        too, for which only the integral makes up.
    derivative_source
        ``"position"``: the difference of measured positions; ``"velocity"``: the measured velocity.
    velocity_feed_forward, acceleration_feed_forward, friction_feed_forward
        Shares, 0 to 1, of the model's viscous, inertial and Coulomb terms along the reference.
    friction_velocity
        Width of the smooth sign of the Coulomb term, > 0 [m/s].

    Raises
    ------
    ConfigurationError
        A gain that is negative or not finite; a share outside 0 to 1.
    RefusedError
        The model is commanded by positions.
    """

    kp: Float[Array, " ..."] = real(unit="command unit per m", minimum=0.0)
    ki: Float[Array, " ..."] = real(unit="command unit per m s", minimum=0.0, default=0.0)
    kd: Float[Array, " ..."] = real(unit="command unit per m/s", minimum=0.0, default=0.0)
    derivative_cutoff_hz: Float[Array, " ..."] = real(
        unit="Hz", above=0.0, finite=False, default=np.inf
    )
    derivative_on: str = static(allowed=("error", "measurement"), default="error")
    derivative_source: str = static(allowed=("position", "velocity"), default="position")
    velocity_feed_forward: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=0.0)
    acceleration_feed_forward: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=0.0)
    friction_feed_forward: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=0.0)
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0, default=1e-3)

    def check(self) -> None:
        """Raise RefusedError if the model is commanded by positions."""
        refuse_position_command(type(self).__name__, self.model)

    @staticmethod
    def by_pole_placement(
        model: NominalModel,
        bandwidth_hz: Any,
        damping: Any = 0.7,
        integral_pole: Any = 1.0,
        **settings: Any,
    ) -> AxisPid:
        """Return the law whose closed loop has three chosen poles.

        On the nominal model without Coulomb friction the poles are those of
        (s + α ω) (s² + 2 ζ ω s + ω²), with

            kp = ((1 + 2 ζ α) ω² M - S) / K,   ki = α ω³ M / K,   kd = ((2 ζ + α) ω M - B) / K.

        S, the stiffness, is 0 on most axes. The continuous loop is placed: keep ω some 20 times
        below the sampling rate [rad/s], and the cut-off of the derivative some 10 times above ω.

        Parameters
        ----------
        model
            Nominal model.
        bandwidth_hz
            ω / 2π, > 0 [Hz], one number or one per axis.
        damping
            ζ, > 0.
        integral_pole
            α > 0, the real pole as a multiple of ω.
        **settings
            The other fields of the law.

        Raises
        ------
        ConfigurationError
            A value that is not > 0, or neither one number nor one per axis; a bandwidth so low
            that kd or kp would be negative.
        """
        refuse_no_model(model)
        n = model.n_axes
        omega = 2.0 * np.pi * checked_per_axis("bandwidth_hz", bandwidth_hz, n, above=0.0)
        zeta = checked_per_axis("damping", damping, n, above=0.0)
        alpha = checked_per_axis("integral_pole", integral_pole, n, above=0.0)
        mass, viscous, gain = (np.asarray(x) for x in (model.mass, model.viscous, model.gain))
        kd = ((2.0 * zeta + alpha) * omega * mass - viscous) / gain
        if np.any(kd < 0.0):
            least = np.max(viscous / ((2.0 * zeta + alpha) * mass)) / (2.0 * np.pi)
            raise ConfigurationError(
                f"bandwidth_hz must be >= {least:.3g} Hz, got {bandwidth_hz}: below that the "
                "axis's own damping is more than the poles ask for and kd would be negative"
            )
        stiffness = 0.0 if model.stiffness is None else np.asarray(model.stiffness)
        kp = ((1.0 + 2.0 * zeta * alpha) * omega**2 * mass - stiffness) / gain
        if np.any(kp < 0.0):
            raise ConfigurationError(
                f"bandwidth_hz must be higher, got {bandwidth_hz}: the axis's own stiffness is "
                "more than the poles ask for and kp would be negative"
            )
        return AxisPid(
            model=model,
            kp=kp,
            ki=alpha * omega**3 * mass / gain,
            kd=kd,
            **settings,
        )

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and nothing of the contour."""
        return Needs(command=self.model.command)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundAxisPid:
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
        n = self.n_axes
        cutoff = per_axis("derivative_cutoff_hz", self.derivative_cutoff_hz, n)
        return BoundAxisPid(
            command_limit=self.model.command_limit,
            kp=per_axis("kp", self.kp, n),
            ki=per_axis("ki", self.ki, n),
            kd=per_axis("kd", self.kd, n),
            sample_time=sample_time,
            derivative=FilteredDerivative.from_cutoff(cutoff, sample_time),
            feed_forward=ModelFeedForward.of_model(
                self.model,
                acceleration=self.acceleration_feed_forward,
                velocity=self.velocity_feed_forward,
                friction=self.friction_feed_forward,
                friction_velocity=self.friction_velocity,
            ),
            on_error=self.derivative_on == "error",
            from_velocity=self.derivative_source == "velocity",
        )


class BoundAxisPid(BoundAxisController):
    """The discretised law; made by :meth:`AxisPid.bind`."""

    kp: Float[Array, " ..."] = real(ndim=1)
    ki: Float[Array, " ..."] = real(ndim=1)
    kd: Float[Array, " ..."] = real(ndim=1)
    sample_time: Scalar = real(unit="s", above=0.0)
    derivative: FilteredDerivative = part()
    feed_forward: ModelFeedForward = part()
    on_error: bool = static(flag=True)
    from_velocity: bool = static(flag=True)

    def init(self, sample: Sample) -> AxisPidState:
        """Return the state before the first step.

        On the measurement the filter starts at the measured velocity, so that a machine that
        already moves meets no jump; on the error it starts at zero.

        Parameters
        ----------
        sample
            The first sample.
        """
        signal, rate = self._signal(sample)
        start = jnp.zeros_like(rate) if self.on_error else rate
        return AxisPidState(
            jnp.zeros_like(signal), self.derivative.init(signal, start), jnp.zeros((), jnp.int32)
        )

    def propose(
        self, state: AxisPidState, sample: Sample
    ) -> tuple[AxisVector, tuple[AxisVector, AxisPidState]]:
        """Return the command before the limit, and what to settle with.

        Parameters
        ----------
        state
            As ``init`` or the last ``settle`` returned it.
        sample
            This instant.
        """
        error = sample.reference.position - sample.position
        signal, rate = self._signal(sample)
        derivative = self.derivative.step(
            state.derivative, signal, rate if self.from_velocity else None
        )
        wanted = (
            self.kp * error
            + self.ki * state.integral
            + self.kd * derivative.value
            + self.feed_forward.command(sample.reference)
        )
        return wanted, (error, state._replace(derivative=derivative))

    def settle(
        self, proposal: tuple[AxisVector, AxisPidState], wanted: AxisVector, applied: AxisVector
    ) -> AxisPidState:
        """Return the new state, now that it is known what was applied.

        Parameters
        ----------
        proposal
            What ``propose`` returned.
        wanted, applied
            The whole command before and after the limit.
        """
        error, state = proposal
        increment = error * self.sample_time
        return AxisPidState(
            held_integral(state.integral, increment, wanted, applied),
            state.derivative,
            jnp.any(wanted != applied).astype(jnp.int32),
        )

    def _signal(self, sample: Sample) -> tuple[AxisVector, AxisVector]:
        """Return what the derivative acts on, and its measured rate."""
        if self.on_error:
            reference = sample.reference
            return reference.position - sample.position, reference.velocity - sample.velocity
        return -sample.position, -sample.velocity
