"""Koren and Lo's variable-gain cross-coupling: a PID on one signed contour error; in the plane.

    ε = -C_x e_x + C_y e_y,   C_x = sin φ - e_x / (2 ρ),   C_y = cos φ + e_y / (2 ρ)      (1)
    w = kp ε + ki ∫ε dt + kd dε/dt                                                        (2)
    u_x = axis law - C_x w,   u_y = axis law + C_y w                                      (3)

with e the tracking error, φ the angle of the tangent at the reference point and ρ its radius of
curvature, signed. ε > 0 means that the contour lies to the left. ε is the estimate of
:class:`~contourlab.contour_errors.VariableGainEstimator` (where it is exact and where it fails),
(-C_x, C_y) the left normal at the reference point turned by half the angle to that at the foot.

Since the PID has one integral that belongs to the side of the path, a constant error on one side is
constant to it while the path turns. The gains C are not normalised: their length is
sqrt(1 + ε/ρ - |e|²/(4 ρ²)), 1 for errors that are small against the radius.

Integral: forward Euler, held while it would push the command further beyond the limit. The
derivative passes a first-order filter, discretised exactly, and starts at zero.

References
----------
.. [KorenLo1991] variable-gain cross-coupling; the paper was not at hand.
.. [GhaffariUlsoy] figure 5 and section IV: the scheme with which theirs is compared, and its gains.
   The numbering is ours.

Differences from the paper
--------------------------
1/ρ is used, so that a straight stretch is no special case. On top of any axis law.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from contourlab.configuration import part, real
from contourlab.contour_errors.variable_gain import VariableGainEstimator
from contourlab.contours.base import Contour, unit
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    clip,
    refuse_no_axis_law,
    refuse_unlike_axes,
)
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.filtered_derivative import DerivativeState, FilteredDerivative
from contourlab.errors import RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = [
    "BoundVariableGainCrossCoupled",
    "VariableGainCrossCoupled",
    "VariableGainCrossCoupledState",
]


class VariableGainCrossCoupledState(NamedTuple):
    """What the law remembers."""

    axis: Any
    """State of the axis law."""
    estimate: AxisVector
    """The last estimated contour error vector, shape (2,) [m]."""
    integral: Scalar
    """Integral of ε [m s]."""
    derivative: DerivativeState
    """Of ε, each of shape (1,) [m], [m/s]."""
    saturated: Count
    """1 if the last command was beyond a limit, int32."""


class VariableGainCrossCoupled(Controller):
    """A PID on Koren and Lo's contour error, added to an axis law; planar; see the module.

    Parameters
    ----------
    axis
        The axis law, of two axes.
    kp
        Proportional gain, >= 0 [command unit per m].
    ki
        Integral gain, >= 0 [command unit per m s].
    kd
        Derivative gain, >= 0 [command unit per m/s].
    derivative_cutoff_hz
        Cut-off frequency of the derivative's filter, > 0 [Hz]; infinite for no filter.

    Raises
    ------
    ConfigurationError
        A gain that is negative or not finite; an axis law that is none.
    """

    axis: AxisController = part()
    kp: Scalar = real(unit="command unit per m", minimum=0.0, ndim=0)
    ki: Scalar = real(unit="command unit per m s", minimum=0.0, ndim=0, default=0.0)
    kd: Scalar = real(unit="command unit per m/s", minimum=0.0, ndim=0, default=0.0)
    derivative_cutoff_hz: Scalar = real(unit="Hz", above=0.0, finite=False, ndim=0, default=np.inf)

    def __check_init__(self) -> None:
        refuse_no_axis_law(self.axis)

    @property
    def needs(self) -> Needs:
        """What the axis law needs, and two derivatives of the contour."""
        axis = self.axis.needs
        return Needs(
            command=axis.command,
            preview=axis.preview,
            derivatives=max(axis.derivatives, VariableGainEstimator().needs.derivatives),
            contour=axis.contour,
            host_synthesis=axis.host_synthesis,
        )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.axis.n_axes

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundVariableGainCrossCoupled:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows, in the plane.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            The contour is not planar, or has not one coordinate per axis.
        """
        if contour.n_axes != 2:
            raise RefusedError(
                "VariableGainCrossCoupled is a law for the plane: its gains are sine and cosine of "
                f"the path's direction there, and this contour has {contour.n_axes} coordinates. "
                "Use NewtonCrossCoupled or CrossCoupled"
            )
        refuse_unlike_axes(type(self).__name__, self.n_axes, contour)
        return BoundVariableGainCrossCoupled(
            axis=self.axis.bind(contour, sample_time),
            kp=self.kp,
            ki=self.ki,
            kd=self.kd,
            sample_time=sample_time,
            derivative=FilteredDerivative.from_cutoff(
                jnp.asarray(self.derivative_cutoff_hz), sample_time
            ),
        )


class BoundVariableGainCrossCoupled(BoundController):
    """The discretised law; made by :meth:`VariableGainCrossCoupled.bind`."""

    axis: BoundAxisController = part()
    kp: Scalar = real()
    ki: Scalar = real()
    kd: Scalar = real()
    sample_time: Scalar = real(unit="s", above=0.0)
    derivative: FilteredDerivative = part()
    estimator: VariableGainEstimator = part(default=VariableGainEstimator())

    statuses = ("normal", "saturated")

    def init(self, sample: Sample) -> VariableGainCrossCoupledState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        error, gains = self.estimator.gains(sample)
        signal = jnp.reshape(error, (1,))
        return VariableGainCrossCoupledState(
            axis=self.axis.init(sample),
            estimate=error * unit(gains),
            integral=jnp.zeros(()),
            derivative=self.derivative.init(signal, jnp.zeros_like(signal)),
            saturated=jnp.zeros((), jnp.int32),
        )

    def step(
        self, state: VariableGainCrossCoupledState, sample: Sample
    ) -> tuple[AxisVector, VariableGainCrossCoupledState]:
        """Return the command, shape (2,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        error, gains = self.estimator.gains(sample)  # (1)
        derivative = self.derivative.step(state.derivative, jnp.reshape(error, (1,)))
        push = self.kp * error + self.ki * state.integral + self.kd * derivative.value[0]  # (2)
        by_axes, proposal = self.axis.propose(state.axis, sample)
        wanted = by_axes + gains * push  # (3)
        command = clip(wanted, self.axis.command_limit)
        outwards = (wanted - command) @ gains * (self.ki * error) > 0.0
        return command, VariableGainCrossCoupledState(
            axis=self.axis.settle(proposal, wanted, command),
            estimate=error * unit(gains),
            integral=state.integral + jnp.where(outwards, 0.0, error * self.sample_time),
            derivative=derivative,
            saturated=jnp.any(wanted != command).astype(jnp.int32),
        )

    def telemetry(self, state: VariableGainCrossCoupledState) -> dict[str, Array]:
        """Return the estimate, and what the axis law reports.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return {**self.axis.telemetry(state.axis), "contour_error_estimate": state.estimate}

    def status(self, state: VariableGainCrossCoupledState) -> Count:
        """Return 1 if an axis was at its limit, else 0.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.saturated
