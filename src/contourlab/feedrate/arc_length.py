"""From arc length to the parameter of a contour, and the derivatives that go with it.

A table of arc length over the parameter is made by Gauss-Legendre panels, halved until each panel
and its two halves agree; the parameter at an arc length is then found by Newton's iteration on the
quadrature itself, not on an interpolation. The result is checked.

A :class:`~contourlab.contours.path.Path` has arc length as its parameter and needs none of this.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.bezier import bezier_derivatives
from contourlab.contours.helical import helical_derivatives
from contourlab.contours.path import Path
from contourlab.errors import FeedError
from contourlab.typing import Array

__all__ = ["ArcLength", "arc_derivatives", "contour_derivatives", "parameter_derivatives"]

Values = NDArray[Any]

TOLERANCE = 1e-12
"""Largest error of an inverted arc length, in lengths of the contour."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_FIRST_PANELS = 32
_MOST_PANELS = 1 << 16
_CHUNKS = (512, 4096, 32768)


@jax.jit
def _fourth(contour: Contour, parameter: Array) -> Array:
    return jax.vmap(lambda p: contour.derivatives(p, 4))(parameter)


@jax.jit
def _helical(*rows: Array) -> Array:
    return jax.vmap(lambda s, rate, r, u, v, w: helical_derivatives(s, rate, r, u, v, w, 4))(*rows)


@jax.jit
def _bezier(*rows: Array) -> Array:
    return jax.vmap(lambda r, inverse, length, s: bezier_derivatives(r, inverse, length, s, 4))(
        *rows
    )


@jax.jit
def _first(contour: Contour, parameter: Array) -> Array:
    return jax.vmap(lambda p: contour.derivatives(p, 1)[1])(parameter)


def _in_chunks(function: Any, *columns: Values) -> Values:
    """Evaluate in blocks of few different sizes, so that little is compiled."""
    n = len(columns[0])
    size = next((size for size in _CHUNKS if n <= size), _CHUNKS[-1])
    parts = []
    for start in range(0, n, size):
        rows = [column[start : start + size] for column in columns]
        count = len(rows[0])
        padded = [
            np.pad(row, ((0, size - count), *((0, 0),) * (row.ndim - 1)), mode="edge")
            for row in rows
        ]
        parts.append(np.asarray(function(*padded))[:count])
    return np.concatenate(parts)


def contour_derivatives(contour: Contour, parameter: Values, piece: Values | None = None) -> Values:
    """Return the point and its first four derivatives over the parameter, shape (n, 5, n_axes).

    Parameters
    ----------
    contour
        Any contour.
    parameter
        Where, shape (n,).
    piece
        Piece of a path for each, so that its end is taken from its own side.
    """
    parameter = np.asarray(parameter, float)
    if isinstance(contour, Path):
        return _along_path(contour, parameter, piece)
    return _in_chunks(partial(_fourth, contour), parameter)


def _along_path(path: Path, parameter: Values, piece: Values | None) -> Values:
    """Evaluate rows that are gathered first: then no compiled function knows how many there are."""
    breaks = np.asarray(path.breaks, float)
    if piece is None:
        if path.closed:
            parameter = breaks[0] + np.mod(parameter - breaks[0], breaks[-1] - breaks[0])
        piece = np.searchsorted(breaks[1:-1], parameter, side="right")
    k = np.asarray(piece, np.int64)
    s = parameter - breaks[k]
    out = np.empty((len(k), 5, path.n_axes))
    row = np.asarray(path.bezier_row)[k]
    at = np.flatnonzero(row < 0)
    if len(at):
        columns = (path.angle_rate, path.origin, path.tangent_vector, path.normal_vector,
                   path.axial_vector)  # fmt: skip
        out[at] = _in_chunks(_helical, s[at], *(np.asarray(x, float)[k[at]] for x in columns))
    at = np.flatnonzero(row >= 0)
    if len(at):
        own = row[at]
        out[at] = _in_chunks(
            _bezier, np.asarray(path.control_points, float)[own],
            np.asarray(path.inverse_length, float)[own], (breaks[k + 1] - breaks[k])[at], s[at],
        )  # fmt: skip
    return out


def parameter_derivatives(d: Values) -> Values:
    """Return the first four derivatives of the parameter over arc length, shape (n, 4).

    With the speed σ = |r'| and primes for derivatives over the parameter: dp/ds = 1/σ, and each
    further one is d/ds = (1/σ) d/dp of the one before.

    Parameters
    ----------
    d
        The contour's derivatives over its parameter, shape (n, 5, n_axes).
    """
    first, second, third, fourth = (d[:, k] for k in range(1, 5))
    speed = np.linalg.norm(first, axis=1)
    speed1 = np.sum(first * second, axis=1) / speed
    speed2 = (np.sum(second * second + first * third, axis=1) - speed1**2) / speed
    speed3 = (np.sum(3.0 * second * third + first * fourth, axis=1) - 3.0 * speed1 * speed2) / speed
    return np.stack(
        [
            1.0 / speed,
            -speed1 / speed**3,
            -speed2 / speed**4 + 3.0 * speed1**2 / speed**5,
            -speed3 / speed**5 + 10.0 * speed1 * speed2 / speed**6 - 15.0 * speed1**3 / speed**7,
        ],
        axis=1,
    )


def arc_derivatives(d: Values) -> Values:
    """Return the first four derivatives of the point over arc length, shape (n, 4, n_axes).

    Parameters
    ----------
    d
        The contour's derivatives over its parameter, shape (n, 5, n_axes).
    """
    p1, p2, p3, p4 = (column[:, None] for column in parameter_derivatives(d).T)
    d1, d2, d3, d4 = (d[:, k] for k in range(1, 5))
    return np.stack(
        [
            d1 * p1,
            d2 * p1**2 + d1 * p2,
            d3 * p1**3 + 3.0 * d2 * p1 * p2 + d1 * p3,
            d4 * p1**4 + 6.0 * d3 * p1**2 * p2 + d2 * (3.0 * p2**2 + 4.0 * p1 * p3) + d1 * p4,
        ],
        axis=1,
    )


class ArcLength:
    """Arc length of a whole contour, from the start of its domain, and back.

    Parameters
    ----------
    contour
        Any contour.

    Raises
    ------
    FeedError
        A contour without length, or one that stands still somewhere (a cusp).
    """

    def __init__(self, contour: Contour) -> None:
        self.contour = contour
        start, end = (float(np.asarray(x)) for x in contour.domain)
        self.start, self.end = start, end
        self._same = isinstance(contour, Path)
        if self._same:
            self.parameter = np.array([start, end])
            self.arc = np.array([0.0, end - start])
        else:
            self._tabulate()
        self.length = float(self.arc[-1])
        if not (np.isfinite(self.length) and self.length > 0):
            raise FeedError(f"the contour's length must be > 0 m and finite, got {self.length:g}")

    def _speed(self, parameter: Values) -> Values:
        flat = _in_chunks(partial(_first, self.contour), parameter.reshape(-1))
        speed: Values = np.linalg.norm(flat, axis=1).reshape(parameter.shape)
        return speed

    def _between(self, a: Values, b: Values) -> Values:
        half = 0.5 * (b - a)
        nodes = 0.5 * (a + b)[:, None] + half[:, None] * _NODES
        return np.asarray(half * (self._speed(nodes) @ _WEIGHTS))

    def _tabulate(self) -> None:
        edges = np.linspace(self.start, self.end, _FIRST_PANELS + 1)
        while True:
            a, b = edges[:-1], edges[1:]
            middle = 0.5 * (a + b)
            whole = self._between(a, b)
            halves = self._between(a, middle) + self._between(middle, b)
            total = float(np.sum(halves))
            if not np.isfinite(total):
                raise FeedError("the contour's arc length is not finite: it has no feed")
            wrong = np.abs(whole - halves) > 1e-14 * total
            if not wrong.any():
                break
            if 2 * len(a) > _MOST_PANELS or np.min(np.diff(edges)) < 1e-9 * (self.end - self.start):
                at = float(middle[int(np.argmax(np.abs(whole - halves)))])
                raise FeedError(
                    f"the contour stands still or turns abruptly near parameter {at:g}: "
                    "split it there, or make a path of it"
                )
            edges = np.sort(np.concatenate([edges, middle[wrong]]))
        self.parameter = edges
        self.arc = np.concatenate([[0.0], np.cumsum(halves)])
        slowest = float(np.min(self._speed(edges)))
        if not slowest > 1e-9 * total / (self.end - self.start):
            raise FeedError("the contour stands still somewhere (a cusp): a feed cannot be held")

    def parameter_at(self, arc: Values) -> Values:
        """Return the parameter at each arc length; closed contours go round.

        Parameters
        ----------
        arc
            Arc lengths from the start, shape (n,) [m]; within the length on an open contour.

        Raises
        ------
        FeedError
            The inversion misses by more than 1e-12 of the length.
        """
        arc = np.asarray(arc, float)
        if self._same:
            return self.start + arc
        turns = np.floor(arc / self.length) if self.contour.closed else np.zeros_like(arc)
        inside = np.clip(arc - turns * self.length, 0.0, self.length)
        k = np.clip(np.searchsorted(self.arc, inside, side="right") - 1, 0, len(self.arc) - 2)
        low, high = self.parameter[k], self.parameter[k + 1]
        wanted = inside - self.arc[k]
        p = low + (high - low) * wanted / (self.arc[k + 1] - self.arc[k])
        for _ in range(20):
            missed = self._between(low, p) - wanted
            step = missed / self._speed(p)
            p = np.clip(p - step, low, high)
            if np.max(np.abs(missed)) <= 1e-15 * self.length:
                break
        missed = self._between(low, p) - wanted
        worst = float(np.max(np.abs(missed))) if len(missed) else 0.0
        if not worst <= TOLERANCE * self.length:
            raise FeedError(
                f"arc length could not be inverted: off by {worst:.3g} m of {self.length:.6g} m"
            )
        result: Values = p + turns * (self.end - self.start)
        return result

    def time_derivatives(
        self, arc: Values, speed: Values, acceleration: Values, jerk: Values
    ) -> tuple[Values, Values, Values, Values]:
        """Return the parameter and its three time derivatives of a motion in arc length.

        Parameters
        ----------
        arc, speed, acceleration, jerk
            The motion along the contour, shape (n,) each [m, m/s, m/s², m/s³].
        """
        parameter = self.parameter_at(arc)
        if self._same:
            return parameter, speed, acceleration, jerk
        p1, p2, p3, _ = parameter_derivatives(contour_derivatives(self.contour, parameter)).T
        return (
            parameter,
            p1 * speed,
            p2 * speed**2 + p1 * acceleration,
            p3 * speed**3 + 3.0 * p2 * speed * acceleration + p1 * jerk,
        )
