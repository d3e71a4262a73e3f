"""Implicit forms: a function of the position that is zero on a contour, with two derivatives.

One rule of signs holds for all of them: the value is positive on the *right* of the direction of
travel, as the contour error is, whose vector runs from the actual position to the foot point and
is counted along the left normal. So ``(-f_y, f_x) / |∇f|`` points along the travel, and the value
of a counter-clockwise ellipse is positive outside. The value's unit is the contour's own affair;
``f / |∇f|`` is the contour error to first order.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from contourlab.typing import Array, AxisVector, Matrix, Scalar

__all__ = ["Level", "quadratic_level", "transformed_level"]


class Level(NamedTuple):
    """Value and derivatives of an implicit form at one position."""

    value: Scalar
    """0 on the contour, positive on the right of the direction of travel."""
    gradient: AxisVector
    """Shape (2,) [unit of the value per m]."""
    hessian: Matrix
    """Shape (2, 2), symmetric [unit of the value per m²]."""


def quadratic_level(
    offset: AxisVector, rows: Matrix, linear: AxisVector, constant: Scalar, sign: Scalar = 1.0
) -> Level:
    """Return ``sign (|A d|² + w . d + c)``, with d an offset, and its derivatives.

    Parameters
    ----------
    offset
        d, shape (2,) [m].
    rows
        A, shape (n, 2).
    linear
        w, shape (2,).
    constant
        c.
    sign
        Of the whole.
    """
    along = rows @ offset
    return Level(
        sign * (along @ along + linear @ offset + constant),
        sign * (2.0 * along @ rows + linear),
        sign * 2.0 * rows.T @ rows,
    )


def transformed_level(level: Level, inverse: Float[Array, "2 2"], sign: Scalar) -> Level:
    """Return a level after ``x -> A x + b``, from that of the original at the original position.

    Parameters
    ----------
    level
        At the position before the transformation.
    inverse
        Inverse of A.
    sign
        -1 for a reflection or a reversal, by which right and left change places.
    """
    return Level(
        sign * level.value,
        sign * (level.gradient @ inverse),
        sign * (inverse.T @ jnp.asarray(level.hessian) @ inverse),
    )
