"""How a run takes the corners of its path: overshoot, undershoot, time and contour error.

At a corner c the path arrives along t₁ and leaves along t₂ (unit tangents); θ is the angle between
them. Everything is judged on the stretch of path from a radius before the corner to a radius after
it, by where the tool's foot point is: a tool that lags is judged when it comes by, not when its
reference does.

::

       overshoot o                       undershoot u

              t₂ ^  .                           t₂ ^
                 |    .                           .|
                 |     .                         . |
                 |<-o->.                        .  |
    t₁           |    .                t₁     .  u |     u from c to the nearest
    --->-------- c . .                 --->-.----- c     point of the tool's path

*Overshoot* is the largest deviation from the path, once the foot point has reached the corner,
along m: the incoming direction t₁ where the path turns by a right angle or more; otherwise the
normal of the leg that leaves, (t₁ - cos θ t₂) / sin θ, since there t₁ itself leads along the leg.
The two agree at a right angle. Because it is the deviation (foot point to tool) that is measured,
it is zero on the path itself, whether the legs are straight or curved.

*Undershoot* is the least distance from the corner to the actual path, a cubic through the samples,
if the nearest point lies on the inside, towards t₂ - t₁; zero if the tool goes round the outside.

*Time* runs from the foot point's arrival at the stretch until it leaves it for the last time; waits
at an exact stop count. *Error* is the largest contour error on the stretch.

A tool that leaves the plane of the corner shows in the error, not in overshoot or undershoot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.joints import path_joints, piece_ends
from contourlab.contours.path import Path
from contourlab.errors import RecordingError

if TYPE_CHECKING:
    from contourlab.recordings.recording import Recording

__all__ = [
    "CORNER_FIGURES", "CORNER_RADIUS", "Corner", "CornerFigure", "CornerPass", "find_corners",
    "measure_corners", "summarise_corners",
]  # fmt: skip

CORNER_RADIUS = 1e-3
"""Length of path on either side of a corner that belongs to it [m]."""
CORNER_ANGLE = 0.01
"""Joints that turn by more are corners [rad]; as in planning the feed."""
CORNER_FIGURES = {"overshoot": "m", "undershoot": "m", "time": "s", "error_max": "m"}
"""What is measured at a corner, and its unit."""
_AT_CORNER = 1e-6
"""Foot points this share of the radius before the corner are at it."""
_FINER = 16
"""Points of the actual path for each sample next to a corner."""


@dataclass(frozen=True, eq=False)
class Corner:
    """A corner of a path."""

    parameter: float
    """Where along the path [m]."""
    position: NDArray[Any]
    """The corner point, shape (n_coordinates,) [m]."""
    incoming: NDArray[Any]
    """Unit tangent on arrival."""
    outgoing: NDArray[Any]
    """Unit tangent on leaving."""
    angle: float
    """How far the path turns, 0 to π [rad]."""
    radius: float
    """Length of path on either side that is judged with it [m]."""
    line_before: int = 0
    """Source line of the move that ends here, 0 if unknown."""
    line_after: int = 0
    """Source line of the move that begins here."""


@dataclass(frozen=True, eq=False)
class CornerPass:
    """How one run takes one corner."""

    corner: Corner
    overshoot: float
    """How far the tool goes past the corner [m]."""
    undershoot: float
    """How much of the corner is rounded off [m]."""
    time: float
    """Time on the stretch within the radius [s]; NaN if the record ends there."""
    error_max: float
    """Largest contour error on it [m]."""


@dataclass(frozen=True)
class CornerFigure:
    """One figure over all corners of a run."""

    worst: float
    median: float
    line: int
    """Source line of the move that ends at the worst corner, 0 if unknown."""


def find_corners(
    contour: Contour, *, radius: float = CORNER_RADIUS, angle: float = CORNER_ANGLE
) -> tuple[Corner, ...]:
    """Return the corners of a path, in order; none of a formula curve, which has no joints.

    Parameters
    ----------
    contour
        A contour.
    radius
        Length of path on either side of a corner that belongs to it, > 0 [m]; less where the next
        corner or the end of the path is nearer than twice that.
    angle
        Joints that turn by more are corners [rad].

    Raises
    ------
    RecordingError
        A radius that is not finite and > 0.
    """
    if not (np.isfinite(radius) and radius > 0.0):
        raise RecordingError(f"radius must be finite and > 0 m, got {radius!r}")
    if not isinstance(contour, Path):
        return ()
    joints = path_joints(contour)
    sharp = np.flatnonzero(joints.turning_angle > angle)
    if not len(sharp):
        return ()
    point, incoming, _ = piece_ends(contour, at_end=True)
    _, leaving, _ = piece_ends(contour, at_end=False)
    at = np.asarray(joints.parameter)[sharp]
    start, end = (float(bound) for bound in contour.domain)
    before, after = np.diff(at, prepend=start), np.diff(at, append=end)
    if contour.closed:  # over the seam
        before[0] = after[-1] = at[0] - start + end - at[-1]
        if len(sharp) == 1:
            before[0] = after[0] = end - start
    room = 0.5 * np.minimum(before, after)
    n = contour.n_pieces
    return tuple(
        Corner(
            parameter=float(at[k]), position=point[joint], incoming=incoming[joint],
            outgoing=leaving[(joint + 1) % n], angle=float(joints.turning_angle[joint]),
            radius=float(min(radius, room[k])), line_before=int(joints.line_before[joint]),
            line_after=int(joints.line_after[joint]),
        )
        for k, joint in enumerate(sharp)
    )  # fmt: skip


def measure_corners(
    recording: Recording, corners: Sequence[Corner], *, period: float | None = None
) -> tuple[CornerPass, ...]:
    """Return how a run takes each corner that its reference goes through, in order of time.

    Definitions at the head of :mod:`contourlab.recordings.corners`.

    Parameters
    ----------
    recording
        With ``tool``, ``contour_error_vector``, ``foot_parameter`` and ``reference_parameter``. A
        run that diverged has no figures: none is returned.
    corners
        Of its contour.
    period
        Length of a closed contour, so that the corners of every lap are found [m].

    Raises
    ------
    RecordingError
        The recording lacks one of these.
    """
    if recording.diverged or not corners:
        return ()
    time = np.asarray(recording["time"], float)
    tool = np.asarray(recording["tool"], float)
    away = -np.asarray(recording["contour_error_vector"], float)
    asked = np.asarray(recording["reference_parameter"], float)
    foot = np.asarray(recording["foot_parameter"], float)
    if period is not None:  # a foot point belongs to the lap of its reference
        foot = foot + period * np.round((asked - foot) / period)
    record = _Record(time, tool, away, foot)
    first, last = float(asked.min()), float(asked.max())
    found = []
    for corner in corners:
        laps = [0.0]
        if period is not None:
            low = np.ceil((first - corner.parameter) / period)
            high = np.floor((last - corner.parameter) / period)
            laps = list(period * np.arange(low, high + 1.0))
        # one at which the reference only begins or ends is not taken
        found += [
            (corner.parameter + lap, corner)
            for lap in laps
            if first + 1e-9 < corner.parameter + lap < last - 1e-9
        ]
    return tuple(record.taken(at, corner) for at, corner in sorted(found, key=lambda f: f[0]))


class _Record:
    """A run's arrays, with what finds a stretch of path in them without reading all."""

    def __init__(
        self, time: NDArray[Any], tool: NDArray[Any], away: NDArray[Any], foot: NDArray[Any]
    ) -> None:
        self.time, self.tool, self.away, self.foot = time, tool, away, foot
        self.reached = np.maximum.accumulate(foot)
        self.ahead = np.minimum.accumulate(foot[::-1])[::-1]

    def taken(self, at: float, corner: Corner) -> CornerPass:
        low, high = at - corner.radius, at + corner.radius
        # from the last row before the stretch to the first after it for good
        begin = max(int(np.searchsorted(self.reached, low, side="right")) - 1, 0)
        end = min(int(np.searchsorted(self.ahead, high, side="left")), len(self.foot) - 1)
        rows = slice(begin, end + 1)
        foot, away = self.foot[rows], self.away[rows]
        inside = np.abs(foot - at) <= corner.radius
        if not inside.any():  # so fast that no sample falls in the stretch
            inside = np.ones(len(foot), bool)
        past = inside & (foot >= at - _AT_CORNER * corner.radius)
        overshoot = float(np.max(away[past] @ _beyond(corner), initial=0.0))
        return CornerPass(
            corner=corner,
            overshoot=overshoot,
            undershoot=_undershoot(self.tool[rows], corner),
            time=self._crossed(end, high) - self._crossed(begin + 1, low),
            error_max=float(np.max(np.linalg.norm(away[inside], axis=1))),
        )

    def _crossed(self, row: int, value: float) -> float:
        """Return when the foot point crosses a parameter just before a row."""
        row = min(max(row, 1), len(self.foot) - 1)
        a, b = self.foot[row - 1], self.foot[row]
        if not min(a, b) <= value <= max(a, b):
            return float("nan")
        share = 1.0 if a == b else (value - a) / (b - a)
        return float(self.time[row - 1] + share * (self.time[row] - self.time[row - 1]))


def _beyond(corner: Corner) -> NDArray[Any]:
    """Return the direction in which a tool that goes past the corner leaves the path."""
    along = float(corner.incoming @ corner.outgoing)
    if along <= 0.0:
        return corner.incoming
    normal = corner.incoming - along * corner.outgoing
    return normal / np.linalg.norm(normal)


def _undershoot(tool: NDArray[Any], corner: Corner) -> float:
    nearest = int(np.argmin(np.linalg.norm(tool - corner.position, axis=1)))
    near = _between(tool[max(nearest - 2, 0) : nearest + 3])
    start, step = near[:-1] - corner.position, np.diff(near, axis=0)
    squared = np.sum(step * step, axis=1)
    share = -np.sum(start * step, axis=1) / np.where(squared > 0.0, squared, 1.0)
    points = start + np.clip(share, 0.0, 1.0)[:, None] * step
    distance = np.linalg.norm(points, axis=1)
    nearest = int(np.argmin(distance))
    inwards = corner.outgoing - corner.incoming
    return float(distance[nearest]) if points[nearest] @ inwards > 0.0 else 0.0


def _between(points: NDArray[Any]) -> NDArray[Any]:
    """Return a cubic through samples, finely.

    A chord would cut a tool that turns with acceleration a short by a Δt² / 8: a micrometre at
    10 m/s² and 1 ms.
    """
    if len(points) < 3:
        return points
    slope = np.gradient(points, axis=0)
    at = np.linspace(0.0, 1.0, _FINER, endpoint=False)[:, None, None]
    a, b, u, v = points[:-1], points[1:], slope[:-1], slope[1:]
    curve = (
        a + (b - a) * at**2 * (3.0 - 2.0 * at)
        + u * at * (1.0 - at) ** 2 - v * at**2 * (1.0 - at)
    )  # fmt: skip
    curve = np.swapaxes(curve, 0, 1).reshape(-1, points.shape[1])
    return np.concatenate([curve, points[-1:]])


def summarise_corners(passes: Sequence[CornerPass]) -> dict[str, CornerFigure]:
    """Return worst and median of every figure over the corners of a run, with the worst's line.

    Parameters
    ----------
    passes
        As ``measure_corners`` returned them; an empty one gives an empty result.
    """
    figures = {}
    for name in CORNER_FIGURES:
        values = np.array([getattr(one, name) for one in passes], float)
        known = np.flatnonzero(np.isfinite(values))
        if len(known):
            worst = int(known[np.argmax(values[known])])
            figures[name] = CornerFigure(
                float(values[worst]), float(np.median(values[known])),
                passes[worst].corner.line_before,
            )  # fmt: skip
    return figures
