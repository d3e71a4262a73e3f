"""What drawings are made of: lines, arcs and rational Bézier curves, in runs that belong together.

A segment may be turned round and its ends moved a little, by no more than the gap that a drawing
may have between neighbours: a line runs between the new ends, an arc keeps its angle, the control
points of a curve move with the nearer end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.spline_paths import straight_rows
from contourlab.errors import PartError

__all__ = [
    "LARGEST_COORDINATE", "MOST_SEGMENTS", "Run", "Segment", "arc", "bulged", "conic", "curve",
    "line",
]  # fmt: skip

LARGEST_COORDINATE = 1e5
"""Coordinates beyond this are no machine's [m]."""
MOST_SEGMENTS = 2_000_000

_FAR = 1e3
"""A radius beyond this is a Bézier curve, exact too: an arc's centre would cost digits [m]."""
_ROUND = 1e-12
"""Axes of an ellipse that differ by no more than this fraction make a circle."""

Rows = NDArray[Any]
_NOWHERE = np.full(3, np.nan)
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Segment:
    """A line, an arc or a rational Bézier curve in space."""

    start: Rows
    """First and last point, shape (3,) [m]."""
    end: Rows
    center: Rows
    """Of an arc; NaN otherwise."""
    normal: Rows
    """Unit normal of an arc's plane."""
    angle: float
    """Swept about the normal; 0 for lines and curves [rad]."""
    control: Rows | None
    """Homogeneous control points of a curve, shape (degree + 1, 4)."""

    @property
    def length(self) -> float:
        """Length of a line or an arc; of the control polygon of a curve [m]."""
        if self.control is not None:
            points = self.control[:, :3] / self.control[:, 3:]
            return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        if self.angle:
            return float(np.linalg.norm(self.start - self.center)) * abs(self.angle)
        return float(np.linalg.norm(self.end - self.start))

    def reversed(self) -> Segment:
        """Return the segment run the other way."""
        control = None if self.control is None else self.control[::-1]
        return replace(self, start=self.end, end=self.start, angle=-self.angle, control=control)

    def moved(self, start: Rows, end: Rows, most: float) -> Segment:
        """Return the segment between ends that are nearly its own.

        Parameters
        ----------
        start, end
            The new ends [m].
        most
            How far anything may move [m].

        Raises
        ------
        PartError
            An arc that would move much further than its ends.
        """
        if np.array_equal(start, self.start) and np.array_equal(end, self.end):
            return self
        if self.control is not None:
            points = self.control[:, :3] / self.control[:, 3:]
            share = np.linspace(0.0, 1.0, len(points))[:, None]
            points = points + (1.0 - share) * (start - self.start) + share * (end - self.end)
            weight = self.control[:, 3:]
            return curve(np.concatenate([points * weight, weight], axis=1))
        if not self.angle:
            return line(start, end)
        chord, half = end - start, 0.5 * self.angle
        if abs(math.sin(half)) < 1e-9:  # whole turns: shift
            center = self.center + 0.5 * (start - self.start + end - self.end)
        else:
            center = 0.5 * (start + end) + 0.5 / math.tan(half) * np.cross(self.normal, chord)
        if np.linalg.norm(center - self.center) > 10.0 * most:
            raise PartError(
                "an arc cannot be moved to meet its neighbours without changing its radius much"
            )
        return replace(self, start=start, end=end, center=center)


@dataclass(eq=False)
class Run:
    """Segments that the drawing itself joins."""

    segments: list[Segment]
    entity: int
    """Which entity of the drawing they come from, counted from 1."""
    layer: str = ""

    def reversed(self) -> Run:
        """Return the run the other way."""
        turned = [segment.reversed() for segment in reversed(self.segments)]
        return Run(turned, self.entity, self.layer)


def line(start: Any, end: Any) -> Segment:
    """Return a line.

    Parameters
    ----------
    start, end
        Shape (3,) [m].
    """
    return Segment(np.asarray(start, float), np.asarray(end, float), _NOWHERE, _UP, 0.0, None)


def arc(center: Any, start: Any, angle: float, normal: Any = _UP, end: Any = None) -> Segment:
    """Return an arc.

    Parameters
    ----------
    center, start
        Shape (3,) [m].
    angle
        Swept about the normal [rad].
    normal
        Unit normal.
    end
        Where it ends, if that is known better than by turning.
    """
    center, start, normal = (np.asarray(v, float) for v in (center, start, normal))
    if end is None:
        arm = start - center
        across = np.cross(normal, arm)
        end = center + math.cos(angle) * arm + math.sin(angle) * across
        if abs(abs(angle) - 2.0 * math.pi) < 1e-14:
            end = start
    return Segment(start, np.asarray(end, float), center, normal, float(angle), None)


def curve(control: Rows) -> Segment:
    """Return a rational Bézier curve; a line if it runs straight.

    Parameters
    ----------
    control
        Homogeneous control points, shape (degree + 1, 4).
    """
    start, end = control[0, :3] / control[0, 3], control[-1, :3] / control[-1, 3]
    if len(control) == 2 or straight_rows(control[None])[0]:
        return line(start, end)
    return Segment(start, end, _NOWHERE, _UP, 0.0, control)


def bulged(start: Any, end: Any, bulge: float, normal: Any = _UP) -> Segment:
    """Return the arc of a polyline: bulge is the tangent of a quarter of its angle.

    An arc that is all but straight becomes the rational Bézier curve that is the same arc.

    Parameters
    ----------
    start, end
        Shape (3,) [m].
    bulge
        > 0 counter-clockwise about the normal; 0 is a line.
    normal
        Unit normal.
    """
    start, end = np.asarray(start, float), np.asarray(end, float)
    if bulge == 0.0 or np.array_equal(start, end):
        return line(start, end)
    if np.linalg.norm(end - start) > 4.0 * _FAR * abs(bulge):  # no centre that is of use
        half = 2.0 * math.atan(bulge)
        corner = 0.5 * (start + end) - 0.5 * math.tan(half) * np.cross(normal, end - start)
        weight = math.cos(half)
        return curve(np.array([[*start, 1.0], [*(weight * corner), weight], [*end, 1.0]]))
    # the centre is this far left of the middle of the chord, in chords
    offset = (1.0 - bulge * bulge) / (4.0 * bulge)
    center = 0.5 * (start + end) + offset * np.cross(normal, end - start)
    return arc(center, start, 4.0 * math.atan(bulge), normal, end)


def conic(center: Any, first: Any, second: Any, start: float, sweep: float) -> list[Segment]:
    """Return the arc ``center + first cos t + second sin t`` of an ellipse, exactly.

    Parameters
    ----------
    center, first, second
        Shape (3,) [m]; conjugate half diameters, not parallel.
    start, sweep
        First t and how much of it, up to a turn either way [rad].
    """
    center, first, second = (np.asarray(v, float) for v in (center, first, second))
    a, b = np.linalg.norm(first), np.linalg.norm(second)

    def at(t: float) -> Rows:
        return center + math.cos(t) * first + math.sin(t) * second  # type: ignore[no-any-return]

    whole = abs(abs(sweep) - 2.0 * math.pi) < 1e-12
    if abs(a - b) <= _ROUND * max(a, b) and abs(first @ second) <= _ROUND * a * b:
        normal = np.cross(first, second)
        return [arc(
            center, at(start), sweep, normal / np.linalg.norm(normal),
            at(start) if whole else at(start + sweep),
        )]  # fmt: skip
    count = max(1, math.ceil(abs(sweep) / (0.5 * math.pi) - 1e-9))
    step = sweep / count
    weight = math.cos(0.5 * step)
    ends = [at(start + k * step) for k in range(count + 1)]
    if whole:
        ends[-1] = ends[0]
    pieces = []
    for k in range(count):
        middle = start + (k + 0.5) * step
        # where the tangents at both ends meet, times its weight
        corner = weight * center + math.cos(middle) * first + math.sin(middle) * second
        control = np.empty((3, 4))
        control[[0, 2], :3], control[1, :3] = (ends[k], ends[k + 1]), corner
        control[:, 3] = 1.0, weight, 1.0
        pieces.append(curve(control))
    return pieces


def check_size(segments: Sequence[Segment], what: str) -> None:
    """Raise PartError if a coordinate is not finite or too large for a machine.

    Parameters
    ----------
    segments
        Of one entity.
    what
        Its name, for the message.
    """
    for segment in segments:
        points = [segment.start, segment.end]
        if segment.angle:
            points.append(segment.center)
        if segment.control is not None:
            if not (segment.control[:, 3] > 0.0).all():
                raise PartError(f"{what}: weights must be > 0")
            points.append(segment.control[:, :3] / segment.control[:, 3:])
        if not all((np.abs(p) <= LARGEST_COORDINATE).all() for p in points):
            raise PartError(
                f"{what}: a coordinate is not finite or beyond {LARGEST_COORDINATE:g} m"
            )
