"""A contour cut into cells, each small enough that its nearest point can be found for certain.

A *cell* is a part of a row: ``(row, part)``. A line or a planar arc is one cell, of whatever
length, because its nearest point has a closed form. A helix is cut into turns of π/4 at most, a
Bézier piece into eight, and a formula contour, which is one row, into ``FORMULA_CELLS`` equal
stretches of its parameter.

In a cell that is not a line or an arc, the derivative of the squared distance is looked at in
``SCAN`` + 1 places; every bracket that shows a minimum is polished by Newton's method kept inside
it. What is assumed is therefore that no two stationary points fall between two neighbouring looks.

Everything here takes scalars and is traceable; ``jax.vmap`` outside gives batches.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.contours.base import Contour
from contourlab.contours.path import Path, helical_derivatives
from contourlab.typing import Array

__all__ = ["Cells", "FormulaCells", "PathCells", "cells_of"]

FORMULA_CELLS = 1024
"""Cells of a formula contour."""
BEZIER_CELLS = 8
"""Cells of a Bézier piece."""
HELIX_TURN = np.pi / 4
"""Largest angle that a cell of a helix turns [rad]."""
LOOKS = 4
"""Places of each cell of a formula contour at which its curvature is sampled."""
QUICK_STEPS = 4
"""Newton steps of the quick way."""
SCAN = 4
"""Brackets looked at in a cell."""
_NEWTON_STEPS = 60
_EPS = float(np.finfo(float).eps)

Curve = Callable[[Array], Array]
"""From a row's own parameter to its point, first and second derivative, shape (3, n_axes)."""


class Cells(eqx.Module):
    """Base: a contour as rows, and rows as cells; parameters are measured inside the row."""

    contour: Any

    @property
    @abc.abstractmethod
    def n_rows(self) -> int:
        """Number of rows."""

    @property
    @abc.abstractmethod
    def closed_form(self) -> bool:
        """Whether every row is known to be a line or a planar arc."""

    @property
    @abc.abstractmethod
    def straight(self) -> bool:
        """Whether every row is known to be a line."""

    @abc.abstractmethod
    def total(self) -> Array:
        """Return the number of cells, int32."""

    @abc.abstractmethod
    def place(self, parameter: Array, piece: Array | None) -> tuple[Array, Array, Array]:
        """Return row, the row's own parameter and lap of a parameter of the contour."""

    @abc.abstractmethod
    def right_side(self, row: Array, s: Array, lap: Array) -> tuple[Array, Array, Array]:
        """Return the same place as the start of the next row, if it is the end of this one."""

    @abc.abstractmethod
    def quick(self, q: Array, s: Array) -> tuple[Array, Array, Array]:
        """Return a cheap nearest parameter, its squared distance, and whether it is certain."""

    @abc.abstractmethod
    def parts(self, row: Array) -> Array:
        """Return the number of cells of a row, int32."""

    @abc.abstractmethod
    def extent(self, row: Array) -> Array:
        """Return the row's own parameter at its end; it is 0 at its start."""

    @abc.abstractmethod
    def offset(self, row: Array) -> Array:
        """Return the contour's parameter at the start of a row."""

    @abc.abstractmethod
    def curve(self, row: Array, s: Array, order: int) -> Array:
        """Return point and derivatives over the row's own parameter."""

    @abc.abstractmethod
    def arc(self, row: Array) -> tuple[Array, Array, Any]:
        """Return whether the row is a line or planar arc, its angle rate, and its vectors."""

    def bounds(self, row: Array, part: Array) -> tuple[Array, Array]:
        """Return the row's own parameter at the two ends of a cell."""
        extent, parts = self.extent(row), self.parts(row)
        width = extent / parts
        return part * width, jnp.where(part + 1 >= parts, extent, (part + 1) * width)

    def find(self, row: Array, s: Array) -> Array:
        """Return the cell of a row that holds the row's own parameter."""
        parts = self.parts(row)
        raw = jnp.floor(s / self.extent(row) * parts)
        return jnp.clip(jnp.nan_to_num(raw), 0, parts - 1).astype(jnp.int32)

    def nearest(self, row: Array, q: Array, low: Array, high: Array, wanted: Array) -> Array:
        """Return the row's own parameter of the point nearest to ``q`` in ``[low, high]``.

        Parameters
        ----------
        row, q
            The row, and the point, shape (n_axes,).
        low, high
            Range inside one cell.
        wanted
            Whether the answer matters; it only saves work.
        """
        simple, rate, vectors = self.arc(row)
        s = nearest_on_arc(rate, vectors, q, low, high)
        if self.closed_form:
            return s
        general = nearest_by_scan(
            lambda x: self.curve(row, x, 2), q, low, high, wanted & ~simple & (high > low)
        )
        return jnp.where(simple, s, general)

    def joint(self, row: Array, part: Array, sign: Array) -> Array:
        """Return the point where a cell ends, in the direction ``sign``."""
        low, high = self.bounds(row, part)
        return self.curve(row, jnp.where(sign > 0, high, low), 0)[0]  # type: ignore[no-any-return]

    def peak(
        self, row: Array, c: Array, start: Array, end: Array, wanted: Array
    ) -> tuple[Array, Array]:
        """Return where the distance from ``c`` first peaks inside a cell, and its square there.

        Parameters
        ----------
        row, c
            The row, and the centre of the ball, shape (n_axes,).
        start, end
            The range, from the one to the other, inside one cell.
        wanted
            Whether the answer matters.

        Returns
        -------
        tuple
            ``end`` and 0 where there is no peak.
        """
        simple, rate, vectors = self.arc(row)
        s, squared = peak_on_arc(rate, vectors, c, start, end)
        if self.closed_form:
            return s, squared
        curve = lambda x: self.curve(row, x, 1)  # noqa: E731
        general, height = peak_by_halving(curve, c, start, end, wanted & ~simple & (start != end))
        return jnp.where(simple, s, general), jnp.where(simple, squared, height)


class FormulaCells(Cells):
    """A formula contour: one row, whose own parameter starts at 0."""

    contour: Contour
    safe_error: Array
    """Of each cell, the error [m] up to which a point has one foot on its stretch."""

    @property
    def n_rows(self) -> int:
        return 1

    @property
    def closed_form(self) -> bool:
        return False

    @property
    def straight(self) -> bool:
        return False

    def total(self) -> Array:
        return jnp.asarray(FORMULA_CELLS, jnp.int32)

    def place(self, parameter: Array, piece: Array | None) -> tuple[Array, Array, Array]:
        return _placed(self.contour, parameter, jnp.zeros((), jnp.int32))

    def right_side(self, row: Array, s: Array, lap: Array) -> tuple[Array, Array, Array]:
        return row, s, lap

    def quick(self, q: Array, s: Array) -> tuple[Array, Array, Array]:
        extent = self.extent(jnp.zeros((), jnp.int32))
        row = jnp.zeros((), jnp.int32)
        r = self.curve(row, s, 2)
        d = r[0] - q
        error2 = d @ d
        cell = jnp.clip(jnp.nan_to_num(s / extent * FORMULA_CELLS), 0, FORMULA_CELLS - 1)
        safe = jnp.asarray(self.safe_error)[cell.astype(jnp.int32)]
        sure = error2 <= safe * safe

        def newton(_: int, state: Any) -> Any:
            x, r, _ = state
            d = r[0] - q
            new = x - (d @ r[1]) / (r[1] @ r[1] + d @ r[2])
            if not self.contour.closed:
                new = jnp.clip(new, 0.0, extent)
            return new, self.curve(row, new, 2), jnp.abs(new - x) * jnp.sqrt(r[1] @ r[1])

        state = (s, r, jnp.inf + 0.0 * s)
        x, r, last = jax.lax.fori_loop(0, QUICK_STEPS, newton, state)
        d = r[0] - q
        # Newton's method ends quadratically: the step before last was this small
        small = last <= 1e-8 * jnp.sqrt(error2) + 1e-13
        return x, d @ d, sure & small

    def parts(self, row: Array) -> Array:
        return jnp.full_like(row, FORMULA_CELLS)

    def extent(self, row: Array) -> Array:
        start, end = self.contour.domain
        return jnp.asarray(end, float) - start

    def offset(self, row: Array) -> Array:
        return jnp.asarray(self.contour.domain[0], float)

    def curve(self, row: Array, s: Array, order: int) -> Array:
        return self.contour.derivatives(self.contour.domain[0] + s, order, row)

    def arc(self, row: Array) -> tuple[Array, Array, Any]:
        zero = jnp.zeros(self.contour.n_axes)
        return row < 0, jnp.zeros(()), (zero, zero, zero)


class PathCells(Cells):
    """A path: its pieces are the rows, and their own parameter is arc length."""

    contour: Path
    n_cells: Array
    all_simple: bool = eqx.field(static=True)
    all_straight: bool = eqx.field(static=True)

    @property
    def n_rows(self) -> int:
        return self.contour.n_pieces

    @property
    def closed_form(self) -> bool:
        return self.all_simple

    @property
    def straight(self) -> bool:
        return self.all_straight

    def total(self) -> Array:
        return self.n_cells

    def place(self, parameter: Array, piece: Array | None) -> tuple[Array, Array, Array]:
        path = self.contour
        row = path.find(parameter) if piece is None else path.locate(parameter, piece)
        row, s, lap = _placed(path, parameter, jnp.asarray(row, jnp.int32))
        s = s - (jnp.asarray(path.breaks)[row] - jnp.asarray(path.breaks)[0])
        return row, jnp.clip(s, 0.0, self.extent(row)), lap

    def right_side(self, row: Array, s: Array, lap: Array) -> tuple[Array, Array, Array]:
        over = s >= self.extent(row)
        last = row + 1 >= self.n_rows
        over = over & (self.contour.closed | ~last)
        new = jnp.where(over, jnp.where(last, 0, row + 1), row).astype(row.dtype)
        lap = lap + jnp.where(over & last, 1, 0).astype(lap.dtype)
        return new, jnp.where(over, 0.0, s), lap

    def quick(self, q: Array, s: Array) -> tuple[Array, Array, Array]:
        return s, jnp.full_like(s, jnp.inf), jnp.zeros((), bool)

    def parts(self, row: Array) -> Array:
        if self.all_simple:
            return jnp.ones_like(row)
        path = self.contour
        simple = self.arc(row)[0]
        rate = jnp.asarray(path.angle_rate)[row]
        turns = jnp.ceil(jnp.abs(rate) * self.extent(row) / HELIX_TURN)
        turns = jnp.clip(turns, 1.0, 2.0**30).astype(jnp.int32)
        curved = jnp.where(jnp.asarray(path.bezier_row)[row] >= 0, BEZIER_CELLS, turns)
        return jnp.where(simple, 1, curved)

    def joint(self, row: Array, part: Array, sign: Array) -> Array:
        if not self.all_simple:
            return super().joint(row, part, sign)
        # past the end of an open path nothing is walked, and a closed one begins again
        at = jnp.where(sign > 0, jnp.mod(row + 1, self.n_rows), row)
        return jnp.asarray(self.contour.origin)[at]

    def extent(self, row: Array) -> Array:
        breaks = jnp.asarray(self.contour.breaks)
        return breaks[row + 1] - breaks[row]

    def offset(self, row: Array) -> Array:
        return jnp.asarray(self.contour.breaks)[row]

    def curve(self, row: Array, s: Array, order: int) -> Array:
        path = self.contour
        if not self.all_simple:
            return path.row_derivatives(row, s, order)
        return helical_derivatives(
            s, jnp.asarray(path.angle_rate)[row], jnp.asarray(path.origin)[row],
            jnp.asarray(path.tangent_vector)[row], jnp.asarray(path.normal_vector)[row],
            jnp.asarray(path.axial_vector)[row], order,
        )  # fmt: skip

    def arc(self, row: Array) -> tuple[Array, Array, Any]:
        path = self.contour
        rate = jnp.asarray(path.angle_rate)[row]
        u, v = jnp.asarray(path.tangent_vector)[row], jnp.asarray(path.normal_vector)[row]
        origin, w = jnp.asarray(path.origin)[row], jnp.asarray(path.axial_vector)[row]
        if self.all_simple:
            return row >= 0, rate, (origin, u + w, v)
        straight = rate == 0.0
        simple = (jnp.asarray(path.bezier_row)[row] < 0) & (straight | (w @ w == 0.0))
        return simple, jnp.where(simple, rate, 0.0), (origin, jnp.where(straight, u + w, u), v)


def cells_of(contour: Contour) -> Cells:
    """Return a contour cut into cells; traceable, and a table of a formula contour's curvature.

    Parameters
    ----------
    contour
        Any contour.
    """
    if not isinstance(contour, Path):
        return FormulaCells(contour, _safe_errors(contour))
    known = all(is_concrete(leaf) for leaf in (contour.angle_rate, contour.axial_vector))
    simple = known and len(contour.control_points) == 0
    straight = False
    if simple:
        turning = np.asarray(contour.angle_rate) != 0.0
        simple = not np.any(np.asarray(contour.axial_vector)[turning])
        straight = not np.any(turning)
    n_rows = jnp.arange(contour.n_pieces, dtype=jnp.int32)
    cells = PathCells(contour, jnp.asarray(contour.n_pieces, jnp.int32), simple, straight)
    if simple:
        return cells
    total = jnp.sum(jax.vmap(cells.parts)(n_rows)).astype(jnp.int32)
    return PathCells(contour, total, simple, straight)


def safe_errors(contour: Contour) -> Array:
    """Return for each cell the error up to which the foot on the stretch is surely unique.

    Let K bound the curvature over w cells either way of a cell, and l the length of the shorter
    way. If 3.2 e K < 1 and 2.2 e < l, the stretch of a point with error e, whose chord is 2e at
    most, lies in those cells (its length is below 2.2 e, as 2 asin(e K) / K is), and on it the
    second derivative of the squared distance over arc length, 1 - (q - r) . r'', is positive since
    |q - r| <= 3e: there is one minimum. K is the largest of the values sampled in ``LOOKS`` places
    of each cell, with 20 % added.

    Parameters
    ----------
    contour
        A formula contour.

    Returns
    -------
    Array
        Shape (FORMULA_CELLS,) [m]; the best over w = 1, 2, 4, ... 128.
    """
    start, end = (jnp.asarray(edge, float) for edge in contour.domain)
    n = FORMULA_CELLS * LOOKS
    r = jax.vmap(lambda p: contour.derivatives(p, 2))(start + (end - start) * jnp.arange(n + 1) / n)
    speed2 = jnp.sum(r[:, 1] ** 2, axis=1)
    tangent = r[:, 1] / jnp.sqrt(speed2)[:, None]
    along = jnp.sum(tangent * r[:, 2], axis=1, keepdims=True) * tangent
    curvature = jnp.sqrt(jnp.sum((r[:, 2] - along) ** 2, axis=1)) / speed2
    chord = jnp.sqrt(jnp.sum(jnp.diff(r[:, 0], axis=0) ** 2, axis=1))
    larger = jnp.maximum(curvature[:-1], curvature[1:])
    # a corner, or a turn between two looks, shows in the tangents and not in the curvature
    turn = jnp.sqrt(jnp.sum(jnp.diff(tangent, axis=0) ** 2, axis=1))
    larger = jnp.where(turn <= 1.2 * larger * chord + 1e-7, larger, jnp.inf)
    seam = jnp.sqrt(jnp.sum((tangent[-1] - tangent[0]) ** 2))
    if contour.closed:
        larger = larger.at[0].set(jnp.where(seam <= 1e-7, larger[0], jnp.inf))
    larger = jnp.where(jnp.isnan(larger), jnp.inf, larger)
    length = chord.reshape(FORMULA_CELLS, LOOKS).sum(axis=1)
    bound = larger.reshape(FORMULA_CELLS, LOOKS).max(axis=1)
    if contour.closed:
        length, bound = jnp.tile(length, 3), jnp.tile(bound, 3)
    else:  # beyond an end nothing is followed
        length = jnp.pad(length, FORMULA_CELLS, constant_values=jnp.inf)
        bound = jnp.pad(bound, FORMULA_CELLS)
    best = jnp.zeros(FORMULA_CELLS)
    here = slice(FORMULA_CELLS, 2 * FORMULA_CELLS)
    for width in (1, 4, 16, 64, 256):
        most = _windows(bound, 2 * width + 1, jax.lax.max, -jnp.inf)
        ways = _windows(length, width, jax.lax.add, 0.0)
        # window i of a "valid" reduction starts at cell i
        ahead = ways[here.start + 1 : here.stop + 1]
        behind = ways[here.start - width : here.stop - width]
        safe = 1.0 / (3.2 * 1.2 * most[here.start - width : here.stop - width] + 1e-300)
        best = jnp.maximum(best, jnp.minimum(jnp.minimum(ahead, behind) / 2.2, safe))
    return best


_safe_errors = jax.jit(safe_errors)


def _windows(values: Array, width: int, reduce: Any, start: float) -> Array:
    return jax.lax.reduce_window(  # type: ignore[no-any-return]
        values, np.float64(start), reduce, (width,), (1,), "valid"
    )


def _placed(contour: Contour, parameter: Array, row: Array) -> tuple[Array, Array, Array]:
    start, end = (jnp.asarray(edge, float) for edge in contour.domain)
    inside = contour.wrap(parameter)
    lap = jnp.zeros((), jnp.int32)
    if contour.closed:
        turns = jnp.round((parameter - inside) / (end - start))
        lap = jnp.nan_to_num(turns).astype(jnp.int32)
    return row, inside - start, lap


def arc_foot(rate: Array, vectors: Any, q: Array) -> Array:
    """Return the arc length of the point nearest to ``q`` on a whole line or circle.

    With x, y the components of q - origin along the first tangent and the normal, and κ the
    curvature: s = atan2(κ x, 1 - κ y) / κ, in half a turn either way of the origin.

    Parameters
    ----------
    rate
        κ, the angle per arc length [rad/m], 0 for a line.
    vectors
        Origin, tangent and normal of the row.
    q
        The point, shape (n_axes,).
    """
    origin, tangent, normal = vectors
    d = q - origin
    x, y = d @ tangent, d @ normal
    line = rate == 0.0
    safe = jnp.where(line, 1.0, rate)
    return jnp.where(line, x, jnp.arctan2(safe * x, 1.0 - safe * y) / safe)  # type: ignore[no-any-return]


def nearest_on_arc(rate: Array, vectors: Any, q: Array, low: Array, high: Array) -> Array:
    """Return the arc length nearest to ``q`` in ``[low, high]`` of a line or a circle.

    Parameters
    ----------
    rate, vectors, q
        As in :func:`arc_foot`.
    low, high
        The range; if it is longer than a turn, one of the nearest points is returned.
    """
    s = arc_foot(rate, vectors, q)
    period = 2.0 * jnp.pi / jnp.where(rate == 0.0, 1.0, jnp.abs(rate))
    middle = 0.5 * (low + high)
    turns = jnp.where(rate == 0.0, 0.0, jnp.round((middle - s) / period))
    return jnp.clip(s + turns * period, low, high)


def peak_on_arc(
    rate: Array, vectors: Any, c: Array, start: Array, end: Array
) -> tuple[Array, Array]:
    """Return where the distance from ``c`` first peaks on the way from ``start`` to ``end``.

    Parameters
    ----------
    rate, vectors, c
        As in :func:`arc_foot`.
    start, end
        Arc lengths, in either order.

    Returns
    -------
    tuple
        The arc length and the squared distance; ``end`` and 0 if there is no peak between.
    """
    origin, tangent, normal = vectors
    line = rate == 0.0
    safe = jnp.where(line, 1.0, rate)
    half = jnp.pi / jnp.abs(safe)
    d = c - origin
    x, y = d @ tangent, d @ normal
    far = jnp.arctan2(safe * x, 1.0 - safe * y) / safe + half
    way = jnp.where(end >= start, 1.0, -1.0)
    ahead = jnp.mod(way * (far - start), 2.0 * half)
    ahead = jnp.where(ahead < 1e-9 * half, ahead + 2.0 * half, ahead)
    peak = (~line) & (ahead < jnp.abs(end - start))
    across = jnp.maximum(d @ d - x * x - y * y, 0.0)
    radius = (jnp.sqrt((safe * x) ** 2 + (1.0 - safe * y) ** 2) + 1.0) / safe
    squared = jnp.where(peak, radius * radius + across, 0.0)
    return jnp.where(peak, start + way * ahead, end), squared


def peak_by_halving(
    curve: Curve, c: Array, start: Array, end: Array, wanted: Array
) -> tuple[Array, Array]:
    """Return the peak of the distance from ``c`` on a short piece of smooth curve.

    Parameters
    ----------
    curve
        Point and derivative, shape (2, n_axes).
    c
        Centre, shape (n_axes,).
    start, end
        The range, in either order; it holds one peak at most.
    wanted
        Whether the answer matters.

    Returns
    -------
    tuple
        The parameter and the squared distance; ``end`` and 0 if there is no peak between.
    """
    way = jnp.where(end >= start, 1.0, -1.0)

    def rising(x: Array) -> Array:
        r = curve(x)
        return way * ((r[0] - c) @ r[1]) > 0.0  # type: ignore[no-any-return]

    wanted = wanted & ~rising(end) & rising(start + 0.125 * (end - start))

    def halve(state: Any) -> Any:
        a, b, k = state
        x = 0.5 * (a + b)
        up = rising(x)
        return jnp.where(up, x, a), jnp.where(up, b, x), k + 1

    # a peak's height is flat in its place: 30 halvings give it to rounding
    a, b, _ = jax.lax.while_loop(
        lambda state: wanted & (state[2] < 30), halve, (start, end, jnp.zeros((), jnp.int32))
    )
    middle = 0.5 * (a + b)
    d = curve(middle)[0] - c
    return jnp.where(wanted, middle, end), jnp.where(wanted, d @ d, 0.0)


def nearest_by_scan(curve: Curve, q: Array, low: Array, high: Array, wanted: Array) -> Array:
    """Return the parameter nearest to ``q`` in ``[low, high]`` of a smooth curve.

    Parameters
    ----------
    curve
        Point and two derivatives, shape (3, n_axes).
    q
        The point, shape (n_axes,).
    low, high
        The range, scanned in ``SCAN`` brackets.
    wanted
        Whether the answer matters.
    """

    def look(x: Array) -> tuple[Array, Array, Array]:
        r = curve(x)
        d = r[0] - q
        return d @ d, d @ r[1], r[1] @ r[1] + d @ r[2]

    edges = low + (high - low) * jnp.arange(SCAN + 1) / SCAN
    edges = edges.at[-1].set(high)
    squared, slope, _ = jax.vmap(look)(edges)
    a, b, ga, gb = edges[:-1], edges[1:], slope[:-1], slope[1:]
    minimum = (ga < 0.0) & (gb >= 0.0)
    tolerance = 4.0 * _EPS * (jnp.abs(high) + jnp.abs(high - low))
    start = jnp.where(minimum, a - (b - a) * ga / jnp.where(minimum, gb - ga, 1.0), a)

    def step(state: Any) -> Any:
        a, b, x, todo, count = state
        _, g, h = jax.vmap(look)(x)
        a, b = jnp.where(todo & (g < 0.0), x, a), jnp.where(todo & (g >= 0.0), x, b)
        newton = x - g / jnp.where(h > 0.0, h, 1.0)
        inside = (h > 0.0) & (newton >= a) & (newton <= b)
        new = jnp.where(inside, newton, 0.5 * (a + b))
        new = jnp.where(todo, new, x)
        return a, b, new, todo & (jnp.abs(new - x) > tolerance), count + 1

    _, _, x, _, _ = jax.lax.while_loop(
        lambda state: jnp.any(state[3]) & (state[4] < _NEWTON_STEPS),
        step,
        (a, b, start, minimum & wanted, jnp.zeros((), jnp.int32)),
    )
    at = jnp.concatenate([x, edges])
    found = jax.vmap(lambda x: look(x)[0])(x)
    values = jnp.concatenate([jnp.where(minimum, found, jnp.inf), squared])
    return at[jnp.argmin(values)]
