"""Exponentials of the zero-order hold: for one mode, safe at zero, and for small matrices.

With z = -h B / M, one axis under a constant force moves over a time h by

    v(h) = e^z v + h φ₁(z) f / M        q(h) = q + h φ₁(z) v + h² φ₂(z) f / M

φ₁(z) = (e^z - 1) / z and φ₂(z) = (φ₁(z) - 1) / z are entire: φ₁(0) = 1, φ₂(0) = 1/2. The quotients
lose digits near zero (their derivatives even more), so a Taylor polynomial stands in there.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.typing import Array

__all__ = ["LARGEST_NORM", "exponential", "phi", "phi_2"]

_NEAR = 0.05
_TAYLOR = (1 / 40320, 1 / 5040, 1 / 720, 1 / 120, 1 / 24, 1 / 6, 1 / 2)
"""The next term is 0.05^7 / 9! = 2e-15; beyond, the quotient loses 1 / 0.05² = 400 roundings."""


def phi_2(z: Array) -> Array:
    """Return φ₂(z), with right derivatives everywhere, zero included.

    Parameters
    ----------
    z
        Any shape, finite, not much above zero.
    """
    near = jnp.abs(z) < _NEAR
    small = jnp.where(near, z, 0.0)
    large = jnp.where(near, -1.0, z)  # keeps the unused branch, and its derivative, finite
    series = _TAYLOR[0] * small + _TAYLOR[1]
    for coefficient in _TAYLOR[2:]:
        series = series * small + coefficient
    inverse = 1.0 / large
    return jnp.where(near, series, ((jnp.exp(large) - 1.0) * inverse - 1.0) * inverse)


@jax.jit
def phi(z: Array) -> tuple[Array, Array, Array]:
    """Return e^z, φ₁(z) and φ₂(z), with right derivatives everywhere, zero included.

    Parameters
    ----------
    z
        Any shape, finite, not much above zero.
    """
    second = phi_2(z)
    return jnp.exp(z), 1.0 + z * second, second


_SQUARINGS = 12
LARGEST_NORM = 2000.0
"""Of a matrix for :func:`exponential`: halved twelve times it is below 1/2."""
_ORDER = 14
"""Of the Taylor polynomial: the next term is 0.5^15 / 15! = 2e-17."""


def exponential(matrix: Array) -> Array:
    """Return the matrix exponential, by a fixed number of halvings and squarings.

    Not ``jax.scipy.linalg.expm``, which computes every one of its branches in a batch and takes
    seconds to compile. What is squared is e^X - I, so that the many halvings cost no digits when
    the matrix is small: (I + Y)² - I = 2 Y + Y².

    Parameters
    ----------
    matrix
        Shape (..., n, n), of norm at most ``LARGEST_NORM``.
    """
    scaled = jnp.asarray(matrix) * 0.5**_SQUARINGS
    identity = jnp.eye(scaled.shape[-1])

    def horner(inner: jax.Array, order: Any) -> tuple[jax.Array, None]:
        return identity + scaled @ inner / order, None

    def square(y: jax.Array, _: None) -> tuple[jax.Array, None]:
        return 2.0 * y + y @ y, None

    orders = np.arange(_ORDER, 1, -1, dtype=float)
    first = scaled @ jax.lax.scan(horner, jnp.broadcast_to(identity, scaled.shape), orders)[0]
    return identity + jax.lax.scan(square, first, None, length=_SQUARINGS)[0]
