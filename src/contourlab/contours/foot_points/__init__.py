"""The exact foot point of a contour: the nearest point, local or global."""

from contourlab.contours.foot_points.contour_cells import cells_of
from contourlab.contours.foot_points.foot_point import foot_point
from contourlab.contours.foot_points.local import FootPoint, local_foot
from contourlab.contours.foot_points.ties import tied_parameter

__all__ = ["FootPoint", "cells_of", "foot_point", "local_foot", "tied_parameter"]
