"""How far a corner is rounded for the sake of the feed.

A blend within the tolerance of G64 P is made no longer than the programmed feed needs, and one of
G64 without a tolerance as long as that. Passing a joint at the speed F changes the velocity of an
axis by Δv = F |Δr'| and its acceleration by Δa = F² |Δr''|. Under the limits A and J that takes

    Δv/A + A/J, or 2 √(Δv/J) if A is not reached, and Δa/J,

in which the tool goes F times that along the path. No spline uses its length that well, so each
side may have the whole of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.blending import BlendedPart, blend_part, merge_part
from contourlab.contours.part import Part
from contourlab.feedrate.arc_length import arc_derivatives, contour_derivatives
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.profile import Profile
from contourlab.feedrate.program import Program, program_of
from contourlab.feedrate.stops_or_blends import faster_to_stop, middle_times

__all__ = ["asks_for_blends", "blended_for_feed", "reach_of_feed"]

Values = NDArray[Any]


def asks_for_blends(part: Part | None) -> bool:
    """Return whether anything in a part is to be blended.

    Parameters
    ----------
    part
        Any part, or none.
    """
    return part is not None and bool((~np.isnan(part.blend[:-1])).any())


def blended_for_feed(
    program: Program,
    limits: AxisLimits,
    corner_angle: float,
    plan: Callable[[Program], Profile],
) -> tuple[BlendedPart, int]:
    """Return the part of a program, blended as it asks, as far as its feed needs and where it pays.

    Parameters
    ----------
    program
        Of a part.
    limits
        One number per axis.
    corner_angle
        Joints that turn by more would be stopped at [rad].
    plan
        Plans a program.

    Returns
    -------
    BlendedPart
        The blended part.
    int
        How many corners are left as they are, because stopping at them is faster.
    """
    assert program.part is not None  # asked for by the caller
    feed = np.where(program.rapid, np.nan, program.feed)
    short, _ = merge_part(dataclasses.replace(program.part, feed=feed))
    rapid = np.asarray(short.rapid, bool)
    fastest = float(program.feed[program.rapid].min(initial=np.inf))
    reach, turn = reach_of_feed(short, np.where(rapid, fastest, short.feed), limits)
    blends = blend_part(short, reach=reach)
    corner = blends.blended.joint[turn[blends.blended.joint] > corner_angle]
    if not len(corner):
        return blends, 0

    def without(joints: Values) -> BlendedPart:
        kept = reach.copy()
        kept[joints] = 0.0
        return blend_part(short, reach=kept)

    def times(part: BlendedPart) -> Values:
        own = program_of(part.part, feed=None, rapid_feed=fastest if np.isfinite(fastest) else None)
        return middle_times(short.path, part.blended, plan(own))

    stops = without(corner)
    stop = corner[faster_to_stop(times(blends), times(stops))[corner]]
    if not len(stop):
        return blends, 0
    return (stops if len(stop) == len(corner) else without(stop)), len(stop)


def reach_of_feed(part: Part, speed: Values, limits: AxisLimits) -> tuple[Values, Values]:
    """Return how long a blend may be on each side of each joint, and by how much the joint turns.

    Parameters
    ----------
    part
        After merging.
    speed
        Of each piece [m/s]; inf where only the limits hold it.
    limits
        One number per axis.

    Returns
    -------
    tuple of arrays
        Length [m] and angle [rad], shape (n_joints,).
    """
    path = part.path
    n = path.n_pieces
    breaks = np.asarray(path.breaks, float)
    before = np.arange(n) if path.closed else np.arange(n - 1)
    after = (before + 1) % n
    left = arc_derivatives(contour_derivatives(path, breaks[before + 1], before))
    right = arc_derivatives(contour_derivatives(path, breaks[after], after))
    velocity, acceleration, jerk = (
        np.asarray(x, float) for x in (limits.velocity, limits.acceleration, limits.jerk)
    )
    steepest = np.maximum(np.abs(left[:, 0]), np.abs(right[:, 0]))
    with np.errstate(divide="ignore"):
        by_axes = (velocity / steepest).min(axis=1)
    pace = np.minimum(np.minimum(speed[before], speed[after]), by_axes)[:, None]
    turn = pace * np.abs(right[:, 0] - left[:, 0])
    bend = pace**2 * np.abs(right[:, 1] - left[:, 1])
    reached = turn >= acceleration**2 / jerk
    turning = np.where(
        reached, turn / acceleration + acceleration / jerk, 2.0 * np.sqrt(turn / jerk)
    )
    reach = (pace * (turning + bend / jerk)).max(axis=1)
    a, b = left[:, 0], right[:, 0]
    angle = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return reach, angle
