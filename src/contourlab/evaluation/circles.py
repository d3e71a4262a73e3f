"""The circular test of ISO 230-4 in a log: found, and evaluated.

A circle is found in the commanded positions: a stretch whose heading turns evenly with the way, by
a full turn or more. Of each direction 360° are taken from the middle of the stretch, so that the
run-in and the run-out, in which the feed changes, are left out.

    G      circular deviation: least separation of two concentric circles about the actual path
    G(b)   the same about both directions together
    F      radial deviation from the nominal circle about the least squares centre, greatest and
           least
    D      mean bidirectional radial deviation: radius of the least squares circle of both
           directions, minus the nominal radius

Positions of encoders may stand for those of an instrument; what lies beyond the encoder is then not
in the figures, and the result says so.

References
----------
.. [ISO230-4] definitions of G, G(b), F and D; the standard itself was not at hand, so clause
   numbers are not given.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.errors import RecordingError
from contourlab.logs.log import Log
from contourlab.recordings.circular import (
    bidirectional_deviation,
    circular_deviation,
    least_squares_circle,
    radial_deviations,
)

__all__ = ["CircularTest", "Direction", "find_circular_test"]

POINTS = 3000
"""Points along the way at which the heading is looked at."""
EVEN = 0.15
"""Share by which the curvature of a circle may differ from place to place."""
FULL = np.deg2rad(350.0)
SAME = 0.01
"""Share of the radius by which the circles of both directions may differ."""
BINS = 1440
NAMES = {1: "counter-clockwise", -1: "clockwise"}

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Direction:
    """One direction of a circular test."""

    name: str
    """``clockwise`` or ``counter-clockwise``, seen with the first axis to the right."""
    deviation: float
    """G [m]."""
    radial_max: float
    """Greatest F [m]."""
    radial_min: float
    """Least F [m]."""
    centre_offset: tuple[float, float]
    """Least squares centre of the actual path minus the nominal one [m]."""
    radius: float
    """Of the least squares circle [m]."""
    feed: float
    """Mean speed along the circle [m/s]; NaN if the log has no time."""
    start: float
    """Angle at which the 360° begin [rad]."""
    angle: Float[np.ndarray, " n_points"] = field(repr=False)
    """Of the points that are drawn, in the order of travel [rad]."""
    radial: Float[np.ndarray, " n_points"] = field(repr=False)
    """Their radial deviations about the least squares centre [m]."""


@dataclass(frozen=True, eq=False)
class CircularTest:
    """A circular test, of one direction or both."""

    axes: tuple[str, str]
    radius: float
    """Nominal [m]; that of the least squares circle if there are no commands."""
    centre: tuple[float, float]
    """Nominal [m]."""
    nominal_known: bool
    """Whether the commanded circle is in the log."""
    directions: tuple[Direction, ...]
    bidirectional: float | None
    """G(b) [m]; None with one direction."""
    mean_radial: float | None
    """D [m]; None with one direction or without a nominal radius."""
    warnings: tuple[str, ...] = ()
    half_width: float = 0.0
    """By which one radial deviation may be off by the log's grid [m]; G, of two, by twice that."""

    def json(self) -> dict[str, Any]:
        """Return the figures for JSON, SI."""
        return {
            "axes": list(self.axes), "radius": self.radius, "centre": list(self.centre),
            "bidirectional_deviation": self.bidirectional,
            "mean_bidirectional_radial_deviation": self.mean_radial,
            "radial_half_width": self.half_width,
            "directions": [
                {
                    "direction": one.name, "circular_deviation": one.deviation,
                    "radial_deviation_max": one.radial_max, "radial_deviation_min": one.radial_min,
                    "centre_offset": list(one.centre_offset), "radius": one.radius,
                    "feed": one.feed if np.isfinite(one.feed) else None,
                }
                for one in self.directions
            ],
        }  # fmt: skip


def find_circular_test(log: Log, left_out: Values, measured: str | None) -> CircularTest | None:
    """Return the circular test in a log, None if it holds no full circle.

    Parameters
    ----------
    log
        The log.
    left_out
        Which rows do not count.
    measured
        Where the position was measured, see :func:`~contourlab.evaluation.evaluate`.
    """
    leading = log.actual if log.commanded is None else log.commanded
    spans = np.ptp(leading, axis=0)
    pair = np.sort(np.argsort(spans)[-2:])
    if spans[pair].min() <= 0.0:
        return None
    rows = np.flatnonzero(~left_out)
    points = leading[rows][:, pair]
    circles = _circles(points)
    if not circles:
        return None
    largest = max(circles, key=lambda c: c[1] - c[0])
    centre, radius = largest[3], largest[4]
    chosen: dict[int, tuple[int, int]] = {largest[2]: (largest[0], largest[1])}
    pace = _pace(points, *chosen[largest[2]])
    for first, last, sign, own, size in circles:
        alike = np.hypot(*(np.subtract(own, centre))) < SAME * radius
        if alike and abs(size - radius) < SAME * radius and sign != largest[2]:
            # back at the feed that is nearest
            before = chosen.get(sign)
            off = abs(_pace(points, first, last) - pace)
            if before is None or off < abs(_pace(points, *before) - pace):
                chosen[sign] = (first, last)
    both = np.concatenate([points[a:b] for a, b in chosen.values()])
    centre, radius = least_squares_circle(_even(both, np.asarray(centre)))
    try:
        found = {
            sign: _direction(log, rows, pair, a, b, sign, centre, radius, points)
            for sign, (a, b) in chosen.items()
        }
        directions = [one for _, one in sorted(found.items(), reverse=True) if one is not None]
        if not directions:
            return None
        return _test(log, pair, directions, centre, radius, measured)
    except RecordingError:
        return None  # the actual path is no circle although the commanded one is: nothing to say


def _circles(points: Values) -> list[tuple[int, int, int, tuple[float, float], float]]:
    """Return stretches of a motion that are circles: rows, direction, centre, radius."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    found = []
    for a, b in _motions(step):
        for first, last, sign, centre, radius in _circles_of(points[a:b], step[a : b - 1]):
            found.append((a + first, a + last, sign, centre, radius))
    return found


def _motions(step: Values) -> list[tuple[int, int]]:
    """Return the stretches of rows between rests of five samples or more."""
    still = np.concatenate([[False], step <= 0.0, [False]])
    edges = np.flatnonzero(np.diff(still.astype(np.int8)))
    rests = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 5]
    starts = [0, *(b for _, b in rests)]
    ends = [*(a + 1 for a, _ in rests), len(step) + 1]
    return [(a, b) for a, b in zip(starts, ends, strict=True) if b - a >= 40]


def _circles_of(
    points: Values, step: Values
) -> list[tuple[int, int, int, tuple[float, float], float]]:
    """Return the circles of a motion without a rest."""
    way = np.concatenate([[0.0], np.cumsum(step)])
    if way[-1] <= 0.0 or len(points) < 40:
        return []
    count = min(POINTS, len(points))
    at = np.linspace(0.0, way[-1], count)
    moving = np.concatenate([[True], step > 0.0])
    even = np.column_stack([np.interp(at, way[moving], column[moving]) for column in points.T])
    reach = max(count // 250, 2)
    chord = even[reach:] - even[:-reach]
    heading = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
    place = at[: len(heading)] + 0.5 * reach * (at[1] - at[0])
    curvature = (heading[reach:] - heading[:-reach]) / (reach * (at[1] - at[0]))
    found = []
    turned = np.sign(curvature)
    for sign in (1, -1):
        # stretches that turn one way all along
        flags = np.concatenate([[0], (turned == sign).astype(np.int8), [0]])
        edges = np.flatnonzero(np.diff(flags))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            own = curvature[a:b]
            usual = float(np.median(own))
            fits = np.abs(own - usual) < EVEN * abs(usual)
            inner = np.flatnonzero(fits)
            if len(inner) < 8 or fits.mean() < 0.5:
                continue
            low, high = a + inner[0], a + inner[-1]
            start, stop = place[low], place[min(high + reach, len(place) - 1)]
            first, last = np.searchsorted(way, [start, stop])
            if last - first < 20:
                continue
            try:
                centre, radius = least_squares_circle(points[first:last])
            except RecordingError:
                continue
            off = np.abs(np.linalg.norm(points[first:last] - centre, axis=1) - radius)
            angle = _angles(points[first:last], centre)
            if off.max() < 0.02 * radius and abs(angle[-1] - angle[0]) >= FULL:
                found.append((int(first), int(last), sign, centre, radius))
    return found


def _pace(points: Values, first: int, last: int) -> float:
    """Return the mean way from sample to sample."""
    return float(np.linalg.norm(np.diff(points[first:last], axis=0), axis=1).mean())


def _angles(points: Values, centre: Any) -> Values:
    away = points - np.asarray(centre)
    return np.unwrap(np.arctan2(away[:, 1], away[:, 0]))


def _even(points: Values, centre: Values) -> Values:
    """Return points with no more in one sector than in another."""
    angle = np.mod(_angles(points, centre), 2.0 * np.pi)
    order = np.argsort(angle)
    return points[order][:: max(1, len(points) // 4000)]


def _direction(
    log: Log, rows: Values, pair: Values, first: int, last: int, sign: int, centre: Any,
    radius: float, points: Values,
) -> Direction | None:  # fmt: skip
    angle = _angles(points[first:last], centre)
    turned = abs(angle[-1] - angle[0])
    if turned < FULL:
        return None
    middle = 0.5 * (angle[0] + angle[-1])
    inside = np.abs(angle - middle) <= np.pi + 1e-12
    own = rows[first:last][inside]
    actual = log.actual[own][:, pair]
    few = _extremes(actual, np.asarray(centre))
    middle_of, size = least_squares_circle(_even(actual, np.asarray(centre)))
    high, low = radial_deviations(actual, radius, middle_of)
    away = few - np.asarray(middle_of)
    feed = float("nan")
    if log.timed:
        feed = float(
            radius
            * abs(angle[inside][-1] - angle[inside][0])
            / (log.time[own[-1]] - log.time[own[0]])
        )
    return Direction(
        name=NAMES[sign], deviation=circular_deviation(few).deviation, radial_max=high,
        radial_min=low, centre_offset=tuple(np.subtract(middle_of, centre).tolist()), radius=size,
        feed=feed, start=float(np.mod(angle[inside][0], 2.0 * np.pi)),
        angle=np.arctan2(away[:, 1], away[:, 0]), radial=np.linalg.norm(away, axis=1) - radius,
    )  # fmt: skip


def _extremes(points: Values, centre: Values) -> Values:
    """Return, in order, the points farthest from and nearest to a centre in every sector."""
    if len(points) <= 2 * BINS:
        return points
    angle = _angles(points, centre)
    span = max(float(np.ptp(angle)), 1e-12)
    sector = np.minimum((np.abs(angle - angle[0]) / span * BINS).astype(int), BINS - 1)
    distance = np.linalg.norm(points - centre, axis=1)
    order = np.lexsort((distance, sector))
    edges = np.flatnonzero(np.diff(sector[order]))
    least = order[np.concatenate([[0], edges + 1])]
    most = order[np.concatenate([edges, [len(order) - 1]])]
    kept: Values = points[np.unique(np.concatenate([least, most]))]
    return kept


def _test(
    log: Log, pair: Values, directions: list[Direction], centre: Any, radius: float,
    measured: str | None,
) -> CircularTest:  # fmt: skip
    axes = (log.axes[int(pair[0])], log.axes[int(pair[1])])
    known = log.commanded is not None
    paths = [
        np.column_stack([np.cos(one.angle), np.sin(one.angle)]) * (radius + one.radial)[:, None]
        + np.asarray(one.centre_offset)
        for one in directions
    ]
    both = mean = None
    said = []
    if len(directions) == 2:
        both = bidirectional_deviation(paths[1], paths[0]).deviation
        if known:
            # a circle through both: of equal weight, whatever their sampling
            mean = 0.5 * (directions[0].radius + directions[1].radius) - radius
    else:
        said.append(
            f"the log holds the {axes[0]}-{axes[1]} circle in the {directions[0].name} direction "
            "only: bidirectional deviations need both"
        )
    if not known:
        said.append("the circle's nominal radius is not in the log: F and D rest on a fitted one")
    if measured != "tool":
        said.append(
            "the circular test is of feedback signals: what lies between encoder and tool, such as "
            + ("squareness" if measured == "scale" else "backlash, pitch and squareness")
            + ", is not in it"
            + ("" if measured else ", unless the position was measured at the tool")
        )
    return CircularTest(
        axes=axes, radius=radius, centre=(float(centre[0]), float(centre[1])), nominal_known=known,
        directions=tuple(directions), bidirectional=both, mean_radial=mean, warnings=tuple(said),
    )  # fmt: skip
