"""What adaptive robust laws in a planar task frame have in common.

The axes are M q'' + B q' + A S_f(q') = u + d in units of the command (the gain of the drive
absorbed), θ = (M, B, A, d) known within bounds. With the errors e of a task frame
(:mod:`~contourlab.controllers.frames.coordinates`),

    s = e' + Λ e = e' - e_eq',    e_eq' = -Λ e,    e_eq'' = -Λ e'                        (1)

and the motion of the axes that e_eq asks for, q_eq'' (3 of that module), everything that the model
needs is linear in θ, axis by axis:

    Y θ = M q_eq'' + B q' + A S_f(q') - d,    Y = (q_eq'', q', S_f(q'), -1)              (2)

This is -Jᵀ Ψ θ, with Ψ the paper's regressor: M_t r_eq'' + C_t r_eq' is J M q_eq''. The law is

    u = Y θ̂ - d̂_c - Jᵀ (K + k) s                                                        (3)

with θ̂ and d̂_c from an adaptation that the laws differ in. Then V = sᵀ M_t s / 2 obeys

    V' = sᵀ [ -(K + k) s - J d̂_c - J Y (θ - θ̂) + Δ ]                                    (4)

whatever the adaptation does, as long as it keeps its bounds: that is what makes the law robust.

**The robust gain** k. With ``robust_accuracy`` η, k = h² / (4 η), where h is at least the size of
all that is unknown in (4): then sᵀ(...) without K is never above η, and V stays below
exp(-λ t) V(0) + η (1 - exp(-λ t)) / λ, λ = 2 min K / max M. Without it k = 0: a constant K, as
the paper has it in practice. A sampled loop stands only so much gain: K + k is held below half the
least mass over the sample time, and the law's status says so, for there the bound is no longer
promised.

The command is clipped at the model's limit. What adapts directly does not push further out while
it is.

References
----------
.. [HuYaoWang] (10) to (21).

Differences from the paper
--------------------------
Everything in axes, so that no Coriolis term and no 2 × 8 regressor is built. h is the sum of what
each parameter's range can do, axis by axis; the paper's |θ_M| |Ψ| is a product of norms that add
V/(m/s²) to V. Limits of the command and of the gain; order (tangential, normal).
"""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.controllers.axis_controller import clip
from contourlab.controllers.base import BoundController
from contourlab.controllers.frames import BoundTaskFrame
from contourlab.controllers.smooth_sign import smooth_sign
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["AdaptiveRobustState", "BoundAdaptiveRobustController", "Parameters"]

Parameters = Float[Array, "4 n_axes"]
"""Rows mass, viscous, coulomb, disturbance."""


class AdaptiveRobustState(NamedTuple):
    """What an adaptive robust law remembers."""

    frame: Any
    adaptation: Any
    """Of the law's own."""
    error: Float[Array, " 2"]
    """The last e: along and across [m]."""
    contour_error: AxisVector
    """The last contour error vector, in axes [m]."""
    status: Count
    """0 normal, 1 saturated, 2 robust gain at the limit of the sampling; int32."""


class BoundAdaptiveRobustController(BoundController):
    """An adaptive robust law, discretised."""

    frame: BoundTaskFrame = part()
    error_decay: Float[Array, " 2"] = real(unit="1/s")
    """Λ."""
    feedback_gain: Float[Array, " 2"] = real()
    """K."""
    lower: Parameters = real()
    upper: Parameters = real()
    initial: Parameters = real()
    command_limit: Float[Array, " ..."] = real(unit="command unit", above=0.0, finite=False)
    """Largest command, per axis; may be infinite."""
    sample_time: Scalar = real(unit="s", above=0.0)
    friction_velocity: AxisVector = real(unit="m/s")
    unmodelled: Scalar = real()
    """δ."""
    largest_gain: Scalar = real()
    robust_accuracy: Scalar | None = real(default=None)
    """η."""
    friction_shape: str = static()

    statuses = ("normal", "saturated", "robust gain held by the sample time")

    @abc.abstractmethod
    def begin(self, sample: Sample) -> Any:
        """Return the state of the adaptation before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """

    @abc.abstractmethod
    def parameters(self, adaptation: Any) -> Parameters:
        """Return θ̂.

        Parameters
        ----------
        adaptation
            State of the adaptation.
        """

    def compensation(self, adaptation: Any) -> AxisVector:
        """Return d̂_c, 0 for laws without.

        Parameters
        ----------
        adaptation
            State of the adaptation.
        """
        del adaptation
        return jnp.zeros(2)

    @property
    def compensation_bound(self) -> AxisVector:
        """Largest d̂_c, per axis [command]."""
        return jnp.zeros(2)

    @abc.abstractmethod
    def adapt(
        self, adaptation: Any, sample: Sample, regressor: Parameters, push: AxisVector,
        wanted: AxisVector, command: AxisVector,
    ) -> Any:  # fmt: skip
        """Return the state of the adaptation after one sample.

        Parameters
        ----------
        adaptation
            Before.
        sample
            This instant.
        regressor
            Y of (2).
        push
            p = Jᵀ s [m/s].
        wanted, command
            Before and after the limit.
        """

    def init(self, sample: Sample) -> AdaptiveRobustState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        zero = jnp.zeros(2)
        return AdaptiveRobustState(
            self.frame.init(sample), self.begin(sample), zero, zero, jnp.zeros((), jnp.int32)
        )

    def step(
        self, state: AdaptiveRobustState, sample: Sample
    ) -> tuple[AxisVector, AdaptiveRobustState]:
        """Return the command, shape (2,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        here, frame = self.frame.step(state.frame, sample)
        wanted_rate = -self.error_decay * here.error
        change = -self.error_decay * here.rate
        s = here.rate - wanted_rate  # (1)
        push = here.to_axes(s)
        _, acceleration = here.equivalent_motion(wanted_rate, change)
        velocity = sample.velocity
        sign = smooth_sign(velocity, self.friction_velocity, self.friction_shape)
        regressor = jnp.stack([acceleration, velocity, sign, -jnp.ones_like(velocity)])  # (2)
        model = jnp.sum(regressor * self.parameters(state.adaptation), axis=0)
        gain, limited = self.robust_gain(regressor)
        wanted = (
            model - self.compensation(state.adaptation)
            - here.to_axes((self.feedback_gain + gain) * s)
        )  # (3)  # fmt: skip
        command = clip(wanted, self.command_limit)
        adaptation = self.adapt(state.adaptation, sample, regressor, push, wanted, command)
        status = jnp.where(jnp.any(wanted != command), 1, jnp.where(limited, 2, 0))
        after = AdaptiveRobustState(
            frame, adaptation, here.error, here.contour_error, status.astype(jnp.int32)
        )
        return command, after

    def robust_gain(self, regressor: Parameters) -> tuple[Array, Array]:
        """Return k, and whether the sampling holds it below what (4) needs.

        Parameters
        ----------
        regressor
            Y of (2).
        """
        if self.robust_accuracy is None:
            return jnp.zeros(2), jnp.zeros((), bool)
        unknown = jnp.sum((self.upper - self.lower) * jnp.abs(regressor), axis=0)
        bound = self.compensation_bound
        h = jnp.sqrt(bound @ bound) + jnp.sqrt(unknown @ unknown) + self.unmodelled
        gain = h * h / (4.0 * self.robust_accuracy)
        room = jnp.maximum(self.largest_gain - self.feedback_gain, 0.0)
        return jnp.minimum(gain, room), jnp.any(gain > room)

    def telemetry(self, state: AdaptiveRobustState) -> dict[str, Array]:
        """Return the contour error vector, the errors in the frame, and the estimates.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        estimate = self.parameters(state.adaptation)
        names = ("mass", "viscous", "coulomb", "disturbance")
        return {
            "contour_error_estimate": state.contour_error,
            "task_error": state.error,
            **{f"{name}_estimate": estimate[row] for row, name in enumerate(names)},
        }

    def status(self, state: AdaptiveRobustState) -> Count:
        """Return 1 if an axis was at its limit, 2 if the robust gain was held, else 0.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.status
