"""Lines, arcs and helices in one formula over arc length, safe at zero curvature.

With θ = rate · s,

    p(s) = origin + U s sin(θ)/θ + V s (1 - cos θ)/θ + W s

where U is the part of the initial tangent in the plane of turning, V the same turned by +90°
towards the centre, W the part along the axis of the helix, |U|² + |W|² = 1. A line has rate 0 and
may hold its tangent in U or in W. The chord from the origin lies at θ/2, which gives

    s sin(θ)/θ = chord cos(θ/2),  s (1 - cos θ)/θ = chord sin(θ/2),  chord = s sinc(θ/2)

without any difference of nearly equal numbers, for tiny arcs as for huge radii.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.errors import GeometryError
from contourlab.typing import Array, AxisVector, Derivatives, Scalar

__all__ = [
    "check_helical",
    "helical_derivatives",
    "helical_end_points",
    "helical_ends",
    "helical_point",
]

_UNIT_TOLERANCE = 1e-9
"""How far the vectors of a piece may be from making a unit tangent, in the square."""

Rows = NDArray[Any]


def _sinc(x: Scalar) -> Scalar:
    """Return sin(x)/x, smooth at 0."""
    small = jnp.abs(x) < 1e-2
    safe = jnp.where(small, 1.0, x)
    x2 = x * x
    series = 1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0))
    return jnp.where(small, series, jnp.sin(safe) / safe)


def helical_point(
    s: Scalar, rate: Scalar, origin: Array, u: Array, v: Array, w: Array
) -> AxisVector:
    """Return the point of a helical piece at its own arc length; see the module's formula.

    Parameters
    ----------
    s, rate
        Arc length from the start of the piece [m], angle rate [rad/m].
    origin, u, v, w
        The row's vectors, shape (n_axes,).
    """
    half = 0.5 * rate * s
    chord = s * _sinc(half)  # the chord to the point lies at half the angle turned
    return origin + u * (chord * jnp.cos(half)) + v * (chord * jnp.sin(half)) + w * s


def helical_derivatives(
    s: Scalar, rate: Scalar, origin: Array, u: Array, v: Array, w: Array, order: int
) -> Derivatives:
    """Return a helical piece's point and derivatives over its own arc length.

    Parameters
    ----------
    s, rate, origin, u, v, w
        As in :func:`helical_point`.
    order
        Highest derivative, >= 0.
    """
    rows = [helical_point(s, rate, origin, u, v, w)]
    if order >= 1:
        angle = rate * s
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        along, across = u * cosine + v * sine, v * cosine - u * sine
        rows.append(along + w)
        factor, turned = rate, (across, -along, -across, along)
        for k in range(2, order + 1):
            rows.append(factor * turned[(k - 2) % 4])
            factor = factor * rate
    return jnp.stack(rows)


def helical_end_points(origin: Rows, u: Rows, v: Rows, w: Rows, rate: Rows, length: Rows) -> Rows:
    """Return the points at an arc length of each of many pieces, shape (n_pieces, n_axes) [m].

    Parameters
    ----------
    origin, u, v, w
        Shape (n_pieces, n_axes).
    rate, length
        Angle rate [rad/m] and arc length [m], shape (n_pieces,).
    """
    half = 0.5 * rate * length
    chord = length * np.sinc(half / np.pi)
    point = origin + u * (chord * np.cos(half))[:, None]
    point += v * (chord * np.sin(half))[:, None]
    point += w * length[:, None]
    return point


def helical_ends(
    origin: Rows, u: Rows, v: Rows, w: Rows, rate: Rows, length: Rows
) -> tuple[Rows, Rows, Rows]:
    """Return the points, tangents and curvature vectors at an arc length of each of many pieces.

    Parameters
    ----------
    origin, u, v, w
        Shape (n_pieces, n_axes).
    rate, length
        Angle rate [rad/m] and arc length [m], shape (n_pieces,).

    Returns
    -------
    point, tangent, curvature
        Each of shape (n_pieces, n_axes): [m], none, [1/m].
    """
    point = helical_end_points(origin, u, v, w, rate, length)
    cosine, sine = np.cos(rate * length)[:, None], np.sin(rate * length)[:, None]
    return point, u * cosine + v * sine + w, rate[:, None] * (v * cosine - u * sine)


def check_helical(u: Rows, v: Rows, w: Rows, rate: Rows) -> None:
    """Raise GeometryError unless the vectors of every piece make it run at unit speed.

    Parameters
    ----------
    u, v, w
        Shape (n_pieces, n_axes).
    rate
        Angle rate, shape (n_pieces,) [rad/m].
    """

    def dot(a: Rows, b: Rows) -> Rows:
        return np.einsum("ij,ij->i", a, b)  # type: ignore[no-any-return]

    u2 = dot(u, u)
    tangent = np.abs(u2 + 2.0 * dot(u, w) + dot(w, w) - 1.0) > _UNIT_TOLERANCE
    if tangent.any():
        raise GeometryError(
            f"piece {int(np.argmax(tangent))}: tangent_vector + axial_vector must be a unit vector"
        )
    across = np.maximum(np.abs(dot(v, v) - u2), np.abs(dot(u, v)))
    across = np.maximum(across, np.maximum(np.abs(dot(u, w)), np.abs(dot(v, w))))
    wrong = (rate != 0.0) & (across > _UNIT_TOLERANCE)
    if wrong.any():
        raise GeometryError(
            f"piece {int(np.argmax(wrong))}: normal_vector must be tangent_vector turned by 90°, "
            "and axial_vector perpendicular to both"
        )
