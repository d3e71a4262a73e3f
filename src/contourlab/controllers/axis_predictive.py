"""Predictive control of every axis by itself: what contouring control is to improve on.

Each axis minimises its own

    J_i = Σ_j (P y(k+j) - P(1) w(k+j))² + ρ_i Σ_j u*(k+j-1)²                                (9)

over j = H_m..H_p and j = 1..H_p - d, with u* = (Q_n/Q_d) u. Nothing in it depends on where the axis
is, so the answer is a row of gains that is found once. The contour error is whatever the tracking
errors of the axes make of it; with equal axes and a straight path it is none. As an axis law it may
be coupled (:class:`~contourlab.controllers.CrossCoupled`).

What horizons and polynomials do: :mod:`~contourlab.controllers.predictive_controller`.

References
----------
.. [ElKhalickUchiyama] equation (9), which the paper takes from a book that was not at hand.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    clip,
    per_axis,
)
from contourlab.controllers.positive_definite import solve_positive_definite
from contourlab.controllers.prediction import History, Predictor
from contourlab.controllers.predictive_controller import (
    BoundPredictiveController,
    PredictiveController,
)
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Flag, Scalar

__all__ = ["AxisPredictive", "AxisPredictiveState", "BoundAxisPredictive"]


class AxisPredictiveState(NamedTuple):
    """What the law remembers."""

    history: History
    saturated: Count
    """Status of the last step, int32; 1 if the command was beyond a limit."""


class AxisPredictive(PredictiveController, AxisController):
    """Unconstrained predictive control on every axis, equation (9); see the module.

    Parameters
    ----------
    model
        Nominal model: kind and limit of the command, the plant if none is given, and Coulomb
        friction.
    input_weight
        ρ, >= 0, one number or one per axis [m² per squared command unit].
    prediction_horizon, control_horizon, minimum_horizon
        H_p, H_c and H_m, in samples.
    delay
        d, samples from a command to its effect beyond the usual one.
    disturbance_integrators, disturbance_plant, disturbance_polynomial
        D = (1 - q⁻¹)^integrators × A, if ``disturbance_plant``, × polynomial.
    noise_polynomial
        C, with its roots inside the unit circle: (1, -1.6, 0.64) for a noisy sensor.
    servo_polynomial
        P.
    input_filter_numerator, input_filter_denominator
        Q_n and Q_d; by default changes of the command are weighted.
    holding_polynomial
        φ, how commands go on after the control horizon; by default they stay.
    plant_numerator, plant_denominator
        B [m per unit of command] and A of an identified difference equation, in place of the
        nominal model's.
    form
        ``"realigned"`` or ``"independent"``.
    friction_compensation
        Share, 0 to 1, of the model's Coulomb friction that is compensated.
    friction_velocity
        Width of the smooth sign, > 0 [m/s].

    Raises
    ------
    ConfigurationError
        Horizons that do not fit, a weight of the wrong sign, a polynomial that cannot be divided
        by.
    RefusedError
        The model is commanded by positions and no plant is given.
    """

    input_weight: Float[Array, " ..."] = real(unit="m^2 per squared command unit", minimum=0.0)

    def check(self) -> None:
        """Check the polynomials, and that without an input weight enough outputs count."""
        super().check()
        self.refuse_no_weight(self.input_weight)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundAxisPredictive:
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
            A weight or a polynomial that is neither one for all axes nor one per axis.
        """
        del contour
        fields = self.bound_fields(sample_time)
        weight = per_axis("input_weight", self.input_weight, self.n_axes)
        gain, effort_gain = _gains(fields["predictor"], jnp.asarray(weight))
        return BoundAxisPredictive(**fields, gain=gain, effort_gain=effort_gain)


@jax.jit
def _gains(predictor: Predictor, weight: Array) -> tuple[Array, Array]:
    """Return what the first command takes from the residuals: -(1 0 ..) Π⁻¹ Mᵀ [Gᵀ, ρ Φᵀ]."""

    def one(reach: Array, effort: Array, rho: Array) -> tuple[Array, Array]:
        matrix = reach.T @ reach + rho * effort.T @ effort
        first = jnp.eye(matrix.shape[0])[:, :1]
        row = solve_positive_definite(matrix, first)[:, 0]  # Π is symmetric
        return -reach @ row, -rho * effort @ row

    return jax.vmap(one)(predictor.reach, predictor.effort, weight)


class AxisPredictiveProposal(NamedTuple):
    """What a step settles with."""

    history: History
    command: AxisVector
    """Of this law alone, within the limit."""
    against: AxisVector
    """The part of it against friction."""
    lost: Flag
    """Whether a position was not finite."""


class BoundAxisPredictive(BoundPredictiveController, BoundAxisController):
    """The law with its gains; made by :meth:`AxisPredictive.bind`."""

    gain: Float[Array, "..."] = real()
    """Command per residual output, shape (n_axes, n_outputs)."""
    effort_gain: Float[Array, "..."] = real()
    """Command per residual effort, shape (n_axes, n_commands)."""

    def init(self, sample: Sample) -> AxisPredictiveState:
        """Return the state before the first step, of a machine that has been at rest.

        Parameters
        ----------
        sample
            The first sample.
        """
        return AxisPredictiveState(self.start(sample), jnp.zeros((), jnp.int32))

    def propose(
        self, state: AxisPredictiveState, sample: Sample
    ) -> tuple[AxisVector, AxisPredictiveProposal]:
        """Return the command before the limit, and what to settle with.

        Parameters
        ----------
        state
            As ``init`` or the last ``settle`` returned it.
        sample
            This instant.
        """
        predictor = self.predictor
        history, _ = predictor.measured(state.history, sample.position)
        skipped = int(sample.preview.position.shape[0]) - int(self.gain.shape[1])
        error = predictor.residual(history, sample.preview.position[skipped:])
        effort = predictor.residual_effort(history)
        command = jnp.sum(self.gain * error, -1) + jnp.sum(self.effort_gain * effort, -1)
        against = self.against_friction(sample)
        command = command + predictor.at_rest * history.origin + against
        return command, AxisPredictiveProposal(
            history, clip(command, self.command_limit), against, self.lost(sample)
        )

    def settle(
        self,
        proposal: AxisPredictiveProposal,
        wanted: AxisVector,
        applied: AxisVector,
    ) -> AxisPredictiveState:
        """Return the new state, now that it is known what was applied.

        Parameters
        ----------
        proposal
            What ``propose`` returned.
        wanted, applied
            The whole command before and after the limit.
        """
        given = jnp.where(jnp.isfinite(applied), applied, proposal.command)
        history = self.predictor.applied(proposal.history, given - proposal.against)
        saturated = jnp.any(wanted != applied)
        return AxisPredictiveState(history, self.status_of(proposal.lost, saturated))
