"""Segments in metres from the shapes of an SVG drawing, through its transformations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.cad.segments import Segment, conic, curve, line
from contourlab.errors import PartError

__all__ = ["PlacedShapes"]

Rows = NDArray[Any]


class PlacedShapes:
    """Segments in metres from coordinates in user units.

    Parameters
    ----------
    matrix
        From user units to metres, shape (2 or 3, 3).
    columns
        Machine axes of x and y.
    """

    def __init__(self, matrix: Rows, columns: tuple[int, ...]) -> None:
        self._turn = np.zeros((3, 2))
        self._turn[list(columns)] = matrix[:2, :2]
        self._shift = np.zeros(3)
        self._shift[list(columns)] = matrix[:2, 2]

    def vector(self, xy: Any) -> Rows:
        """Return a direction or distance, shape (3,) [m].

        Parameters
        ----------
        xy
            In user units, shape (2,).
        """
        turned: Rows = self._turn @ np.asarray(xy, float)
        return turned

    def point(self, xy: Any) -> Rows:
        """Return a point, shape (3,) [m].

        Parameters
        ----------
        xy
            In user units, shape (2,).
        """
        return self.vector(xy) + self._shift

    def line(self, start: Any, end: Any) -> Segment:
        """Return a straight line.

        Parameters
        ----------
        start, end
            In user units, shape (2,).
        """
        return line(self.point(start), self.point(end))

    def lines(self, points: Sequence[Any]) -> list[Segment]:
        """Return the straight lines from point to point.

        Parameters
        ----------
        points
            In user units, each of shape (2,).
        """
        placed = [self.point(xy) for xy in points]
        return [line(a, b) for a, b in pairwise(placed)]

    def conic(
        self, center: Any, first: Any, second: Any, start: float, sweep: float
    ) -> list[Segment]:
        """Return an arc of an ellipse: center + first cos t + second sin t.

        Parameters
        ----------
        center, first, second
            In user units, shape (2,).
        start, sweep
            Of t [rad].

        Raises
        ------
        PartError
            The transformation makes it flat.
        """
        a, b = self.vector(first), self.vector(second)
        if not np.linalg.norm(np.cross(a, b)) > 1e-9 * np.linalg.norm(a) * np.linalg.norm(b):
            raise PartError("a transformation makes an arc flat")
        return conic(self.point(center), a, b, start, sweep)

    def piece(self, piece: Any) -> list[Segment]:
        """Return what svgpathtools made of a command of a path.

        Parameters
        ----------
        piece
            A ``Line``, ``Arc``, ``QuadraticBezier`` or ``CubicBezier``.

        Raises
        ------
        PartError
            An arc without a centre, or made flat.
        """
        kind = type(piece).__name__
        if kind == "Arc":
            return self._arc(piece)
        points = np.array([self.point((p.real, p.imag)) for p in piece.bpoints()])
        if kind == "Line":
            return [line(points[0], points[1])]
        return [curve(np.concatenate([points, np.ones((len(points), 1))], axis=1))]

    def _arc(self, piece: Any) -> list[Segment]:
        turn = math.radians(float(piece.rotation))
        rx, ry = float(piece.radius.real), float(piece.radius.imag)
        first = (rx * math.cos(turn), rx * math.sin(turn))
        second = (-ry * math.sin(turn), ry * math.cos(turn))
        center = (piece.center.real, piece.center.imag)
        start, sweep = math.radians(float(piece.theta)), math.radians(float(piece.delta))
        if not all(map(math.isfinite, (*first, *second, *center, start, sweep))) or sweep == 0.0:
            raise PartError("an arc of the path has no centre")
        run = self.conic(center, first, second, start, sweep)
        ends = [self.point((p.real, p.imag)) for p in (piece.start, piece.end)]
        # the path's own ends, which the centre gives to rounding only
        most = 1e-9 * (abs(rx) + abs(ry) + abs(piece.center)) * float(np.abs(self._turn).max())
        if len(run) == 1 and abs(abs(sweep) - 2.0 * math.pi) > 1e-9:
            return [run[0].moved(ends[0], ends[1], most)]
        run[0] = run[0].moved(ends[0], run[0].end, most)
        run[-1] = run[-1].moved(run[-1].start, ends[1], most)
        return run
