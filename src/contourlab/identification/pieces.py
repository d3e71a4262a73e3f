"""Pieces of a record in which an axis moves one way, fast enough for its friction to be simple.

Near a reversal friction is not what the model says (stiction, presliding, Stribeck). A piece begins
after one and ends before the next, and begins anew: nothing of what happened in between matters.
Long motions one way are cut, so that a force that nobody knows of does not add up for ever.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

__all__ = ["Pieces", "cut_pieces", "smooth_velocity"]

SHORTEST = 24
"""Samples below which a piece says too little."""
MOST_ROWS = 120_000
"""Rows that a fit looks at; of longer records pieces spread evenly over it are taken."""


class Pieces(NamedTuple):
    """Rows of the record, padded to one length."""

    rows: NDArray[Any]
    """Shape (n_pieces, length), int; padding repeats the last."""
    counts: NDArray[Any]
    """1 where a row is there, 0 in the padding."""
    found: int
    """Pieces in the record, of which these are as many as were taken."""

    def of(self, signal: NDArray[Any]) -> NDArray[Any]:
        """Return a signal's rows, shape (n_pieces, length).

        Parameters
        ----------
        signal
            Over the record, shape (n_samples,).
        """
        return np.asarray(signal[self.rows])


def smooth_velocity(position: NDArray[Any], sample_time: float) -> NDArray[Any]:
    """Return the velocity of one axis without the encoder's rattle and without delay [m/s].

    Parameters
    ----------
    position
        Shape (n_samples,) [m].
    sample_time
        [s].
    """
    window = min(21, (len(position) - 1) // 2 * 2 + 1)
    if window < 5:
        return np.asarray(np.gradient(position, sample_time))
    return np.asarray(savgol_filter(position, window, 2, deriv=1, delta=sample_time))


def cut_pieces(
    velocity: NDArray[Any], minimum_speed: float, *, longest: int, margin: int = 0
) -> Pieces | None:
    """Return the pieces of one axis, None if there is none.

    Parameters
    ----------
    velocity
        Shape (n_samples,) [m/s].
    minimum_speed
        Slower rows are in no piece [m/s].
    longest
        Samples of a piece at most.
    margin
        Rows at both ends of the record that are not looked at: what acts there is not known.
    """
    way = np.where(np.abs(velocity) >= minimum_speed, np.sign(velocity), 0.0)
    way[: margin + 1], way[len(way) - margin :] = 0.0, 0.0
    changes = np.flatnonzero(np.diff(way)) + 1
    edges = np.concatenate([[0], changes, [len(way)]])
    spans: list[tuple[int, int]] = []
    for begin, end in pairwise(edges):
        if way[begin] == 0.0 or end - begin < SHORTEST:
            continue
        parts = int(np.ceil((end - begin) / longest))
        cuts = np.linspace(begin, end, parts + 1).round().astype(int)
        spans += list(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True))
    if not spans:
        return None
    found = len(spans)
    total = sum(end - begin for begin, end in spans)
    if total > MOST_ROWS:
        keep = max(1, int(found * MOST_ROWS / total))
        spans = [spans[k] for k in np.unique(np.linspace(0, found - 1, keep).round().astype(int))]
    lengths = np.array([end - begin for begin, end in spans])
    length = int(2 ** np.ceil(np.log2(lengths.max())))  # few shapes, so that little is compiled
    at = np.arange(length)
    rows, counts = np.zeros((len(spans), length), int), np.zeros((len(spans), length))
    for k, (begin, end) in enumerate(spans):
        rows[k] = np.minimum(begin + at, end - 1)
        counts[k] = at < end - begin
    return Pieces(rows, counts, found)
