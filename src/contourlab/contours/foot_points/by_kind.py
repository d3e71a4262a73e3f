"""Local feet on paths of several kinds of piece: each lane is worked on by the formula of its row.

Lines and planar arcs have closed forms; a Bézier row is taken whole where the error is small
against its curvature (:mod:`~contourlab.contours.foot_points.bezier_tables`), and by cells where it
is not; helices go by cells. Lanes are sorted by the kind of their row before every round, so that
none pays for the formula of another.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.bezier_tables import REACH, BezierTables
from contourlab.contours.foot_points.lanes import (
    FEW,
    in_chunks,
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
    advance,
    better,
    finish,
    start,
    step,
)
from contourlab.contours.foot_points.path_cells import PathCells
from contourlab.typing import Array

__all__ = ["KINDS", "by_kind", "feet_by_kind", "finish_by_kind", "row_kinds"]

KINDS = ("simple", "bezier", "helix")
SIMPLE, BEZIER, HELIX = range(3)
_STEPS = (3, 8)
"""Newton steps on a whole row: few for all lanes, more for those that need them."""
_TOGETHER = 1 << 15
"""Points walked together."""
_ROUNDS = 64
"""Rounds of one cell or row each, before the stragglers go on together, whatever their kind."""

Values = NDArray[Any]


def row_kinds(cells: PathCells) -> Values:
    """Return the kind of every piece of a path, as an index of ``KINDS``.

    Parameters
    ----------
    cells
        The path.
    """
    path = cells.contour
    turning = np.asarray(path.angle_rate) != 0.0
    rising = np.any(np.asarray(path.axial_vector) != 0.0, axis=-1)
    own = np.where(turning & rising, HELIX, SIMPLE)
    return np.where(np.asarray(path.bezier_row) >= 0, BEZIER, own)


def feet_by_kind(
    cells: PathCells, points: Values, near: Values, pieces: Values, ball: tuple[Values, float]
) -> tuple[Foot, Values]:
    """Return the feet of many points, and which of them have the whole path in their ball.

    Parameters
    ----------
    cells
        The path, on the device, with tables.
    points, near, pieces
        Shapes (n, n_axes) [m], (n,) and (n,): the piece of every reference parameter.
    ball
        Centre and radius of a ball that holds the path.

    Returns
    -------
    tuple
        The feet, right where the mask beside them, shape (n,), is false.
    """
    n, kinds = len(points), row_kinds(cells)
    feet = Foot(np.full(n, np.nan), np.zeros(n, np.int32), np.zeros(n), np.zeros(n, np.int32))
    whole = np.zeros(n, bool)

    def work(at: slice) -> None:
        given = (points[at], near[at], pieces[at])
        begun = by_kind(kinds[pieces[at]], functools.partial(_begun, cells), given)
        away = np.linalg.norm(begun.centre - ball[0], axis=1) + ball[1]
        whole[at] = (away**2 <= begun.reach) & np.isfinite(begun.reach)
        foot = _walked(cells, kinds, points[at], begun, np.flatnonzero(~whole[at]))
        for all_, part in zip(feet, foot, strict=True):
            all_[at] = part

    side_by_side(work, _slices(n))
    return feet, whole


def finish_by_kind(cells: PathCells, points: Values, feet: Foot) -> FootPoint:
    """Return foot points from places on a path.

    Parameters
    ----------
    cells
        The path, on the device, with tables.
    points
        Shape (n, n_axes) [m].
    feet
        One per point.
    """
    kinds, feet = row_kinds(cells), _right_side(cells, feet)
    n = len(points)
    result = FootPoint(np.empty(n), np.empty_like(points), np.empty_like(points), np.empty(n))

    def one_kind(kind: int, given: Any) -> FootPoint:
        return in_chunks(functools.partial(_finish, cells.only(KINDS[kind])), given)  # type: ignore[no-any-return]

    def work(at: slice) -> None:
        given = (points[at], rows_of(feet, at))
        for all_, part in zip(result, by_kind(kinds[feet.row[at]], one_kind, given), strict=True):
            all_[at] = part

    side_by_side(work, _slices(n))
    return result


def _slices(n: int) -> list[tuple[slice]]:
    edges = np.linspace(0, n, max(round(n / _TOGETHER), 1) + 1).astype(int)
    return [(slice(a, b),) for a, b in pairwise(edges) if b > a]


def by_kind(of_lane: Values, work: Callable[[int, Any], Any], given: Any) -> Any:
    """Return what is made of all lanes, kind by kind, in their order.

    Parameters
    ----------
    of_lane
        Kind of every lane, as an index of ``KINDS``; of one lane at least.
    work
        Takes a kind and the arrays of its lanes.
    given
        Arrays of all lanes.
    """
    order = [np.flatnonzero(of_lane == kind) for kind in range(len(KINDS))]
    parts = [work(kind, rows_of(given, at)) for kind, at in enumerate(order) if len(at)]
    back = np.argsort(np.concatenate(order), kind="stable")
    return jax.tree.map(lambda *x: np.concatenate(x)[back], *parts)


def _right_side(cells: PathCells, feet: Foot) -> Foot:
    """Return the same places, the end of a row as the start of the next."""
    path = cells.contour
    extent = np.where(np.asarray(path.bezier_row) >= 0, 1.0, np.diff(np.asarray(path.breaks)))
    last = feet.row + 1 >= cells.n_rows
    over = (feet.s >= extent[feet.row]) & (path.closed | ~last)
    row = np.where(over, np.where(last, 0, feet.row + 1), feet.row).astype(np.int32)
    lap = (feet.lap + (over & last)).astype(np.int32)
    return Foot(feet.squared, row, np.where(over, 0.0, feet.s), lap)


def _begun(cells: PathCells, kind: int, given: Any) -> Start:
    """Return the starts of lanes of a kind; a Bézier row is taken whole where that is certain."""
    by_cells = functools.partial(_begin, cells.only(KINDS[kind]))
    if kind != BEZIER:
        return in_chunks(by_cells, given)  # type: ignore[no-any-return]
    begun, sure = None, np.zeros(len(given[0]), bool)
    for steps in (*_STEPS, None):
        rest = np.flatnonzero(~sure)
        if not len(rest):
            break
        some = rows_of(given, rest)
        if steps is None:
            new, done = in_chunks(by_cells, some), True
        else:
            whole = functools.partial(_begin_rows, cells.only("whole"), np.int32(steps))
            new, done = in_chunks(whole, some)
        sure[rest] = done
        begun = new if begun is None else _replaced(begun, rest, new)
    return begun  # type: ignore[return-value]


def _replaced(tree: Any, rows: Values, new: Any) -> Any:
    """Return arrays with some rows replaced."""

    def one(values: Values, part: Values) -> Values:
        values = np.array(values)
        values[rows] = part
        return values

    return jax.tree.map(one, tree, new)


def _walked(cells: PathCells, kinds: Values, q: Values, begun: Start, lanes: Values) -> Foot:
    """Return the best feet of a chunk, of which some lanes count."""
    best = Foot(*(np.array(x) for x in begun.foot))
    owner, state = walkers_of(begun, q, lanes)
    rounds = 0
    while len(owner):
        if rounds < _ROUNDS:
            foot, walker = _stepped(cells, kinds, state)
        else:
            foot, walker = in_chunks(functools.partial(_go_on, cells), state)
        rounds += 1
        going = walker.left > 0
        write_nearer(best, owner[~going], rows_of(foot, ~going))
        owner = owner[going]
        state = rows_of((*state[:3], foot, walker), going)
    return best


def _stepped(cells: PathCells, kinds: Values, state: Any) -> tuple[Foot, Walker]:
    """Return all lanes one cell or row further, each by the formula of its row."""

    def one_kind(kind: int, state: Any) -> tuple[Foot, Walker]:
        by_cells = functools.partial(_step, cells.only(KINDS[kind]))
        if kind != BEZIER:
            return in_chunks(by_cells, state)  # type: ignore[no-any-return]
        whole = functools.partial(_step_rows, cells.only("whole"), np.int32(_STEPS[-1]))
        *new, sure = in_chunks(whole, state)
        rest = np.flatnonzero(~sure)
        if len(rest):
            new = _replaced(new, rest, list(in_chunks(by_cells, rows_of(state, rest), FEW)))
        return new[0], new[1]

    return by_kind(kinds[state[4].row], one_kind, state)  # type: ignore[no-any-return]


@jax.jit
def _begin(cells: PathCells, q: Any, near: Any, piece: Any) -> Start:
    def one(q: Any, near: Any, piece: Any) -> Start:
        return start(cells, q, *cells.place_on(near, piece))

    return jax.vmap(one)(q, near, piece)


@jax.jit
def _step(
    cells: PathCells, q: Any, centre: Any, reach: Any, foot: Foot, walker: Walker
) -> tuple[Foot, Walker]:
    return jax.vmap(step, (None, 0, 0, 0, 0, 0))(cells, q, centre, reach, foot, walker)


@jax.jit
def _go_on(
    cells: PathCells, q: Any, centre: Any, reach: Any, foot: Foot, walker: Walker
) -> tuple[Foot, Walker]:
    many = jax.vmap(step, (None, 0, 0, 0, 0, 0))
    return jax.lax.while_loop(
        lambda state: jnp.any(state[1].left > 0),
        lambda state: many(cells, q, centre, reach, *state),
        (foot, walker),
    )


@jax.jit
def _finish(cells: PathCells, q: Any, foot: Foot) -> FootPoint:
    return jax.vmap(finish, (None, 0, 0))(cells, q, foot)


@jax.jit
def _begin_rows(cells: PathCells, steps: Any, q: Any, near: Any, piece: Any) -> tuple[Start, Any]:
    def one(q: Any, near: Any, piece: Any) -> tuple[Start, Any]:
        # the barrier: else XLA works out the series again wherever u is used, in time and in code
        row, u, lap = jax.lax.optimization_barrier(cells.place_on(near, piece))  # type: ignore[no-untyped-call]
        centre = cells.curve(row, u, 0)[0]
        squared = jnp.sum((centre - q) ** 2)
        reach = 4.0 * squared
        s = cells.contour.wrap(near) - jnp.asarray(cells.contour.breaks)[row]
        foot, room, sure = _row(cells, q, centre, reach, row, u, s, lap, steps)
        total = (cells.total() + 2).astype(row.dtype)
        ways = []
        for sign, over in ((1, room[1]), (-1, room[0])):
            part = cells.parts(row) - 1 if sign > 0 else jnp.zeros_like(row)
            walker = Walker(row, part, lap, u, jnp.full_like(row, sign), total)
            ways.append(advance(cells, walker, centre, reach, over))
        foot = better(Foot(squared, row, u, lap), foot)
        return Start(centre, reach, foot, *ways), sure

    return jax.vmap(one)(q, near, piece)


@jax.jit
def _step_rows(
    cells: PathCells, steps: Any, q: Any, centre: Any, reach: Any, foot: Foot, walker: Walker
) -> tuple[Foot, Walker, Any]:
    def one(q: Any, centre: Any, reach: Any, foot: Foot, walker: Walker) -> Any:
        row, ahead = walker.row, walker.sign > 0
        begin, breaks = walker.begin, jnp.asarray(cells.contour.breaks)
        s = jnp.where(begin == 0.0, 0.0, breaks[row + 1] - breaks[row])
        new, room, sure = _row(cells, q, centre, reach, row, begin, s, walker.lap, steps)
        sure = sure & ((begin == 0.0) | (begin == 1.0))  # some cells of the row may be done
        end = walker._replace(part=jnp.where(ahead, cells.parts(row) - 1, 0).astype(row.dtype))
        over = jnp.where(ahead, room[1], room[0])
        return better(foot, new), advance(cells, end, centre, reach, over), sure

    return jax.vmap(one)(q, centre, reach, foot, walker)  # type: ignore[no-any-return]


def _row(
    cells: PathCells,
    q: Array,
    centre: Array,
    reach: Array,
    row: Array,
    begin: Array,
    s: Array,
    lap: Array,
    steps: Array,
) -> tuple[Foot, tuple[Array, Array], Array]:
    """Return the foot on a whole Bézier row, which ends are out of reach, and if it is certain.

    The stretch begins, or goes both ways, at ``begin``, an arc length ``s`` from the row's start.
    """
    path, tables = cells.contour, cells.tables
    assert isinstance(tables, BezierTables)
    at = cells.table_row(row)
    error = 0.5 * jnp.sqrt(reach)
    u, squared, place, sure = tables.nearest(at, q, begin, error, steps)
    breaks = jnp.asarray(path.breaks)
    length = breaks[row + 1] - breaks[row]
    # places are right to rounding, and so is the ball
    most = REACH * error + 1e-12 * length
    inside = jnp.sum((place - centre) ** 2) <= reach + 1e-30 * (1.0 + jnp.sum(centre**2))
    close = jnp.abs(u - begin) * tables.fastest[at] <= most
    sure = sure & close & (inside | (u == begin))
    return Foot(squared, row, u, lap), (s > most, length - s > most), sure
