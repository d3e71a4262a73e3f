"""Corners blended by splines within a tolerance, runs of lines merged: G64 P and Q as geometry."""

from contourlab.contours.blending.corners import Blended, blend_corners
from contourlab.contours.blending.merging import Merged, merge_lines
from contourlab.contours.blending.parts import BlendedPart, blend_part, joint_tolerance, merge_part

__all__ = [
    "Blended",
    "BlendedPart",
    "Merged",
    "blend_corners",
    "blend_part",
    "joint_tolerance",
    "merge_lines",
    "merge_part",
]
