"""Nearest and farthest points on a short piece of smooth curve: looks, brackets, Newton in them.

It is assumed that no two stationary points of the distance fall between two neighbouring looks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.typing import Array

__all__ = ["Curve", "nearest_by_scan", "peak_by_halving"]

SCAN = 4
"""Brackets looked at."""
_NEWTON_STEPS = 60
_EPS = float(np.finfo(float).eps)

Curve = Callable[[Array, int], Array]
"""From a parameter and an order to the point and its derivatives, shape (order + 1, n_axes)."""


def nearest_by_scan(
    curve: Curve, q: Array, low: Array, high: Array, wanted: Array
) -> tuple[Array, Array]:
    """Return the parameter nearest to ``q`` in ``[low, high]`` of a smooth curve, and how near.

    Parameters
    ----------
    curve
        To be asked for order 2.
    q
        The point, shape (n_axes,).
    low, high
        The range, scanned in ``SCAN`` brackets.
    wanted
        Whether the answer matters.
    """

    def look(x: Array) -> tuple[Array, Array, Array, Any]:
        r = curve(x, 2)
        d = r[0] - q
        speed2 = r[1] @ r[1]
        return d @ d, d @ r[1], speed2 + d @ r[2], (speed2, r[2] @ r[2], r[0] @ r[0])

    fraction = jnp.arange(SCAN + 1) / SCAN
    edges = jnp.where(fraction == 1.0, high, low + (high - low) * fraction)
    squared, slope, *_ = jax.vmap(look)(edges)
    a, b, ga, gb = edges[:-1], edges[1:], slope[:-1], slope[1:]
    minimum = (ga < 0.0) & (gb >= 0.0)
    tolerance = 4.0 * _EPS * (jnp.abs(high) + jnp.abs(high - low))
    start = jnp.where(minimum, a - (b - a) * ga / jnp.where(minimum, gb - ga, 1.0), a)

    def step(state: Any) -> Any:
        a, b, x, value, todo, count = state
        seen, g, h, (speed2, bend2, size2) = jax.vmap(look)(x)
        value = jnp.where(todo, seen, value)
        a, b = jnp.where(todo & (g < 0.0), x, a), jnp.where(todo & (g >= 0.0), x, b)
        newton = x - g / jnp.where(h > 0.0, h, 1.0)
        inside = (h > 0.0) & (newton >= a) & (newton <= b)
        new = jnp.where(inside, newton, 0.5 * (a + b))
        new = jnp.where(todo, new, x)
        # the point moves by less than the rounding of its coordinates
        step = jnp.abs(new - x)
        moved = step * (jnp.sqrt(speed2) + step * jnp.sqrt(bend2))
        going = (step > tolerance) & ~(moved <= 2.0 * _EPS * jnp.sqrt(size2))
        return a, b, new, value, todo & going, count + 1

    _, _, x, value, _, _ = jax.lax.while_loop(
        lambda state: jnp.any(state[4]) & (state[5] < _NEWTON_STEPS),
        step,
        (a, b, start, jnp.full_like(start, jnp.inf), minimum & wanted, jnp.zeros((), jnp.int32)),
    )
    at = jnp.concatenate([x, edges])
    values = jnp.concatenate([value, squared])
    best = jnp.argmin(values)
    return at[best], values[best]


def peak_by_halving(
    curve: Curve, c: Array, start: Array, end: Array, wanted: Array
) -> tuple[Array, Array]:
    """Return the peak of the distance from ``c`` on a short piece of smooth curve.

    Parameters
    ----------
    curve
        To be asked for order 1.
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

    def look(x: Array) -> tuple[Array, Array]:
        r = curve(x, 1)
        d = r[0] - c
        return way * (d @ r[1]) > 0.0, d @ d

    rising, _ = jax.vmap(look)(jnp.stack([start + 0.125 * (end - start), end]))
    wanted = wanted & rising[0] & ~rising[1]

    def halve(state: Any) -> Any:
        a, b, _, k = state
        x = 0.5 * (a + b)
        up, squared = look(x)
        return jnp.where(up, x, a), jnp.where(up, b, x), squared, k + 1

    # a peak's height is flat in its place: 30 halvings give it to rounding
    a, b, squared, _ = jax.lax.while_loop(
        lambda state: wanted & (state[3] < 30),
        halve,
        (start, end, jnp.zeros_like(start), jnp.zeros((), jnp.int32)),
    )
    return jnp.where(wanted, 0.5 * (a + b), end), jnp.where(wanted, squared, 0.0)
