"""Small symmetric positive definite systems, in operations that can be exported.

Elimination without a search for pivots: a positive definite matrix needs none, every pivot is
positive and none grows. The loop has as many passes as there are unknowns.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.typing import Array

__all__ = ["solve_positive_definite"]


def solve_positive_definite(
    matrix: Float[Array, "n n"], right: Float[Array, "n m"]
) -> Float[jax.Array, "n m"]:
    """Return X of ``matrix X = right``.

    Parameters
    ----------
    matrix
        Symmetric and positive definite, shape (n, n); not checked.
    right
        Shape (n, m).
    """
    n = int(matrix.shape[0])
    work = jnp.concatenate([matrix, right], 1)
    rows = jnp.arange(n)

    def eliminate(work: jax.Array, k: jax.Array) -> tuple[jax.Array, None]:
        pivot = work[k] / work[k, k]
        column = jnp.where(rows == k, 0.0, work[:, k])
        work = work - column[:, None] * pivot
        return jnp.where((rows == k)[:, None], pivot, work), None

    return jax.lax.scan(eliminate, work, rows)[0][:, n:]
