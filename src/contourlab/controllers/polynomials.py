"""Polynomials in the delay operator q⁻¹: coefficients along the last dimension, no delay first.

All that Diophantine equations of predictive control ask for is one long division. With i terms of
the quotient taken,

    N / D = g_0 + g_1 q⁻¹ + ... + g_{i-1} q^-(i-1) + q^-i R_i / D,

the quotient is what is still to come, the remainder what is known already.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.errors import ConfigurationError
from contourlab.typing import Array

__all__ = ["check_roots", "divide", "multiply", "padded"]

Polynomial = Float[Array, "..."]


def multiply(first: Polynomial, second: Polynomial) -> Array:
    """Return the product of two polynomials.

    Parameters
    ----------
    first, second
        Shapes (..., n) and (..., m), broadcast over what stands before.
    """
    n, m = int(first.shape[-1]), int(second.shape[-1])
    shape = jnp.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    product = jnp.zeros((*shape, n + m - 1))
    for k in range(n):
        product = product.at[..., k : k + m].add(first[..., k : k + 1] * second)
    return product


def padded(polynomial: Polynomial, length: int) -> Array:
    """Return a polynomial with zeros at its end.

    Parameters
    ----------
    polynomial
        Shape (..., n).
    length
        Of the result, >= n.
    """
    missing = length - int(polynomial.shape[-1])
    return jnp.pad(polynomial, [(0, 0)] * (polynomial.ndim - 1) + [(0, missing)])


def divide(
    numerator: Polynomial, denominator: Polynomial, terms: int
) -> tuple[jax.Array, jax.Array]:
    """Return the first terms of a quotient, and the remainder after each.

    Parameters
    ----------
    numerator, denominator
        Shapes (..., n) and (..., m), of the same batch; the denominator does not begin with 0.
    terms
        Number of terms, >= 1.

    Returns
    -------
    quotient
        g_0 to g_{terms-1}, shape (..., terms).
    remainders
        R_1 to R_terms, shape (..., terms, max(n, m, 2) - 1).
    """
    length = max(int(numerator.shape[-1]), int(denominator.shape[-1]), 2)
    shape = jnp.broadcast_shapes(numerator.shape[:-1], denominator.shape[:-1])
    divisor = jnp.broadcast_to(padded(denominator, length), (*shape, length))
    start = jnp.broadcast_to(padded(numerator, length), (*shape, length))

    def term(rest: jax.Array, _: None) -> tuple[jax.Array, tuple[jax.Array, jax.Array]]:
        g = rest[..., 0] / divisor[..., 0]
        rest = (rest - g[..., None] * divisor)[..., 1:]
        return jnp.asarray(padded(rest, length)), (g, rest)

    _, (quotient, remainders) = jax.lax.scan(term, start, None, length=terms)
    return jnp.moveaxis(quotient, 0, -1), jnp.moveaxis(remainders, 0, -2)


def check_roots(name: str, polynomial: Any, *, on_circle: bool) -> None:
    """Raise ConfigurationError unless the roots are inside the unit circle, so that 1/p decays.

    Parameters
    ----------
    name
        Of the field, for the message.
    polynomial
        Shape (..., n), of known numbers.
    on_circle
        Whether roots of size 1 will do too.
    """
    for row in np.asarray(polynomial).reshape(-1, np.shape(polynomial)[-1]):
        largest = max(np.abs(np.roots(row)), default=0.0)
        if largest > 1.0 + 1e-9 if on_circle else largest >= 1.0 - 1e-9:
            raise ConfigurationError(
                f"{name} must have its roots {'in' if on_circle else 'inside'} the unit circle, "
                f"got one of size {largest:.6g}"
            )
