"""Least squares in groups of columns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Groups", "independent_samples", "solve", "thinned"]

Values = NDArray[Any]
Groups = dict[str, Values]


def independent_samples(residual: Values) -> float:
    """Return how many independent samples a residual amounts to.

    Parameters
    ----------
    residual
        Shape (n,).
    """
    x = residual - residual.mean()
    n = len(x)
    size = 1 << int(np.ceil(np.log2(2 * n)))
    correlation = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: n // 2]
    if len(correlation) < 2 or correlation[0] <= 0.0:
        return float(n)
    correlation = correlation / correlation[0]
    ends = np.flatnonzero(correlation < 0.05)
    stop = int(ends[0]) if len(ends) else len(correlation)
    return float(max(n / (1.0 + 2.0 * correlation[1:stop].sum()), 20.0))


def solve(groups: Groups, target: Values, rows: Values) -> tuple[Groups, float]:
    """Return coefficients by group and the sum of squares that is left.

    Parameters
    ----------
    groups
        Columns, shape (n, columns) each.
    target
        What they are to make up, shape (n,).
    rows
        Which rows count.
    """
    matrix = np.column_stack([columns[rows] for columns in groups.values()])
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    scaled = matrix / size
    wanted = target[rows]
    gram = scaled.T @ scaled
    solution = np.linalg.lstsq(gram, scaled.T @ wanted, rcond=1e-12)[0]
    left = wanted - scaled @ solution
    found: Groups = {}
    at = 0
    for name, columns in groups.items():
        width = columns.shape[1]
        found[name] = (solution / size)[at : at + width]
        at += width
    return found, float(left @ left)


def thinned(rows: Values, most: int) -> Values:
    """Return every so many of some rows, so that no more are left.

    Parameters
    ----------
    rows
        Rows.
    most
        How many may be left.
    """
    return rows[:: max(1, -(-len(rows) // most))]
