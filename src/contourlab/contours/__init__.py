"""Curves as geometry: derivatives, frames, arc length, the exact foot point, part readers."""

from contourlab.contours.base import Contour, Frenet, left_normal, unit
from contourlab.contours.blending import (
    Blended,
    BlendedPart,
    Merged,
    blend_corners,
    blend_part,
    joint_tolerance,
    merge_lines,
    merge_part,
)
from contourlab.contours.circle import Arc, Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.foot_points import FootPoint, foot_point, local_foot
from contourlab.contours.frenet import (
    CurvatureDerivatives,
    arc_length_derivatives,
    curvature_derivatives,
)
from contourlab.contours.gcode import read_gcode, read_gcode_text
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.part import Part
from contourlab.contours.path import Path

__all__ = [
    "Arc",
    "Blended",
    "BlendedPart",
    "Circle",
    "Contour",
    "CurvatureDerivatives",
    "Ellipse",
    "FootPoint",
    "Frenet",
    "Helix",
    "Line",
    "Merged",
    "Part",
    "Path",
    "arc_length_derivatives",
    "blend_corners",
    "blend_part",
    "curvature_derivatives",
    "foot_point",
    "joint_tolerance",
    "left_normal",
    "local_foot",
    "merge_lines",
    "merge_part",
    "read_gcode",
    "read_gcode_text",
    "unit",
]
