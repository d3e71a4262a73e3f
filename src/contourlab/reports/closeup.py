"""The neighbourhood of a run's worst point at true scale: path, reference and actual paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from contourlab.reports.decimation import shape_rows
from contourlab.reports.drawing import Drawing, Run, contour_points

__all__ = ["Closeup", "closeup"]

TRACK_POINTS = 500
SMALLEST_HALF = 3.0
LARGEST_HALF = 8.0
"""Half of the window's side, in contour errors; between the two the reference point is shown."""


@dataclass(frozen=True, eq=False)
class Closeup:
    """A square window about the foot point of the worst sample [m]; its centre is (0, 0)."""

    half: float
    axes: tuple[str, str]
    """What the two directions of the window are."""
    path: Float[np.ndarray, "n 2"]
    tracks: dict[str, Float[np.ndarray, "_ 2"]]
    """Actual paths of the controllers that come by, by name."""
    actual: Float[np.ndarray, " 2"]
    """Where the tool was at the worst instant."""
    reference: Float[np.ndarray, " 2"]
    """Where it should have been at that instant; may lie outside."""
    lag: float
    """Distance from the tool to its reference point [m]."""


def closeup(drawing: Drawing, run: Run) -> Closeup | None:
    """Return the neighbourhood of a run's worst point; None if it diverged or has no error.

    In the plane the window's directions are the axes; in space, along the path and from the path
    to the tool.

    Parameters
    ----------
    drawing
        The comparison.
    run
        One of its runs.
    """
    if run.worst is None or drawing.shown == 1:
        return None
    size = float(np.linalg.norm(run.vector[run.worst]))
    if not (np.isfinite(size) and size > 0.0):
        return None
    contour = drawing.comparison.reference.contour
    centre = run.foot[run.worst]
    parameter = float(run.recording["reference_parameter"][run.worst])
    wanted = contour_points(contour, [parameter])[0] - centre
    actual = -run.vector[run.worst]
    lag = float(np.linalg.norm(wanted - actual))
    half = float(np.clip(1.2 * lag, SMALLEST_HALF * size, LARGEST_HALF * size))
    around = run.distance[run.worst] + np.linspace(-3.0 * half, 3.0 * half, 601)
    parameters = np.asarray(drawing.parameter(around))
    if not contour.closed:
        start, end = contour.domain
        parameters = np.clip(parameters, float(start), float(end))
    breaks = np.asarray(getattr(contour, "breaks", np.zeros(0)), float)
    inside = breaks[(breaks > parameters[0]) & (breaks < parameters[-1])]
    parameters = np.unique(np.concatenate([parameters, inside[:TRACK_POINTS]]))
    path = contour_points(contour, parameters) - centre
    basis, axes = _directions(drawing, path, actual)
    tracks = {
        other.name: _nearby(other, centre, run.distance[run.worst], 3.0 * half) @ basis.T
        for other in drawing.runs
    }
    return Closeup(
        half=half, axes=axes, path=path @ basis.T,
        tracks={name: track for name, track in tracks.items() if len(track) > 1},
        actual=basis @ actual, reference=basis @ wanted, lag=lag,
    )  # fmt: skip


def _directions(
    drawing: Drawing, path: np.ndarray, actual: np.ndarray
) -> tuple[np.ndarray, tuple[str, str]]:
    if len(drawing.coordinates) == 2:
        return np.eye(2), (drawing.coordinates[0], drawing.coordinates[1])
    near = int(np.argmin(np.linalg.norm(path, axis=1)))
    tangent = path[min(near + 1, len(path) - 1)] - path[max(near - 1, 0)]
    length = float(np.linalg.norm(tangent))
    tangent = tangent / length if length > 0.0 else np.eye(len(actual))[0]
    across = actual - tangent * (tangent @ actual)
    return np.stack([tangent, across / np.linalg.norm(across)]), ("along the path", "off the path")


def _nearby(run: Run, centre: np.ndarray, distance: float, reach: float) -> np.ndarray:
    """Return the stretch of a run's actual path that passes a point, relative to it."""
    tool = run.foot - run.vector - centre
    inside = np.max(np.abs(tool), axis=1) <= reach
    # the pass that is meant: of all rows inside, the one whose foot point is nearest along the path
    rows = np.flatnonzero(inside)
    if not len(rows):
        return np.zeros((0, len(centre)))
    at = rows[int(np.argmin(np.abs(run.distance[rows] - distance)))]
    outside = np.flatnonzero(~inside)
    before, after = outside[outside < at], outside[outside > at]
    first = int(before[-1]) if len(before) else 0
    last = int(after[0]) + 1 if len(after) else len(tool)
    track = tool[first:last]
    return track[shape_rows(track, TRACK_POINTS)]  # type: ignore[no-any-return]
