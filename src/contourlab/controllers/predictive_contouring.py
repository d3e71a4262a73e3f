"""Model predictive contouring control: the error across the path counts more than along it.

Over the horizons H_m..H_p of outputs and 1..H_p - d of commands,

    J = Σ_j ρ_cn e_n(k+j)² + ρ_ct e_t(k+j)² + Σ_j ρ_n u*_n(k+j-1)² + ρ_t u*_t(k+j-1)²      (10)

is minimised without constraints, with e = P(1) w - P y and u* = (Q_n/Q_d) u turned into the tangent
t of the path. All that is across it counts alike, so that no normal is needed,

    W_j = ρ_n I + (ρ_t - ρ_n) t tᵀ                                                          (1)

for any number of axes, and neither straight stretches nor inflections are special cases. Then

    Π = Mᵀ [ Gᵀ W G + Φᵀ V Φ ] M,   Γ = -Mᵀ [ Gᵀ W f + Φᵀ V h ],   Π u = Γ           (11) - (13)

with f and h the outputs' errors and filtered commands if nothing is done any more, and W, V the
weights of every sample ahead. By (1) the part of Π that does not turn with the path is found once.
The first command of every axis is given.

``angle="per_step"``, the default, takes the tangent of each sample ahead; ``"single"``, as the
paper writes it, that of now for all. Where the reference stands still it has no direction of
motion, and every error counts as one across the path. Corners are nothing special: the weights turn
with the path. A *contour* error is controlled only as far as e_n is one: on a curve of curvature κ
a lag e_t leaves κ e_t² / 2, which this law does not see. Weighting commands along the path heavily
makes a lag, and with it a contour error, where the paper expects less.

With equal axes, and a path that turns little within the horizon, only ρ_n/ρ_cn matters across the
path and ρ_t/ρ_ct along it: raising ρ_cn tenfold and lowering ρ_n tenfold do the same.

What horizons and polynomials do: :mod:`~contourlab.controllers.predictive_controller`.

References
----------
.. [ElKhalickUchiyama] equations (10) to (13).

Differences from the paper
--------------------------
The second Π_yy of (12) is Π_xy, with G_xᵀ G_y; (13) lacks transposes of G, and N multiplies past
commands; the left side of (11) is the whole horizon. The sums over commands run over
j = 1..H_p - d, and over filtered commands, where (10) prints H_m..H_p and u. With Q = 1 - q⁻¹ what
is weighted in a direction is the change of the commands of the axes, turned, not the change of the
turned command. ζ of (13), which the paper does not explain, is left out: (6) calls so the
disturbance, whose future F c predicts already.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import real, static
from contourlab.contours.base import Contour, unit
from contourlab.controllers.axis_controller import clip, refuse_unlike_axes
from contourlab.controllers.positive_definite import solve_positive_definite
from contourlab.controllers.prediction import History, Predictor
from contourlab.controllers.predictive_controller import (
    BoundPredictiveController,
    PredictiveController,
)
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["BoundPredictiveContouring", "PredictiveContouring", "PredictiveContouringState"]


class PredictiveContouringState(NamedTuple):
    """What the law remembers."""

    history: History
    estimate: AxisVector
    """The last error across the path, shape (n_axes,) [m]."""
    lag: Scalar
    """The last error along it [m]."""
    status: Count
    """int32."""


class PredictiveContouring(PredictiveController):
    """Unconstrained predictive contouring control, equation (10); see the module.

    Parameters
    ----------
    model
        Nominal model: kind and limit of the command, the plant if none is given, and Coulomb
        friction.
    normal_input_weight, tangential_input_weight
        ρ_n and ρ_t, >= 0 [m² per squared command unit].
    contour_weight, lag_weight
        ρ_cn and ρ_ct, > 0.
    angle
        ``"per_step"`` or ``"single"``.
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

    normal_input_weight: Scalar = real(unit="m^2 per squared command unit", minimum=0.0, ndim=0)
    tangential_input_weight: Scalar = real(unit="m^2 per squared command unit", minimum=0.0, ndim=0)
    contour_weight: Scalar = real(above=0.0, ndim=0, default=10.0)
    lag_weight: Scalar = real(above=0.0, ndim=0, default=1.0)
    angle: str = static(allowed=("per_step", "single"), default="per_step")

    def check(self) -> None:
        """Check the polynomials, and that without an input weight enough outputs count."""
        super().check()
        self.refuse_no_weight(self.normal_input_weight, self.tangential_input_weight)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundPredictiveContouring:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour has not one coordinate per axis.
        ConfigurationError
            A polynomial that is neither for all axes nor one per axis.
        """
        refuse_unlike_axes(type(self).__name__, self.n_axes, contour)
        fields = self.bound_fields(sample_time)
        predictor: Predictor = fields["predictor"]
        return BoundPredictiveContouring(
            **fields,
            error_weights=jnp.stack([jnp.asarray(self.contour_weight), self.lag_weight]),
            effort_weights=jnp.stack(
                [jnp.asarray(self.normal_input_weight), self.tangential_input_weight]
            ),
            still=_block_diagonal(
                self.contour_weight * _square(predictor.reach)
                + self.normal_input_weight * _square(predictor.effort)
            ),
            first=self.minimum_horizon,
            per_step=self.angle == "per_step",
        )


def _square(matrices: Array) -> Array:
    return jnp.einsum("ajp,ajq->apq", matrices, matrices)


def _block_diagonal(blocks: Array) -> Array:
    n, size = int(blocks.shape[0]), int(blocks.shape[1])
    whole = jnp.einsum("ab,apq->apbq", jnp.eye(n), blocks)
    return whole.reshape(n * size, n * size)


class BoundPredictiveContouring(BoundPredictiveController):
    """The law with its matrices; made by :meth:`PredictiveContouring.bind`."""

    error_weights: Float[Array, " 2"] = real()
    """ρ_cn, ρ_ct."""
    effort_weights: Float[Array, " 2"] = real()
    """ρ_n, ρ_t."""
    still: Float[Array, "n n"] = real()
    """What of Π does not turn with the path."""
    first: int = static(minimum=1)
    per_step: bool = static(flag=True)

    def init(self, sample: Sample) -> PredictiveContouringState:
        """Return the state before the first step, of a machine that has been at rest.

        Parameters
        ----------
        sample
            The first sample.
        """
        zero = jnp.zeros_like(sample.position)
        return PredictiveContouringState(
            self.start(sample), zero, zero[0], jnp.zeros((), jnp.int32)
        )

    def step(
        self, state: PredictiveContouringState, sample: Sample
    ) -> tuple[AxisVector, PredictiveContouringState]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        predictor = self.predictor
        history, position = predictor.measured(state.history, sample.position)
        velocity = jnp.concatenate([sample.reference.velocity[None], sample.preview.velocity])
        if not self.per_step:
            velocity = jnp.broadcast_to(velocity[0], velocity.shape)
        tangent = jax.vmap(unit)(velocity).T  # t(k) .. t(k+H_p), one row per axis
        free = self._minimiser(
            predictor.residual(history, sample.preview.position[self.first - 1 :]),
            predictor.residual_effort(history),
            tangent[:, self.first :],
            tangent[:, : predictor.effort.shape[1]],
        )
        against = self.against_friction(sample)
        wanted = free[:, 0] + predictor.at_rest * history.origin + against
        command = clip(wanted, self.command_limit)
        error = sample.reference.position - position
        along = tangent[:, 0] @ error
        return command, PredictiveContouringState(
            predictor.applied(history, command - against),
            error - along * tangent[:, 0],
            along,
            self.status_of(self.lost(sample), jnp.any(wanted != command)),
        )

    def _minimiser(self, f: Array, h: Array, ahead: Array, now: Array) -> Array:
        """Return the free commands that minimise (10), shape (n_axes, n_free).

        ``f``, ``h`` are the residuals, ``ahead``, ``now`` the tangents that weight them.
        """
        reach, effort = self.predictor.reach, self.predictor.effort
        n, n_free = int(reach.shape[0]), int(reach.shape[2])
        cn, ct = self.error_weights[0], self.error_weights[1]
        rn, rt = self.effort_weights[0], self.effort_weights[1]
        # G M and Φ M turned into the tangent: rows (axis, free command), columns samples
        z = jnp.swapaxes(reach * ahead[:, :, None], 1, 2).reshape(n * n_free, -1)
        y = jnp.swapaxes(effort * now[:, :, None], 1, 2).reshape(n * n_free, -1)
        matrix = self.still + (ct - cn) * z @ z.T + (rt - rn) * y @ y.T  # (12) by (1)
        across = cn * jnp.sum(reach * f[:, :, None], 1) + rn * jnp.sum(effort * h[:, :, None], 1)
        along = (ct - cn) * z @ jnp.sum(ahead * f, 0) + (rt - rn) * y @ jnp.sum(now * h, 0)
        right = -(across.reshape(-1) + along)  # (13)
        return solve_positive_definite(matrix, right[:, None])[:, 0].reshape(n, n_free)  # (11)

    def telemetry(self, state: PredictiveContouringState) -> dict[str, Array]:
        """Return the error across the path, as a vector, and the error along it.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return {"contour_error_estimate": state.estimate, "lag_error": jnp.asarray(state.lag)}

    def status(self, state: PredictiveContouringState) -> Count:
        """Return the status of the last step, an index into ``statuses``.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.status
