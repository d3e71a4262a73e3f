"""Corners rounded, and jumps of curvature smoothed, by splines within a tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray

from contourlab.contours.blending.deviation import Cut, measured_deviation
from contourlab.contours.blending.pieces import Pieces
from contourlab.contours.blending.rows import blended_path
from contourlab.contours.blending.shape import deviation_per_trim
from contourlab.contours.blending.trims import (
    blend_controls,
    kept_stretches,
    longest_trims,
    shared,
    wanted_trims,
)
from contourlab.contours.joints import CORNER, piece_ends
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

__all__ = ["REVERSAL", "Blended", "blend_corners"]

REVERSAL = np.radians(179.0)
"""Turning angle above which a joint is a reversal: it has no side to go round [rad]."""

_SMOOTH = 1e-3
"""Jump of curvature, over the larger of the two curvatures, that is left alone."""
_FINEST = 1e-8
"""Shortest trim, over the largest coordinate: below it rounding shows in the curvature."""
_ROUNDS = 40

Rows = NDArray[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class Blended:
    """A path with its blends; NumPy arrays."""

    path: Path
    """The new path. A blend may be several rows."""
    piece: Int[NDArray[Any], " n_rows"]
    """Piece of the old path that each row comes from; for a blend the piece after its joint."""
    blend: Int[NDArray[Any], " n_rows"]
    """Blend that each row is a part of, counted from 0, or -1."""
    joint: Int[NDArray[Any], " n_blends"]
    """Joint of the old path that each blend replaces; joint j is at the end of piece j."""
    deviation: Float[NDArray[Any], " n_blends"]
    """Greatest distance between the blend and what it replaces, both ways [m].

    In closed form between two lines, else measured, with the error of measuring added.
    """
    trim: Float[NDArray[Any], "n_blends 2"]
    """Length replaced of the piece before and of the piece after [m]."""
    left: Int[NDArray[Any], " n_left"]
    """Joints that were to be blended and are not, ascending."""
    reason: tuple[str, ...]
    """Why, one for each."""

    @property
    def is_blend(self) -> Bool[NDArray[Any], " n_rows"]:
        """Whether each row is part of a blend."""
        return self.blend >= 0


def blend_corners(
    path: Path,
    *,
    tolerance: Any,
    reach: Any = np.inf,
    corner_angle: float = CORNER,
    curvature: bool = True,
) -> Blended:
    """Return the path with its corners blended by splines, curvature being continuous across them.

    Where the path turns, an equal length of both neighbours is replaced by a quintic Bézier curve
    that has their points, tangents and curvature vectors at its ends, in any number of axes. The
    length is the greatest that the tolerance, the reach, the two pieces and an eighth of a turn of
    an arc allow. Two blends on one piece share it: each may use half, and what the other leaves.
    What is left of lines, arcs, helices and Bézier pieces is exact; a piece of which nothing is
    left has no row. For the choice of the spline see :mod:`contourlab.contours.blending.shape`.

    The deviation is the Hausdorff distance between a blend and what it replaces: the blend is
    nowhere farther from the path than that, nor the path from the blend.

    Parameters
    ----------
    path
        Any path.
    tolerance
        Greatest deviation at each joint, shape (n_joints,) or one for all [m]; NaN or 0 leaves the
        joint as it is, inf is no limit.
    reach
        Longest trim that is wanted of either neighbour, likewise [m].
    corner_angle
        Joints between lines that turn by no more than this are left as they are [rad].
    curvature
        Whether joints without a corner at which the curvature jumps are smoothed as well.

    Returns
    -------
    Blended
        Joints that stay corners are listed in it: reversals (turning by more than 179°), the seam
        of a closed path, and where no blend could be made.

    Raises
    ------
    GeometryError
        A negative tolerance or reach, or arrays of a wrong shape.
    """
    joints = path.joints()
    n_joints = len(joints.parameter)
    limit = _per_joint("tolerance", tolerance, n_joints)
    near = _per_joint("reach", reach, n_joints)
    if np.isnan(near).any():
        raise GeometryError("reach must be >= 0 m, got nan")
    pieces = Pieces(path)
    angle, jump = joints.turning_angle, joints.curvature_jump
    asked = (limit > 0.0) & (near > 0.0)
    asked &= (angle > corner_angle) | (curvature & _jumps(path, jump))
    left = {int(j): "a reversal" for j in np.flatnonzero(asked & (angle > REVERSAL))}
    if path.closed and asked[-1]:
        left[n_joints - 1] = "the seam of a closed path"
    asked[list(left)] = False
    joint = np.flatnonzero(asked)
    longest = np.minimum(longest_trims(pieces, joint), near[joint])
    trim = wanted_trims(pieces, joint, angle[joint], jump[joint], limit[joint], longest)
    trim = shared(trim, joint, pieces.length)
    finest = _FINEST * float(np.abs(pieces.origin).max())
    joint, trim, control, deviation, low, high = _certified(
        pieces, joint, trim, angle, limit, finest, left
    )
    new, piece, blend = blended_path(path, pieces, low, high, joint, control)
    order = sorted(left)
    return Blended(
        path=new,
        piece=piece,
        blend=blend,
        joint=joint.astype(np.int32),
        deviation=deviation,
        trim=np.stack([pieces.length[joint] - high[joint], low[joint + 1]], axis=1),
        left=np.array(order, np.int32),
        reason=tuple(left[j] for j in order),
    )


def _per_joint(name: str, value: Any, n_joints: int) -> Rows:
    array = np.asarray(value, float)
    if array.shape not in ((), (n_joints,)):
        raise GeometryError(
            f"{name} must be one number or of shape ({n_joints},), one for each joint, "
            f"got {array.shape}"
        )
    if (array < 0.0).any():
        raise GeometryError(f"{name} must be >= 0 m, got {np.nanmin(array):g}")
    return np.array(np.broadcast_to(array, (n_joints,)))


def _jumps(path: Path, jump: Rows) -> Rows:
    """Return which joints have a jump of curvature worth smoothing."""
    before = np.linalg.norm(piece_ends(path, at_end=True)[2], axis=1)
    after = np.linalg.norm(piece_ends(path, at_end=False)[2], axis=1)
    following = np.roll(after, -1)[: len(jump)]
    size = np.maximum(before[: len(jump)], following)
    return (jump > _SMOOTH * size) & (jump > 0.0)  # type: ignore[no-any-return]


def _certified(
    pieces: Pieces, joint: Rows, trim: Rows, angle: Rows, limit: Rows, finest: float,
    left: dict[int, str],
) -> tuple[Rows, Rows, Rows, Rows, Rows, Rows]:  # fmt: skip
    """Shorten trims until every blend is within its tolerance; those that cannot are left."""
    known = np.full((len(pieces.length), 4), np.nan)  # low, high, deviation, fair of each joint
    for _ in range(_ROUNDS):
        short = trim <= finest
        for j in joint[short].tolist():
            left.setdefault(j, "no room on its pieces")
        joint, trim = joint[~short], trim[~short]
        low, high = kept_stretches(trim, joint, pieces.length)
        cut = Cut(joint, high[joint], joint + 1, low[joint + 1])
        control = blend_controls(pieces, cut, angle[joint])
        used = np.maximum(pieces.length[joint] - cut.low, cut.high)
        changed = (known[joint, 0] != cut.low) | (known[joint, 1] != cut.high)
        closed_form = deviation_per_trim(angle[joint]) * used
        first_look = np.stack([cut.low, cut.high, closed_form, np.ones(len(joint))], axis=1)
        known[joint] = np.where(changed[:, None], first_look, known[joint])
        curved = ~(pieces.straight[joint] & pieces.straight[joint + 1])
        other = np.flatnonzero(changed & curved)
        if len(other):
            known[joint[other], 2], known[joint[other], 3] = measured_deviation(
                pieces, cut.at(other), control[other]
            )
        deviation, fair = known[joint, 2], known[joint, 3] > 0.0
        wrong = ~fair | (deviation > limit[joint])
        if not wrong.any():
            break
        with np.errstate(divide="ignore"):
            step = np.clip(0.99 * limit[joint] / np.maximum(deviation, 1e-300), 0.3, 0.97)
        trim = np.where(wrong, trim * np.where(fair, step, 0.5), trim)
    else:
        for j in joint[wrong].tolist():
            left[j] = "no well shaped blend within the tolerance"
        return _certified(pieces, joint[~wrong], trim[~wrong], angle, limit, finest, left)
    return joint, trim, control, deviation, low, high
