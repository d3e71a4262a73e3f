"""A formula contour in equal stretches of its parameter, and where its foot is surely unique."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.cells import Cells, placed
from contourlab.typing import Array

__all__ = ["FORMULA_CELLS", "FormulaCells", "formula_tables"]

FORMULA_CELLS = 1024
"""Cells of a formula contour."""
LOOKS = 4
"""Places of each cell at which the curvature is sampled."""
QUICK_STEPS = 4
"""Newton steps of the quick way."""


class FormulaCells(Cells):
    """A formula contour: one row, whose own parameter starts at 0."""

    contour: Contour
    safe_error: Array
    """Of each cell, the error [m] up to which a point has one foot on its stretch."""
    bounds_of_rates: Array
    """Of each cell, bounds of |r'|, |r''| and |r'''| over the parameter, (3, FORMULA_CELLS)."""

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return 1

    @property
    def closed_form(self) -> bool:
        """Whether every row is a line or a planar arc."""
        return False

    @property
    def any_simple(self) -> bool:
        """Whether some row may be a line or a planar arc."""
        return False

    @property
    def by_length(self) -> bool:
        """Whether the parameter of every row is arc length."""
        return False

    @property
    def straight(self) -> bool:
        """Whether every row is a line."""
        return False

    def total(self) -> Array:
        """Return the number of cells."""
        return jnp.asarray(FORMULA_CELLS, jnp.int32)

    def place(self, parameter: Array, piece: Array | None) -> tuple[Array, Array, Array]:
        """Return row, the row's own parameter and lap of a parameter."""
        return placed(self.contour, parameter, jnp.zeros((), jnp.int32))

    def right_side(self, row: Array, s: Array, lap: Array) -> tuple[Array, Array, Array]:
        """Return the start of the next row for the end of this one."""
        return row, s, lap

    def quick(self, q: Array, s: Array) -> tuple[Array, Array, Array]:
        """Return a cheap nearest parameter, its squared distance, and whether it is certain."""
        x, squared, _, within, small = self.newton(q, s, QUICK_STEPS)
        return x, squared, within & small

    def newton(self, q: Array, s: Array, steps: int) -> tuple[Array, Array, Array, Array, Array]:
        """Return a cheap nearest parameter, its squared distance, its point and whether it is sure.

        By Newton's method from the reference point; sure where the error is below the cell's safe
        one (see :func:`formula_tables`), so that there is one minimum, and the steps died out. The
        steps are written out, and products of vectors by component: XLA then makes one loop of it
        over a batch, four times faster than its own loops and batched products.

        Parameters
        ----------
        q
            The point, shape (n_axes,) [m].
        s
            The row's own parameter at the reference point.
        steps
            Newton steps.

        Returns
        -------
        parameter, squared, derivatives, within, small
            The nearest parameter, its squared distance [m²], point and derivatives to the second
            there; whether the error is within the safe one, and whether the steps died out. It is
            certain if both hold.
        """
        extent = self.extent(jnp.zeros((), jnp.int32))
        row = jnp.zeros((), jnp.int32)
        x, r = s, self.curve(row, s, 2)
        error2 = _product(r[0] - q, r[0] - q)
        safe = self.safe(s)
        last = jnp.inf + 0.0 * s
        for _ in range(steps):
            d = r[0] - q
            speed2 = _product(r[1], r[1])
            new = x - _product(d, r[1]) / (speed2 + _product(d, r[2]))
            if not self.contour.closed:
                new = jnp.clip(new, 0.0, extent)
            last = jnp.abs(new - x) * jnp.sqrt(speed2)
            x, r = new, self.curve(row, new, 2)
        d = r[0] - q
        # Newton's method ends quadratically: the step before last was this small
        small = last <= 1e-8 * jnp.sqrt(error2) + 1e-13
        return x, _product(d, d), r, error2 <= safe * safe, small

    def safe(self, s: Array) -> Array:
        """Return the error up to which a point referred to ``s`` has one foot on its stretch."""
        return jnp.asarray(self.safe_error)[self.find(jnp.zeros((), jnp.int32), s)]

    def parts(self, row: Array) -> Array:
        """Return the number of cells of a row."""
        return jnp.full_like(row, FORMULA_CELLS)

    def extent(self, row: Array) -> Array:
        """Return the row's own parameter at its end."""
        start, end = self.contour.domain
        return jnp.asarray(end, float) - start

    def parameter(self, row: Array, s: Array, lap: Array) -> Array:
        """Return the contour's parameter of a place."""
        return self.contour.domain[0] + s + lap * self.extent(row)

    def rates(self, row: Array, part: Array) -> Array:
        """Return bounds of |r'|, |r''| and |r'''| over the row's own parameter, shape (3,)."""
        return jnp.asarray(self.bounds_of_rates)[:, part]

    def simple_point(self, row: Array, s: Array) -> Array:
        """Return the point of a line or a planar arc."""
        return self.curve(row, s, 0)[0]

    def curve(self, row: Array, s: Array, order: int) -> Array:
        """Return point and derivatives over the row's own parameter."""
        return self.contour.derivatives(self.contour.domain[0] + s, order, row)

    def arc(self, row: Array) -> tuple[Array, Array, Any]:
        """Return whether the row is simple, its angle rate, and origin, tangent and normal."""
        zero = jnp.zeros(self.contour.n_axes)
        return row < 0, jnp.zeros(()), (zero, zero, zero)


def _product(a: Array, b: Array) -> Array:
    """Return the scalar product by component."""
    total = a[0] * b[0]
    for k in range(1, a.shape[0]):
        total = total + a[k] * b[k]
    return total


def formula_tables(contour: Contour) -> tuple[Array, Array]:
    """Return for each cell the error up to which the foot is surely unique, and derivative bounds.

    *Bounds* of |r'|, |r''|, |r'''| come from ``LOOKS`` looks at each cell: 1.5 times the largest of
    the values and difference quotients in a stretch between two looks and in its neighbours. That
    is the one assumption made of a formula: within 1/4096 of its domain, |r'''| is no more than 1.5
    times its means over the stretch and the ones beside. Where a difference quotient stands out
    from its neighbours (a jump of curvature, or a corner) the bounds of r''', or of r'' too, are
    infinite: nothing is assumed then but that of the lower ones.

    *Safe errors*: let K bound the curvature over w cells either way of a cell, and l the length of
    the shorter way. If 3.2 e K < 1 and 2.2 e < l, the stretch of a point with error e, whose chord
    is 2e at most, lies in those cells (its length is below 2.2 e, as 2 asin(e K) / K is), and on it
    the second derivative of the squared distance over arc length, 1 - (q - r) . r'', is positive
    since |q - r| <= 3e: there is one minimum.

    Parameters
    ----------
    contour
        A formula contour.

    Returns
    -------
    tuple
        Shape (FORMULA_CELLS,) [m], the best over w = 1, 4, 16, 64, 256; and (3, FORMULA_CELLS).
    """
    start, end = (jnp.asarray(edge, float) for edge in contour.domain)
    n = FORMULA_CELLS * LOOKS
    r = jax.vmap(lambda p: contour.derivatives(p, 2))(start + (end - start) * jnp.arange(n + 1) / n)
    step = (end - start) / n
    speed, second = (jnp.sqrt(jnp.sum(r[:, k] ** 2, axis=1)) for k in (1, 2))
    chord, turn, change = (
        jnp.sqrt(jnp.sum(jnp.diff(r[:, k], axis=0) ** 2, axis=1)) / step for k in range(3)
    )
    fast = 1.5 * _beside(contour, jnp.maximum(jnp.maximum(speed[:-1], speed[1:]), chord))
    seen = jnp.maximum(second[:-1], second[1:])
    bend = 1.5 * _beside(contour, jnp.maximum(seen, turn))
    third = 1.5 * _beside(contour, change)
    corner = _stands_out(contour, turn, seen)
    jump = _stands_out(contour, change, 0.0 * change) | corner
    if contour.closed:  # the seam may be less smooth than the rest
        ends = (jnp.arange(n) == 0) | (jnp.arange(n) == n - 1)
        broken = [
            jnp.sqrt(jnp.sum((r[-1, k] - r[0, k]) ** 2)) > 1e-7 * jnp.max(size)
            for k, size in ((1, speed), (2, second))
        ]
        corner, jump = corner | (ends & broken[0]), jump | (ends & (broken[0] | broken[1]))
    bend = jnp.where(_beside(contour, corner), jnp.inf, bend)
    third = jnp.where(_beside(contour, jump), jnp.inf, third)
    rates = [jnp.where(jnp.isnan(x), jnp.inf, x) for x in (fast, bend, third)]
    bounds = jnp.stack([x.reshape(FORMULA_CELLS, LOOKS).max(axis=1) for x in rates])
    return _safe_errors(contour, r, step, rates), bounds


def _neighbours(contour: Contour, values: Array) -> tuple[Array, Array]:
    if contour.closed:
        return jnp.roll(values, 1), jnp.roll(values, -1)
    before = jnp.concatenate([values[1:2], values[:-1]])
    return before, jnp.concatenate([values[1:], values[-2:-1]])


def _beside(contour: Contour, values: Array) -> Array:
    """Return the largest (or any) of each stretch and its two neighbours."""
    before, after = _neighbours(contour, values)
    return jnp.maximum(values, jnp.maximum(before, after))


def _stands_out(contour: Contour, values: Array, own: Array) -> Array:
    """Return where values are more than three times what is seen beside them."""
    before, after = _neighbours(contour, jnp.maximum(values, own))
    beside = jnp.maximum(jnp.maximum(before, after), own)
    return ~(values <= 3.0 * beside + 1e-6 * jnp.nanmax(values))


def _safe_errors(contour: Contour, r: Array, step: Array, rates: Sequence[Any]) -> Array:
    fast, bend, third = rates
    speed2, bend2 = jnp.sum(r[:, 1] ** 2, axis=1), jnp.sum(r[:, 2] ** 2, axis=1)
    dot = jnp.sum(r[:, 1] * r[:, 2], axis=1)
    across = jnp.sqrt(jnp.maximum(speed2 * bend2 - dot**2, 0.0)) + 1e-7 * jnp.sqrt(speed2 * bend2)
    speed = jnp.sqrt(speed2)
    # |r' x r''| changes by |r' x r'''| at most, and half a step is the way to the nearer look
    across = jnp.maximum(across[:-1], across[1:]) + 0.5 * step * fast * third
    slowest = jnp.minimum(speed[:-1], speed[1:]) - 0.5 * step * bend
    larger = jnp.where(slowest > 0.0, across / jnp.where(slowest > 0.0, slowest, 1.0) ** 3, jnp.inf)
    larger = jnp.where(jnp.isnan(larger), jnp.inf, larger)
    chord = jnp.sqrt(jnp.sum(jnp.diff(r[:, 0], axis=0) ** 2, axis=1))
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
        safe = 1.0 / (3.2 * most[here.start - width : here.stop - width] + 1e-300)
        best = jnp.maximum(best, jnp.minimum(jnp.minimum(ahead, behind) / 2.2, safe))
    return best


def _windows(values: Array, width: int, reduce: Any, start: float) -> Array:
    return jax.lax.reduce_window(  # type: ignore[no-any-return]
        values, np.float64(start), reduce, (width,), (1,), "valid"
    )
