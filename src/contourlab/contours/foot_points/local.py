"""The local foot point: the nearest point on the stretch of contour around a reference point.

With e the distance of the point from the reference point r(near), the stretch is followed from
``near`` both ways, cell by cell, until it first leaves the ball of radius 2e about r(near), or
ends, or has gone round. The foot is the nearest point of all its cells.

A foot point is never further than e from the point, hence never outside the ball. So a cell need
not be cut where it leaves the ball: up to the first peak of the distance from r(near) that is
higher than 2e, whatever lies in the ball lies in the stretch.

The work is bounded: two more cells than the contour has, ``INTERVALS`` looks in each, and
``NEWTON_STEPS`` steps where a look finds a minimum, or ``BISECTIONS`` in a cell with a corner or a
jump of curvature. One look is usual, and with an error small
beside the radius of curvature a few cells, or on a formula contour four steps and no cells at all.

Everything here is traceable, for one point; ``jax.vmap`` outside gives batches.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.cells import Cells
from contourlab.contours.foot_points.contour_cells import cells_of
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = [
    "Foot",
    "FootPoint",
    "Start",
    "Walker",
    "advance",
    "better",
    "finish",
    "local_foot",
    "search",
    "start",
    "step",
    "walk",
]


class FootPoint(NamedTuple):
    """Foot points, one per row, or one alone from :func:`local_foot`."""

    parameter: Any
    """Parameter of the contour, shape (n,); of a closed contour continued past its seam."""
    position: Any
    """The foot point, shape (n, n_axes) [m]."""
    vector: Any
    """From the point to the foot, the contour error vector, shape (n, n_axes) [m]."""
    distance: Any
    """Contour error [m], shape (n,): in the plane along the left normal, a norm otherwise."""


class Foot(NamedTuple):
    """A place on the contour, and its squared distance from the point."""

    squared: Array
    row: Array
    s: Array
    lap: Array


class Walker(NamedTuple):
    """One of the two ways along the stretch: the cell that comes next, and the ball."""

    row: Array
    part: Array
    lap: Array
    begin: Array
    """Where in the row the walk through this cell begins."""
    sign: Array
    left: Array
    """Cells that may still be walked; 0 once the stretch has ended."""


class Start(NamedTuple):
    """Where the walk begins."""

    centre: Array
    reach: Array
    """Square of the ball's radius."""
    foot: Foot
    ahead: Walker
    behind: Walker


def local_foot(
    contour: Contour | Cells,
    point: AxisVector,
    near: Scalar,
    piece: Count | None = None,
) -> FootPoint:
    """Return the foot point of one point, near a reference parameter; for use inside a loop.

    Traceable, and ``vmap`` outside gives batches. Its derivatives are those of the foot point on
    the piece of contour where it lies (at a corner or an end it stays there); ``near`` only chooses
    the stretch, so nothing is differentiated through it.

    Parameters
    ----------
    contour
        The contour, or what :func:`cells_of` made of it before the loop, which for a formula
        contour saves a table.
    point
        Shape (n_axes,) [m].
    near
        Reference parameter; clipped to the domain of an open contour.
    piece
        Where to look for ``near`` first, as in ``contour.locate``; by bisection when None.

    Returns
    -------
    FootPoint
        ``parameter`` and ``distance`` scalars, ``position`` and ``vector`` of shape (n_axes,).
    """
    cells = contour if isinstance(contour, Cells) else cells_of(contour)
    fixed, q, at = jax.lax.stop_gradient(
        (cells, jnp.asarray(point, float), jnp.asarray(near, float))
    )
    hint = None if piece is None else jnp.asarray(piece, jnp.int32)
    row, s, lap = fixed.place(at, hint)
    foot = search(fixed, q, row, s, lap)
    return finish(cells, jnp.asarray(point, float), foot)


def search(cells: Cells, q: Array, row: Array, s: Array, lap: Array) -> Foot:
    """Return the foot of one point: by the quick way where that is certain, else by walking.

    Parameters
    ----------
    cells, q, row, s, lap
        As in :func:`start`.
    """
    at, squared, sure = cells.quick(q, s)
    quick = Foot(squared, row, at, lap)
    # a loop that runs once or never: a batch whose points are all certain skips the rest
    foot, _ = jax.lax.while_loop(
        lambda state: state[1],
        lambda state: (walk(cells, q, start(cells, q, row, s, lap)), jnp.zeros((), bool)),
        (quick, ~sure),
    )
    return foot


def start(cells: Cells, q: Array, row: Array, s: Array, lap: Array) -> Start:
    """Return the nearest point in the cell of the reference point, and the two walkers.

    Parameters
    ----------
    cells
        The contour.
    q
        The point, shape (n_axes,).
    row, s, lap
        The reference point.
    """
    centre = cells.curve(row, s, 0)[0]
    d = centre - q
    squared = d @ d
    reach = 4.0 * squared
    part = cells.find(row, s)
    moving = (squared > 0.0) & jnp.isfinite(squared)
    # once round, and the rest of the first cell from its far side
    total = jnp.where(moving, cells.total() + 2, 0).astype(row.dtype)
    foot = Foot(squared, row, s, lap)
    ways = [jnp.full_like(row, sign) for sign in (1, -1)]
    walkers = [Walker(row, part, lap, s, way, total) for way in ways]
    if not cells.closed_form:
        return Start(centre, reach, foot, *walkers)
    # the closed form takes both sides of the reference point at once
    low, high = cells.bounds(row, part)
    top, over_top = cells.cut(row, centre, reach, s, high)
    bottom, over_bottom = cells.cut(row, centre, reach, s, low)
    at, squared = cells.on_arc(row, q, bottom, top)
    squared = jnp.where(moving, squared, jnp.inf)
    foot = better(foot, Foot(squared, row, at, lap))
    for k, over in enumerate((over_top, over_bottom)):
        walkers[k] = advance(cells, walkers[k], centre, reach, over)
    return Start(centre, reach, foot, *walkers)


def step(
    cells: Cells, q: Array, centre: Array, reach: Array, foot: Foot, walker: Walker
) -> tuple[Foot, Walker]:
    """Return the better foot after one more cell, and the walker behind it.

    Parameters
    ----------
    cells, q
        As in :func:`start`.
    centre, reach
        The ball.
    foot
        The best so far.
    walker
        The cell to look at.
    """
    row, part, going = walker.row, walker.part, walker.left > 0
    low, high = cells.bounds(row, part)
    begin = walker.begin
    at, squared, over = cells.along(
        row, part, q, (centre, reach), begin, jnp.where(walker.sign > 0, high, low),
        foot.squared, going,
    )  # fmt: skip
    squared = jnp.where(going, squared, jnp.inf)
    foot = better(foot, Foot(squared, row, at, walker.lap))
    return foot, advance(cells, walker, centre, reach, over)


def walk(cells: Cells, q: Array, begun: Start) -> Foot:
    """Return the best foot of the whole stretch.

    Parameters
    ----------
    cells, q
        As in :func:`start`.
    begun
        What :func:`start` returned.
    """

    def onward(state: tuple[Foot, Walker, Walker, Array]) -> tuple[Foot, Walker, Walker, Array]:
        foot, walker, other, count = state
        foot, walker = step(cells, q, begun.centre, begun.reach, foot, walker)
        ended = walker.left <= 0
        first, second = (
            jax.tree.map(lambda a, b: jnp.where(ended, a, b), *pair)
            for pair in ((other, walker), (walker, other))
        )
        return foot, first, second, count + 1

    # each pass takes one of what is left to either walker, or turns to the other: the count says
    # to compilers that ask for a bound what is so in any case
    most = 2 * (jnp.asarray(cells.total(), jnp.int32) + 3)
    begin: tuple[Foot, Walker, Walker, Array] = (
        begun.foot, begun.ahead, begun.behind, jnp.zeros((), jnp.int32),
    )  # fmt: skip
    foot, *_ = jax.lax.while_loop(
        lambda state: ((state[1].left > 0) | (state[2].left > 0)) & (state[3] < most),
        onward,
        begin,
    )
    return foot


def finish(cells: Cells, point: AxisVector, foot: Foot) -> FootPoint:
    """Return a foot with its position, vector and signed distance, and their derivatives.

    Parameters
    ----------
    cells
        The contour.
    point
        Shape (n_axes,) [m].
    foot
        Where it is.
    """
    contour = cells.contour
    known = jnp.isfinite(foot.squared)
    row, s, lap = cells.right_side(foot.row, foot.s, foot.lap)
    r = cells.curve(row, s, 2)
    d = r[0] - point
    slope, bend = d @ r[1], r[1] @ r[1] + d @ r[2]
    speed2 = r[1] @ r[1]
    # at a minimum inside a piece the slope is rounding; at a corner or an end it is not
    inside = slope**2 <= 1e-14 * speed2 * (d @ d) + 1e-26 * speed2 * (1.0 + r[0] @ r[0])
    bend = jax.lax.stop_gradient(bend)
    sound = inside & (bend > 1e-9 * jax.lax.stop_gradient(speed2))
    move = jnp.where(sound, -slope / jnp.where(sound, bend, 1.0), 0.0)
    move = move - jax.lax.stop_gradient(move)  # 0, with the derivative of the foot
    s = s + move
    foot_position = r[0] + move * jax.lax.stop_gradient(r[1])
    vector = foot_position - point
    squared = vector @ vector
    norm = jnp.where(squared > 0.0, jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0)), 0.0)
    distance = norm
    if contour.n_axes == 2:
        across = r[1, 0] * vector[1] - r[1, 1] * vector[0]
        speed = jnp.sqrt(r[1] @ r[1])
        whole = jnp.where(across < 0.0, -norm, norm)
        distance = jnp.where(
            inside & (speed > 0.0), across / jnp.where(speed > 0.0, speed, 1.0), whole
        )
    values = FootPoint(cells.parameter(row, s, lap), foot_position, vector, distance)
    return FootPoint(*(jnp.where(known, x, jnp.nan) for x in values))


def better(foot: Foot, new: Foot) -> Foot:
    """Return the nearer of two."""
    closer = new.squared < foot.squared
    return Foot(*(jnp.where(closer, *pair) for pair in zip(new, foot, strict=True)))


def advance(cells: Cells, walker: Walker, centre: Array, reach: Array, over: Array) -> Walker:
    """Return the walker at the next cell; it stops outside the ball and at an open end."""
    out = cells.joint(walker.row, walker.part, walker.sign) - centre
    done = over | ~(out @ out <= reach)
    part = walker.part + walker.sign
    before, after = part < 0, part >= cells.parts(walker.row)
    row = walker.row + jnp.where(before, -1, 0) + jnp.where(after, 1, 0)
    under, beyond = row < 0, row >= cells.n_rows
    if not cells.contour.closed:
        done = done | under | beyond
    dtype = walker.row.dtype
    row = jnp.where(under, cells.n_rows - 1, jnp.where(beyond, 0, row)).astype(dtype)
    lap = walker.lap + jnp.where(under, -1, 0) + jnp.where(beyond, 1, 0)
    part = jnp.where(before, cells.parts(row) - 1, jnp.where(after, 0, part)).astype(dtype)
    left = jnp.where(done, 0, jnp.maximum(walker.left - 1, 0))
    low, high = cells.bounds(row, part)
    begin = jnp.where(walker.sign > 0, low, high)
    return Walker(row, part, lap.astype(dtype), begin, walker.sign, left.astype(dtype))
