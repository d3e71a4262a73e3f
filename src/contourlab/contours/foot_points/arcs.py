"""Nearest and farthest points of lines and circles, in closed form.

The circle of curvature κ through the origin with a first tangent and a normal; a line where κ = 0.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from contourlab.typing import Array

__all__ = ["arc_foot", "nearest_on_arc", "peak_on_arc"]


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
    return jnp.where(line, x, jnp.arctan2(safe * x, 1.0 - safe * y) / safe)


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
