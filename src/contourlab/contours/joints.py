"""The joints of a path: how far it turns and how much its curvature jumps from piece to piece."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from contourlab.contours.bezier_rows import end_derivatives
from contourlab.contours.helical import helical_ends

if TYPE_CHECKING:
    from contourlab.contours.path import Path

__all__ = ["CORNER", "Joints", "path_joints", "piece_ends"]

CORNER = 1e-4
"""Turning angle above which a joint is a corner [rad].

Coordinates written to 1 µm turn the tangents of centimetre arcs by this much, and at 100 mm/s the
velocity then jumps by 10 µm/s, which no axis shows: below it a joint is meant to be smooth.
"""


class Joints(eqx.Module):
    """Where the pieces of a path meet; joint i is between piece i and the one after it.

    A closed path has one more: its last joint is the seam, from the last piece to the first. All
    are NumPy arrays of shape (n_joints,).
    """

    parameter: Float[NDArray[Any], " n_joints"]
    """Arc length [m]; for the seam the end of the domain."""
    turning_angle: Float[NDArray[Any], " n_joints"]
    """Angle between the tangents before and after, 0 to π [rad]."""
    curvature_jump: Float[NDArray[Any], " n_joints"]
    """Size of the difference of the curvature vectors after and before [1/m]."""
    line_before: Int[NDArray[Any], " n_joints"]
    """Source line of the piece that ends, 0 if unknown."""
    line_after: Int[NDArray[Any], " n_joints"]
    """Source line of the piece that begins."""


def piece_ends(path: Path, *, at_end: bool) -> tuple[Any, Any, Any]:
    """Return the first or last point of each piece, its unit tangent and its curvature vector.

    Parameters
    ----------
    path
        A path.
    at_end
        Whether the last points are meant.

    Returns
    -------
    point, tangent, curvature
        NumPy arrays of shape (n_pieces, n_axes): [m], none, [1/m].
    """
    at = np.diff(np.asarray(path.breaks)) * float(at_end)
    ends = helical_ends(
        np.asarray(path.origin), np.asarray(path.tangent_vector), np.asarray(path.normal_vector),
        np.asarray(path.axial_vector), np.asarray(path.angle_rate), at,
    )  # fmt: skip
    rows = np.asarray(path.bezier_row)
    curved = rows >= 0
    if curved.any():
        control = np.asarray(path.control_points)[rows[curved]]
        for values, exact in zip(ends, end_derivatives(control, at_end=at_end), strict=True):
            values[curved] = exact
    return ends


def path_joints(path: Path) -> Joints:
    """Return the joints of a path.

    Parameters
    ----------
    path
        A path.
    """
    n = path.n_pieces
    before = np.arange(n if path.closed else n - 1)
    after = (before + 1) % n
    _, tangent, curvature = piece_ends(path, at_end=True)
    _, next_tangent, next_curvature = piece_ends(path, at_end=False)
    difference = np.linalg.norm(next_tangent[after] - tangent[before], axis=1)
    total = np.linalg.norm(next_tangent[after] + tangent[before], axis=1)
    lines = np.asarray(path.source_line)
    return Joints(
        parameter=np.asarray(path.breaks)[before + 1],
        turning_angle=2.0 * np.arctan2(difference, total),  # accurate near 0 and near π
        curvature_jump=np.linalg.norm(next_curvature[after] - curvature[before], axis=1),
        line_before=lines[before],
        line_after=lines[after],
    )
