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
from contourlab.contours.bspline import BSpline
from contourlab.contours.cad import read_dxf, read_svg
from contourlab.contours.circle import Arc, Circle
from contourlab.contours.combined import combined
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.figure_eight import FigureEight
from contourlab.contours.foot_points import FootPoint, foot_point, local_foot, tied_parameter
from contourlab.contours.frenet import (
    CurvatureDerivatives,
    arc_length_derivatives,
    curvature_derivatives,
)
from contourlab.contours.gcode import read_gcode, read_gcode_text
from contourlab.contours.heart import Heart
from contourlab.contours.helix import Helix
from contourlab.contours.interpolation import (
    SplineFit,
    interpolating_spline,
    smoothing_spline,
)
from contourlab.contours.joining import Joined, join
from contourlab.contours.level import Level
from contourlab.contours.line import Line
from contourlab.contours.lissajous import Lissajous
from contourlab.contours.nurbs import Nurbs
from contourlab.contours.parabola import Parabola
from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.contours.points import PointsPart, read_points
from contourlab.contours.rotation_minimising import (
    MovingFrame,
    TransportedFrame,
    begin_frame,
    move_frame,
    rotation_minimising_frames,
    transport_normal,
)
from contourlab.contours.signed_distance import ImplicitForm, SignedDistance, implicit_form
from contourlab.contours.sinusoid import Sinusoid
from contourlab.contours.spiral import Involute, Spiral
from contourlab.contours.star import Star

__all__ = [
    "Arc",
    "BSpline",
    "Blended",
    "BlendedPart",
    "Circle",
    "Contour",
    "CurvatureDerivatives",
    "Ellipse",
    "FigureEight",
    "FootPoint",
    "Frenet",
    "Heart",
    "Helix",
    "ImplicitForm",
    "Involute",
    "Joined",
    "Level",
    "Line",
    "Lissajous",
    "Merged",
    "MovingFrame",
    "Nurbs",
    "Parabola",
    "Part",
    "Path",
    "PointsPart",
    "SignedDistance",
    "Sinusoid",
    "Spiral",
    "SplineFit",
    "Star",
    "TransportedFrame",
    "arc_length_derivatives",
    "begin_frame",
    "blend_corners",
    "blend_part",
    "combined",
    "curvature_derivatives",
    "foot_point",
    "implicit_form",
    "interpolating_spline",
    "join",
    "joint_tolerance",
    "left_normal",
    "local_foot",
    "merge_lines",
    "merge_part",
    "move_frame",
    "read_dxf",
    "read_gcode",
    "read_gcode_text",
    "read_points",
    "read_svg",
    "rotation_minimising_frames",
    "smoothing_spline",
    "tied_parameter",
    "transport_normal",
    "unit",
]
