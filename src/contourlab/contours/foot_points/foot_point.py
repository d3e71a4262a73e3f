"""The public foot point of many points: local where reference parameters are given, else global."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.blocks import Blocks
from contourlab.contours.foot_points.certified import Curve, Places, dot
from contourlab.contours.foot_points.contour_cells import cells_of
from contourlab.contours.foot_points.everywhere import fragments_of, global_feet
from contourlab.contours.foot_points.formula_cells import FormulaCells
from contourlab.contours.foot_points.formula_feet import FormulaCurve
from contourlab.contours.foot_points.lanes import LARGE, side_by_side, slices
from contourlab.contours.foot_points.local import FootPoint
from contourlab.contours.foot_points.path_feet import path_feet
from contourlab.contours.foot_points.path_table import PathTable
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

__all__ = ["curve_of", "foot_point"]

Values = NDArray[Any]


def foot_point(contour: Contour, points: Any, near: Any = None) -> FootPoint:
    """Return the exact foot points of many points on a contour.

    *Local*, with ``near``: the nearest point on the connected stretch of contour around the
    reference parameter that stays within 2 e of the reference point r(near), e being the distance
    of the point from it; the stretch ends at the ends of an open contour and goes round a closed
    one. *Global*, without: the nearest point of the whole contour.

    Lines and planar arcs are solved in closed form, in any number of axes. On helices, Bézier
    pieces and formula contours every stretch is either shown to hold no nearer point, or to hold
    one minimum, to which Newton's method converges; that rests on bounds of derivatives
    (:mod:`~contourlab.contours.foot_points.certified`), not on sampled distances. The bounds are
    certain on paths; on formula contours they are taken from 4096 looks, as
    :func:`~contourlab.contours.foot_points.formula_cells.formula_tables` says.

    Distances are right to 1e-13 of the contour's size or better. Where a point is at the centre of
    curvature of its foot the parameter is only good to the square or fourth root of rounding, and
    at the centre of a circle it is any. Of two feet that are equally near one
    is returned; :func:`~contourlab.contours.tied_parameter` tells of the other.

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
    points = _numbers("points", points)
    if points.ndim != 2 or points.shape[1] != contour.n_axes:
        raise GeometryError(
            f"points must have shape (n, {contour.n_axes}) on a contour of {contour.n_axes} axes, "
            f"got {points.shape}"
        )
    if near is not None:
        near = _numbers("near", near)
        if near.shape != points.shape[:1]:
            raise GeometryError(f"near must have shape ({len(points)},), got {near.shape}")
    n = len(points)
    result = FootPoint(np.empty(n), np.empty_like(points), np.empty_like(points), np.empty(n))
    if n == 0:
        return result
    curve = curve_of(contour)
    fragments = fragments_of(curve) if near is None else None
    blocks = Blocks(curve) if isinstance(curve, PathTable) else None

    def work(at: slice) -> None:
        part = points[at]
        if fragments is not None:
            columns = np.ascontiguousarray(part.T)
            _store(result, at, _finished(curve, columns, global_feet(curve, fragments, columns)))
        elif isinstance(curve, PathTable):
            assert blocks is not None
            columns = np.ascontiguousarray(part.T)
            _store(
                result, at, _finished(curve, columns, path_feet(curve, columns, near[at], blocks))
            )
        else:
            foot, sure = curve.quick(part, near[at])
            _store(result, at, foot)
            rest = np.flatnonzero(~sure)
            if len(rest):
                columns = np.ascontiguousarray(part[rest].T)
                found = curve.search(columns, near[at][rest])
                _store(result, at.start + rest, _finished(curve, columns, found))

    side_by_side(work, [(at,) for at in slices(n, LARGE)])
    return result


def _numbers(name: str, values: Any) -> Values:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise GeometryError(f"{name} must be an array of numbers") from None


def curve_of(contour: Contour) -> PathTable | FormulaCurve:
    """Return a contour as rows that are worked out for many points at a time.

    Parameters
    ----------
    contour
        Any contour.
    """
    if isinstance(contour, Path):
        return PathTable(contour)
    cells = cells_of(contour)
    assert isinstance(cells, FormulaCells)
    return FormulaCurve(cells)


def _store(result: FootPoint, at: Any, part: FootPoint) -> None:
    for whole, values in zip(result, part, strict=True):
        whole[at] = values


def _finished(curve: Curve, points: Values, places: Places) -> FootPoint:
    """Return foot points from places on the contour; points are columns."""
    row, s, lap = curve.right_side(places.row, places.s, places.lap)
    with np.errstate(invalid="ignore", over="ignore"):
        vector, slope, _ = curve.look(row, s, points, 1)
        squared, speed2 = dot(vector, vector), dot(slope, slope)
        norm = distance = np.sqrt(squared)
        if len(points) == 2:
            across = slope[0] * vector[1] - slope[1] * vector[0]
            # at a minimum inside a piece g is rounding; at a corner or an end it is not
            g = dot(vector, slope)
            inside = g * g <= speed2 * (1e-14 * squared + (0.1 * curve.rounding) ** 2)
            inside &= speed2 > 0.0
            signed = np.where(across < 0.0, -norm, norm)
            distance = np.where(inside, across / np.sqrt(np.where(inside, speed2, 1.0)), signed)
    parameter = curve.parameter(row, s, lap, slope)
    lost = np.isnan(places.squared)
    if lost.any():
        vector[:, lost] = parameter[lost] = distance[lost] = np.nan
    return FootPoint(parameter, (points + vector).T, vector.T, distance)
