"""What is not linear in the tracking error of an axis, searched for: poles, sticking, play.

The poles of the loop are fitted with everything that is linear solved anew at each step (variable
projection). They tell how the axis would move without friction; moving it with friction tells where
it sticks and reverses; and that tells the poles again. A few rounds are enough. The order of the
loop, friction that is higher at rest and presliding count only if they explain more than chance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from contourlab.evaluation.causes.basis import Stage
from contourlab.evaluation.causes.linear import Groups, independent_samples, solve, thinned
from contourlab.evaluation.causes.response import (
    bounds_of,
    denominator,
    lags_of,
    peaks_of,
    richer,
    start_of,
)
from contourlab.evaluation.causes.reversals import direction, lost_motion, turning_points
from contourlab.evaluation.causes.sticking import RESTS, Sliding, slide

__all__ = ["Shape", "search"]

SCAN_ROWS = 3_000
"""Rows, taken evenly, by which shapes are judged: a search of a long log takes no longer."""
WINDOW_ROWS = 30_000
"""Rows of a long record in which the shape is looked for."""
RATES = 9
"""Rates at which a loop's poles are first tried."""
ROUNDS = 5
"""Rounds of moving the axis and fitting the loop, at most: a search that goes to and fro ends."""
ENOUGH = 0.9
"""A round that leaves more than this share of what the one before left is the last."""
BEFORES = (0.0, 1.0, -1.0)
"""Sides on which an axis may rest at first."""
BETTER = 12.0
"""F above which a further parameter counts."""
DISTANCES = (2e-6, 8e-6, 25e-6)
"""Presliding distances that are tried first [m]: rolling guides have some tens of micrometres."""
CREEPS = (1e-4, 1e-3)
"""Speeds of creeping that are tried first [m/s]."""
RISES = ((0.3, 2e-3), (0.3, 1e-2), (0.8, 2e-3), (0.8, 1e-2))
"""Rises of friction at rest and their speeds [m/s] that are tried first."""
CLEARLY = 2.0
"""Lost motion is ruled out if it leaves more than this many times the square that steady friction
does: both change over at a reversal, and rounding lets either fit a little better."""
GRID = 0.25
"""Of two grid steps: rounding of commanded and actual position leaves √(2 / 12) of a step."""
NOTHING = 1e-5
"""Share of the error of an axis that is not looked into."""
FACTOR = 1.5
"""By which what was found is changed to see whether that is better."""

Values = NDArray[Any]


class Shape(NamedTuple):
    """What is not linear in the fit of an axis."""

    kind: str
    """Poles of the loop, one of :data:`~.response.ORDERS`."""
    poles: Values
    denominator: Values
    """D."""
    how: Sliding
    """How friction sets in."""
    play: float
    """Width of the play [m]."""
    before: float
    """Side of the play while an axis rests at first, in units of that of its first motion."""
    free: Values
    """Position without friction and play [m]."""
    side: Values
    """Of friction."""
    lost: Values
    """Side of the play."""
    moved: Values
    """Position of the motor: without the causes behind it [m]."""
    steady: bool
    """Whether friction leaves an offset: then what is lost at a reversal is not play."""


class _Search:
    def __init__(self, stage: Stage, rows: Values, extra: Groups, target: Values, steady: bool):
        self.stage, self.extra, self.target = stage, extra, target
        self.steady, self.plays = steady, not steady
        self.rows = thinned(rows if len(rows) > 50 else np.arange(len(target)), SCAN_ROWS)
        self.offset = {"offset": np.ones((len(target), 1))}
        self.how, self.play, self.before = Sliding(), 0.0, 0.0
        self.kind, self.poles = "pair and pole", np.zeros(3)
        self.side = self.lost = self.free = np.zeros(len(target))

    def groups(self, kind: str, poles: Values, side: Values, lost: Values) -> Groups:
        d = denominator(kind, poles, self.stage.sample_time)
        found = {**self.offset, "lag": lags_of(self.stage, d),
                 "peaks": self.peaks(side, d), **self.extra}  # fmt: skip
        return found | ({"sides": lost[:, None]} if self.plays else {})

    def peaks(self, side: Values, d: Values) -> Values:
        columns = peaks_of(self.stage, side, d, 1)
        return columns if self.steady else columns[:, :1]

    def left(self, kind: str, poles: Values) -> float:
        return solve(self.groups(kind, poles, self.side, self.lost), self.target, self.rows)[1]

    def fitted(self, kind: str, poles: Values) -> tuple[Values, float]:
        """Return the poles that leave least, and what they leave."""
        low, high = bounds_of(kind, self.stage.sample_time)
        start = np.clip(poles, low + 1e-6, high - 1e-6)
        scale = max(np.sqrt(self.left(kind, start) / len(self.rows)), 1e-300)

        def residual(x: Values) -> Values:
            groups = self.groups(kind, x, self.side, self.lost)
            found, _ = solve(groups, self.target, self.rows)
            left: Values = self.target[self.rows] / scale
            for name in groups:
                left -= groups[name][self.rows] @ found[name] / scale
            return left

        answer = least_squares(residual, start, bounds=(low, high), diff_step=1e-3, xtol=1e-3,
                               ftol=1e-4, max_nfev=20)  # fmt: skip
        return answer.x, float(2.0 * answer.cost) * scale**2

    def begin(self) -> None:
        """Set the first poles, and sides as they are without sticking."""
        stage = self.stage
        slowest = min(max(5.0, 0.005 / stage.sample_time), 0.04 / stage.sample_time)
        rates = np.geomspace(slowest, 0.4 / stage.sample_time, RATES)
        best = np.inf
        for rate in rates:
            poles = start_of(self.kind, rate)
            groups = {**self.offset, "lag": lags_of(stage, self._d(poles)), **self.extra}
            found, _ = solve(groups, self.target, self.rows)
            free = stage.commanded - groups["lag"] @ found["lag"]
            side = sides(stage, free, 0.0, 0.0)
            groups = self.groups(self.kind, poles, side, side)
            left = solve(groups, self.target, self.rows)[1]
            if left < best:
                best, self.poles, self.side, self.lost, self.free = left, poles, side, side, free

    def _d(self, poles: Values) -> Values:
        return denominator(self.kind, poles, self.stage.sample_time)

    def move(self, hows: list[Sliding], befores: tuple[float, ...],
             *, anyway: bool = False) -> float:  # fmt: skip
        """Move the axis in several ways, keep the one that explains most; return what it leaves."""
        stage, d = self.stage, self._d(self.poles)
        groups = self.groups(self.kind, self.poles, self.side, self.lost)
        found, best = solve(groups, self.target, self.rows)
        self.free = stage.commanded - groups["lag"] @ found["lag"]
        if self.plays:
            self.play = 2.0 * max(float(found["sides"][0]), 0.0)
        kept = (np.inf, self.how, self.before, self.side, self.lost)
        for how in hows:
            slid: Values | None = np.zeros_like(self.side)
            if not how.none:
                slid = slide(stage, self.free, d, self.two(found["peaks"]), how)
            side = self.side if slid is None else slid
            moved = self.free - self.peaks(side, d) @ found["peaks"]
            for before in befores if self.plays else (0.0,):
                lost = sides(stage, moved, self.play, before) if self.plays else side
                left = solve(
                    self.groups(self.kind, self.poles, side, lost), self.target, self.rows
                )[1]
                if left < kept[0]:
                    kept = (left, how, before, side, lost)
        if anyway or kept[0] <= best:
            best, self.how, self.before, self.side, self.lost = kept
        return best

    def explained(self, left: float) -> bool:
        """Return whether what is left is no more than the grid makes, or next to nothing."""
        size = float(np.std(self.target[self.rows]))
        return bool(np.sqrt(left / len(self.rows)) <= GRID * self.stage.least + NOTHING * size)

    def simplify(self, left: float) -> float:
        """Drop what explains no more than chance of how friction sets in; return what is left."""
        for simpler, parameters in _simpler(self.how):
            start = (self.poles, self.how, self.before, self.side, self.lost)
            self.move([simpler], (self.before,), anyway=True)
            self.poles, less = self.fitted(self.kind, self.poles)
            if (less - left) * self.freedom() / max(left, 1e-300) / parameters < BETTER:
                left = less
            else:
                self.poles, self.how, self.before, self.side, self.lost = start
        return left

    def best_of(self, kinds: tuple[list[Sliding], ...]) -> float:
        """Try each kind of friction with poles of its own, keep the best; return what it leaves."""
        start = (self.poles, self.how, self.before, self.side, self.lost)
        best, kept = self.left(self.kind, self.poles), start
        for hows in kinds:
            self.poles, self.how, self.before, self.side, self.lost = start
            self.move(hows, (self.before,), anyway=True)
            self.poles, left = self.fitted(self.kind, self.poles)
            if left < best:
                best, kept = left, (self.poles, self.how, self.before, self.side, self.lost)
        self.poles, self.how, self.before, self.side, self.lost = kept
        return best

    def without_friction(self) -> None:
        """Try play alone, and keep it if friction explains no more."""
        start = (self.poles, self.how, self.before, self.side, self.lost)
        left = self.left(self.kind, self.poles)
        self.side = np.zeros_like(self.side)
        for _ in range(3):
            self.poles, less = self.fitted(self.kind, self.poles)
            self.move([self.how._replace(none=True)], BEFORES, anyway=True)
        less = self.left(self.kind, self.poles)
        if (less - left) * self.freedom() / max(left, 1e-300) / 3.0 > BETTER:
            self.poles, self.how, self.before, self.side, self.lost = start

    def two(self, peaks: Values) -> Values:
        return peaks if self.steady else np.append(peaks, 0.0)

    def freedom(self) -> float:
        """Return how many independent samples the residual amounts to."""
        groups = self.groups(self.kind, self.poles, self.side, self.lost)
        found, _ = solve(groups, self.target, self.rows)
        made = sum(groups[name][self.rows] @ found[name] for name in groups)
        return independent_samples(self.target[self.rows] - made)


def search(
    stage: Stage, rows: Values, extra: Groups, target: Values, *, play: bool,
    start: Shape | None = None,
) -> Shape:  # fmt: skip
    """Return the shape of an axis' error.

    Where the sensor sees lost motion, what is lost at a reversal may be play, or the steady
    friction of a loop without integral action, which builds up as the loop answers: play, unless it
    leaves more than ``CLEARLY`` times what steady friction does.

    Parameters
    ----------
    stage
        The axis.
    rows
        Which rows count.
    extra
        Further groups of columns.
    target
        What is to be explained [m].
    play
        Whether the sensor sees lost motion.
    start
        A shape that was found when other causes were not known yet, such as a vibration; found
        from nothing if None.
    """
    part, inside = _window(stage)
    own = rows[(rows >= inside.start) & (rows < inside.stop)] - inside.start
    groups = {name: columns[inside] for name, columns in extra.items()}
    if start is not None:
        found = _Search(part, own, groups, target[inside], steady=start.steady)
        found.kind, found.poles, found.how = start.kind, start.poles, start.how
        found.play, found.before = start.play, start.before
        found.side, found.lost = start.side[inside], start.lost[inside]
        _rounds(found)
        return _over_whole(stage, found)
    found = _Search(part, own, groups, target[inside], steady=not play)
    left = _searched(found)
    if play and found.play > 0.0:
        other = _Search(part, own, groups, target[inside], steady=True)
        if _quickly(other, found) < left and CLEARLY * _searched(other) < left:
            found = other
    return _over_whole(stage, found)


def _quickly(other: _Search, found: _Search) -> float:
    """Return what steady friction leaves, from the poles that were found with play."""
    other.kind, other.poles, other.how = found.kind, found.poles, found.how._replace(none=False)
    other.side = other.lost = sides(other.stage, found.free, 0.0, other.how.before)
    for _ in range(2):
        other.poles, left = other.fitted(other.kind, other.poles)
        other.move([other.how, *(other.how._replace(creep=one) for one in CREEPS)], (0.0,))
    return min(left, other.left(other.kind, other.poles))


def _searched(found: _Search) -> float:
    """Let a search run; return what it leaves."""
    found.begin()
    found.poles, left = found.fitted(found.kind, found.poles)
    if found.explained(left):
        return left
    found.move([Sliding(before=one) for one in BEFORES], BEFORES)
    plain = Sliding(before=found.how.before)
    kinds = (
        [plain],
        [plain._replace(distance=one) for one in DISTANCES],
        [plain._replace(creep=one) for one in CREEPS],
        [plain._replace(rise=a, speed=v) for a, v in RISES],
    )
    left = found.best_of(kinds)
    if found.explained(left):
        return found.simplify(left)
    if found.plays:
        found.without_friction()
    both = [found.how]
    if found.how.distance or found.how.creep:
        both += [found.how._replace(rise=a, speed=v) for a, v in RISES]
    if found.how.rise:
        both += [found.how._replace(distance=one) for one in DISTANCES]
        both += [found.how._replace(creep=one) for one in CREEPS]
    found.move(both, (found.before,))
    found.poles, _ = found.fitted(found.kind, found.poles)
    return _rounds(found)


def _rounds(found: _Search) -> float:
    """Let poles and motion tell each other until that is no better; return what is left."""
    left = np.inf
    for _ in range(ROUNDS):
        others = [found.how._replace(before=one) for one in BEFORES if one != found.how.before]
        found.move([*_near(found.how), *others], BEFORES)
        before, left = left, 0.0
        found.poles, left = found.fitted(found.kind, found.poles)
        near = _near(found.how)
        if len(near) > 1:  # poles may make up for what is not right here: with poles of their own
            left = found.best_of(tuple([one] for one in near))
        if left > ENOUGH * before or found.explained(left):
            break
    left = found.simplify(left)
    while (more := richer(found.kind, found.poles)) is not None and not found.explained(left):
        kind, start = more
        poles, less = found.fitted(kind, start)
        if (left - less) * found.freedom() / max(less, 1e-300) / 3.0 < BETTER:
            break
        found.kind, found.poles = kind, poles
        found.move(_near(found.how), (found.before,))
        found.poles, left = found.fitted(kind, found.poles)
    return found.move([found.how], (found.before,))


def _near(how: Sliding) -> list[Sliding]:
    """Return ways of sliding round one."""
    found = [how]
    if how.distance:
        found += [how._replace(distance=how.distance * f) for f in (FACTOR, 1.0 / FACTOR)]
    if how.creep:
        found += [how._replace(creep=how.creep * f) for f in (FACTOR, 1.0 / FACTOR)]
    if how.rise:
        found += [how._replace(rise=how.rise * f) for f in (FACTOR, 1.0 / FACTOR)]
        found += [how._replace(speed=how.speed * f) for f in (FACTOR, 1.0 / FACTOR)]
    return found


def _simpler(how: Sliding) -> list[tuple[Sliding, int]]:
    """Return ways of sliding with fewer parameters, and how many fewer."""
    found = []
    if how.rise:
        found.append((how._replace(rise=0.0, speed=1.0), 2))
    if how.distance or how.creep:
        found.append((how._replace(distance=0.0, creep=0.0), 1))
    return found


def _over_whole(stage: Stage, found: _Search) -> Shape:
    """Return the shape over the whole record, from that of a stretch."""
    d = denominator(found.kind, found.poles, stage.sample_time)
    groups = found.groups(found.kind, found.poles, found.side, found.lost)
    solution, _ = solve(groups, found.target, found.rows)
    peaks = found.two(solution["peaks"])
    free, side, lost = found.free, found.side, found.lost
    whole = len(free) != len(stage.commanded)
    if whole:
        free = stage.commanded - lags_of(stage, d) @ solution["lag"]
        slid = slide(stage, free, d, peaks, found.how)
        side = sides(stage, free, 0.0, found.how.before) if slid is None else slid
    moved = free - peaks_of(stage, side, d, 1) @ peaks
    if whole:
        lost = sides(stage, moved, found.play, found.before)
    return Shape(found.kind, found.poles, d, found.how, found.play, found.before, free, side, lost,
                 moved, found.steady)  # fmt: skip


def sides(stage: Stage, moved: Values, play: float, before: float) -> Values:
    """Return the side of the play of each row, or with no play the direction of motion.

    Parameters
    ----------
    stage
        The axis.
    moved
        Where the motor is: its reversals count [m].
    play
        Width of the play [m].
    before
        Side while an axis rests at first, in units of that of its first motion.
    """
    out = np.zeros(len(moved))
    for at in stage.parts:
        position = moved[at]
        rows, signs = turning_points(position, stage.least)
        left = np.flatnonzero(stage.commanded[at] != stage.commanded[at.start])
        rests = len(left) > 0 and left[0] > RESTS
        if play > 0.0:
            out[at] = lost_motion(position, rows, signs, play, signs[0] * before if rests else None)
            continue
        out[at] = direction(len(position), rows, signs)
        if rests:
            still = np.maximum.accumulate(np.abs(position - position[0])) <= stage.least
            out[at] = np.where(still, before * signs[0], out[at])
    return out


def _window(stage: Stage) -> tuple[Stage, slice]:
    """Return the stretch of a long record that tells most: the one with the most reversals."""
    n = len(stage.commanded)
    if n <= WINDOW_ROWS:
        return stage, slice(0, n)
    count = np.zeros(n)
    for at in stage.parts:
        count[at.start + turning_points(stage.commanded[at], stage.least)[0]] += 1.0
    moves = np.concatenate([[0.0], np.abs(np.diff(stage.commanded))])
    told = np.cumsum(count + 1e-3 * moves / max(float(moves.mean()), 1e-300))
    gain = told[WINDOW_ROWS:] - told[:-WINDOW_ROWS]
    start = int(gain.argmax())
    inside = slice(start, start + WINDOW_ROWS)
    parts = tuple(
        slice(max(at.start, start) - start, min(at.stop, inside.stop) - start)
        for at in stage.parts
        if at.stop > start and at.start < inside.stop
    )
    return stage._replace(
        commanded=stage.commanded[inside], error=stage.error[inside], parts=parts
    ), inside
