"""The grid on which recorded values lie: encoder counts, decimals of a text, significant digits.

The step of a grid is the greatest common divisor of the distances between the values that occur,
found by Euclid's algorithm with a tolerance for rounding. A text with three significant digits has
a step for every decade. Values that lie on no grid that could be told from rounding have step zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["grid_step", "grid_steps"]

LEAST_VALUES = 6
"""Different values from which a grid can be told."""
MOST_VALUES = 20_000
"""So many of the different values are looked at, next to each other."""
OFF = 0.02
"""Share of the step by which a distance may be off a multiple of it."""
SELDOM = 0.9
"""Share of values that occur once, and of those one step apart, from which it may be a motion."""
FINEST = 1e-9
"""Share of the largest value below which a step is rounding."""

Values = NDArray[Any]


def grid_step(values: Values) -> float:
    """Return the step of the grid on which values lie, 0 if there is none.

    Parameters
    ----------
    values
        Shape (n,).
    """
    different = np.unique(values)
    once = len(different) > SELDOM * len(values)
    if len(different) > MOST_VALUES:
        start = (len(different) - MOST_VALUES) // 2
        different = different[start : start + MOST_VALUES]
    if len(different) < LEAST_VALUES:
        return 0.0
    least = FINEST * float(np.abs(different).max())
    steps = np.diff(different)
    steps = steps[steps > least]
    # a motion at constant speed is evenly spaced too: then only digits make a grid
    for off in (OFF, 0.0):
        step = _divisor(steps, off, least)
        if step == 0.0 or not (once and np.mean(steps < 1.5 * step) > SELDOM):
            return step
    return 0.0


def _divisor(steps: Values, off: float, least: float) -> float:
    """Return the greatest common divisor of distances, 0 if it is no larger than rounding.

    Parameters
    ----------
    steps
        Distances.
    off
        Share of the divisor by which they may be off a multiple.
    least
        Size of rounding.
    """
    if len(steps) + 1 < LEAST_VALUES:
        return 0.0
    step = float(steps.min())
    for _ in range(40):
        rest = np.abs(steps - step * np.round(steps / step))
        beyond = rest > off * step + least
        if not beyond.any():
            return step if step > 20.0 * least else 0.0
        step = float(rest[beyond].min())
        if step < 20.0 * least:
            return 0.0
    return 0.0


def grid_steps(values: Values) -> Values:
    """Return the step of the grid at every value: one for all, or one for each decade.

    Parameters
    ----------
    values
        Shape (n,), in the unit of the file.
    """
    overall = grid_step(values)
    steps = np.full(len(values), overall)
    if overall == 0.0:
        return steps
    size = np.abs(values)
    decade = np.floor(np.log10(np.where(size > 0.0, size, 1e-300)) + 1e-9)
    for one in np.unique(decade):
        inside = decade == one
        own = grid_step(values[inside])
        ratio = own / overall
        # digits that are cut off make the step ten times as large, or a hundred times
        if ratio > 5.0 and abs(np.log10(ratio) - round(np.log10(ratio))) < 1e-3:
            steps[inside] = own
    return steps
