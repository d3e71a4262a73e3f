"""The limit cycle of a law on a machine, against the sample time and one of its numbers.

Laws with a steep gain about zero error (a unity contour error vector with a small guard, a thin
boundary layer) do not come to rest when they are sampled too slowly: they swing about the path with
a small amplitude at a high frequency. How steep a gain may be depends on the sample time, on the
delay of drives and sensors and on what the sensors resolve; this study runs the machine and looks.

The machine starts from rest on a straight line at a constant feed, under a disturbance if one is
given. When the start has died out, a linear loop leaves a constant contour error there: whatever
moves in the last part of the run is a limit cycle or noise. Reported are its *amplitude* (the
largest distance of the contour error vector from its mean), its *frequency* (the strongest line of
the spectrum), and beside them what a softer gain costs: the largest contour error of the whole run.

A run whose amplitude is below ``quiet_below`` counts as quiet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.line import Line
from contourlab.controllers.base import Controller
from contourlab.errors import SimulationError
from contourlab.feedrate import constant_feed
from contourlab.feedrate.limits import metres_per_second
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.simulation.many import simulate_many

__all__ = ["Chattering", "chattering", "limit_cycle"]

_SHARE = 0.25
"""Last part of a run in which nothing should move any more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chattering:
    """Limit cycles over sample times (rows) and values of one number of the law (columns)."""

    field: str
    """The number that was varied, such as ``"guard"``."""
    values: NDArray[Any]
    """Its values, ascending, shape (n_values,)."""
    sample_times: NDArray[Any]
    """Ascending, shape (n_times,) [s]."""
    amplitude: NDArray[Any]
    """Of the contour error, shape (n_times, n_values) [m]; NaN where the run diverged."""
    frequency_hz: NDArray[Any]
    """Likewise [Hz]; NaN where the run is quiet or diverged."""
    command_ripple: NDArray[Any]
    """Half of what the command swings, on the axis where it swings most, likewise."""
    contour_error_max: NDArray[Any]
    """Over the whole run, the start included, likewise [m]."""
    quiet_below: float
    """Amplitude below which a run counts as quiet [m]."""

    @property
    def quiet(self) -> NDArray[Any]:
        """Whether nothing moves, shape (n_times, n_values)."""
        return self.amplitude <= self.quiet_below

    @property
    def least_quiet(self) -> NDArray[Any]:
        """Least value from which on all are quiet, per sample time; NaN if not even the largest."""
        least = np.full(len(self.sample_times), np.nan)
        for row, quiet in enumerate(self.quiet):
            loud = np.flatnonzero(~quiet)
            first = loud[-1] + 1 if len(loud) else 0
            if first < len(self.values):
                least[row] = self.values[first]
        return least


def chattering(
    machine: Machine,
    controller: Controller,
    *,
    values: Sequence[float] | NDArray[Any],
    sample_times: Sequence[float] | NDArray[Any],
    field: str = "guard",
    feed: float | str = 0.01,
    duration: float = 2.0,
    direction: Sequence[float] | NDArray[Any] | None = None,
    disturbances: Sequence[Disturbance] | Disturbance = (),
    quiet_below: float = 1e-9,
    progress: Callable[[float], None] | None = None,
) -> Chattering:
    """Return the limit cycles of a law for several sample times and values of one of its numbers.

    Parameters
    ----------
    machine
        The machine, with its delays and sensors.
    controller
        The law.
    values
        Of the number that varies.
    sample_times
        [s].
    field
        Which number of the law, as a dotted path: ``"guard"``, ``"axis.boundary_layer"``.
    feed
        Along the line, in m/s or a text with its unit.
    duration
        Of each run [s]; long enough for the start to die out in its first three quarters.
    direction
        Of the line, one number per axis; by default all axes alike.
    disturbances
        What acts on the axes, such as a constant load.
    quiet_below
        Amplitude of the contour error below which a run is quiet [m]. Above the resolution of the
        encoders, where there is one.
    progress
        Called with the fraction done.

    Raises
    ------
    SimulationError
        No values or sample times, a direction of no length or of another number of axes.
    RefusedError
        The law is not for straight lines, or, as it is given, not stable at one of the sample
        times. The values of ``field`` are traced and not checked for stability.
    ConfigurationError
        A value out of bounds.
    """
    numbers = np.unique(np.asarray(values, float))
    times = np.unique(np.asarray(sample_times, float))
    if not numbers.size or not times.size:
        raise SimulationError("chattering needs at least one value and one sample time")
    shape = (len(times), len(numbers))
    found = {name: np.full(shape, np.nan) for name in ("amplitude", "frequency", "ripple", "top")}
    for row, sample_time in enumerate(times):
        reference = _line(machine, feed, duration, direction, float(sample_time))
        lanes = simulate_many(
            machine, controller, reference, vary={f"controller.{field}": numbers},
            metrics=("contour_error_max",), record=("contour_error_vector", "command"),
            disturbances=disturbances,
        )  # fmt: skip
        kept = slice(-max(8, round(_SHARE * reference.n_samples)), None)
        fine = np.isnan(np.asarray(lanes["diverged_at"]))
        for lane in np.flatnonzero(fine):
            error = np.asarray(lanes["contour_error_vector"])[lane, kept]
            command = np.asarray(lanes["command"])[lane, kept]
            amplitude, frequency = limit_cycle(error, float(sample_time))
            found["amplitude"][row, lane] = amplitude
            found["frequency"][row, lane] = frequency if amplitude > quiet_below else np.nan
            found["ripple"][row, lane] = 0.5 * float(np.max(np.ptp(command, axis=0)))
            found["top"][row, lane] = float(np.asarray(lanes["contour_error_max"])[lane])
        if progress is not None:
            progress((row + 1) / len(times))
    return Chattering(
        field=field, values=numbers, sample_times=times, amplitude=found["amplitude"],
        frequency_hz=found["frequency"], command_ripple=found["ripple"],
        contour_error_max=found["top"], quiet_below=float(quiet_below),
    )  # fmt: skip


def limit_cycle(signal: NDArray[Any], sample_time: float) -> tuple[float, float]:
    """Return the amplitude of what moves in a signal, and the frequency of its strongest line.

    Parameters
    ----------
    signal
        Shape (n_samples, n_axes), eight samples or more.
    sample_time
        [s].

    Returns
    -------
    amplitude
        Largest distance from the mean.
    frequency
        [Hz], to one over the length of the signal; 0 if nothing moves.
    """
    moving = signal - np.mean(signal, axis=0)
    amplitude = float(np.max(np.linalg.norm(moving, axis=1)))
    window = np.hanning(len(moving))[:, None]
    power = np.sum(np.abs(np.fft.rfft(window * moving, axis=0)) ** 2, axis=1)
    power[0] = 0.0
    strongest = int(np.argmax(power))
    return amplitude, strongest / (len(moving) * sample_time)


def _line(
    machine: Machine, feed: float | str, duration: float, direction: Any, sample_time: float,
) -> Reference:  # fmt: skip
    """Return a straight motion through the middle of a machine's travel."""
    n = machine.n_axes
    along = np.ones(n) if direction is None else np.asarray(direction, float)
    size = float(np.linalg.norm(along))
    if along.shape != (n,) or not (np.isfinite(size) and size > 0.0):
        raise SimulationError(
            f"direction must have one number for each of the {n} axes, not all 0, got {direction}"
        )
    ends = np.broadcast_to(np.asarray(machine.travel), (n, 2))
    middle = np.zeros(n)
    bounded = np.all(np.isfinite(ends), axis=1)
    middle[bounded] = np.mean(ends[bounded], axis=1)
    half = 0.51 * metres_per_second(feed, "feed") * duration * along / size
    line = Line(start=middle - half, end=middle + half)
    return constant_feed(line, feed=feed, sample_time=sample_time, duration=duration)
