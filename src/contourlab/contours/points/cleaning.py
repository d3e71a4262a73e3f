"""What is wrong with points as they come, mended or said: repeats, gaps, turns back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import PartError
from contourlab.units import to_um

__all__ = ["Cleaning", "cleaned"]

GAP = 20.0
"""A step this many times the median step is said to be a gap."""
TURN_BACK = np.deg2rad(150.0)
"""A turn by more than this is said to be a turn back [rad]."""

Rows = NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class Cleaning:
    """What was left out of the points, and how they lie; lines are counted from 1."""

    points_read: int
    points_kept: int
    repeated: int
    """Points equal to the one before, left out."""
    first_repeated: int
    """Line of the first of them, 0 if there is none."""
    near: int
    """Points nearer than ``spacing`` to the last one kept, left out."""
    first_near: int
    spacing: float
    """Least distance between neighbours that was asked for [m]."""
    smallest_step: float
    """Distance between neighbours that were kept [m]: smallest, median, largest."""
    median_step: float
    largest_step: float
    gap_line: int
    """Line before the largest step, if it is more than 20 median steps; else 0."""
    turns_back: int
    """Points at which the polyline turns by more than 150°."""
    first_turn_back: int

    def sentences(self) -> tuple[str, ...]:
        """Return what a user should see, one sentence each."""
        said = []
        if self.repeated:
            said.append(
                f"{self.repeated} of {self.points_read} points repeat the one before and are left "
                f"out, the first in line {self.first_repeated}"
            )
        if self.near:
            said.append(
                f"{self.near} of {self.points_read} points are nearer than "
                f"{to_um(self.spacing)} um to the one before and are left out, the first in line "
                f"{self.first_near}"
            )
        if self.gap_line:
            said.append(
                f"the step after line {self.gap_line} is {to_um(self.largest_step)} um, and the "
                f"median step {to_um(self.median_step)} um: points may be missing"
            )
        if self.turns_back:
            said.append(
                f"the points turn back by more than 150 degrees at {self.turns_back} places, "
                f"the first in line {self.first_turn_back}"
            )
        return tuple(said)


def cleaned(points: Rows, line: Rows, spacing: float, name: str) -> tuple[Rows, Rows, Cleaning]:
    """Return the points that are kept, their lines, and what was left out.

    The first and the last point stay where they are.

    Parameters
    ----------
    points
        Shape (n_points, n_axes) [m], finite.
    line
        Of each.
    spacing
        Least distance between neighbours [m].
    name
        Of the file, for messages.

    Raises
    ------
    PartError
        Fewer than two points are left.
    """
    count = len(points)
    repeated = np.zeros(count, bool)
    repeated[1:] = np.all(points[1:] == points[:-1], axis=1)
    again = line[repeated]
    points, line = points[~repeated], line[~repeated]
    keep = np.ones(len(points), bool)
    if len(points) > 1 and np.min(np.linalg.norm(np.diff(points, axis=0), axis=1)) < spacing:
        keep = _spaced(points, spacing)
    near = line[~keep]
    points, line = points[keep], line[keep]
    if len(points) < 2:
        raise PartError(f"{name}: all points are one, within {spacing:.3g} m: there is no path")
    steps = np.diff(points, axis=0)
    distance = np.linalg.norm(steps, axis=1)
    median = float(np.median(distance))
    largest = int(np.argmax(distance))
    direction = steps / distance[:, None]
    back = np.sum(direction[1:] * direction[:-1], axis=1) < np.cos(TURN_BACK)
    turned = line[1:-1][back]
    return points, line, Cleaning(
        points_read=count,
        points_kept=len(points),
        repeated=len(again),
        first_repeated=int(again[0]) if len(again) else 0,
        near=len(near),
        first_near=int(near[0]) if len(near) else 0,
        spacing=spacing,
        smallest_step=float(distance.min()),
        median_step=median,
        largest_step=float(distance[largest]),
        gap_line=int(line[largest]) if distance[largest] > GAP * median else 0,
        turns_back=len(turned),
        first_turn_back=int(turned[0]) if len(turned) else 0,
    )  # fmt: skip


def _spaced(points: Rows, spacing: float) -> NDArray[np.bool_]:
    """Return which points are kept so that neighbours are at least this far apart."""
    keep = np.zeros(len(points), bool)
    keep[0] = True
    last, squared = points[0].tolist(), spacing * spacing
    kept = [0]
    for k, point in enumerate(points.tolist()):
        if k and sum((a - b) ** 2 for a, b in zip(point, last, strict=True)) >= squared:
            kept.append(k)
            last = point
    if kept[-1] != len(points) - 1:  # the end stays, and what is too near before it goes
        end = points[-1]
        while len(kept) > 1 and np.sum((points[kept[-1]] - end) ** 2) < squared:
            kept.pop()
        if np.any(points[kept[-1]] != end):
            kept.append(len(points) - 1)
    keep[kept] = True
    return keep
