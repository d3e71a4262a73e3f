"""Local foot points of many points on a formula contour: the quick way, and the certain one."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.certified import (
    Curve,
    HeadStart,
    Places,
    dot,
    first_exit,
    nearest,
)
from contourlab.contours.foot_points.formula_cells import FORMULA_CELLS, FormulaCells
from contourlab.contours.foot_points.lanes import LARGE, SMALL, chunks, padded
from contourlab.contours.foot_points.local import FootPoint

__all__ = ["FormulaCurve"]

ORDER, STEPS = 3, 3
"""Of the Taylor polynomial about the reference point, and Newton steps on it."""
ROUNDS = 3
"""Newton steps on the contour, at most; one is usual."""
WINDOW = 16
"""Cells either way over which a bound of the speed is kept."""

Values = NDArray[Any]


# XLA works a sine out again for each output of a batch. So the quick way is three programs: the
# first and the second have one output each, the third has several but evaluates no contour.


@jax.jit
def _predicted(cells: FormulaCells, q: Any, near: Any) -> Any:
    """Return the foot on the Taylor polynomial of the contour about each reference point."""

    def one(q: Any, near: Any) -> Any:
        row, s, _ = cells.place(near, None)
        r = cells.curve(row, s, ORDER)
        rows = [[r[k, axis] for axis in range(len(q))] for k in range(ORDER + 1)]
        rows[0] = [x - y for x, y in zip(rows[0], q, strict=True)]
        x = s
        for _ in range(STEPS):
            d, slope, bend = (_taylor(rows, k, x - s) for k in range(3))
            x = x - _dot(d, slope) / (_dot(slope, slope) + _dot(d, bend))
            if not cells.contour.closed:
                x = jnp.clip(x, 0.0, cells.extent(row))
        return x

    return jax.vmap(one)(q, near)


@jax.jit
def _within(cells: FormulaCells, q: Any, near: Any) -> Any:
    """Return whether errors are below the safe ones of their reference points."""

    def one(q: Any, near: Any) -> Any:
        row, s, _ = cells.place(near, None)
        d = cells.curve(row, s, 0)[0] - q
        return _dot(d, d) <= cells.safe(s) ** 2

    return jax.vmap(one)(q, near)


def _taylor(rows: list[list[Any]], order: int, step: Any) -> list[Any]:
    """Return a derivative of a Taylor polynomial, by Horner's rule."""
    total = rows[-1]
    for k in range(len(rows) - 2, order - 1, -1):
        total = [own + step / (k - order + 1) * x for own, x in zip(rows[k], total, strict=True)]
    return total


def _dot(a: Any, b: Any) -> Any:
    total = a[0] * b[0]
    for k in range(1, len(a)):
        total = total + a[k] * b[k]
    return total


@jax.jit
def _evaluated(cells: FormulaCells, x: Any) -> Any:
    """Return points and two derivatives at the row's own parameters, shape (n, 3, n_axes)."""
    row = jnp.zeros((), jnp.int32)
    return jax.vmap(lambda x: cells.curve(row, x, 2))(x)


@jax.jit
def _stepped(
    cells: FormulaCells, speeds: Any, r: Any, q: Any, near: Any, x: Any
) -> tuple[FootPoint, Any, Any, Any]:
    """Return feet after a Newton step from x, the parameters there, and what they are worth.

    The last two: whether the error is surely within the safe one, so that there is one foot, and
    whether the step was so small that the next would be rounding.
    """
    contour = cells.contour

    def one(r: Any, q: Any, near: Any, x: Any) -> tuple[FootPoint, Any, Any, Any]:
        row, s, lap = cells.place(near, None)
        extent = cells.extent(row)
        d = [r[0, axis] - q[axis] for axis in range(len(q))]
        slope, bend = ([r[k, axis] for axis in range(len(q))] for k in (1, 2))
        speed2 = _dot(slope, slope)
        new = x - _dot(d, slope) / (speed2 + _dot(d, bend))
        if not contour.closed:
            new = jnp.clip(new, 0.0, extent)
        move = new - x
        # the error at the reference point is no more than from here and the way back
        way = jnp.abs(new - s)
        own = speeds[:, cells.find(row, s)]
        near_by = way <= WINDOW / FORMULA_CELLS * extent
        error = jnp.sqrt(_dot(d, d)) + way * jnp.where(near_by, own[0], own[1])
        small = jnp.abs(move) * jnp.sqrt(speed2) <= 1e-8 * error + 1e-13
        # where the step is small, what is beyond its square is rounding
        vector = jnp.stack(
            [a + move * (b + 0.5 * move * c) for a, b, c in zip(d, slope, bend, strict=True)]
        )
        norm = distance = jnp.sqrt(_dot(vector, vector))
        if contour.n_axes == 2:
            u, v = (b + move * c for b, c in zip(slope, bend, strict=True))
            across = u * vector[1] - v * vector[0]
            distance = across / jnp.sqrt(u * u + v * v)
            if not contour.closed:
                end = (new <= 0.0) | (new >= extent)
                distance = jnp.where(end, jnp.where(across < 0.0, -norm, norm), distance)
        foot = FootPoint(cells.parameter(row, new, lap), q + vector, vector, distance)
        return foot, new, error <= cells.safe(s), small

    return jax.vmap(one)(r, q, near, x)


@jax.jit
def _looked(cells: FormulaCells, t: Any) -> Any:
    row = jnp.zeros((), jnp.int32)
    r = jax.vmap(lambda t: cells.curve(row, t, 2))(t)
    return jnp.moveaxis(r, 0, 2)


class FormulaCurve(Curve):
    """A formula contour as one row, asked for many places at a time.

    Its own parameter starts at 0 and, if the contour is closed, goes round beyond its extent.
    """

    def __init__(self, cells: FormulaCells) -> None:
        self.cells, self.n_axes = cells, int(cells.contour.n_axes)
        start, end = (float(edge) for edge in cells.contour.domain)
        self.start, self.total, self.closed = start, end - start, bool(cells.contour.closed)
        self._tables = [np.asarray(cells.bounds_of_rates)]
        if self.closed:  # a lap either way
            self._tables = [np.tile(self._tables[0], (1, 3))]
        while self._tables[-1].shape[1] > 1 << len(self._tables) - 1:
            k = 1 << len(self._tables) - 1
            last = self._tables[-1]
            self._tables.append(np.maximum(last[:, :-k], last[:, k:]))
        mode: Any = "wrap" if self.closed else "edge"
        around = np.pad(self._tables[0][0, :FORMULA_CELLS], WINDOW, mode)
        windows = np.lib.stride_tricks.sliding_window_view(around, 2 * WINDOW + 1).max(axis=1)
        self._safe = np.asarray(cells.safe_error)
        self._speeds = np.stack([windows, np.full(FORMULA_CELLS, windows.max())])
        at = np.linspace(0.0, self.total, 65)
        points = self.look(at, at, np.zeros((self.n_axes, 1)))[0]
        low, high = points.min(axis=1), points.max(axis=1)
        self.size = float(np.linalg.norm(high - low))
        largest = float(max(np.abs(low).max(), np.abs(high).max()))
        self.rounding = 4.0 * float(np.finfo(float).eps) * (largest + self.size)

    def look(
        self, row: Values, t: Values, q: Values, order: int = 2
    ) -> tuple[Values, Values, Values]:
        """Return r - q, r' and r'' at many places, each of shape (n_axes, n).

        Parameters
        ----------
        row
            Not needed: there is one.
        t, q
            Places and points.
        order
            Not needed.
        """
        del row, order
        at = np.mod(t, self.total) if self.closed else t
        parts = [np.zeros((3, self.n_axes, 0))]
        for some, size in chunks(len(at)):
            r = np.asarray(_looked(self.cells, padded(at[some], size)))
            parts.append(r[:, :, : some.stop - some.start])
        whole = np.concatenate(parts, axis=2)
        return whole[0] - q, whole[1], whole[2]

    def rates(self, row: Values, low: Values, high: Values) -> tuple[Values, Values, Values]:
        """Return bounds of |r'|, |r''| and |r'''| on many stretches.

        Parameters
        ----------
        row
            Not needed.
        low, high
            The stretches, within a lap of the domain.
        """
        del row
        n, shift = FORMULA_CELLS, FORMULA_CELLS if self.closed else 0
        last = self._tables[0].shape[1] - 1
        # a hair wider: a place at the edge of two cells belongs to both
        hair = 1e-9
        first = np.clip(np.floor(low / self.total * n - hair).astype(int) + shift, 0, last)
        final = np.clip(np.floor(high / self.total * n + hair).astype(int) + shift, 0, last)
        level = np.frexp((final - first + 1).astype(float))[1] - 1
        out = np.empty((3, len(low)))
        for k in np.unique(level):
            at = np.flatnonzero(level == k)
            table = self._tables[k]
            out[:, at] = np.maximum(table[:, first[at]], table[:, final[at] - (1 << k) + 1])
        return out[0], out[1], out[2]

    def place(self, parameter: Values) -> tuple[Values, Values, Values]:
        """Return row, the row's own parameter, and lap of parameters.

        Parameters
        ----------
        parameter
            Clipped on an open contour, wrapped on a closed one; NaN where not finite.
        """
        given = np.where(np.isfinite(parameter), parameter, self.start) - self.start
        lap = np.zeros(len(given))
        if self.closed:
            lap = np.floor(given / self.total)
            given = given - lap * self.total
        s = np.where(np.isfinite(parameter), np.clip(given, 0.0, self.total), np.nan)
        return np.zeros(len(given), int), s, lap

    def parameter(self, row: Values, s: Values, lap: Values, slope: Values) -> Values:
        """Return the contour's parameter of places.

        Parameters
        ----------
        row, s, lap
            Places.
        slope
            Not needed.
        """
        del row, slope
        result: Values = self.start + s + lap * self.total
        return result

    def nearest(
        self, q: Values, row: Values, low: Values, high: Values, known: Values
    ) -> tuple[Values, Values]:
        """Return the nearest places of stretches, and their squared distances.

        Parameters
        ----------
        q, row, low, high, known
            As in :func:`~contourlab.contours.foot_points.certified.nearest`.
        """
        return nearest(self, q, row, low, high, known)

    def quick(self, points: Values, near: Values) -> tuple[FootPoint, Values]:
        """Return local feet by a few steps from the reference points, and which are certain.

        The foot on the Taylor polynomial about the reference point, then Newton's method on the
        contour. Certain where the error is below the cell's safe one (see
        :func:`~contourlab.contours.foot_points.formula_cells.formula_tables`), so that there is
        one minimum, and the steps died out.

        Parameters
        ----------
        points, near
            A chunk, of shapes (n, n_axes) and (n,).
        """
        n = len(points)
        foot, x, within, small = self._round(points, near, None)
        for _ in range(ROUNDS - 1):
            rest = np.flatnonzero(within & ~small)
            if not len(rest):
                break
            if len(rest) > n // 2:
                foot, x, within, small = self._round(points, near, x)
                continue
            more, x[rest], within[rest], small[rest] = self._round(
                points[rest], near[rest], x[rest]
            )
            for whole, part in zip(foot, more, strict=True):
                whole[rest] = part
        return foot, within & small

    def head_start(self, q: Values, s: Values) -> HeadStart:
        """Return feet by the quick way, and the stretches on which they are the nearest.

        With the safe error e of the cell, not that of the point, the stretch of
        :func:`~contourlab.contours.foot_points.formula_cells.formula_tables` has the radius 2e.

        Parameters
        ----------
        q
            Points, shape (n_axes, n) [m].
        s
            Places.
        """
        n = len(s)
        squared, at, sure = np.empty(n), np.empty(n), np.empty(n, bool)
        points = np.ascontiguousarray(q.T)
        for some, _ in chunks(n, LARGE):
            foot, sure[some] = self.quick(points[some], self.start + s[some])
            at[some] = foot.parameter - self.start
            squared[some] = np.einsum("nk,nk->n", foot.vector, foot.vector)
        if self.closed:
            at -= np.floor(at / self.total) * self.total
        cell = np.clip((s / self.total * FORMULA_CELLS).astype(int), 0, FORMULA_CELLS - 1)
        half = np.minimum(
            2.0 * self._safe[cell] / self._speeds[0, cell],
            (WINDOW - 1) / FORMULA_CELLS * self.total,
        )
        return HeadStart(squared, at, s - half, s + half, sure)

    def _round(
        self, points: Values, near: Values, x: Values | None
    ) -> tuple[FootPoint, Values, Values, Values]:
        n = len(points)
        q, start = padded((points, near), SMALL if n <= SMALL else LARGE)
        at = _predicted(self.cells, q, start) if x is None else padded(x, len(q))
        found = _stepped(self.cells, self._speeds, _evaluated(self.cells, at), q, start, at)
        foot, new, within, small = jax.tree.map(lambda x: np.array(x)[:n], found)
        doubtful = np.flatnonzero(~within)
        if len(doubtful):
            some = padded((points[doubtful], near[doubtful]), len(q))
            within[doubtful] = np.asarray(_within(self.cells, *some))[: len(doubtful)]
        return foot, new, within, small

    def search(self, points: Values, near: Values) -> Places:
        """Return the places of local feet, by the certain way.

        Parameters
        ----------
        points, near
            Shapes (n_axes, n) and (n,).
        """
        row, s, lap = self.place(near)
        with np.errstate(invalid="ignore", over="ignore"):
            centre = self.look(row, np.nan_to_num(s), np.zeros_like(points))[0]
            off = centre - points
            error2 = dot(off, off)
        best, at = np.where(np.isnan(s), np.nan, error2), np.nan_to_num(s)
        best[~np.isfinite(best)] = np.nan
        lanes = np.flatnonzero(best > 0.0)
        if len(lanes):
            begin, q = at[lanes], points[:, lanes]
            whole = np.full(len(lanes), self.total)
            ends = (begin + whole, begin - whole) if self.closed else (whole, 0.0 * whole)
            high, low = (
                first_exit(self, centre[:, lanes], 4.0 * error2[lanes], row[lanes], begin, end)[0]
                for end in ends
            )
            found, squared = nearest(self, q, row[lanes], low, high, error2[lanes])
            nearer = squared < error2[lanes]
            best[lanes[nearer]], at[lanes[nearer]] = squared[nearer], found[nearer]
        return Places(best, row, at, lap)
