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
from contourlab.feedrate.interior_point import Collocation
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.motion import Motion
from contourlab.feedrate.refined import OwnMotion

__all__ = ["Geometry", "Stretch"]

Values = NDArray[Any]

_END_PLACES = np.concatenate([np.arange(1, 24) / 12.0, [0.02, 0.04]])
"""Further places from both ends, in intervals: there the pace changes most."""
_LEAST_SPEED = 1e-6
"""Smallest speed of an own motion between its ends, in units of its mean."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """From stop to stop, as a motion over a time of its own from 0."""

    number: int
    """Which stretch of the plan."""
    own: OwnMotion
    duration: float
    """Own time that it takes [s]."""
    intervals: int
    """Of the pace."""

    @property
    def h(self) -> float:
        """Length of an interval [s]."""
        return self.duration / self.intervals

    def moves_on(self) -> bool:
        """Return whether the own motion goes forward everywhere between its ends."""
        u = np.linspace(0.0, self.duration, 8 * self.intervals + 1)[1:-1]
        speed = self.own.at(u)[1]
        return bool((speed[4:-4] > _LEAST_SPEED * speed.mean()).all() and (speed > 0.0).all())


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
        _, interval, place, weight, piece, place_of_joint = (
            np.concatenate(column) for column in zip(*rows, strict=True)
        )
        duration = np.array([stretch.duration for stretch in stretches])
        intervals = np.array([stretch.intervals for stretch in stretches])
        own = np.concatenate(
            [np.stack(s.own.at(row[0])) for s, row in zip(stretches, rows, strict=True)], axis=1
        )
        first, second, third, piece = self._axes(own, piece)
        most = self._most(own, first, piece, place_of_joint)
        offset = np.cumsum(intervals + 2) - (intervals + 2)
        return Collocation(
            stretch=which,
            interval=offset[which] + interval,
            place=place,
            piece=piece,
            h=(duration / intervals)[which],
            time_weight=weight / intervals[which],
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
        """Return own time, interval, place, weight, piece (-1: by arc length) and edge (-1)."""
        n, h = stretch.intervals, stretch.h
        interval = np.repeat(np.arange(n), len(places))
        place = np.tile(places, n)
        u = (interval + place) * h
        joints = self._joints(stretch)
        at = self._own_time(stretch, self.motion.segments.edges[joints])
        left = self.motion.segments.piece[joints - 1]
        right = self.motion.segments.piece[joints]
        between = 0.5 * (at[1:] + at[:-1])
        none = np.full(len(u) + len(joints), -1)
        near = _END_PLACES * h
        ends = np.concatenate([near, stretch.duration - near])
        extra_u = np.concatenate([at, at, between, ends])
        extra_interval = np.clip((extra_u / h).astype(int), 0, n - 1)
        columns = (
            np.concatenate([u, extra_u]),
            np.concatenate([interval, extra_interval]),
            np.concatenate([place, np.clip(extra_u / h - extra_interval, 0.0, 1.0)]),
            np.concatenate([np.tile(weights, n), np.zeros(len(extra_u))]),
            np.concatenate([none[: len(u)], left, right, right[:-1], none[: len(ends)]]),
            np.concatenate([none[: len(u)], joints, joints, none[: len(between) + len(ends)]]),
        )
        order = np.argsort(columns[0], kind="stable")
        return tuple(column[order] for column in columns)

    def _joints(self, stretch: Stretch) -> Values:
        """Return the edges of the segments that are joints inside the stretch."""
        segments, (start, end) = self.motion.segments, self._ends(stretch)
        inside = segments.joint & (segments.edges > start) & (segments.edges < end)
        return np.flatnonzero(inside)

    def _ends(self, stretch: Stretch) -> tuple[float, float]:
        stops = self.motion.stops
        return float(stops[stretch.number]), float(stops[stretch.number + 1])

    def _own_time(self, stretch: Stretch, arc: Values) -> Values:
        """Return the own time at which the stretch reaches some arc lengths inside it."""
        grid = np.linspace(0.0, stretch.duration, 8 * stretch.intervals + 1)
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

    def _axes(self, own: Values, piece: Values) -> tuple[Values, Values, Values, Values]:
        """Return the derivatives of the axes over own time, and the piece of each point."""
        _, s1, s2, s3 = own[:, :, None]
        arc = np.clip(own[0], 0.0, self.table.length)
        if isinstance(self.contour, Path):
            breaks = np.asarray(self.contour.breaks, float)
            place = np.clip(breaks[0] + arc, breaks[0], breaks[-1])
            found = np.clip(np.searchsorted(breaks, place, side="right") - 1, 0, len(breaks) - 2)
            piece = np.where(piece < 0, found, piece)
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
