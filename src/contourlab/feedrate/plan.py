"""The programmed feed, as far as the axes can follow it.

Corners under G64 are blended first (:mod:`contourlab.feedrate.blends`). The path is split where the
motion stops: at other corners, at dwells and at both ends. On each stretch

1. the geometry is bounded (:mod:`contourlab.feedrate.segments`) and gives, place by place, caps on
   speed and tangential acceleration under which no axis exceeds a limit (``caps``);
2. the caps are spread over what the smoothing will mix (``cells``);
3. the fastest motion of constant accelerations is planned (``ramps``), several windows being tried;
4. it is averaged over the window (``smoothing``), which limits its jerk;
5. stretches on which that gives time away, because the path curves or the feed changes, are planned
   anew for the least time under the same limits (``refine``).

On a straight line the first plan is the time-optimal motion of limited jerk. On curves the second
one is optimal to about one percent; where an axis limit holds the feed back, the speed then varies
along an arc with its direction. Without step 5 an arc has one speed, that of its worst direction.

The result is checked at every sample and between; a plan that exceeded a limit would be made anew
under lower limits, never returned. Where the curvature jumps (a line into a tangent arc) the
acceleration jumps, within its limit; the plan lists these joints.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace
from contourlab.contours.base import Contour
from contourlab.contours.blending import BlendedPart
from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.errors import FeedError, UnitError
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives
from contourlab.feedrate.blends import asks_for_blends, blended_for_feed
from contourlab.feedrate.limits import AxisLimits, positive, sample_count
from contourlab.feedrate.motion import Motion, plan_motion
from contourlab.feedrate.profile import Profile
from contourlab.feedrate.program import Program, program_of
from contourlab.feedrate.refine import refine
from contourlab.feedrate.refined import RefinedProfile
from contourlab.feedrate.remarks import (
    CurvatureJump,
    axis_names,
    blend_remarks,
    curvature_jumps,
    remarks,
)
from contourlab.feedrate.segments import Segments, segments_of
from contourlab.recordings.reference import Reference
from contourlab.units import parse_quantity

__all__ = ["Plan", "plan_feed", "programmed_feed"]

Values = NDArray[Any]

CORNER_ANGLE = 0.01
"""Joints that turn by more than this are stopped at [rad]."""
_SHRINK = 0.98
_ATTEMPTS = 6
_ROUNDING = 1e-9
_FINER = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """A planned motion along a contour."""

    reference: Reference
    """The motion at the samples."""
    stop_times: Values
    """Instants of arrival at exact stops, the end included, shape (n_stops,) [s]."""
    stop_parameters: Values
    """Contour parameters of these stops, shape (n_stops,)."""
    cycle_time: float
    """Time of arrival at the end, dwells included [s]; not rounded to samples."""
    warnings: tuple[str, ...]
    """What the plan could not honour, in sentences; those of the part are not repeated."""
    profile: Profile = field(repr=False)
    """The motion between the samples too, in arc length from the start of the contour."""
    limits: AxisLimits = field(repr=False)
    """The limits it was planned under, one number per axis."""
    feed: Values = field(repr=False)
    """Programmed feed of each piece of the contour, inf for rapids left to the limits [m/s]."""
    axes: tuple[str, ...]
    """Names of the axes: those of the part, or numbers from 0."""
    curvature_jumps: tuple[CurvatureJump, ...] = field(repr=False)
    """Joints that are passed although the curvature jumps, along the path."""
    part: Part | None = field(default=None, repr=False)
    """The part as it was planned, with its corners blended; None for a contour."""
    blends: BlendedPart | None = field(default=None, repr=False)
    """How corners were blended; None if the part asks for none."""


def programmed_feed(
    contour: Contour | Part,
    *,
    limits: AxisLimits | None,
    sample_time: float,
    feed: Any = None,
    rapid_feed: float | str | None = None,
    corner_angle: float | str = CORNER_ANGLE,
    fastest: bool = True,
) -> Reference:
    """Return the reference of :func:`plan_feed`.

    Parameters
    ----------
    contour, limits, sample_time, feed, rapid_feed, corner_angle, fastest
        As there.
    """
    return plan_feed(
        contour, limits=limits, sample_time=sample_time, feed=feed, rapid_feed=rapid_feed,
        corner_angle=corner_angle, fastest=fastest,
    ).reference  # fmt: skip


def plan_feed(
    contour: Contour | Part,
    *,
    limits: AxisLimits | None,
    sample_time: float,
    feed: Any = None,
    rapid_feed: float | str | None = None,
    corner_angle: float | str = CORNER_ANGLE,
    fastest: bool = True,
) -> Plan:
    """Plan the programmed feed under limits of velocity, acceleration and jerk of every axis.

    The motion starts and ends at rest, goes along the contour once, stops exactly at corners and
    where the program dwells, and rests for as long as it says. Where a part asks for it (G64),
    corners are blended within its tolerance, and the reference follows the blended path:
    ``Plan.part`` has it, ``Plan.blends`` says how far it leaves the programmed one. A corner of
    which no blend within the tolerance can be passed faster than a stop takes stays a stop.

    Between stops no axis exceeds its velocity or acceleration limit anywhere, nor its jerk limit
    wherever the curvature is continuous. At joints that turn by less than a corner, the speed is
    held so low that no axis velocity jumps by more than its acceleration limit changes it in one
    sample.

    Parameters
    ----------
    contour
        A contour, or a part whose pieces carry feeds, rapids and dwells.
    limits
        Of the axes, which are the contour's coordinates; those of a machine that has none, None,
        are refused.
    sample_time
        Time between samples, > 0 [s].
    feed
        Programmed feed: a number in m/s or a text with its unit; for a path also one number per
        piece. Needed for a contour; for a part it replaces the feed of all pieces but rapids.
    rapid_feed
        Feed of rapids, as ``feed``; None leaves them to the velocity limits. Only for a part.
    corner_angle
        Joints that turn by more are stopped at, 0 to π: a number in rad or a text with its unit.
    fastest
        Whether stretches with curves or several feeds are planned for the least time; otherwise
        they keep a first plan that is made at once, and on strongly curved paths slower.

    Raises
    ------
    FeedError
        No feed, one that is not > 0, no limits, limits for another number of axes, a contour
        without length or with a cusp.
    """
    if limits is None:
        raise FeedError("limits is missing: the machine has no axis limits")
    program = program_of(contour, feed=feed, rapid_feed=rapid_feed)
    dt = positive(sample_time, "sample_time", "s")
    angle = _angle(corner_angle)
    if not 0.0 <= angle <= np.pi:
        raise FeedError(f"corner_angle must be within 0 to pi rad, got {angle:g}")
    axis_limits = limits.for_axes(program.contour.n_axes)
    blends, stopped = None, 0
    if asks_for_blends(program.part):
        blends, stopped = blended_for_feed(
            program,
            axis_limits,
            angle,
            lambda program: _Task.of(program).motion(axis_limits, dt, angle, fastest, True).profile,
        )
        program = program_of(blends.part, feed=None, rapid_feed=rapid_feed)
    task = _Task.of(program)
    geometry, table = program.contour, task.table
    lowered = axis_limits
    for attempt in range(_ATTEMPTS):
        motion = task.motion(lowered, dt, angle, fastest)
        reference = _sampled(geometry, table, motion.profile, dt)
        worst = _worst(reference, axis_limits)
        helical = isinstance(geometry, Path) and not len(geometry.control_points)
        if isinstance(motion.profile, RefinedProfile) or not helical:
            worst = max(worst, _worst_between(geometry, table, motion.profile, axis_limits, dt))
        if worst <= 1.0 + _ROUNDING:
            break
        shrink = min(_SHRINK, 1.0 / worst**2) ** (attempt + 1)
        lowered = AxisLimits(
            velocity=axis_limits.velocity * shrink,
            acceleration=axis_limits.acceleration * shrink,
            jerk=axis_limits.jerk * shrink,
        )
    else:
        raise FeedError(
            f"no plan within the limits was found: one is exceeded by {100 * (worst - 1):.3g} %; "
            "the contour is rougher than its samples show"
        )
    of_motion = remarks(motion, axis_limits)
    said = (*blend_remarks(blends, stopped), *of_motion)
    reference = replace(
        reference, warnings=(*program.warnings, *said), motion_warnings=tuple(of_motion)
    )
    return Plan(
        reference=reference,
        stop_times=motion.arrives,
        stop_parameters=table.parameter_at(motion.stops[1:]),
        cycle_time=motion.profile.duration,
        warnings=said,
        profile=motion.profile,
        limits=axis_limits,
        feed=program.feed,
        axes=axis_names(motion),
        curvature_jumps=curvature_jumps(motion, table),
        part=program.part,
        blends=blends,
    )


def _angle(value: float | str) -> float:
    try:
        return parse_quantity(value, "angle") if isinstance(value, str) else float(value)
    except (UnitError, TypeError, ValueError) as error:
        raise FeedError(f"corner_angle must be an angle, got {value!r}: {error}") from None


@dataclass(frozen=True, eq=False)
class _Task:
    """What is to be planned, with its geometry bounded."""

    program: Program
    table: ArcLength
    segments: Segments

    @staticmethod
    def of(program: Program) -> _Task:
        table = ArcLength(program.contour)
        segments = segments_of(program.contour, table)
        if not (np.diff(segments.edges) > 0.0).all():
            at = int(np.argmin(np.diff(segments.edges)))
            raise FeedError(
                f"piece {int(segments.piece[at])} at {segments.edges[at]:.6g} m "
                "is shorter than rounding"
            )
        return _Task(program, table, segments)

    def motion(
        self, limits: AxisLimits, dt: float, corner: float, fastest: bool, roughly: bool = False
    ) -> Motion:
        motion = plan_motion(self.segments, self.program, limits, dt, corner)
        if fastest:
            motion = refine(motion, self.program.contour, self.table, limits, dt, roughly)
        return motion


def _sampled(contour: Contour, table: ArcLength, profile: Profile, dt: float) -> Reference:
    count = max(1, sample_count(np.ceil(profile.duration / dt - 1e-9), dt))
    time = dt * np.arange(count + 1)
    arc, speed, acceleration, jerk = profile.at(time)
    parameter = table.time_derivatives(arc, speed, acceleration, jerk)
    return Reference.along(
        contour, sample_time=dt, parameter=parameter[0], parameter_rate=parameter[1],
        parameter_acceleration=parameter[2], parameter_jerk=parameter[3],
    )  # fmt: skip


def _worst(reference: Reference, limits: AxisLimits) -> float:
    """Return the largest fraction of a limit that a sample takes."""
    pairs = (
        (reference.velocity, limits.velocity),
        (reference.acceleration, limits.acceleration),
        (reference.jerk, limits.jerk),
    )
    return max(float(np.max(np.abs(value) / np.asarray(limit))) for value, limit in pairs)


def _worst_between(
    contour: Contour, table: ArcLength, profile: Profile, limits: AxisLimits, dt: float
) -> float:
    """Return the same between samples, where bounds rest on samples of the geometry."""
    count = int(np.ceil(profile.duration / dt)) * _FINER
    time = np.linspace(0.0, profile.duration, min(count, 200_000) + 1)
    arc, v, a, j = (x[:, None] for x in profile.at(time))
    r = arc_derivatives(contour_derivatives(contour, table.parameter_at(arc[:, 0])))
    velocity = r[:, 0] * v
    acceleration = r[:, 1] * v**2 + r[:, 0] * a
    jerk = r[:, 2] * v**3 + 3.0 * r[:, 1] * v * a + r[:, 0] * j
    pairs = (
        (velocity, limits.velocity), (acceleration, limits.acceleration), (jerk, limits.jerk),
    )  # fmt: skip
    return max(float(np.max(np.abs(value) / np.asarray(limit))) for value, limit in pairs)
