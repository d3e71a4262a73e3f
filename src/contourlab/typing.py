"""Shapes, named once.

Axes come last: ``(n_axes,)`` for one instant, ``(n_samples, n_axes)`` for a record. The annotations
are checked in the test run.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import jax
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray

__all__ = [
    "Array",
    "AxisVector",
    "Count",
    "Derivatives",
    "Flag",
    "Matrix",
    "Record",
    "Scalar",
    "Series",
    "Vector",
]

Array: TypeAlias = jax.Array | NDArray[Any]
"""A JAX array (also while it is traced) or a NumPy array."""

Scalar: TypeAlias = Float[Array, ""] | float
AxisVector: TypeAlias = Float[Array, " n_axes"]
"""One value per axis (or per coordinate of the tool point)."""
Vector: TypeAlias = Float[Array, " n"]
Matrix: TypeAlias = Float[Array, "rows columns"]
Derivatives: TypeAlias = Float[Array, "order_plus_one n_axes"]
"""Position in row 0, k-th derivative in row k."""
Record: TypeAlias = Float[Array, "n_samples n_axes"]
Series: TypeAlias = Float[Array, " n_samples"]
Count: TypeAlias = Int[Array, ""] | int
Flag: TypeAlias = Bool[Array, ""] | bool
