"""Nearest point and first way out of a ball on a smooth curve, certain by bounds of derivatives.

A stretch is cut into intervals until each can be judged by what the curve is at its middle m and by
bounds R1, R2, R3 of |r'|, |r''|, |r'''| on it. With w half its width, D = |r - q|²/2,

    g = D' = d . r',    h = D'' = r' . r' + d . r'',    d = r - q,
    |d| <= P0 = |d(m)| + w P1,    |r'| <= P1 = min(R1, |r'(m)| + w P2),
    |r''| <= P2 = min(R2, |r''(m)| + w R3),    |h'| <= H = 3 P1 P2 + P0 R3,

so that an interval

- is too far if |d(m)| - w P1, or D(m) less what D can fall on it, is no less than the best known;
- has no minimum inside if |g(m)| > w max |h|, or if h(m) + w H < 0;
- holds one point at most where g = 0, to which Newton's method kept inside it converges from m if
  h(m) >= 4 w H: h then is within a quarter of h(m), so that each step leaves two thirds of the
  error at most, and soon its square;
- is cut in two otherwise. That ends because what D can fall goes to nothing with w.

Nothing here rests on looks at chosen places. A bound may be infinite: beside a corner R2 and R3, at
a jump of curvature R3. Work is in NumPy, over as many intervals at a time as there are: none waits
for another, and nothing is compiled.
"""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Curve", "HeadStart", "Places", "dot", "first_exit", "keep_nearer", "nearest"]

Values = NDArray[Any]

ACCURACY = 1e-13
"""A distance may be off by this much of the contour's size where the foot is ill-conditioned."""
_NEWTON = 16
_HALVINGS = 64
_EPS = float(np.finfo(float).eps)


class Curve(abc.ABC):
    """Rows of curve, each with a parameter of its own from 0, and bounds of their derivatives.

    Arrays of points have their axes first, shape (n_axes, n), so that a coordinate lies together.
    """

    n_axes: int
    total: float
    """Of the contour's parameter, start to end."""
    size: float
    """Of the contour [m]."""
    rounding: float
    """Of its coordinates [m]."""

    @abc.abstractmethod
    def look(
        self, row: Values, t: Values, q: Values, order: int = 2
    ) -> tuple[Values, Values, Values]:
        """Return r - q, r' and r'' at many places, each of shape (n_axes, n).

        Parameters
        ----------
        row, t, q
            Places and points.
        order
            What is beyond it need not be right.
        """

    @abc.abstractmethod
    def rates(self, row: Values, low: Values, high: Values) -> tuple[Values, Values, Values]:
        """Return bounds of |r'|, |r''| and |r'''| on many stretches.

        Parameters
        ----------
        row, low, high
            The stretches.
        """

    @abc.abstractmethod
    def place(self, parameter: Values) -> tuple[Values, Values, Values]:
        """Return row, the row's own parameter, and lap of parameters of the contour.

        Parameters
        ----------
        parameter
            Clipped on an open contour, wrapped on a closed one; NaN where not finite.
        """

    @abc.abstractmethod
    def parameter(self, row: Values, s: Values, lap: Values, slope: Values) -> Values:
        """Return the contour's parameter of places.

        Parameters
        ----------
        row, s, lap
            Places.
        slope
            r' there, shape (n_axes, n).
        """

    def right_side(self, row: Values, s: Values, lap: Values) -> tuple[Values, Values, Values]:
        """Return the start of the next row for places that are the end of theirs.

        Parameters
        ----------
        row, s, lap
            Places.
        """
        return row, s, lap

    def head_start(self, q: Values, s: Values) -> HeadStart | None:
        """Return what is easily known of points near places of the contour, or None.

        Parameters
        ----------
        q
            Points, shape (n_axes, n) [m].
        s
            Places, the row's own parameter.
        """
        return None

    @abc.abstractmethod
    def nearest(
        self, q: Values, row: Values, low: Values, high: Values, known: Values
    ) -> tuple[Values, Values]:
        """Return the nearest places of stretches, and their squared distances.

        Parameters
        ----------
        q, row, low, high, known
            As in :func:`nearest`.
        """


class HeadStart(NamedTuple):
    """Places near given ones, each the nearest of a stretch of the contour, for many points."""

    squared: Values
    s: Values
    low: Values
    high: Values
    """The stretch; it may go beyond the seam of a closed contour."""
    sure: Values
    """Whether there is such a stretch."""


class Places(NamedTuple):
    """Places on a contour, one per point; ``squared`` is NaN where there is none."""

    squared: Values
    row: Values
    s: Values
    lap: Values


def dot(a: Values, b: Values) -> Values:
    """Return products of vectors, shape (n,).

    Parameters
    ----------
    a, b
        Shape (n_axes, n).
    """
    total: Values = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total += x * y
    return total


def keep_nearer(best: tuple[Values, ...], task: Values, new: tuple[Values, ...]) -> None:
    """Write what is nearer; a task may come several times.

    Parameters
    ----------
    best
        Squared distances, and other arrays, one element per task.
    task
        To which the new ones belong.
    new
        As ``best``.
    """
    better = np.flatnonzero(new[0] < best[0][task])
    if not len(better):
        return
    order = better[np.argsort(-new[0][better], kind="stable")]  # the nearest is written last
    at = task[order]
    for whole, part in zip(best, new, strict=True):
        whole[at] = part[order]


class _Judged:
    """What is known of intervals from their middles."""

    def __init__(self, curve: Curve, row: Values, a: Values, b: Values, q: Values) -> None:
        self.middle, width = 0.5 * (a + b), 0.5 * np.abs(b - a)
        d, slope, bend = curve.look(row, self.middle, q)
        fast, second, third = curve.rates(row, np.minimum(a, b), np.maximum(a, b))
        self.width, self.squared = width, dot(d, d)
        self.g = dot(d, slope)
        speed2 = dot(slope, slope)
        self.h = speed2 + dot(d, bend)
        self.distance = np.sqrt(self.squared)
        with np.errstate(invalid="ignore", over="ignore"):
            p2 = np.minimum(second, np.sqrt(dot(bend, bend)) + width * third)
            self.p1 = np.minimum(fast, np.sqrt(speed2) + width * p2)
            p0 = self.distance + width * self.p1
            self.swing = width * _finite(3.0 * self.p1 * p2 + p0 * third)
            most = np.minimum(np.abs(self.h) + self.swing, _finite(self.p1**2 + p0 * p2))
            self.one_way = np.abs(self.g) > width * most
            fall = 0.5 * width * width * np.minimum(np.abs(self.h) + self.swing / 3.0, most)
            self.fall = np.minimum(width * np.abs(self.g) + fall, width * p0 * self.p1)


def _finite(values: Values) -> Values:
    return np.where(np.isnan(values), np.inf, values)


def nearest(
    curve: Curve, q: Values, row: Values, low: Values, high: Values, known: Values
) -> tuple[Values, Values]:
    """Return the nearest point of many stretches.

    Parameters
    ----------
    curve
        Rows of curve.
    q
        Points, shape (n_axes, n) [m].
    row, low, high
        The stretches.
    known
        Squared distance that something else has already, or inf: what is not nearer is not found.

    Returns
    -------
    tuple
        The row's parameter, and the squared distance, not below ``known`` where nothing nearer was
        found; within ``ACCURACY`` of the contour's size, as a distance.
    """
    n = len(row)
    at, best = low.copy(), np.full(n, np.inf)
    task, a, b = np.arange(n), low, high
    rough = np.zeros(n, bool)
    for _ in range(_HALVINGS):
        if not len(task):
            break
        own, points = row[task], q[:, task]
        seen = _Judged(curve, own, a, b, points)
        keep_nearer((best, at, rough), task, (seen.squared, seen.middle, np.ones(len(task), bool)))
        limit = np.minimum(best[task], known[task])
        far = seen.distance - seen.width * seen.p1 >= np.sqrt(limit)
        lowest = seen.squared - 2.0 * seen.fall
        far |= lowest >= limit
        if a is low:  # the first time: the ends of what is not too far as a whole
            some = np.flatnonzero(~far)
            for end in (low, high):
                d = curve.look(row[some], end[some], q[:, some])[0]
                keep_nearer((best, at, rough), some, (dot(d, d), end[some], rough[some] & False))
        open_ = ~(far | seen.one_way | (seen.h + seen.swing < 0.0))
        newton = open_ & (seen.h >= 4.0 * seen.swing) & (seen.h > 0.0)
        some = np.flatnonzero(newton)
        if len(some):
            ends = (np.minimum(a, b)[some], np.maximum(a, b)[some])
            x, squared = _newton(curve, own[some], points[:, some], seen.middle[some], *ends)
            # no dearer than the middle by rounding: it is the better parameter
            squared = np.minimum(squared, seen.squared[some])
            keep_nearer((best, at, rough), task[some], (squared, x, np.zeros(len(some), bool)))
            same = (squared == best[task[some]]) & rough[task[some]]
            at[task[some][same]], rough[task[some][same]] = x[same], False
        cut = open_ & ~newton & (lowest < limit - 2.0 * ACCURACY * curve.size * np.sqrt(limit))
        cut &= seen.width > 4.0 * _EPS * (np.abs(a) + np.abs(b))
        task, a, b, m = task[cut], a[cut], b[cut], seen.middle[cut]
        task, a, b = np.tile(task, 2), np.concatenate([a, m]), np.concatenate([m, b])
    _polish(curve, q, row, low, high, at, best, np.flatnonzero(rough))
    return at, best


def _newton(
    curve: Curve, row: Values, q: Values, x: Values, low: Values, high: Values
) -> tuple[Values, Values]:
    """Return zeros of g by Newton's method kept inside intervals, or the ends where none is."""
    at, best, going = x.copy(), np.full(len(x), np.inf), np.arange(len(x))
    for _ in range(_NEWTON):
        d, slope, bend = curve.look(row, x, q)
        speed2 = dot(slope, slope)
        h = speed2 + dot(d, bend)
        at[going], best[going] = x, dot(d, d)
        new = np.clip(x - dot(d, slope) / np.where(h > 0.0, h, speed2 + 1e-300), low, high)
        moved = np.abs(new - x) * np.sqrt(speed2)
        more = moved > 2.0 * _EPS * curve.size + 4.0 * _EPS * np.abs(x) * np.sqrt(speed2)
        if not more.any():
            break
        going, row, q, x = going[more], row[more], q[:, more], new[more]
        low, high = low[more], high[more]
    return at, best


def _polish(
    curve: Curve,
    q: Values,
    row: Values,
    low: Values,
    high: Values,
    at: Values,
    best: Values,
    some: Values,
) -> None:
    """Bring feet that were found by cutting alone, as at a jump of curvature, nearer to g = 0."""
    for _ in range(4):
        if not len(some):
            return
        d, slope, bend = curve.look(row[some], at[some], q[:, some])
        g, speed2 = dot(d, slope), dot(slope, slope)
        h = speed2 + dot(d, bend)
        good = h > 1e-6 * speed2
        new = np.clip(at[some] - g / np.where(good, h, 1.0), low[some], high[some])
        d, slope, _ = curve.look(row[some], new, q[:, some])
        good &= (np.abs(dot(d, slope)) < 0.5 * np.abs(g)) & (dot(d, d) <= best[some] * (1 + 1e-14))
        at[some[good]], best[some[good]] = new[good], np.minimum(dot(d, d), best[some])[good]
        some = some[good]


def first_exit(
    curve: Curve, c: Values, reach: Values, row: Values, begin: Values, end: Values
) -> tuple[Values, Values]:
    """Return up to where stretches must be looked at until they leave a ball, and if they do.

    An interval on which the distance from the centre is convex, or goes one way, meets the ball in
    one connected part: where it is left in such an interval, all that lies in the ball up to the
    interval's end lies in the stretch.

    Parameters
    ----------
    curve
        Rows of curve.
    c, reach
        Centre of each ball, shape (n_axes, n), and the square of its radius.
    row, begin, end
        The stretches, from the one to the other; they begin in the ball.
    """
    n, way = len(row), end - begin
    stop = np.full(n, np.inf)
    task, a, b = np.arange(n), np.zeros(n), np.ones(n)
    for _ in range(_HALVINGS):
        if not len(task):
            break
        own, points, first = row[task], c[:, task], begin[task]
        where = first + a * way[task], first + b * way[task]
        seen = _Judged(curve, own, *where, points)
        limit = reach[task] * (1.0 + 1e-12)
        inside = seen.squared + 2.0 * seen.fall <= limit
        simple = ~inside & (seen.one_way | (seen.h >= seen.swing))
        tiny = ~inside & ~simple & (seen.fall <= 1e-13 * limit)
        tiny |= ~inside & ~simple & (seen.width <= 4.0 * _EPS * np.abs(where).max(axis=0))
        out = tiny & (seen.squared > limit)
        some = np.flatnonzero(simple)
        if len(some):
            d = curve.look(own[some], where[1][some], points[:, some])[0]
            out[some] = dot(d, d) > limit[some]
        np.minimum.at(stop, task[out], b[out])
        # what was seen outside bounds the way out, so that nothing behind it is looked at
        behind = np.full(n, np.inf)
        beyond = np.flatnonzero(seen.squared > limit)
        np.minimum.at(behind, task[beyond], 0.5 * (a + b)[beyond])
        cut = ~(inside | simple | tiny) & (a < stop[task])
        middle = 0.5 * (a + b)
        task = np.tile(task[cut], 2)
        a, b = np.concatenate([a[cut], middle[cut]]), np.concatenate([middle[cut], b[cut]])
        ahead = (a < stop[task]) & (a <= behind[task])
        task, a, b = task[ahead], a[ahead], b[ahead]
    over = np.isfinite(stop)
    return np.where(over, begin + np.where(over, stop, 0.0) * way, end), over
