"""Cross-coupled control: a PID on the estimated contour error, added to an axis law.

    u = axis law + kp ε + ki ∫ε dt + kd dε/dt,    clipped at the model's command limit

with ε the estimated contour error vector, from the actual point to the contour, so that a positive
gain pulls the tool onto the path. Any estimator, any axis law, any number of axes.

What the integral and the derivative of a *vector* mean along a curved path has to be chosen
(``form``):

``"normal"`` (the default)
    ε is projected onto the plane normal to the tangent at the reference point; between samples the
    integral and the filter of the derivative are carried along with that plane, turned exactly as
    the tangent turns (parallel transport, (1) below). A constant error on one side of the path is a
    constant input to the integral, on a line as on a circle. In the plane, and with each gain equal
    on all axes, this *is* the classical scalar law: a PID on the contour error signed along the
    left normal, its output applied along that normal. (Gains that differ from axis to axis scale
    the coordinates of ε each by itself, so that the output has a part along the path.) The
    transport extends it to space without a Frenet frame, hence without its singularity on straight
    stretches.

``"vector"``
    A PID on each coordinate of ε. The integral stays where it is while the path turns: on a circle
    at the angular rate Ω a constant radial error is to it a rotating one, so that it no longer
    removes the error but answers with the gain ki / Ω, 90° late. Right where the disturbance is
    constant in the *axes* (gravity, cogging) and for polygons; gains per axis act on each
    coordinate alone.

Exact transport of a vector v normal to the tangent t0 into the plane normal to t1:

    v ← v - (t0 + t1) (t1·v) / (1 + t0·t1)                                  (1)

The law is as good as its estimator. It competes with the axis loops on the normal direction, where
the effective gains add up, and does nothing about the error along the path. High gains meet the
same limits of stability as an axis loop with those gains.

On a :class:`Cascade` that commands a force or a voltage the law gains little or nothing: the
coupling enters as an effort, which the inner velocity loop takes for a disturbance and fights, its
integral until nothing is left. Use it with :class:`AxisPid`, or on drives that take a velocity.

The estimator is handed the positions of the axes: the law does not take account of a tool map, and
is for machines whose axes are the coordinates of the tool point.

Integrals: forward Euler; held while they would push the command further beyond the limit. The axis
law settles on the whole command. The derivative passes a first-order filter, discretised exactly,
and starts at zero.

References
----------
.. [Koren1980] cross-coupling of two axes; the paper was not at hand, equation numbers not checked.
.. [GhaffariUlsoy] a PID per axis on the contour error vector, the form ``"vector"``.

Differences from the papers
---------------------------
Koren's law is an integral and proportional one on straight lines and circles; here PID on whatever
the estimator says. Ghaffari and Ulsoy normalise the vector to unit length (a relay with a boundary
layer): that is :class:`NewtonCrossCoupled`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contour_errors.base import Estimator
from contourlab.contours.base import Contour, unit
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    clip,
    per_axis,
    refuse_no_axis_law,
    refuse_unlike_axes,
)
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.filtered_derivative import DerivativeState, FilteredDerivative
from contourlab.errors import ConfigurationError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["BoundCrossCoupled", "CrossCoupled", "CrossCoupledState"]


class CrossCoupledState(NamedTuple):
    """What the law remembers; vectors have shape (n_axes,)."""

    axis: Any
    """State of the axis law."""
    estimator: Any
    """State of the estimator."""
    estimate: AxisVector
    """The last estimated contour error vector [m]."""
    integral: AxisVector
    """Integral of the contour error [m s]."""
    derivative: DerivativeState
    """Of the contour error [m], [m/s]."""
    tangent: AxisVector
    """Tangent at the last reference point [1]."""
    saturated: Count
    """1 if the last command was beyond a limit, int32."""


class CrossCoupled(Controller):
    """A PID on the estimated contour error, added to an axis law; see the module.

    Parameters
    ----------
    axis
        The axis law, such as :class:`AxisPid` or :class:`Cascade`; its model gives the limits.
    estimator
        Where the contour error comes from.
    kp
        Proportional gain, >= 0 [command unit per m], one number or one per axis; likewise the rest.
    ki
        Integral gain, >= 0 [command unit per m s].
    kd
        Derivative gain, >= 0 [command unit per m/s].
    derivative_cutoff_hz
        Cut-off frequency of the derivative's filter, > 0 [Hz]; infinite for no filter. One number:
        directions turn, so that axes cannot have filters of their own.
    form
        ``"normal"``: integral and derivative ride along with the path; ``"vector"``: they stay with
        the coordinates.
    engage_time
        From when the coupling acts, >= 0 [s]: until then the axis law runs alone, and the integral
        rests.

    Raises
    ------
    ConfigurationError
        A gain that is negative or not finite; an axis law or estimator that is none.
    """

    axis: AxisController = part()
    estimator: Estimator = part()
    kp: Float[Array, " ..."] = real(unit="command unit per m", minimum=0.0)
    ki: Float[Array, " ..."] = real(unit="command unit per m s", minimum=0.0, default=0.0)
    kd: Float[Array, " ..."] = real(unit="command unit per m/s", minimum=0.0, default=0.0)
    derivative_cutoff_hz: Float[Array, " ..."] = real(
        unit="Hz", above=0.0, finite=False, default=np.inf
    )
    form: str = static(allowed=("normal", "vector"), default="normal")
    engage_time: Scalar = real(unit="s", minimum=0.0, ndim=0, default=0.0)

    def __check_init__(self) -> None:
        refuse_no_axis_law(self.axis)
        if not isinstance(self.estimator, Estimator):
            raise ConfigurationError(
                "estimator must be an estimator, such as TangentEstimator(), "
                f"got {self.estimator!r}"
            )

    @property
    def needs(self) -> Needs:
        """What the axis law and the estimator need, and the tangent."""
        axis, estimator = self.axis.needs, self.estimator.needs
        return Needs(
            command=axis.command,
            preview=axis.preview,
            derivatives=max(axis.derivatives, estimator.derivatives, 1),
            contour=axis.contour or estimator.contour,
            host_synthesis=axis.host_synthesis,
        )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.axis.n_axes

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundCrossCoupled:
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
            The contour has not one coordinate per axis, or the estimator cannot take it.
        ConfigurationError
            A gain that is neither one number nor one per axis.
        """
        return BoundCrossCoupled(**self.bound_parts(contour, sample_time))

    def bound_parts(self, contour: Contour, sample_time: Scalar) -> dict[str, Any]:
        """Return the fields of the bound law, for this law and those that extend it.

        Parameters
        ----------
        contour
            The path that the loop follows.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            As ``bind``.
        ConfigurationError
            As ``bind``.
        """
        n = self.n_axes
        refuse_unlike_axes(type(self).__name__, n, contour)
        if np.shape(self.derivative_cutoff_hz) != ():
            raise ConfigurationError(
                "derivative_cutoff_hz must be one number, got shape "
                f"{np.shape(self.derivative_cutoff_hz)}"
            )
        return {
            "axis": self.axis.bind(contour, sample_time),
            "estimator": self.estimator.bind(contour, sample_time),
            "kp": per_axis("kp", self.kp, n),
            "ki": per_axis("ki", self.ki, n),
            "kd": per_axis("kd", self.kd, n),
            "sample_time": sample_time,
            "derivative": FilteredDerivative.from_cutoff(self.derivative_cutoff_hz, sample_time),
            "follows_path": self.form == "normal",
            "engage_time": self.engage_time,
        }


class BoundCrossCoupled(BoundController):
    """The discretised law; made by :meth:`CrossCoupled.bind`."""

    axis: BoundAxisController = part()
    estimator: Estimator = part()
    kp: Float[Array, " ..."] = real(ndim=1)
    ki: Float[Array, " ..."] = real(ndim=1)
    kd: Float[Array, " ..."] = real(ndim=1)
    sample_time: Scalar = real(unit="s", above=0.0)
    derivative: FilteredDerivative = part()
    follows_path: bool = static(flag=True)
    engage_time: Scalar = real(unit="s", minimum=0.0)

    statuses = ("normal", "saturated")

    def init(self, sample: Sample) -> CrossCoupledState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        estimator = self.estimator.init(sample)
        tangent = unit(sample.geometry[1])
        estimate, _ = self.estimator.step(estimator, sample)
        zero = jnp.zeros_like(sample.position)
        error = self._controlled(estimate, tangent)
        return CrossCoupledState(
            axis=self.axis.init(sample),
            estimator=estimator,
            estimate=estimate,
            integral=zero,
            derivative=self.derivative.init(error, zero),
            tangent=tangent,
            saturated=jnp.zeros((), jnp.int32),
        )

    def step(
        self, state: CrossCoupledState, sample: Sample
    ) -> tuple[AxisVector, CrossCoupledState]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        estimate, estimator = self.estimator.step(state.estimator, sample)
        tangent = unit(sample.geometry[1])
        error = self._controlled(estimate, tangent)
        integral, last = state.integral, state.derivative
        if self.follows_path:
            integral = transport(integral, state.tangent, tangent)
            last = DerivativeState(*(transport(v, state.tangent, tangent) for v in last))
        derivative = self.derivative.step(last, error)
        # half a sample early, so that the instant itself does not hang on rounding
        engaged = sample.time > self.engage_time - 0.5 * self.sample_time
        whole = self.kp * error + self.ki * integral + self.kd * derivative.value
        coupling = jnp.where(engaged, whole, 0.0)

        by_axes, proposal = self.axis.propose(state.axis, sample)
        wanted = by_axes + coupling
        command = clip(wanted, self.axis.command_limit)
        outwards = (wanted - command) @ (self.ki * error) > 0.0
        return command, CrossCoupledState(
            axis=self.axis.settle(proposal, wanted, command),
            estimator=estimator,
            estimate=estimate,
            integral=integral + jnp.where(outwards | ~engaged, 0.0, error * self.sample_time),
            derivative=derivative,
            tangent=tangent,
            saturated=jnp.any(wanted != command).astype(jnp.int32),
        )

    def telemetry(self, state: CrossCoupledState) -> dict[str, Array]:
        """Return the estimate, and what the axis law reports.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return {**self.axis.telemetry(state.axis), "contour_error_estimate": state.estimate}

    def status(self, state: CrossCoupledState) -> Count:
        """Return 1 if an axis was at its limit, else 0.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.saturated

    def _controlled(self, estimate: AxisVector, tangent: AxisVector) -> AxisVector:
        """Return the part of the estimate that the PID acts on."""
        return estimate - tangent * (tangent @ estimate) if self.follows_path else estimate


def transport(vector: AxisVector, start: AxisVector, end: AxisVector) -> AxisVector:
    """Return a vector normal to one tangent, turned as that tangent turns into another.

    Parameters
    ----------
    vector
        Normal to ``start``, shape (n_axes,).
    start, end
        Unit tangents. Where they are opposite the turn is not defined; the vector stays.
    """
    cosine = jnp.maximum(1.0 + start @ end, 1e-9)
    return vector - (start + end) * ((end @ vector) / cosine)  # (1)
