"""How an axis loop answers at one frequency: what a law makes of reference and position, T1.

A linear axis law gives u = F r - C y at e^{jωT}, its axis y = P u, so that

    y = T1 r,    T1 = P F / (1 + P C).                                                  (1)

:class:`AxisPid` and :class:`Cascade` are both of the form

    C = g + h I + (k + l I) D,    F = g + h I + (k + l I) D_r + S + jω V - ω² A,        (2)

with I = T/(z - 1) the integral, D the filtered difference, (1 - a)/(1 - a/z) (1 - 1/z)/T, and D_r
what of the reference stands against it: D itself, jω behind the same filter where a velocity is
compared with a velocity, or nothing. S, V and A are feed-forward.

A measured velocity is taken for the difference of positions over a sample, which is what encoders
give; one that is measured without that half sample of delay changes T1 by about ω² T / 2 times the
velocity gain over the position gain.

Complex numbers are pairs, so that all of it can stand in a loop that is exported.

References
----------
.. [CaoZhang] Remark 4.1, for which this is needed.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real, static
from contourlab.controllers.axis_controller import BoundAxisController
from contourlab.controllers.axis_pid import BoundAxisPid
from contourlab.controllers.cascade import BoundCascade
from contourlab.controllers.pulse_model import PulseModel
from contourlab.typing import Array, Scalar

__all__ = ["AxisResponse", "Complex"]

Complex: TypeAlias = tuple[Array, Array]
"""Real and imaginary part."""


class AxisResponse(Configuration):
    """T1 of one axis; made by :meth:`of`."""

    gains: Float[Array, "4"] = real()
    """g, h, k, l of (2)."""
    decay: Float[Array, ""] = real()
    """a of (2)."""
    share: Float[Array, ""] = real()
    """Of D_r: 0 where the derivative acts on the measurement alone."""
    feed_forward: Float[Array, "3"] = real()
    """S, V, A of (2)."""
    numerator: Float[Array, " order"] = real()
    """b of the axis."""
    denominator: Float[Array, " order"] = real()
    """a of the axis."""
    sample_time: Scalar = real(unit="s", above=0.0)
    by_velocity: bool = static(flag=True)
    """Whether D_r is jω behind the filter, and not D."""

    @staticmethod
    def of(
        law: BoundAxisController, axis: int, model: PulseModel, sample_time: Scalar
    ) -> AxisResponse | None:
        """Return the response of an axis, None under a law that is not of the form (2).

        Parameters
        ----------
        law
            The axis law.
        axis
            Which axis.
        model
            Of all axes.
        sample_time
            T [s].
        """
        if isinstance(law, BoundAxisPid):
            gains = (law.kp[axis], law.ki[axis], law.kd[axis], jnp.zeros(()))
            decay = jnp.broadcast_to(law.derivative.decay, np.shape(law.kp))[axis]
            share, by_velocity = jnp.asarray(float(law.on_error)), law.from_velocity
        elif isinstance(law, BoundCascade):
            outer, p, i = law.position_gain[axis], law.proportional[axis], law.integral[axis]
            inner = 0.0 if law.outer_only else 1.0
            gains = (p * outer, i * outer, inner * p, inner * i)
            decay, share = jnp.zeros(()), jnp.asarray(law.velocity_share[axis])
            by_velocity = True
        else:
            return None
        forward = law.feed_forward
        spring = jnp.zeros(()) if forward.position is None else forward.position[axis]
        return AxisResponse(
            gains=_stacked(*gains), decay=decay, share=share,
            feed_forward=_stacked(spring, forward.velocity[axis], forward.acceleration[axis]),
            numerator=model.numerator[axis], denominator=model.denominator[axis],
            sample_time=sample_time, by_velocity=by_velocity,
        )  # fmt: skip

    def inverse(self, omega: Scalar) -> Complex:
        """Return 1/T1 at e^{jωT}.

        Parameters
        ----------
        omega
            ω > 0 [rad/s].
        """
        proportional, integral, derivative, double = (self.gains[k] for k in range(4))
        spring, velocity, acceleration = (self.feed_forward[k] for k in range(3))
        time = self.sample_time
        z: Complex = (jnp.cos(omega * time), jnp.sin(omega * time))
        one: Complex = (jnp.ones(()), jnp.zeros(()))
        back = (z[0], -z[1])  # 1/z on the unit circle
        summed = _over((jnp.asarray(time), jnp.zeros(())), _minus(z, one))
        smooth = _over(
            (1.0 - self.decay, jnp.zeros(())),
            _minus(one, (self.decay * back[0], self.decay * back[1])),
        )
        difference = _minus(one, back)
        slope = _times(smooth, (difference[0] / time, difference[1] / time))
        exact = _times(smooth, (jnp.zeros(()), jnp.asarray(omega)))
        wanted = exact if self.by_velocity else slope
        steady = (proportional + integral * summed[0], integral * summed[1])
        rate = (derivative + double * summed[0], double * summed[1])
        on_position = _times(rate, slope)
        on_reference = _times(rate, wanted)
        feedback = (steady[0] + on_position[0], steady[1] + on_position[1])  # C of (2)
        forward = (  # F of (2)
            steady[0] + self.share * on_reference[0] + spring - acceleration * omega**2,
            steady[1] + self.share * on_reference[1] + velocity * omega,
        )
        top: Complex = (jnp.zeros(()), jnp.zeros(()))
        bottom: Complex = one
        for k in range(np.shape(self.numerator)[0]):
            top, bottom = _times(top, z), _times(bottom, z)
            top = (top[0] + self.numerator[k], top[1])
            bottom = (bottom[0] + self.denominator[k], bottom[1])
        loop = _times(feedback, top)
        return _over((bottom[0] + loop[0], bottom[1] + loop[1]), _times(forward, top))  # 1 / (1)


def _stacked(*values: Any) -> Array:
    return jnp.stack([jnp.asarray(value, float) for value in values])


def _minus(a: Complex, b: Complex) -> Complex:
    return a[0] - b[0], a[1] - b[1]


def _times(a: Complex, b: Complex) -> Complex:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _over(a: Complex, b: Complex) -> Complex:
    size = b[0] * b[0] + b[1] * b[1]
    return (a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size
