"""A machine's parameters from a recording of position and command, refined by simulation.

For each axis

    M q'' + B q' + S q + (A_f forwards, -A_b backwards) = u(t - δ)

in units of the command: **mass and input gain cannot be told apart** from position and command,
so that M is mass over gain, and so on. Filtered least squares begin
(:mod:`~contourlab.identification.start`), the error of the simulated response decides
(:mod:`~contourlab.identification.refinement`).
What the motion does not tell apart gets no value, and a sentence.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from contourlab.configuration import replace
from contourlab.controllers.least_squares import FilteredLeastSquares
from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification.instrument import directions, driving_command, following_motion
from contourlab.identification.machine_result import AxisModel, MachineIdentification
from contourlab.identification.machine_words import NOTES, sentences
from contourlab.identification.pieces import Pieces, cut_pieces, smooth_velocity
from contourlab.identification.record import COMMAND_UNITS, Record, read_record
from contourlab.identification.refinement import Drive, Refined, gram, refine
from contourlab.identification.result import Parameter
from contourlab.identification.rows import memory
from contourlab.identification.separability import Separability, separate
from contourlab.identification.signals import Signals, axis_signals
from contourlab.identification.simulated_response import MODEL_PARAMETERS
from contourlab.identification.start import Start, position_columns, start_values
from contourlab.machines.base import per_axis
from contourlab.recordings.recording import Recording

__all__ = ["KINDS", "PIECE_TIME", "identify_machine", "units_of"]

KINDS = {**COMMAND_UNITS, "position": "m"}
"""Kinds of command, and their units."""
CUTOFF_SHARE = 0.05
"""Cut-off of the filter relative to the sampling frequency, if nothing else is said."""
SIGN_WIDTH = 1e-4
"""Of the tanh, if nothing else is said [m/s]."""
PIECE_TIME = 0.5
"""A motion one way is cut into pieces no longer than this [s]..."""
FEWEST_ROWS = 48
"""...and of no fewer samples."""
SPRING_SHARE = 5e-3
"""Share of the command from which a spring is believed..."""
SPRING_SURE = 5.0
"""...if its value is this many standard deviations..."""
SPRING_GAIN = 0.8
"""...and it leaves no more than this share of the residual."""
ASTRAY = 30.0
"""Standard deviation of the refined mass, in those of the start, from which it is not believed."""
STILL = 1e-6
"""Acceleration of a motion, relative to speed times cut-off, below which it is none."""
Rows = NDArray[Any]


class _Options(NamedTuple):
    given: dict[str, Rows]
    stiffness: bool | None
    drive_lag: bool
    confidence: float
    limit: float
    piece_time: float
    simulate: bool


def identify_machine(
    recording: Recording,
    *,
    instrument: str = "auto",
    law: FilteredLeastSquares | None = None,
    minimum_speed: float | None = None,
    known: Mapping[str, Any] | None = None,
    stiffness: bool | None = None,
    drive_lag: bool = False,
    window: tuple[float, float] | None = None,
    confidence: float = 0.95,
    condition_limit: float = 30.0,
    piece_time: float = PIECE_TIME,
    simulate: bool = True,
    command_kind: str | None = None,
    source: str = "",
) -> MachineIdentification:
    """Return mass, friction of each direction, stiffness and delay of every axis.

    Parameters
    ----------
    recording
        With ``measured`` positions [m] and ``command``; with the ``reference`` where there is one.
    instrument
        ``reference``; ``none``: the response itself, biased where a loop feeds forces back;
        ``auto``: the reference if there is one.
    law
        Filter of the start, and smooth sign of the friction; by default a cut-off of a twentieth of
        the sampling frequency and a tanh of 0.1 mm/s. The rest of it is not used.
    minimum_speed
        Slower rows do not count, > 0 [m/s]; see :func:`~contourlab.identification.identify`.
    known
        Parameters that are known, by name, one number or one per axis, in units of the command;
        ``delay`` in s. A motion that does not tell the delay takes 0 s for it if it is not given.
    stiffness
        Whether a spring holds the axes; found out if None.
    drive_lag
        Whether the drive lags by a time constant that is looked for too.
    window
        Start and end [s]; the whole record if None.
    confidence
        Of the intervals, between 0 and 1.
    condition_limit
        Condition beyond which parameters are not told apart, > 1.
    piece_time
        Longest stretch that is simulated without beginning anew, > 0 [s].
    simulate
        Whether the simulated response refines what least squares find.
    command_kind
        ``voltage``, ``force``, ``velocity`` or ``position``; that of the recording if None.
    source
        Where the record comes from, for people.

    Returns
    -------
    MachineIdentification
        A parameter that cannot be found has no value; ``warnings`` says why.

    Raises
    ------
    RecordingError
        Signals are missing or unfit, or no axis ever moved fast enough for long enough.
    ConfigurationError
        An option out of bounds.
    """
    _check(instrument, confidence, condition_limit, minimum_speed, piece_time)
    record = read_record(recording, window=window, command_kind=command_kind, kinds=KINDS)
    if record.reference is None and record.kind == "position":
        record = record._replace(reference=record.acting)  # what is asked for is the command
    if instrument == "auto":
        instrument = "none" if record.reference is None else "reference"
    if instrument == "reference" and record.reference is None:
        raise RecordingError(
            "the recording has no reference to be an instrument: choose instrument='none'"
        )
    n = len(record.names)
    if law is None:
        law = FilteredLeastSquares(
            cutoff_hz=CUTOFF_SHARE / record.sample_time, friction_shape="tanh",
            friction_velocity=SIGN_WIDTH,
        )  # fmt: skip
    law = replace(law, initial_covariance=np.ones(4))
    options = _Options(
        _given(known, n), True if record.kind == "position" else stiffness, drive_lag, confidence,
        condition_limit, piece_time, simulate,
    )  # fmt: skip
    prepared = axis_signals(record, law, instrument, minimum_speed)
    if not any(signals.weight.any() for signals in prepared):
        remembers = memory(law, record.sample_time, n)
        raise RecordingError(
            f"no axis moved faster than {max(s.minimum_speed for s in prepared):.3g} m/s for "
            f"longer than {2 * remembers.max() * record.sample_time:.3g} s, twice what the filter "
            "remembers: record a longer or faster motion, or raise the cut-off of the filter"
        )
    springs = [position_columns(record, law, record.measured)] * 2
    if instrument == "reference" and record.reference is not None:
        springs[1] = position_columns(record, law, record.reference)
    axes, warnings = [], []
    for k, signals in enumerate(prepared):
        spring = (springs[0][:, k], springs[1][:, k])
        found, said = _axis(record, k, signals, spring, law, instrument, options)
        axes.append(found)
        warnings += [f"axis {record.names[k]}: {sentence}" for sentence in said]
    reference = record.reference
    jerk = np.full(n, np.nan)
    if reference is not None and len(reference) > 5:
        jerk = np.abs(np.diff(reference, 3, axis=0)).max(axis=0) / record.sample_time**3
    return MachineIdentification(
        axes=tuple(axes), confidence=confidence, instrument=instrument,
        command_kind=record.kind, command_limit=record.limit,  # type: ignore[arg-type]
        sample_time=record.sample_time,
        travel=np.stack([record.measured.min(axis=0), record.measured.max(axis=0)], axis=1),
        jerk=jerk, warnings=tuple(warnings), notes=NOTES, source=source,
    )  # fmt: skip


def units_of(kind: str) -> dict[str, str]:
    """Return the units of the parameters, by name.

    Parameters
    ----------
    kind
        Of the command, a key of :data:`KINDS`.
    """
    mass, viscous, stiffness = {
        "force": ("kg", "N s/m", "N/m"),
        "velocity": ("s", "1", "1/s"),
        "voltage": ("V/(m/s^2)", "V/(m/s)", "V/m"),
        "position": ("s^2", "s", "1"),
    }[kind]
    return {
        "mass": mass, "viscous": viscous, "stiffness": stiffness, "coulomb_forward": KINDS[kind],
        "coulomb_backward": KINDS[kind], "delay": "s", "drive_lag": "s",
    }  # fmt: skip


def _check(
    instrument: str, confidence: float, limit: float, speed: float | None, piece_time: float
) -> None:
    allowed = ("auto", "reference", "none")
    if instrument not in allowed:
        raise ConfigurationError(
            f"unknown instrument {instrument!r}; {choices(instrument, allowed)}"
        )
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError(f"confidence must be > 0 and < 1, got {confidence!r}")
    if not limit > 1.0:
        raise ConfigurationError(f"condition_limit must be > 1, got {limit!r}")
    if speed is not None and not (np.isfinite(speed) and speed > 0.0):
        raise ConfigurationError(f"minimum_speed must be > 0 m/s, got {speed!r}")
    if not (np.isfinite(piece_time) and piece_time > 0.0):
        raise ConfigurationError(f"piece_time must be > 0 s, got {piece_time!r}")


def _given(known: Mapping[str, Any] | None, n: int) -> dict[str, Rows]:
    rows = {}
    for name, value in (known or {}).items():
        if name not in MODEL_PARAMETERS:
            raise ConfigurationError(
                f"known has no parameter {name!r}; {choices(name, MODEL_PARAMETERS)}"
            )
        row = np.asarray(per_axis(f"known {name}", value, n), float)
        if not np.isfinite(row).all():
            raise ConfigurationError(f"known {name} must be finite, got {value!r}")
        rows[name] = row
    if set(rows) >= set(MODEL_PARAMETERS) - {"drive_lag"}:
        raise ConfigurationError("known leaves nothing to find")
    return rows


def _axis(
    record: Record, k: int, signals: Signals, spring: tuple[Rows, Rows],
    law: FilteredLeastSquares, instrument: str, options: _Options,
) -> tuple[AxisModel, list[str]]:  # fmt: skip
    given = {name: float(row[k]) for name, row in options.given.items()}
    units = units_of(record.kind)
    empty = _Found(record, k, signals, units, options)
    if not signals.weight.any():
        return empty.model(), sentences(empty.model(), record, options.confidence)
    start, held = _start(record, signals, spring, given, options)
    excited = _motion_excites(signals, instrument, law, record.sample_time)
    theta = _theta(start, given, options, record.sample_time)
    names = [name for name in MODEL_PARAMETERS if name not in given and name not in held]
    if not options.drive_lag:
        names.remove("drive_lag")
    velocity = smooth_velocity(record.measured[:, k], record.sample_time)
    longest = max(FEWEST_ROWS, round(options.piece_time / record.sample_time))
    pieces = cut_pieces(
        velocity, signals.minimum_speed, longest=longest,
        margin=round(max(theta[5], 0.0) / record.sample_time) + 2,
    )  # fmt: skip
    if pieces is None or not excited or not theta[0] > 0.0:
        found = empty._replace(start=start, held=held, excited=excited)
        return found.model(), sentences(found.model(), record, options.confidence)
    ahead, back = directions(velocity, law, k)
    measured = Drive(record.acting[:, k], ahead, back, record.measured[:, k])
    noiseless = None
    if instrument == "reference" and record.reference is not None:
        motion = following_motion(record.reference[:, k], record.measured[:, k], record.sample_time)
        noiseless = driving_command(theta, motion, law, k, record.sample_time)
    theta, names, judged = _judged(
        theta, names, noiseless or measured, pieces, record, given, options
    )
    refined, astray = None, False
    if options.simulate:
        names = [name for name in names if name not in judged.unexcited]
        for _ in range(2):  # the command of the instrument is that of the parameters found
            refined = refine(
                theta, tuple(names), measured, noiseless, pieces, record.sample_time,
                signals.cosines,
            )  # fmt: skip
            if not _plausible(refined, theta, names, start):
                refined, astray = None, True
                break
            theta = refined.theta
            if noiseless is None:
                break
            noiseless = driving_command(theta, motion, law, k, record.sample_time)
        if refined is not None:  # with the values found, are they told apart?
            _, still, again = _judged(
                theta, names, noiseless or measured, pieces, record, given, options
            )
            lost = tuple(name for name in names if name not in still)
            judged = again._replace(
                unexcited=judged.unexcited, inseparable=(*lost, *again.inseparable)
            )
    found = empty._replace(
        start=start, held=held, judged=judged, refined=refined, names=tuple(names), pieces=pieces,
        given=given, astray=astray,
    )  # fmt: skip
    model = found.model()
    return model, sentences(model, record, options.confidence)


def _start(
    record: Record, signals: Signals, spring: tuple[Rows, Rows], given: dict[str, float],
    options: _Options,
) -> tuple[Start, dict[str, float]]:  # fmt: skip
    """Return where to start, and what is held at which value."""
    held: dict[str, float] = {}
    about: dict[str, float] = {
        name: given[name] for name in ("mass", "viscous", "stiffness") if name in given
    }
    ways = [given.get(f"coulomb_{way}") for way in ("forward", "backward")]
    if None not in ways:
        ahead, back = (float(way or 0.0) for way in ways)
        about |= {"coulomb": 0.5 * (ahead + back), "disturbance": 0.5 * (back - ahead)}
    assumed = given.get("delay", 0.0)
    delay = assumed if "delay" in given else None

    def solve(with_spring: bool) -> Start:
        return start_values(
            signals, spring if with_spring else None, record.sample_time, delay, about,
            options.limit, assumed,
        )  # fmt: skip

    if options.stiffness is None and "stiffness" not in given:
        start, without = solve(True), solve(False)
        value, spread = start.values["stiffness"], start.deviations["stiffness"]
        effort = abs(value) * float(np.std(spring[0][signals.weight > 0.0]))
        command = float(np.sqrt(np.average(signals.wanted**2, weights=signals.weight)))
        sure = abs(value) > SPRING_SURE * spread and effort > SPRING_SHARE * command
        if not (sure and start.residual_rms < SPRING_GAIN * without.residual_rms):
            start = without
            held["stiffness"] = 0.0
    else:
        start = solve(bool(options.stiffness) or "stiffness" in given)
        if not options.stiffness:
            held["stiffness"] = given.get("stiffness", 0.0)
    if "delay" not in start.deviations:
        held["delay"] = assumed
    return start, held


def _motion_excites(
    signals: Signals, instrument: str, law: FilteredLeastSquares, sample_time: float
) -> bool:
    """Return whether the axis accelerates at all."""
    moving = signals.instrument if instrument == "reference" else signals.regressor
    square = np.average(moving[:, :2] ** 2, axis=0, weights=signals.weight)
    cutoff = 2.0 * np.pi * float(np.max(np.asarray(law.cutoff_hz)))
    least = (STILL * cutoff) ** 2 * square[1]
    if instrument != "reference":
        square[0] -= signals.noise[0, 0]
        least = max(least, signals.noise[0, 0])
    return bool(square[0] > least)


def _theta(start: Start, given: dict[str, float], options: _Options, sample_time: float) -> Rows:
    values = {**{"mass": 0.0, "viscous": 0.0, "stiffness": 0.0}, **given, **start.values}
    coulomb = start.values.get("coulomb", 0.0)
    push = start.values.get("disturbance", 0.0)
    values["coulomb_forward"] = given.get("coulomb_forward", coulomb - push)
    values["coulomb_backward"] = given.get("coulomb_backward", coulomb + push)
    values["drive_lag"] = given.get("drive_lag", 0.0)
    if options.drive_lag and not values["drive_lag"] > 0.0:
        values["drive_lag"] = max(0.5 * values["delay"], 0.5 * sample_time)
        values["delay"] = max(values["delay"] - values["drive_lag"], 0.0)
    values |= {name: value for name, value in given.items() if name != "delay"}
    return np.array([values[name] for name in MODEL_PARAMETERS])


def _judged(
    theta: Rows, names: list[str], drive: Drive, pieces: Pieces, record: Record,
    given: dict[str, float], options: _Options,
) -> tuple[Rows, list[str], Separability]:  # fmt: skip
    """Return where to start, which parameters to look for, and which of these are told apart.

    A delay that is not told apart is what it was assumed to be; a lag of the drive likewise.
    """
    theta = theta.copy()
    corner = min(2.0 * CUTOFF_SHARE, 0.9)
    while True:
        products = gram(theta, drive, pieces, record.sample_time, corner)
        where = [MODEL_PARAMETERS.index(name) for name in names]
        judged = separate(
            products[np.ix_(where, where)], tuple(names), np.zeros(len(names)), options.limit
        )
        loose = [n for n in ("drive_lag", "delay") if n in judged.inseparable]
        if not loose:
            return theta, names, judged
        names = [name for name in names if name != loose[0]]
        theta[MODEL_PARAMETERS.index(loose[0])] = given.get(loose[0], 0.0)


def _plausible(refined: Refined, theta: Rows, names: list[str], start: Start) -> bool:
    """Return whether the refinement went on from the start, and not astray."""
    spread = np.sqrt(np.maximum(np.diagonal(refined.covariance), 0.0))
    at = [MODEL_PARAMETERS.index(name) for name in names]
    if not (refined.converged and np.isfinite(refined.theta).all() and np.isfinite(spread).all()):
        return False
    if "mass" not in names:
        return True
    first, deviation = float(theta[0]), start.deviations.get("mass", 0.0)
    wide = float(spread[at.index(0)])
    ratio = float(refined.theta[0]) / first
    return wide < max(ASTRAY * deviation, 0.5 * abs(first)) and 0.2 < ratio < 5.0


class _Found(NamedTuple):
    """What one axis gave, on the way to its model."""

    record: Record
    k: int
    signals: Signals
    units: dict[str, str]
    options: _Options
    start: Start | None = None
    held: dict[str, float] | None = None
    judged: Separability | None = None
    refined: Refined | None = None
    names: tuple[str, ...] = ()
    pieces: Pieces | None = None
    given: dict[str, float] | None = None
    excited: bool = True
    astray: bool = False

    def model(self) -> AxisModel:
        """Return the model of the axis."""
        record, k, signals = self.record, self.k, self.signals
        n = len(record.time)
        none = np.full(n, np.nan)
        refined, judged = self.refined, self.judged
        names = [name for name in MODEL_PARAMETERS if name != "drive_lag" or self.options.drive_lag]
        quantile = float(student.ppf(0.5 + 0.5 * self.options.confidence, signals.cosines))
        from_start = self._of_start(names, quantile)
        parameters = {name: self._parameter(name, np.nan, np.nan) for name in names}
        if refined is not None and judged is not None:
            spread = np.sqrt(np.diagonal(refined.covariance))
            for name, deviation in zip(self.names, spread, strict=True):
                if name not in judged.inseparable:
                    value = float(refined.theta[MODEL_PARAMETERS.index(name)])
                    parameters[name] = self._parameter(name, value, quantile * float(deviation))
        elif self.start is not None:
            parameters = dict(from_start)
        for name, value in (self.given or {}).items():
            if name in parameters:
                parameters[name] = Parameter(
                    value=value, low=value, high=value, unit=self.units[name], known=True
                )
        unexcited = judged.unexcited if judged is not None else ()
        if not self.excited:
            unexcited = ("mass",)
        method = "none" if self.start is None else "least squares"
        if refined is not None:
            method = "simulation error"
        square = float(np.sum(signals.weight * signals.regressor[:, 0] ** 2))
        square /= max(float(signals.weight.sum()), 1.0)
        ratio = 1.0 - signals.noise[0, 0] / square if square > 0.0 else np.nan
        moved = record.measured if record.reference is None else record.reference
        velocity = smooth_velocity(moved[:, k], record.sample_time)
        rate = smooth_velocity(velocity, record.sample_time)
        counted = float(signals.weight.sum()) * record.sample_time
        if self.pieces is not None:
            counted = float(self.pieces.counts.sum()) * record.sample_time
        residual = none if refined is None else refined.residual
        there = np.isfinite(residual)
        return AxisModel(
            axis=record.names[k], method=method, parameters=parameters, least_squares=from_start,
            astray=self.astray,
            covariance=np.zeros((0, 0)) if refined is None else refined.covariance,
            free=self.names, unexcited=unexcited,
            inseparable=() if judged is None else judged.inseparable, degrees=signals.cosines,
            minimum_speed=signals.minimum_speed, speed=float(np.abs(velocity).max()),
            acceleration=float(np.abs(rate).max()), counted=counted,
            encoder_noise=signals.position_noise, noise_ratio=float(max(ratio, 0.0)),
            residual_rms=float(np.sqrt(np.mean(residual[there] ** 2))) if there.any() else np.nan,
            corner_hz=np.nan if refined is None else 0.5 * refined.corner / record.sample_time,
            correlation=np.nan if refined is None else _correlation(refined.whitened),
            time=record.time, measured=record.measured[:, k],
            simulated=none if refined is None else refined.simulated, residual=residual,
        )  # fmt: skip

    def _parameter(self, name: str, value: float, half: float) -> Parameter:
        return Parameter(value=value, low=value - half, high=value + half, unit=self.units[name])

    def _of_start(self, names: list[str], quantile: float) -> dict[str, Parameter]:
        found = {name: self._parameter(name, np.nan, np.nan) for name in names}
        if self.start is None:
            return found
        values, spread = self.start.values, self.start.deviations
        for name in ("mass", "viscous", "stiffness", "delay"):
            if name in spread:
                found[name] = self._parameter(name, values[name], quantile * spread[name])
        if "coulomb" in spread and "disturbance" in spread:
            # the sum of two that are hardly correlated where a motion goes both ways
            half = quantile * float(np.hypot(spread["coulomb"], spread["disturbance"]))
            for way, sign in (("forward", -1.0), ("backward", 1.0)):
                value = values["coulomb"] + sign * values["disturbance"]
                found[f"coulomb_{way}"] = self._parameter(f"coulomb_{way}", value, half)
        return found


def _correlation(whitened: Rows) -> float:
    x = whitened[np.isfinite(whitened)]
    if len(x) < 200 or not np.any(x):
        return float("nan")
    x = x - x.mean()
    square = float(x @ x)
    return max(abs(float(x[late:] @ x[:-late])) / square for late in range(1, 51))
