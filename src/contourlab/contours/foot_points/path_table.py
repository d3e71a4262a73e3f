"""The pieces of a path as columns of numbers, worked out for many points at a time.

A *row* is a piece. Its own parameter starts at 0: arc length on lines, arcs and helices, u in
[0, 1] on Bézier pieces. Arrays of points have their axes first, shape (n_axes, n), so that every
coordinate lies together.
"""

from __future__ import annotations

from math import comb, factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.foot_points.certified import Curve, dot, nearest
from contourlab.contours.path import Path

__all__ = [
    "ARC",
    "BEZIER",
    "HELIX",
    "LINE",
    "BezierTable",
    "PathTable",
    "clenshaw",
    "derivative_bounds",
]

LINE, ARC, HELIX, BEZIER = range(4)

Values = NDArray[Any]


def clenshaw(coefficients: Values, x: Values) -> Values:
    """Return Chebyshev series, shape (n_coefficients, n), each at its own point, shape (n,).

    Parameters
    ----------
    coefficients, x
        Series, and places in [-1, 1].
    """
    first, second, twice = np.zeros_like(x), np.zeros_like(x), 2.0 * x
    for row in coefficients[:0:-1]:
        first, second = row + twice * first - second, first
    result: Values = coefficients[0] + x * first - second
    return result


class BezierTable:
    """Rational Bézier rows about the middle of their parameter and their first point.

    Coefficients are of powers of u - 1/2: a row is short enough that they die out.
    """

    def __init__(self, path: Path) -> None:
        control = np.asarray(path.control_points, float)
        weight = control[..., -1:]
        first = control[:, :1, :-1] / weight[:, :1]
        local = np.concatenate([control[..., :-1] - weight * first, weight], axis=2)
        self.degree = control.shape[1] - 1
        self.rational = bool(np.any(weight != weight[:, :1]))
        if not self.rational:
            local = local / weight[:, :1]
        # about the middle: (degree + 1, n_axes + 1, n_rows)
        self.powers = np.ascontiguousarray(
            np.einsum("kj,njc->kcn", _middle_powers(self.degree), local)
        )
        if not self.rational:
            self.powers = np.ascontiguousarray(self.powers[:, :-1])
        self.inverse = np.ascontiguousarray(np.asarray(path.inverse_length, float).T)
        self.rates = derivative_bounds(control)
        self.curvature = self._curvature()
        self.forward = self._forward()

    def look(self, powers: Values, u: Values, order: int = 2) -> list[Values]:
        """Return points from the row's first one, and derivatives, each of shape (n_axes, n).

        Parameters
        ----------
        powers
            Of the rows, as :attr:`powers`.
        u
            Places.
        order
            0, 1 or 2.
        """
        x = u - 0.5
        series = [np.array(powers[-1])]  # of order k: k-th derivative over k!
        series += [np.zeros_like(series[0]) for _ in range(order)]
        for row in powers[-2::-1]:
            for k in range(order, 0, -1):
                series[k] *= x
                series[k] += series[k - 1]
            series[0] *= x
            series[0] += row
        if order == 2:
            series[2] *= 2.0
        if not self.rational:
            return series
        inverse = 1.0 / series[0][-1]
        curve = [series[0][:-1] * inverse]
        if order >= 1:
            curve.append((series[1][:-1] - curve[0] * series[1][-1]) * inverse)
        if order >= 2:
            bend = series[2][:-1] - 2.0 * curve[1] * series[1][-1] - curve[0] * series[2][-1]
            curve.append(bend * inverse)
        return curve

    def length_to(self, at: Values, length: Values, u: Values, speed: Values) -> Values:
        """Return arc length from the start of rows to u, in one with the path's own series.

        Parameters
        ----------
        at
            Row of the tables.
        length
            Of the rows [m].
        u, speed
            Places, and |dr/du| there.
        """
        s = clenshaw(self.forward[:, at], 2.0 * u - 1.0)
        off = clenshaw(self.inverse[:, at], 2.0 * s / length - 1.0) - u
        result: Values = np.clip(s - off * speed, 0.0, length)
        return result

    def _curvature(self) -> Values:
        """Return a bound of the curvature of every row, from the middles of its parts."""
        bound, w = np.zeros(self.powers.shape[2]), 0.5 / _PARTS
        third = self.rates[2]
        for k in range(_PARTS):
            u = np.full(len(bound), (k + 0.5) / _PARTS)
            _, slope, bend = self.look(self.powers, u)
            speed2, bend2 = dot(slope, slope), dot(bend, bend)
            speed = np.sqrt(speed2)
            # |r' x r''| changes by |r' x r'''| at most
            across = np.sqrt(np.maximum(speed2 * bend2 - dot(slope, bend) ** 2, 0.0))
            across = across + 1e-7 * speed * np.sqrt(bend2)
            most = np.sqrt(bend2) + w * third
            slowest = speed - w * most
            with np.errstate(divide="ignore"):
                here = (across + w * (speed + w * most) * third) / slowest**3
            bound = np.maximum(bound, np.where(slowest > 0.0, here, np.inf))
        return bound

    def _forward(self) -> Values:
        """Return short series of arc length over 2 u - 1: a Newton step makes them exact."""
        slopes = [self.look(self.powers, np.full(self.powers.shape[2], u), 1)[1] for u in _PLACES]
        speed = np.stack([np.sqrt(dot(slope, slope)) for slope in slopes])
        return np.ascontiguousarray(_LENGTH_FIT @ speed)


_PARTS = 16
_COUNT = 12
_ANGLES = np.pi * (np.arange(_COUNT) + 0.5) / _COUNT
_PLACES = 0.5 + 0.5 * np.cos(_ANGLES)
_FIT = 2.0 / _COUNT * np.cos(np.outer(np.arange(_COUNT), _ANGLES))
_FIT[0] *= 0.5
_INTEGRAL = np.stack(
    [np.polynomial.chebyshev.chebint(row, lbnd=-1) for row in np.eye(_COUNT)], axis=1
)
_LENGTH_FIT = 0.5 * _INTEGRAL @ _FIT


def _middle_powers(degree: int) -> Values:
    """Return the matrix from Bernstein coefficients to those of powers of u - 1/2."""
    matrix = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        # u^j (1 - u)^(n - j) with u = 1/2 + x
        polynomial = np.ones(1)
        for _ in range(j):
            polynomial = np.convolve(polynomial, [0.5, 1.0])
        for _ in range(degree - j):
            polynomial = np.convolve(polynomial, [0.5, -1.0])
        matrix[:, j] = comb(degree, j) * polynomial
    return matrix


def derivative_bounds(control: Any, xp: Any = np) -> Any:
    """Return bounds of |r'|, |r''|, |r'''| of whole rows by their control points, shape (3, n).

    A polynomial lies in the hull of its control points; with r = N / W the k-th derivative is
    N_k less the sum of binomial(k, j) W_j r_(k-j), over W.

    Parameters
    ----------
    control
        Homogeneous control points, shape (n, degree + 1, n_axes + 1).
    xp
        ``numpy``, or ``jax.numpy`` if they are traced.
    """
    degree, weight = control.shape[1] - 1, control[..., -1:]
    # about their first point, so that bounds do not depend on where the row lies
    points = control[..., :-1] - weight * (control[:, :1, :-1] / weight[:, :1])
    lightest = xp.min(weight, axis=(1, 2))
    sizes = [xp.max(xp.linalg.norm(points, axis=2), axis=1) / lightest]
    weights: list[Any] = []
    for k in range(1, 4):
        total = 0.0 * sizes[0]
        weights.append(total)
        if k <= degree:
            factor = factorial(degree) / factorial(degree - k)
            points, weight = xp.diff(points, axis=1), xp.diff(weight, axis=1)
            total = factor * xp.max(xp.linalg.norm(points, axis=2), axis=1)
            weights[-1] = factor * xp.max(xp.abs(weight), axis=(1, 2))
        for j in range(1, k + 1):
            total = total + comb(k, j) * weights[j - 1] * sizes[k - j]
        sizes.append(total / lightest)
    return xp.stack(sizes[1:])


class PathTable(Curve):
    """A path's rows, in columns."""

    def __init__(self, path: Path) -> None:
        self.n_axes = path.n_axes
        self.closed = path.closed
        self.breaks = np.asarray(path.breaks, float)
        self.length = np.diff(self.breaks)
        self.total = float(self.breaks[-1] - self.breaks[0])
        self.n_rows = len(self.length)
        columns = (path.origin, path.tangent_vector, path.normal_vector, path.axial_vector)
        self.origin, self.u, self.v, self.w = (
            np.ascontiguousarray(np.asarray(column, float).T) for column in columns
        )
        self.rate = np.asarray(path.angle_rate, float)
        turning, rising = self.rate != 0.0, np.any(self.w != 0.0, axis=0)
        self.bezier_row = np.asarray(path.bezier_row)
        kind = np.where(turning, np.where(rising, HELIX, ARC), LINE)
        self.kind = np.where(self.bezier_row >= 0, BEZIER, kind).astype(np.int8)
        self.kinds = tuple(int(k) for k in np.unique(self.kind))
        self.tangent = self.u + np.where(turning, 0.0, self.w)
        self.extent = np.where(self.kind == BEZIER, 1.0, self.length)
        self.bezier = BezierTable(path) if BEZIER in self.kinds else None
        low, high = self.origin.min(axis=1), self.origin.max(axis=1)
        self.size = float(np.linalg.norm(high - low) + self.length.max())
        largest = float(max(np.abs(low).max(), np.abs(high).max()))
        self.rounding = 4.0 * float(np.finfo(float).eps) * (largest + self.size)

    def groups(self, row: Values) -> list[tuple[int, Any]]:
        """Return which lanes are of which kind.

        Parameters
        ----------
        row
            The row of every lane.
        """
        if len(self.kinds) == 1:
            return [(self.kinds[0], slice(None))]
        kind = self.kind[row]
        lanes = [(k, np.flatnonzero(kind == k)) for k in self.kinds]
        return [(k, some) for k, some in lanes if len(some)]

    def look(
        self, row: Values, t: Values, q: Values, order: int = 2
    ) -> tuple[Values, Values, Values]:
        """Return r - q, r' and r'' at many places, each of shape (n_axes, n).

        Parameters
        ----------
        row, t, q
            Places and points.
        order
            What is beyond it is not worked out, and 0.
        """
        out = np.zeros((3, len(q), len(row)))
        for kind, some in self.groups(row):
            for k, values in enumerate(self.look_kind(kind, row[some], t[some], q[:, some], order)):
                out[k][:, some] = values
        return out[0], out[1], out[2]

    def look_kind(self, kind: int, row: Values, t: Values, q: Values, order: int) -> list[Values]:
        """Return the same of rows of one kind, up to the order.

        Parameters
        ----------
        kind
            Of all rows.
        row, t, q, order
            As in :meth:`look`.
        """
        away = self.origin[:, row] - q
        if kind == LINE:
            tangent = self.tangent[:, row]
            return [away + tangent * t, tangent, np.zeros_like(tangent)][: order + 1]
        if kind == BEZIER:
            assert self.bezier is not None
            curve = self.bezier.look(self.bezier.powers[:, :, self.bezier_row[row]], t, order)
            curve[0] += away
            return curve
        u, v, rate = self.u[:, row], self.v[:, row], self.rate[row]
        half = 0.5 * rate * t
        sine, cosine = np.sin(half), np.cos(half)
        small = np.abs(half) < 1e-2
        h2 = half * half
        series = 1.0 - h2 / 6.0 * (1.0 - h2 / 20.0 * (1.0 - h2 / 42.0))
        chord = t * np.where(small, series, sine / np.where(small, 1.0, half))
        place = away + u * (chord * cosine) + v * (chord * sine)
        whole_cosine, whole_sine = 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine
        slope = u * whole_cosine + v * whole_sine
        if kind == HELIX:
            w = self.w[:, row]
            place += w * t
            slope = slope + w
        if order < 2:
            return [place, slope][: order + 1]
        return [place, slope, rate * (v * whole_cosine - u * whole_sine)]

    def rates(self, row: Values, low: Values, high: Values) -> tuple[Values, Values, Values]:
        """Return bounds of |r'|, |r''| and |r'''| of many stretches.

        Parameters
        ----------
        row, low, high
            The stretches; the bounds are of the whole rows.
        """
        del low, high
        rate = np.abs(self.rate[row])
        bounds = [np.ones(len(row)), rate, rate * rate]
        if self.bezier is not None:
            own = self.bezier_row[row]
            some = np.flatnonzero(own >= 0)
            for bound, of_rows in zip(bounds, self.bezier.rates, strict=True):
                bound[some] = of_rows[own[some]]
        return bounds[0], bounds[1], bounds[2]

    def place(self, parameter: Values) -> tuple[Values, Values, Values]:
        """Return row, the row's own parameter, and lap of parameters of the path.

        Parameters
        ----------
        parameter
            Clipped on an open path, wrapped on a closed one; NaN where not finite.
        """
        start = self.breaks[0]
        finite = np.isfinite(parameter)
        given = np.where(finite, parameter, start)
        if self.closed:
            lap = np.floor((given - start) / self.total)
            inside = given - lap * self.total
            inside = np.clip(inside, start, self.breaks[-1])
        else:
            lap, inside = np.zeros(len(given)), np.clip(given, start, self.breaks[-1])
        row = np.searchsorted(self.breaks[1:-1], inside, side="right")
        s = np.clip(inside - self.breaks[row], 0.0, self.length[row])
        if self.bezier is not None:
            some = np.flatnonzero(self.kind[row] == BEZIER)
            at = row[some]
            x = 2.0 * s[some] / self.length[at] - 1.0
            s[some] = np.clip(clenshaw(self.bezier.inverse[:, self.bezier_row[at]], x), 0.0, 1.0)
        return row, np.where(finite, s, np.nan), lap

    def parameter(self, row: Values, s: Values, lap: Values, slope: Values) -> Values:
        """Return the path's parameter of places.

        Parameters
        ----------
        row, s, lap
            Places.
        slope
            r' there, shape (n_axes, n).
        """
        if self.bezier is not None:
            some = np.flatnonzero(self.kind[row] == BEZIER)
            at, speed = row[some], np.sqrt(dot(slope[:, some], slope[:, some]))
            s = s.copy()
            s[some] = self.bezier.length_to(self.bezier_row[at], self.length[at], s[some], speed)
        result: Values = self.breaks[row] + s + lap * self.total
        return result

    def right_side(self, row: Values, s: Values, lap: Values) -> tuple[Values, Values, Values]:
        """Return the start of the next row for places that are the end of theirs.

        Parameters
        ----------
        row, s, lap
            Places.
        """
        last = row + 1 >= self.n_rows
        over = (s >= self.extent[row]) & (self.closed | ~last)
        new = np.where(over, np.where(last, 0, row + 1), row)
        return new, np.where(over, 0.0, s), lap + (over & last)

    def nearest(
        self, q: Values, row: Values, low: Values, high: Values, known: Values
    ) -> tuple[Values, Values]:
        """Return the nearest places of stretches, and their squared distances.

        Parameters
        ----------
        q, row, low, high, known
            As in :func:`~contourlab.contours.foot_points.certified.nearest`.
        """
        s, squared = low.copy(), np.full(len(row), np.inf)
        for kind, some in self.groups(row):
            at, points, a, b = row[some], q[:, some], low[some], high[some]
            if kind == LINE:
                tangent = self.tangent[:, at]
                away = points - self.origin[:, at]
                place = np.clip(dot(away, tangent), a, b)
                away -= tangent * place
                s[some], squared[some] = place, dot(away, away)
            elif kind == ARC:
                place = self.arc_foot(at, points, a, b)
                d = self.look_kind(ARC, at, place, points, 0)[0]
                s[some], squared[some] = place, dot(d, d)
            else:
                s[some], squared[some] = nearest(self, points, at, a, b, known[some])
        return s, squared

    def in_arc_plane(self, row: Values, q: Values) -> tuple[Values, Values, Values]:
        """Return κx and 1 - κy of points, and their squared height over the plane of an arc.

        With x, y the components of q - origin along first tangent and normal; the foot on the whole
        circle lies at the angle atan2(κx, 1 - κy), the circle's radius being 1/κ.

        Parameters
        ----------
        row, q
            Planar arcs, and points of shape (n_axes, n).
        """
        rate, d = self.rate[row], q - self.origin[:, row]
        x, y = dot(d, self.u[:, row]), dot(d, self.v[:, row])
        across = np.maximum(dot(d, d) - x * x - y * y, 0.0)
        return rate * x, 1.0 - rate * y, across

    def arc_foot(self, row: Values, q: Values, low: Values, high: Values) -> Values:
        """Return the arc length nearest to points in ranges of planar arcs.

        Parameters
        ----------
        row, q, low, high
            As in :meth:`nearest`; a range longer than a turn has one of the nearest points.
        """
        x, y, _ = self.in_arc_plane(row, q)
        rate = self.rate[row]
        s, turn = np.arctan2(x, y) / rate, 2.0 * np.pi / np.abs(rate)
        turns = np.round((0.5 * (low + high) - s) / turn)
        result: Values = np.clip(s + turns * turn, low, high)
        return result

    def joint(self, row: Values, ahead: Any) -> Values:
        """Return the point where rows end, or begin.

        Parameters
        ----------
        row
            Of a closed path, or not the last of an open one.
        ahead
            Whether the end is meant; else the start.
        """
        result: Values = self.origin[:, np.where(ahead, (row + 1) % self.n_rows, row)]
        return result
