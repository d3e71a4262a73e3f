"""Rational Bézier curves over their own arc length.

The curve is exact; its parameter u is a Chebyshev series of arc length s, and every derivative over
s follows in closed form from those over u: with the operator D = (1/|dr/du|) d/du, the k-th
derivative is D^k r, worked on the Taylor series of r at u.
"""

from __future__ import annotations

from itertools import pairwise
from math import comb
from typing import Any

import jax
import jax.numpy as jnp

from contourlab.typing import Array, AxisVector, Derivatives, Scalar

__all__ = [
    "bezier_derivatives",
    "bezier_parameter",
    "chebyshev_value",
    "rational_point",
    "rational_taylor",
]


Series = list[Any]
"""Taylor coefficients of a scalar function: traced scalars, so that XLA fuses what is done."""


def rational_point(control: Array, u: Scalar) -> AxisVector:
    """Return the point of a rational Bézier curve by de Casteljau's algorithm.

    Parameters
    ----------
    control
        Homogeneous control points (w x, w y, ..., w), shape (degree + 1, n_axes + 1).
    u
        Parameter, 0 at the first point and 1 at the last.
    """
    return jnp.stack([series[0] for series in rational_taylor(control, u, 0)])


def rational_taylor(control: Array, u: Scalar, order: int) -> list[Series]:
    """Return the Taylor coefficients of a rational Bézier curve at u, d^k r/du^k / k!.

    Parameters
    ----------
    control
        Homogeneous control points (w x, w y, ..., w), shape (degree + 1, n_axes + 1).
    u
        Parameter, 0 at the first point and 1 at the last.
    order
        Of the last coefficient, >= 0.

    Returns
    -------
    list
        For every axis, its order + 1 coefficients.
    """
    # scalar by scalar: in vectors of a few elements XLA spends its time between the operations
    count, width = control.shape
    *coordinates, weight = [
        _polynomial_taylor([control[i, axis] for i in range(count)], u, order)
        for axis in range(width)
    ]
    inverse = 1.0 / weight[0]
    curve = []
    for numerator in coordinates:
        series: Series = []
        for k in range(order + 1):
            rest = numerator[k]
            for j in range(1, k + 1):
                rest = rest - weight[j] * series[k - j]
            series.append(rest * inverse)
        curve.append(series)
    return curve


def _polynomial_taylor(points: Series, u: Scalar, order: int) -> Series:
    degree = len(points) - 1
    series: Series = [jnp.zeros_like(points[0])] * (order + 1)
    for k in range(degree, -1, -1):
        if k <= order:  # k + 1 points are left: their k-th difference is the coefficient
            differences = points
            for _ in range(k):
                differences = [b - a for a, b in pairwise(differences)]
            series[k] = comb(degree, k) * differences[0]
        points = [a + u * (b - a) for a, b in pairwise(points)]
    return series


def bezier_derivatives(
    control: Array, inverse: Array, length: Scalar, s: Scalar, order: int
) -> Derivatives:
    """Return a Bézier piece's point and derivatives over its own arc length.

    Outside [0, length] the piece goes on along the tangent at its end, because the Chebyshev series
    means nothing there; at both ends the derivatives are the curve's own.

    Parameters
    ----------
    control
        Homogeneous control points, shape (degree + 1, n_axes + 1).
    inverse
        Chebyshev coefficients of u over 2 s/length - 1.
    length, s
        Length of the piece and arc length from its start [m].
    order
        Highest derivative, >= 0.

    Returns
    -------
    Derivatives
        Shape (order + 1, n_axes) [m^(1-k)].
    """
    before, after = s < 0.0, s > length
    outside = before | after
    inside = jnp.where(before, 0.0, jnp.where(after, length, s))
    u = bezier_parameter(control, inverse, length, inside)
    curve = rational_taylor(control, u, max(order, 1))
    slowness = _slowness(curve)
    columns = []
    for series in curve:
        column = [series[0]]
        while len(series) > 1:  # one application of (1/|dr/du|) d/du
            series = _product(slowness, _slope(series))
            column.append(series[0])
        column[0] = column[0] + (s - inside) * column[1]
        column[2:] = [jnp.where(outside, 0.0, value) for value in column[2:]]
        columns.append(column)
    return jnp.stack([jnp.stack([column[k] for column in columns]) for k in range(order + 1)])


def _slope(series: Series) -> Series:
    return [(k + 1) * series[k + 1] for k in range(len(series) - 1)]


def _product(a: Series, b: Series) -> Series:
    count = min(len(a), len(b))
    return [sum((a[j] * b[k - j] for j in range(1, k + 1)), a[0] * b[k]) for k in range(count)]


def _slowness(curve: list[Series]) -> Series:
    """Return the Taylor coefficients of 1/|dr/du|, one fewer than those of r."""
    squares = [_product(slope, slope) for slope in map(_slope, curve)]
    squared = [sum(terms[1:], terms[0]) for terms in zip(*squares, strict=True)]
    # y = x^(-1/2) from 2 x y' = -x' y
    inverse = [1.0 / jnp.sqrt(squared[0])]
    for k in range(1, len(squared)):
        total = sum((k - 0.5 * j) * squared[j] * inverse[k - j] for j in range(1, k + 1))
        inverse.append(-total / (k * squared[0]))
    return inverse


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


@jax.custom_jvp
def bezier_parameter(control: Array, inverse: Array, length: Scalar, s: Scalar) -> Scalar:
    """Return a Bézier piece's own parameter u at its arc length s, from its Chebyshev series.

    The derivative over s is 1/|dr/du|, not that of the series. Tables of geometry are not
    differentiated: u does not change with control points or length.

    Parameters
    ----------
    control
        Homogeneous control points, shape (degree + 1, n_axes + 1).
    inverse
        Chebyshev coefficients.
    length, s
        Length of the piece and arc length from its start [m], 0 <= s <= length.
    """
    del control
    return chebyshev_value(inverse, 2.0 * s / length - 1.0)


@bezier_parameter.defjvp
def _bezier_parameter_jvp(primals: Any, tangents: Any) -> Any:
    control, inverse, length, s = primals
    u = bezier_parameter(control, inverse, length, s)
    slowness = _slowness(rational_taylor(control, u, 1))[0]
    return u, tangents[3] * slowness  # arc length: ds = |dr/du| du
