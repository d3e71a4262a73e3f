"""The master's amplitude and phase, put right in its reference (Remark 4.1).

Slaves can go wherever the master is, but not where it does not get: a loop T1 with |T1| ≠ 1 swings
a rotational master between ends that are not those of the path, and the contour error there is the
master's. Its reference is therefore made that whose answer is the path's swing,

    r' = c + Re(1/T1) (r - c) + Im(1/T1) v / ω,       T1 at e^{jωT},                     (R)

with v the reference's velocity and ω the rate of the master's angle, κ times that of the contour
parameter: amplitude and phase are both right, in steady rotation exactly. κ is 1 on a curve over
its angle and 1/R on a circle of radius R over arc length
(:class:`~contourlab.controllers.master.MasterMotion` finds it).

It takes a master whose coordinate is a cosine of the contour parameter, since only that has one
frequency, and an axis law whose T1 is known, :class:`AxisPid` or :class:`Cascade`. Elsewhere the
reference is left as it is and the recording says so; a law that was told to compensate refuses. A
monotone master is late, not short: the slaves wait for it, and there is nothing to compensate.

References
----------
.. [CaoZhang] Remark 4.1.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import Configuration, part
from contourlab.controllers.axis_controller import BoundAxisController
from contourlab.controllers.axis_response import AxisResponse
from contourlab.controllers.master import MasterMotion
from contourlab.controllers.pulse_model import PulseModel
from contourlab.errors import RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, Scalar

__all__ = ["MasterCompensation", "bound_compensation"]

STANDS = 1e-9
"""Rate of the angle below which the master counts as standing [rad/s]."""


class MasterCompensation(Configuration):
    """(R); made by :func:`bound_compensation`."""

    motion: MasterMotion = part()
    response: AxisResponse = part()

    def apply(self, sample: Sample) -> Sample:
        """Return the sample with the master's reference corrected by (R).

        Parameters
        ----------
        sample
            One instant.
        """
        reference, k = sample.reference, self.motion.axis
        rate = jnp.abs(reference.parameter_rate * self.motion.angle_rate)
        turning = rate > STANDS
        omega = jnp.where(turning, rate, 1.0)
        real_part, imaginary = self.response.inverse(omega)
        real_part = jnp.where(turning, real_part, 1.0)
        imaginary = jnp.where(turning, imaginary / omega, 0.0)
        rows = jnp.stack([
            reference.position[k] - self.motion.centre, reference.velocity[k],
            reference.acceleration[k], reference.jerk[k],
        ])  # fmt: skip
        new = real_part * rows[:3] + imaginary * rows[1:]  # (R) and its time derivatives
        return dataclasses.replace(
            sample,
            reference=dataclasses.replace(
                reference,
                position=_at(reference.position, k, new[0] + self.motion.centre),
                velocity=_at(reference.velocity, k, new[1]),
                acceleration=_at(reference.acceleration, k, new[2]),
            ),
        )


def bound_compensation(
    law: str, asked: bool | None, axis: BoundAxisController, motion: MasterMotion,
    model: PulseModel, sample_time: Scalar,
) -> tuple[MasterCompensation | None, str]:  # fmt: skip
    """Return the compensation, or None and the warning that goes with it ("" if there is none).

    Parameters
    ----------
    law
        Name of the law, for the message.
    asked
        Whether there must be one (True), must not be (False), or may be (None).
    axis
        The axis law.
    motion
        Of the master.
    model
        Of all axes.
    sample_time
        T [s].

    Raises
    ------
    RefusedError
        There must be one and cannot be; says why.
    """
    if asked is False:
        return None, ""
    response = AxisResponse.of(axis, motion.axis, model, sample_time)
    why = ""
    if not motion.rotational:
        why = f"axis {motion.axis} only rises or only falls on this path: it is late, not short"
    elif not motion.cosine:
        why = (
            f"axis {motion.axis} is no cosine of the contour parameter on this path and has no one "
            "frequency at which its loop could be asked"
        )
    elif response is None:
        why = (
            f"the axis law is {type(axis).__name__.removeprefix('Bound')}, and only AxisPid and "
            "Cascade are known to answer linearly"
        )
    if not why:
        assert response is not None
        return MasterCompensation(motion=motion, response=response), ""
    if asked:
        raise RefusedError(
            f"{law} cannot compensate its master (compensate_master): {why}; leave "
            "compensate_master out to go without"
        )
    if not motion.rotational:
        return None, ""
    return None, (
        f"the master's amplitude is not compensated: {why}; by what it swings short or wide, the "
        "contour error at the ends of its swing is its own"
    )


def _at(vector: Array, k: int, value: Array) -> jax.Array:
    return jnp.where(np.arange(np.shape(vector)[0]) == k, value, vector)
