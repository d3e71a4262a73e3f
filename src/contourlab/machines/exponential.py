"""Functions of the matrix exponential for one scalar mode, safe at zero.

With z = -h B / M, one axis under a constant force moves over a time h by

    v(h) = e^z v + h φ₁(z) f / M        q(h) = q + h φ₁(z) v + h² φ₂(z) f / M

φ₁(z) = (e^z - 1) / z and φ₂(z) = (φ₁(z) - 1) / z are entire: φ₁(0) = 1, φ₂(0) = 1/2. The quotients
lose digits near zero (their derivatives even more), so a Taylor polynomial stands in there.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.typing import Array

__all__ = ["phi"]

_NEAR = 0.1
"""Below this the polynomial of degree 9 is exact to rounding: the next term is 0.1^10 / 12!."""
_TAYLOR = (
    1 / 39916800, 1 / 3628800, 1 / 362880, 1 / 40320, 1 / 5040, 1 / 720, 1 / 120, 1 / 24, 1 / 6, 1 / 2,
)  # fmt: skip


def phi(z: Array) -> tuple[Array, Array, Array]:
    """Return e^z, φ₁(z) and φ₂(z), with right derivatives everywhere, zero included.

    Parameters
    ----------
    z
        Any shape, finite, not much above zero.
    """
    near = jnp.abs(z) < _NEAR
    small = jnp.where(near, z, 0.0)
    large = jnp.where(near, -1.0, z)  # keeps the unused branch, and its derivative, finite
    series = jnp.full_like(small, _TAYLOR[0])
    for coefficient in _TAYLOR[1:]:
        series = series * small + coefficient
    phi_2 = jnp.where(near, series, (jnp.expm1(large) / large - 1.0) / large)
    phi_1 = 1.0 + z * phi_2
    return jnp.exp(z), phi_1, phi_2
