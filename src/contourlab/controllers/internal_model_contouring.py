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
because α is near (-2, 1), a double integrator. That holds on axes with stiffness. On an axis that
integrates, as a linear motor does, the copy runs away from the axis under any push that it is not
told of, dry friction to begin with, until the command is at its limit: there a disturbance
observer is on by default, and the recording warns where ``disturbance_observer_hz = 0`` turns it
off.

**Look-ahead.** u(k) takes f(k+1), which is where the master will be: its position is predicted one
sample ahead by its nominal model and an observer, and the same predictions are used at every
instant, for f and for the coefficients. What is predicted wrongly enters e as if the path had
moved. One point of the reference is previewed, for the contour parameter expected there.

**Disturbances.** With ``disturbance_observer_hz`` the exosystem is augmented by what acts at each
slave's input: a constant, and sinusoids of ``disturbance_frequencies_hz``. Their internal model is
a unit of its own beside that of the reference, an extended state observer
(:mod:`~contourlab.controllers.augmentation`). With the constant alone it is what section 7
announces. The observer that predicts the master has the same dynamics, and what it finds is taken
from the master's command: friction and a wrong gain otherwise keep a rotational master from the
ends of its swing, and one of known frequency is predicted without error.

**Order.** Nominal models are of second order; an identified pulse transfer function may be of any,
see :mod:`~contourlab.controllers.immersion` for the filter that brings the exosystem to it.

The error along the path is the master's alone. Contours on which no axis is monotone or rotational
are refused (:mod:`~contourlab.controllers.master`).

References
----------
.. [CaoZhang] (36), (41), (42), Theorem 5.1, Remarks 2.1 and 4.1.

Differences from the paper
--------------------------
Assumption 2.1 asks for axes that are asymptotically stable, or are made so. An axis that
integrates is taken as it is, with a disturbance observer to hold its copy beside it; on the paper's
axes, which are stable, there is none unless it is asked for.
(35) has x_o1 and x_b mixed up; A11 = -α1, A12 = [1 0 ...], A21 = (-α2, 0, ...), A22 a shift, and
α(k) in both. See the modules for the rest. Limits of the command: the copy and the observer are
driven by what was applied.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from contourlab.configuration import part, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.axis_controller import (
    AxisController,
)
from contourlab.controllers.base import Controller, Needs
from contourlab.controllers.exosystem import SIGNALS
from contourlab.controllers.internal_model_bound import BoundInternalModelContouring
from contourlab.controllers.internal_model_fields import (
    bound_model,
    bound_stabiliser,
    check_fields,
    slave_disturbances,
)
from contourlab.controllers.internal_model_state import InternalModelState
from contourlab.controllers.master_compensation import bound_compensation
from contourlab.controllers.position_domain_law import bound_domain, refuse_lone_axis
from contourlab.controllers.pulse_model import AxisObserver
from contourlab.controllers.second_signal import SecondSignal
from contourlab.typing import Array, Scalar

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
        Added to the position, where it is the second signal [m]; refused where it is not. 0 by
        default.
    conversion
        ``"tracked"`` or ``"arccos"`` (Algorithm 3.1); see
        :mod:`~contourlab.controllers.position_domain`.
    turning_width
        Share of the master's steepest slope, > 0 and < 1, below which its position says little of
        the place; 0.03 by default. Of ``"tracked"`` only.
    compensate_master
        Whether the master's amplitude and phase are compensated (Remark 4.1): by default where that
        can be done, and the recording says where it cannot; True refuses there.
    master_observer_hz
        Bandwidth of the observer that predicts the master, > 0 [Hz].
    stabiliser_gain
        K, shape (n,) or (n_slaves, n) [command unit per m]; by default found by linear matrix
        inequalities when the law is bound.
    stabiliser_range
        Half-width of the box of α about (-2, 1) for which they must hold, > 0; 0.01 by default. Of
        gains that are given: the loop must be stable at its corners, and what is certified is
        watched up to it; without it, as far as it is certified.
    stabiliser_decay
        ρ of :mod:`~contourlab.controllers.stabiliser`, > 0 and < 1: the least gain for it is taken;
        the nearer to 1, the less of the command. By default the gain is in the middle of those for
        0.6, nearly dead-beat. Of gains that are given: bound on the spectral radius at the corners;
        1 by default.
    observer_gain
        F of (36).
    disturbance_observer_hz
        Bandwidth of the slaves' disturbance observers, >= 0 [Hz]; 0 for none. By default that of
        the master's, ``master_observer_hz``, where a slave has no stiffness, and none elsewhere;
        the recording says where it is on without having been given.
    disturbance_frequencies_hz
        Frequencies of known disturbances of any axis, > 0 [Hz], beside the constant.
    reject_on
        Whose disturbances are taken away: ``"all"`` axes', of the master what its own observer
        finds, or the ``"slaves"``', so that the master's is predicted only.
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
    offset: Scalar | None = real(unit="m", ndim=0, default=None)
    conversion: str = static(allowed=("tracked", "arccos"), default="tracked")
    turning_width: Scalar | None = real(above=0.0, below=1.0, ndim=0, default=None)
    compensate_master: bool | None = static(flag=True, default=None)
    master_observer_hz: Scalar = real(unit="Hz", above=0.0, ndim=0, default=100.0)
    stabiliser_gain: Float[Array, " ..."] | None = real(default=None)
    stabiliser_range: Scalar | None = real(above=0.0, ndim=0, default=None)
    stabiliser_decay: Scalar | None = real(above=0.0, below=1.0, ndim=0, default=None)
    observer_gain: Scalar = real(ndim=0, default=1e-4)
    disturbance_observer_hz: Scalar | None = real(unit="Hz", minimum=0.0, ndim=0, default=None)
    disturbance_frequencies_hz: Float[Array, " n"] | None = real(unit="Hz", above=0.0, default=None)
    reject_on: str = static(allowed=("all", "slaves"), default="all")
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
            with a zero on or outside the unit circle; a gain that is not stable, or none that is
            certified; a master that was to be compensated and cannot be.
        ConfigurationError
            A gain or model of another shape or sample time; no solver for the gains; an offset
            that is added to nothing.
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
        observed = slave_disturbances(self, slaves, model)
        known = observed.known
        compensation, remark = bound_compensation(
            name, self.compensate_master, axis, domain.motion, whole, sample_time
        )
        return BoundInternalModelContouring(
            axis=axis,
            domain=domain,
            slaves=slaves,
            signal=SecondSignal.along(domain, slaves, self.second_signal, self.offset),
            compensation=compensation,
            master_observer=AxisObserver.of_model(
                whole.of_axes((master,)), np.full(1, self.master_observer_hz),
                known if len(known) else np.zeros(1), sample_time,
            ),
            slave_observer=AxisObserver.of_model(
                model, np.full(len(slaves), observed.bandwidth), known, sample_time
            ),
            model=model,
            **bound_stabiliser(self, model),
            observer_gain=self.observer_gain,
            engage_time=self.engage_time,
            master_asked=self.master is not None,
            rejects=len(known) > 0 and self.reject_on == "all",
            gain_given=self.stabiliser_gain is not None,
            observer_fact=observed.fact,
            remarks=tuple(sentence for sentence in (remark, observed.warning) if sentence),
        )  # fmt: skip
