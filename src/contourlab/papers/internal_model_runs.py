"""The runs of Cao and Zhang's simulations and emulated experiments, and what is kept of each.

Positions are in mm in the paper and in m here: gains per mm are a thousand times as large per m.

References
----------
.. [CaoZhang] section 6.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace
from contourlab.contour_errors import TangentEstimator
from contourlab.contours import Circle, Contour, Heart, Lissajous, Sinusoid, combined
from contourlab.controllers import (
    AxisPid,
    Controller,
    CrossCoupled,
    FirstOrderTaskFrame,
    InternalModelContouring,
    PositionDomainPid,
)
from contourlab.feedrate import constant_rate
from contourlab.machines import Machine, SineDisturbance
from contourlab.machines.published import (
    cao_zhang_emulated_stage,
    cao_zhang_stage,
    cao_zhang_stage_and_scanner,
)
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model
from contourlab.recordings import Recording
from contourlab.recordings.reference import Reference
from contourlab.reports.decimation import kept_rows
from contourlab.simulation import simulate

__all__ = [
    "COUPLED",
    "LAWS",
    "PUBLISHED_GAIN",
    "SAMPLE_TIME",
    "SHAKEN",
    "Curves",
    "Figures",
    "axis_pid",
    "figures_of",
    "four_axes",
    "hardware_reference",
    "law",
    "read",
    "shaking",
    "shown",
    "simulated_reference",
]

SAMPLE_TIME = 1e-3
"""[s], section 6."""
KP, KI, KD = (34.96, 11.34), (173.3, 54.11), (0.40, 0.18)
"""PID gains of X1 and X2 [V per mm, per mm s, per mm/s], section 6."""
SCANNER_PID = ((0.5, 0.5), (20.0, 20.0), (0.0, 0.0))
"""Of X3 and X4 until they are engaged: assumed, the paper has none."""
PUBLISHED_GAIN = ((-1.50e3, -9.47e2), (-41.15, -26.41), (-41.15, -26.41))
"""Stabiliser gains of X2, X3 and X4 [V per mm]."""
ERROR_DYNAMICS = (1e4, 1e2)
"""Of the task frame law: e'' = -1e4 e - 1e2 e', from A_Td."""
SMOOTHING = 0.005
"""δ of the simulated heart: as printed it has cusps. A fit after the fact: with twice the radius it
is the value to a digit that brings PID's maximum to the printed one."""
HARDWARE_SMOOTHING = 0.1
"""δ of the heart of the experiments, "smoothed to avoid input saturation": assumed."""
COUPLED = 1.0
"""When the cross-coupling is engaged in the experiments [s]: "not immediately", assumed."""
SHAKEN = 5.0
"""Frequency of the master's error in Figure 5 [rad/s]."""
Curves = tuple[NDArray[Any], tuple[tuple[str, NDArray[Any]], ...]]
"""Time [s], and curves by name."""
LAWS = ("axis_pid", "cross_coupled", "first_order_task_frame", "internal_model_contouring")
"""PID, CCC, TCF and TV-IMCC of the tables."""


@dataclass(frozen=True)
class Figures:
    """What the tables hold of a run."""

    rms: float
    """[m]."""
    largest: float
    """[m]."""


def figures_of(recording: Recording, start: float, end: float) -> Figures:
    """Return rms and maximum of the exact contour error.

    Parameters
    ----------
    recording
        Of a run.
    start, end
        Window [s].
    """
    metrics = recording.metrics_between(start, end)
    return Figures(read(metrics["contour_error_rms"]), read(metrics["contour_error_max"]))


def read(value: Any) -> float:
    """Return a metric as a number.

    Parameters
    ----------
    value
        Of one number.
    """
    return float(np.asarray(value))


def axis_pid(machine: Machine) -> AxisPid:
    """Return the PID of every axis, without a filter and without feed-forward.

    Parameters
    ----------
    machine
        Of two or four axes.
    """
    n = machine.n_axes
    kp, ki, kd = (
        1e3 * np.array((*stage, *scanner)[:n])
        for stage, scanner in zip((KP, KI, KD), SCANNER_PID, strict=True)
    )
    return AxisPid(model=machine.nominal, kp=kp, ki=ki, kd=kd)


def law(name: str, machine: Machine, **changes: Any) -> Controller:
    """Return one of the four laws at the paper's gains.

    Parameters
    ----------
    name
        Of :data:`LAWS`, or ``"position_domain_pid"``.
    machine
        That it is for.
    **changes
        Fields that differ.
    """
    axis = axis_pid(machine)
    if name == "axis_pid":
        return replace(axis, **changes)
    if name == "cross_coupled":
        # K = 1 on each axis: the PID acts on e_i + K ε n_i, which is the PID on the vector, added
        return CrossCoupled(
            axis=axis, estimator=TangentEstimator(), kp=axis.kp, ki=axis.ki, kd=axis.kd,
            form="vector", **changes,
        )  # fmt: skip
    if name == "first_order_task_frame":
        omega = ERROR_DYNAMICS[0] ** 0.5
        fields = {
            "bandwidth_hz": np.full(2, omega / (2.0 * np.pi)),
            "damping": ERROR_DYNAMICS[1] / (2.0 * omega), "hold_compensation": False,
        }  # fmt: skip
        return FirstOrderTaskFrame(model=machine.nominal, **(fields | changes))
    if name == "position_domain_pid":
        # at 1 mm/s of the master the gains of the PID in time
        fields = {
            "kp": 1e3 * KP[1], "ki": 1e3 * KI[1] / 1e-3, "kd": 1e3 * KD[1] * 1e-3, "master": 0
        }  # fmt: skip
        return PositionDomainPid(axis=axis, **(fields | changes))
    top, bottom = cao_zhang_pulse_model(machine.n_axes)
    fields = {
        "master": 0, "numerator": top, "denominator": bottom, "identified_at": SAMPLE_TIME,
        "stabiliser_gain": 1e3 * np.array(PUBLISHED_GAIN[: machine.n_axes - 1]),
    }  # fmt: skip
    return InternalModelContouring(axis=axis, **(fields | changes))


@functools.cache
def simulated_reference(
    contour: str, radius: float = 1.0, duration: float = 20.0, sample_time: float = SAMPLE_TIME
) -> Reference:
    """Return r1 and r2 of section 6.1.

    Parameters
    ----------
    contour
        ``"sinusoid"``, ``"circle"`` or ``"heart"``.
    radius
        By which the printed contour is multiplied, in mm.
    duration
        [s].
    sample_time
        [s].
    """
    size = 1e-3 * radius
    curve: Contour
    if contour == "sinusoid":
        curve = Sinusoid(
            amplitude=np.asarray(size),
            wavelength=np.asarray(2.0 * np.pi * size),
            periods=np.asarray(5.0),
        )
        return constant_rate(curve, rate=size, duration=duration, sample_time=sample_time)
    if contour == "circle":
        curve = Circle(radius=np.asarray(size))
    else:
        curve = Heart(radius=np.asarray(size), smoothing=np.asarray(SMOOTHING))
    return constant_rate(curve, rate=1.0, duration=duration, sample_time=sample_time)


def shaking(amplitude: float = 1e-4, omega: float = SHAKEN) -> SineDisturbance:
    """Return the disturbance that shakes the master by amplitude sin(omega t), its PID at work.

    Parameters
    ----------
    amplitude
        Of the master's error, once its start has died away [m].
    omega
        Its frequency [rad/s].
    """
    top, bottom = (rows[0] for rows in cao_zhang_pulse_model())
    z = np.exp(1j * omega * SAMPLE_TIME)
    axis = (top @ [z, 1.0]) / (z**2 + bottom @ [z, 1.0])
    feedback = 1e3 * (
        KP[0] + KI[0] * SAMPLE_TIME / (z - 1.0) + KD[0] * (1.0 - 1.0 / z) / SAMPLE_TIME
    )
    answer = axis / (1.0 + axis * feedback)  # of the position to a push at the input
    return SineDisturbance(
        axis=0, amplitude=amplitude / abs(answer), frequency_hz=omega / (2.0 * np.pi),
        phase=-np.angle(answer),
    )  # fmt: skip


@functools.cache
def hardware_reference(contour: str, duration: float = 20.0) -> Reference:
    """Return r1 and r2 of section 6.2.

    Parameters
    ----------
    contour
        ``"sinusoid"``, ``"circle"`` or ``"heart"``.
    duration
        [s].
    """
    curve: Contour
    if contour == "sinusoid":  # r1 = 0.1 π t, r2 = 30 sin 0.5 π t: y = 30 sin 5 x in mm
        curve = Sinusoid(
            amplitude=np.asarray(0.03),
            wavelength=np.asarray(0.4e-3 * np.pi),
            periods=np.asarray(6.0),
        )
        rate = 1e-4 * np.pi
    elif contour == "circle":
        curve, rate = Circle(radius=np.asarray(0.03)), 0.5 * np.pi
    else:
        curve = Heart(radius=np.asarray(0.03), smoothing=np.asarray(HARDWARE_SMOOTHING))
        rate = 0.1 * np.pi
    return constant_rate(curve, rate=rate, duration=duration, sample_time=SAMPLE_TIME)


def four_axes(
    stage: float = 1e-3, scanner: float = 1e-4, rates: tuple[float, float] = (1.0, 10.0),
    duration: float = 20.0,
) -> Reference:  # fmt: skip
    """Return the four-axis contour of Figure 9: a circle of the stage and ten of the scanner.

    Parameters
    ----------
    stage, scanner
        Radii [m].
    rates
        Of the stage and of the scanner [rad/s].
    duration
        [s].
    """
    path = Lissajous(
        amplitudes=np.array([stage, stage, scanner, scanner]),
        frequencies=(1.0, 1.0, rates[1] / rates[0], rates[1] / rates[0]),
        phases=np.array([0.5 * np.pi, 0.0, 0.5 * np.pi, 0.0]),
    )
    tool: Any = cao_zhang_stage_and_scanner().tool
    reference = constant_rate(path, rate=rates[0], duration=duration, sample_time=SAMPLE_TIME)
    return replace(reference, contour=combined(path, tool.matrix))


@functools.cache
def emulated(
    coulomb: float = 0.05, gain_error: float = 0.02,
    resolution: float | tuple[float, ...] = 10e-9, n_axes: int = 2,
) -> Machine:  # fmt: skip
    """Return the emulated stage, with the same structure whatever is switched off.

    Parameters
    ----------
    coulomb
        Dry friction [V]; 0 is taken for 1e-12, which keeps the compiled loop.
    gain_error
        Of X1, and minus that of X2.
    resolution
        Of the encoders [m], one for all or one per axis.
    n_axes
        2 or 4.
    """
    return cao_zhang_emulated_stage(
        coulomb=max(coulomb, 1e-12), gain_error=(gain_error, -gain_error), resolution=resolution,
        n_axes=n_axes,
    )  # fmt: skip


def run(
    controller: Controller, reference: Reference, machine: Machine | None = None, **options: Any
) -> Recording:
    """Run one experiment.

    Parameters
    ----------
    controller
        Of :func:`law`.
    reference
        Of one of the functions above.
    machine
        The stage of the simulations by default.
    **options
        Of ``simulate``.
    """
    return simulate(
        cao_zhang_stage() if machine is None else machine, controller, reference, **options
    )


def shown(curves: Mapping[str, Recording], budget: int = 6000) -> Curves:
    """Return time [s] and contour errors [um] for a figure, thinned out with their extremes kept.

    Parameters
    ----------
    curves
        Recordings by name, of one reference.
    budget
        How many instants may be kept.
    """
    errors = {
        name: 1e6 * np.abs(np.asarray(recording["contour_error"]))
        for name, recording in curves.items()
    }
    time = np.asarray(next(iter(curves.values()))["time"])
    kept = kept_rows(len(time), budget, list(errors.values()))
    return time[kept], tuple((name, error[kept]) for name, error in errors.items())
