"""Substeps of a control period, shared between the parts that a fractional delay cuts it into."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from contourlab.typing import Array, Scalar

__all__ = ["lengths_of", "share"]


def share(substeps: int, durations: tuple[Scalar, ...]) -> tuple[int, ...]:
    """Return how many substeps each part of a control period gets: at least one.

    Parameters
    ----------
    substeps
        Per control period.
    durations
        Length of each part [s]; known numbers if there is more than one.
    """
    if len(durations) == 1:
        return (substeps,)
    total = sum(float(d) for d in durations)
    return tuple(max(1, int(np.ceil(substeps * float(d) / total - 1e-9))) for d in durations)


def lengths_of(durations: tuple[Scalar, ...], counts: tuple[int, ...]) -> Array:
    """Return the length of a substep in each part, shape (n_parts,) [s].

    Parameters
    ----------
    durations
        Length of each part [s].
    counts
        Substeps of each.
    """
    return jnp.stack([jnp.asarray(d, float) for d in durations]) / np.asarray(counts, float)
