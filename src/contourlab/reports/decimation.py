"""Fewer points for drawing, with the extremes kept."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

__all__ = ["kept_rows", "shape_rows", "spans"]


def kept_rows(
    n_rows: int, budget: int, series: Sequence[Float[np.ndarray, " n_rows"]]
) -> Int[np.ndarray, " n_kept"]:
    """Return the rows to draw: of every bucket the first, and least and largest of every series.

    Parameters
    ----------
    n_rows
        Length of the record.
    budget
        How many rows may be kept; all are if there are no more.
    series
        What must keep its extremes, each of length ``n_rows``; NaN counts as 0.
    """
    if n_rows <= budget:
        return np.arange(n_rows)
    n_buckets = max(1, (budget - 1) // (1 + 2 * len(series)))
    rows = _buckets(n_rows, n_buckets)
    kept = [rows[:, 0], np.array([n_rows - 1])]
    for values in series:
        bucket = np.nan_to_num(np.asarray(values, float))[rows]
        for at in (bucket.argmin(axis=1), bucket.argmax(axis=1)):
            kept.append(np.take_along_axis(rows, at[:, None], axis=1)[:, 0])
    return np.unique(np.concatenate(kept))


def shape_rows(
    points: Float[np.ndarray, "n_rows n_coordinates"], budget: int
) -> Int[np.ndarray, " n_kept"]:
    """Return the rows of a curve to draw: of every bucket its ends and what is far from its chord.

    Parameters
    ----------
    points
        The curve.
    budget
        How many rows may be kept; all are if there are no more.
    """
    n_rows = len(points)
    if n_rows <= budget:
        return np.arange(n_rows)
    rows = _buckets(n_rows, max(1, budget // 2))
    bucket = np.nan_to_num(points)[rows]
    start, chord = bucket[:, :1], bucket[:, -1:] - bucket[:, :1]
    size = np.maximum(np.sum(chord * chord, axis=2, keepdims=True), 1e-300)
    along = np.clip(np.sum((bucket - start) * chord, axis=2, keepdims=True) / size, 0.0, 1.0)
    away = np.sum((bucket - start - along * chord) ** 2, axis=2)
    far = np.take_along_axis(rows, away.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.unique(np.concatenate([rows[:, 0], far, [n_rows - 1]]))


def spans(flags: np.ndarray, gap: int) -> list[tuple[int, int]]:
    """Return the stretches of rows in which a flag is set, first and last row of each.

    Parameters
    ----------
    flags
        Shape (n_rows,), true where something holds.
    gap
        Stretches closer than this many rows are drawn as one.
    """
    rows = np.flatnonzero(flags)
    if not len(rows):
        return []
    cut = np.flatnonzero(np.diff(rows) > max(gap, 1))
    first = np.concatenate([rows[:1], rows[cut + 1]])
    last = np.concatenate([rows[cut], rows[-1:]])
    return [(int(a), int(b)) for a, b in zip(first, last, strict=True)]


def _buckets(n_rows: int, n_buckets: int) -> Int[np.ndarray, "n_buckets size"]:
    # the last bucket repeats its last row; buckets that would be empty repeat it too
    size = -(-n_rows // n_buckets)
    n_buckets = -(-n_rows // size)
    return np.minimum(np.arange(n_buckets * size), n_rows - 1).reshape(n_buckets, size)
