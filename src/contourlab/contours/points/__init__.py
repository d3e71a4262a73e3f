"""Measured or tabulated points as a part: polylines and fitted splines."""

from contourlab.contours.points.cleaning import Cleaning
from contourlab.contours.points.reader import PointsPart, read_points

__all__ = ["Cleaning", "PointsPart", "read_points"]
