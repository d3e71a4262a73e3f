"""How fast the axes may be, for what comes on the path: corners, turns, the end.

A horizon sees a turn only when it is near, and a path that is linearised has no corners at all. On
a grid of equal arc lengths h, with a deceleration a that every axis can give and the angle θ that
the path turns by on an interval,

    v² <= a h / θ    on the interval,    |v²(s + h) - v²(s)| <= 2 a h.                        (1)

θ / h is the curvature on smooth stretches; a corner counts as turned over one interval. With every
turn it is how fast a plan may be where it ends; with corners alone, θ less what curvature turns,
how fast it may be anywhere.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from contourlab.controllers.model_predictive_contouring_path import ProgressPath
from contourlab.typing import Array, Scalar

__all__ = ["SafeSpeed", "safe_speed"]

INTERVALS = 2048
SMOOTH = 1e-3
"""Angle [rad] from which on a joint is a corner."""


class SafeSpeed(eqx.Module):
    """Square of the speed that is safe, over arc length; infinite where there is no bound."""

    everything: Array
    """For every turn and the end, at equal arc lengths, (INTERVALS + 1,) [m²/s²]."""
    corners: Array
    """For corners alone."""
    length: Array
    """Of the path [m]."""
    closed: bool = eqx.field(static=True)

    def at(self, squares: Array, progress: Scalar) -> tuple[Array, Array]:
        """Return the square of a safe speed [m²/s²] and its slope [m/s²].

        Parameters
        ----------
        squares
            ``everything`` or ``corners``.
        progress
            Arc length [m].
        """
        share = progress / self.length * INTERVALS
        if self.closed:
            share = jnp.mod(share, INTERVALS)
        share = jnp.clip(share, 0.0, INTERVALS)
        cell = jnp.clip(jnp.floor(jax.lax.stop_gradient(share)), 0, INTERVALS - 1)
        k = cell.astype(jnp.int32)
        low, high = squares[k], squares[k + 1]
        bounded = jnp.isfinite(low) & jnp.isfinite(high)
        low, high = jnp.where(bounded, low, 0.0), jnp.where(bounded, high, 0.0)
        square = low + (share - cell) * (high - low)
        return (
            jnp.where(bounded, square, jnp.inf),
            jnp.where(bounded, (high - low) * INTERVALS / self.length, 0.0),
        )


def safe_speed(path: ProgressPath, deceleration: Scalar) -> SafeSpeed:
    """Return the safe speed along a path, by (1) backwards and forwards.

    Parameters
    ----------
    path
        The contour over arc length.
    deceleration
        a > 0 [m/s²]; infinite if commands have no limit, and every speed is then safe.
    """
    closed = path.contour.closed
    width = path.length / INTERVALS
    bounded = jnp.isfinite(deceleration)
    a = jnp.where(bounded, deceleration, 1.0)
    places = jnp.arange(INTERVALS + 1) * width
    points, _ = path.points(places, jnp.zeros((), jnp.int32))
    angle = jnp.sqrt(jnp.sum(jnp.diff(points.tangent, axis=0) ** 2, axis=1) + 1e-24)
    curvature = jnp.sqrt(jnp.sum(points.bend**2, axis=1) + 1e-24)
    curved = width * jnp.maximum(curvature[1:], curvature[:-1])
    kink = angle - 1.5 * curved  # 1.5: curvature may vary over an interval
    sharp = kink > SMOOTH
    rise = 2.0 * a * width

    def limit(square: Any, cap: Any) -> tuple[Any, Any]:
        square = jnp.minimum(cap, square + rise)
        return square, square

    def profile(cap: Array, *, stop: bool) -> Array:
        before = jnp.concatenate([cap[-1:] if closed else cap[:1], cap])
        after = jnp.concatenate([cap, cap[:1] if closed else cap[-1:]])
        caps = jnp.minimum(before, after)
        caps = caps.at[-1].set(0.0) if stop else caps
        first = jnp.max(caps)
        for _ in range(2 if closed else 1):  # twice around: what is after the seam counts before
            first, caps = jax.lax.scan(limit, first, caps, reverse=True)
        _, caps = jax.lax.scan(limit, caps[-1] if closed else caps[0], caps)
        return jnp.where(bounded, caps, jnp.inf)

    return SafeSpeed(
        profile(a * width / angle, stop=not closed),
        profile(jnp.where(sharp, a * width / jnp.where(sharp, kink, 1.0), jnp.inf), stop=False),
        path.length, closed,
    )  # fmt: skip
