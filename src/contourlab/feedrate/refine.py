"""A faster motion for the stretches on which curvature or changing feeds hold the first plan back.

The first plan (:mod:`contourlab.feedrate.motion`) keeps the limits by bounds and gives time away
where the path curves. Here each such stretch is taken as a smooth motion over a time of its own,
and the fastest pace along it is found (:mod:`contourlab.feedrate.interior_point`); once more with
the result as the own motion, so that its intervals are even in real time. Last, the limits are
checked on a grid several times finer than the collocation, with the rise between its points that
second differences allow, and each stretch is slowed by what it exceeds. A stretch that did not
become faster keeps its first plan.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.feedrate.arc_length import ArcLength
from contourlab.feedrate.collocation import Geometry, Stretch, graded_times
from contourlab.feedrate.interior_point import Collocation, fastest_pace
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.motion import Motion
from contourlab.feedrate.refined import OwnMotion, RefinedProfile
from contourlab.feedrate.retiming import Retiming

__all__ = ["MOST_INTERVALS", "refine"]

Values = NDArray[Any]

MOST_INTERVALS = 400_000
"""Intervals over all stretches; stretches beyond keep their first plan."""
_WORTH = 1.01
_PER_CURVE = 6.0
"""Intervals, at least, in each curved piece of the path,"""
_SHORTEST = 0.5
"""but none shorter than this many samples for the sake of that."""
_FEWEST = 64
_ROUGHLY, _CLOSELY = 1e-2, 5e-4
_KNOT = 2
"""Intervals of the pace to a piece of the own motion."""
_PLACES = np.array([0.0, 0.5, 1.0])
_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
_FINE = np.arange(9) / 8.0
_RISE = 0.25
"""Between points h apart a function of bend M rises by up to M h²/8; twice that is allowed."""
_CLOSE = 1e-6
"""No bend is taken from points this much closer on one side than on the other: rounding."""
_GAP = 1.0
"""Own time between stretches [s]; none is there, so that no stretch reads another's pieces."""


def refine(
    motion: Motion,
    contour: Contour,
    table: ArcLength,
    limits: AxisLimits,
    sample_time: float,
    roughly: bool = False,
) -> Motion:
    """Return the motion with a faster profile.

    Parameters
    ----------
    motion
        The first plan.
    contour, table
        The contour and its arc length.
    limits
        One number per axis.
    sample_time
        Time between samples [s].
    roughly
        Whether one round is enough: a percent or two slower.
    """
    took = motion.arrives - motion.begins
    longest, shortest = _longest(limits, sample_time), _SHORTEST * sample_time
    geometry = Geometry(motion, contour, table, limits)
    stretches: list[Stretch] = []
    left, room = 0, MOST_INTERVALS
    for k in np.flatnonzero(_worth(motion, limits)).tolist():
        begin, arrive = motion.begins[k], motion.arrives[k]
        edges = _pieces(motion, k)
        if took[k] / longest + _PER_CURVE * len(edges) > room:
            left += 1
            continue
        nodes = motion.profile.time_at(edges[1:-1]) - begin
        time = _grid(motion, k, np.concatenate([[0.0], nodes, [arrive - begin]]), longest, shortest)
        if len(time) > room:
            left += 1
            continue
        room -= len(time)
        arc = motion.profile.at(begin + time[::_KNOT])[0]
        stretches.append(_stretch(k, arc, edges, time))
    asked = len(stretches)
    stretches, paces = _fastest(geometry, stretches, _ROUGHLY)
    motion = replace(motion, left_as_planned=left + asked - len(stretches))
    again = [
        _anew(motion, stretch, pace, longest, shortest)
        for stretch, pace in zip(stretches, paces, strict=True)
        if not roughly
    ]
    again, faster = _fastest(geometry, again, _CLOSELY)
    best: dict[int, tuple[Stretch, Retiming]] = {}
    for stretch, pace in [*zip(stretches, paces, strict=True), *zip(again, faster, strict=True)]:
        least = float(took[stretch.number])
        if stretch.number in best:
            least = float(best[stretch.number][1].duration.sum())
        if pace.duration.sum() < least:
            best[stretch.number] = stretch, pace
    return _assembled(motion, [best[k] for k in sorted(best)]) if best else motion


def _worth(motion: Motion, limits: AxisLimits) -> Values:
    """Return which stretches could be noticeably faster, shape (n_stretches,).

    Not those that lose little more to a full speed everywhere than one start and one stop take.
    """
    n = len(motion.arrives)
    segments = motion.segments
    stretch = np.cumsum(motion.stop[:-1]) - 1
    slower = np.bincount(stretch, motion.speed < motion.programmed, n) > 0
    at_full_speed = np.bincount(stretch, np.diff(segments.edges) / motion.speed, n)
    most = np.zeros(n)
    np.maximum.at(most, stretch, motion.speed)
    acceleration = float(np.max(limits.acceleration))
    ramps = most / acceleration + acceleration / float(np.max(limits.jerk))
    took = motion.arrives - motion.begins
    several = np.bincount(stretch, minlength=n) > 1
    curved = np.bincount(stretch, segments.bend.max(axis=1) > 0.0, n) > 0
    return (curved | several) & (slower | (took > _WORTH * (at_full_speed + ramps)))


def _longest(limits: AxisLimits, sample_time: float) -> float:
    """Return the longest interval: a quarter of the time that acceleration needs to build up."""
    build_up = float(np.min(np.asarray(limits.acceleration) / np.asarray(limits.jerk)))
    return max(2.0 * sample_time, 0.25 * build_up)


def _pieces(motion: Motion, number: int) -> Values:
    """Return the arc lengths between which a stretch is of one piece, both ends included."""
    start, end = motion.stops[number], motion.stops[number + 1]
    edges = motion.segments.edges
    inside = motion.segments.joint & (edges > start) & (edges < end)
    return np.concatenate([[start], edges[inside], [end]])


def _grid(motion: Motion, number: int, nodes: Values, longest: float, shortest: float) -> Values:
    """Return the instants of a stretch between which its pace has one piece."""
    edges = _pieces(motion, number)
    segment = np.searchsorted(motion.segments.edges, edges[:-1], side="right") - 1
    curved = motion.segments.bend[segment].max(axis=1) > 0.0
    nodes = np.maximum.accumulate(nodes)
    own = np.maximum(np.diff(nodes) / _PER_CURVE, shortest)
    spacing = np.where(curved, own, np.inf)
    keep = np.append(True, np.diff(nodes) > 0.0)
    return graded_times(nodes[keep], spacing[keep[1:]], longest, _FEWEST)


def _stretch(number: int, arc: Values, edges: Values, time: Values) -> Stretch:
    """Return a stretch that reaches given arc lengths at every second of its knots."""
    arc[0], arc[-1] = edges[0], edges[-1]
    return Stretch(number, OwnMotion.through(time[::_KNOT], arc), time)


def _fastest(
    geometry: Geometry, stretches: list[Stretch], gap: float
) -> tuple[list[Stretch], list[Retiming]]:
    """Return the stretches that could be solved, and the fastest pace of each within the limits."""
    stretches = [stretch for stretch in stretches if stretch.moves_on()]
    if not stretches:
        return [], []
    x = fastest_pace(geometry.collocation(stretches, _PLACES, _WEIGHTS), gap)
    check = geometry.collocation(stretches, _FINE, np.ones(len(_FINE)))
    x = x / _exceeded(check, x)[check.coefficient_stretch]
    paces, at = [], 0
    for stretch in stretches:
        own = x[at : at + stretch.intervals + 2]
        paces.append(Retiming.of_spline(stretch.knots, own, 0.0))
        at += len(own)
    good = [bool(np.isfinite(pace.duration).all()) for pace in paces]
    return (
        [stretch for stretch, kept in zip(stretches, good, strict=True) if kept],
        [pace for pace, kept in zip(paces, good, strict=True) if kept],
    )


def _exceeded(check: Collocation, coefficient: Values) -> Values:
    """Return by how much c of each stretch must be divided, shape (n_stretches,)."""
    shares = check.shares(coefficient)
    step = np.diff(check.own_time)
    apart = (check.interval[1:] != check.interval[:-1]) | (check.piece[1:] != check.piece[:-1])
    step[apart] = 0.0
    before, after = step[:-1], step[1:]
    close = np.minimum(before, after) <= _CLOSE * np.maximum(before, after)
    before, after = (np.where(close, 1.0, h)[:, None] for h in (before, after))
    slope = np.diff(shares, axis=0)
    bend = np.zeros_like(shares)
    bend[1:-1] = 2.0 * np.abs(slope[1:] / after - slope[:-1] / before) / (before + after)
    bend[1:-1][close] = 0.0
    # between two points what either neighbour bends: the ends of an interval have no difference
    rise = _RISE * np.maximum(bend[1:], bend[:-1]) * step[:, None] ** 2
    bound = np.abs(shares)
    bound[:-1] += rise
    bound[1:] = np.maximum(bound[1:], np.abs(shares[1:]) + rise)
    worst = np.zeros(check.n_stretches)
    np.maximum.at(worst, check.stretch, check.mended_by(bound))
    return worst


def _anew(
    motion: Motion, stretch: Stretch, pace: Retiming, longest: float, shortest: float
) -> Stretch:
    """Return the stretch with the result as its own motion."""
    edges = _pieces(motion, stretch.number)
    end = float(pace.duration.sum())
    fine = np.interp(
        np.arange(8 * stretch.intervals + 1) / 8.0,
        np.arange(stretch.intervals + 1),
        np.append(pace.time, end),
    )
    arc = np.maximum.accumulate(stretch.own.at(pace.at(fine)[0])[0])
    nodes = np.concatenate([[0.0], np.interp(edges[1:-1], arc, fine), [end]])
    time = _grid(motion, stretch.number, nodes, longest, shortest)
    arc = stretch.own.at(pace.at(time[::_KNOT])[0])[0]
    return _stretch(stretch.number, arc, edges, time)


def _assembled(motion: Motion, best: list[tuple[Stretch, Retiming]]) -> Motion:
    n = len(motion.arrives)
    took = motion.arrives - motion.begins
    rest = np.append(motion.begins[1:], motion.profile.duration) - motion.arrives
    refined = np.zeros(n, bool)
    for stretch, pace in best:
        refined[stretch.number] = True
        took[stretch.number] = pace.duration.sum()
    ends = motion.begins[0] + np.cumsum(took + rest)
    begins = np.concatenate([motion.begins[:1], ends[:-1]])
    arrives = begins + took
    own, paces, offset = [], [], 0.0
    for stretch, pace in best:
        own.append(replace(stretch.own, start=stretch.own.start + offset))
        begin = begins[stretch.number]
        paces.append(replace(pace, start=pace.start + offset, time=pace.time + begin))
        offset += stretch.duration + _GAP
    pace = Retiming.join(paces)
    shift = begins - motion.begins
    kept = ~refined[_stretch_of(motion, motion.profile.time)]
    first_times = motion.profile.time[kept]
    first_times = first_times + shift[_stretch_of(motion, first_times)]
    time = np.unique(np.concatenate([first_times, pace.time, begins, arrives]))
    profile = RefinedProfile(
        time, np.empty(0), float(ends[-1]), motion.profile, begins, arrives, shift, motion.stops,
        refined, OwnMotion.join(own), pace,
    )  # fmt: skip
    arc = np.maximum.accumulate(profile.at(time)[0])
    return replace(motion, profile=replace(profile, arc=arc), begins=begins, arrives=arrives)


def _stretch_of(motion: Motion, time: Values) -> Values:
    found = np.searchsorted(motion.begins, time, side="right") - 1
    return np.clip(found, 0, len(motion.begins) - 1)
