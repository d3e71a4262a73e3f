"""A path in cells: lines and planar arcs whole, helices by the turn, Bézier pieces in parts."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.contours.bezier import chebyshev_value
from contourlab.contours.foot_points.cells import Cells, placed
from contourlab.contours.foot_points.path_table import derivative_bounds
from contourlab.contours.helical import helical_derivatives
from contourlab.contours.path import Path
from contourlab.typing import Array

__all__ = ["PathCells", "path_cells"]

BEZIER_CELLS = 8
"""Cells of a Bézier piece."""
HELIX_TURN = np.pi / 4
"""Largest angle that a cell of a helix turns [rad]."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class PathCells(Cells):
    """A path: its pieces are the rows."""

    contour: Path
    n_cells: Array
    has_lines: bool = eqx.field(static=True)
    """Whether lines or planar arcs are, or may be, among the pieces; and so on."""
    has_arcs: bool = eqx.field(static=True)
    has_helices: bool = eqx.field(static=True)
    has_beziers: bool = eqx.field(static=True)

    bezier_rates: Array
    """Bounds of |r'|, |r''| and |r'''| of the Bézier rows, shape (3, n_bezier_rows)."""

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return self.contour.n_pieces

    @property
    def closed_form(self) -> bool:
        """Whether every row is a line or a planar arc."""
        return not (self.has_helices or self.has_beziers)

    @property
    def any_simple(self) -> bool:
        """Whether some row may be a line or a planar arc."""
        return self.has_lines or self.has_arcs

    @property
    def by_length(self) -> bool:
        """Whether the parameter of every row is arc length."""
        return not self.has_beziers

    @property
    def straight(self) -> bool:
        """Whether every row is a line."""
        return self.closed_form and not self.has_arcs

    def total(self) -> Array:
        """Return the number of cells."""
        return self.n_cells

    def place(self, parameter: Array, piece: Array | None) -> tuple[Array, Array, Array]:
        """Return row, the row's own parameter and lap of a parameter."""
        path = self.contour
        row = path.find(parameter) if piece is None else path.locate(parameter, piece)
        return self.place_on(parameter, jnp.asarray(row, jnp.int32))

    def place_on(self, parameter: Array, row: Array) -> tuple[Array, Array, Array]:
        """Return row, the row's own parameter and lap of a parameter known to be on a row."""
        path = self.contour
        row, s, lap = placed(path, parameter, row)
        breaks = jnp.asarray(path.breaks)
        length = breaks[row + 1] - breaks[row]
        s = jnp.clip(s - (breaks[row] - breaks[0]), 0.0, length)
        if self.has_beziers:
            u = chebyshev_value(self._inverse(row), 2.0 * s / length - 1.0)
            s = jnp.where(self._is_bezier(row), jnp.clip(u, 0.0, 1.0), s)
        return row, s, lap

    def parameter(self, row: Array, s: Array, lap: Array) -> Array:
        """Return the contour's parameter of a place."""
        path = self.contour
        breaks = jnp.asarray(path.breaks)
        length = breaks[row + 1] - breaks[row]
        if self.has_beziers:
            s = jnp.where(self._is_bezier(row), self._bezier_length(row, s, length), s)
        return breaks[row] + s + lap * path.length

    def _bezier_length(self, row: Array, u: Array, length: Array) -> Array:
        """Return arc length to u: by quadrature, then made one with the path's own series."""

        def speed(u: Array) -> Array:
            slope = self._bezier(row, u, 1)[1]
            return jnp.sqrt(slope @ slope)

        nodes = u * (0.5 + 0.5 * jnp.asarray(_NODES))
        s = 0.5 * u * (jax.vmap(speed)(nodes) @ jnp.asarray(_WEIGHTS))
        off = chebyshev_value(self._inverse(row), 2.0 * s / length - 1.0) - u
        return jnp.clip(s - off * speed(u), 0.0, length)

    def right_side(self, row: Array, s: Array, lap: Array) -> tuple[Array, Array, Array]:
        """Return the start of the next row for the end of this one."""
        over = s >= self.extent(row)
        last = row + 1 >= self.n_rows
        over = over & (self.contour.closed | ~last)
        new = jnp.where(over, jnp.where(last, 0, row + 1), row).astype(row.dtype)
        lap = lap + jnp.where(over & last, 1, 0).astype(lap.dtype)
        return new, jnp.where(over, 0.0, s), lap

    def quick(self, q: Array, s: Array) -> tuple[Array, Array, Array]:
        """Return that there is no quicker way than the walk itself."""
        return s, jnp.full_like(s, jnp.inf), jnp.zeros((), bool)

    def parts(self, row: Array) -> Array:
        """Return the number of cells of a row."""
        parts = jnp.ones_like(row)
        if self.has_helices:
            turn = jnp.abs(self._rate(row)) * self.extent(row)
            turns = jnp.clip(jnp.ceil(turn / HELIX_TURN), 1.0, 2.0**30).astype(row.dtype)
            parts = jnp.where(self._is_helix(row), turns, 1)
        if self.has_beziers:
            parts = jnp.where(self._is_bezier(row), BEZIER_CELLS, parts)
        return parts

    def joint(self, row: Array, part: Array, sign: Array) -> Array:
        """Return the point where a cell ends."""
        if not self.closed_form:
            return super().joint(row, part, sign)
        # past the end of an open path nothing is walked, and a closed one begins again
        after = jnp.where(row + 1 >= self.n_rows, 0, row + 1)
        return jnp.asarray(self.contour.origin)[jnp.where(sign > 0, after, row)]

    def extent(self, row: Array) -> Array:
        """Return the row's own parameter at its end."""
        breaks = jnp.asarray(self.contour.breaks)
        length = breaks[row + 1] - breaks[row]
        return jnp.where(self._is_bezier(row), 1.0, length) if self.has_beziers else length

    def curve(self, row: Array, s: Array, order: int) -> Array:
        """Return point and derivatives over the row's own parameter."""
        if self.straight:
            origin, tangent, _ = self.arc(row)[2]
            rows = [origin + s * tangent, tangent, jnp.zeros_like(tangent)]
            return jnp.stack(rows[: order + 1])
        if not self.has_beziers:
            return self._helical(row, s, order)
        if not (self.any_simple or self.has_helices):
            return self._bezier(row, s, order)
        return jnp.where(
            self._is_bezier(row), self._bezier(row, s, order), self._helical(row, s, order)
        )

    def rates(self, row: Array, part: Array) -> Array:
        """Return bounds of |r'|, |r''| and |r'''| over the row's own parameter, shape (3,)."""
        rate = jnp.abs(self._rate(row))
        bounds = jnp.stack([jnp.ones_like(rate), rate, rate * rate])
        if self.has_beziers:
            own = jnp.asarray(self.bezier_rates)[:, self.table_row(row)]
            bounds = jnp.where(self._is_bezier(row), own, bounds)
        return bounds

    def simple_point(self, row: Array, s: Array) -> Array:
        """Return the point of a line or a planar arc."""
        if self.straight:
            origin, tangent, _ = self.arc(row)[2]
            return origin + s * tangent  # type: ignore[no-any-return]
        return self._helical(row, s, 0)[0]

    def arc(self, row: Array) -> tuple[Array, Array, Any]:
        """Return whether the row is simple, its angle rate, and origin, tangent and normal."""
        path = self.contour
        rate = self._rate(row)
        u, v = jnp.asarray(path.tangent_vector)[row], jnp.asarray(path.normal_vector)[row]
        origin, w = jnp.asarray(path.origin)[row], jnp.asarray(path.axial_vector)[row]
        straight = rate == 0.0
        if self.closed_form:
            simple = jnp.ones((), bool)
        else:
            simple = (jnp.asarray(path.bezier_row)[row] < 0) & (straight | (w @ w == 0.0))
        return simple, jnp.where(simple, rate, 0.0), (origin, jnp.where(straight, u + w, u), v)

    def _rate(self, row: Array) -> Array:
        return jnp.asarray(self.contour.angle_rate)[row]

    def _is_bezier(self, row: Array) -> Array:
        return jnp.asarray(self.contour.bezier_row)[row] >= 0

    def _is_helix(self, row: Array) -> Array:
        w = jnp.asarray(self.contour.axial_vector)[row]
        return ~self._is_bezier(row) & (self._rate(row) != 0.0) & (w @ w != 0.0)

    def table_row(self, row: Array) -> Array:
        """Return the row of the Bézier tables that a Bézier row uses."""
        return jnp.maximum(jnp.asarray(self.contour.bezier_row)[row], 0)

    def _inverse(self, row: Array) -> Array:
        return jnp.asarray(self.contour.inverse_length)[self.table_row(row)]

    def _bezier(self, row: Array, u: Array, order: int) -> Array:
        control = jnp.asarray(self.contour.control_points)[self.table_row(row)]
        return rational_derivatives(control, u, order)

    def _helical(self, row: Array, s: Array, order: int) -> Array:
        path = self.contour
        return helical_derivatives(
            s, self._rate(row), jnp.asarray(path.origin)[row],
            jnp.asarray(path.tangent_vector)[row], jnp.asarray(path.normal_vector)[row],
            jnp.asarray(path.axial_vector)[row], order,
        )  # fmt: skip


def path_cells(path: Path) -> PathCells:
    """Return a path cut into cells.

    Parameters
    ----------
    path
        If its numbers are traced, every kind of piece is allowed for.
    """
    beziers = len(path.control_points) > 0
    lines = arcs = helices = True
    if all(is_concrete(x) for x in (path.angle_rate, path.axial_vector, path.bezier_row)):
        own = np.asarray(path.bezier_row) < 0
        turning = np.asarray(path.angle_rate) != 0.0
        rising = np.any(np.asarray(path.axial_vector) != 0.0, axis=-1)
        lines = bool(np.any(own & ~turning))
        arcs = bool(np.any(own & turning & ~rising))
        helices = bool(np.any(own & turning & rising))
    control = path.control_points
    rates: Any = np.zeros((3, 0))
    if beziers:
        rates = derivative_bounds(control, np if is_concrete(control) else jnp)
    count = jnp.asarray(path.n_pieces, jnp.int32)
    cells = PathCells(path, count, lines, arcs, helices, beziers, rates)
    if cells.closed_form:
        return cells
    rows = jnp.arange(path.n_pieces, dtype=jnp.int32)
    return dataclasses.replace(cells, n_cells=_count(cells, rows))


@jax.jit
def _count(cells: PathCells, rows: Array) -> Array:
    return jnp.sum(jax.vmap(cells.parts)(rows))


def rational_derivatives(control: Array, u: Array, order: int) -> Array:
    """Return a rational Bézier curve's point and derivatives over u, in few array operations.

    Parameters
    ----------
    control
        Homogeneous control points, shape (degree + 1, n_axes + 1).
    u
        Parameter in [0, 1].
    order
        0, 1 or 2.

    Returns
    -------
    Array
        Shape (order + 1, n_axes).
    """
    degree = control.shape[0] - 1
    points, rows = control, [jnp.zeros(control.shape[1])] * 3
    for left in range(degree, -1, -1):  # de Casteljau: left + 1 points are left
        if left == 2:
            rows[2] = degree * (degree - 1) * (points[2] - 2.0 * points[1] + points[0])
        elif left == 1:
            rows[1] = degree * (points[1] - points[0])
        elif left == 0:
            rows[0] = points[0]
        points = points[:-1] + u * (points[1:] - points[:-1])
    weight = rows[0][-1]
    curve = [rows[0][:-1] / weight]
    if order >= 1:
        curve.append((rows[1][:-1] - curve[0] * rows[1][-1]) / weight)
    if order >= 2:
        bend = rows[2][:-1] - 2.0 * curve[1] * rows[1][-1] - curve[0] * rows[2][-1]
        curve.append(bend / weight)
    return jnp.stack(curve)
