"""What a plan could not honour, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from contourlab.feedrate.limits import AxisLimits

if TYPE_CHECKING:
    from contourlab.feedrate.motion import Motion

__all__ = ["remarks"]

_NOTICED = 1e-9


def remarks(motion: Motion, limits: AxisLimits) -> tuple[str, ...]:
    """Return the sentences that the user should see.

    Parameters
    ----------
    motion
        The plan.
    limits
        One number per axis.
    """
    sentences = (_slower(motion), _turns(motion), _curvature_jumps(motion, limits))
    return tuple(sentence for sentence in sentences if sentence)


def _place(motion: Motion, edge: int) -> str:
    """Return where an edge is: along the path, and in the program if there is one."""
    text = f"{1e3 * motion.segments.edges[edge]:.4g} mm"
    part, pieces = motion.program.part, motion.segments.piece
    if part is None:
        return text
    line = int(part.source_line[int(pieces[min(edge, len(pieces) - 1)])])
    return f"{text}, line {line}"


def _axis(motion: Motion, axis: int) -> str:
    part = motion.program.part
    return f"axis {axis if part is None else part.axes[axis]}"


def _slower(motion: Motion) -> str:
    length = np.diff(motion.segments.edges)
    held = motion.speed < motion.programmed * (1.0 - _NOTICED)
    held &= ~motion.program.rapid[motion.segments.piece]
    if not held.any():
        return ""
    share = float(length[held].sum() / length.sum())
    least = int(np.argmin(np.where(held, motion.speed / motion.programmed, np.inf)))
    return (
        f"axis limits hold the feed below the programmed one on {1e3 * length[held].sum():.4g} mm "
        f"({100 * share:.3g} %) of the path, at {_place(motion, least)}, to "
        f"{6e4 * motion.speed[least]:.4g} of {6e4 * motion.programmed[least]:.4g} mm/min; "
        "speeding up and slowing down for stops and slower places come on top"
    )


def _turns(motion: Motion) -> str:
    turning = (motion.angle > 1e-9) & ~motion.stop
    if not turning.any():
        return ""
    at = motion.segments.edges[turning]
    speed = motion.profile.at(motion.profile.time_at(at))[1]
    change = motion.segments.after[turning, 0] - motion.segments.before[turning, 0]
    jump = np.abs(change).max(axis=1)
    return (
        f"{int(turning.sum())} joints turn by up to {float(motion.angle[turning].max()):.3g} rad "
        "and are passed without a stop: an axis velocity jumps by up to "
        f"{1e3 * float((jump * speed).max()):.3g} mm/s there"
    )


def _curvature_jumps(motion: Motion, limits: AxisLimits) -> str:
    segments = motion.segments
    jump = np.abs(segments.after[:, 1] - segments.before[:, 1])
    where = segments.joint & ~motion.stop & (jump.max(axis=1) > 1e-6 / segments.edges[-1])
    if not where.any():
        return ""
    speed = motion.profile.at(motion.profile.time_at(segments.edges[where]))[1]
    steps = jump[where] * speed[:, None] ** 2
    share = steps / np.asarray(limits.acceleration)
    row, axis = np.unravel_index(int(np.argmax(share)), share.shape)
    place = f"{_axis(motion, int(axis))}, at {_place(motion, int(np.flatnonzero(where)[row]))}"
    return (
        f"the curvature jumps at {int(where.sum())} joints that are passed without a stop: an axis "
        f"acceleration jumps by up to {steps[row, axis]:.3g} m/s^2 there ({place}), "
        "within its limit; the jerk is not limited there"
    )
