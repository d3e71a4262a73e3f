"""Contouring in the position domain with a time-varying internal model: TV-IMCC.

One axis is the master and runs in time by an axis law; every other axis is a slave and follows
f(s), its place on the path where the master *is*. To a slave that is a reference which no one
planned, and which obeys a recurrence of second order with coefficients found as it comes
(:mod:`~contourlab.controllers.exosystem`). A copy of the slave's axis and a unit that makes what
goes round in it obey that recurrence (:mod:`~contourlab.controllers.immersion`) form an internal
model; a reduced-order observer and a gain (:mod:`~contourlab.controllers.stabiliser`) bring the
slave onto it:

    u = u_im + u_st,      u_st = K1 e + K2 x̂_b,      e = y - f                          (42)
    ẑ(k+1) = (A22 - F A12) ẑ + (B2 - F B1) u_st + ((A22 - F A12) F + A21 - F A11) e,
    x̂_b = ẑ + F e                                                                       (36)

**When it is exact.** For a slave that is its nominal model, e is zero to rounding whatever the
master does and whatever the path is: the coefficients are fitted anew to every sample, so that the
internal model amounts to inverting the axis with one sample of look-ahead. Its zeros must be inside
the unit circle. Nothing in it is robust: the copy is driven by the command, not by the axis, and a
model that is off leaves an error that K alone holds down. A constant push is nearly removed,
because α is near (-2, 1), a double integrator.

**Look-ahead.** u(k) takes f(k+1), which is where the master will be: its position is predicted one
sample ahead by its nominal model and an observer, and the same predictions are used at every
instant, for f and for the coefficients. What is predicted wrongly enters e as if the path had
moved. One point of the reference is previewed, for the contour parameter expected there.

**Disturbances.** With ``disturbance_observer_hz`` an extended state observer on each slave takes
away what acts at its input: a constant, and sinusoids of ``disturbance_frequencies_hz``, whose
generating dynamics are thereby part of the internal model. This is what section 7 announces.

**Order.** Nominal models are of second order; an identified pulse transfer function may be of any,
see :mod:`~contourlab.controllers.immersion` for the filter that brings the exosystem to it.

The error along the path is the master's alone. Contours on which no axis is monotone or rotational
are refused (:mod:`~contourlab.controllers.master`).

References
----------
.. [CaoZhang] (36), (41), (42), Theorem 5.1, Remarks 2.1 and 4.1.

Differences from the paper
--------------------------
(35) has x_o1 and x_b mixed up; A11 = -α1, A12 = [1 0 ...], A21 = (-α2, 0, ...), A22 a shift, and
α(k) in both. See the modules for the rest. Limits of the command: the copy and the observer are
driven by what was applied.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    AxisController,
    BoundAxisController,
    clip,
)
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.controllers.exosystem import SIGNALS, alpha_1, alpha_2
from contourlab.controllers.immersion import InternalUnit
from contourlab.controllers.internal_model_fields import bound_model, bound_stabiliser, check_fields
from contourlab.controllers.internal_model_state import InternalModelState
from contourlab.controllers.position_domain import PositionDomain, PositionDomainState
from contourlab.controllers.position_domain_law import (
    MasterCompensation,
    bound_domain,
    refuse_lone_axis,
)
from contourlab.controllers.pulse_model import AxisObserver, PulseModel
from contourlab.controllers.second_signal import SecondSignal
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Flag, Scalar, Vector

__all__ = ["BoundInternalModelContouring", "InternalModelContouring", "InternalModelState"]


class InternalModelContouring(Controller):
    """Time-varying internal model contouring control; see the module.

    Parameters
    ----------
    axis
        The axis law that runs the master, and the slaves until they are engaged.
    master
        Which axis, counted from 0; by default the slowest of those that can be the master.
    second_signal
        Of the exosystem: ``"best"``, ``"position"`` (the paper's), ``"master"`` or
        ``"derivative"``; see :mod:`~contourlab.controllers.exosystem`.
    offset
        Added to the position, where it is the second signal [m].
    conversion
        ``"tracked"`` or ``"arccos"`` (Algorithm 3.1); see
        :mod:`~contourlab.controllers.position_domain`.
    turning_width
        Share of the master's swing, > 0 and < 1, below which a turning point is near.
    compensate_master
        Whether the master's amplitude and phase are compensated (Remark 4.1).
    master_observer_hz
        Bandwidth of the observer that predicts the master, > 0 [Hz].
    stabiliser_gain
        K, shape (n,) or (n_slaves, n) [command unit per m]; by default found by linear matrix
        inequalities when the law is bound.
    stabiliser_range
        Half-width of the box of α about (-2, 1) for which they hold, > 0.
    stabiliser_decay
        ρ of :mod:`~contourlab.controllers.stabiliser`, > 0 and < 1.
    observer_gain
        F of (36).
    disturbance_observer_hz
        Bandwidth of the slaves' disturbance observers, > 0 [Hz]; none by default.
    disturbance_frequencies_hz
        Frequencies of known disturbances, > 0 [Hz], beside the constant.
    engage_time
        From when the slaves follow the master [s]; until then the axis law runs them.
    numerator, denominator
        Identified pulse transfer functions, shape (n_axes, n): b_1 z^(n-1) + ... + b_n [m per
        command unit] over z^n + a_1 z^(n-1) + ... + a_n, as b and a; by default those of the axis
        law's nominal model.
    identified_at
        Their sample time, > 0 [s].

    Raises
    ------
    ConfigurationError
        A value out of bounds; an axis law that is none or has one axis; identified models without
        all three of their fields.
    """

    axis: AxisController = part()
    master: int | None = static(minimum=0, default=None)
    second_signal: str = static(allowed=SIGNALS, default="best")
    offset: Scalar = real(unit="m", ndim=0, default=0.0)
    conversion: str = static(allowed=("tracked", "arccos"), default="tracked")
    turning_width: Scalar = real(above=0.0, below=1.0, ndim=0, default=0.03)
    compensate_master: bool = static(flag=True, default=True)
    master_observer_hz: Scalar = real(unit="Hz", above=0.0, ndim=0, default=100.0)
    stabiliser_gain: Float[Array, " ..."] | None = real(default=None)
    stabiliser_range: Scalar = real(above=0.0, ndim=0, default=0.01)
    stabiliser_decay: Scalar = real(above=0.0, below=1.0, ndim=0, default=0.6)
    observer_gain: Scalar = real(ndim=0, default=1e-4)
    disturbance_observer_hz: Scalar | None = real(unit="Hz", above=0.0, ndim=0, default=None)
    disturbance_frequencies_hz: Float[Array, " n"] | None = real(unit="Hz", above=0.0, default=None)
    engage_time: Scalar = real(unit="s", minimum=0.0, ndim=0, default=0.0)
    numerator: Float[Array, "n_axes order"] | None = real(default=None)
    denominator: Float[Array, "n_axes order"] | None = real(default=None)
    identified_at: Scalar | None = real(unit="s", above=0.0, ndim=0, default=None)

    def __check_init__(self) -> None:
        refuse_lone_axis(self.axis)
        check_fields(self)

    @property
    def needs(self) -> Needs:
        """One point ahead, the contour itself, and work on the host when the law is bound."""
        axis = self.axis.needs
        return Needs(
            command=axis.command,
            preview=max(1, axis.preview),
            derivatives=axis.derivatives,
            contour=True,
            host_synthesis=True,
            axes_path=True,
        )

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return self.axis.n_axes

    def bind(self, contour: Contour, sample_time: Scalar) -> BoundInternalModelContouring:
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
            No axis can be the master, or the one that was asked for cannot; a corner; a numerator
            with a zero on or outside the unit circle; no certified gain.
        ConfigurationError
            A gain or model of another shape or sample time; no solver for the gains.
        """
        name = type(self).__name__
        domain = bound_domain(
            name, contour, self.axis, self.master, self.conversion, self.turning_width
        )
        master = domain.motion.axis
        slaves = tuple(k for k in range(self.n_axes) if k != master)
        whole = bound_model(self, sample_time)
        model = whole.of_axes(slaves)
        axis = self.axis.bind(contour, sample_time)
        known = np.zeros(0)
        if self.disturbance_observer_hz is not None:
            extra = self.disturbance_frequencies_hz
            known = np.append(0.0, np.zeros(0) if extra is None else extra)
        bandwidth = 1.0 if self.disturbance_observer_hz is None else self.disturbance_observer_hz
        compensation = (
            MasterCompensation.of(axis, domain.motion, whole, sample_time)
            if self.compensate_master
            else None
        )
        return BoundInternalModelContouring(
            axis=axis,
            domain=domain,
            slaves=slaves,
            signal=SecondSignal.along(domain, slaves, self.second_signal, self.offset),
            compensation=compensation,
            master_observer=AxisObserver.of_model(
                whole.of_axes((master,)), np.full(1, self.master_observer_hz),
                np.zeros(1), sample_time,
            ),
            slave_observer=AxisObserver.of_model(
                model, np.full(len(slaves), bandwidth), known, sample_time
            ),
            model=model,
            **bound_stabiliser(self, model),
            observer_gain=self.observer_gain,
            engage_time=self.engage_time,
        )  # fmt: skip


class BoundInternalModelContouring(BoundController):
    """The discretised law; made by :meth:`InternalModelContouring.bind`."""

    axis: BoundAxisController = part()
    domain: PositionDomain = part()
    slaves: tuple[int, ...] = static()
    signal: SecondSignal = part()
    compensation: MasterCompensation | None = part()
    master_observer: AxisObserver = part()
    slave_observer: AxisObserver = part()
    model: PulseModel = part()
    gain: Float[Array, "2 n_slaves order"] = real()
    """K at the lower and the upper end of α1."""
    low: Vector = real()
    high: Vector = real()
    """Ends of α1 between which K is scheduled; the same for a constant K."""
    half_width: Vector = real(finite=False)
    """Of the box for which K is certified; infinite where nothing was asked."""
    certificate: Vector = real(finite=False)
    """Margin of the certificate; NaN is not allowed, 0 stands for none."""
    observer_gain: Scalar = real()
    engage_time: Scalar = real(unit="s")

    statuses = (
        "normal", "saturated", "slaves not engaged yet", "outside the certified coefficients",
        "no recurrence: the exosystem does not turn",
    )  # fmt: skip

    def init(self, sample: Sample) -> InternalModelState:
        """Return the state before the first step: axes at rest where they were measured.

        Parameters
        ----------
        sample
            The first sample.
        """
        own, master = np.asarray(self.slaves, int), self.domain.motion.axis
        domain = self.domain.init(sample.reference.parameter)
        f, g = self._signals(domain)
        copy, command = self.model.rest(sample.position[own])
        zero = jnp.zeros(len(self.slaves))
        memory = jnp.zeros((len(self.slaves), self.model.order - 1))
        return InternalModelState(
            axis=self.axis.init(self._compensated(sample)),
            domain=domain,
            master=self.master_observer.init(sample.position[master : master + 1]),
            disturbed=self.slave_observer.init(sample.position[own]),
            reference=jnp.stack([f, f]),
            second=jnp.stack([g, g]),
            alpha=zero - 2.0,
            copy=copy,
            unit=InternalUnit(memory),
            observed=memory,
            error=zero,
            applied=command,
            by_model=command,
            by_gain=zero,
            last_step=jnp.stack([zero - 2.0, zero, zero]),
            samples=jnp.zeros((), jnp.int32),
            status=jnp.zeros((), jnp.int32),
        )

    def step(
        self, state: InternalModelState, sample: Sample
    ) -> tuple[AxisVector, InternalModelState]:
        """Return the command, shape (n_axes,), and the new state.

        Parameters
        ----------
        state
            As ``init`` or the last ``step`` returned it.
        sample
            This instant.
        """
        own, master = np.asarray(self.slaves, int), self.domain.motion.axis
        model, order = self.model, self.model.order
        limit = jnp.broadcast_to(jnp.asarray(self.axis.command_limit), np.shape(sample.position))

        # the master, and where it will be
        by_axes, proposal = self.axis.propose(state.axis, self._compensated(sample))
        first = clip(by_axes, limit)[master]
        predicted = self.master_observer.step(
            state.master, sample.position[master : master + 1], first[None]
        )
        domain = self.domain.step(state.domain, predicted.axes[0, 0], sample.preview.parameter[0])

        # the exosystem: samples k-1, k, k+1
        f_next, g_next = self._signals(domain)
        f = jnp.concatenate([state.reference, f_next[None]])
        g = jnp.concatenate([state.second, g_next[None]])
        alpha, well = alpha_1(f, g)
        before = jnp.stack([state.alpha, alpha_2(f, g)], -1)  # α(k-1)
        before = jnp.concatenate([before, jnp.zeros((len(own), order - 2))], -1)

        # what waited for α2(k-1): the internal model and the observer at k
        copy = model.advance(state.copy, state.applied)  # (26)
        u_r = copy[:, 0]
        unit = state.unit.advance(
            model, before - model.denominator, state.copy[:, 0], state.by_model
        )
        observed = self._observe(state, before)
        error = sample.position[own] - f[1]

        by_model = unit.output(model, alpha - model.denominator[:, 0], u_r)
        hidden = jnp.asarray(observed).at[:, 0].add(self.observer_gain * error)  # x̂_b of (36)
        by_gain = self._gain(alpha, error, hidden)
        push = self.slave_observer.disturbance(state.disturbed)
        engaged = (sample.time >= self.engage_time - 1e-12) & (state.samples >= order)
        slaves = jnp.where(engaged, by_model + by_gain - push, by_axes[own])  # (42)
        wanted = jnp.asarray(by_axes).at[own].set(slaves)
        command = clip(wanted, limit)
        applied = command[own] + push
        ahead = self._anticipated(f)
        return command, InternalModelState(
            axis=self.axis.settle(proposal, wanted, command),
            domain=domain,
            master=predicted,
            disturbed=self.slave_observer.step(state.disturbed, sample.position[own], command[own]),
            reference=f[1:],
            second=g[1:],
            alpha=alpha,
            copy=copy,
            unit=unit,
            observed=observed,
            error=error,
            applied=applied,
            by_model=jnp.where(engaged, by_model, ahead),
            by_gain=jnp.where(engaged, applied - by_model, 0.0),
            last_step=jnp.stack([alpha, error, well]),
            samples=state.samples + 1,
            status=self._status(wanted, command, engaged, alpha, before[:, 1], well),
        )

    def telemetry(self, state: InternalModelState) -> dict[str, Array]:
        """Return the place on the path, errors in the position domain, and α1.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return {
            "position_parameter": jnp.asarray(state.domain.parameter),
            "position_domain_error": state.error,
            "exosystem_alpha_1": state.alpha,
            "disturbance_estimate": self.slave_observer.disturbance(state.disturbed),
        }

    def status(self, state: InternalModelState) -> Count:
        """Return the index into ``statuses`` of the last step.

        Parameters
        ----------
        state
            As ``step`` returned it.
        """
        return state.status

    def _compensated(self, sample: Sample) -> Sample:
        return sample if self.compensation is None else self.compensation.apply(sample)

    def _signals(self, domain: PositionDomainState) -> tuple[Vector, Vector]:
        """Return f and g of the slaves at a place on the path."""
        target, slope = self.domain.follow(domain)
        g = self.signal.value(self.domain, domain.parameter, target, slope, self.slaves)
        return target[np.asarray(self.slaves, int)], g

    def _observe(self, state: InternalModelState, alpha: Array) -> Array:
        """Return ẑ at k from what was known at k-1 (36)."""
        b, gain = self.model.numerator, self.observer_gain
        lead = state.observed[:, 0] + gain * state.error  # first of x̂_b
        shifted = jnp.concatenate([state.observed[:, 1:], jnp.zeros_like(b[:, :1])], -1)
        # A22 x̂_b + A21 e + B2 u_st, less F times what is predicted of e
        ahead: jax.Array = (
            shifted - alpha[:, 1:] * state.error[:, None] + b[:, 1:] * state.by_gain[:, None]
        )
        next_error = lead - alpha[:, 0] * state.error + b[:, 0] * state.by_gain
        return ahead.at[:, 0].add(-gain * next_error)

    def _gain(self, alpha: Vector, error: Vector, hidden: Array) -> Vector:
        """Return u_st, K being scheduled over α1 with convex weights (41)."""
        width = self.high - self.low
        share = (alpha - self.low) / jnp.where(width > 0.0, width, 1.0)
        share = jnp.where(width > 0.0, jnp.clip(share, 0.0, 1.0), 0.0)
        gain = self.gain[0] + share[:, None] * (self.gain[1] - self.gain[0])
        return gain[:, 0] * error + jnp.sum(gain[:, 1:] * hidden, -1)

    def _anticipated(self, f: Array) -> Vector:
        """Return the command that the reference would take, by its last samples, before engaging.

        A(z) f over B(1): with it in its memory the unit starts without a jump.
        """
        model = self.model
        rise, bend = f[2] - f[1], f[2] - 2.0 * f[1] + f[0]
        total = f[2]
        for i in range(1, model.order + 1):
            steps = i - 1.0  # f(k + 1 - i), by the parabola through the last three samples
            back = f[1] - steps * (rise - bend) + 0.5 * steps * (steps - 1.0) * bend
            total = total + model.denominator[:, i - 1] * back
        return total / jnp.sum(model.numerator, -1)

    def _status(
        self, wanted: AxisVector, command: AxisVector, engaged: Flag, alpha_now: Vector,
        alpha_before: Vector, well: Vector,
    ) -> Count:  # fmt: skip
        outside = jnp.any(jnp.abs(alpha_now + 2.0) > self.half_width) | jnp.any(
            jnp.abs(alpha_before - 1.0) > self.half_width
        )
        number = jnp.where(outside, 3, 0)
        number = jnp.where(jnp.any(well < 0.5), 4, number)
        number = jnp.where(engaged, number, 2)
        return jnp.where(jnp.any(wanted != command), 1, number).astype(jnp.int32)
