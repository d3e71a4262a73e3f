"""Splines through points: interpolating, or smoothing within a stated distance.

Fitted by scipy: at parameters chosen from the points' distances, the interpolating spline ends
"not-a-knot" (closed: periodic), the smoothing one has as few knots as its sum of squares allows
(FITPACK). Every fit says how far from the curve the points are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from scipy.interpolate import BSpline as ScipySpline
from scipy.interpolate import make_interp_spline, splprep

from contourlab.contours.bspline import BSpline
from contourlab.errors import ConfigurationError, GeometryError, choices

__all__ = ["SplineFit", "interpolating_spline", "smoothing_spline"]

PARAMETRISATIONS = {"chord": 1.0, "centripetal": 0.5, "uniform": 0.0}
"""Power of the distance between two points by which the parameter grows."""

_ATTEMPTS = 24
"""How often the sum of squares is lowered until every point is within the tolerance."""
_LOWER = 0.5
_PINNED = 1e4
"""Weight of the ends of an open curve, others having 1."""
_STEPS = 8
"""Newton steps from a point's own parameter to the foot."""
_MOST_AXES = 10
"""What FITPACK takes."""

Rows = NDArray[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class SplineFit:
    """A spline through points, and how far from it they are."""

    spline: BSpline
    """The curve; its parameter goes from 0 to 1."""
    parameters: Float[np.ndarray, " n_points"]
    """Where on the curve each point was put."""
    distances: Float[np.ndarray, " n_points"]
    """From each point to the curve near its parameter [m]."""

    @property
    def max_error(self) -> float:
        """The greatest distance [m]."""
        return float(np.max(self.distances))

    @property
    def rms_error(self) -> float:
        """Root of the mean square of the distances [m]."""
        return float(np.sqrt(np.mean(self.distances**2)))


def interpolating_spline(
    points: Any, *, degree: int = 3, closed: bool = False, parametrisation: str = "centripetal"
) -> SplineFit:
    """Return the spline through all points.

    Parameters
    ----------
    points
        Shape (n_points, n_axes) [m], more than ``degree``; no two neighbours equal. Closed, the
        first may be repeated at the end or not.
    degree
        1 to 25; odd ones are usual.
    closed
        Whether the last point is joined to the first, smoothly.
    parametrisation
        How the parameter grows from point to point: with the distance (``"chord"``), with its root
        (``"centripetal"``, which overshoots least where points lie unevenly), or ``"uniform"``.

    Raises
    ------
    GeometryError
        Too few points, repeated ones, or one that is not finite; says which.
    ConfigurationError
        An option that is not allowed.
    """
    points = _checked(points, degree, closed)
    u = _parameters(points, parametrisation)
    try:
        fit = make_interp_spline(u, points, k=degree, bc_type="periodic" if closed else None)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise GeometryError(f"no spline of degree {degree} goes through the points: {error}") from (
            None
        )
    return _result(fit, u, points, degree, closed)


def smoothing_spline(
    points: Any, *, tolerance: float, degree: int = 3, closed: bool = False,
    parametrisation: str = "centripetal",
) -> SplineFit:  # fmt: skip
    """Return a spline with few knots from which no point is further than a tolerance.

    Open, it begins and ends in the first and the last point.

    Parameters
    ----------
    points
        Shape (n_points, n_axes), up to 10 axes [m], more than ``degree``; no two neighbours equal.
    tolerance
        Greatest distance of a point from the curve, > 0 [m].
    degree
        1 to 5.
    closed, parametrisation
        As in :func:`interpolating_spline`.

    Raises
    ------
    GeometryError
        Too few points, repeated ones, or one that is not finite; says which. A tolerance that
        cannot be met.
    ConfigurationError
        An option that is not allowed.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise ConfigurationError(f"tolerance must be > 0 m, got {tolerance}")
    if not 1 <= degree <= 5:
        raise ConfigurationError(f"degree of a smoothing spline must be 1 to 5, got {degree!r}")
    points = _checked(points, degree, closed)
    if points.shape[1] > _MOST_AXES:
        raise ConfigurationError(
            f"a smoothing spline takes {_MOST_AXES} axes or fewer, got {points.shape[1]}"
        )
    u = _parameters(points, parametrisation)
    total = len(points) * tolerance**2  # of squares, if each were just within
    for _ in range(_ATTEMPTS):
        tck = _fitpack(points, u, degree, closed, total)
        control = np.array(tck[1]).T
        if not closed:  # which the weights have brought nearly there
            control[0], control[-1] = points[0], points[-1]
        fit = ScipySpline(tck[0], control, degree)
        if np.max(_distances(fit, u, points)) <= tolerance:
            result = _result(fit, u, points, degree, closed)
            if result.max_error <= tolerance:
                return result
        total *= _LOWER
    exact = interpolating_spline(
        points, degree=degree, closed=closed, parametrisation=parametrisation
    )
    if exact.max_error > tolerance:
        raise GeometryError(
            f"the points cannot be followed within {tolerance:.3g} m: the spline through all of "
            f"them is {exact.max_error:.3g} m away"
        )
    return exact


def _fitpack(points: Rows, u: Rows, degree: int, closed: bool, total: float) -> Any:
    try:
        weights = np.ones(len(points))
        if not closed:
            weights[[0, -1]] = _PINNED
        tck, _ = splprep(
            list(points.T), w=weights, u=u, k=degree, s=total, per=int(closed), quiet=2
        )
    except (ValueError, TypeError) as error:
        raise GeometryError(f"no smoothing spline was found: {error}") from None
    return tck


def _checked(points: Any, degree: int, closed: bool) -> Rows:
    try:
        rows = np.array(points, float)
    except (TypeError, ValueError):
        raise GeometryError("points must be numbers of shape (n_points, n_axes)") from None
    if rows.ndim != 2 or rows.shape[1] == 0:
        raise GeometryError(f"points must have shape (n_points, n_axes), got {rows.shape}")
    if isinstance(degree, bool) or not isinstance(degree, int) or degree < 1:
        raise ConfigurationError(f"degree must be a whole number >= 1, got {degree!r}")
    if not np.isfinite(rows).all():
        at = int(np.argmin(np.isfinite(rows).all(axis=1)))
        raise GeometryError(f"points must be finite, got points[{at}] = {rows[at]}")
    if closed and not (len(rows) and np.array_equal(rows[0], rows[-1])):
        rows = np.concatenate([rows, rows[:1]])
    count = len(rows) - int(closed)
    if count <= degree:
        raise GeometryError(f"degree {degree} needs more than {degree} points, got {count}")
    same = np.all(rows[1:] == rows[:-1], axis=1)
    if same.any():
        at = int(np.argmax(same))
        raise GeometryError(f"points[{at}] and the next are the same, {rows[at]}: remove one")
    return rows


def _parameters(points: Rows, parametrisation: str) -> Rows:
    if parametrisation not in PARAMETRISATIONS:
        raise ConfigurationError(
            f"unknown parametrisation {parametrisation!r}; "
            + choices(parametrisation, PARAMETRISATIONS)
        )
    distance = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.concatenate([[0.0], np.cumsum(distance ** PARAMETRISATIONS[parametrisation])])
    u /= u[-1]
    if not (np.diff(u) > 0.0).all():
        at = int(np.argmin(np.diff(u) > 0.0))
        raise GeometryError(
            f"points[{at}] and the next are {distance[at]:.3g} m apart, below rounding of the whole"
        )
    return u


def _result(fit: Any, u: Rows, points: Rows, degree: int, closed: bool) -> SplineFit:
    knots, control = np.array(fit.t), np.array(fit.c)
    if closed:
        n = len(control) - degree
        control, knots = control[:n], knots[degree : n + degree + 1]
    spline = BSpline(control_points=control, knots=knots, degree=degree, closed=closed)
    return SplineFit(spline=spline, parameters=u, distances=_distances(fit, u, points))


def _distances(fit: Any, u: Rows, points: Rows) -> Rows:
    """Return the distance of every point from the curve near its parameter, never too small."""
    offset = fit(u) - points
    best = np.linalg.norm(offset, axis=1)
    at = u
    step_limit = np.gradient(u)  # a foot is looked for no further than the next point
    for _ in range(_STEPS if fit.k > 1 else 1):
        slope, bend = fit(at, 1), fit(at, 2)
        first = np.sum(offset * slope, axis=1)
        second = np.sum(slope * slope, axis=1) + np.sum(offset * bend, axis=1)
        convex = second > 0.0
        step = np.where(convex, -first / np.where(convex, second, 1.0), 0.0)
        at = np.clip(at + np.clip(step, -step_limit, step_limit), u[0], u[-1])
        offset = fit(at) - points
        best = np.minimum(best, np.linalg.norm(offset, axis=1))
    return best  # type: ignore[no-any-return]
