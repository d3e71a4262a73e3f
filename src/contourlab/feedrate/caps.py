"""Caps on speed and on tangential acceleration that keep every axis within its limits.

With the speed v, the tangential acceleration a and its rate j, an axis moves by

    velocity       r' v
    acceleration   r'' v² + r' a
    jerk           r''' v³ + 3 r'' v a + r' j.

A place gets a cap V on the speed first, which leaves a share of the acceleration and of the jerk
to the tangential motion, and then a cap on |a| that holds for every v <= V. The smoothing of
:mod:`contourlab.feedrate.smoothing` gives |j| <= |a|max / T, so the jerk limits |a| too:

    |a| <= (J - |r'''| V³) / (|r'| / T + 3 |r''| V).

On an arc |r'| and |r''| are not largest at one place: there ``|W| a + ρ hypot(a, rate V²) <= A`` is
used where it allows more, ρ being the amplitude of the turning tangent.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.segments import Segments

__all__ = ["acceleration_caps", "jerk_left", "speed_caps"]

Values = NDArray[Any]

BEND_SHARE = 0.95
"""Share of the acceleration limit that the curvature may take at the capped speed."""
TWIST_SHARE = 0.8
"""Share of the jerk limit that the change of curvature may take at the capped speed."""


def _ratio(limit: Values, bound: Values) -> Values:
    with np.errstate(divide="ignore"):
        return np.where(bound > 0.0, limit / np.where(bound > 0.0, bound, 1.0), np.inf)


def speed_caps(segments: Segments, limits: AxisLimits) -> Values:
    """Return the largest speed that the axes allow on each segment, shape (n,) [m/s].

    Parameters
    ----------
    segments
        Bounds of the geometry.
    limits
        Per axis.
    """
    velocity = _ratio(np.asarray(limits.velocity), segments.tangent)
    bend = _ratio(BEND_SHARE * np.asarray(limits.acceleration), segments.bend)
    twist = _ratio(TWIST_SHARE * np.asarray(limits.jerk), segments.twist)
    every = np.minimum(np.minimum(velocity, np.sqrt(bend)), np.cbrt(twist))
    return every.min(axis=1)  # type: ignore[no-any-return]


def acceleration_caps(
    segments: Segments, limits: AxisLimits, speed: Values, window: Values
) -> Values:
    """Return the largest tangential acceleration on each segment, shape (n,) [m/s²].

    Parameters
    ----------
    segments
        Bounds of the geometry.
    limits
        Per axis.
    speed
        Cap on the speed, shape (n,) [m/s].
    window
        T of the smoothing, shape (n,) [s]; inf leaves the jerk limit out.
    """
    acceleration, jerk = np.asarray(limits.acceleration), np.asarray(limits.jerk)
    v = speed[:, None]
    apart = _ratio(acceleration - segments.bend * v**2, segments.tangent)
    turning = np.where(np.isfinite(segments.turning), segments.turning, 0.0)
    left = np.maximum(acceleration**2 - (turning * segments.rate[:, None] * v**2) ** 2, 0.0)
    square = (acceleration * segments.axial) ** 2 + (turning**2 - segments.axial**2) * left
    root = np.sqrt(np.maximum(square, 0.0))
    below = acceleration * segments.axial + root
    together = np.where(left > 0.0, _ratio(left, below), 0.0)
    together = np.where(np.isfinite(segments.turning), together, 0.0)
    by_acceleration = np.maximum(apart, together)
    by_jerk = _ratio(
        jerk - segments.twist * v**3,
        segments.tangent / window[:, None] + 3.0 * segments.bend * v,
    )
    return np.minimum(by_acceleration, by_jerk).min(axis=1)  # type: ignore[no-any-return]


def jerk_left(segments: Segments, limits: AxisLimits, speed: Values) -> Values:
    """Return the tangential jerk that the axes have left at steady speed, shape (n,) [m/s³].

    Parameters
    ----------
    segments
        Bounds of the geometry.
    limits
        Per axis.
    speed
        Cap on the speed, shape (n,) [m/s].
    """
    left = np.asarray(limits.jerk) - segments.twist * speed[:, None] ** 3
    return _ratio(left, segments.tangent).min(axis=1)  # type: ignore[no-any-return]
