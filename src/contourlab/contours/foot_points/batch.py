"""Local foot points by the million: the same steps as for one point, in chunks.

A chunk of points takes its first step together. Points whose stretch goes on are gathered, both
ways of each a lane of its own, and take one cell more; those that are done drop out, and the rest
are gathered again. So a point costs its own cells and not those of the slowest, and memory is that
of a chunk.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.bezier_tables import bezier_tables
from contourlab.contours.foot_points.by_kind import feet_by_kind, finish_by_kind
from contourlab.contours.foot_points.cells import Cells
from contourlab.contours.foot_points.formula_cells import FormulaCells
from contourlab.contours.foot_points.lanes import (
    SMALL,
    chunks,
    in_chunks,
    padded,
    rows_of,
    side_by_side,
    walkers_of,
    write_nearer,
)
from contourlab.contours.foot_points.local import (
    Foot,
    FootPoint,
    Start,
    Walker,
    finish,
    start,
    step,
)
from contourlab.contours.foot_points.path_cells import PathCells

__all__ = ["finish_all", "local_feet", "on_device"]

QUICK_STEPS = (3, 8)
"""Newton steps of the quick way: few for all points, more for those that need them."""
_ONE_BY_ONE = 6
"""Rounds of one cell each, before the stragglers go on together."""

Values = NDArray[Any]


def on_device(cells: Cells) -> Cells:
    """Return cells whose tables are JAX arrays, so that they are handed over once."""
    if isinstance(cells, PathCells) and cells.has_beziers:
        tables = bezier_tables(np.asarray(cells.contour.control_points))
        cells = dataclasses.replace(cells, tables=tables)
    return jax.tree.map(jnp.asarray, cells)  # type: ignore[no-any-return]


def _begin_one(cells: Cells, q: Any, near: Any, piece: Any) -> Start:
    return start(cells, q, *cells.place(near, piece))


@functools.partial(jax.jit, static_argnames="steps")
def _quick(cells: FormulaCells, q: Any, near: Any, steps: int) -> tuple[FootPoint, Any]:
    contour = cells.contour

    def one(q: Any, near: Any) -> tuple[FootPoint, Any]:
        row, s, lap = cells.place(near, None)
        at, squared, r, sure = cells.newton(q, s, steps)
        vector = r[0] - q
        norm = distance = jnp.sqrt(squared)
        if contour.n_axes == 2:
            across = r[1, 0] * vector[1] - r[1, 1] * vector[0]
            distance = across / jnp.sqrt(r[1, 0] ** 2 + r[1, 1] ** 2)
            if not contour.closed:
                end = (at <= 0.0) | (at >= cells.extent(row))
                distance = jnp.where(end, jnp.where(across < 0.0, -norm, norm), distance)
        return FootPoint(cells.parameter(row, at, lap), r[0], vector, distance), sure

    return jax.vmap(one)(q, near)


@jax.jit
def _begin(cells: Cells, q: Any, near: Any, piece: Any) -> Start:
    return jax.vmap(_begin_one, (None, 0, 0, 0))(cells, q, near, piece)


@jax.jit
def _go_on(
    cells: Cells, count: Any, q: Any, centre: Any, reach: Any, foot: Foot, walker: Walker
) -> tuple[Foot, Walker]:
    many = jax.vmap(step, (None, 0, 0, 0, 0, 0))

    def body(state: Any) -> Any:
        foot, walker, k = state
        return *many(cells, q, centre, reach, foot, walker), k + 1

    foot, walker, _ = jax.lax.while_loop(
        lambda state: jnp.any(state[1].left > 0) & (state[2] < count),
        body,
        (foot, walker, jnp.zeros((), jnp.int32)),
    )
    return foot, walker


@jax.jit
def _finish(cells: Cells, q: Any, foot: Foot) -> FootPoint:
    return jax.vmap(finish, (None, 0, 0))(cells, q, foot)


def finish_all(cells: Cells, points: Values, feet: Foot) -> FootPoint:
    """Return foot points from places on the contour.

    Parameters
    ----------
    cells
        The contour, on the device.
    points
        Shape (n, n_axes) [m].
    feet
        One per point.
    """
    if isinstance(cells, PathCells) and not cells.closed_form:
        return finish_by_kind(cells, points, feet)
    result = _empty(points)

    def work(at: slice, size: int) -> None:
        part = jax.tree.map(lambda x: x[at], feet)
        _store(result, at, _finish(cells, padded(points[at], size), padded(part, size)))

    side_by_side(work, chunks(len(points)))
    return result


def local_feet(cells: Cells, points: Values, near: Values) -> tuple[FootPoint, Values]:
    """Return the local foot point of every point, and which points are too far off to be done here.

    All of a path is in the ball of such a point, so that its local foot is the global one.

    Parameters
    ----------
    cells
        The contour, on the device.
    points, near
        Shapes (n, n_axes) [m] and (n,).
    """
    if isinstance(cells, FormulaCells):
        return _formula_feet(cells, points, near), np.zeros(0, np.intp)
    return _searched(cells, points, near)


def _formula_feet(cells: FormulaCells, points: Values, near: Values) -> FootPoint:
    """Return local feet on a formula contour: the quick way for all, the long one for the rest."""
    result, certain = _quickly(cells, points, near, QUICK_STEPS[0])
    rest = np.flatnonzero(~certain)
    for steps in QUICK_STEPS[1:]:
        if len(rest):
            found, certain = _quickly(cells, points[rest], near[rest], steps)
            _put(result, rest, found)
            rest = rest[~certain]
    if len(rest):
        _put(result, rest, _searched(cells, points[rest], near[rest])[0])
    return result


def _quickly(
    cells: FormulaCells, points: Values, near: Values, steps: int
) -> tuple[FootPoint, Values]:
    """Return feet by some Newton steps, and which of them are certain."""
    result, certain = _empty(points), np.zeros(len(points), bool)

    def work(at: slice, size: int) -> None:
        quick, sure = _quick(cells, *padded((points[at], near[at]), size), steps)
        _store(result, at, quick)
        certain[at] = np.asarray(sure)[: at.stop - at.start]

    side_by_side(work, chunks(len(points)))
    return result, certain


def _put(result: FootPoint, rows: Values, values: FootPoint) -> None:
    for whole, part in zip(result, values, strict=True):
        whole[rows] = part


def _empty(points: Values) -> FootPoint:
    n = len(points)
    return FootPoint(np.empty(n), np.empty_like(points), np.empty_like(points), np.empty(n))


def _searched(cells: Cells, points: Values, near: Values) -> tuple[FootPoint, Values]:
    n = len(points)
    result = _empty(points)
    breaks, ball, whole = None, None, np.zeros(n, bool)
    if isinstance(cells, PathCells):
        breaks, ball = np.asarray(cells.contour.breaks), _path_ball(cells)
        if not cells.closed_form:
            pieces = _pieces(breaks, near, cells.contour.closed)
            feet, whole = feet_by_kind(cells, points, near, pieces, ball)
            return finish_by_kind(cells, points, feet), np.flatnonzero(whole)

    def work(at: slice, size: int) -> None:
        q, parameter = padded((points[at], near[at]), size)
        begun = _begin(cells, q, parameter, _pieces(breaks, parameter, cells.contour.closed))
        n = at.stop - at.start
        if ball is not None:
            # a ball that holds the whole path: its stretch is all of it
            away = np.linalg.norm(np.asarray(begun.centre) - ball[0], axis=1) + ball[1]
            whole[at] = (away**2 <= np.asarray(begun.reach))[:n] & np.isfinite(begun.reach)[:n]
        foot = _walked(cells, q, begun, np.flatnonzero(~whole[at]))
        _store(result, at, _finish(cells, q, foot))

    side_by_side(work, chunks(n))
    return result, np.flatnonzero(whole)


def _path_ball(cells: PathCells) -> tuple[Values, float]:
    """Return a ball that holds a path."""
    path = cells.contour
    origin, length = np.asarray(path.origin), np.diff(np.asarray(path.breaks))
    centre = 0.5 * (origin.min(axis=0) + origin.max(axis=0))
    return centre, float(np.max(np.linalg.norm(origin - centre, axis=1) + length))


def _store(result: FootPoint, at: slice, values: FootPoint) -> None:
    for whole, part in zip(result, values, strict=True):
        whole[at] = np.asarray(part)[: at.stop - at.start]


def _pieces(breaks: Values | None, near: Values, closed: bool) -> Values:
    if breaks is None:
        return np.zeros(len(near), np.int32)
    start, end = breaks[0], breaks[-1]
    at = start + np.mod(near - start, end - start) if closed else near
    return np.searchsorted(breaks[1:-1], at, side="right").astype(np.int32)


def _walked(cells: Cells, q: Values, begun: Start, lanes: Values) -> Foot:
    """Return the best feet of a chunk, of which some lanes count."""
    best: Foot = begun.foot
    owner, state = walkers_of(begun, q, lanes)
    if not len(owner):
        return best
    best = Foot(*(np.array(x) for x in best))
    rounds = 0
    while len(owner):
        count = 1 if rounds < _ONE_BY_ONE else 8 if len(owner) > SMALL else 1 << 20
        way = functools.partial(_go_on, cells, np.int32(count))
        foot, walker = in_chunks(way, state)
        rounds += 1
        going = np.asarray(walker.left) > 0
        write_nearer(best, owner[~going], rows_of(foot, ~going))
        owner = owner[going]
        state = rows_of((*state[:3], foot, walker), going)
    return best
