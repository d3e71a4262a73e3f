"""Configuration that adaptive robust laws have in common: gains, frame, bounds of the parameters.

What they do with it stands in :mod:`~contourlab.controllers.adaptive_robust_law`.

References
----------
.. [HuYaoWang] (7), (13) and section IV.
"""

from __future__ import annotations

import abc
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, part, real
from contourlab.contours.base import Contour
from contourlab.controllers.adaptive_robust_law import BoundAdaptiveRobustController
from contourlab.controllers.axis_controller import (
    per_axis,
    refuse_no_model,
    refuse_position_command,
)
from contourlab.controllers.base import Controller, Needs
from contourlab.controllers.frames import GlobalTaskFrame, TaskFrame
from contourlab.controllers.parameter_bounds import nominal_parameters, parameter_bounds
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.typing import Array, Scalar

__all__ = ["AdaptiveRobustController"]

UNCERTAINTY = 0.5
"""Share of every parameter that is uncertain if nothing is said."""
SAMPLED_SHARE = 0.5
"""K + k is at most this share of the least mass over the sample time."""


def _refuse_outside(initial: Array, lower: Array, upper: Array) -> None:
    """Raise ConfigurationError unless a start is within the bounds."""
    start, low, high = np.broadcast_arrays(*(np.asarray(x) for x in (initial, lower, upper)))
    wrong = np.argwhere(~((low <= start) & (start <= high)))
    if len(wrong):
        *_, row, axis = place = tuple(wrong[0])
        name = ("mass", "viscous", "coulomb", "disturbance")[row]
        raise ConfigurationError(
            "initial_parameters must be within the bounds of the parameters: "
            f"{name} of axis {axis} in {low[place]:g} to {high[place]:g}, got {start[place]:g}"
        )


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
            raise RefusedError(
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
        if self.initial_parameters is not None:
            _refuse_outside(self.initial_parameters, lower, upper)

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
        if initial is None:
            initial = nominal_parameters(self.model)
        elif all(is_concrete(value) for value in (initial, lower, upper)):
            _refuse_outside(initial, lower, upper)
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
