"""Rational Bézier curves cut, on the host, until their parameter is a short series of arc length.

The speed |dr/du| of a stretch is interpolated at Chebyshev nodes; its integral is the arc length
s(u), and u(s) is found at Chebyshev nodes of s by Newton's method. A stretch is kept when both
series have died out, else it is halved. All curves are worked on at once.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from contourlab.errors import GeometryError

__all__ = ["SERIES", "bezier_rows", "elevated", "end_derivatives"]

SERIES = 16
"""Coefficients of u over s; a curve is cut until they suffice."""

SERIES_TOLERANCE = 1e-13
"""What the last coefficients of a series may be, as a fraction of the whole."""

_SPEED_NODES = 25
_DEEPEST = 24
_CROWDED = (10, 600)
"""At this many halvings no more stretches of one curve than this may still be too long: round a
cusp there are two, and without a bound a curve at the edge of rounding would double for ever."""

_AT_ONCE = 512
"""Curves worked on together; bounds the memory."""

Rows = NDArray[Any]


def _interpolation(count: int) -> tuple[Rows, Rows]:
    """Return Chebyshev nodes in (-1, 1) and the matrix from values there to coefficients."""
    angles = np.pi * (np.arange(count) + 0.5) / count
    matrix = 2.0 / count * np.cos(np.outer(np.arange(count), angles))
    matrix[0] *= 0.5
    return np.cos(angles), matrix


_NODES, _FIT = _interpolation(SERIES)
_SPEED_AT, _SPEED_FIT = _interpolation(_SPEED_NODES)
_INTEGRAL = np.stack(
    [chebyshev.chebint(row, lbnd=-1) for row in np.eye(_SPEED_NODES)], axis=1
)  # from the coefficients of a function on [-1, 1] to those of its integral from -1
_AT_PLACES = chebyshev.chebvander(np.linspace(-1.0, 1.0, 9), _SPEED_NODES - 1).T


def bezier_rows(rows: Rows) -> tuple[Rows, Rows, Rows, Rows]:
    """Cut rational Bézier curves until u is a short Chebyshev series of arc length.

    Parameters
    ----------
    rows
        Homogeneous control points, shape (n_curves, degree + 1, n_axes + 1).

    Returns
    -------
    rows, inverse, length, owner
        The stretches in order: control points, Chebyshev coefficients of u over 2 s/length - 1,
        lengths [m], and the curve each came from.

    Raises
    ------
    GeometryError
        A curve of no length, or one whose speed vanishes (a cusp).
    """
    kept: list[tuple[Rows, Rows, Rows, Rows, Rows]] = []
    owner, start = np.arange(len(rows)), np.zeros(len(rows))
    points = rows[..., :-1] / rows[..., -1:]
    extent = np.max(np.abs(points - points[:, :1]), axis=(1, 2))
    still = extent <= 4e-16 * np.max(np.abs(points), axis=(1, 2))
    if still.any():
        raise GeometryError(f"Bézier curve {int(np.argmax(still))} has no length")
    for depth in range(_DEEPEST + 1):
        fits = [_length_series(rows[i : i + _AT_ONCE]) for i in range(0, len(rows), _AT_ONCE)]
        inverse, length, good = (np.concatenate(part) for part in zip(*fits, strict=True))
        kept.append((rows[good], inverse[good], length[good], owner[good], start[good]))
        rows, owner, start = rows[~good], owner[~good], start[~good]
        if len(rows) == 0:
            break
        if depth >= _CROWDED[0] and np.bincount(owner).max() > _CROWDED[1]:
            raise GeometryError(
                f"Bézier curve {int(np.argmax(np.bincount(owner)))} cannot be cut into smooth "
                "stretches: it is too small beside its coordinates, or too winding"
            )
        left, right = _halves(rows)
        rows = np.concatenate([left, right])
        start = np.concatenate([start, start + 0.5 ** (depth + 1)])
        owner = np.concatenate([owner, owner])
    else:
        raise GeometryError(
            f"Bézier curve {owner.min()} stands still somewhere (a cusp): "
            "split it there, or remove repeated control points"
        )
    rows, inverse, length, owner, start = (np.concatenate(part) for part in zip(*kept, strict=True))
    order = np.lexsort((start, owner))
    return rows[order], inverse[order], length[order], owner[order].astype(np.int32)


def elevated(rows: Rows, count: int) -> Rows:
    """Return Bézier rows raised to more control points each; the curves are unchanged.

    Parameters
    ----------
    rows
        Homogeneous control points, shape (n_curves, degree + 1, n_axes + 1).
    count
        Control points wanted for each curve.
    """
    while rows.shape[1] < count:
        n = rows.shape[1]
        fraction = (np.arange(1, n) / n)[None, :, None]
        inner = fraction * rows[:, :-1] + (1 - fraction) * rows[:, 1:]
        rows = np.concatenate([rows[:, :1], inner, rows[:, -1:]], axis=1)
    return rows


def end_derivatives(rows: Rows, *, at_end: bool) -> tuple[Rows, Rows, Rows]:
    """Return the first or last point of each curve, its unit tangent and its curvature vector.

    Parameters
    ----------
    rows
        Homogeneous control points, shape (n_curves, degree + 1, n_axes + 1).
    at_end
        Whether the last point is meant.

    Returns
    -------
    point, tangent, curvature
        Each of shape (n_curves, n_axes): [m], none, [1/m].
    """
    if at_end:
        rows = rows[:, ::-1]
    rows = elevated(rows, 3)
    degree = rows.shape[1] - 1
    first = degree * (rows[:, 1] - rows[:, 0])
    second = degree * (degree - 1) * (rows[:, 2] - 2.0 * rows[:, 1] + rows[:, 0])
    weight = rows[:, 0, -1:]
    point = rows[:, 0, :-1] / weight
    slope = (first[:, :-1] - first[:, -1:] * point) / weight
    bend = (second[:, :-1] - second[:, -1:] * point - 2.0 * first[:, -1:] * slope) / weight
    speed = np.linalg.norm(slope, axis=1, keepdims=True)
    tangent = slope / speed
    curvature = (bend - tangent * np.sum(bend * tangent, axis=1, keepdims=True)) / speed**2
    return point, -tangent if at_end else tangent, curvature


def _halves(rows: Rows) -> tuple[Rows, Rows]:
    left, right, points = [rows[:, 0]], [rows[:, -1]], rows
    while points.shape[1] > 1:
        points = 0.5 * (points[:, :-1] + points[:, 1:])
        left.append(points[:, 0])
        right.append(points[:, -1])
    return np.stack(left, axis=1), np.stack(right[::-1], axis=1)


def _speed(rows: Rows, u: Rows) -> Rows:
    """Return |dr/du| of every curve at several u, shape (n_curves, n_u)."""
    degree = rows.shape[1] - 1
    # about its first point: what is left carries no rounding of the size of the coordinates
    origin = rows[:, :1, :-1] / rows[:, :1, -1:]
    local = np.concatenate([rows[..., :-1] - origin * rows[..., -1:], rows[..., -1:]], axis=2)
    at = u[None, :, None]
    points = [local[:, i : i + 1] for i in range(degree + 1)]
    while len(points) > 2:
        points = [a + at * (b - a) for a, b in pairwise(points)]
    slope = degree * (points[1] - points[0])
    value = points[0] + at * (points[1] - points[0])
    point = value[..., :-1] / value[..., -1:]
    return np.linalg.norm(  # type: ignore[no-any-return]
        (slope[..., :-1] - point * slope[..., -1:]) / value[..., -1:], axis=-1
    )


def _clenshaw(coefficients: Rows, x: Rows) -> Rows:
    """Return several series, shape (n, n_coefficients), each at its own points, shape (n, m)."""
    first = second = np.zeros_like(x)
    for k in range(coefficients.shape[1] - 1, 0, -1):
        first, second = coefficients[:, k : k + 1] + 2.0 * x * first - second, first
    return coefficients[:, :1] + x * first - second  # type: ignore[no-any-return]


def _length_series(rows: Rows) -> tuple[Rows, Rows, Rows]:
    """Return the series of u over arc length, the length, and whether the series suffice."""
    speed = 0.5 * _speed(rows, 0.5 + 0.5 * _SPEED_AT) @ _SPEED_FIT.T  # over x = 2 u - 1
    travelled = speed @ _INTEGRAL.T
    length = np.sum(travelled, axis=1)
    # control points carry rounding of the size of their coordinates: no stretch does better
    coordinates = np.max(np.abs(rows[..., :-1] / rows[..., -1:]), axis=(1, 2))
    tolerance = SERIES_TOLERANCE + 1e-15 * coordinates / np.maximum(length, 1e-300)
    slowest = np.min(speed @ _AT_PLACES, axis=1)
    good = slowest > 1e-3 * length
    good &= np.max(np.abs(speed[:, -3:]), axis=1) < tolerance * length
    inverse = np.zeros((len(rows), SERIES))
    inverse[good], close = _inverse(speed[good], travelled[good], length[good], tolerance[good])
    good[good] = close
    return inverse, length, good


def _inverse(speed: Rows, travelled: Rows, length: Rows, tolerance: Rows) -> tuple[Rows, Rows]:
    """Return the series of u over arc length and whether it has died out, by Newton's method."""
    target = 0.5 * length[:, None] * (1.0 + _NODES)
    x = np.broadcast_to(_NODES, target.shape)
    step = np.zeros_like(target)
    for _ in range(8):
        step = (_clenshaw(travelled, x) - target) / _clenshaw(speed, x)
        x = np.clip(x - step, -1.0, 1.0)
        if not np.any(np.abs(step) > 1e-9):  # the next step would be its square
            break
    inverse = (0.5 + 0.5 * x) @ _FIT.T
    close = np.max(np.abs(inverse[:, -2:]), axis=1) < tolerance
    return inverse, close & (np.max(np.abs(step), axis=1) < 1e-8)
