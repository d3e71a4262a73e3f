"""Drawings as parts: DXF and SVG, by the extra ``cad``."""

from contourlab.contours.cad.dxf import read_dxf
from contourlab.contours.cad.svg import read_svg

__all__ = ["read_dxf", "read_svg"]
