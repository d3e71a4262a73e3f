"""Integral sliding mode position control on every axis, with a disturbance estimate.

With e = reference - measured position, e' likewise of velocities, and an integral state q,

    q' = -b q + μ sat(σ/μ)                                        (20)
    σ  = e' + a e + b q                                           (21)
    T  = ((a + b) M - B)/K e' + a b M/K e + (M r'' + B r')/K
         + κ μ sat(σ/μ)                                           (22)
    u  = T - Δ + what friction and stiffness take

with Δ the estimated disturbance (:mod:`contourlab.controllers.disturbance_estimator`). For M = τ,
B = 1, K = k (22) is the paper's. On an axis as the model says, under a disturbance D in units of
the command,

    σ' = -b σ - (κ K/M - b) μ sat(σ/μ) - (K/M) D                  (S)

Outside the boundary layer, |σ| > μ, the switching term drives σ back as long as |D| < κ μ. The
paper's condition asks for a little more, b μ M/K of the command:

    κ >= D_max / μ + b M / K                                      (23)

It is checked when the law is made. Inside the layer the law is linear, its poles are a, b and
κ K/M, and D answers with

    e / D = -(K/M) s / ((s + a) (s + b) (s + κ K/M))              (T)

Theorem 1 in these terms. A constant disturbance leaves no error: (T) has a zero at s = 0. A varying
one leaves a residual, to leading order (K/M) D' / (a b κ K/M) = D' / (a b κ), which ``"none"``
shows. With the estimate, on a reference without jerk,

    e / D = -(K/M) s² (s + c) / ((s+a) (s+b) (s + κ K/M) (s+c) (s+d) - d s⁴)    (R)

and with its ``"matched"`` form, on any reference,

    e / D = -(K/M) s² (s + c + d) / ((s+a) (s+b) (s + κ K/M) (s+c) (s+d))       (R')

so that even a ramp leaves none. Beyond |D| = κ μ the layer is left for good and an error of
(K/M) (|D| - κ μ) / (a b) stays. D counts with whatever the estimate adds to it: on a reference
with jerk the corrected form is off by (M/K) jerk / c, the matched one by nothing.

The boundary layer takes the place of a relay: its slope κ is the gain at which the axis would
chatter when sampled too slowly. ``bind`` computes the poles of the sampled loop on the nominal
model and refuses what is not stable. Delays, coarse encoders and elastic axes are not in it.

T includes what a cross-coupling adds when it comes to the estimate (``settle``), and is the
command after the limit. q is leaky, |q| <= μ / b; it is held while it would push the command
further beyond the limit.

References
----------
.. [GhaffariUlsoy] section III; equation numbers are the paper's, but (S), (T), (R) and (R'),
   which are derived here.

Differences from the paper
--------------------------
(25) is corrected, and the matched form added. Any model with mass, damping and stiffness: S P / K
is added to (22) with the measured position, so that (S) holds. Coulomb friction may be fed forward;
the estimate is told. Sampled: q is discretised exactly for a saturation that is held between
samples. κ may be left out and is then the least that (23) allows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, part, real, static
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
from contourlab.controllers.disturbance_estimator import (
    FORMS,
    DisturbanceEstimator,
    DisturbanceState,
)
from contourlab.controllers.feed_forward import ModelFeedForward
from contourlab.controllers.sliding_mode_stability import refuse_unstable
from contourlab.errors import ConfigurationError
from contourlab.machines.base import NominalModel
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["BoundIntegralSlidingMode", "IntegralSlidingMode", "IntegralSlidingModeState"]

_ROUNDING = 1e-9
"""Share of the least switching gain by which a given one may be below it."""


class IntegralSlidingModeState(NamedTuple):
    """What the law remembers."""

    integral: AxisVector
    """q, shape (n_axes,) [m]."""
    surface: AxisVector
    """σ of the last sample, shape (n_axes,) [m/s]."""
    estimate: DisturbanceState
    """Of the disturbance; zero where it is not estimated."""
    saturated: Count
    """1 if the last command was beyond a limit, int32."""


class IntegralSlidingMode(AxisController):
    """Integral sliding mode on every axis; see the module. Numbers are one, or one per axis.

    Parameters
    ----------
    model
        Nominal model: M, B, K, S, kind and limit of the command.
    error_rate
        a, > 0 [1/s]: how fast the position error dies out on the sliding surface.
    integral_rate
        b, > 0 [1/s]: how fast the integral forgets.
    boundary_layer
        μ, > 0 [m/s]: half the thickness of the layer in which the switching is linear.
    disturbance_bound
        D_max, >= 0 [command unit]: the largest disturbance that (23) is to hold for.
    switching_gain
        κ [command unit per m/s]; the least that (23) allows when None.
    disturbance_estimate
        ``"corrected"``; ``"matched"``, for references with jerk; ``"printed"``: with (25) as in
        the paper; ``"none"``.
    acceleration_rate
        c, > 0 [1/s], of the derivative in the estimate; 2 a, the paper's choice, when None.
    smoothing_rate
        d, > 0 [1/s], of the smoothing of the estimate; 2 a, the paper's choice, when None.
    friction_feed_forward
        Share, 0 to 1, of the model's Coulomb friction along the reference.
    friction_velocity
        Width of the smooth sign of the Coulomb term, > 0 [m/s].

    Raises
    ------
    ConfigurationError
        A number out of bounds; a switching gain below (23), with its axis and what it has to be; a
        rate of an estimate that is not made.
    RefusedError
        The model is commanded by positions.
    """

    error_rate: Float[Array, " ..."] = real(unit="1/s", above=0.0, ndim=1)
    integral_rate: Float[Array, " ..."] = real(unit="1/s", above=0.0, ndim=1)
    boundary_layer: Float[Array, " ..."] = real(unit="m/s", above=0.0, ndim=1)
    disturbance_bound: Float[Array, " ..."] = real(unit="command unit", minimum=0.0, ndim=1)
    switching_gain: Float[Array, " ..."] | None = real(
        unit="command unit per m/s", above=0.0, ndim=1, default=None
    )
    disturbance_estimate: str = static(allowed=(*FORMS, "none"), default="corrected")
    acceleration_rate: Float[Array, " ..."] | None = real(
        unit="1/s", above=0.0, ndim=1, default=None
    )
    smoothing_rate: Float[Array, " ..."] | None = real(unit="1/s", above=0.0, ndim=1, default=None)
    friction_feed_forward: Float[Array, " ..."] = real(
        minimum=0.0, maximum=1.0, ndim=1, default=0.0
    )
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0, ndim=1, default=1e-3)

    def check(self) -> None:
        """Check (23), and that no rate is given in vain."""
        refuse_position_command(type(self).__name__, self.model)
        if self.disturbance_estimate == "none":
            for name in ("acceleration_rate", "smoothing_rate"):
                if getattr(self, name) is not None:
                    raise ConfigurationError(
                        f"{name} has no effect with disturbance_estimate 'none'"
                    )
        if self.switching_gain is None:
            return
        least = np.asarray(self._least_gain())
        given, least = np.broadcast_arrays(np.asarray(self.switching_gain), least)
        low = np.argwhere(given < least * (1.0 - _ROUNDING))
        if len(low):
            at = tuple(low[0])
            bound = np.broadcast_to(np.asarray(self.disturbance_bound), least.shape)[at]
            raise ConfigurationError(
                f"switching_gain of axis {at[-1] if at else 0} (counted from 0) must be >= "
                f"{least[at]:.6g} for a disturbance_bound of {bound:.6g} (the stability condition "
                f"D_max / boundary_layer + integral_rate M / K), got {given[at]:.6g}: raise the "
                "gain or the boundary layer, or lower the bound"
            )

    def _least_gain(self) -> Any:
        """Return the right side of (23)."""
        return (
            self.disturbance_bound / self.boundary_layer
            + self.integral_rate * self.model.mass / self.model.gain
        )

    @staticmethod
    def by_bandwidth(
        model: NominalModel,
        bandwidth_hz: Any,
        disturbance_bound: Any,
        layer_ratio: Any = 3.0,
        **settings: Any,
    ) -> IntegralSlidingMode:
        """Return the law with chosen poles inside a layer that holds the disturbance.

        a = b = ω, and the pole of the layer κ K/M = ρ ω with ρ the ``layer_ratio``. (23) then
        holds with equality for the thickness

            μ = K D_max / (M (ρ - 1) ω).

        A bound well above the disturbance makes the layer thicker, not the gains higher. Keep
        ρ ω some 10 times below the sampling rate [rad/s].

        Parameters
        ----------
        model
            Nominal model.
        bandwidth_hz
            ω / 2π, > 0 [Hz], one number or one per axis.
        disturbance_bound
            D_max, > 0 [command unit], one number or one per axis.
        layer_ratio
            ρ > 1; the paper's axes have 6.15 and 5.33.
        **settings
            The other fields of the law.

        Raises
        ------
        ConfigurationError
            A value out of bounds, or neither one number nor one per axis.
        RefusedError
            The model is commanded by positions.
        """
        refuse_no_model(model)
        n = model.n_axes
        omega = 2.0 * np.pi * checked_per_axis("bandwidth_hz", bandwidth_hz, n, above=0.0)
        bound = checked_per_axis("disturbance_bound", disturbance_bound, n, above=0.0)
        ratio = checked_per_axis("layer_ratio", layer_ratio, n, above=1.0)
        inertia = np.asarray(model.mass) / np.asarray(model.gain)
        return IntegralSlidingMode(
            model=model,
            error_rate=omega,
            integral_rate=omega,
            boundary_layer=bound / (inertia * (ratio - 1.0) * omega),
            disturbance_bound=bound,
            **settings,
        )

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and nothing of the contour."""
        return Needs(command=self.model.command)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundIntegralSlidingMode:
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
            A number that is neither one nor one per axis.
        RefusedError
            The sampled loop on the nominal model is not stable inside the layer; not looked at
            while it is traced.
        """
        del contour
        n, model = self.n_axes, self.model
        a = per_axis("error_rate", self.error_rate, n)
        b = per_axis("integral_rate", self.integral_rate, n)
        layer = per_axis("boundary_layer", self.boundary_layer, n)
        per_axis("disturbance_bound", self.disturbance_bound, n)
        gain = self._least_gain() if self.switching_gain is None else self.switching_gain
        gain = per_axis("switching_gain", gain, n)
        c = self._rate("acceleration_rate", a)
        d = self._rate("smoothing_rate", a)
        inertia, viscous = model.mass / model.gain, model.viscous / model.gain
        estimated = self.disturbance_estimate != "none"
        estimator = DisturbanceEstimator.of_model(
            model, c, d, sample_time, self.disturbance_estimate
        )
        law = BoundIntegralSlidingMode(
            command_limit=model.command_limit,
            error_rate=a,
            integral_rate=b,
            boundary_layer=layer,
            switching_gain=gain,
            velocity_gain=(a + b) * inertia - viscous,
            position_gain=a * b * inertia,
            decay=jnp.exp(-b * sample_time),
            estimator=estimator,
            feed_forward=ModelFeedForward.of_model(
                model, acceleration=np.ones(n), velocity=np.ones(n),
                friction=self.friction_feed_forward, friction_velocity=self.friction_velocity,
            ),
            estimated=estimated,
        )  # fmt: skip
        if all(map(is_concrete, (sample_time, model.mass, *jax.tree.leaves(law)))):
            refuse_unstable(law, model, float(np.asarray(sample_time)))
        return law

    def _rate(self, name: str, error_rate: AxisVector) -> AxisVector:
        given = getattr(self, name)
        return 2.0 * error_rate if given is None else per_axis(name, given, self.n_axes)


class BoundIntegralSlidingMode(BoundAxisController):
    """The discretised law; made by :meth:`IntegralSlidingMode.bind`."""

    statuses = ("normal", "saturated", "outside the boundary layer")

    error_rate: Float[Array, " ..."] = real(unit="1/s", ndim=1)
    integral_rate: Float[Array, " ..."] = real(unit="1/s", ndim=1)
    boundary_layer: Float[Array, " ..."] = real(unit="m/s", ndim=1)
    switching_gain: Float[Array, " ..."] = real(ndim=1)
    velocity_gain: Float[Array, " ..."] = real(unit="command unit per m/s", ndim=1)
    """((a + b) M - B) / K."""
    position_gain: Float[Array, " ..."] = real(unit="command unit per m", ndim=1)
    """a b M / K."""
    decay: Float[Array, " ..."] = real(unit="1", ndim=1)
    """exp(-b T)."""
    estimator: DisturbanceEstimator = part()
    feed_forward: ModelFeedForward = part()
    estimated: bool = static(flag=True)

    def init(self, sample: Sample) -> IntegralSlidingModeState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        zero = jnp.zeros_like(sample.position)
        return IntegralSlidingModeState(
            zero, zero, self.estimator.init(sample.velocity), jnp.zeros((), jnp.int32)
        )

    def propose(
        self, state: IntegralSlidingModeState, sample: Sample
    ) -> tuple[AxisVector, tuple[AxisVector, AxisVector, Sample, IntegralSlidingModeState]]:
        """Return the command before the limit, and what to settle with.

        Parameters
        ----------
        state
            As ``init`` or the last ``settle`` returned it.
        sample
            This instant.
        """
        reference = sample.reference
        error = reference.position - sample.position  # (16)
        rate = reference.velocity - sample.velocity  # (17)
        surface = rate + self.error_rate * error + self.integral_rate * state.integral  # (21)
        layer = self.boundary_layer
        switched = layer * jnp.clip(surface / layer, -1.0, 1.0)
        wanted = (
            self.velocity_gain * rate
            + self.position_gain * error
            + self.feed_forward.command(reference)
            - self.estimator.stiffness * error  # the spring is fed forward where the axis is
            + self.switching_gain * switched
        )  # (22)
        if self.estimated:
            wanted = wanted - state.estimate.disturbance
        increment = (1.0 - self.decay) * (switched / self.integral_rate - state.integral)
        return wanted, (increment, surface, sample, state)

    def settle(
        self,
        proposal: tuple[AxisVector, AxisVector, Sample, IntegralSlidingModeState],
        wanted: AxisVector,
        applied: AxisVector,
    ) -> IntegralSlidingModeState:
        """Return the new state, now that it is known what was applied.

        Parameters
        ----------
        proposal
            What ``propose`` returned.
        wanted, applied
            The whole command before and after the limit.
        """
        increment, surface, sample, state = proposal
        estimate = state.estimate
        if self.estimated:
            friction = self.feed_forward.friction_command(sample.reference)
            estimate = self.estimator.step(
                estimate, sample.position, sample.velocity, applied - friction
            )
        return IntegralSlidingModeState(
            held_integral(state.integral, increment, wanted, applied),  # (20)
            surface,
            estimate,
            jnp.any(wanted != applied).astype(jnp.int32),
        )

    def status(self, state: Any) -> Count:
        """Return 1 if the last command was beyond a limit, else 2 if σ was outside the layer.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        outside = jnp.any(jnp.abs(state.surface) > self.boundary_layer)
        return jnp.where(outside & (state.saturated == 0), 2, state.saturated).astype(jnp.int32)

    def telemetry(self, state: IntegralSlidingModeState) -> dict[str, Array]:
        """Return σ/μ, within ±1 inside the layer, and the estimated disturbance.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        shown = {"sliding_surface": state.surface / self.boundary_layer}
        if self.estimated:
            shown["disturbance_estimate"] = state.estimate.disturbance
        return shown
