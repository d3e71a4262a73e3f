"""Direct adaptive robust contouring control: the parameters follow the error, not the truth.

    θ̂' = Proj(Γ Ψᵀ s):    θ̂_j' = -Γ_j Y_j p,    p = Jᵀ s                                (1)

for each axis, Y = (q_eq'', q', S_f, -1) and the law u = Y θ̂ - Jᵀ K s of
:mod:`~contourlab.controllers.adaptive_robust_law`. The fast row is that of d̂, an integral of the
error in axes; it removes a constant error whatever its cause.

Good contouring, no identification: θ̂ goes where the error wants it. Under velocity noise of
variance σ² the masses drift up, since q_eq'' and p hold the same noise:

    mean of M̂_i' = Γ σ² (Λ_t t_i² + Λ_n n_i²)                                            (2)

Use :class:`IntegratedAdaptiveRobust` where the parameters matter.

References
----------
.. [HuYaoWang] (8), (13) without u_a2, and section IV.B, C1; the paper only cites where it is from.

Differences from the paper
--------------------------
Projection by clipping after each sample.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.adaptive_robust import AdaptiveRobustController
from contourlab.controllers.adaptive_robust_law import (
    BoundAdaptiveRobustController,
    Parameters,
)
from contourlab.controllers.smooth_sign import SHAPES
from contourlab.errors import ConfigurationError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundDirectAdaptiveRobust", "DirectAdaptiveRobust"]

SLOW_SHARE = 0.02
"""By default the rates of mass and friction are this share of what their ranges allow."""


class DirectAdaptiveRobust(AdaptiveRobustController):
    """Adaptive robust law whose parameters follow the error; see the module.

    Parameters
    ----------
    model
        Nominal model of two axes.
    error_decay
        Λ, > 0 [1/s], (tangential, normal).
    feedback_gain
        K, > 0 [command per m/s], (tangential, normal).
    frame
        A task frame.
    uncertainty
        Share of the model's mass, viscous and Coulomb friction by which the truth may differ, one
        number or three; 0.5 if nothing is given.
    disturbance_limit
        Largest d, > 0 [command], one number or one per axis; a quarter of the command's limit if
        not given.
    parameter_lower, parameter_upper
        Bounds of θ in place of those two, shape (4, 2): mass, viscous, coulomb, disturbance.
    initial_parameters
        θ̂(0), shape (4, 2), within the bounds; if not given that of the model, or the nearest
        within them.
    robust_accuracy
        η > 0 [command m/s]: the robust feedback by its conditions; none: a constant gain alone.
    unmodelled_limit
        δ >= 0 [command]: size of what no parameter explains, for that feedback.
    adaptation_rate
        Γ > 0, shape (4,) or (4, 2) [θ² per command, m]. If not given: K Λ of the normal direction
        for d, and for the others 0.02 of that times the square of their range over that of d.
    friction_velocity
        v_0 of the smooth sign, > 0 [m/s].
    friction_shape
        ``"arctan"`` or ``"tanh"``.

    Raises
    ------
    ConfigurationError
        A value out of bounds, of the wrong shape, or without effect.
    RefusedError
        The model is commanded by positions, or has a stiffness.
    """

    adaptation_rate: Float[Array, " ..."] | None = real(above=0.0, default=None)
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0, default=1.0 / 9000.0)
    friction_shape: str = static(allowed=SHAPES, default="arctan")

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundDirectAdaptiveRobust:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            A planar contour without corners.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour is not planar, has a corner, or lacks an implicit form that is asked for.
        ConfigurationError
            A setting of the wrong shape, or bounds that leave d no range and no
            ``adaptation_rate``.
        """
        fields = self.bound_fields(
            contour, sample_time, self.friction_velocity, self.friction_shape
        )
        return BoundDirectAdaptiveRobust(**fields, rate=self._rate(*self.bounds()))

    def _rate(self, lower: Array, upper: Array) -> Array:
        if self.adaptation_rate is None:
            fast = self.feedback_gain[1] * self.error_decay[1]
            span = upper - lower
            if is_concrete(span) and not np.all(np.asarray(span[3]) > 0.0):
                raise ConfigurationError(
                    "adaptation_rate must be given where the bounds leave d no range: it is "
                    "measured by that"
                )
            share = jnp.array([SLOW_SHARE] * 3 + [1.0])[:, None]
            return fast * share * (span / span[3]) ** 2
        rate = jnp.asarray(self.adaptation_rate)
        if np.shape(rate) not in ((4,), (4, 2)):
            raise ConfigurationError(
                f"adaptation_rate must have shape (4,) or (4, 2), got {np.shape(rate)}"
            )
        return jnp.broadcast_to(rate if rate.ndim == 2 else rate[:, None], (4, 2))


class BoundDirectAdaptiveRobust(BoundAdaptiveRobustController):
    """The discretised law; made by :meth:`DirectAdaptiveRobust.bind`."""

    rate: Parameters = real()
    """Γ."""

    def begin(self, sample: Sample) -> Parameters:
        """Return θ̂(0).

        Parameters
        ----------
        sample
            Not needed.
        """
        del sample
        return jnp.asarray(self.initial)

    def parameters(self, adaptation: Any) -> Parameters:
        """Return θ̂.

        Parameters
        ----------
        adaptation
            State of the adaptation.
        """
        return adaptation  # type: ignore[no-any-return]

    def adapt(
        self, adaptation: Any, sample: Sample, regressor: Parameters, push: AxisVector,
        wanted: AxisVector, command: AxisVector,
    ) -> Parameters:  # fmt: skip
        """Return θ̂ after one sample.

        Parameters
        ----------
        adaptation
            Before.
        sample
            Not needed.
        regressor
            Y.
        push
            p = Jᵀ s [m/s].
        wanted, command
            Before and after the limit.
        """
        del sample
        # every parameter moves the command against p: not while that is further out
        held = (wanted - command) * push < 0.0
        step = jnp.where(held, 0.0, self.sample_time * push)
        moved = adaptation - self.rate * regressor * step  # (1)
        return jnp.clip(moved, self.lower, self.upper)
