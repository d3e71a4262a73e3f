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
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    clip,
    per_axis,
    refuse_no_model,
    refuse_position_command,
)
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.frames import BoundTaskFrame, GlobalTaskFrame, TaskFrame
from contourlab.controllers.parameter_bounds import nominal_parameters, parameter_bounds
from contourlab.controllers.smooth_sign import smooth_sign
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = [
    "AdaptiveRobustController",
    "AdaptiveRobustState",
    "BoundAdaptiveRobustController",
]

UNCERTAINTY = 0.5
"""Share of every parameter that is uncertain if nothing is said."""
SAMPLED_SHARE = 0.5
"""K + k is at most this share of the least mass over the sample time."""
Parameters = Float[Array, "4 n_axes"]


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


class AdaptiveRobustController(Controller):
    """Configuration of an adaptive robust law; see the module."""

    model: NominalModel = part()
    error_decay: Float[Array, " ..."] = real(unit="1/s", above=0.0)
    feedback_gain: Float[Array, " ..."] = real(above=0.0)
    frame: TaskFrame = part(default=GlobalTaskFrame())
    uncertainty: Float[Array, " ..."] | None = real(minimum=0.0, default=None)
    disturbance_limit: Float[Array, " ..."] | None = real(above=0.0, default=None)
    parameter_lower: Float[Array, " ..."] | None = real(default=None)
    parameter_upper: Float[Array, " ..."] | None = real(default=None)
    initial_parameters: Float[Array, " ..."] | None = real(default=None)
    robust_accuracy: Scalar | None = real(above=0.0, ndim=0, default=None)
    unmodelled_limit: Scalar | None = real(minimum=0.0, ndim=0, default=None)

    def __check_init__(self) -> None:
        refuse_no_model(self.model)
        name = type(self).__name__
        if not isinstance(self.frame, TaskFrame):
            raise ConfigurationError(
                f"frame must be a task frame, such as GlobalTaskFrame(), got {self.frame!r}"
            )
        refuse_position_command(name, self.model)
        if self.model.n_axes != 2:
            raise ConfigurationError(
                f"{name} is for two axes in a plane, the model has {self.model.n_axes}"
            )
        if self.model.stiffness is not None:
            raise RefusedError(f"{name} knows no stiffness, and the model has one")
        both = (self.parameter_lower is None) == (self.parameter_upper is None)
        if not both:
            raise ConfigurationError("parameter_lower and parameter_upper go together")
        for other in ("uncertainty", "disturbance_limit"):
            if self.parameter_lower is not None and getattr(self, other) is not None:
                raise ConfigurationError(
                    f"{other} has no effect beside parameter_lower and parameter_upper"
                )
        if self.unmodelled_limit is not None and self.robust_accuracy is None:
            raise ConfigurationError("unmodelled_limit has no effect without robust_accuracy")
        for field in ("parameter_lower", "parameter_upper", "initial_parameters"):
            value = getattr(self, field)
            if value is not None and np.shape(value)[-2:] != (4, 2):
                raise ConfigurationError(
                    f"{field} must have shape (4, 2): mass, viscous, coulomb and disturbance for "
                    f"each axis; got {np.shape(value)}"
                )

    def check(self) -> None:
        """Check the number of gains and the order of the bounds."""
        for field in ("error_decay", "feedback_gain"):
            if np.shape(getattr(self, field))[-1:] != (2,):
                raise ConfigurationError(
                    f"{field} must be (tangential, normal), got shape "
                    f"{np.shape(getattr(self, field))}"
                )
        lower, upper = self.parameter_lower, self.parameter_upper
        if lower is None or upper is None:
            return
        if not np.all(np.asarray(lower) <= np.asarray(upper)):
            raise ConfigurationError("parameter_lower must be <= parameter_upper everywhere")
        if not np.all(np.asarray(lower)[..., 0, :] > 0.0):
            raise ConfigurationError("parameter_lower must be > 0 for the masses")

    @classmethod
    def by_bandwidth(cls, model: NominalModel, bandwidth_hz: Any, **settings: Any) -> Any:
        """Return the law whose errors decay at chosen rates.

        Λ = 2π f, and K = 2 Λ M with the largest mass of the axes (in units of the command): the
        integral of the adaptation then makes s a loop of damping 0.7 on that axis, more on the
        lighter. Keep f below 1 / (25 T) for axes of equal mass, and lower as they differ.

        Parameters
        ----------
        model
            Nominal model.
        bandwidth_hz
            f > 0 [Hz], (tangential, normal).
        **settings
            Other fields.

        Raises
        ------
        ConfigurationError
            A bandwidth that is not two numbers > 0.
        """
        frequency = np.asarray(bandwidth_hz, float)
        if np.shape(frequency) != (2,) or not np.all(frequency > 0.0):
            raise ConfigurationError(
                f"bandwidth_hz must be (tangential, normal), each > 0 Hz, got {bandwidth_hz!r}"
            )
        refuse_no_model(model)
        decay = 2.0 * np.pi * frequency
        heaviest = jnp.max(jnp.asarray(model.mass) / jnp.asarray(model.gain))
        return cls(model=model, error_decay=decay, feedback_gain=2.0 * decay * heaviest, **settings)

    @property
    def n_axes(self) -> int:
        """2."""
        return 2

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and what the frame needs."""
        return Needs(
            command=self.model.command, derivatives=self.frame.derivatives,
            contour=self.frame.needs_contour,
        )  # fmt: skip

    def bounds(self) -> tuple[Array, Array]:
        """Return the bounds of θ, given or from the nominal model and its uncertainty.

        Raises
        ------
        ConfigurationError
            No limit of d where the command has none; a wrong shape.
        """
        if self.parameter_lower is not None and self.parameter_upper is not None:
            return jnp.asarray(self.parameter_lower), jnp.asarray(self.parameter_upper)
        share = UNCERTAINTY if self.uncertainty is None else self.uncertainty
        return parameter_bounds(self.model, share, self.disturbance_limit)

    @abc.abstractmethod
    def bind(self, contour: Contour, sample_time: Scalar) -> BoundAdaptiveRobustController:
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
            A setting of the wrong shape.
        """

    def bound_fields(
        self, contour: Contour, sample_time: Scalar, friction_velocity: Any, shape: str
    ) -> dict[str, Any]:
        """Return the fields of the bound law that all laws have.

        Parameters
        ----------
        contour, sample_time
            As for ``bind``.
        friction_velocity, shape
            Of the smooth sign.
        """
        lower, upper = self.bounds()
        initial = self.initial_parameters
        initial = nominal_parameters(self.model) if initial is None else initial
        unmodelled = 0.0 if self.unmodelled_limit is None else self.unmodelled_limit
        return {
            "frame": self.frame.bind(contour, sample_time),
            "error_decay": self.error_decay,
            "feedback_gain": self.feedback_gain,
            "lower": lower,
            "upper": upper,
            "initial": jnp.clip(jnp.asarray(initial, float), lower, upper),
            "command_limit": self.model.command_limit,
            "sample_time": sample_time,
            "friction_velocity": per_axis("friction_velocity", friction_velocity, 2),
            "friction_shape": shape,
            "robust_accuracy": self.robust_accuracy,
            "unmodelled": unmodelled,
            "largest_gain": SAMPLED_SHARE * jnp.min(lower[0]) / sample_time,
        }


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
    command_limit: Float[Array, " ..."] = real(above=0.0, finite=False)
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
