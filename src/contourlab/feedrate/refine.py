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
from contourlab.feedrate.collocation import Geometry, Stretch
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
_FEWEST = 64
_LONGEST = 0.01
"""Longest interval [s]."""
_ROUGHLY, _CLOSELY = 1e-3, 2e-5
_KNOT = 2
"""Intervals of the pace to a piece of the own motion."""
_PLACES = np.array([0.0, 0.5, 1.0])
_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
_FINE = np.arange(9) / 8.0
_RISE = 0.25
"""A quadratic rises by 1/8 of its second difference between two points; twice that is allowed."""
_GAP = 1.0
"""Own time between stretches [s]; none is there, so that no stretch reads another's pieces."""


def refine(
    motion: Motion, contour: Contour, table: ArcLength, limits: AxisLimits, sample_time: float
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
    """
    took = motion.arrives - motion.begins
    intervals = _intervals(motion, took, limits, sample_time)
    chosen = np.flatnonzero(_worth(motion, limits))
    few = np.cumsum(intervals[chosen]) <= MOST_INTERVALS
    motion = replace(motion, left_as_planned=int((~few).sum()))
    chosen = chosen[few]
    geometry = Geometry(motion, contour, table, limits)
    stretches = []
    for k in chosen.tolist():
        u = np.linspace(0.0, took[k], intervals[k] // _KNOT + 1)
        arc = motion.profile.at(motion.begins[k] + u)[0]
        arc[-1] = motion.stops[k + 1]
        stretches.append(Stretch(k, OwnMotion.through(u, arc), float(took[k]), int(intervals[k])))
    stretches, paces = _fastest(geometry, stretches, _ROUGHLY)
    evenly = [_evenly(stretch, pace) for stretch, pace in zip(stretches, paces, strict=True)]
    again, faster = _fastest(geometry, evenly, _CLOSELY)
    best: dict[int, tuple[Stretch, Retiming]] = {}
    for stretch, pace in [*zip(stretches, paces, strict=True), *zip(again, faster, strict=True)]:
        time = float(took[stretch.number])
        if stretch.number in best:
            time = float(best[stretch.number][1].duration.sum())
        if pace.duration.sum() < time:
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


def _intervals(motion: Motion, took: Values, limits: AxisLimits, sample_time: float) -> Values:
    """Return the intervals of each stretch: a quarter of the time that jerk needs to build up."""
    build_up = float(np.min(np.asarray(limits.acceleration) / np.asarray(limits.jerk)))
    h = min(_LONGEST, max(2.0 * sample_time, 0.25 * build_up))
    count = np.maximum(_FEWEST, np.ceil(took / h)).astype(int)
    return _KNOT * (-(-count // _KNOT))


def _fastest(
    geometry: Geometry, stretches: list[Stretch], barrier: float
) -> tuple[list[Stretch], list[Retiming]]:
    """Return the stretches that could be solved, and the fastest pace of each within the limits."""
    stretches = [stretch for stretch in stretches if stretch.moves_on()]
    if not stretches:
        return [], []
    x = fastest_pace(geometry.collocation(stretches, _PLACES, _WEIGHTS), barrier)
    check = geometry.collocation(stretches, _FINE, np.ones(len(_FINE)))
    x = x / _exceeded(check, x)[check.coefficient_stretch]
    paces, at = [], 0
    for stretch in stretches:
        own = x[at : at + stretch.intervals + 2]
        paces.append(Retiming.of_spline(0.0, stretch.h, own, 0.0))
        at += len(own)
    good = [bool(np.isfinite(pace.duration).all()) for pace in paces]
    return (
        [stretch for stretch, kept in zip(stretches, good, strict=True) if kept],
        [pace for pace, kept in zip(paces, good, strict=True) if kept],
    )


def _exceeded(check: Collocation, coefficient: Values) -> Values:
    """Return by how much c of each stretch must be divided, shape (n_stretches,)."""
    shares = check.shares(coefficient)
    bound = np.abs(shares)
    bend = np.abs(shares[2:] - 2.0 * shares[1:-1] + shares[:-2])
    same = (check.interval[2:] == check.interval[:-2]) & (check.piece[2:] == check.piece[:-2])
    bound[1:-1] += _RISE * np.where(same[:, None], bend, 0.0)
    worst = np.zeros(check.n_stretches)
    np.maximum.at(worst, check.stretch, check.mended_by(bound))
    return worst


def _evenly(stretch: Stretch, pace: Retiming) -> Stretch:
    """Return the stretch with the result as its own motion."""
    duration = float(pace.duration.sum())
    time = np.linspace(0.0, duration, stretch.intervals // _KNOT + 1)
    arc = stretch.own.at(pace.at(time)[0])[0]
    arc[0], arc[-1] = (float(stretch.own.at(np.array([u]))[0][0]) for u in (0.0, stretch.duration))
    return Stretch(stretch.number, OwnMotion.through(time, arc), duration, stretch.intervals)


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
