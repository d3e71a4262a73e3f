"""What predictive laws have in common: horizons, polynomials, what is predicted and what is held.

Positions ahead are predicted from past commands and measurements
(:mod:`~contourlab.controllers.prediction`), the commands of a short horizon are chosen so that a
sum of squares is least, the first of them is given, and all is done again a sample later.

Horizons, in samples: outputs count from ``minimum_horizon`` to ``prediction_horizon``, the first
``control_horizon`` commands are free, and after them φ P u = 0; with φ = 1 - q⁻¹ and P = 1 the last
one is kept. A horizon has to cover what the machine does in answer: some 0.1 s on the published
feed drive. A command that is kept for long misses a curve, by an error that grows with the square
of the feed and that weights across the path make larger: free at least half of the commands, or let
φ = (1 - q⁻¹)² go on at a constant slope.

**The disturbance model decides more than any weight.** D = (1 - q⁻¹)^integrators × A × polynomial
lists the disturbances that come back for ever. The default, (1 - q⁻¹) A, is that of a force that is
constant: it is predicted and leaves no error behind. Without the integrator a constant force leaves
one, without A it is removed slowly, and with D = 1 nothing measured is used at all: an open loop,
which the status of every step then says. An input filter 1 - q⁻¹ belongs to the integrator: it
weights changes of the command, so that holding against a constant force costs nothing.

Commands beyond the limit are clipped, and what was applied is what is remembered: there is nothing
to wind up. A limit is not foreseen. A reference that asks for more than the drives give, with light
input weights, ends in a limit cycle.

The reference is known ``prediction_horizon`` samples ahead; past its end it rests at its last
point. Coulomb friction of the model, which is no part of the prediction, is compensated along the
reference velocity beside it. ``delay`` is that of the drive, in whole samples, 0 if a command acts
in the sample in which it is given.

A position that is not finite is replaced by the one that the model and D expect, axis by axis, for
as long as that lasts; the status says so, and nothing of it stays in what the law remembers. Before
the first position the machine counts as on the reference. A command that another law has made not
finite is remembered as the one that this law gave.
"""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import is_concrete, part, real, static
from contourlab.controllers.axis_controller import per_axis, refuse_no_model
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.held_model import held_polynomials
from contourlab.controllers.polynomials import check_roots, multiply
from contourlab.controllers.prediction import (
    History,
    Horizons,
    Polynomials,
    Predictor,
    make_predictor,
)
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Flag, Scalar

__all__ = ["BoundPredictiveController", "PredictiveController"]

Coefficients = Float[Array, "..."]


class PredictiveController(Controller):
    """Horizons and polynomials of a predictive law; see the module.

    Polynomials are in q⁻¹, (1, -0.8) for 1 - 0.8 q⁻¹: one for all axes, or one row per axis.
    """

    model: NominalModel = part()
    prediction_horizon: int = static(minimum=1, default=20)
    control_horizon: int = static(minimum=1, default=10)
    minimum_horizon: int = static(minimum=1, default=1)
    delay: int = static(minimum=0, default=0)
    disturbance_integrators: int = static(minimum=0, default=1)
    disturbance_plant: bool = static(flag=True, default=True)
    disturbance_polynomial: Coefficients = real(ndim=1, default=(1.0,))
    noise_polynomial: Coefficients = real(ndim=1, default=(1.0,))
    servo_polynomial: Coefficients = real(ndim=1, default=(1.0,))
    input_filter_numerator: Coefficients = real(ndim=1, default=(1.0, -1.0))
    input_filter_denominator: Coefficients = real(ndim=1, default=(1.0,))
    holding_polynomial: Coefficients = real(ndim=1, default=(1.0, -1.0))
    plant_numerator: Coefficients | None = real(ndim=1, default=None)
    plant_denominator: Coefficients | None = real(ndim=1, default=None)
    form: str = static(allowed=("realigned", "independent"), default="realigned")
    friction_compensation: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=1.0)
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0, default=1e-3)

    _POLYNOMIALS: ClassVar[tuple[str, ...]] = (
        "disturbance_polynomial", "noise_polynomial", "servo_polynomial",
        "input_filter_numerator", "input_filter_denominator", "holding_polynomial",
        "plant_numerator", "plant_denominator",
    )  # fmt: skip

    def __check_init__(self) -> None:
        name = type(self).__name__
        refuse_no_model(self.model)
        counts = (self.minimum_horizon, self.prediction_horizon, self.control_horizon)
        whole = all(isinstance(count, int) and count >= 1 for count in counts)
        if not (whole and isinstance(self.delay, int)):
            return  # the fields' own bounds refuse these
        if self.minimum_horizon > self.prediction_horizon:
            raise ConfigurationError(
                f"minimum_horizon must be <= prediction_horizon = {self.prediction_horizon}, "
                f"got {self.minimum_horizon}"
            )
        if self.delay >= self.prediction_horizon:
            raise ConfigurationError(
                f"delay must be < prediction_horizon = {self.prediction_horizon}, got "
                f"{self.delay}: no command would reach an output within the horizon"
            )
        if self.control_horizon > self.prediction_horizon - self.delay:
            raise ConfigurationError(
                "control_horizon must be <= prediction_horizon - delay = "
                f"{self.prediction_horizon - self.delay}, got {self.control_horizon}"
            )
        if self.form == "realigned" and not self.disturbance_plant:
            raise ConfigurationError(
                "form 'realigned' needs disturbance_plant=True: only a disturbance model that "
                "contains the plant lets the model's own output be eliminated; choose "
                "form='independent'"
            )
        if (self.plant_numerator is None) != (self.plant_denominator is None):
            raise ConfigurationError(
                "plant_numerator and plant_denominator must be given together, or neither"
            )
        if self.model.command == "position" and self.plant_numerator is None:
            raise RefusedError(
                f"{name} of a model that takes positions, whose drive closes its loop itself, "
                "needs that loop as plant_numerator and plant_denominator"
            )

    def check(self) -> None:
        """Check the leading coefficients, and the roots of what is divided by."""
        for name in self._POLYNOMIALS:
            value = getattr(self, name)
            if value is None:
                continue
            if np.ndim(value) == 0:
                raise ConfigurationError(
                    f"{name} must list coefficients of 1, q^-1, ..., got {value}"
                )
            if name != "plant_numerator" and np.any(np.asarray(value)[..., 0] == 0.0):
                raise ConfigurationError(f"{name} must not begin with 0")
        if self.plant_numerator is not None:
            still = np.sum(np.asarray(self.plant_numerator), -1) == 0.0
            if np.any(still):
                raise ConfigurationError(
                    "plant_numerator must not add up to 0: a constant command would move nothing"
                )
        check_roots("noise_polynomial", self.noise_polynomial, on_circle=False)
        check_roots("input_filter_denominator", self.input_filter_denominator, on_circle=True)

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.model.n_axes

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and the reference over the prediction horizon."""
        return Needs(command=self.model.command, preview=self.prediction_horizon)

    @property
    def open_loop(self) -> bool:
        """Whether the disturbance model is constant, so that nothing measured is used."""
        return (
            not self.disturbance_plant
            and self.disturbance_integrators == 0
            and np.shape(self.disturbance_polynomial)[-1] == 1
        )

    @property
    def horizons(self) -> Horizons:
        """The horizons together."""
        return Horizons(
            self.minimum_horizon, self.prediction_horizon, self.control_horizon,
            self.prediction_horizon - self.delay,
        )  # fmt: skip

    def plant(self, sample_time: Scalar) -> tuple[Array, Array]:
        """Return B and A as they are used: as given, or of the nominal model; without the delay.

        Parameters
        ----------
        sample_time
            Time between samples [s].
        """
        if self.plant_numerator is None or self.plant_denominator is None:
            return held_polynomials(self.model, sample_time)
        return self._rows("plant_numerator"), self._rows("plant_denominator")

    def predictor(self, sample_time: Scalar) -> Predictor:
        """Return the predictor for one sample time.

        Parameters
        ----------
        sample_time
            Time between samples [s].

        Raises
        ------
        ConfigurationError
            A polynomial that is neither for all axes nor one per axis.
        """
        numerator, denominator = self.plant(sample_time)
        waiting = jnp.zeros((numerator.shape[0], self.delay))
        disturbance: Array = self._rows("disturbance_polynomial")
        difference = jnp.array([[1.0, -1.0]])
        for _ in range(self.disturbance_integrators):
            disturbance = multiply(disturbance, difference)
        realigned = self.form == "realigned"
        if self.disturbance_plant and not realigned:
            disturbance = multiply(disturbance, denominator)
        predictor: Predictor = make_predictor(
            Polynomials(
                numerator=jnp.concatenate([waiting, numerator], 1), denominator=denominator,
                noise=self._rows("noise_polynomial"), disturbance=disturbance,
                servo=self._rows("servo_polynomial"),
                filter_numerator=self._rows("input_filter_numerator"),
                filter_denominator=self._rows("input_filter_denominator"),
                holding=self._rows("holding_polynomial"),
            ),
            horizons=self.horizons, realigned=realigned,
        )  # fmt: skip
        return predictor

    def bound_fields(self, sample_time: Scalar) -> dict[str, Any]:
        """Return the fields of the bound law that all laws have.

        Parameters
        ----------
        sample_time
            Time between samples [s].
        """
        if is_concrete(sample_time) and not np.all(np.asarray(sample_time) > 0.0):
            raise ConfigurationError(f"sample_time must be > 0 s, got {sample_time}")
        n, model = self.n_axes, self.model
        share = per_axis("friction_compensation", self.friction_compensation, n)
        return {
            "command_limit": model.command_limit,
            "predictor": self.predictor(sample_time),
            "friction": share * model.coulomb / model.gain,
            "friction_velocity": per_axis("friction_velocity", self.friction_velocity, n),
            "open_loop": self.open_loop,
        }

    def refuse_no_weight(self, *weights: Any) -> None:
        """Raise ConfigurationError if more commands are free than outputs count, unweighted.

        Parameters
        ----------
        *weights
            Of the inputs.
        """
        late = self.delay
        if self.plant_numerator is not None:  # zeros in front are a delay too
            late += int(np.max(np.argmax(np.asarray(self.plant_numerator) != 0.0, -1)))
        counted = self.prediction_horizon - max(self.minimum_horizon, late + 1) + 1
        if self.control_horizon > counted and any(np.any(np.asarray(w) == 0.0) for w in weights):
            raise ConfigurationError(
                f"control_horizon must be <= {counted}, the number of outputs that count, where an "
                f"input weight is 0, got {self.control_horizon}"
            )

    def _rows(self, name: str) -> Array:
        """Return a polynomial with one row per axis."""
        value, n = jnp.asarray(getattr(self, name)), self.n_axes
        if value.ndim > 2 or (value.ndim == 2 and value.shape[0] not in (1, n)):
            raise ConfigurationError(
                f"{name} must be one polynomial or one for each of the {n} axes, "
                f"got shape {value.shape}"
            )
        return jnp.broadcast_to(value, (n, value.shape[-1]))


class BoundPredictiveController(BoundController):
    """What predictive laws are when they are bound: a predictor, limits and friction."""

    command_limit: Float[Array, " ..."] = real(unit="command unit", above=0.0, finite=False)
    """Largest command, per axis; may be infinite."""
    predictor: Predictor = part()
    friction: Float[Array, " ..."] = real(unit="command unit", ndim=1)
    """Command against Coulomb friction."""
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", ndim=1)
    open_loop: bool = static(flag=True)

    statuses: ClassVar[tuple[str, ...]] = (
        "normal", "saturated", "open loop: a constant disturbance model uses no measurement",
        "a measurement was lost: the model's in its place",
    )  # fmt: skip

    def start(self, sample: Sample) -> History:
        """Return the history of a machine that has been at rest where it is measured.

        Parameters
        ----------
        sample
            The first sample.
        """
        known = jnp.isfinite(sample.position)
        return self.predictor.start(jnp.where(known, sample.position, sample.reference.position))

    def against_friction(self, sample: Sample) -> AxisVector:
        """Return the command against Coulomb friction along the reference velocity.

        Parameters
        ----------
        sample
            This instant.
        """
        return self.friction * jnp.tanh(sample.reference.velocity / self.friction_velocity)

    def lost(self, sample: Sample) -> Flag:
        """Return whether a measured position is not finite.

        Parameters
        ----------
        sample
            This instant.
        """
        return jnp.any(~jnp.isfinite(sample.position))

    def status_of(self, lost: Flag, saturated: Flag) -> Count:
        """Return the status of a step, an index into ``statuses``.

        Parameters
        ----------
        lost
            Whether a measured position was not finite.
        saturated
            Whether an axis was at its limit.
        """
        fine = jnp.where(saturated, 1, 2 * self.open_loop)
        return jnp.where(lost, 3, fine).astype(jnp.int32)
