"""What laws in the local task frame have in common: PD on errors along and across the path.

The measured position is written in the frame R = [T N B] at the reference point
(:mod:`~contourlab.controllers.frames.reference_frame`),

    f = Rᵀ (w - w_d) = (t, n, b),     f' = Rᵀ (w' - w_d') - W f                         (1)

t > 0 where the machine is ahead. A law says which acceleration f'' it wants there; the nominal
model makes it a command (feedback linearisation):

    acc = R [(W W + W') f + 2 W f' + f''] + w_d''                                       (2)
    u   = (M acc + B w' + S w + F_c sign(w')) / K                                       (3)

(2) is ``R'' f + 2 R' f' + R f'' + w_d''``, and (2) with (3) is the paper's (25), whose matrices
M_F, C_F, K_F are this multiplied out. The command is clipped at the model's limit; there is no
integral, hence nothing to wind up and nothing that removes a constant error: what the model does
not know (friction, a wrong B, gravity) leaves an error F / (M (2π f)²) in every direction.

**Holding.** The command is held over one sample time T, so that (3) asks for acc at the start of
the interval and gets less: behind a viscous drag the law is late by T/2. With ``hold_compensation``
(the default) the command is the one that changes the velocity of the nominal axis by T acc over the
interval, exactly (Coulomb friction apart), and w_d'' is that of the middle of the interval:

    M → M z / (1 - e^-z), z = T B / M;    w_d'' → w_d'' + T w_d''' / 2.                 (4)

**Coulomb friction** is compensated along the reference velocity by default, which neither lags nor
chatters; ``friction_from="measured"`` takes the measured one, as (3) says, and chatters about rest
within ``friction_velocity``.

**Where it is defined.** On contours of two or three axes, one axis per coordinate, whose tangent
does not jump: corners of paths and splines are refused. Where only the curvature jumps (a line into
an arc) the frame goes on without a jump, and the command steps with the reference's acceleration
and, in the natural local law, by the curvature's share of the estimate; in space the normal may
jump there too, and the frame then turns to it smoothly. A contour that stands still (r' = 0, a
cusp) has no frame at that point; the command is then the feed-forward alone.
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
    SHARED_AXES,
    clip,
    per_axis,
    refuse_no_model,
    refuse_position_command,
    refuse_unlike_axes,
)
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.frames import FrameMotion, ReferenceFrame
from contourlab.controllers.smooth_path import refuse_corners
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["BoundTaskFrameController", "TaskFrameController", "TaskFrameState"]

RETURN_SHARE = 0.25
"""How fast a carried frame goes back, as a share of the slowest normal bandwidth [rad/s]."""


class TaskFrameState(NamedTuple):
    """What a law in the task frame remembers."""

    frame: Any
    """State of the frame: nothing in the plane."""
    error: AxisVector
    """The last (z_1, z_2, z_3): along the path and, estimated, across it [m]."""
    estimate: AxisVector
    """The last estimated contour error vector, in axes [m]."""
    status: Count
    """0 normal, 1 saturated, 2 frame carried on; int32."""


class TaskFrameController(Controller):
    """PD with feedback linearisation in the local task frame; see the module."""

    model: NominalModel = part()
    bandwidth_hz: Float[Array, " ..."] = real(unit="Hz", above=0.0)
    damping: Float[Array, " ..."] = real(above=0.0, default=1.0)
    friction_compensation: Float[Array, " ..."] = real(minimum=0.0, maximum=1.0, default=1.0)
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", above=0.0, default=1e-3)
    friction_from: str = static(allowed=("reference", "measured"), default="reference")
    hold_compensation: bool = static(flag=True, default=True)

    def __check_init__(self) -> None:
        refuse_no_model(self.model)

    def check(self) -> None:
        """Check the number of axes and of bandwidths, and that the model takes no positions."""
        n = self.model.n_axes
        refuse_position_command(type(self).__name__, self.model)
        if n not in (2, 3):
            raise RefusedError(
                f"{type(self).__name__} is for machines of 2 or 3 axes, the model has {n}: it "
                "corrects along the tangent and the normals of the path, and does not say how axes "
                f"that share a coordinate would share a correction; {SHARED_AXES}"
            )
        if np.shape(self.bandwidth_hz)[-1:] not in ((2,), (n,)):
            three = " or (tangential, normal, binormal)" if n == 3 else ""
            raise ConfigurationError(
                f"bandwidth_hz must be (tangential, normal){three}, got shape "
                f"{np.shape(self.bandwidth_hz)}"
            )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.model.n_axes

    @property
    def derivatives(self) -> int:
        """Order of the contour's derivatives that the law needs."""
        return self.n_axes + 1

    @property
    def needs(self) -> Needs:
        """The model's kind of command, and derivatives of the contour."""
        return Needs(command=self.model.command, derivatives=self.derivatives)

    @abc.abstractmethod
    def bind(self, contour: Contour, sample_time: Scalar) -> BoundTaskFrameController:
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
            The contour has a corner, or not one coordinate per axis.
        ConfigurationError
            A damping or friction setting of the wrong number.
        """

    def bound_fields(self, contour: Contour, sample_time: Scalar) -> dict[str, Any]:
        """Return the fields of the bound law that all laws have.

        Parameters
        ----------
        contour, sample_time
            As for ``bind``.
        """
        n, model = self.n_axes, self.model
        refuse_unlike_axes(type(self).__name__, n, contour)
        refuse_corners(type(self).__name__, contour)
        bandwidth = jnp.asarray(self.bandwidth_hz)
        if np.shape(bandwidth) == (2,) and n == 3:
            bandwidth = jnp.concatenate([bandwidth, bandwidth[1:]])
        omega = 2.0 * np.pi * bandwidth
        if np.shape(self.damping) not in ((), (1,), (n,)):
            raise ConfigurationError(
                f"damping must be one number or one for each of the {n} directions, "
                f"got shape {np.shape(self.damping)}"
            )
        slowest = jnp.min(omega[1:])
        mass = model.mass
        if self.hold_compensation:  # (4)
            mass = mass * _held(sample_time * model.viscous / mass)
        coulomb = per_axis("friction_compensation", self.friction_compensation, n) * model.coulomb
        return {
            "command_limit": model.command_limit,
            "stiffness_gain": omega**2,
            "damping_gain": 2.0 * self.damping * omega,
            "mass": mass / model.gain,
            "viscous": model.viscous / model.gain,
            "stiffness": None if model.stiffness is None else model.stiffness / model.gain,
            "friction": coulomb / model.gain,
            "friction_velocity": per_axis("friction_velocity", self.friction_velocity, n),
            "lead": 0.5 * sample_time if self.hold_compensation else 0.0,
            "frame": ReferenceFrame(
                n_axes=n,
                sample_time=sample_time,
                twist_limit=slowest,
                return_rate=RETURN_SHARE * slowest,
            ),
            "friction_from": self.friction_from,
        }


class BoundTaskFrameController(BoundController):
    """A law in the task frame, discretised."""

    command_limit: Float[Array, " ..."] = real(unit="command unit", above=0.0, finite=False)
    """Largest command, per axis; may be infinite."""
    stiffness_gain: Float[Array, " ..."] = real(unit="1/s^2", ndim=1)
    """(2π f)², per direction."""
    damping_gain: Float[Array, " ..."] = real(unit="1/s", ndim=1)
    """4π ζ f, per direction."""
    mass: Float[Array, " ..."] = real(unit="command unit per m/s^2", ndim=1)
    """Command per acceleration, per axis."""
    viscous: Float[Array, " ..."] = real(unit="command unit per m/s", ndim=1)
    """Command per velocity."""
    stiffness: Float[Array, " ..."] | None = real(unit="command unit per m", ndim=1, default=None)
    """Command per position."""
    friction: Float[Array, " ..."] = real(unit="command unit", ndim=1)
    """Command against Coulomb friction."""
    friction_velocity: Float[Array, " ..."] = real(unit="m/s", ndim=1)
    lead: Scalar = real(unit="s")
    """By which feed-forward is ahead."""
    frame: ReferenceFrame = part()
    friction_from: str = static()

    statuses = ("normal", "saturated", "frame carried on, the normal turns too fast")

    def init(self, sample: Sample) -> TaskFrameState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        zero = jnp.zeros_like(sample.position)
        return TaskFrameState(self.frame.init(sample), zero, zero, jnp.zeros((), jnp.int32))

    def step(self, state: TaskFrameState, sample: Sample) -> tuple[AxisVector, TaskFrameState]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        motion, frame = self.frame.step(state.frame, sample)
        reference, w = sample.reference, motion.turning
        f = motion.from_axes(sample.position - reference.position)
        f_1 = motion.from_axes(sample.velocity - reference.velocity) - w @ f  # (1)
        error, f_2 = self.acceleration(motion, f, f_1)
        planned = reference.acceleration + self.lead * reference.jerk  # (4)
        acceleration = motion.to_axes(
            w @ (w @ f) + motion.turning_rate @ f + 2.0 * (w @ f_1) + f_2
        )  # (2)
        wanted = self._command(sample, acceleration + planned)
        command = clip(wanted, self.command_limit)
        across = jnp.concatenate([jnp.zeros(1), error[1:]])
        held = 2 * self.frame.held(frame)
        status = jnp.where(jnp.any(wanted != command), 1, held).astype(jnp.int32)
        return command, TaskFrameState(frame, error, -motion.to_axes(across), status)

    @abc.abstractmethod
    def acceleration(
        self, motion: FrameMotion, error: AxisVector, rate: AxisVector
    ) -> tuple[AxisVector, AxisVector]:
        """Return (z_1, z_2, z_3) and the acceleration f'' that the law wants.

        Parameters
        ----------
        motion
            The frame and how it moves.
        error, rate
            f and f', shape (n_axes,).
        """

    def _command(self, sample: Sample, acceleration: AxisVector) -> AxisVector:
        """Return (3)."""
        along = sample.reference.velocity
        if self.friction_from == "measured":
            along = sample.velocity
        command = (
            self.mass * acceleration
            + self.viscous * sample.velocity
            + self.friction * jnp.tanh(along / self.friction_velocity)
        )
        if self.stiffness is None:
            return command
        middle = sample.position + self.lead * sample.velocity
        return command + self.stiffness * middle

    def telemetry(self, state: TaskFrameState) -> dict[str, Array]:
        """Return the estimated contour error vector, and the errors in the frame.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return {"contour_error_estimate": state.estimate, "task_error": state.error}

    def status(self, state: TaskFrameState) -> Count:
        """Return 1 if an axis was at its limit, 2 if the frame was carried on, else 0.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.status


def _held(z: Array) -> Array:
    """Return z / (1 - e^-z), 1 + z/2 at the start."""
    small = jnp.asarray(z) < 1e-4
    safe = jnp.where(small, 1.0, z)
    return jnp.where(small, 1.0 + z / 2.0 + z**2 / 12.0, safe / -jnp.expm1(-safe))
