"""Along a smooth stretch of curve until it leaves a ball, with the nearest point on the way.

The same bounds as in :mod:`~contourlab.contours.foot_points.certified`, for one stretch and inside
a traced program: intervals are taken in the order of the stretch, halved where they cannot be
judged and doubled behind those that could, so that no list of them is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.typing import Array

__all__ = ["Curve", "along"]

INTERVALS = 2048
"""Intervals of one stretch, at most: beyond that they are taken as they are."""
DOUBLINGS = 1100
"""Looks after that, at most: each takes twice the width of the one before, and no width above zero
needs more doublings to become the whole. The loop says so, for compilers that ask for a bound."""
NEWTON_STEPS = 16
"""Steps of Newton's method in an interval, at most; from a certain start 7 are enough."""
ROUGH = 2.0**-9
"""Share of a stretch without a bound of the third derivative (a corner or a jump of curvature is in
it) below which nothing is halved: there the sign of the slope is followed instead."""
BISECTIONS = 60
"""Halvings of such an interval, at most."""
_ACCURACY = 1e-13
_EPS = float(np.finfo(float).eps)

Curve = Callable[[Array, int], Array]
"""From a parameter and an order to the point and its derivatives, shape (order + 1, n_axes)."""


class _Judged(NamedTuple):
    squared: Array
    h: Array
    swing: Array
    fall: Array
    one_way: Array


def _judged(d: Array, r: Array, width: Array, fast: Array, bend: Array, third: Array) -> _Judged:
    squared, g, h = d @ d, d @ r[1], r[1] @ r[1] + d @ r[2]
    p0 = jnp.sqrt(squared) + width * fast
    swing = width * _finite(3.0 * fast * bend + p0 * third)
    most = jnp.minimum(jnp.abs(h) + swing, _finite(fast * fast + p0 * bend))
    fall = 0.5 * width * width * jnp.minimum(jnp.abs(h) + swing / 3.0, most)
    fall = jnp.minimum(width * jnp.abs(g) + fall, width * p0 * fast)
    return _Judged(squared, h, swing, fall, jnp.abs(g) > width * most)


def _finite(value: Array) -> Array:
    return jnp.where(jnp.isnan(value), jnp.inf, value)


def along(
    curve: Curve,
    rates: Array,
    q: Array,
    c: Array,
    reach: Array,
    begin: Array,
    end: Array,
    known: Array,
    wanted: Array,
) -> tuple[Array, Array, Array]:
    """Return the nearest place of a stretch, how near, and whether a ball was left on the way.

    Parameters
    ----------
    curve
        To be asked for order 2.
    rates
        Bounds of |r'|, |r''| and |r'''| on the stretch, shape (3,).
    q, c, reach
        The point and the centre of the ball, shape (n_axes,), and the square of its radius.
    begin, end
        The stretch; it begins in the ball, at a place that is known already.
    known
        Squared distance known already: what is not nearer need not be found.
    wanted
        Whether the answer matters; it only saves work.
    """
    way = end - begin
    limit = reach * (1.0 + 1e-12)

    def body(state: Any) -> Any:
        x, width, at, best, over, count = state
        last = x + width >= 1.0
        a, b = begin + x * way, jnp.where(last, end, begin + (x + width) * way)
        m, half = 0.5 * (a + b), 0.5 * jnp.abs(b - a)
        r = curve(m, 2)
        bend = jnp.minimum(rates[1], jnp.sqrt(r[2] @ r[2]) + half * rates[2])
        fast = jnp.minimum(rates[0], jnp.sqrt(r[1] @ r[1]) + half * bend)
        mine = _judged(r[0] - q, r, half, fast, bend, rates[2])
        ball = _judged(r[0] - c, r, half, fast, bend, rates[2])
        edge = curve(b, 0)[0]
        most = jnp.minimum(best, known)
        rough = ~jnp.isfinite(rates[2]) & (width <= ROUGH)
        tiny = (half <= 4.0 * _EPS * (jnp.abs(a) + jnp.abs(b))) | (count >= INTERVALS) | rough
        # the nearest point
        lowest = mine.squared - 2.0 * mine.fall
        distance = jnp.sqrt(mine.squared) - half * fast
        far = (lowest >= most) | ((distance > 0.0) & (distance * distance >= most))
        newton = (mine.h >= 4.0 * mine.swing) & (mine.h > 0.0) & ~far & ~mine.one_way
        slack = _ACCURACY * most + 4.0 * _EPS * jnp.sqrt(most * (r[0] @ r[0]))
        judged = far | mine.one_way | newton | (mine.h + mine.swing < 0.0) | tiny
        judged = judged | (lowest >= jnp.minimum(most, mine.squared) - 2.0 * slack)
        # the ball
        inside = ball.squared + 2.0 * ball.fall <= limit
        simple = ball.one_way | (ball.h >= ball.swing) | (ball.fall <= 1e-13 * limit) | tiny
        done = judged & (inside | simple)
        out = done & ~inside & (jnp.sum((edge - c) ** 2) > limit)
        found, squared = _newton(
            curve, q, m, jnp.minimum(a, b), jnp.maximum(a, b), mine.squared, done & newton
        )
        turn, lowest_there = _bisection(
            curve, q, jnp.minimum(a, b), jnp.maximum(a, b), done & rough & ~far
        )
        for place, value in (
            (m, mine.squared), (b, jnp.sum((edge - q) ** 2)), (found, squared),
            (turn, lowest_there),
        ):  # fmt: skip
            nearer = done & (value < best)
            at, best = jnp.where(nearer, place, at), jnp.where(nearer, value, best)
        at = jnp.where(done & newton & (squared <= best), found, at)  # the better place of equals
        x = jnp.where(done, jnp.where(last, 1.0, x + width), x)
        width = jnp.where(done, 2.0 * width, 0.5 * width)
        return x, width, at, best, over | out, count + 1

    zero = 0.0 * (begin + end)
    first = (
        zero, zero + 1.0, begin + zero, zero + jnp.inf, zero != zero, jnp.zeros((), jnp.int32)
    )  # fmt: skip
    _, _, at, best, over, _ = jax.lax.while_loop(
        lambda state: (
            wanted & (begin != end) & (state[0] < 1.0) & ~state[4]
            & (state[5] < INTERVALS + DOUBLINGS)
        ),
        body, first,
    )  # fmt: skip
    return at, best, over


def _bisection(
    curve: Curve, q: Array, low: Array, high: Array, wanted: Array
) -> tuple[Array, Array]:
    """Return a place where the distance turns from falling to rising, a corner or not."""

    def rising(x: Array) -> Array:
        r = curve(x, 1)
        return (r[0] - q) @ r[1] >= 0.0

    def step(state: Any) -> Any:
        low, high, count = state
        middle = 0.5 * (low + high)
        up = rising(middle)
        return jnp.where(up, low, middle), jnp.where(up, middle, high), count + 1

    last = jnp.where(wanted, BISECTIONS, 0)
    low, high, _ = jax.lax.while_loop(
        lambda state: state[2] < last, step, (low, high, jnp.zeros((), last.dtype))
    )
    ends = [jnp.sum((curve(x, 0)[0] - q) ** 2) for x in (low, high)]
    nearer = ends[0] < ends[1]
    return jnp.where(nearer, low, high), jnp.minimum(*ends)


def _newton(
    curve: Curve, q: Array, x: Array, low: Array, high: Array, squared: Array, wanted: Array
) -> tuple[Array, Array]:
    """Return the zero of g in an interval that holds one at most, or the end nearest to it."""

    def step(state: Any) -> Any:
        x, _, _, _, count = state
        r = curve(x, 2)
        d = r[0] - q
        speed2 = r[1] @ r[1]
        h = speed2 + d @ r[2]
        new = jnp.clip(x - d @ r[1] / jnp.where(h > 0.0, h, 1.0), low, high)
        moved = jnp.abs(new - x) * jnp.sqrt(speed2)
        # the point moves by less than the rounding of its coordinates
        rounding = jnp.sqrt(r[0] @ r[0]) + jnp.sqrt(speed2) * jnp.abs(x)
        return new, x, d @ d, moved > 2.0 * _EPS * rounding, count + 1

    # no dearer than the middle by rounding: it is the better place
    _, at, best, _, _ = jax.lax.while_loop(
        lambda state: state[3] & (state[4] < NEWTON_STEPS),
        step,
        (x, x, squared, wanted, jnp.zeros((), jnp.int32)),
    )
    return at, jnp.minimum(best, squared)
