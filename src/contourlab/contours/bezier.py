"""Rational Bézier curves: points, and their parameter as a series of arc length."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Scalar

__all__ = ["bezier_rows", "chebyshev_value", "rational_point"]

SERIES = 16
"""Coefficients of u over s; a curve is cut until they suffice."""
SERIES_TOLERANCE = 1e-13
_DEEPEST = 20

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_CHEBYSHEV = np.cos(np.pi * (np.arange(SERIES) + 0.5) / SERIES)
_FIT = 2.0 / SERIES * np.cos(np.outer(np.arange(SERIES), np.arccos(_CHEBYSHEV)))
_FIT[0] *= 0.5

Rows = np.ndarray[Any, Any]


def rational_point(control: Array, u: Scalar) -> AxisVector:
    """Return the point of a rational Bézier curve by de Casteljau's algorithm.

    Parameters
    ----------
    control
        Homogeneous control points (w x, w y, ..., w), shape (degree + 1, n_axes + 1).
    u
        Parameter, 0 at the first point and 1 at the last.
    """
    points = control
    while points.shape[0] > 1:
        points = points[:-1] + u * (points[1:] - points[:-1])
    return points[0, :-1] / points[0, -1]


def chebyshev_value(coefficients: Array, x: Scalar) -> Scalar:
    """Return a Chebyshev series at one x in [-1, 1] by Clenshaw's recurrence.

    Parameters
    ----------
    coefficients
        Shape (n,).
    x
        Where.
    """
    b1 = b2 = jnp.zeros_like(x)
    for k in range(coefficients.shape[0] - 1, 0, -1):
        b1, b2 = coefficients[k] + 2.0 * x * b1 - b2, b1
    return coefficients[0] + x * b1 - b2


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
    done: list[tuple[Rows, Rows, float, int]] = []
    for owner, curve in enumerate(rows):
        stack = [(curve, 0)]
        while stack:
            row, depth = stack.pop()
            fit = _length_series(row)
            if fit is not None:
                done.append((row, *fit, owner))
                continue
            if depth == _DEEPEST:
                raise GeometryError(
                    f"Bézier curve {owner} stands still somewhere (a cusp, or no length): "
                    "split it there, or remove repeated control points"
                )
            left, right = _halves(row)
            stack += [(right, depth + 1), (left, depth + 1)]
    return (
        np.stack([d[0] for d in done]),
        np.stack([d[1] for d in done]),
        np.array([d[2] for d in done]),
        np.array([d[3] for d in done], np.int32),
    )


def _halves(row: Rows) -> tuple[Rows, Rows]:
    left, right, points = [row[0]], [row[-1]], row
    while len(points) > 1:
        points = 0.5 * (points[:-1] + points[1:])
        left.append(points[0])
        right.append(points[-1])
    return np.stack(left), np.stack(right[::-1])


def _speed(row: Rows, u: Rows) -> Rows:
    """Return |dr/du| at several u."""
    degree = len(row) - 1
    points = np.broadcast_to(row, (*u.shape, *row.shape)).copy()
    at = u[..., None, None]
    for _ in range(degree - 1):
        points = points[..., :-1, :] + at * (points[..., 1:, :] - points[..., :-1, :])
    slope = degree * (points[..., 1, :] - points[..., 0, :])
    value = points[..., 0, :] + u[..., None] * (points[..., 1, :] - points[..., 0, :])
    point = value[..., :-1] / value[..., -1:]
    return np.linalg.norm(  # type: ignore[no-any-return]
        (slope[..., :-1] - point * slope[..., -1:]) / value[..., -1:], axis=-1
    )


def _arc_length(row: Rows, u: Rows) -> Rows:
    """Return the length from 0 to each u."""
    nodes = u[:, None] * (0.5 + 0.5 * _NODES)
    return 0.5 * u * (_speed(row, nodes) @ _WEIGHTS)


def _length_series(row: Rows) -> tuple[Rows, float] | None:
    """Return Chebyshev coefficients of u over arc length and the length, None if too few."""
    speed = _speed(row, np.linspace(0.0, 1.0, 33))
    if not speed.min() > 0.2 * speed.max():
        return None
    length = float(_arc_length(row, np.array([1.0]))[0])
    middle = float(_arc_length(row, np.array([0.5]))[0])
    other = _arc_length(_halves(row)[1], np.array([1.0]))[0]
    # control points carry rounding of the size of their coordinates: a short stretch cannot do better
    rounding = 1e-15 * float(np.abs(row[:, :-1] / row[:, -1:]).max())
    if abs(middle + other - length) > 1e-13 * length + 4.0 * rounding:
        return None
    target = 0.5 * length * (1.0 + _CHEBYSHEV)
    u = target / length
    for _ in range(12):
        u = np.clip(u - (_arc_length(row, u) - target) / _speed(row, u), 0.0, 1.0)
    coefficients = _FIT @ u
    if np.abs(coefficients[-2:]).max() > SERIES_TOLERANCE + rounding / length:
        return None
    return coefficients, length
