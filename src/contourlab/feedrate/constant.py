"""Motions of constant rate: of the parameter, or of the path itself.

Both start with a velocity step, as the papers do: the first sample has full velocity already. A
machine that must not be asked that gets :func:`~contourlab.feedrate.programmed_feed`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.path import Path
from contourlab.errors import FeedError
from contourlab.feedrate.arc_length import ArcLength
from contourlab.feedrate.limits import metres_per_second, positive, sample_count
from contourlab.recordings.reference import Reference

__all__ = ["constant_feed", "constant_rate"]

_SLACK = 1e-9
"""Fraction of a sample by which a duration may miss a sampling instant and still be on it."""

STEP = "the reference starts with a velocity step: its first sample moves already"


def constant_rate(
    contour: Contour,
    *,
    rate: float,
    duration: float,
    sample_time: float,
    start: float | None = None,
) -> Reference:
    """Return a reference whose contour parameter grows at a constant rate.

    It starts with a velocity step. A closed contour goes round; on an open one the motion ends
    where the domain ends, and the rest of the record is at rest there (a second velocity step).

    Parameters
    ----------
    contour
        Where.
    rate
        Parameter per second, not 0; negative runs backwards.
    duration
        Length of the record, > 0 [s]; samples at 0, sample_time, ... up to it.
    sample_time
        Time between samples, > 0 [s].
    start
        Parameter at time 0; the start of the domain (its end if the rate is negative) if None.

    Raises
    ------
    FeedError
        A rate of 0 or not finite, a duration shorter than one sample, a start outside the domain
        of an open contour.
    """
    rate = float(rate)
    if not (np.isfinite(rate) and rate != 0.0):
        raise FeedError(f"rate must be finite and not 0 per second, got {rate:g}")
    time = sample_times(duration, sample_time)
    low, high = (float(np.asarray(x)) for x in contour.domain)
    begin = (low if rate > 0 else high) if start is None else float(start)
    if not np.isfinite(begin) or (not contour.closed and not low <= begin <= high):
        raise FeedError(f"start must be within the domain {low:g} to {high:g}, got {begin:g}")
    parameter = begin + rate * time
    moving = np.ones(len(time), bool)
    if not contour.closed:
        last = high if rate > 0 else low
        moving = parameter < last if rate > 0 else parameter > last
        parameter = np.where(moving, parameter, last)
    zero = np.zeros_like(time)
    said = (STEP, *_corners(contour, parameter), *_ended(moving, time))
    return Reference.along(
        contour, sample_time=float(sample_time), parameter=parameter,
        parameter_rate=np.where(moving, rate, 0.0), parameter_acceleration=zero,
        parameter_jerk=zero,
        warnings=said, motion_warnings=said,
    )  # fmt: skip


def constant_feed(
    contour: Contour, *, feed: float | str, sample_time: float, duration: float | None = None
) -> Reference:
    """Return a reference that runs along the contour at constant speed.

    The parameter follows from the exact inversion of arc length, to 1e-12 of the length. It starts
    with a velocity step; axis limits are not looked at.

    Parameters
    ----------
    contour
        Where; from the start of its domain.
    feed
        Speed along the path: a number in m/s, or a text with its unit such as "3000 mm/min".
    sample_time
        Time between samples, > 0 [s].
    duration
        Length of the record, > 0 [s]. A closed contour goes round as often as it takes, on an open
        one the record is at rest after the end. None: once along the whole contour.

    Raises
    ------
    FeedError
        A feed that is not > 0, a duration shorter than one sample, a contour without length or
        with a cusp.
    """
    speed = metres_per_second(feed, "feed")
    table = ArcLength(contour)
    once = duration is None
    dt = positive(sample_time, "sample_time", "s")
    if duration is None:
        samples = max(1, sample_count(np.ceil(table.length / speed / dt - _SLACK), dt))
        time = dt * np.arange(samples + 1)
    else:
        time = sample_times(duration, dt)
    arc = speed * time
    moving = np.ones(len(time), bool)
    if once or not contour.closed:
        moving = arc < table.length * (1.0 - 1e-15)
        arc = np.where(moving, arc, table.length)
    zero = np.zeros_like(time)
    profile = table.time_derivatives(arc, np.where(moving, speed, 0.0), zero, zero)
    said = (STEP, *_corners(contour, profile[0]), *_ended(moving, time))
    return Reference.along(
        contour, sample_time=dt, parameter=profile[0], parameter_rate=profile[1],
        parameter_acceleration=profile[2], parameter_jerk=profile[3],
        warnings=said, motion_warnings=said,
    )  # fmt: skip


def sample_times(duration: Any, sample_time: Any) -> NDArray[Any]:
    """Return the sampling instants from 0 up to a duration [s].

    Parameters
    ----------
    duration, sample_time
        Both > 0 [s].

    Raises
    ------
    FeedError
        Not > 0, not finite, or a duration of less than one sample.
    """
    dt = positive(sample_time, "sample_time", "s")
    total = positive(duration, "duration", "s")
    count = sample_count(np.floor(total / dt * (1.0 + 1e-12) + _SLACK), dt)
    if count < 1:
        raise FeedError(f"duration must be >= sample_time = {dt:g} s, got {total:g}")
    return dt * np.arange(count + 1)


def _corners(contour: Contour, parameter: NDArray[Any]) -> tuple[str, ...]:
    """Return a warning of the corners of a path that the motion passes."""
    if not isinstance(contour, Path):
        return ()
    at = contour.joints().parameter[contour.corners()]
    low, high = float(parameter.min()), float(parameter.max())
    if contour.closed:
        period = float(np.asarray(contour.breaks)[-1])
        passed = np.ceil((high - at) / period) - 1.0 > np.floor((low - at) / period)
    else:
        passed = (low < at) & (at < high)
    count = int(passed.sum())
    if not count:
        return ()
    places = f"{count} corners" if count > 1 else "a corner"
    return (f"the path turns at {places}: the velocity of the reference jumps there",)


def _ended(moving: NDArray[Any], time: NDArray[Any]) -> tuple[str, ...]:
    if moving.all():
        return ()
    at = time[int(np.argmin(moving))]
    return (f"the contour ends at or before {at:.6g} s: a velocity step down to rest",)
