"""Local foot points of many points on a formula contour: the quick way, and the certain one."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.certified import Curve, Places, dot, first_exit, nearest
from contourlab.contours.foot_points.formula_cells import FORMULA_CELLS, FormulaCells
from contourlab.contours.foot_points.lanes import LARGE, SMALL, chunks, padded
from contourlab.contours.foot_points.local import FootPoint

__all__ = ["FormulaCurve"]

QUICK_STEPS = 3
"""Newton steps of the quick way."""

Values = NDArray[Any]


@functools.partial(jax.jit, static_argnames="steps")
def _quick(cells: FormulaCells, q: Any, near: Any, steps: int) -> tuple[FootPoint, Any, Any]:
    contour = cells.contour

    def one(q: Any, near: Any) -> tuple[FootPoint, Any, Any]:
        row, s, lap = cells.place(near, None)
        at, squared, r, within, small = cells.newton(q, s, steps)
        vector = r[0] - q
        norm = distance = jnp.sqrt(squared)
        if contour.n_axes == 2:
            across = r[1, 0] * vector[1] - r[1, 1] * vector[0]
            distance = across / jnp.sqrt(r[1, 0] ** 2 + r[1, 1] ** 2)
            if not contour.closed:
                end = (at <= 0.0) | (at >= cells.extent(row))
                distance = jnp.where(end, jnp.where(across < 0.0, -norm, norm), distance)
        return FootPoint(cells.parameter(row, at, lap), r[0], vector, distance), within, small

    return jax.vmap(one)(q, near)


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
        """Return local feet by some Newton steps, and which of them are certain.

        Parameters
        ----------
        points, near
            A chunk, of shapes (n, n_axes) and (n,).
        """
        foot, within, small = self._stepped(points, near)
        # the same steps again, from where the first ones came to
        rest = np.flatnonzero(within & ~small)
        if len(rest):
            more, _, small[rest] = self._stepped(points[rest], foot.parameter[rest])
            for whole, part in zip(foot, more, strict=True):
                whole[rest] = part
        return foot, within & small

    def _stepped(self, points: Values, near: Values) -> tuple[FootPoint, Values, Values]:
        n = len(points)
        size = SMALL if n <= SMALL else LARGE
        found = _quick(self.cells, *padded((points, near), size), QUICK_STEPS)
        foot, within, small = jax.tree.map(lambda x: np.array(x)[:n], found)
        return foot, within, small

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
