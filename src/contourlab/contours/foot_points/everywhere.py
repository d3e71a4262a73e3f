"""The global foot point: the nearest point of the whole contour.

The cells are cut into *fragments* of about equal length, each inside a ball about its middle. A k-d
tree of the middles gives every point its nearest fragments; those whose ball could hold a nearer
point are solved exactly. A point is done when the nearest fragment that was not asked for is too
far to matter, whatever its size: |q - middle| - largest radius >= distance found. Until then more
are asked for. On lines, arcs and helices the radii are exact (half the arc length); on Bézier
pieces and formulas they are sampled, with 10 % added.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contourlab.contours.foot_points.batch import finish_all
from contourlab.contours.foot_points.by_kind import KINDS, by_kind, row_kinds
from contourlab.contours.foot_points.cells import Cells
from contourlab.contours.foot_points.formula_cells import FormulaCells
from contourlab.contours.foot_points.lanes import (
    LARGE,
    SMALL,
    chunks,
    in_chunks,
    padded,
    side_by_side,
)
from contourlab.contours.foot_points.local import Foot, FootPoint
from contourlab.contours.foot_points.path_cells import PathCells

__all__ = ["Fragments", "fragments_of", "global_feet"]

_EXTRA = 4096
"""Fragments beside those that the cells make by themselves."""
_ASKED = 6
"""Fragments that a point asks for at first."""
_MOST = 1 << 20
"""Answers of the tree held at a time."""

Values = NDArray[Any]


class Fragments(NamedTuple):
    """Short stretches that cover the contour, in its order."""

    row: Values
    low: Values
    high: Values
    middle: Values
    radius: Values


def fragments_of(cells: Cells) -> Fragments:
    """Return the fragments of a contour.

    Parameters
    ----------
    cells
        The contour, on the device.
    """
    rows = np.arange(cells.n_rows, dtype=np.int32)
    parts = np.asarray(_parts(cells, rows))
    row = np.repeat(rows, parts)
    part = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    low, high = (np.asarray(x) for x in _bounds(cells, row, part.astype(np.int32)))
    length = _measured(cells, row, low, high)[1] * 2.0
    longest = length.sum() / (len(row) + _EXTRA)
    count = np.maximum(np.ceil(length / longest), 1.0).astype(int)
    row, low, width, many = (np.repeat(x, count) for x in (row, low, high - low, count))
    at = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    ends = np.repeat(high, count)
    begin = low + width * (at / many)
    end = np.where(at + 1 == many, ends, low + width * ((at + 1) / many))
    return Fragments(row, begin, end, *_measured(cells, row, begin, end))


def global_feet(cells: Cells, points: Values) -> FootPoint:
    """Return the nearest point of the whole contour to every point.

    Parameters
    ----------
    cells
        The contour, on the device.
    points
        Shape (n, n_axes) [m].
    """
    n = len(points)
    feet = Foot(np.full(n, np.inf), np.zeros(n, np.int32), np.zeros(n), np.zeros(n, np.int32))
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(finite):
        fragments = fragments_of(cells)
        tree = cKDTree(fragments.middle, balanced_tree=False)

        def work(at: slice, size: int) -> None:
            del size
            _search(cells, fragments, tree, points, finite[at], feet)

        side_by_side(work, chunks(len(finite)))
    return finish_all(cells, points, feet)


def _search(
    cells: Cells, fragments: Fragments, tree: Any, points: Values, open_: Values, feet: Foot
) -> None:
    """Find the feet of some points, and write them."""
    asked, largest, total = 0, float(fragments.radius.max()), len(fragments.row)
    covered = np.zeros(len(points) if isinstance(cells, FormulaCells) else 0)
    first = np.zeros(len(covered), int)
    while len(open_):
        before, asked = asked, min(max(_ASKED, 4 * asked), total)
        pending, step = [], max(_MOST // asked, 1)
        for at in range(0, len(open_), step):
            some = open_[at : at + step]
            distance, index = tree.query(points[some], k=[*range(1, asked + 1)], workers=1)
            for new in (slice(before, before + 1), slice(before + 1, asked)):
                # the nearest first: it leaves little to do for the others
                bound = distance[:, new] - fragments.radius[index[:, new]]
                hopes = bound < np.sqrt(feet.squared[some])[:, None]
                if isinstance(cells, FormulaCells):
                    if new.start == 0:
                        first[some] = index[:, 0]
                        covered[some] = _go_quickly(cells, fragments, points, some, first, feet)
                    hopes &= ~_within(fragments, first[some], index[:, new], covered[some])
                lane, _ = hopeful = np.nonzero(hopes)
                _solve(cells, fragments, points, some[lane], index[:, new][hopeful], feet)
            sure = distance[:, -1] - largest >= np.sqrt(feet.squared[some])
            pending.append(some[~sure])
        open_ = np.concatenate(pending) if asked < total else open_[:0]


def _go_quickly(
    cells: FormulaCells,
    fragments: Fragments,
    points: Values,
    some: Values,
    first: Values,
    feet: Foot,
) -> Values:
    """Take the quick way from the nearest middle; return how far along the contour it is certain.

    Up to the safe error E of the cell, the stretch of chord 2 E has one minimum; its arc length is
    at least 2 E either way.
    """
    at = first[some]
    middle = 0.5 * (fragments.low[at] + fragments.high[at])
    size = SMALL if len(some) <= SMALL else LARGE
    s, squared, sure, safe = (
        np.asarray(x)[: len(some)] for x in _quick(cells, *padded((points[some], middle), size))
    )
    extent = float(cells.extent(jnp.zeros((), jnp.int32)))
    s = np.mod(s, extent) if cells.contour.closed else s
    feet.squared[some[sure]], feet.s[some[sure]] = squared[sure], s[sure]
    return np.where(sure, 2.0 * safe, 0.0)


def _within(fragments: Fragments, first: Values, index: Values, reach: Values) -> Values:
    """Return whether fragments lie wholly within an arc length of the middle of the first."""
    # a radius is more than half a length, so distances along the contour are not underrated
    edges = np.concatenate([[0.0], np.cumsum(2.0 * fragments.radius)])
    middle = 0.5 * (edges[1:] + edges[:-1])
    away = np.abs(middle[index] - middle[first][:, None]) + fragments.radius[index]
    return np.asarray(away <= reach[:, None])


def _solve(
    cells: Cells, fragments: Fragments, points: Values, owner: Values, index: Values, feet: Foot
) -> None:
    """Solve fragments exactly, and write what is nearer."""
    n, at = len(owner), 0
    while at < n:
        size = SMALL if n - at <= 2 * SMALL else LARGE
        own, some = owner[at : at + size], index[at : at + size]
        row = fragments.row[some]
        given = (points[own], row, fragments.low[some], fragments.high[some])
        if isinstance(cells, PathCells) and not cells.closed_form:
            s, squared = by_kind(row_kinds(cells)[row], functools.partial(_of_kind, cells), given)
        else:
            found = _nearest(cells, *padded(given, size))
            s, squared = (np.asarray(x)[: len(own)] for x in found)
        # one point may be here several times: the nearest is written last
        order = np.argsort(-squared, kind="stable") if len(own) > 1 else np.zeros(1, int)
        order = order[squared[order] < feet.squared[own[order]]]
        feet.squared[own[order]] = squared[order]
        feet.row[own[order]] = row[order]
        feet.s[own[order]] = s[order]
        at += size


def _of_kind(cells: PathCells, kind: int, given: Any) -> Any:
    return in_chunks(functools.partial(_nearest, cells.only(KINDS[kind])), given)


def _measured(cells: Cells, row: Values, low: Values, high: Values) -> tuple[Values, Values]:
    """Return the middle of each stretch and the radius of a ball about it."""
    middle, radius = [], []
    size = SMALL if len(row) <= SMALL else LARGE
    for at in range(0, len(row), size):
        some = slice(at, at + size)
        count = len(row[some])
        values = _measure(cells, *padded((row[some], low[some], high[some]), size))
        middle.append(np.asarray(values[0])[:count])
        radius.append(np.asarray(values[1])[:count])
    return np.concatenate(middle), np.concatenate(radius)


@jax.jit
def _parts(cells: Cells, row: Any) -> Any:
    return jax.vmap(cells.parts)(row)


@jax.jit
def _bounds(cells: Cells, row: Any, part: Any) -> Any:
    return jax.vmap(cells.bounds)(row, part)


@jax.jit
def _measure(cells: Cells, row: Any, low: Any, high: Any) -> Any:
    def one(row: Any, low: Any, high: Any) -> Any:
        if cells.by_length:
            return cells.curve(row, 0.5 * (low + high), 0)[0], 0.5 * (high - low)
        at = low + (high - low) * jnp.arange(9) / 8
        r = jax.vmap(lambda s: cells.curve(row, s, 0)[0])(at)
        chord = jnp.sqrt(jnp.sum(jnp.diff(r, axis=0) ** 2, axis=1))
        return r[4], 1.1 * jnp.maximum(jnp.sum(chord[:4]), jnp.sum(chord[4:]))

    return jax.vmap(one)(row, low, high)


@jax.jit
def _quick(cells: FormulaCells, q: Any, s: Any) -> Any:
    return jax.vmap(lambda q, s: (*cells.quick(q, s), cells.safe(s)))(q, s)


@jax.jit
def _nearest(cells: Cells, q: Any, row: Any, low: Any, high: Any) -> Any:
    def one(q: Any, row: Any, low: Any, high: Any) -> Any:
        return cells.nearest(row, q, low, high, jnp.ones((), bool))

    return jax.vmap(one)(q, row, low, high)
