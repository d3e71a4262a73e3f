"""The runs of Ghaffari and Ulsoy's simulations, and what is kept of each.

The paper prints rounded parameters. The rules that they are rounded from are taken, since they
give its digits and its figures: a = b = 1 / (2 τ), c = d = 1 / τ, κ by (23) for 0.25 V, and for
section A the poles (s + 60) (s² + 28 s + 400).

The proposed scheme can be read in three ways (:data:`READINGS`). The paper gives k' = c' = 500
without a unit, everything else being in mm and s.

References
----------
.. [GhaffariUlsoy] section IV.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contour_errors import NewtonEstimator, VariableGainEstimator
from contourlab.contours.parabola import Parabola
from contourlab.controllers import (
    AxisController,
    AxisPid,
    Controller,
    IntegralSlidingMode,
    NewtonCrossCoupled,
    VariableGainCrossCoupled,
)
from contourlab.feedrate import constant_rate
from contourlab.machines import Disturbance, Machine
from contourlab.machines.base import NominalModel
from contourlab.machines.published.ghaffari import (
    TIME_CONSTANT,
    ghaffari_disturbance,
    ghaffari_two_axes,
)
from contourlab.recordings import Recording
from contourlab.recordings.reference import Reference, ReferencePoint
from contourlab.recordings.sample import Sample
from contourlab.simulation import simulate

__all__ = [
    "CASES",
    "GUARD",
    "READINGS",
    "Case",
    "Outcome",
    "conventional",
    "outcome",
    "parabola_reference",
    "pid_loops",
    "proposed",
    "run_case",
    "sliding_mode",
]

GUARD = 1e-6
"""δ [m]: assumed, the paper prints none."""
DERIVATIVE_HZ = 100.0 / (2.0 * np.pi)
"""Of the couplings' PID: a filter at 100 rad/s, assumed."""
SAMPLE_TIME = 2e-5
"""Of every run but those of the dynamic estimate as printed [s]: assumed."""
FAST_SAMPLE_TIME = 2e-6
"""Of those [s]: k' T = 1."""
SLIDING, PID = "sliding mode", "PID"


@dataclass(frozen=True)
class Case:
    """One of the paper's experiments."""

    curvature: float
    """h_r [1/m]."""
    duration: float
    """T_r [s]."""
    loop: str
    """Position loop: ``"PID"`` or ``"sliding mode"``."""


CASES = {
    "A: PID, h_r = 50, T_r = 2 s": Case(50.0, 2.0, PID),
    "B: h_r = 50, T_r = 2 s": Case(50.0, 2.0, SLIDING),
    "B: h_r = 100, T_r = 2 s": Case(100.0, 2.0, SLIDING),
    "C: h_r = 50, T_r = 1 s": Case(50.0, 1.0, SLIDING),
}
"""Section IV by name."""

READINGS = {
    "k' in 1/ms": "the estimate as printed, E(θ̂) by (8), (11) and the filter, with k' = c' = 500 "
    "read per ms: the paper prints no unit",
    "converged": "Newton's method iterated to convergence within every sample, as 'at each time "
    "step finds θ*' may be read; no k', no lag",
    "k' in 1/s": "the estimate as printed with k' = c' = 500 per s, the unit of everything else",
}
"""Ways to read the proposed estimate."""


@functools.cache
def parabola_reference(curvature: float, duration: float, sample_time: float) -> Reference:
    """Return R(θ) = (θ, h_r θ²), θ from -20 to 20 mm at a constant rate, begun at full speed.

    The contour goes on for 5 mm at either end, so that feet beyond the ends exist, as on the
    paper's parabola.

    Parameters
    ----------
    curvature
        h_r [1/m].
    duration
        T_r [s].
    sample_time
        [s].
    """
    contour = Parabola(coefficient=np.asarray(curvature), half_width=np.asarray(0.025))
    return constant_rate(
        contour, rate=0.04 / duration, start=-0.02, duration=duration, sample_time=sample_time
    )


def pid_loops(model: NominalModel) -> AxisPid:
    """Return the position loop of section A: PID on each axis and velocity feed-forward.

    The derivative acts on the measured velocity: on the error the published errors are out of
    reach.

    Parameters
    ----------
    model
        Of the axes.
    """
    return AxisPid.by_pole_placement(
        model, 20.0 / (2.0 * np.pi), damping=0.7, integral_pole=3.0,
        derivative_on="measurement", derivative_source="velocity", velocity_feed_forward=1.0,
    )  # fmt: skip


def sliding_mode(model: NominalModel, estimate: str = "printed") -> IntegralSlidingMode:
    """Return the position loop of sections B and C.

    Parameters
    ----------
    model
        Of the axes.
    estimate
        Of the disturbance: ``"printed"``, which gives the published figures, ``"corrected"``,
        ``"matched"`` or ``"none"``.
    """
    tau = np.array(TIME_CONSTANT[: model.n_axes])
    rates: dict[str, Any] = {"acceleration_rate": 1.0 / tau, "smoothing_rate": 1.0 / tau}
    if estimate == "none":
        rates = {}
    return IntegralSlidingMode(
        model=model, error_rate=0.5 / tau, integral_rate=0.5 / tau, boundary_layer=np.asarray(1e-3),
        disturbance_bound=np.asarray(0.25), disturbance_estimate=estimate, **rates,
    )  # fmt: skip


def conventional(axis: AxisController, *, stiff: bool = False) -> VariableGainCrossCoupled:
    """Return the variable-gain scheme, Gc = 8 + 80/s + 0.6 s per mm.

    Parameters
    ----------
    axis
        The position loop.
    stiff
        Whether it is given the gain that the proposed scheme has near the path, its Gc over the
        guard: 1000 + 10000/s + 100 s per mm.
    """
    kp, ki, kd = (1.0 / GUARD, 10.0 / GUARD, 0.1 / GUARD) if stiff else (8e3, 80e3, 600.0)
    return VariableGainCrossCoupled(
        axis=axis, kp=kp, ki=ki, kd=kd, derivative_cutoff_hz=DERIVATIVE_HZ
    )


def proposed(axis: AxisController, reading: str = "converged") -> NewtonCrossCoupled:
    """Return the proposed scheme, Gc = 1 + 10/s + 0.1 s on each axis.

    Parameters
    ----------
    axis
        The position loop.
    reading
        One of :data:`READINGS`.
    """
    if reading == "converged":
        estimator = NewtonEstimator()
    else:
        rate = np.asarray(500.0 if reading == "k' in 1/s" else 500e3)
        estimator = NewtonEstimator(
            form="filtered", hessian="approximate", convergence_rate=rate, filter_rate=rate
        )
    return NewtonCrossCoupled(
        axis=axis, estimator=estimator, guard=GUARD, kp=np.asarray(1.0), ki=np.asarray(10.0),
        kd=np.asarray(0.1), derivative_cutoff_hz=np.asarray(DERIVATIVE_HZ),
    )  # fmt: skip


def run_case(
    case: Case,
    law: str,
    *,
    estimate: str = "printed",
    disturbances: Sequence[Disturbance] | None = None,
    sample_time: float | None = None,
    machine: Machine | None = None,
) -> Recording:
    """Run one experiment.

    Parameters
    ----------
    case
        Of :data:`CASES`, or another.
    law
        ``"variable gain"``, ``"stiff variable gain"`` with the gain of the proposed scheme near
        the path, one of :data:`READINGS` for the proposed scheme, or ``"none"`` for the position
        loop alone.
    estimate
        Of the disturbance, in the sliding mode.
    disturbances
        -0.15 V on both axes, constant, by default.
    sample_time
        [s]; by default what the law takes.
    machine
        That of the paper by default; laws are told its nominal model.
    """
    machine = ghaffari_two_axes() if machine is None else machine
    model = machine.nominal
    axis = pid_loops(model) if case.loop == PID else sliding_mode(model, estimate)
    controller: Controller = axis
    if law in ("variable gain", "stiff variable gain"):
        controller = conventional(axis, stiff=law != "variable gain")
    elif law != "none":
        controller = proposed(axis, law)
    if sample_time is None:
        sample_time = FAST_SAMPLE_TIME if law == "k' in 1/ms" else SAMPLE_TIME
    reference = parabola_reference(case.curvature, case.duration, sample_time)
    pushes = ghaffari_disturbance() if disturbances is None else disturbances
    return simulate(machine, controller, reference, disturbances=pushes)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What is kept of a run: figures, and curves thinned out."""

    largest: float
    """MCE [um]."""
    mean: float
    """TACE [um]."""
    command: NDArray[Any]
    """Largest command, shape (n_axes,) [V]."""
    needed: NDArray[Any]
    """Largest command that reference and disturbance need, shape (n_axes,) [V]."""
    time: NDArray[Any]
    """[s]."""
    exact: NDArray[Any]
    """Contour error, magnitude [um]."""
    estimated: NDArray[Any]
    """What the law took it for [um]; NaN without a coupling."""
    static: NDArray[Any]
    """Koren and Lo's estimate at the same points [um]."""

    @property
    def peak(self) -> float:
        """Largest command over what is needed, of the axis where that is most."""
        return float(np.max(self.command / self.needed))

    @property
    def estimate_off(self) -> float:
        """Largest difference of the law's estimate and the exact error, in magnitude [um]."""
        return float(np.max(np.abs(self.estimated - self.exact)))

    @property
    def static_off(self) -> float:
        """Largest difference of the static estimate and the exact error, in magnitude [um]."""
        return float(np.max(np.abs(self.static - self.exact)))


def outcome(recording: Recording, case: Case, *, points: int = 10_000) -> Outcome:
    """Return what is kept of a run.

    Parameters
    ----------
    recording
        Of :func:`run_case`.
    case
        Its case.
    points
        About how many points of the curves are kept.
    """
    time = np.asarray(recording["time"])
    reference = parabola_reference(case.curvature, case.duration, float(time[1] - time[0]))
    model = ghaffari_two_axes().nominal
    needed = np.asarray(jax.vmap(model.feed_forward)(reference.velocity, reference.acceleration))
    kept = slice(None, None, max(1, len(time) // points))
    estimated = np.full(len(time[kept]), np.nan)
    if "contour_error_estimate" in recording.dataset:
        vector = np.asarray(recording["contour_error_estimate"])[kept]
        estimated = 1e6 * np.linalg.norm(vector, axis=1)
    names = ("actual", "reference_parameter")
    actual, parameter = (np.asarray(recording[name])[kept] for name in names)
    return Outcome(
        largest=1e6 * _number(recording, "contour_error_max"),
        mean=1e6 * _number(recording, "contour_error_mean"),
        command=np.max(np.abs(np.asarray(recording["command"])), axis=0),
        needed=np.max(np.abs(needed), axis=0) + 0.15,
        time=time[kept],
        exact=1e6 * np.abs(np.asarray(recording["contour_error"]))[kept],
        estimated=estimated,
        static=1e6 * np.abs(np.asarray(_static(reference.contour, parameter, actual))),
    )


@jax.jit
def _static(contour: Any, parameter: Any, actual: Any) -> Any:
    """Return Koren and Lo's contour error at points that lag behind reference points [m]."""

    def one(p: Any, at: Any) -> Any:
        rows = contour.derivatives(p, 2)
        zero = jnp.zeros(())
        here = ReferencePoint(p, zero, zero, rows[0], rows[1], rows[2], rows[2])
        # of a sample, the estimator reads geometry and position only
        sample = Sample(zero, here, rows, here, at, rows[1])
        return VariableGainEstimator().gains(sample)[0]

    return jax.vmap(one)(parameter, actual)


def _number(recording: Recording, name: str) -> float:
    return float(np.asarray(recording.metrics[name]))
