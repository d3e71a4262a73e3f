"""Where a record is broken: gaps in time, jumps in position, values that are held.

A *jump* is a step between neighbours that is many times what the samples around it do, at both of
its ends: no axis comes from rest, crosses the machine and rests again between two samples. What was
between is not in the record, so a path is not drawn across it. A *gap* is a time without samples;
a path may cross it, the dynamics may not.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Int
from numpy.typing import NDArray

from contourlab.logs.log import Log

__all__ = ["Breaks", "find_breaks", "stretches"]

JUMP = 8.0
"""A step this many times those beside it, and the usual one, is a jump."""
LONGEST_REPEAT = 10
"""More samples than this that stand still are a rest."""
GAP = 1.5
"""A step in time this many times the sample time is a gap."""

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Breaks:
    """Where a record is broken."""

    jumps: Int[np.ndarray, " n_jumps"]
    """Rows after which the position jumps."""
    largest_jump: float
    """[m]"""
    gaps: Int[np.ndarray, " n_gaps"]
    """Rows after which samples are missing."""
    lost_time: float
    """Time without samples [s]."""
    held: Bool[np.ndarray, " n_samples"]
    """Samples between two jumps in which nothing moves: the record shows no machine there."""
    repeated: Bool[np.ndarray, " n_samples"]
    """Samples that repeat the one before although the axes move."""


def find_breaks(log: Log) -> Breaks:
    """Return where a log is broken.

    Parameters
    ----------
    log
        The log.
    """
    position = log.actual if log.commanded is None else log.commanded
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    jumps = _jumps(position, step)
    if log.commanded is not None and len(jumps):
        # the actual position jumps with it, or it was a step that the axes could not follow
        actual = np.linalg.norm(np.diff(log.actual, axis=0), axis=1)
        jumps = jumps[actual[jumps] > 0.5 * step[jumps]]
    interval = np.diff(log.time)
    long = interval > GAP * log.sample_time
    lost = float(np.sum(interval[long] - log.sample_time)) if long.any() else 0.0
    gaps = np.union1d(np.flatnonzero(long), log.lost_after).astype(np.int64)
    held = np.zeros(log.n_samples, bool)
    if len(jumps):
        edges = np.concatenate([[0], jumps + 1, [log.n_samples]])
        for a, b in pairwise(edges):
            held[a:b] = not (step[a : b - 1] > 0.0).any()
    return Breaks(
        jumps=jumps, largest_jump=float(step[jumps].max()) if len(jumps) else 0.0,
        gaps=gaps[gaps < log.n_samples - 1], lost_time=lost, held=held,
        repeated=_repeated(log, step),
    )  # fmt: skip


def _jumps(position: Values, step: Values) -> Values:
    """Return the rows after which a record jumps."""
    moving = step[step > 0.0]
    if len(moving) < 4:
        return np.zeros(0, np.int64)
    usual = float(np.median(moving))
    before = np.concatenate([[0.0], step[:-1]])
    after = np.concatenate([step[1:], [0.0]])
    wild = step > JUMP * np.maximum(np.maximum(before, after), usual)
    # there and back: a single value that is out of place
    away = np.concatenate([step[2:], [0.0, 0.0]])
    net = np.linalg.norm(position[2:] - position[:-2], axis=1)
    out = np.zeros_like(wild)
    out[:-1] = (
        (np.minimum(step[:-1], step[1:]) > JUMP * np.maximum(np.maximum(before, away)[:-1], usual))
        & (net < 0.2 * step[:-1])
    )  # fmt: skip
    wild |= out
    wild[1:] |= out[:-1]
    return np.flatnonzero(wild).astype(np.int64)


def _repeated(log: Log, step: Values) -> Values:
    """Return which samples repeat the one before in every column while the axes move."""
    still = (np.diff(log.actual, axis=0) == 0.0).all(axis=1)
    if log.commanded is not None:
        still &= step == 0.0
    # a few still samples between motion on both sides are no rest
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    repeated = np.zeros(log.n_samples, bool)
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if first > 0 and last < len(still) and last - first <= LONGEST_REPEAT:
            repeated[first + 1 : last + 1] = True
    return repeated


def stretches(n: int, after: Values) -> list[slice]:
    """Return the stretches of rows between breaks.

    Parameters
    ----------
    n
        How many rows.
    after
        Rows after which the record is broken, rising.
    """
    edges = [0, *(int(k) + 1 for k in after), n]
    return [slice(a, b) for a, b in pairwise(edges) if b > a]
