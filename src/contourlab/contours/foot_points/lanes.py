"""Many points at a time: chunks of few sizes, side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

__all__ = ["LARGE", "SMALL", "chunks", "padded", "side_by_side", "slices"]

LARGE, SMALL = 1 << 13, 1 << 11
"""Lanes of a chunk: of these sizes only, so that nothing is compiled for a new number of points."""

Values = NDArray[Any]


def padded(values: Any, size: int) -> Any:
    """Return arrays with their last rows repeated up to a size; none may be empty."""

    def one(x: Values) -> Values:
        x = np.asarray(x)
        more = size - len(x)
        return np.concatenate([x, np.repeat(x[-1:], more, axis=0)]) if more else x

    return jax.tree.map(one, values)


def chunks(n: int, size: int | None = None) -> list[tuple[slice, int]]:
    """Return slices that cover n points, each with the size that it is padded to.

    Parameters
    ----------
    n
        Number of points.
    size
        Lanes of a chunk; ``SMALL`` or ``LARGE``, whichever suits n, when None. It is one size for
        all chunks, because to compile for a second one takes longer than to pad.
    """
    size = size or (SMALL if n <= 2 * SMALL else LARGE)
    return [(slice(at, min(at + size, n)), size) for at in range(0, n, size)]


def slices(n: int, size: int) -> list[slice]:
    """Return slices of about one length that cover n points.

    Parameters
    ----------
    n
        Number of points.
    size
        Of a slice, at most.
    """
    edges = np.linspace(0, n, -(-n // size) + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges) if b > a]


def side_by_side(work: Callable[..., None], jobs: Sequence[tuple[Any, ...]]) -> None:
    """Do jobs, as many at a time as there are processors.

    Parameters
    ----------
    work
        Takes what is in a job.
    jobs
        Arguments of each call.
    """
    if len(jobs) < 2:
        for job in jobs:
            work(*job)
        return
    with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
        list(pool.map(work, *zip(*jobs, strict=True)))
