"""The discretised law of internal-model contouring: what happens in a sample.

See :mod:`~contourlab.controllers.internal_model_contouring` for what it is. The order of a step is
that of what is known: the master's command first, from which its place at the next sample is
predicted; with that one point of look-ahead f, g and α1 of this sample and α2 of the last; then
what waited for α2, the internal model and the observer at this sample; then the slaves' command.

References
----------
.. [CaoZhang] (26), (36), (41), (42).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.controllers.axis_controller import BoundAxisController, clip
from contourlab.controllers.base import BoundController
from contourlab.controllers.exosystem import SIGNALS, alpha_1, alpha_2
from contourlab.controllers.immersion import InternalUnit
from contourlab.controllers.internal_model_state import InternalModelState
from contourlab.controllers.master_compensation import MasterCompensation
from contourlab.controllers.position_domain import PositionDomain, PositionDomainState
from contourlab.controllers.position_domain_law import master_fact
from contourlab.controllers.pulse_model import AxisObserver, PulseModel
from contourlab.controllers.second_signal import SecondSignal
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, AxisVector, Count, Flag, Scalar, Vector

__all__ = ["BoundInternalModelContouring"]


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
    half_width: Vector = real(minimum=0.0)
    """Of the box of α about (-2, 1) for which K is certified."""
    certificate: Vector = real()
    """Margin of the certificate, relative; 0 where there is none."""
    radius: Vector = real(minimum=0.0)
    """Largest spectral radius of the loop at the corners of the box that was asked for."""
    observer_gain: Scalar = real()
    engage_time: Scalar = real(unit="s")
    master_asked: bool = static(flag=True)
    gain_given: bool = static(flag=True)
    rejects: bool = static(flag=True)
    """Whether what the master's observer finds to disturb it is taken away."""
    remarks: tuple[str, ...] = static(default=())
    observer_fact: str = static(default="")

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
        if self.rejects:
            push = self.master_observer.disturbance(state.master)
            by_axes = jnp.asarray(by_axes).at[master].add(-push[0])
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

    def facts(self) -> dict[str, str]:
        """Return master, second signal, certificate of the stabiliser and observers, in words."""
        taken = np.argmax(np.asarray(self.signal.choice), 0)
        signals = ", ".join(
            f"axis {k} {SIGNALS[1 + i]}" for k, i in zip(self.slaves, taken, strict=True)
        )
        rows = zip(self.slaves, *(
            np.asarray(x) for x in (self.half_width, self.certificate, self.radius)
        ), strict=True)  # fmt: skip
        origin = "gain as given" if self.gain_given else "gain by linear matrix inequalities"
        certificates = "; ".join(
            f"axis {k} certified for alpha within {width:.4g} of (-2, 1), margin {margin:.3g}, "
            f"spectral radius {radius:.4g}"
            for k, width, margin, radius in rows
        )
        return {
            "master": master_fact(self.domain, asked=self.master_asked),
            "second_signal": signals,
            "stabiliser": f"{origin}; {certificates}",
            **({"disturbance_observer": self.observer_fact} if self.observer_fact else {}),
        }

    def warnings(self) -> tuple[str, ...]:
        """Return what could not be done when the law was bound, in sentences."""
        return self.remarks

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
