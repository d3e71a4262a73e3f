"""Circular tests of ISO 230-4: deviations of an actual path from a circle.

References
----------
.. [ISO230-4] clauses on circular deviation G, bidirectional deviation G(b) and radial deviation F;
   clause numbers not checked.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from contourlab.errors import RecordingError

__all__ = [
    "CircularDeviation",
    "bidirectional_deviation",
    "circular_deviation",
    "least_squares_circle",
    "radial_deviations",
]

Points = NDArray[Any]

_RANK_TOLERANCE = 1e-10
"""Width over length below which points are a line: rounding of 1 mm of path 1 m from the origin
gives 1e-13, an arc of 1 mm on a radius of 1 km some 1e-7."""


class CircularDeviation(NamedTuple):
    """A pair of concentric circles that envelop a path with the least radial separation."""

    deviation: float
    """Their separation: G, or G(b) for two directions [m]."""
    centre: tuple[float, float]
    inner_radius: float
    outer_radius: float


def _planar(points: Any) -> Points:
    array = np.asarray(points, float)
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < 3:
        raise RecordingError(f"a circle needs points of shape (n >= 3, 2), got {array.shape}")
    if not np.isfinite(array).all():
        raise RecordingError("the points of a circle must be finite")
    spread = np.linalg.svd(array - array.mean(axis=0), compute_uv=False)
    if spread[1] <= _RANK_TOLERANCE * spread[0]:
        raise RecordingError("the points lie on a line: no circle fits them")
    return array


def _directions(offset: Points, distance: Points) -> Points:
    """Return the unit vectors of offsets; zero, a subgradient too, for a point on the centre."""
    return offset / np.where(distance > 0.0, distance, 1.0)[:, None]


def least_squares_circle(points: Any) -> tuple[tuple[float, float], float]:
    """Return centre and radius of the circle with the least sum of squared radial residuals.

    Parameters
    ----------
    points
        Shape (n, 2) [m].

    Raises
    ------
    RecordingError
        Fewer than three points, not planar, not finite, or on a line.
    """
    p = _planar(points)
    shift = p.mean(axis=0)
    q = p - shift
    # algebraic start, then Gauss-Newton on the radial residuals
    a = np.column_stack([2.0 * q, np.ones(len(q))])
    solution = np.linalg.lstsq(a, np.sum(q * q, axis=1), rcond=None)[0]
    centre = solution[:2]
    radius = float(np.sqrt(max(solution[2] + centre @ centre, 0.0)))
    for _ in range(20):
        offset = q - centre
        distance = np.linalg.norm(offset, axis=1)
        jacobian = np.column_stack([-_directions(offset, distance), -np.ones(len(q))])
        step = np.linalg.lstsq(jacobian, -(distance - radius), rcond=None)[0]
        centre, radius = centre + step[:2], radius + float(step[2])
        if np.abs(step).max() < 1e-15 * (1.0 + radius):
            break
    return (float(centre[0] + shift[0]), float(centre[1] + shift[1])), radius


def circular_deviation(points: Any) -> CircularDeviation:
    """Return G: the least radial separation of two concentric circles that envelop a path.

    The minimum zone is found by linear programmes in the centre's shift, repeated until it stands
    still; the path should cover most of a circle.

    Parameters
    ----------
    points
        Actual path, shape (n, 2) [m].

    Raises
    ------
    RecordingError
        Fewer than three points, not planar, not finite, or on a line; no minimum zone found.
    """
    p = _planar(points)
    centre = np.asarray(least_squares_circle(p)[0])
    for _ in range(50):
        offset = p - centre
        distance = np.linalg.norm(offset, axis=1)
        direction = _directions(offset, distance)
        scale = max(float(np.ptp(distance)), 1e-300)
        mean = float(distance.mean())
        residual = (distance - mean) / scale
        # unknowns: shift s, outer, inner; least outer - inner with inner <= r_i - u_i.s <= outer
        one, zero = np.ones(len(p)), np.zeros(len(p))
        a = np.concatenate(
            [np.column_stack([-direction, -one, zero]), np.column_stack([direction, zero, one])]
        )
        limit = np.concatenate([-residual, residual])
        bounds = [(-1.0, 1.0)] * 2 + [(None, None)] * 2
        answer = linprog([0, 0, 1, -1], A_ub=a, b_ub=limit, bounds=bounds, method="highs")
        if not answer.success:
            raise RecordingError(f"the minimum zone was not found: {answer.message}")
        shift = answer.x[:2] * scale
        trial = np.linalg.norm(p - (centre + shift), axis=1)
        if np.ptp(trial) >= np.ptp(distance) * (1.0 - 1e-13):
            break
        centre = centre + shift
    distance = np.linalg.norm(p - centre, axis=1)
    inner, outer = float(distance.min()), float(distance.max())
    return CircularDeviation(outer - inner, (float(centre[0]), float(centre[1])), inner, outer)


def bidirectional_deviation(clockwise: Any, counter_clockwise: Any) -> CircularDeviation:
    """Return G(b): the circular deviation of two paths, one in each direction, taken together.

    Parameters
    ----------
    clockwise, counter_clockwise
        Actual paths, shape (n, 2) [m].
    """
    return circular_deviation(np.concatenate([_planar(clockwise), _planar(counter_clockwise)]))


def radial_deviations(
    points: Any, radius: float, centre: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Return F_max and F_min: the largest and smallest radial deviation from a nominal circle [m].

    Parameters
    ----------
    points
        Actual path, shape (n, 2) [m].
    radius
        Nominal radius [m].
    centre
        Centre of the nominal circle [m]; that of the least-squares circle if None.
    """
    p = _planar(points)
    if not radius > 0:
        raise RecordingError(f"radius must be > 0 m, got {radius}")
    at = least_squares_circle(p)[0] if centre is None else centre
    deviation = np.linalg.norm(p - np.asarray(at), axis=1) - radius
    return float(deviation.max()), float(deviation.min())
