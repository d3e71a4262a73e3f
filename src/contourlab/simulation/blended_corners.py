"""The corners of a program that its plan has blended: still corners to whoever wrote it.

The tool does not come to the corner's point any more. How much is rounded off, by the blend and by
the machine, is the undershoot from that point; overshoot, time and contour error are those on the
blended path.
"""

from __future__ import annotations

import numpy as np

from contourlab.contours.part import Part
from contourlab.feedrate import Plan
from contourlab.feedrate.arc_length import arc_derivatives, contour_derivatives
from contourlab.feedrate.plan import CORNER_ANGLE
from contourlab.recordings.corners import Corner

__all__ = ["blended_corners"]


def blended_corners(plan: Plan | None, part: Part | None, radius: float) -> tuple[Corner, ...]:
    """Return the blended corners of a plan, in order.

    Parameters
    ----------
    plan
        Of the part, or none.
    part
        As the program has it.
    radius
        Length of path on either side of the blend's middle that is judged with a corner [m]; no
        shorter than the blend.
    """
    if plan is None or plan.blends is None or part is None or plan.part is None:
        return ()
    blends = plan.blends
    number = blends.blended.blend
    rows = np.flatnonzero(number >= 0)
    if not len(rows):
        return ()
    breaks = np.asarray(plan.part.path.breaks, float)
    first = rows[np.append(True, np.diff(number[rows]) != 0)]
    last = rows[np.append(np.diff(number[rows]) != 0, True)]
    middle = 0.5 * (breaks[first] + breaks[last + 1])
    half = 0.5 * (breaks[last + 1] - breaks[first])
    after = blends.piece[first]
    joint = np.asarray(part.path.breaks, float)[after]
    left = contour_derivatives(part.path, joint, after - 1)
    right = contour_derivatives(part.path, joint, after)
    a, b = arc_derivatives(left)[:, 0], arc_derivatives(right)[:, 0]
    angle = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    beside = np.minimum(np.diff(middle, prepend=-np.inf), np.diff(middle, append=np.inf))
    reach = np.minimum(np.maximum(radius, half), 0.5 * beside)
    lines = part.source_line
    return tuple(
        Corner(
            parameter=float(middle[k]),
            position=right[k, 0],
            incoming=a[k],
            outgoing=b[k],
            angle=float(angle[k]),
            radius=float(reach[k]),
            line_before=int(lines[after[k] - 1]),
            line_after=int(lines[after[k]]),
        )
        for k in np.flatnonzero(angle > CORNER_ANGLE)
    )
