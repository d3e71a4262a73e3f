"""Whether another point of the contour is as near: then the foot point is not determined."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.certified import dot
from contourlab.contours.foot_points.everywhere import fragments_of
from contourlab.contours.foot_points.foot_point import curve_of
from contourlab.contours.foot_points.lanes import SMALL, side_by_side, slices
from contourlab.contours.foot_points.local import FootPoint
from contourlab.errors import GeometryError

__all__ = ["tied_parameter"]

_APART = 1e-3
_NEAR = 1e-9

Values = NDArray[Any]


def tied_parameter(
    contour: Contour,
    points: Any,
    foot: FootPoint,
    *,
    apart: float | None = None,
    tolerance: float | None = None,
) -> Values:
    """Return the parameter of another point of the contour that is as near as the foot point.

    Where there is one, the global foot point is ambiguous: the least disturbance moves it at least
    ``apart``. So it is for a point on the medial axis, at the centre of a circle, or on the evolute
    where the contour hugs a circle about the point. Points that tie within one short fragment of
    the contour (some 1/4096 of its length, and one piece of a path at most) are not told apart.

    Parameters
    ----------
    contour
        Any contour.
    points
        Actual positions, shape (n, n_axes) [m].
    foot
        Their foot points, from :func:`~contourlab.contours.foot_point` without ``near``.
    apart
        How far from the foot point another point must be [m]; 1e-3 of the contour's size if None.
    tolerance
        How much further from the actual position it may be [m]; 1e-9 of the contour's size if None.

    Returns
    -------
    Values
        Shape (n,); NaN where nothing ties.

    Raises
    ------
    GeometryError
        ``points`` that do not match ``foot``; a distance that is not > 0.
    """
    points = np.asarray(points, dtype=float)
    position = np.asarray(foot.position)
    if points.shape != position.shape or points.ndim != 2:
        raise GeometryError(f"points must have the shape of foot.position, {position.shape}")
    curve = curve_of(contour)
    apart = _APART * curve.size if apart is None else float(apart)
    tolerance = _NEAR * curve.size if tolerance is None else float(tolerance)
    for name, value in (("apart", apart), ("tolerance", tolerance)):
        if not value > 0.0:
            raise GeometryError(f"{name} must be > 0 m, got {value:g}")
    fragments = fragments_of(curve)
    largest = float(fragments.radius.max())
    limit = np.linalg.norm(np.asarray(foot.vector), axis=1) + tolerance
    result = np.full(len(points), np.nan)

    def work(at: slice) -> None:
        some = at.start + np.flatnonzero(np.isfinite(limit[at]))
        if not len(some):
            return
        found = fragments.tree.query_ball_point(points[some], limit[some] + largest)
        count = np.array([len(index) for index in found])
        which = np.concatenate([np.asarray(index, int) for index in found])
        own = np.repeat(some, count)
        row, low, high = fragments.row[which], fragments.low[which], fragments.high[which]
        q = np.ascontiguousarray(points[own].T)
        s, squared = curve.nearest(q, row, low, high, (limit[own] * (1.0 + 1e-9)) ** 2)
        d, slope, _ = curve.look(row, s, q, 1)
        off = d - (position[own].T - q)
        tied = (np.sqrt(squared) <= limit[own]) & (dot(off, off) >= apart * apart)
        parameter = curve.parameter(row, s, np.zeros(len(row)), slope)
        order = np.flatnonzero(tied)
        order = order[np.argsort(-squared[order], kind="stable")]  # the nearest is written last
        result[own[order]] = parameter[order]

    side_by_side(work, [(at,) for at in slices(len(points), SMALL)])
    return result
