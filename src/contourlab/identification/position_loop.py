"""What a log of commanded and actual positions tells: the position loop, not the machine in it.

Such a log has no force. What it tells is how the loop follows: its velocity gain K_v, the share F
of feed-forward, the time constant τ of the velocity loop, a delay δ (model:
:mod:`~contourlab.identification.position_loop_response`), and above all the *velocity lag*

    c = (1 - F) / K_v + δ                                                              (1)

by which the axis is behind at a constant velocity, c times the velocity. c is told by any motion.
K_v, F and δ one by one are told by motion that accelerates as fast as the loop answers; where it
does not, and where a log is so slow that its motion between samples is more than its noise, they
get no value, and a sentence. **Mass and friction in N are not in such a log**,
however long; a column of force or current tells them.

The commanded position has no noise, and nothing is fed back to it: least squares of the simulated
position are consistent, whatever the colour of the residual. Rows slower than a least speed do not
count (presliding). As everywhere, an error of the model is not in the intervals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification.machine_result import AxisModel, MachineIdentification
from contourlab.identification.pieces import SHORTEST, cut_pieces, smooth_velocity
from contourlab.identification.position_loop_fit import LoopFit, fit_loop
from contourlab.identification.record import Record, read_record
from contourlab.identification.result import Parameter
from contourlab.identification.rows import position_noise
from contourlab.identification.signals import FEWEST, MOST, NOISE_SPEEDS, PEAK_SHARE
from contourlab.machines.base import per_axis
from contourlab.recordings.recording import Recording

__all__ = ["LOOP_PARAMETERS", "identify_position_loops"]

LOOP_PARAMETERS = {
    "velocity_lag": "s", "velocity_gain": "1/s", "feed_forward": "1", "time_constant": "s",
    "integral_rate": "1/s", "delay": "s", "friction_forward": "m", "friction_backward": "m",
}  # fmt: skip
"""What is looked for, and units: c, K_v, F, τ, x, δ, and φ / K_v of each direction, by which
friction holds a loop without integral back."""
GIVEN = ("velocity_gain", "feed_forward", "time_constant", "delay")
NOTES = (
    "The log holds commanded and actual positions: it tells how the position loop follows, and not "
    "what is in it. Mass and friction in N need a column of force, torque or current (--command).",
    "velocity_lag is by how much later the axis is where it was told to be, at a constant "
    "velocity: (1 - feed_forward) / velocity_gain + delay. Where all axes have the same, a "
    "straight line has no contour error.",
    "velocity_gain is that of a loop in continuous time; one that holds its velocity command for "
    "a time T answers like one whose gain is larger by about half of gain times T.",
    "Intervals are of Student's t over equal-weighted cosines of the scores, which stand coloured "
    "residuals. An error of the model is not in them: of a simulated loop on a Lissajous figure, "
    "where the velocity lag came out wrong by 0.5 us, 70 to 75 % of the 95 % intervals held it.",
)
TOLD = 0.2
"""Half an interval, as a share of the value (of the whole, for F), from which one is not told."""
NO_WORSE = 1.1
"""Residual without feed-forward, over that with it, up to which there is none."""
PROPER = ("time_constant", "integral_rate")
"""Parameters that are above 0 in any case."""
MISFIT = 3.0
"""Residual over the noise of the encoder from which the model leaves something out."""
SMOOTHED = 0.05
"""Standard deviation of a smoothed velocity, over that of positions by the sample time, at most."""
COUNTS_SHOWN = 0.2
"""Speed below which a smoothed velocity shows single counts, in counts per sample."""
PEAK = 0.995
"""Share of the rows below whose largest speed the peak is: a jump of a log is no speed."""
BLIND = 0.5
"""Motion between samples, seen in the command, over what is seen of noise, from which the log tells
neither: the residual has nothing to be judged by."""
SLOW_LOG = 5e-3
"""Sample time from which a log is slower than most loops answer [s]."""
PIECE_TIME = 0.5
"""A motion one way is cut into pieces no longer than this [s]."""
MOST_ROWS = 200_000
"""Of longer records the stretch of this length with most motion is looked at."""
FEWEST_ROWS = 48
"""A piece may be as long as this, whatever the time [samples]."""
Rows = NDArray[Any]


def identify_position_loops(
    recording: Recording,
    *,
    known: Mapping[str, Any] | None = None,
    window: tuple[float, float] | None = None,
    confidence: float = 0.95,
    source: str = "",
) -> MachineIdentification:
    """Return how the position loop of every axis follows what it is told.

    Parameters
    ----------
    recording
        With ``measured`` positions [m] and a ``command`` of kind ``position``.
    known
        ``velocity_gain``, ``feed_forward``, ``time_constant`` or ``delay`` that is known, one
        number or one per axis.
    window
        Start and end [s]; the whole record if None.
    confidence
        Of the intervals, between 0 and 1.
    source
        Where the record comes from, for people.

    Returns
    -------
    MachineIdentification
        With parameters :data:`LOOP_PARAMETERS`; one that cannot be found has no value, and
        ``warnings`` says why.

    Raises
    ------
    RecordingError
        Signals are missing or unfit, or no axis moved.
    ConfigurationError
        An option out of bounds.
    """
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError(f"confidence must be > 0 and < 1, got {confidence!r}")
    record = read_record(recording, window=window, kinds={"position": "m"})
    n = len(record.names)
    given = _given(known, n)
    axes, warnings = [], []
    for k in range(n):
        axis, said = _axis(record, k, {name: float(row[k]) for name, row in given.items()},
                           confidence)  # fmt: skip
        axes.append(axis)
        warnings += [f"axis {axis.axis}: {sentence}" for sentence in said]
    if all(axis.method == "none" for axis in axes):
        count = max(_count(record.measured[:, k]) for k in range(n))
        raise RecordingError(
            f"no axis moved one way for {SHORTEST} samples and faster than the log shows: "
            f"positions in steps of {1e6 * count:.4g} um, one every "
            f"{1e3 * record.sample_time:.4g} ms, do not tell how a loop follows"
        )
    jerk = np.abs(np.diff(record.acting, 3, axis=0)).max(axis=0) / record.sample_time**3
    return MachineIdentification(
        axes=tuple(axes), confidence=confidence, instrument="none", command_kind="position",
        command_limit=record.limit, sample_time=record.sample_time,
        travel=np.stack([record.measured.min(axis=0), record.measured.max(axis=0)], axis=1),
        jerk=jerk, warnings=tuple(warnings), notes=NOTES, source=source,
    )  # fmt: skip


def _given(known: Mapping[str, Any] | None, n: int) -> dict[str, Rows]:
    rows = {}
    for name, value in (known or {}).items():
        if name not in GIVEN:
            raise ConfigurationError(
                f"known has no parameter {name!r} of a position loop; {choices(name, GIVEN)}"
            )
        row = np.asarray(per_axis(f"known {name}", value, n), float)
        sign = ">=" if name in ("feed_forward", "delay") else ">"
        if not (np.isfinite(row).all() and ((row > 0.0) | ((row == 0.0) & (sign == ">="))).all()):
            raise ConfigurationError(f"known {name} must be {sign} 0, got {value!r}")
        rows[name] = row
    return rows


def _axis(
    record: Record, k: int, given: dict[str, float], confidence: float
) -> tuple[AxisModel, list[str]]:
    step = record.sample_time
    begin, end = _stretch(np.gradient(record.acting[:, k], step))
    measured, commanded = record.measured[begin:end, k], record.acting[begin:end, k]
    velocity, count = smooth_velocity(measured, step), _count(measured)
    least = max(
        NOISE_SPEEDS * SMOOTHED * position_noise(measured) / step, COUNTS_SHOWN * count / step,
        PEAK_SHARE * float(np.quantile(np.abs(velocity), PEAK)),
    )  # fmt: skip
    pieces = None
    if least > 0.0:
        pieces = cut_pieces(velocity, least, longest=max(FEWEST_ROWS, round(PIECE_TIME / step)))
    way = np.where(np.abs(velocity) >= least, np.sign(velocity), 0.0)
    turns = way[way != 0.0]
    cosines = int(np.clip(np.sum(turns[1:] != turns[:-1]), FEWEST, MOST))
    quantile = float(student.ppf(0.5 + 0.5 * confidence, cosines))
    fits: list[LoopFit] = []
    if pieces is not None:

        def fit(given: dict[str, float]) -> LoopFit:
            return fit_loop(commanded, measured, way, step, pieces, given, cosines)

        fits.append(fit(given))
        loose = quantile * fits[0].deviation({"feed_forward": 1.0}) > TOLD
        if loose and "feed_forward" not in given:
            without = fit({**given, "feed_forward": 0.0})
            if without.rms < NO_WORSE * fits[0].rms and without.values["delay"] > -step:
                fits.append(without)
    return _model(record, k, given, fits, quantile, cosines, (begin, end), least, count)


def _stretch(velocity: Rows) -> tuple[int, int]:
    """Return which rows to look at: of a long record those where most moves."""
    n = len(velocity)
    if n <= MOST_ROWS:
        return 0, n
    total = np.concatenate([[0.0], np.cumsum(velocity**2)])
    begin = int(np.argmax(total[MOST_ROWS:] - total[:-MOST_ROWS]))
    return begin, begin + MOST_ROWS


def _count(measured: Rows) -> float:
    """Return the smallest step between neighbouring positions [m]; 0 if there is none."""
    steps = np.abs(np.diff(measured[:MOST_ROWS]))
    steps = steps[steps > 1e-12]
    return float(steps.min()) if len(steps) else 0.0


def _model(
    record: Record, k: int, given: dict[str, float], fits: list[LoopFit], quantile: float,
    cosines: int, stretch: tuple[int, int], least: float, count: float,
) -> tuple[AxisModel, list[str]]:  # fmt: skip
    nothing = {
        name: Parameter(value=np.nan, low=np.nan, high=np.nan, unit=unit)
        for name, unit in LOOP_PARAMETERS.items()
    }
    step, n = record.sample_time, len(record.time)
    fit = fits[-1] if fits else None
    measured, residual, parameters = record.measured[:, k], np.full(n, np.nan), dict(nothing)
    if fit is None:
        noise = position_noise(measured)
        said = [f"it never moved faster than {least:.3g} m/s for long enough: nothing was found"]
    else:
        residual[slice(*stretch)] = fit.residual
        counts = np.isfinite(residual)
        noise = position_noise(measured, counts.astype(float))
        finest = max(noise, count / np.sqrt(12.0))
        # what the command shows of it, which has none, is motion
        asked = position_noise(record.acting[:, k], counts.astype(float))
        rounded = _count(record.acting[:, k]) ** 2 / 12.0
        blind = asked**2 - rounded > (BLIND * noise) ** 2
        if blind:
            finest, noise = 0.0, min(noise, fit.rms)
        parameters |= _parameters(fits, quantile, given, finest)
        error = np.abs(record.acting[counts, k] - measured[counts])
        said = _sentences(parameters, fits, quantile, step, float(error.max()), finest, count)
        if stretch[1] - stretch[0] < n:
            said.append(
                f"of {n} samples those from {record.time[stretch[0]]:.6g} to "
                f"{record.time[stretch[1] - 1]:.6g} s were looked at, where it moves most"
            )
    velocity = smooth_velocity(record.acting[:, k], step)
    told = fit is None or parameters["velocity_gain"].identified
    return AxisModel(
        axis=record.names[k], method="none" if fit is None else "simulation error",
        parameters=parameters, least_squares=nothing,
        covariance=np.zeros((0, 0)) if fit is None else fit.covariance,
        free=() if fit is None else fit.names, unexcited=(),
        inseparable=() if told else ("velocity_gain", "feed_forward", "delay"),
        astray=False, degrees=cosines, minimum_speed=least, speed=float(np.abs(velocity).max()),
        acceleration=float(np.abs(smooth_velocity(velocity, step)).max()),
        counted=float(np.isfinite(residual).sum()) * step, encoder_noise=noise, noise_ratio=np.nan,
        residual_rms=np.nan if fit is None else fit.rms, corner_hz=np.nan, correlation=np.nan,
        time=record.time, measured=measured, simulated=measured - residual, residual=residual,
    ), said  # fmt: skip


def _parameters(
    fits: list[LoopFit], quantile: float, given: dict[str, float], finest: float
) -> dict[str, Parameter]:
    def found(name: str, value: float, deviation: float) -> Parameter:
        half = quantile * deviation
        return Parameter(
            value=value, low=value - half, high=value + half, unit=LOOP_PARAMETERS[name],
            known=name in given,
        )  # fmt: skip

    fit, x = fits[0], fits[0].values
    gain, share = x["velocity_gain"], x["feed_forward"]
    slope = {"feed_forward": -1.0 / gain, "velocity_gain": -(1.0 - share) / gain**2, "delay": 1.0}
    value = (1.0 - share) / gain + x["delay"]  # (1)
    parameters = {"velocity_lag": found("velocity_lag", value, fit.deviation(slope))}
    parameters |= {name: found(name, given[name], 0.0) for name in given}
    guessed = quantile * fit.deviation({"velocity_gain": 1.0}) > TOLD * gain
    fit, x = fits[-1], fits[-1].values
    width = {name: quantile * fit.deviation({name: 1.0}) for name in fit.names}
    if guessed or fit.rms >= MISFIT * finest or _backwards(fits, quantile):
        return parameters
    together = width.get("feed_forward", 0.0) > TOLD
    for name, half in width.items():
        if name not in LOOP_PARAMETERS or (together and name in ("feed_forward", "delay")):
            continue
        if name not in PROPER or half < TOLD * x[name]:  # else no more than its size is known
            parameters[name] = found(name, x[name], half / quantile)
    return parameters


def _backwards(fits: list[LoopFit], quantile: float) -> bool:
    """Return whether feed-forward came out negative: then (1) stands for something else, as the
    fraction of a long delay does."""
    half = quantile * fits[0].deviation({"feed_forward": 1.0})
    return fits[0].values["feed_forward"] + half < 0.0


def _sentences(
    parameters: dict[str, Parameter], fits: list[LoopFit], quantile: float, step: float,
    error: float, finest: float, count: float,
) -> list[str]:  # fmt: skip
    said = []
    if error <= 2.0 * count:
        said.append(
            f"the actual position is never more than two of its steps of {1e6 * count:.3g} um from "
            "the commanded one: the log is too coarse to show how the loop follows"
        )
    if finest == 0.0:
        said.append(
            f"{1e3 * step:.4g} ms between samples do not tell noise from motion, nor how the axis "
            "moves between them: only the velocity lag is told, and the interval does not hold "
            "what that leaves open"
        )
    elif fits[-1].rms >= MISFIT * finest:
        said.append(
            f"the simulated motion misses the measured one by {1e6 * fits[-1].rms:.3g} um rms, "
            f"with {1e6 * finest:.2g} um of noise and counts: the loop does something that the "
            "model does not know (other feed-forward or filters, elasticity, backlash); of it "
            "only the velocity lag is told, and the interval does not hold that"
        )
    elif _backwards(fits, quantile):
        said.append(
            "feed-forward came out negative: the axis lags otherwise than a loop with a velocity "
            "gain does, such as by a long delay; only the velocity lag is told"
        )
    elif not parameters["velocity_gain"].identified:
        why = "it hardly accelerates as fast as the loop answers"
        if step > SLOW_LOG:
            why += f", and {1e3 * step:.4g} ms between samples are too long to see that"
        said.append(
            "only the velocity lag is told; velocity gain, feed-forward and delay are not told "
            f"apart: {why}. Give one that is known"
        )
    elif not parameters["feed_forward"].identified:
        said.append(
            "a little feed-forward looks like a delay that is less"
            + (
                ": feed-forward was taken for 0, which fits as well"
                if len(fits) > 1
                else ", and the motion does not tell them apart; give one that is known"
            )
        )
    return said
