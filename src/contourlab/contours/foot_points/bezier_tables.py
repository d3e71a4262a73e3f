"""Of every Bézier row: arc length as a series of u, and a bound of the curvature.

Where the distance from a row is small against its radius of curvature, the row's stretch has one
nearest point, and Newton's method over arc length finds it in a few steps, without cells or looks.

Let e be the distance of the point q from the reference point c, and K bound the curvature of the
row. If 3.2 e K < 1, then inside the ball of radius 2 e about c

- |r - q| <= 3 e, so that |r - q|² is convex over arc length: the stretch has one minimum;
- |r - c|² is convex too: the row leaves the ball once, at most 4.4 e of arc length from where the
  stretch begins (the chord is at most 4 e, and 2 asin(2 e K) / K < 4.4 e);
- on those 4.4 e the row turns by less than a right angle, so what lies there in the ball lies in
  the stretch.

So a minimum with |r - q| <= e at most 4.4 e away is the one looked for, and the end of the row is
on the stretch if it is as near as that and in the ball. K is sampled, with 20 % added.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from contourlab.contours.bezier import chebyshev_value, rational_taylor
from contourlab.typing import Array

__all__ = ["BezierTables", "bezier_tables"]

CONVEX = 3.2
"""Times error and curvature must be below 1."""
REACH = 4.4
"""Arc length of the stretch in a row, at most, as a multiple of the error."""

_COUNT = 25
_ANGLES = np.pi * (np.arange(_COUNT) + 0.5) / _COUNT
_FIT = 2.0 / _COUNT * np.cos(np.outer(np.arange(_COUNT), _ANGLES))
_FIT[0] *= 0.5
_INTEGRAL = np.stack([chebyshev.chebint(row, lbnd=-1) for row in np.eye(_COUNT)], axis=1)
_LENGTH_FIT = 0.5 * _INTEGRAL @ _FIT  # from speeds over u at the nodes to the series of length
_PLACES = np.concatenate([0.5 + 0.5 * np.cos(_ANGLES), [0.0, 1.0]])
_ROWS = (1 << 8, 1 << 13)


class BezierTables(eqx.Module):
    """Tables of the Bézier rows."""

    control: Array
    forward: Array
    """Chebyshev coefficients of arc length over 2 u - 1, shape (n_rows, n_coefficients) [m]."""
    curvature: Array
    """Bound of the curvature, shape (n_rows,) [1/m]."""
    fastest: Array
    """Bound of |dr/du|, shape (n_rows,) [m]."""

    def length(self, at: Array, inverse: Array, length: Array, u: Array) -> Array:
        """Return arc length from the start of a row to u, in one with the row's own series.

        Parameters
        ----------
        at
            Row of the tables.
        inverse, length
            The row's series of u over arc length, and its length [m].
        u
            Parameter in [0, 1].
        """
        slope = [series[1] for series in rational_taylor(self.control[at], u, 1)]
        s = chebyshev_value(self.forward[at], 2.0 * u - 1.0)
        off = chebyshev_value(inverse, 2.0 * s / length - 1.0) - u
        return jnp.clip(s - off * jnp.sqrt(_dot(slope, slope)), 0.0, length)

    def nearest(
        self, at: Array, q: Array, begin: Array, error: Array, steps: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the nearest u of a row's stretch that begins, or goes both ways, at ``begin``.

        Parameters
        ----------
        at
            Row of the tables.
        q
            The point, shape (n_axes,) [m].
        begin
            Parameter u on the stretch.
        error
            Distance of ``q`` from the reference point [m].
        steps
            Newton steps.

        Returns
        -------
        tuple
            u, squared distance [m²], the point there, and whether it is certain; but it must be in
            the ball, and ``REACH * error`` of arc length from ``begin`` at most.
        """
        control = self.control[at]

        def look(_: Any, state: Any) -> Any:
            _, _, convex, new, *_ = state
            curve = rational_taylor(control, new, 2)
            d = [series[0] - q[axis] for axis, series in enumerate(curve)]
            slope = [series[1] for series in curve]
            second = [2.0 * series[2] for series in curve]
            speed2, along = _dot(slope, slope), _dot(d, slope)
            # 1 + d . r'' over arc length: the second derivative of half the squared distance
            bend = 1.0 + (_dot(d, second) - along * _dot(slope, second) / speed2) / speed2
            upward = bend > 0.02
            nearer = jnp.clip(new - along / (speed2 * jnp.where(upward, bend, 1.0)), 0.0, 1.0)
            place = jnp.stack([series[0] for series in curve])
            last = jnp.abs(nearer - new) * jnp.sqrt(speed2)
            return new, last, convex & upward, nearer, _dot(d, d), place

        # one look more than steps; the step after the last is only measured. Rolled up: written
        # out it would run a little faster and take seconds to compile
        yes, zero = begin == begin, 0.0 * begin
        first = (begin, zero, yes, begin, zero, 0.0 * q)
        u, last, convex, _, squared, place = jax.lax.fori_loop(0, steps + 1, look, first)
        # places are right to the rounding of coordinates, and a foot to the square of this step
        small = last <= 1e-8 * error + 1e-13
        sure = convex & small & (CONVEX * error * self.curvature[at] < 1.0)
        return u, squared, place, sure


def _dot(a: list[Any], b: list[Any]) -> Any:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


@jax.jit
def _tables(control: Any) -> tuple[Any, Any, Any]:
    def one(control: Any, u: Any) -> tuple[Any, Any]:
        # about its first point: no rounding of the size of the coordinates is left
        weight = control[:, -1:]
        first = control[0, :-1] / control[0, -1]
        local = jnp.concatenate([control[:, :-1] - weight * first, weight], axis=1)
        curve = rational_taylor(local, u, 2)
        slope = [series[1] for series in curve]
        second = [2.0 * series[2] for series in curve]
        speed2 = _dot(slope, slope)
        along = _dot(slope, second) / speed2
        across = [b - along * a for a, b in zip(slope, second, strict=True)]
        return jnp.sqrt(speed2), jnp.sqrt(_dot(across, across)) / speed2

    places = jnp.asarray(_PLACES)
    speed, curvature = jax.vmap(jax.vmap(one, (None, 0)), (0, None))(control, places)
    forward = speed[:, :_COUNT] @ jnp.asarray(_LENGTH_FIT).T
    return forward, 1.2 * jnp.max(curvature, axis=1), 1.1 * jnp.max(speed, axis=1)


def bezier_tables(control: NDArray[Any]) -> BezierTables:
    """Return the tables of Bézier rows.

    Parameters
    ----------
    control
        Homogeneous control points, shape (n_rows, degree + 1, n_axes + 1), not empty.
    """
    n, parts = len(control), []
    size = _ROWS[0] if n <= _ROWS[0] else _ROWS[1]
    for at in range(0, n, size):
        some = control[at : at + size]
        whole = np.concatenate([some, np.repeat(some[-1:], size - len(some), axis=0)])
        parts.append([np.asarray(x)[: len(some)] for x in _tables(whole)])
    tables = (jnp.asarray(np.concatenate(part)) for part in zip(*parts, strict=True))
    return BezierTables(jnp.asarray(control), *tables)
