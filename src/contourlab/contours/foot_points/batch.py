"""Local foot points by the million: the same steps as for one point, in chunks.

A chunk of points takes its first step together. Points whose stretch goes on are gathered, both
ways of each a lane of its own, and take one cell more; those that are done drop out, and the rest
are gathered again. So a point costs its own cells and not those of the slowest, and memory is that
of a chunk.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.cells import Cells
from contourlab.contours.foot_points.formula_cells import FormulaCells
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

__all__ = ["LARGE", "SMALL", "finish_all", "local_feet", "on_device", "padded", "side_by_side"]

LARGE, SMALL = 1 << 16, 1 << 11
"""Lanes of a chunk: of two sizes only, so that nothing is compiled for a new number of points."""
QUICK_STEPS = (3, 8)
"""Newton steps of the quick way: few for all points, more for those that need them."""
_ONE_BY_ONE = 6
"""Rounds of one cell each, before the stragglers go on together."""

Values = NDArray[Any]


def on_device(cells: Cells) -> Cells:
    """Return cells whose tables are JAX arrays, so that they are handed over once."""
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
    cells: Cells, q: Any, centre: Any, reach: Any, foot: Foot, walker: Walker, count: Any
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


def padded(values: Any, size: int) -> Any:
    """Return arrays with their last rows repeated up to a size; none may be empty."""

    def one(x: Values) -> Values:
        x = np.asarray(x)
        more = size - len(x)
        return np.concatenate([x, np.repeat(x[-1:], more, axis=0)]) if more else x

    return jax.tree.map(one, values)


def chunks(n: int) -> list[tuple[slice, int]]:
    """Return slices that cover n points, each with the size that it is padded to."""
    size = SMALL if n <= SMALL else LARGE
    return [(slice(k, min(k + size, n)), size) for k in range(0, n, size)]


def side_by_side(work: Callable[[slice, int], None], n: int) -> None:
    """Do the chunks of n points, as many at a time as there are processors.

    Parameters
    ----------
    work
        Takes a slice of the points and the size that it is to be padded to.
    n
        Number of points.
    """
    jobs = chunks(n)
    if len(jobs) < 2:
        for job in jobs:
            work(*job)
        return
    with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
        list(pool.map(work, *zip(*jobs, strict=True)))


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
    result = _empty(points)

    def work(at: slice, size: int) -> None:
        part = jax.tree.map(lambda x: x[at], feet)
        _store(result, at, _finish(cells, padded(points[at], size), padded(part, size)))

    side_by_side(work, len(points))
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

    side_by_side(work, len(points))
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

    side_by_side(work, n)
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
    owner, state = _still(begun, q, lanes)
    if not len(owner):
        return best
    best = Foot(*(np.array(x) for x in best))
    rounds = 0
    while len(owner):
        count = 1 if rounds < _ONE_BY_ONE else 8 if len(owner) > SMALL else 1 << 20
        foot, walker = _stepped(cells, state, count)
        rounds += 1
        going = np.asarray(walker.left) > 0
        _keep(best, owner[~going], _rows(foot, ~going))
        owner = owner[going]
        state = _rows((*state[:3], foot, walker), going)
    return best


def _rows(tree: Any, which: Values) -> Any:
    return jax.tree.map(lambda x: x[which], tree)


def _still(begun: Start, q: Values, lanes: Values) -> tuple[Values, Any]:
    """Return the lanes that go on, both ways, and whose they are."""
    ways = [lanes[np.asarray(w.left)[lanes] > 0] for w in (begun.ahead, begun.behind)]
    owner = np.concatenate(ways)
    walker = jax.tree.map(
        lambda a, b: np.concatenate([np.asarray(a)[ways[0]], np.asarray(b)[ways[1]]]),
        begun.ahead,
        begun.behind,
    )
    rest = (q, begun.centre, begun.reach, begun.foot)
    return owner, (*jax.tree.map(lambda x: np.asarray(x)[owner], rest), walker)


def _stepped(cells: Cells, state: Any, count: int) -> tuple[Foot, Walker]:
    parts = []
    n = len(state[2])
    at = 0
    while at < n:
        size = SMALL if n - at <= 2 * SMALL else LARGE
        lanes = slice(at, min(at + size, n))
        some = padded(jax.tree.map(lambda x, lanes=lanes: x[lanes], state), size)
        done = _go_on(cells, *some, np.int32(count))
        parts.append(jax.tree.map(lambda x, m=lanes.stop - at: np.asarray(x)[:m], done))
        at = lanes.stop
    return jax.tree.map(lambda *x: np.concatenate(x), *parts)  # type: ignore[no-any-return]


def _keep(best: Foot, owner: Values, foot: Foot) -> None:
    """Write into ``best`` what is nearer; both ways of one point may be among the lanes."""
    for half in _once_each(owner):
        at = owner[half]
        nearer = foot.squared[half] < best.squared[at]
        for whole, part in zip(best, foot, strict=True):
            whole[at[nearer]] = part[half][nearer]


def _once_each(owner: Values) -> list[Values]:
    """Return masks in each of which no owner comes twice; owners come in two rising runs."""
    turn = np.flatnonzero(np.diff(owner) <= 0)
    first = np.arange(len(owner)) <= (turn[0] if len(turn) else len(owner))
    return [first, ~first]
