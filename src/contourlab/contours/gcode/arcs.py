"""Arcs from what a program says of them: a centre or a radius, and where they end.

Everything here is in the two coordinates of a plane, taken so that a positive angle turns the first
axis towards the second. An arc always starts and ends exactly where the program says.

**Centre given (I J K).** The radii to the start and to the end differ by rounding. LinuxCNC accepts
a difference Δ unless Δ > 100 a, or Δ > a and Δ > 0.001 times the larger radius, with
a = 2√2 · 0.01 mm (2√2 · 0.001 inch in G20), and refuses radii below 0.00005 inch; so does this
reader. LinuxCNC then runs a spiral. Here the centre moves onto the perpendicular bisector of the
chord, by Δ r / chord. On an arc of half a turn or less that keeps the arc within Δ of the spiral.
On a longer one a small chord would throw the whole circle off; when the centre would move by more
than 1 µm the arc is made of two, which meet on the spiral, and each centre moves by less than Δ.

**Radius given (R).** Positive R takes the short way, negative R the long way. LinuxCNC stretches a
radius that is too short for the chord by no more than 0.00005 inch; so does this reader.

A sweep below 1e-6 rad with a centre is a full turn, as in LinuxCNC's planner.

References
----------
.. [LinuxCNC] interp_arc.cc and interp_internal.hh of LinuxCNC 2.9: the tolerances, read and
   confirmed by running its interpreter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from contourlab.errors import GcodeError

__all__ = ["ArcPiece", "Tolerances", "arc_by_center", "arc_by_radius", "tolerances"]

_RELATIVE = 0.001
_FULL_TURN_BELOW = 1e-6
_SPLIT_ABOVE = 1e-6
_TURN = 2.0 * math.pi
_SAME_POINT = 1e-12
"""Points nearer than this are one point [m]: coordinates added up in G91 differ by rounding."""

Point = tuple[float, float]


class Tolerances(NamedTuple):
    """LinuxCNC's tolerances on arcs [m]."""

    spiral: float
    """By how much the radii to start and end may differ, whatever the radius."""
    radius: float
    """Least radius, and by how much an R may be too short."""


_MM = Tolerances(spiral=2.0 * math.sqrt(2.0) * 1e-5, radius=0.00005 * 0.0254)
_INCH = Tolerances(spiral=2.0 * math.sqrt(2.0) * 0.001 * 0.0254, radius=0.00005 * 0.0254)


def tolerances(inch: bool) -> Tolerances:
    """Return the tolerances in force in G20 (inch) or G21."""
    return _INCH if inch else _MM


class ArcPiece(NamedTuple):
    """One circular piece."""

    center: Point
    angle: float
    """Swept angle, signed [rad]."""
    end: Point
    rise: float
    """Fraction of the whole arc's rise that is reached at the end of this piece, 0 to 1."""


def arc_by_radius(
    start: Point, end: Point, radius: float, clockwise: bool, turns: int, tolerance: Tolerances
) -> ArcPiece:
    """Return the arc of a given radius.

    Parameters
    ----------
    start, end
        Where it starts and ends [m].
    radius
        Positive for the short way, negative for the long way [m].
    clockwise
        G2 and not G3.
    turns
        P word: 1 for a simple arc, each more a full turn.
    tolerance
        From :func:`tolerances`.

    Raises
    ------
    GcodeError
        End equal to the start, zero radius, radius too small to reach the end.
    """
    size = abs(radius)
    chord = math.hypot(end[0] - start[0], end[1] - start[1])
    if chord <= _SAME_POINT:
        raise GcodeError("an arc given by R must end away from its start; give I J K for a circle")
    if size < tolerance.radius:
        raise GcodeError(f"the radius of the arc is zero (below {_mm(tolerance.radius)} mm)")
    half = 0.5 * chord
    if half - size > tolerance.radius:
        raise GcodeError(
            f"the radius {_mm(size)} mm is too small to reach the end of the arc, "
            f"{_mm(chord)} mm away: at least {_mm(half)} mm"
        )
    offset = math.sqrt(max((size - half) * (size + half), 0.0))
    if radius < 0.0:
        offset = -offset
    center, swept = _through(start, end, offset, clockwise)
    swept += _TURN * (turns - 1)
    return ArcPiece(center, -swept if clockwise else swept, end, 1.0)


def arc_by_center(
    start: Point, end: Point, center: Point, clockwise: bool, turns: int, tolerance: Tolerances
) -> tuple[list[ArcPiece], float]:
    """Return the arc about a given centre, as one piece or two, and how far the centre moved.

    Parameters
    ----------
    start, end, center
        As programmed [m]; the end equal to the start is a full circle.
    clockwise
        G2 and not G3.
    turns
        P word: 1 for a simple arc, each more a full turn.
    tolerance
        From :func:`tolerances`.

    Returns
    -------
    pieces : list of ArcPiece
        In order.
    moved : float
        The farthest that a centre is from where the program puts it [m].

    Raises
    ------
    GcodeError
        Zero radius, or radii to start and end that differ by more than LinuxCNC allows.
    """
    sign = -1.0 if clockwise else 1.0
    a1, a2 = start[0] - center[0], start[1] - center[1]
    b1, b2 = end[0] - center[0], end[1] - center[1]
    first, last = math.hypot(a1, a2), math.hypot(b1, b2)
    if min(first, last) < tolerance.radius:
        raise GcodeError(f"the radius of the arc is zero (below {_mm(tolerance.radius)} mm)")
    difference = abs(first - last)
    if difference > 100.0 * tolerance.spiral or (
        difference > tolerance.spiral and difference > _RELATIVE * max(first, last)
    ):
        raise GcodeError(
            f"the radius to the end of the arc, {_mm(last)} mm, differs from the radius to its "
            f"start, {_mm(first)} mm, by more than LinuxCNC's tolerance "
            f"({_mm(tolerance.spiral)} mm or 0.1 %)"
        )
    if math.dist(start, end) <= _SAME_POINT:
        return [ArcPiece(center, sign * _TURN * turns, end, 1.0)], 0.0
    base = math.atan2(sign * (a1 * b2 - a2 * b1), a1 * b1 + a2 * b2) % _TURN
    if base < _FULL_TURN_BELOW:
        base += _TURN
    total = base + _TURN * (turns - 1)
    whole, moved = _about(start, end, center, clockwise, total)
    if total <= math.pi or moved <= _SPLIT_ABOVE:
        return [ArcPiece(*whole, end, 1.0)], moved
    # Far from any whole number of turns on both sides of the joint, where chords are long.
    part = 0.5 * base if base >= math.pi else 0.5 * base + math.pi
    radius = first + (last - first) * part / total
    direction = math.atan2(a2, a1) + sign * part
    joint = (
        center[0] + radius * math.cos(direction),
        center[1] + radius * math.sin(direction),
    )
    one, moved_one = _about(start, joint, center, clockwise, part)
    two, moved_two = _about(joint, end, center, clockwise, total - part)
    pieces = [ArcPiece(*one, joint, part / total), ArcPiece(*two, end, 1.0)]
    return pieces, max(moved_one, moved_two)


def _about(
    start: Point, end: Point, center: Point, clockwise: bool, total: float
) -> tuple[tuple[Point, float], float]:
    """Return centre and signed angle of the arc whose centre is nearest the one given."""
    d1, d2 = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(d1, d2)
    t1, t2 = d1 / chord, d2 / chord
    c1 = center[0] - 0.5 * (start[0] + end[0])
    c2 = center[1] - 0.5 * (start[1] + end[1])
    along, left = c1 * t1 + c2 * t2, c2 * t1 - c1 * t2
    moved, swept = _through(start, end, -left if clockwise else left, clockwise)
    swept += _TURN * round((total - swept) / _TURN)
    return (moved, -swept if clockwise else swept), abs(along)


def _through(start: Point, end: Point, offset: float, clockwise: bool) -> tuple[Point, float]:
    """Return centre and sweep (0 to 2π) of the arc through two points.

    ``offset`` is the distance of the centre from the middle of the chord, positive on the side that
    makes the sweep less than half a turn.
    """
    d1, d2 = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(d1, d2)
    side = (-offset if clockwise else offset) / chord
    center = (0.5 * (start[0] + end[0]) - side * d2, 0.5 * (start[1] + end[1]) + side * d1)
    return center, 2.0 * math.atan2(0.5 * chord, offset)


def _mm(metres: float) -> str:
    return f"{metres * 1e3:.6g}"
