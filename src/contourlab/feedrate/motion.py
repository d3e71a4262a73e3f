"""The motion along bounded geometry: stops, caps, windows, and the choice among them.

Two things are free and decided by trying, stretch by stretch: the window T of the smoothing, and
how low the caps on the speed are. A lower cap than the geometry demands leaves more acceleration;
where a first plan does not come near its caps, lower ones make the next plan faster. Whatever is
chosen keeps the limits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.feedrate.caps import acceleration_caps, jerk_left, speed_caps
from contourlab.feedrate.cells import (
    Cells,
    affected,
    spread_acceleration,
    spread_speed,
    subdivide,
    whole,
)
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.profile import Profile
from contourlab.feedrate.program import Program
from contourlab.feedrate.ramps import Ramps, plan_ramps
from contourlab.feedrate.segments import Segments, joint_angles
from contourlab.feedrate.smoothing import smooth

__all__ = ["Motion", "plan_motion"]

Values = NDArray[Any]

_WINDOWS = (0.6, 0.35, 1.7)
"""Further windows to try, in units of the one that suits a straight line."""
_HEADROOMS = (1.3, 1.3, 1.05)
"""Caps on the speed to try one after the other, in units of the speed that was reached."""
_WORTH = 0.01
"""Lower caps are tried if those that were not reached are on more than this part of the path."""
_STRAIGHT = 1e-9
"""Joints that turn by less are tangent, up to rounding [rad]."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A profile and what it was made from."""

    profile: Profile
    segments: Segments
    program: Program
    angle: Values
    """Turn at each edge of the segments [rad]."""
    stop: Values
    """Whether each edge is stopped at."""
    programmed: Values
    """Programmed feed of each segment [m/s], inf for rapids left to the limits."""
    speed: Values
    """Cap of each segment, from its feed and the limits [m/s]."""
    stops: Values
    """Arc lengths of the stops, the start included [m]."""
    joint_speed: Values
    """Largest speed at each edge, inf unless a joint turns there [m/s]."""
    begins: Values
    """Instants at which the stretches between stops begin [s]."""
    arrives: Values
    """Instants at which they arrive [s]."""
    window: Values
    """T of each stretch [s]."""
    left_as_planned: int = 0
    """How many stretches were too many to plan for the least time."""


def plan_motion(
    segments: Segments, program: Program, limits: AxisLimits, sample_time: float, corner: float
) -> Motion:
    """Return the motion along bounded geometry.

    Parameters
    ----------
    segments
        Bounds of the contour.
    program
        Feeds and dwells.
    limits
        One number per axis.
    sample_time
        Time between samples [s].
    corner
        Turn from which on a joint is stopped at [rad].
    """
    angle = joint_angles(segments)
    dwell = np.zeros(len(segments.edges))
    dwell[np.flatnonzero(segments.joint[1:]) + 1] = program.dwell
    stop = (angle > corner) | (dwell > 0.0)
    stop[0] = stop[-1] = True
    programmed = program.feed[segments.piece]
    speed = np.minimum(programmed, speed_caps(segments, limits))
    jump = np.abs(segments.after[:, 0] - segments.before[:, 0])
    jump[angle < _STRAIGHT] = 0.0
    with np.errstate(divide="ignore"):
        joint_speed = (np.asarray(limits.acceleration) * sample_time / jump).min(axis=1)
    task = _Task(segments, limits, stop, joint_speed)
    ramps, window = _choose(task, speed)
    stops = segments.edges[stop]
    rest = dwell[stop][1:]
    profile, arrives = smooth(ramps, window, stops, rest, program.dwell_before)
    begins = np.concatenate([[program.dwell_before], arrives[:-1] + rest[:-1]])
    return Motion(
        profile, segments, program, angle, stop, programmed, speed, stops, joint_speed, begins,
        arrives, window,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Task:
    """What does not change while windows and caps are tried."""

    segments: Segments
    limits: AxisLimits
    stop: Values
    joint_speed: Values

    @property
    def n_stretches(self) -> int:
        return int(self.stop.sum()) - 1

    @property
    def stretch(self) -> Values:
        return np.cumsum(self.stop[:-1]) - 1

    def suited_window(self, speed: Values) -> Values:
        """Return the window that is best on a straight line of each stretch's length.

        There it gives the time-optimal motion: T = A/J if the acceleration limit is reached,
        sqrt(V/J) if the feed is reached first, and the cube root of L/(2 J) if neither is.
        """
        free = np.full(len(speed), np.inf)
        acceleration = acceleration_caps(self.segments, self.limits, speed, free)
        jerk = jerk_left(self.segments, self.limits, speed)
        suited, most = np.zeros(self.n_stretches), np.zeros(self.n_stretches)
        np.maximum.at(suited, self.stretch, np.minimum(acceleration / jerk, np.sqrt(speed / jerk)))
        np.maximum.at(most, self.stretch, jerk)
        length = np.diff(self.segments.edges[self.stop])
        return np.minimum(suited, np.cbrt(0.5 * length / most))

    def ramps(self, speed: Values, window: Values) -> tuple[Ramps, bool]:
        """Return the ramps for given caps and windows, and whether places slow their neighbours."""
        edges, lasting = self.segments.edges, window[self.stretch]
        acceleration = acceleration_caps(self.segments, self.limits, speed, lasting)
        held = np.isfinite(self.joint_speed) & ~self.stop
        places, place_speed = edges[held], self.joint_speed[held]

        def spread(cells: Cells) -> tuple[Values, Values]:
            own, k = window[cells.stretch], cells.segment
            return (
                spread_speed(cells, speed[k], own, places, place_speed),
                spread_acceleration(cells, acceleration[k], speed[k], own),
            )

        cells = whole(edges, self.stop)
        planned, gentle = spread(cells)
        divide = affected(speed, planned) | affected(acceleration, gentle)
        divided = bool(divide.any())
        if divided:
            cells = subdivide(edges, self.stop, speed, self.joint_speed, lasting, divide)
            planned, gentle = spread(cells)
        return plan_ramps(cells, planned, gentle, window), divided

    def reached(self, ramps: Ramps) -> Values:
        """Return the largest planned speed on each segment [m/s]."""
        top = np.zeros(len(self.segments.edges) - 1)
        k = np.searchsorted(self.segments.edges, ramps.start, side="right") - 1
        np.maximum.at(top, k, np.maximum(ramps.speed, ramps.end_speed))
        return top


def _choose(task: _Task, caps: Values) -> tuple[Ramps, Values]:
    """Return the best ramps that were found and the window of each stretch."""
    base = task.suited_window(caps)
    ramps, divided = task.ramps(caps, base)
    best = ramps.stretch_times(task.n_stretches) + base
    speed, window, reached = caps, base, task.reached(ramps)

    def keep(tried_speed: Values, tried_window: Values) -> None:
        nonlocal speed, window, reached, best
        other, _ = task.ramps(tried_speed, tried_window)
        time = other.stretch_times(task.n_stretches) + tried_window
        better = time < best
        here = better[task.stretch]
        best, window = np.where(better, time, best), np.where(better, tried_window, window)
        speed = np.where(here, tried_speed, speed)
        reached = np.where(here, task.reached(other), reached)

    tried = False
    if divided:
        tried = True
        for factor in _WINDOWS:
            keep(speed, factor * base)
    share = task.segments.bend * caps[:, None] ** 2 / np.asarray(task.limits.acceleration)
    idle = (share.max(axis=1) > 0.1) & (reached < 0.98 * caps)
    length = np.diff(task.segments.edges)
    if length[idle].sum() > _WORTH * length.sum():
        tried = True
        for headroom in _HEADROOMS:
            lower = np.minimum(caps, headroom * np.where(reached > 0.0, reached, caps))
            keep(lower, task.suited_window(lower))
    if tried:
        ramps, _ = task.ramps(speed, window)
    return ramps, window
