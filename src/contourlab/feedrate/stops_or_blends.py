"""Whether passing a blended corner is faster than stopping at it.

A blend within a small tolerance is so sharp that a jerk limit may hold the feed on it lower than
pays: then an exact stop is faster, and more accurate. The program is planned with all of its blends
and with none at its corners; each corner gets what takes less time from the middle of the piece
before it to the middle of the piece behind it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.blending import Blended
from contourlab.contours.path import Path
from contourlab.feedrate.profile import Profile

__all__ = ["faster_to_stop", "middle_times"]

Values = NDArray[Any]

_FASTER = 1e-3
"""A stop that saves less than this share is none."""


def faster_to_stop(with_blends: Values, with_stops: Values) -> Values:
    """Return for each joint whether a stop is faster, shape (n_pieces - 1,).

    Parameters
    ----------
    with_blends, with_stops
        Instants at the middles of the pieces in both plans, shape (n_pieces,) [s].
    """
    faster: Values = np.diff(with_stops) < (1.0 - _FASTER) * np.diff(with_blends)
    return faster


def middle_times(path: Path, blended: Blended, profile: Profile) -> Values:
    """Return when a plan passes the middle of each piece of a path, shape (n_pieces,) [s].

    Where a blend has taken the middle, it is the end of the blend; where two blends have taken all
    of the piece, where they meet.

    Parameters
    ----------
    path
        Before blending.
    blended
        How it was blended.
    profile
        The plan along the blended path.
    """
    n = path.n_pieces
    length = np.diff(np.asarray(path.breaks, float))
    before, after = np.zeros(n), np.zeros(n)
    after[blended.joint] = blended.trim[:, 0]
    before[(blended.joint + 1) % n] = blended.trim[:, 1]
    into = np.clip(0.5 * length, before, np.maximum(length - after, before)) - before
    breaks = np.asarray(blended.path.breaks, float) - float(np.asarray(blended.path.breaks)[0])
    # the first row that is of the piece, its blend with the piece before it left out
    own = blended.piece - 0.5 * blended.is_blend
    row = np.searchsorted(own, np.arange(n), side="left")
    return profile.time_at(np.minimum(breaks[row] + into, breaks[-1]))
