"""A PID in the position domain: slaves that follow the master's position, not time.

    u = kp e + ki ∫ e ds + kd de/ds,      e = f(s) - y,                                  (P)

with s the way of the master: its position where it only rises or only falls, S p where it swings,
p being its place on the path and S its steepest slope, so that this is R θ on a circle
(:mod:`~contourlab.controllers.position_domain`). In discrete form the integral grows by e Δs and
the derivative is Δe/Δs, Δs being the master's way since the last sample. At a speed v of the master
this is a PID in time with the gains ki v and kd/v: it grows slack where the master is slow, and
where the master stands neither is defined. |Δs| is taken for no less than ``least_speed`` times the
sample time.

The contour error is the slaves' error alone, whatever the master does; what a PID leaves of it is
what a PID leaves of any reference: a lag. The law is the one that internal-model contouring
extends.

References
----------
.. [Ouyang2012] the law; the paper was not at hand, equation numbers not checked.
.. [CaoZhang] sections 1 and 2.2, and the position domain for masters that swing.

Differences from the paper
--------------------------
Masters that swing; the least speed; the integral is held while it would push further into a limit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    clip,
    held_integral,
)
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.master_compensation import MasterCompensation, bound_compensation
from contourlab.controllers.position_domain import PositionDomain, PositionDomainState
from contourlab.controllers.position_domain_law import (
    bound_domain,
    check_conversion,
    master_fact,
    refuse_lone_axis,
)
from contourlab.controllers.pulse_model import PulseModel
from contourlab.errors import ConfigurationError
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Scalar, Vector

__all__ = ["BoundPositionDomainPid", "PositionDomainPid", "PositionDomainPidState"]


class PositionDomainPidState(NamedTuple):
    """What the law remembers; one value per slave."""

    axis: Any
    """State of the axis law."""
    domain: PositionDomainState
    """Where the master is."""
    error: Vector
    """e at the last instant [m]."""
    integral: Vector
    """∫ e ds [m²]."""
    saturated: Count
    """1 if the last command was beyond a limit, int32."""


class PositionDomainPid(Controller):
    """PID over the master's way; see the module.

    Parameters
    ----------
    axis
        The axis law that runs the master.
    kp
        Proportional gain, >= 0 [command unit per m], one number or one per slave; likewise the
        next two.
    ki
        Integral gain, >= 0 [command unit per m²].
    kd
        Derivative gain, >= 0 [command unit, for an error that grows as fast as the way].
    master
        Which axis, counted from 0; by default the slowest of those that can be the master.
    least_speed
        Of the master, > 0 [m/s].
    conversion
        ``"tracked"`` or ``"arccos"``; see :mod:`~contourlab.controllers.position_domain`.
    turning_width
        Share of the master's steepest slope, > 0 and < 1, below which its position says little of
        the place; 0.03 by default. Of ``"tracked"`` only.
    compensate_master
        Whether the master's amplitude and phase are compensated: by default where that can be done,
        and the recording says where it cannot; True refuses there.

    Raises
    ------
    ConfigurationError
        A value out of bounds; an axis law that is none or has one axis.
    """

    axis: AxisController = part()
    kp: Float[Array, " ..."] = real(unit="command unit per m", minimum=0.0)
    ki: Float[Array, " ..."] = real(unit="command unit per m^2", minimum=0.0, default=0.0)
    kd: Float[Array, " ..."] = real(unit="command unit", minimum=0.0, default=0.0)
    master: int | None = static(minimum=0, default=None)
    least_speed: Scalar = real(unit="m/s", above=0.0, ndim=0, default=1e-4)
    conversion: str = static(allowed=("tracked", "arccos"), default="tracked")
    turning_width: Scalar | None = real(above=0.0, below=1.0, ndim=0, default=None)
    compensate_master: bool | None = static(flag=True, default=None)

    def __check_init__(self) -> None:
        refuse_lone_axis(self.axis)
        check_conversion(self.conversion, self.turning_width)

    @property
    def needs(self) -> Needs:
        """What the axis law needs, the contour itself, and a look at it on the host."""
        axis = self.axis.needs
        return Needs(
            command=axis.command, preview=axis.preview, derivatives=axis.derivatives,
            contour=True, host_synthesis=True, axes_path=True,
        )  # fmt: skip

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.axis.n_axes

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundPositionDomainPid:
        """Return the law for one contour and sample time.

        Parameters
        ----------
        contour
            The path that the loop follows; of redundant axes, one made by ``contours.combined``.
        sample_time
            Time between samples [s].

        Raises
        ------
        RefusedError
            No axis can be the master, or the one that was asked for cannot; a corner; a master that
            was to be compensated and cannot be.
        ConfigurationError
            A gain that is neither one number nor one per slave.
        """
        name = type(self).__name__
        domain = bound_domain(
            name, contour, self.axis, self.master, self.conversion,
            self.turning_width,
        )  # fmt: skip
        slaves = tuple(k for k in range(self.n_axes) if k != domain.motion.axis)
        axis = self.axis.bind(contour, sample_time)
        model = PulseModel.of_model(self.axis.model, sample_time)
        gains = {}
        for gain in ("kp", "ki", "kd"):
            value = getattr(self, gain)
            if np.shape(value) not in ((), (1,), (len(slaves),)):
                raise ConfigurationError(
                    f"{gain} must be one number or one for each of the {len(slaves)} slaves, got "
                    f"shape {np.shape(value)}"
                )
            gains[gain] = jnp.broadcast_to(jnp.asarray(value), (len(slaves),))
        compensation, remark = bound_compensation(
            name, self.compensate_master, axis, domain.motion, model, sample_time
        )
        return BoundPositionDomainPid(
            axis=axis, domain=domain, slaves=slaves, **gains, compensation=compensation,
            least_way=self.least_speed * sample_time,
            master_asked=self.master is not None, remarks=(remark,) * bool(remark),
        )  # fmt: skip


class BoundPositionDomainPid(BoundController):
    """The discretised law; made by :meth:`PositionDomainPid.bind`."""

    axis: BoundAxisController = part()
    domain: PositionDomain = part()
    slaves: tuple[int, ...] = static()
    compensation: MasterCompensation | None = part()
    kp: Vector = real()
    ki: Vector = real()
    kd: Vector = real()
    least_way: Scalar = real(unit="m", above=0.0)
    master_asked: bool = static(flag=True)
    remarks: tuple[str, ...] = static(default=())

    statuses = ("normal", "saturated")

    def init(self, sample: Sample) -> PositionDomainPidState:
        """Return the state before the first step.

        Parameters
        ----------
        sample
            The first sample.
        """
        domain = self.domain.init(sample.reference.parameter)
        own = np.asarray(self.slaves, int)
        error = self.domain.follow(domain)[0][own] - sample.position[own]
        return PositionDomainPidState(
            axis=self.axis.init(self._compensated(sample)), domain=domain, error=error,
            integral=jnp.zeros_like(error), saturated=jnp.zeros((), jnp.int32),
        )  # fmt: skip

    def step(
        self, state: PositionDomainPidState, sample: Sample
    ) -> tuple[AxisVector, PositionDomainPidState]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        own, motion = np.asarray(self.slaves, int), self.domain.motion
        domain = self.domain.step(
            state.domain, sample.position[motion.axis], sample.reference.parameter
        )
        target = self.domain.follow(domain)[0]
        error = target[own] - sample.position[own]
        before = self.domain.follow(state.domain)[0][motion.axis]
        way = (
            motion.steepest * (domain.parameter - state.domain.parameter)
            if motion.rotational
            else target[motion.axis] - before
        )
        size = jnp.maximum(jnp.abs(way), self.least_way)
        slope = (error - state.error) / size
        by_axes, proposal = self.axis.propose(state.axis, self._compensated(sample))
        slaves = self.kp * error + self.ki * state.integral + self.kd * slope  # (P)
        wanted = jnp.asarray(by_axes).at[own].set(slaves)
        limit = jnp.broadcast_to(jnp.asarray(self.axis.command_limit), np.shape(wanted))
        command = clip(wanted, limit)
        return command, PositionDomainPidState(
            axis=self.axis.settle(proposal, wanted, command),
            domain=domain,
            error=error,
            integral=held_integral(state.integral, error * jnp.abs(way), wanted[own], command[own]),
            saturated=jnp.any(wanted != command).astype(jnp.int32),
        )

    def facts(self) -> dict[str, str]:
        """Return the master, in words."""
        return {"master": master_fact(self.domain, asked=self.master_asked)}

    def warnings(self) -> tuple[str, ...]:
        """Return what could not be done when the law was bound, in sentences."""
        return self.remarks

    def telemetry(self, state: PositionDomainPidState) -> dict[str, Array]:
        """Return the place on the path and the errors in the position domain.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return {
            "position_parameter": jnp.asarray(state.domain.parameter),
            "position_domain_error": state.error,
        }

    def status(self, state: PositionDomainPidState) -> Count:
        """Return 1 if an axis was at its limit, else 0.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.saturated

    def _compensated(self, sample: Sample) -> Sample:
        return sample if self.compensation is None else self.compensation.apply(sample)
