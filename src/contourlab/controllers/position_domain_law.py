"""What laws in the position domain share: one master axis, the others sent where the master is.

An axis law (``axis``) runs the master in time, as it would run it alone, and the slaves until they
are engaged. The law's own share is what the slaves do.

**Redundant axes.** A path of more axes than the tool has coordinates is taken in the space of the
axes (:func:`contourlab.contours.combined`): every axis has a place for every parameter, so that
nothing has to be shared out.

**The master's amplitude** (Remark 4.1). Slaves can go wherever the master is, but not where it does
not get: a loop T1 with |T1| ≠ 1 swings a rotational master between ends that are not those of the
path, and the contour error there is the master's. With ``compensate_master`` its reference is that
whose answer is the path's swing, at the frequency ω of the parameter's rate,

    r' = c + Re(1/T1) (r - c) + Im(1/T1) v / ω,       T1 at e^{jωT},                     (R)

with v the reference's velocity: amplitude and phase are both right, in steady rotation exactly. It
acts where the master's coordinate is a cosine of the contour parameter and the axis law is
:class:`AxisPid`, whose T1 is known; elsewhere the reference is left as it is. A monotone master is
late, not short: the slaves wait for it.

References
----------
.. [CaoZhang] section 2.2, Remarks 2.1 and 4.1.
"""

from __future__ import annotations

import dataclasses
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.contours.base import Contour
from contourlab.contours.combined import CombinedAxes
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    refuse_no_axis_law,
)
from contourlab.controllers.axis_pid import BoundAxisPid
from contourlab.controllers.master import MasterMotion, choose_master, master_motion
from contourlab.controllers.position_domain import PositionDomain
from contourlab.controllers.pulse_model import PulseModel
from contourlab.controllers.smooth_path import refuse_corners
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, Scalar

__all__ = ["MasterCompensation", "bound_domain", "refuse_lone_axis"]

Complex: TypeAlias = tuple[Array, Array]
"""Real and imaginary part: no complex numbers in the loop."""


def refuse_lone_axis(axis: Any) -> None:
    """Raise ConfigurationError unless a law was given an axis law for two axes or more.

    Parameters
    ----------
    axis
        What was given.
    """
    refuse_no_axis_law(axis, "which runs the master, ")
    if axis.n_axes < 2:
        raise ConfigurationError("axis must be for 2 axes or more: a master and its slaves, got 1")


def bound_domain(
    law: str, contour: Contour, axis: AxisController, master: int | None, conversion: str,
    turning_width: Scalar,
) -> PositionDomain:  # fmt: skip
    """Return the position domain of a path, with the master that was asked for or chosen.

    Parameters
    ----------
    law
        Name of the law, for messages.
    contour
        The tool's path.
    axis
        The axis law.
    master
        Which axis, or None for the one recommended.
    conversion, turning_width
        Of the position domain.

    Raises
    ------
    RefusedError
        The path has another number of axes or a corner, or no master; says which axis fails where.
    ConfigurationError
        No such axis.
    """
    n = axis.n_axes
    path = contour.axes if isinstance(contour, CombinedAxes) else contour
    if path.n_axes != n:
        raise RefusedError(
            f"{law} sends every axis to its own place on the path: it commands {n} axes, the path "
            f"has {path.n_axes} coordinates; a path of redundant axes is given in axes, by "
            "contours.combined(path_of_axes, tool_matrix)"
        )
    refuse_corners(law, path)
    names = tuple(f"axis {k}" for k in range(n))
    if master is None:
        master = choose_master(law, path, axis.model, names)
    if not master < n:
        raise ConfigurationError(f"master must be one of the {n} axes, 0 to {n - 1}, got {master}")
    motion = master_motion(law, path, master, names)
    if conversion == "arccos" and motion.rotational and not motion.cosine:
        raise RefusedError(
            f"{law} with conversion 'arccos' needs a master that is a cosine of the contour "
            f"parameter (y = c + R cos(p + phase)), which axis {master} is not on this path; take "
            "conversion 'tracked'"
        )
    return PositionDomain(
        path=path, motion=motion, turning_width=np.asarray(turning_width), conversion=conversion
    )


class MasterCompensation(Configuration):
    """(R) for one axis with a PID; made by :meth:`of`."""

    axis: MasterMotion
    gains: Float[Array, "6"] = real()
    """kp, ki, kd and decay of the derivative, and feed-forward of velocity and acceleration."""
    spring: Float[Array, ""] = real()
    """Feed-forward of position."""
    numerator: Float[Array, " order"] = real()
    denominator: Float[Array, " order"] = real()
    sample_time: Scalar = real(unit="s", above=0.0)
    on_error: Float[Array, ""] = real()
    """1 if the derivative acts on the error, 0 if on the measurement."""

    @staticmethod
    def of(
        axis: BoundAxisController, motion: MasterMotion, model: PulseModel, sample_time: Scalar
    ) -> MasterCompensation | None:
        """Return the compensation, or None where T1 is not known or there is nothing to do.

        Parameters
        ----------
        axis
            The axis law.
        motion
            Of the master.
        model
            Of all axes.
        sample_time
            T [s].
        """
        if not (isinstance(axis, BoundAxisPid) and motion.rotational and motion.cosine):
            return None
        if axis.from_velocity:
            return None
        k, forward = motion.axis, axis.feed_forward
        spring = 0.0 if forward.position is None else forward.position[k]
        return MasterCompensation(
            axis=motion,
            gains=jnp.stack([
                jnp.asarray(x, float)
                for x in (
                    axis.kp[k], axis.ki[k], axis.kd[k],
                    jnp.broadcast_to(axis.derivative.decay, np.shape(axis.kp))[k],
                    forward.velocity[k], forward.acceleration[k],
                )
            ]),
            spring=jnp.asarray(spring, float),
            numerator=model.numerator[k], denominator=model.denominator[k],
            sample_time=sample_time, on_error=np.asarray(float(axis.on_error)),
        )  # fmt: skip

    def inverse(self, omega: Scalar) -> Complex:
        """Return 1/T1 at e^{jωT}, as real and imaginary part.

        Parameters
        ----------
        omega
            ω > 0 [rad/s].
        """
        kp, ki, kd, decay, velocity, acceleration = (self.gains[k] for k in range(6))
        time = self.sample_time
        z = (jnp.cos(omega * time), jnp.sin(omega * time))
        one: Complex = (jnp.ones(()), jnp.zeros(()))
        back = (z[0], -z[1])  # 1/z on the unit circle
        slope = _times(
            _over(_minus(one, back), _minus(one, (decay * back[0], decay * back[1]))),
            ((1.0 - decay) / time, jnp.zeros(())),
        )
        summed = _over((jnp.asarray(time), jnp.zeros(())), _minus(z, one))
        steady = (kp + ki * summed[0], ki * summed[1])
        feedback = (steady[0] + kd * slope[0], steady[1] + kd * slope[1])
        share = self.on_error * kd
        forward = (
            steady[0] + share * slope[0] + self.spring - acceleration * omega**2,
            steady[1] + share * slope[1] + velocity * omega,
        )
        top: Complex = (jnp.zeros(()), jnp.zeros(()))
        bottom: Complex = one
        for k in range(np.shape(self.numerator)[0]):
            top, bottom = _times(top, z), _times(bottom, z)
            top = (top[0] + self.numerator[k], top[1])
            bottom = (bottom[0] + self.denominator[k], bottom[1])
        loop = _times(feedback, top)
        return _over((bottom[0] + loop[0], bottom[1] + loop[1]), _times(forward, top))

    def apply(self, sample: Sample) -> Sample:
        """Return the sample with the master's reference corrected by (R).

        Parameters
        ----------
        sample
            One instant.
        """
        reference, k = sample.reference, self.axis.axis
        rate = reference.parameter_rate
        turning = jnp.abs(rate) > 1e-9
        omega = jnp.where(turning, jnp.abs(rate), 1.0)
        real_part, imaginary = self.inverse(omega)
        real_part = jnp.where(turning, real_part, 1.0)
        imaginary = jnp.where(turning, imaginary / omega, 0.0)
        rows = jnp.stack([
            reference.position[k] - self.axis.centre, reference.velocity[k],
            reference.acceleration[k], reference.jerk[k],
        ])  # fmt: skip
        new = real_part * rows[:3] + imaginary * rows[1:]  # (R) and its time derivatives
        return dataclasses.replace(
            sample,
            reference=dataclasses.replace(
                reference,
                position=_at(reference.position, k, new[0] + self.axis.centre),
                velocity=_at(reference.velocity, k, new[1]),
                acceleration=_at(reference.acceleration, k, new[2]),
            ),
        )


def _at(vector: Array, k: int, value: Array) -> jax.Array:
    return jnp.where(np.arange(np.shape(vector)[0]) == k, value, vector)


def _minus(a: Complex, b: Complex) -> Complex:
    return a[0] - b[0], a[1] - b[1]


def _times(a: Complex, b: Complex) -> Complex:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _over(a: Complex, b: Complex) -> Complex:
    size = b[0] * b[0] + b[1] * b[1]
    return (a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size
