"""Collects moves row by row in flat buffers, and hands them out as arrays once."""

from __future__ import annotations

import math
from array import array

import numpy as np

from contourlab.contours.part import Moves

__all__ = ["MoveRecorder"]

_NO_CENTER = (math.nan, math.nan, math.nan)

Point = tuple[float, float, float]


class MoveRecorder:
    """Rows of :class:`Moves` in the making: 17 numbers a piece, no object a piece."""

    def __init__(self) -> None:
        self._points = array("d")
        self._scalars = array("d")
        self._integers = array("i")
        self._dwell: list[tuple[int, float]] = []

    def __len__(self) -> int:
        return len(self._integers) // 2

    def line(
        self, start: Point, end: Point, normal: int, source_line: int, feed: float, blend: float
    ) -> None:
        """Add a line; a NaN feed is a rapid."""
        self.arc(start, end, _NO_CENTER, normal, 0.0, source_line, feed, blend)

    def arc(
        self, start: Point, end: Point, center: Point, normal: int, angle: float,
        source_line: int, feed: float, blend: float,
    ) -> None:  # fmt: skip
        """Add an arc; ``normal`` is the axis that is normal to its plane."""
        self._points.extend((*start, *end, *center))
        self._scalars.extend((angle, feed, blend))
        self._integers.extend((source_line, normal))

    def dwell(self, seconds: float) -> None:
        """Add waiting after the last piece, or before the first."""
        self._dwell.append((len(self) - 1, seconds))

    def moves(self) -> Moves:
        """Return everything recorded."""
        n = len(self)
        points = np.array(self._points, dtype=float).reshape(n, 9)
        scalars = np.array(self._scalars, dtype=float).reshape(n, 3)
        integers = np.array(self._integers, dtype=np.int32).reshape(n, 2)
        dwell = np.zeros(n + 1)
        for piece, seconds in self._dwell:
            dwell[piece + 1] += seconds
        return Moves(
            start=points[:, :3].copy(),
            end=points[:, 3:6].copy(),
            center=points[:, 6:].copy(),
            normal=np.eye(3)[integers[:, 1]],
            angle=scalars[:, 0].copy(),
            source_line=integers[:, 0].copy(),
            feed=scalars[:, 1].copy(),
            rapid=np.isnan(scalars[:, 1]),
            blend=scalars[:, 2].copy(),
            dwell=dwell[1:].copy(),
            dwell_before=float(dwell[0]),
        )
