"""Where an axis reverses, and the states that follow from it: direction and lost motion."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["direction", "lost_motion", "turning_points"]

Values = NDArray[Any]


def turning_points(position: Values, least: float) -> tuple[Values, Values]:
    """Return the rows at which an axis reverses, and the direction after each.

    Parameters
    ----------
    position
        Shape (n,) [m].
    least
        An axis has reversed when it is further than this from where it turned: what goes back and
        forth by less is a flicker of the grid [m].

    Returns
    -------
    rows, signs
        ``signs`` begins with the first direction and has one entry more than ``rows``.
    """
    step = np.diff(position)
    moving = np.flatnonzero(step != 0.0)
    if not len(moving):
        return np.zeros(0, np.int64), np.zeros(1)
    sign = np.sign(step[moving])
    turn = np.flatnonzero(np.diff(sign) != 0.0)
    # local extremes, of a rest there its last row; and the ends of the record
    extremes = np.concatenate([[0], moving[turn + 1], [len(position) - 1]])
    heights = position[extremes]
    rows: list[int] = []
    first = 0.0
    top, at, way = heights[0], int(extremes[0]), 0.0
    low, high = (heights[0], heights[0])
    for row, height in zip(extremes[1:].tolist(), heights[1:].tolist(), strict=True):
        if way == 0.0:
            low, high = min(low, height), max(high, height)
            if height - low > least:
                way = first = 1.0
            elif high - height > least:
                way = first = -1.0
            else:
                continue
            top, at = height, row
        elif (height - top) * way > 0.0:
            top, at = height, row
        elif (top - height) * way > least:
            rows.append(at)
            way = -way
            top, at = height, row
    signs = first * (-1.0) ** np.arange(len(rows) + 1)
    return np.asarray(rows, np.int64), signs


def direction(n: int, rows: Values, signs: Values) -> Values:
    """Return the direction of motion at every row, held while the axis rests.

    Parameters
    ----------
    n
        How many rows.
    rows, signs
        As :func:`turning_points` returns them.
    """
    return signs[np.searchsorted(rows, np.arange(n), side="left")]


def lost_motion(
    position: Values, rows: Values, signs: Values, play: float, before: float | None = None
) -> Values:
    """Return on which side of its play an axis is, from -1 to 1.

    After a reversal it crosses the play while it moves by its width; where it turns within the play
    it comes back the same way.

    Parameters
    ----------
    position
        Shape (n,) [m].
    rows, signs
        As :func:`turning_points` returns them.
    play
        Width of the play [m]; 0 crosses at once.
    before
        The side at the first row; that of the first motion if None.
    """
    n = len(position)
    if play <= 0.0:
        return direction(n, rows, signs)
    side = float(signs[0]) if before is None else before
    state = np.empty(n)
    edges = [0, *(int(row) for row in rows), n - 1]
    for first, last in pairwise(edges):
        gone = position[first : last + 1] - position[first]
        state[first : last + 1] = np.clip(side + 2.0 * gone / play, -1.0, 1.0)
        side = float(state[last])
    return state
