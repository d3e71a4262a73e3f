"""One axis: where its parameters start, which of them the motion tells, and what simulation finds.

A delay and a lag of the drive that the motion does not tell apart from the rest are held at what
they are assumed to be; if the residual then says that this cannot be, the delay is looked for all
the same. Friction that changes at low speed (Stribeck's) is in no model here: where the residual
says that something is missing, and less is missing among faster rows, those alone count. A fit that
goes astray is not believed: then filtered least squares stand, or nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.least_squares import FilteredLeastSquares
from contourlab.identification.axis import identify_axis
from contourlab.identification.axis_model import Found, Options, units_of
from contourlab.identification.instrument import directions, driving_command, following_motion
from contourlab.identification.machine_result import AxisModel
from contourlab.identification.machine_words import sentences
from contourlab.identification.pieces import Pieces, cut_pieces, smooth_velocity
from contourlab.identification.record import COMMAND_UNITS, Record
from contourlab.identification.refinement import Drive, Refined, gram, misfit, refine
from contourlab.identification.result import AxisIdentification
from contourlab.identification.separability import Separability, separate
from contourlab.identification.signals import Signals
from contourlab.identification.simulated_response import MODEL_PARAMETERS
from contourlab.identification.start import Start, start_values
from contourlab.machines.base import per_axis

__all__ = ["fit_axis"]

JUDGED = 0.1
"""Corner of the filter up to which forces count when parameters are told apart, as a share of half
the sampling frequency."""
FEWEST_ROWS = 48
"""A piece may be as long as this, whatever the time [samples]."""
SPRING_SHARE = 5e-3
"""Share of the command from which a spring is believed..."""
SPRING_SURE = 5.0
"""...if its value is this many standard deviations..."""
SPRING_GAIN = 0.8
"""...and it leaves no more than this share of the residual."""
ASTRAY = 0.5
"""Standard deviation of the refined mass, as a share of it, from which it is not believed."""
TELLING = 2.0
"""Residual, over the noise of the encoder, from which a delay is looked for that the motion hardly
tells..."""
LESS = 0.7
"""...and believed if it leaves less than this share."""
# The next four were halved and doubled (or as far as they go) over simulated stages with friction
# 1.2 to 3 times as large at rest: Stribeck velocities 2 to 140 mm/s, peak 0.6, least 0.031 m/s.
# Up to a Stribeck velocity of 20 mm/s none of them acts: the residual does not tell.
FASTER = 2.0
"""Rows slower than this times as much are then left out too, again and again... Of √2 the search
ends where the residual just falls silent, with an error as large as the interval: of Stribeck
velocities of 30 and 50 mm/s 30 to 75 % of the intervals held, in place of 90 to 100 %. Of 4 it was
92 to 100 %, but at 100 mm/s 35 % in place of 62 % (with 0.6 of the rows below), as too much is left
out at once."""
MUCH_LESS = 0.5
"""...as long as no more than this share of the residual is left among those that remain... Of 0.9
nothing changed; of 0.25 some searches gave up: 85 % held in place of 90 %, at 30 mm/s."""
STILL_THERE = 0.3
"""...and this share of the rows. Of 0.6 nothing changed up to 70 mm/s; at 100 and 140 mm/s the
largest error was 1.1 to 8 % in place of 0.04 to 1 %. Of 0.9 nothing was refined at 50 mm/s: least
squares stood, with intervals 4 to 15 times as wide, which held the truth."""
WORSE = 3.0
"""A residual that is this many times that of the start, and more than noise, refines nothing. Of
1.5 nothing changed; of 6 some were believed that had gone astray, by up to 17 %: 75 % held."""
SINGULAR = 1e5
"""Condition beyond which a parameter is left out instead of solved for."""
STILL = 1e-6
"""Acceleration of a motion, relative to speed times cut-off, below which it is none."""
Rows = NDArray[Any]


def fit_axis(
    record: Record, k: int, signals: Signals, spring: tuple[Rows, Rows],
    law: FilteredLeastSquares, instrument: str, options: Options,
) -> tuple[AxisModel, list[str]]:  # fmt: skip
    """Return the model of one axis, and what to say of it.

    Parameters
    ----------
    record
        As it was read.
    k
        Which axis.
    signals
        Its filtered signals.
    spring
        H q measured and of the instrument, each shape (n_samples,).
    law
        Filter and smooth sign.
    instrument
        ``reference`` or ``none``.
    options
        Of ``identify_machine``.
    """
    given = {name: float(row[k]) for name, row in options.given.items()}
    units = units_of(record.kind)
    empty = Found(record, k, signals, units, options)
    if not signals.weight.any():
        return empty.model(), sentences(empty.model(), record, options.confidence)

    def plain() -> AxisIdentification | None:
        if record.kind not in COMMAND_UNITS:
            return None  # a position loop has a spring, which only the start knows
        cutoff = 2.0 * np.pi * np.asarray(per_axis("cutoff_hz", law.cutoff_hz, len(record.names)))
        return identify_axis(
            record, k, signals, instrument=instrument, given=np.full(4, np.nan),
            confidence=options.confidence, limit=options.limit, cutoff=float(cutoff[k]),
        )[0]  # fmt: skip

    start, held = _start(record, signals, spring, given, options)
    excited = _motion_excites(signals, instrument, law, record.sample_time)
    theta = _theta(start, given, options, record.sample_time)
    names = [name for name in MODEL_PARAMETERS if name not in given and name not in held]
    if not options.drive_lag:
        names = [name for name in names if name != "drive_lag"]
    velocity = smooth_velocity(record.measured[:, k], record.sample_time)
    longest = max(FEWEST_ROWS, round(options.piece_time / record.sample_time))
    margin = round(max(theta[5], 0.0) / record.sample_time) + 2

    def cut(speed: float) -> Pieces | None:
        return cut_pieces(velocity, speed, longest=longest, margin=margin)

    speed = signals.minimum_speed
    pieces = cut(speed)
    if not theta[0] > 0.0:  # a start that says nothing: as if all of the command went into it
        size = [np.sqrt(np.mean(x[signals.weight > 0.0] ** 2)) for x in
                (signals.wanted, signals.regressor[:, 0])]  # fmt: skip
        theta[0] = float(size[0] / size[1]) if size[1] > 0.0 else 1.0
    if pieces is None or not excited:
        found = empty._replace(start=start, held=held, plain=plain())
        return found.model(), sentences(found.model(), record, options.confidence)
    ahead, back = directions(velocity, law, k)
    measured = Drive(record.acting[:, k], ahead, back, record.measured[:, k])
    noiseless, motion = None, None
    if instrument == "reference" and record.reference is not None:
        motion = following_motion(record.reference[:, k], record.measured[:, k], record.sample_time)
        noiseless = driving_command(theta, motion, law, k, record.sample_time)
    theta, names, judged = _judged(
        theta, names, noiseless or measured, pieces, record, given, options
    )
    refined, astray = None, False
    if options.simulate:
        names = [name for name in names if name not in judged.unexcited]
        names = _solvable(theta, names, judged, noiseless or measured, pieces, record)

        def find(rows: Pieces, some: list[str]) -> tuple[Refined | None, list[str]]:
            def attempt(some: list[str], rough: bool) -> Refined | None:
                return _refined(theta, some, measured, motion, law, k, rows, record, signals, rough)

            best = attempt(some, False) or attempt(some, True)
            if "delay" in [*some, *given] or (best is not None and not _telling(best, signals)):
                return best, some
            # what the motion hardly tells by itself, a residual may tell beyond doubt
            late = attempt([*some, "delay"], False)
            if late is not None and (best is None or _misfit(late) < LESS * _misfit(best)):
                return late, [*some, "delay"]
            return best, some

        refined, names = find(pieces, names)
        least, tried = STILL_THERE * pieces.counts.sum(), speed
        while refined is None or _telling(refined, signals):
            tried *= FASTER
            rows = cut(tried)
            if rows is None or rows.counts.sum() < least:
                break
            better, more = find(rows, names)
            if refined is not None and (
                better is None or _misfit(better) > MUCH_LESS * _misfit(refined)
            ):
                break
            if better is not None:
                refined, names, pieces, speed = better, more, rows, tried
        astray = refined is None
        if refined is not None:  # with the values found, are they told apart?
            theta = refined.theta
            if motion is not None:
                noiseless = driving_command(theta, motion, law, k, record.sample_time)
            _, still, again = _judged(
                theta, names, noiseless or measured, pieces, record, given, options
            )
            lost = tuple(name for name in names if name not in still and name != "delay")
            judged = again._replace(
                unexcited=judged.unexcited, inseparable=(*lost, *again.inseparable)
            )
    found = empty._replace(
        plain=plain() if refined is None else None,
        start=start, held=held, judged=judged, refined=refined, names=tuple(names), pieces=pieces,
        given=given, astray=astray, speed=speed,
    )  # fmt: skip
    model = found.model()
    said = sentences(model, record, options.confidence)
    if speed > signals.minimum_speed:
        said.append(
            f"only motion faster than {speed:.3g} m/s counts: slower, the model misses more, as "
            "where friction rises at low speed (Stribeck), which two terms do not describe"
        )
    return model, said


def _start(
    record: Record, signals: Signals, spring: tuple[Rows, Rows], given: dict[str, float],
    options: Options,
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
        value = start.values.get("stiffness", 0.0)
        spread = start.deviations.get("stiffness", np.inf)
        effort = abs(value) * float(np.std(spring[0][signals.weight > 0.0]))
        command = float(np.sqrt(np.average(signals.wanted**2, weights=signals.weight)))
        sure = abs(value) > SPRING_SURE * spread and effort > SPRING_SHARE * command
        sure = sure and start.condition < options.limit
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


def _theta(start: Start, given: dict[str, float], options: Options, sample_time: float) -> Rows:
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
    given: dict[str, float], options: Options,
) -> tuple[Rows, list[str], Separability]:  # fmt: skip
    """Return where to start, which parameters to look for, and which of these are told apart.

    A delay that is not told apart is what it was assumed to be; a lag of the drive likewise.
    """
    theta = theta.copy()
    while True:
        products = gram(theta, drive, pieces, record.sample_time, JUDGED)
        where = [MODEL_PARAMETERS.index(name) for name in names]
        judged = separate(
            products[np.ix_(where, where)], tuple(names), np.zeros(len(names)), options.limit
        )
        loose = [n for n in ("drive_lag", "delay") if n in judged.inseparable]
        if not loose:
            return theta, names, judged
        names = [name for name in names if name != loose[0]]
        theta[MODEL_PARAMETERS.index(loose[0])] = given.get(loose[0], 0.0)


def _refined(
    theta: Rows, names: list[str], measured: Drive, motion: Rows | None,
    law: FilteredLeastSquares, k: int, pieces: Pieces, record: Record, signals: Signals,
    rough: bool,
) -> Refined | None:  # fmt: skip
    """Return what the simulated response gives, None if it went astray.

    Twice: the command of the instrument is that of the parameters found.
    """
    refined = None
    at_first = misfit(theta, measured, pieces, record.sample_time)
    for _ in range(1 if motion is None else 2):
        noiseless = None
        if motion is not None:
            noiseless = driving_command(theta, motion, law, k, record.sample_time)
        try:
            refined = refine(
                theta, tuple(names), measured, noiseless, pieces, record.sample_time,
                signals.cosines, rough,
            )  # fmt: skip
        except np.linalg.LinAlgError:  # on the way the model grew beyond all bounds
            return None
        if not _plausible(refined, names):
            return None
        theta = refined.theta
    if refined is not None and _telling(refined, signals):
        return None if _misfit(refined) > WORSE * at_first else refined
    return refined


def _telling(refined: Refined, signals: Signals) -> bool:
    """Return whether the residual says that something is missing."""
    return _misfit(refined) > TELLING * signals.position_noise


def _misfit(refined: Refined) -> float:
    return float(np.sqrt(np.nanmean(refined.residual**2)))


def _solvable(
    theta: Rows, names: list[str], judged: Separability, drive: Drive, pieces: Pieces,
    record: Record,
) -> list[str]:  # fmt: skip
    """Return the parameters to solve for.

    Of those that are truly one, all but one are left out: the one takes what they explain
    together, and the others' values do not change.
    """
    products = gram(theta, drive, pieces, record.sample_time, JUDGED)

    def condition(some: list[str]) -> float:
        at = [MODEL_PARAMETERS.index(name) for name in some]
        part = products[np.ix_(at, at)]
        size = np.sqrt(np.diagonal(part))
        return float(np.sqrt(np.linalg.cond(part / np.outer(size, size))))

    while len(names) > 1 and condition(names) > SINGULAR:
        doubtful = [name for name in names if name in judged.inseparable] or names
        names.remove(min(doubtful, key=lambda n: condition([x for x in names if x != n])))
    return names


def _plausible(refined: Refined, names: list[str]) -> bool:
    """Return whether the refinement found something, and did not go astray."""
    spread = np.sqrt(np.maximum(np.diagonal(refined.covariance), 0.0))
    at = [MODEL_PARAMETERS.index(name) for name in names]
    if not (refined.converged and np.isfinite(refined.theta).all() and np.isfinite(spread).all()):
        return False
    if "mass" not in names:
        return True
    wide = float(spread[at.index(0)])
    mass = float(refined.theta[0])
    return mass > 0.0 and wide < ASTRAY * mass
