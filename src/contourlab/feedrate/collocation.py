"""The motion along a contour at the places where its limits are asked for.

A stretch has places in each interval of its pace, more near its ends, both sides of each joint of
the path, and a place between each two joints, so that no piece is missed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.path import Path
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives
from contourlab.feedrate.cells import limit_rise
from contourlab.feedrate.interior_point import Collocation
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.motion import Motion
from contourlab.feedrate.refined import OwnMotion
from contourlab.feedrate.retiming import spline_basis

__all__ = ["Geometry", "Stretch"]

Values = NDArray[Any]

_END_PLACES = np.concatenate([np.arange(1, 24) / 12.0, [0.02, 0.04]])
"""Further places from both ends, in intervals: there the pace changes most."""
_GRADING = 0.2
"""Intervals grow by no more than this share from one to the next."""
_LEAST_SPEED = 1e-9
"""Smallest speed of an own motion away from its ends, in units of its mean."""


def graded_times(nodes: Values, spacing: Values, longest: float, fewest: int) -> Values:
    """Return instants with small intervals where much happens, which grow evenly from there.

    Parameters
    ----------
    nodes
        Ascending instants between which the path is of one kind, from the start to the end [s].
    spacing
        Wanted intervals between consecutive ones, shape (n - 1,) [s].
    longest
        Longest interval anywhere [s].
    fewest
        Least count of intervals.
    """
    even = np.linspace(nodes[0], nodes[-1], int(np.ceil((nodes[-1] - nodes[0]) / longest)) + 1)
    grid = np.union1d(nodes, even)
    inside = np.searchsorted(nodes, 0.5 * (grid[1:] + grid[:-1]), side="right") - 1
    wanted = np.minimum(spacing[np.clip(inside, 0, len(spacing) - 1)], longest)
    at = np.minimum(np.append(wanted, longest), np.append(longest, wanted))
    rise = _GRADING * np.diff(grid)
    at = limit_rise(limit_rise(at, rise)[::-1], rise[::-1])[::-1]
    # the spacing being linear in between, intervals passed are a logarithm
    step = np.diff(grid)
    slope = np.diff(at) / step
    flat = np.abs(slope) * step < 1e-6 * at[:-1]
    slope = np.where(flat, 1.0, slope)
    within = np.where(flat, step / at[:-1], np.log1p(slope * step / at[:-1]) / slope)
    passed = np.concatenate([[0.0], np.cumsum(within)])
    count = max(fewest, 2 * int(np.ceil(0.5 * passed[-1])))
    wanted = np.linspace(0.0, passed[-1], count + 1)
    k = np.clip(np.searchsorted(passed, wanted, side="right") - 1, 0, len(step) - 1)
    into = wanted - passed[k]
    moved = np.where(flat[k], into * at[k], at[k] * np.expm1(slope[k] * into) / slope[k])
    times: Values = np.minimum(grid[k] + moved, grid[k + 1])
    times[-1] = grid[-1]
    return times


@dataclass(frozen=True, eq=False)
class Stretch:
    """From stop to stop, as a motion over a time of its own from 0."""

    number: int
    """Which stretch of the plan."""
    own: OwnMotion
    knots: Values
    """Own times between which the pace has one piece, from 0, shape (n + 1,) [s]."""

    @property
    def intervals(self) -> int:
        """Count of intervals of the pace."""
        return len(self.knots) - 1

    @property
    def duration(self) -> float:
        """Own time that it takes [s]."""
        return float(self.knots[-1])

    def fine(self, parts: int) -> Values:
        """Return the knots with so many parts in each interval.

        Parameters
        ----------
        parts
            Of an interval.
        """
        at = np.arange(parts * self.intervals + 1) / parts
        return np.interp(at, np.arange(self.intervals + 1), self.knots)

    def moves_on(self) -> bool:
        """Return whether the own motion goes forward everywhere between its ends."""
        speed = self.own.at(self.fine(8)[1:-1])[1]
        return bool((speed > 0.0).all() and (speed[16:-16] > _LEAST_SPEED * speed.mean()).all())


@dataclass(frozen=True, eq=False)
class Geometry:
    """A contour with its feeds and limits, as a plan goes along it."""

    motion: Motion
    contour: Contour
    table: ArcLength
    limits: AxisLimits

    def collocation(self, stretches: list[Stretch], places: Values, weights: Values) -> Collocation:
        """Return the points of some stretches, in the order of their own time.

        Parameters
        ----------
        stretches
            One or more, in order.
        places
            In each interval, ascending, 0 to 1.
        weights
            Of each place in the time of the interval.
        """
        rows = [self._points(stretch, places, weights) for stretch in stretches]
        count = np.array([len(row[0]) for row in rows])
        which = np.repeat(np.arange(len(rows)), count)
        own_time, interval, basis, weight, piece, place_of_joint = (
            np.concatenate(column, axis=-1) for column in zip(*rows, strict=True)
        )
        intervals = np.array([stretch.intervals for stretch in stretches])
        own = np.concatenate(
            [np.stack(s.own.at(row[0])) for s, row in zip(stretches, rows, strict=True)], axis=1
        )
        low, high = (
            np.array(ends)[which] for ends in zip(*map(self._pieces, stretches), strict=True)
        )
        first, second, third, piece = self._axes(own, piece, low, high)
        most = self._most(own, first, piece, place_of_joint)
        offset = np.cumsum(intervals + 2) - (intervals + 2)
        return Collocation(
            stretch=which,
            own_time=own_time,
            interval=offset[which] + interval,
            basis=basis,
            piece=piece,
            time_weight=weight,
            barrier_weight=(1.0 / count)[which],
            most=most,
            first=first,
            second=second,
            third=third,
            acceleration=np.asarray(self.limits.acceleration),
            jerk=np.asarray(self.limits.jerk),
            coefficient_stretch=np.repeat(np.arange(len(stretches)), intervals + 2),
        )

    def _points(self, stretch: Stretch, places: Values, weights: Values) -> tuple[Values, ...]:
        """Return own time, interval, basis, weight, piece (-1: by arc length) and edge (-1)."""
        n, knots = stretch.intervals, stretch.knots
        h = np.diff(knots)
        interval = np.repeat(np.arange(n), len(places))
        place = np.tile(places, n)
        joints = self._joints(stretch)
        at = self._own_time(stretch, self.motion.segments.edges[joints])
        left = self.motion.segments.piece[joints - 1]
        right = self.motion.segments.piece[joints]
        between = 0.5 * (at[1:] + at[:-1])
        ends = np.concatenate([_END_PLACES * h[0], knots[-1] - _END_PLACES * h[-1]])
        extra = np.concatenate([at, at, between, ends])
        extra_interval = np.clip(np.searchsorted(knots, extra, side="right") - 1, 0, n - 1)
        extra_place = np.clip((extra - knots[extra_interval]) / h[extra_interval], 0.0, 1.0)
        none = np.full(len(interval) + len(extra), -1)
        u = np.concatenate([knots[interval] + place * h[interval], extra])
        interval = np.concatenate([interval, extra_interval])
        place = np.concatenate([place, extra_place])
        m = len(u) - len(extra)
        columns = (
            u,
            interval,
            spline_basis(knots, interval, place),
            np.concatenate([np.tile(weights, n) * np.repeat(h, len(places)), 0.0 * extra])
            / knots[-1],
            np.concatenate([none[:m], left, right, right[:-1], none[: len(ends)]]),
            np.concatenate([none[:m], joints, joints, none[: len(between) + len(ends)]]),
        )
        order = np.argsort(u, kind="stable")
        return tuple(column[..., order] for column in columns)

    def _joints(self, stretch: Stretch) -> Values:
        """Return the edges of the segments that are joints inside the stretch."""
        segments, (start, end) = self.motion.segments, self._ends(stretch)
        inside = segments.joint & (segments.edges > start) & (segments.edges < end)
        return np.flatnonzero(inside)

    def _ends(self, stretch: Stretch) -> tuple[float, float]:
        stops = self.motion.stops
        return float(stops[stretch.number]), float(stops[stretch.number + 1])

    def _pieces(self, stretch: Stretch) -> tuple[int, int]:
        """Return the first and the last piece of a stretch."""
        segments, (start, end) = self.motion.segments, self._ends(stretch)
        edge = np.searchsorted(segments.edges, [start, end])
        return int(segments.piece[edge[0]]), int(segments.piece[edge[1] - 1])

    def _own_time(self, stretch: Stretch, arc: Values) -> Values:
        """Return the own time at which the stretch reaches some arc lengths inside it."""
        grid = stretch.fine(8)
        s = np.maximum.accumulate(stretch.own.at(grid)[0])
        k = np.clip(np.searchsorted(s, arc, side="right") - 1, 0, len(grid) - 2)
        low, high = grid[k], grid[k + 1]
        u = low + (high - low) * (arc - s[k]) / np.maximum(s[k + 1] - s[k], 1e-300)
        for _ in range(12):
            here, speed, _, _ = stretch.own.at(u)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.where(speed > 0.0, (here - arc) / speed, 0.0)
            u = np.clip(u - step, low, high)
        return np.asarray(u)

    def _axes(
        self, own: Values, piece: Values, low: Values, high: Values
    ) -> tuple[Values, Values, Values, Values]:
        """Return the derivatives of the axes over own time, and the piece of each point."""
        _, s1, s2, s3 = own[:, :, None]
        arc = np.clip(own[0], 0.0, self.table.length)
        if isinstance(self.contour, Path):
            breaks = np.asarray(self.contour.breaks, float)
            place = np.clip(breaks[0] + arc, breaks[0], breaks[-1])
            found = np.clip(np.searchsorted(breaks, place, side="right") - 1, 0, len(breaks) - 2)
            # at a stop the arc length alone does not tell the side
            piece = np.where(piece < 0, np.clip(found, low, high), piece)
            place = np.clip(place, breaks[piece], breaks[piece + 1])
            d = contour_derivatives(self.contour, place, piece)
        else:
            piece = np.zeros(len(arc), int)
            d = contour_derivatives(self.contour, self.table.parameter_at(arc))
        r = arc_derivatives(d)
        return (
            r[:, 0] * s1,
            r[:, 1] * s1**2 + r[:, 0] * s2,
            r[:, 2] * s1**3 + 3.0 * r[:, 1] * s1 * s2 + r[:, 0] * s3,
            piece,
        )

    def _most(self, own: Values, first: Values, piece: Values, edge: Values) -> Values:
        """Return the largest squared pace that velocities, feed and small turns allow."""
        speed = np.minimum(
            self.motion.program.feed[piece],
            np.where(edge >= 0, self.motion.joint_speed[edge], np.inf),
        )
        velocity = np.asarray(self.limits.velocity)
        with np.errstate(divide="ignore"):
            by_axes = (velocity / np.abs(first)).min(axis=1)
            by_feed = speed / np.maximum(own[1], 0.0)
        least = np.minimum(by_axes, by_feed)
        return np.where(least < 1e150, least, np.inf) ** 2
