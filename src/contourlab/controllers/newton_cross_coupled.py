"""Cross-coupling by the unity contour error vector: Ghaffari and Ulsoy's law, with its guard.

    ε = E / (|E| + δ)                                             (15), guarded
    u = axis law + kp ε + ki ∫ε dt + kd dε/dt,    one PID per axis

with E the estimated contour error vector, from the actual point to the contour. ε says in which
direction the contour lies, and beyond a few δ no longer how far: besides its integral an axis gets
at most kp + 2 N kd (N = 2π times the cut-off) whatever the error, so that the same gains go with
every contour and a large error makes no large command. Near the contour the law is linear, with the
gain kp / δ: as accurate as a plain coupling of that gain and no more. What it has besides is that
the push is bounded.

The guard δ is a *design parameter*; the paper prints (15) without one, and at E = 0 it divides zero
by zero. Without it the law is a relay, which sampled never comes to rest. What δ trades:

* An error that stays. Under a disturbance that the integral cannot follow the error settles where
  the law has the authority: of the order of δ D / kp while D < kp.
* Chatter. The loop of kp / δ needs the bandwidth ω = sqrt(K kp / (M δ)) on a mass M. Held commands
  are late by half a sample, plus the delay of drive and sensors; where that takes what damping
  the loop has, it swings in a limit cycle. :func:`contourlab.simulation.chattering` measures it.
* Noise. E is known to the resolution of the sensors: δ below that makes quantisation a relay.

The integral of ε can change by no more than ki volts per second, whatever the error is: that is
the law's authority against errors that grow. While |E| >> δ it runs on at that rate and has to run
back.

Where the estimate has a part along the path, which the paper's dynamic estimate has in full while
it lags behind the foot, ε points along the path and the coupling drives the axes forward. Use an
estimator that is exact across the path: the default, Newton's method iterated to convergence within
every sample, has no lag to fit.

Form, anti-windup and filter are those of :class:`CrossCoupled`; the paper's is ``"vector"``, an
integral for each coordinate, which is the default here. On paths that turn by much within the time
kp / ki ``"normal"`` removes what ``"vector"`` answers late.

References
----------
.. [GhaffariUlsoy] section II; (15) and figure 5.

Differences from the paper
--------------------------
The guard. The estimator is chosen freely. Sampled, with the integral held at the command limit.
"""

from __future__ import annotations

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contour_errors.base import Estimator
from contourlab.contour_errors.newton import NewtonEstimator
from contourlab.contours.base import Contour
from contourlab.controllers.cross_coupled import BoundCrossCoupled, CrossCoupled
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["BoundNewtonCrossCoupled", "NewtonCrossCoupled", "unity_error"]


class NewtonCrossCoupled(CrossCoupled):
    """One PID per axis on the unity contour error vector, added to an axis law; see the module.

    Parameters
    ----------
    axis
        The axis law, such as :class:`IntegralSlidingMode`; its model gives the limits.
    guard
        δ, > 0 [m]: contour error at which the unity vector has half its length.
    estimator
        Where the contour error comes from; Newton's method, converged, by default.
    kp
        Proportional gain, >= 0 [command unit], one number or one per axis; likewise the rest.
    ki
        Integral gain, >= 0 [command unit per s].
    kd
        Derivative gain, >= 0 [command unit s].
    derivative_cutoff_hz
        Cut-off frequency of the derivative's filter, > 0 [Hz]; infinite for no filter. One number.
    form
        ``"vector"``: integral and derivative of each coordinate, as in the paper; ``"normal"``:
        across the path, riding along with it.
    engage_time
        From when the coupling acts, >= 0 [s].

    Raises
    ------
    ConfigurationError
        A gain that is negative or not finite, a guard that is not > 0; an axis law or estimator
        that is none.
    """

    guard: Scalar = real(unit="m", above=0.0, ndim=0)
    estimator: Estimator = part(default=NewtonEstimator())
    kp: Float[Array, " ..."] = real(unit="command unit", minimum=0.0)
    ki: Float[Array, " ..."] = real(unit="command unit per s", minimum=0.0, default=0.0)
    kd: Float[Array, " ..."] = real(unit="command unit s", minimum=0.0, default=0.0)
    derivative_cutoff_hz: Float[Array, " ..."] = real(
        unit="Hz", above=0.0, finite=False, default=np.inf
    )
    form: str = static(allowed=("normal", "vector"), default="vector")

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundNewtonCrossCoupled:
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
        return BoundNewtonCrossCoupled(guard=self.guard, **self.bound_parts(contour, sample_time))


class BoundNewtonCrossCoupled(BoundCrossCoupled):
    """The discretised law; made by :meth:`NewtonCrossCoupled.bind`."""

    # of the unity vector, which has no unit
    state_units: ClassVar[dict[str, str]] = {
        "integral": "s", "derivative.signal": "1", "derivative.value": "1/s"
    }  # fmt: skip

    guard: Scalar = real(unit="m", above=0.0)

    def _controlled(self, estimate: AxisVector, tangent: AxisVector) -> AxisVector:
        """Return the unity contour error vector, of what the form controls."""
        return unity_error(super()._controlled(estimate, tangent), self.guard)


def unity_error(error: AxisVector, guard: Scalar) -> AxisVector:
    """Return a contour error vector over its length plus a guard, (15); 0 where the error is 0.

    Parameters
    ----------
    error
        From the actual point to the contour, shape (n_axes,) [m].
    guard
        δ > 0 [m].
    """
    squared = error @ error
    # the root has no derivative at 0, where its factor vanishes
    length = jnp.where(squared > 0.0, jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0)), 0.0)
    return error / (length + guard)
