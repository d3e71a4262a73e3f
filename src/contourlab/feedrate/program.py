"""What a part or a contour asks of the feed: one speed, and rests, for each piece."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.errors import FeedError
from contourlab.feedrate.limits import metres_per_second

__all__ = ["Program", "part_warnings", "program_of"]

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Program:
    """A contour with its feeds."""

    contour: Contour
    feed: Values
    """Of each piece [m/s]; inf for rapids that only the limits hold."""
    rapid: Values
    """Whether each piece is a rapid."""
    dwell: Values
    """Time at rest after each piece [s]."""
    dwell_before: float
    """Time at rest before the first [s]."""
    warnings: tuple[str, ...]
    """What the part's reader wanted seen."""
    part: Part | None = None
    """The part, if the contour came from one."""


def program_of(contour: Contour | Part, *, feed: Any, rapid_feed: Any) -> Program:
    """Return what is asked.

    Parameters
    ----------
    contour
        A part, or a contour.
    feed, rapid_feed
        As in :func:`contourlab.feedrate.plan_feed`.

    Raises
    ------
    FeedError
        No feed, a feed or a dwell that is wrong, or a feed for rapids where there are none.
    """
    if isinstance(contour, Part):
        return _of_part(contour, feed, rapid_feed)
    if rapid_feed is not None:
        raise FeedError("rapid_feed is for parts: a contour has no rapids")
    if feed is None:
        raise FeedError("feed is missing: a contour has none of its own; give it in m/s")
    n = contour.n_pieces if isinstance(contour, Path) else 1
    none = np.zeros(n)
    return Program(contour, _feeds(feed, n), np.zeros(n, bool), none, 0.0, ())


def part_warnings(part: Part) -> tuple[str, ...]:
    """Return what the user should see of how a part was read: its warnings and ignored words.

    Parameters
    ----------
    part
        As read. Line numbers (N) are labels and not listed.
    """
    words = [
        f"{word} (line {seen.line}{f', {seen.count} times' if seen.count > 1 else ''})"
        for word, seen in part.ignored.items()
        if word != "N"
    ]
    if not words:
        return tuple(part.warnings)
    return *part.warnings, f"words that do not move the tool were ignored: {', '.join(words)}"


def _of_part(part: Part, feed: Any, rapid_feed: Any) -> Program:
    n = part.path.n_pieces
    rapid = np.asarray(part.rapid, bool)
    if feed is None:
        if np.isnan(np.asarray(part.feed)[~rapid]).all() and not rapid.all():
            raise FeedError(f"feed is missing: {part.source} has none of its own; give it")
        speed = np.where(rapid, np.inf, np.asarray(part.feed, float))
    else:
        speed = np.where(rapid, np.inf, _feeds(feed, n))
    if rapid_feed is not None:
        speed = np.where(rapid, metres_per_second(rapid_feed, "rapid_feed"), speed)
    wrong = ~(speed > 0.0) | (~rapid & ~np.isfinite(speed))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise FeedError(f"{part.describe(k)}: the feed must be > 0 m/s, got {speed[k]:g}")
    dwell = np.asarray(part.dwell, float)
    before = float(part.dwell_before)
    wrong = ~(dwell >= 0.0) | ~np.isfinite(dwell)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise FeedError(f"{part.describe(k)}: the dwell after it must be >= 0 s, got {dwell[k]:g}")
    if not (np.isfinite(before) and before >= 0.0):
        raise FeedError(f"the dwell before the first piece must be >= 0 s, got {before:g}")
    return Program(part.path, speed, rapid, dwell, before, part_warnings(part), part)


def _feeds(feed: Any, n: int) -> Values:
    if isinstance(feed, str) or np.ndim(feed) == 0:
        return np.full(n, metres_per_second(feed, "feed"))
    values = np.asarray(feed, float)
    if values.shape != (n,):
        raise FeedError(
            f"feed must be one number, or one for each of {n} pieces, got shape {values.shape}"
        )
    wrong = ~(values > 0.0) | ~np.isfinite(values)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise FeedError(f"feed of piece {k} must be > 0 m/s and finite, got {values[k]:g}")
    return values
