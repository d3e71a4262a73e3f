"""Integrated direct and indirect adaptive robust contouring control, with true parameters.

The parameters come from filtered least squares on what was commanded and measured, apart from the
contour error (:mod:`~contourlab.controllers.least_squares`). What they leave is taken away by a
fast compensation, an integral of the error in axes:

    u = Y θ̂ - d̂_c - Jᵀ K s,    d̂_c' = Proj(γ_a Jᵀ s),    |d̂_c| ≤ d̂_cmax                 (1)

(see :mod:`~contourlab.controllers.adaptive_robust_law` for Y and s). θ̂ converges to the truth if
the motion excites it; how much it does, (26) of the paper, is computed by
:func:`~contourlab.controllers.excitation.windowed_excitation`.

With ``frame=LocalTaskFrame()`` it is the paper's C3, with the global frame (the default) its C2.

References
----------
.. [HuYaoWang] (13), (17), (18) and (22) to (25).

Differences from the paper
--------------------------
Those of the two modules.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete, part, real
from contourlab.contours.base import Contour
from contourlab.controllers.adaptive_robust import AdaptiveRobustController
from contourlab.controllers.adaptive_robust_law import (
    AdaptiveRobustState,
    BoundAdaptiveRobustController,
    Parameters,
)
from contourlab.controllers.axis_controller import held_integral, per_axis
from contourlab.controllers.least_squares import (
    BoundLeastSquares,
    FilteredLeastSquares,
    LeastSquaresState,
)
from contourlab.errors import ConfigurationError
from contourlab.machines.base import PerAxis
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundIntegratedAdaptiveRobust", "IntegratedAdaptiveRobust", "IntegratedState"]

COMPENSATION_SHARE = 2.0
"""By default d̂_c may be this many times the largest d, as in the paper."""


class IntegratedState(NamedTuple):
    """What the adaptation remembers."""

    learned: LeastSquaresState
    compensation: AxisVector
    """d̂_c [command]."""
    command: AxisVector
    """What acts since the last sample [command]."""


class IntegratedAdaptiveRobust(AdaptiveRobustController):
    """Adaptive robust law with least squares and a fast compensation; see the module.

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
    least_squares
        The estimator of the parameters, and the smooth sign of the friction.
    compensation_rate
        γ_a > 0 [command per m], one number or one per axis; K Λ of the normal direction if not
        given, which is the paper's.
    compensation_limit
        d̂_cmax > 0 [command], one number or one per axis; twice the largest d if not given.

    Raises
    ------
    ConfigurationError
        A value out of bounds, of the wrong shape, or without effect.
    RefusedError
        The model is commanded by positions, or has a stiffness.
    """

    least_squares: FilteredLeastSquares = part(default=FilteredLeastSquares())
    compensation_rate: PerAxis | None = real(above=0.0, ndim=1, default=None)
    compensation_limit: PerAxis | None = real(above=0.0, ndim=1, default=None)

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundIntegratedAdaptiveRobust:
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
            A setting of the wrong shape, a cut-off too high for the sample time, or bounds of d
            that are zero and no ``compensation_limit``.
        """
        estimator = self.least_squares
        fields = self.bound_fields(
            contour, sample_time, estimator.friction_velocity, estimator.friction_shape
        )
        lower, upper = fields["lower"], fields["upper"]
        rate, limit = self.compensation_rate, self.compensation_limit
        rate = self.feedback_gain[1] * self.error_decay[1] if rate is None else rate
        if limit is None:
            limit = COMPENSATION_SHARE * jnp.maximum(jnp.abs(lower[3]), jnp.abs(upper[3]))
            if is_concrete(limit) and not np.all(np.asarray(limit) > 0.0):
                raise ConfigurationError(
                    "compensation_limit must be given where the bounds of d are zero: by default "
                    f"it is {COMPENSATION_SHARE:g} times the largest d"
                )
        return BoundIntegratedAdaptiveRobust(
            **fields, estimator=estimator.bind(lower, upper, sample_time),
            compensation_rate=per_axis("compensation_rate", rate, 2),
            largest_compensation=per_axis("compensation_limit", limit, 2),
        )  # fmt: skip


class BoundIntegratedAdaptiveRobust(BoundAdaptiveRobustController):
    """The discretised law; made by :meth:`IntegratedAdaptiveRobust.bind`."""

    estimator: BoundLeastSquares = part()
    compensation_rate: AxisVector = real()
    """γ_a."""
    largest_compensation: AxisVector = real(unit="command unit")
    """d̂_cmax."""

    def begin(self, sample: Sample) -> IntegratedState:
        """Return the state of the adaptation before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        learned = self.estimator.init(sample.position, self.initial)
        return IntegratedState(learned, jnp.zeros(2), jnp.zeros(2))

    def parameters(self, adaptation: Any) -> Parameters:
        """Return θ̂.

        Parameters
        ----------
        adaptation
            State of the adaptation.
        """
        return adaptation.learned.estimate  # type: ignore[no-any-return]

    def compensation(self, adaptation: Any) -> AxisVector:
        """Return d̂_c.

        Parameters
        ----------
        adaptation
            State of the adaptation.
        """
        return adaptation.compensation  # type: ignore[no-any-return]

    @property
    def compensation_bound(self) -> AxisVector:
        """Largest d̂_c, per axis [command]."""
        return self.largest_compensation

    def adapt(
        self, adaptation: Any, sample: Sample, regressor: Parameters, push: AxisVector,
        wanted: AxisVector, command: AxisVector,
    ) -> IntegratedState:  # fmt: skip
        """Return the state of the adaptation after one sample.

        Parameters
        ----------
        adaptation
            Before.
        sample
            This instant.
        regressor
            Not needed: the least squares filter their own.
        push
            p = Jᵀ s [m/s].
        wanted, command
            Before and after the limit.
        """
        del regressor
        learned = self.estimator.step(adaptation.learned, sample.position, adaptation.command)
        # -d̂_c is what is added to the command
        increment = -self.sample_time * self.compensation_rate * push
        minus = held_integral(-adaptation.compensation, increment, wanted, command)  # (1)
        largest = self.largest_compensation
        return IntegratedState(learned, jnp.clip(-minus, -largest, largest), command)

    def telemetry(self, state: AdaptiveRobustState) -> dict[str, Array]:
        """Return what the base reports, d̂_c, and the norm of the covariance.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        adaptation = state.adaptation
        return {
            **super().telemetry(state),
            "compensation": adaptation.compensation,
            "covariance_norm": self.estimator.norm(adaptation.learned.covariance),
        }
