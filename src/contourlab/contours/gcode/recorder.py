"""Collects moves row by row in flat buffers, and hands them out as arrays once."""

from __future__ import annotations

import math
from array import array
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.part import Moves

__all__ = ["MoveRecorder", "Place"]

_NO_CENTER = (math.nan, math.nan, math.nan)
_STRAIGHT = -1

Point = tuple[float, float, float]


class Place(NamedTuple):
    """Where in the files of a program a piece comes from."""

    line: int
    """Line of the program itself; of the call, if the piece comes from another file."""
    file: int = 0
    """Number of the file, 0 for the program."""
    file_line: int = 0
    """Line in that file."""


class MoveRecorder:
    """Rows of :class:`Moves` in the making: 24 numbers a piece, no object a piece."""

    def __init__(self) -> None:
        self._points = array("d")
        self._scalars = array("d")
        self._integers = array("i")
        self._splines: list[NDArray[Any]] = []
        self._normals: dict[int, Point] = {}
        self._dwell: list[tuple[int, float]] = []

    def __len__(self) -> int:
        return len(self._integers) // 5

    def line(
        self, start: Point, end: Point, normal: int, place: Place, feed: float, blend: float,
        merge: float,
    ) -> None:  # fmt: skip
        """Add a line; a NaN feed is a rapid."""
        self._points.extend((*start, *end, *_NO_CENTER))
        self._scalars.extend((0.0, feed, blend, merge))
        self._integers.extend((*place, normal, _STRAIGHT))

    def arc(
        self, start: Point, end: Point, center: Point, normal: int, angle: float,
        place: Place, feed: float, blend: float, merge: float, tilted: Point | None = None,
    ) -> None:  # fmt: skip
        """Add an arc; ``normal`` is the axis that is normal to its plane, unless it is tilted."""
        if tilted is not None:
            self._normals[len(self)] = tilted
        self._points.extend((*start, *end, *center))
        self._scalars.extend((angle, feed, blend, merge))
        self._integers.extend((*place, normal, _STRAIGHT))

    def spline(
        self, start: Point, end: Point, control: NDArray[Any], place: Place, feed: float,
        blend: float, merge: float,
    ) -> None:  # fmt: skip
        """Add a rational Bézier curve, homogeneous control points of shape (n, 4)."""
        self._points.extend((*start, *end, *_NO_CENTER))
        self._scalars.extend((0.0, feed, blend, merge))
        self._integers.extend((*place, 2, len(self._splines)))
        self._splines.append(control)

    def dwell(self, seconds: float) -> None:
        """Add waiting after the last piece, or before the first."""
        self._dwell.append((len(self) - 1, seconds))

    def moves(self) -> Moves:
        """Return everything recorded."""
        n = len(self)
        points = np.array(self._points, dtype=float).reshape(n, 9)
        scalars = np.array(self._scalars, dtype=float).reshape(n, 4)
        integers = np.array(self._integers, dtype=np.int32).reshape(n, 5)
        dwell = np.zeros(n + 1)
        for piece, seconds in self._dwell:
            dwell[piece + 1] += seconds
        normal = np.eye(3)[integers[:, 3]]
        for piece, tilted in self._normals.items():
            normal[piece] = tilted
        return Moves(
            start=points[:, :3].copy(),
            end=points[:, 3:6].copy(),
            center=points[:, 6:].copy(),
            normal=normal,
            angle=scalars[:, 0].copy(),
            source_line=integers[:, 0].copy(),
            file=integers[:, 1].copy(),
            file_line=integers[:, 2].copy(),
            feed=scalars[:, 1].copy(),
            rapid=np.isnan(scalars[:, 1]),
            blend=scalars[:, 2].copy(),
            merge=scalars[:, 3].copy(),
            spline=integers[:, 4].copy(),
            control_points=tuple(self._splines),
            dwell=dwell[1:].copy(),
            dwell_before=float(dwell[0]),
        )
