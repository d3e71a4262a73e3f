"""The public foot point of many points: local where reference parameters are given, else global."""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.batch import local_feet, on_device
from contourlab.contours.foot_points.contour_cells import cells_of
from contourlab.contours.foot_points.everywhere import global_feet
from contourlab.contours.foot_points.local import FootPoint
from contourlab.errors import GeometryError

__all__ = ["foot_point"]


def foot_point(contour: Contour, points: Any, near: Any = None) -> FootPoint:
    """Return the exact foot points of many points on a contour.

    *Local*, with ``near``: the nearest point on the connected stretch of contour around the
    reference parameter that stays within 2 e of the reference point r(near), e being the distance
    of the point from it; the stretch ends at the ends of an open contour and goes round a closed
    one. *Global*, without: the nearest point of the whole contour.

    Lines and planar arcs are solved in closed form, in any number of axes, and their stretches are
    followed exactly. Helices, Bézier pieces and formula contours are searched cell by cell, with
    Newton's method kept inside brackets; it is assumed that a cell (a turn of π/4, an eighth of a
    Bézier piece, 1/1024 of a formula's domain) hides no second stationary point between two of
    five looks, and that the distance peaks in it once at most. On formula contours a point whose
    error is small against the radius of curvature, certified from sampled curvatures, takes a
    shorter way.

    Distances are right to rounding. Where the point is at the centre of curvature of its foot, the
    distance is as good, but the parameter is only good to the square or fourth root of rounding.

    Parameters
    ----------
    contour
        Any contour.
    points
        Actual positions, shape (n, n_axes) [m].
    near
        Reference parameters, shape (n,); clipped to the domain of an open contour.

    Returns
    -------
    FootPoint
        ``parameter`` (n,), continuous with ``near`` on a closed contour; ``position`` and
        ``vector`` = foot - point, (n, n_axes) [m]; ``distance`` (n,) [m], in the plane the
        component of ``vector`` along the left normal (at corners and ends the norm, with the sign
        of the cross product of the right-sided tangent and ``vector``), else the norm. NaN where
        the point or its reference parameter is NaN or infinite.

    Raises
    ------
    GeometryError
        ``points`` or ``near`` of a wrong shape.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != contour.n_axes:
        raise GeometryError(
            f"points must have shape (n, {contour.n_axes}) on a contour of {contour.n_axes} axes, "
            f"got {points.shape}"
        )
    if near is not None:
        near = np.asarray(near, dtype=float)
        if near.shape != points.shape[:1]:
            raise GeometryError(f"near must have shape ({len(points)},), got {near.shape}")
    cells = on_device(cells_of(contour))
    if near is None:
        return global_feet(cells, points)
    foot, far = local_feet(cells, points, near)
    if len(far):
        for values, replaced in zip(foot, global_feet(cells, points[far]), strict=True):
            values[far] = replaced
        if contour.closed:
            start, end = (float(edge) for edge in contour.domain)
            laps = np.round((near[far] - foot.parameter[far]) / (end - start))
            foot.parameter[far] += laps * (end - start)
    return foot
