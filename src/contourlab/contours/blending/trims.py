"""How much of its neighbours each blend may replace: wanted, then shared fairly."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.blending.deviation import Cut, measured_deviation
from contourlab.contours.blending.pieces import Pieces
from contourlab.contours.blending.shape import deviation_per_trim, quintic

__all__ = ["SWEEP", "blend_controls", "kept_stretches", "longest_trims", "shared", "wanted_trims"]

Rows = NDArray[Any]

SWEEP = np.pi / 4.0
"""Greatest angle of an arc that a blend replaces [rad]: past it one quintic is no longer near."""

_SEARCH = 14
_SWALLOWED = 1e-6
"""What is left of a piece below this fraction of it is given to the blends."""
_SHY = 1.0 - 3e-6
"""Fraction of the tolerance that is aimed at, so that swallowing what is left does not pass it."""
_BEND = 0.011
"""Deviation of a smoothed curvature jump, over jump and trim squared."""
_ROUNDS = 40


def longest_trims(pieces: Pieces, joint: Rows) -> Rows:
    """Return the longest trims that the two pieces at joints allow, sharing aside [m].

    Parameters
    ----------
    pieces
        The path.
    joint
        Joints, shape (n,); joint j is between pieces j and j + 1.
    """
    rate = np.abs(pieces.rate)
    for at_end in (False, True):
        curved = np.flatnonzero(pieces.row >= 0)
        if len(curved):
            where = pieces.length[curved] * float(at_end)
            bend = np.linalg.norm(pieces.ends_at(curved, where)[2], axis=1)
            rate[curved] = np.maximum(rate[curved], bend)
    longest = np.minimum(pieces.length, SWEEP / np.maximum(rate, 1e-300))
    return np.minimum(longest[joint], longest[joint + 1])  # type: ignore[no-any-return]


def blend_controls(pieces: Pieces, cut: Cut, angle: Rows) -> Rows:
    """Return the Bézier points of blends, shape (n, 6, n_axes) [m].

    Parameters
    ----------
    pieces
        The path.
    cut
        What they replace.
    angle
        Turning angles at the joints, shape (n,) [rad].
    """
    trim = np.stack([pieces.length[cut.before] - cut.low, cut.high], axis=1)
    return quintic(
        pieces.ends_at(cut.before, cut.low), pieces.ends_at(cut.after, cut.high), trim, angle
    )


def wanted_trims(
    pieces: Pieces, joint: Rows, angle: Rows, jump: Rows, tolerance: Rows, longest: Rows
) -> Rows:
    """Return the longest trims at which blends stay within tolerance, shape (n,) [m]; 0 if none.

    Two lines in closed form; any others by a search for each joint as if it were alone.

    Parameters
    ----------
    pieces
        The path.
    joint, angle, jump
        Joints, their turning angles [rad] and curvature jumps [1/m], shape (n,).
    tolerance
        Shape (n,), may be inf [m].
    longest
        Upper bounds, shape (n,) [m].
    """
    straight = pieces.straight[joint] & pieces.straight[joint + 1]
    corner = tolerance / np.maximum(deviation_per_trim(angle), 1e-300)
    trim = np.minimum(_SHY * corner, longest)
    other = np.flatnonzero(~straight)
    if len(other):
        bend = np.sqrt(tolerance / np.maximum(_BEND * jump, 1e-300))
        guess = np.minimum(np.minimum(corner, bend), longest)[other]
        trim[other] = _searched(
            pieces, joint[other], angle[other], tolerance[other], longest[other], guess
        )
    return trim


def _searched(
    pieces: Pieces, joint: Rows, angle: Rows, tolerance: Rows, longest: Rows, guess: Rows
) -> Rows:
    best, trim = np.zeros(len(joint)), guess.copy()
    too_long = np.full(len(joint), np.inf)
    power = np.where(angle > 1e-2, 1.0, 2.0)
    active = np.arange(len(joint))
    for _ in range(_SEARCH):
        j, t = joint[active], trim[active]
        cut = Cut(j, pieces.length[j] - t, j + 1, t)
        control = blend_controls(pieces, cut, angle[active])
        deviation, fair = measured_deviation(pieces, cut, control, samples=17, rounds=0)
        good = fair & (deviation <= _SHY * tolerance[active])
        best[active] = np.where(good, np.maximum(best[active], t), best[active])
        too_long[active] = np.where(good, too_long[active], np.minimum(too_long[active], t))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = 0.99 * tolerance[active] / np.maximum(deviation, 1e-300)
        step = np.where(fair, np.clip(ratio, 1e-4, 1e2) ** (1.0 / power[active]), 0.5)
        following = np.minimum(t * step, longest[active])
        # inside the bracket once there is one
        bracketed = np.isfinite(too_long[active]) & (best[active] > 0.0)
        inside = (following > best[active]) & (following < too_long[active])
        middle = 0.5 * (best[active] + np.where(bracketed, too_long[active], 0.0))
        trim[active] = np.where(bracketed & ~inside, middle, following)
        close = bracketed & (too_long[active] - best[active] <= 0.02 * best[active])
        enough = good & (ratio < 1.03)
        done = (good & (t >= longest[active])) | close | enough
        active = active[~done]
        if not len(active):
            break
    return best


def shared(want: Rows, joint: Rows, length: Rows) -> Rows:
    """Return trims that fit: the two blends on a piece together use no more than its length.

    Each gets its want or half the piece; what is then left of a piece is offered to both, half and
    half, again and again, so that what one does not need goes to the other, and the result does
    not depend on the direction of travel.

    Parameters
    ----------
    want
        Shape (n,) [m].
    joint
        Shape (n,), ascending.
    length
        Of all pieces [m].
    """
    demand = np.zeros(len(length) + 1)  # at the start of piece i; at i + 1 its end
    demand[joint + 1] = want
    half = np.where((demand[:-1] > 0.0) & (demand[1:] > 0.0), 0.5, 1.0) * length
    trim = np.minimum(demand, np.minimum(np.append(half, np.inf), np.append(np.inf, half)))
    for _ in range(_ROUNDS):
        spare = np.maximum(length - trim[:-1] - trim[1:], 0.0)
        hungry = trim < demand * (1.0 - 1e-9)
        offered = spare / np.maximum(hungry[:-1].astype(float) + hungry[1:], 1.0)
        offered = np.where(offered > 1e-9 * length, offered, 0.0)
        more = np.minimum(np.append(offered, np.inf), np.append(np.inf, offered))
        more = np.minimum(np.where(hungry, more, 0.0), demand - trim)
        if not (more > 0.0).any():
            break
        trim = trim + more
    return trim[joint + 1]  # type: ignore[no-any-return]


def kept_stretches(trim: Rows, joint: Rows, length: Rows) -> tuple[Rows, Rows]:
    """Return the arc lengths from and to which each piece is kept; equal where nothing is left.

    Parameters
    ----------
    trim
        Shape (n,) [m].
    joint
        Shape (n,).
    length
        Of all pieces [m].
    """
    start, end = np.zeros(len(length)), np.zeros(len(length))
    start[joint + 1] = trim
    end[joint] = trim
    used = start + end
    swallowed = (used > 0.0) & (length - used <= _SWALLOWED * length)
    meeting = length * start / np.where(swallowed, used, 1.0)
    return np.where(swallowed, meeting, start), np.where(swallowed, meeting, length - end)
