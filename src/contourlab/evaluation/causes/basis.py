"""A record of one axis, ready for a fit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Stage", "stage_of"]

Values = NDArray[Any]


class Stage(NamedTuple):
    """A record of one axis, ready for a fit."""

    commanded: Values
    """r, shape (n,) [m]."""
    error: Values
    """e [m]."""
    parts: tuple[slice, ...]
    """Rows between breaks."""
    sample_time: float
    """[s]"""
    least: float
    """Reversals smaller than this are flicker [m]."""


def stage_of(
    commanded: Values, actual: Values, parts: list[slice], dt: float, least: float
) -> Stage:
    """Return a record of one axis.

    Parameters
    ----------
    commanded, actual
        Shape (n,) [m].
    parts
        Rows between breaks.
    dt
        Sample time [s].
    least
        Reversals smaller than this are flicker [m].
    """
    return Stage(np.asarray(commanded, float), commanded - actual, tuple(parts), dt, least)
