"""A contour cut into cells, each small enough that its nearest point can be found for certain.

A contour is a number of *rows*, and a *cell* is a part of a row: ``(row, part)``. A row has a
parameter of its own that starts at 0: arc length on lines, arcs and helices, u on Bézier pieces,
the contour's parameter on a formula. A line or a planar arc is one cell, of whatever length,
because its nearest point has a closed form. A helix is cut into turns of π/4 at most, a Bézier
piece into eight, a formula contour, which is one row, into 1024.

Everything here takes scalars and is traceable; ``jax.vmap`` outside gives batches.
"""

from __future__ import annotations

import abc
from functools import partial
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from contourlab.contours.base import Contour
from contourlab.contours.foot_points.arcs import nearest_on_arc, peak_on_arc
from contourlab.contours.foot_points.scan import along
from contourlab.typing import Array

__all__ = ["Cells", "placed"]


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
    def any_simple(self) -> bool:
        """Whether some row may be a line or a planar arc."""

    @property
    @abc.abstractmethod
    def by_length(self) -> bool:
        """Whether the parameter of every row is arc length."""

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
    def parameter(self, row: Array, s: Array, lap: Array) -> Array:
        """Return the contour's parameter of a place."""

    @abc.abstractmethod
    def curve(self, row: Array, s: Array, order: int) -> Array:
        """Return point and derivatives over the row's own parameter."""

    @abc.abstractmethod
    def rates(self, row: Array, part: Array) -> Array:
        """Return bounds of |r'|, |r''| and |r'''| over the row's own parameter, shape (3,)."""

    @abc.abstractmethod
    def simple_point(self, row: Array, s: Array) -> Array:
        """Return the point of a row that is a line or a planar arc."""

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

    def on_arc(self, row: Array, q: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the place nearest to ``q`` in a range of a line or a planar arc, and how near.

        Parameters
        ----------
        row, q
            The row, and the point, shape (n_axes,).
        low, high
            The range.

        Returns
        -------
        tuple
            The parameter, and the squared distance.
        """
        _, rate, vectors = self.arc(row)
        s = nearest_on_arc(rate, vectors, q, low, high)
        d = self.simple_point(row, s) - q
        return s, d @ d

    def along(
        self,
        row: Array,
        part: Array,
        q: Array,
        ball: tuple[Array, Array],
        begin: Array,
        end: Array,
        known: Array,
        wanted: Array,
    ) -> tuple[Array, Array, Array]:
        """Return the place nearest to ``q`` on the way through a cell, until a ball is left.

        Parameters
        ----------
        row, part
            The cell.
        q, ball
            The point, shape (n_axes,), and centre and squared radius of the ball.
        begin, end
            From where to where, inside the cell.
        known
            Squared distance known already.
        wanted
            Whether the answer matters; it only saves work.

        Returns
        -------
        tuple
            The parameter, the squared distance, and whether the ball was left.
        """
        curve, rates = partial(self.curve, row), self.rates(row, part)
        if not self.any_simple:
            return along(curve, rates, q, *ball, begin, end, known, wanted)
        stop, over = self.cut(row, *ball, begin, end)
        s, squared = self.on_arc(row, q, jnp.minimum(begin, stop), jnp.maximum(begin, stop))
        if self.closed_form:
            return s, squared, over
        simple = self.arc(row)[0]
        general = along(curve, rates, q, *ball, begin, end, known, wanted & ~simple)
        three = zip((s, squared, over), general, strict=True)
        at, squared, over = (jnp.where(simple, *pair) for pair in three)
        return at, squared, over

    def cut(
        self, row: Array, c: Array, reach: Array, begin: Array, end: Array
    ) -> tuple[Array, Array]:
        """Return where to stop on a line or a planar arc, and whether the ball was left.

        Parameters
        ----------
        row, c, reach
            The row; centre, and squared radius of the ball.
        begin, end
            From where to where.
        """
        if self.straight:
            return end, jnp.zeros((), bool)
        _, rate, vectors = self.arc(row)
        peak, squared = peak_on_arc(rate, vectors, c, begin, end)
        over = squared > reach * (1.0 + 1e-12)
        return jnp.where(over, peak, end), over

    def joint(self, row: Array, part: Array, sign: Array) -> Array:
        """Return the point where a cell ends, in the direction ``sign``."""
        low, high = self.bounds(row, part)
        return self.curve(row, jnp.where(sign > 0, high, low), 0)[0]


def placed(contour: Contour, parameter: Array, row: Array) -> tuple[Array, Array, Array]:
    """Return the row given, how far into the domain a parameter is, and its lap.

    Parameters
    ----------
    contour
        Whose domain it is.
    parameter
        Clipped if the contour is open, wrapped if it is closed.
    row
        Handed on.
    """
    start, end = (jnp.asarray(edge, float) for edge in contour.domain)
    inside = contour.wrap(parameter)
    lap = jnp.zeros((), jnp.int32)
    if contour.closed:
        turns = jnp.round((parameter - inside) / (end - start))
        lap = jnp.nan_to_num(turns).astype(jnp.int32)
    return row, inside - start, lap
