"""Which contours have a tangent that a law can follow: no corners."""

from __future__ import annotations

import jax
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.contours.base import Contour
from contourlab.contours.joints import CORNER, path_joints
from contourlab.contours.path import Path
from contourlab.contours.spline import Spline
from contourlab.contours.transformed_path import affine_path, reversed_path, stretch_of_path
from contourlab.contours.wrapped import Reversed, Stretch, Transformed
from contourlab.errors import GeometryError, RefusedError

__all__ = ["refuse_corners"]


def refuse_corners(law: str, contour: Contour) -> None:
    """Raise RefusedError if the tangent of a path turns at a joint, or that of a spline at a knot.

    A joint is a corner if it turns by more than 1e-4 rad. Formula curves other than splines have
    none.

    Parameters
    ----------
    law
        Name of the law, for the message.
    contour
        What it is to follow; not looked at while it is traced (it was before).
    """
    if not all(is_concrete(leaf) for leaf in jax.tree.leaves(contour)):
        return
    try:
        path = _path_of(contour)
    except GeometryError as error:
        raise RefusedError(f"{law} needs a tangent everywhere: {error}") from error
    if path is None:
        return
    joints = path_joints(path)
    corners = np.flatnonzero(joints.turning_angle > CORNER)
    if not len(corners):
        return
    first = corners[0]
    before, after = int(joints.line_before[first]), int(joints.line_after[first])
    where = f"between lines {before} and {after}" if before and after else "at a joint"
    more = f", and at {len(corners) - 1} more corners" if len(corners) > 1 else ""
    remedy = (
        "Blend the corners: G64 P in a program, blend of points and drawings, with a tolerance at "
        "which passing is faster than stopping; a rapid and a feed are never blended: leave rapids "
        "out, skip_rapids in a scenario"
        if isinstance(contour, Path)
        else "Round it: a spline has a corner where a knot stands as often as its degree"
    )
    raise RefusedError(
        f"{law} controls errors along the tangent and the normal of the path, which jump at a "
        f"corner: the path turns by {np.degrees(joints.turning_angle[first]):.3g} degrees "
        f"{where}, {float(joints.parameter[first]) * 1e3:.6g} mm from its start{more}. {remedy}"
    )


def _path_of(contour: Contour) -> Path | None:
    """Return a contour as a path if it may have corners, None if it is smooth by its formula."""
    if isinstance(contour, Path):
        return contour
    if isinstance(contour, Spline):
        return contour.to_path()
    if not isinstance(contour, Transformed | Reversed | Stretch):
        return None
    path = _path_of(contour.inner)
    if path is None:
        return None
    if isinstance(contour, Reversed):
        return reversed_path(path)
    if isinstance(contour, Transformed):
        return affine_path(path, contour.matrix, contour.offset)
    low = contour.inner.domain[0]
    ends = (contour.inner.arc_length(low, at) for at in (contour.start, contour.end))
    return stretch_of_path(path, *map(float, ends))
