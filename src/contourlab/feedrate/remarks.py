"""What a plan could not honour, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.feedrate.arc_length import ArcLength
from contourlab.feedrate.limits import AxisLimits

if TYPE_CHECKING:
    from contourlab.contours.blending import BlendedPart
    from contourlab.feedrate.motion import Motion

__all__ = ["CurvatureJump", "axis_names", "blend_remarks", "curvature_jumps", "remarks"]

Values = NDArray[Any]

_NOTICED = 1e-9
_SHOWN, _LISTED = 5, 12
_SMOOTH = 1e-6
"""Jumps of curvature below this share of that on both sides are rounding."""
_REACHED = 0.999
_PLACES = np.array([0.1, 0.5, 0.9])


class CurvatureJump(NamedTuple):
    """A joint at which the curvature jumps and the motion does not stop."""

    parameter: float
    """Where on the contour."""
    line: int
    """Line of the program that makes the piece after it; 0 without a program."""
    acceleration: Values
    """Jump of each axis' acceleration, shape (n_axes,) [m/s²]; within its limit."""


def remarks(motion: Motion, limits: AxisLimits) -> tuple[str, ...]:
    """Return the sentences that the user should see.

    Parameters
    ----------
    motion
        The plan.
    limits
        One number per axis.
    """
    sentences = (
        _slower(motion), _turns(motion), _jumps(motion, limits), _left_as_planned(motion),
    )  # fmt: skip
    return tuple(sentence for sentence in sentences if sentence)


def blend_remarks(blends: BlendedPart | None, stopped: int) -> tuple[str, ...]:
    """Return what the user should know of the blends: how far they go, and which were left.

    Parameters
    ----------
    blends
        Of the part, None if there are none.
    stopped
        How many corners stay stops because that is faster.
    """
    if blends is None:
        return ()
    sentences = []
    if blends.n_blends:
        sentences.append(
            f"G64: {blends.n_blends} corners and jumps of curvature are blended, the path leaves "
            f"the programmed one by at most {1e6 * blends.largest_deviation:.3g} um "
            f"(line {blends.largest_line}); the contour error is judged against the blended path"
        )
    if stopped:
        sentences.append(
            f"G64: {stopped} corners are stopped at, because under the jerk limits no blend within "
            "the tolerance is passed in less time than that takes"
        )
    if blends.left:
        lines = ", ".join(f"line {line} ({why})" for line, why in blends.left[:_SHOWN])
        more = len(blends.left) - _SHOWN
        sentences.append(
            f"G64: {len(blends.left)} corners could not be blended and are stopped at: {lines}"
            + (f" and {more} more" if more > 0 else "")
        )
    return tuple(sentences)


def _place(motion: Motion, edge: int) -> str:
    """Return where an edge is: along the path, and in the program if there is one."""
    text = f"{1e3 * motion.segments.edges[edge]:.4g} mm"
    part, pieces = motion.program.part, motion.segments.piece
    if part is None:
        return text
    line = int(part.source_line[int(pieces[min(edge, len(pieces) - 1)])])
    return f"{text}, line {line}"


def axis_names(motion: Motion) -> tuple[str, ...]:
    """Return the names of the axes: those of the part, or numbers.

    Parameters
    ----------
    motion
        The plan.
    """
    part = motion.program.part
    n_axes = motion.segments.tangent.shape[1]
    return tuple(map(str, range(n_axes))) if part is None else part.axes


def _slower(motion: Motion) -> str:
    length = np.diff(motion.segments.edges)
    held = np.flatnonzero(
        (motion.speed < motion.programmed * (1.0 - _NOTICED))
        & ~motion.program.rapid[motion.segments.piece]
    )
    places = motion.segments.edges[held][:, None] + length[held][:, None] * _PLACES
    speed = motion.profile.at(motion.profile.time_at(places.reshape(-1)))[1]
    speed = speed.reshape(-1, len(_PLACES)).max(axis=1)
    reached = speed / motion.programmed[held]
    below = reached < _REACHED
    if not below.any():
        return ""
    held, speed, reached = held[below], speed[below], reached[below]
    share = float(length[held].sum() / length.sum())
    least = int(np.argmin(reached))
    return (
        f"axis limits hold the feed below the programmed one on {1e3 * length[held].sum():.4g} mm "
        f"({100 * share:.3g} %) of the path, at {_place(motion, int(held[least]))}, to "
        f"{6e4 * speed[least]:.4g} of {6e4 * motion.programmed[held[least]]:.4g} mm/min; "
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


def curvature_jumps(motion: Motion, table: ArcLength) -> tuple[CurvatureJump, ...]:
    """Return the joints that are passed although the curvature jumps.

    Parameters
    ----------
    motion
        The plan.
    table
        Arc length of the contour.
    """
    edges, steps = _curvature_steps(motion)
    if not len(edges):
        return ()
    arc = motion.segments.edges[edges]
    parameter = table.parameter_at(arc).tolist()
    part = motion.program.part
    lines = [0] * len(edges)
    if part is not None:
        lines = part.source_line[motion.segments.piece[edges]].tolist()
    return tuple(map(CurvatureJump, parameter, lines, steps))


def _curvature_steps(motion: Motion) -> tuple[Values, Values]:
    """Return these edges and the jump of each axis' acceleration there [m/s²]."""
    segments = motion.segments
    jump = np.abs(segments.after[:, 1] - segments.before[:, 1])
    bend = segments.bend.max(axis=1)
    bent = np.maximum(np.append(bend[:1], bend), np.append(bend, bend[-1:]))
    where = segments.joint & ~motion.stop & (jump.max(axis=1) > _SMOOTH * bent)
    speed = motion.profile.at(motion.profile.time_at(segments.edges[where]))[1]
    return np.flatnonzero(where), jump[where] * speed[:, None] ** 2


def _jumps(motion: Motion, limits: AxisLimits) -> str:
    edges, steps = _curvature_steps(motion)
    if not len(edges):
        return ""
    share = steps / np.asarray(limits.acceleration)
    row, axis = np.unravel_index(int(np.argmax(share)), share.shape)
    place = f"axis {axis_names(motion)[int(axis)]}, at {_place(motion, int(edges[row]))}"
    return (
        f"the curvature jumps at {len(edges)} joints that are passed without a stop: an axis "
        f"acceleration jumps by up to {steps[row, axis]:.3g} m/s^2 there ({place}), "
        f"within its limit; the jerk is not limited there{_lines(motion, edges)}"
    )


def _lines(motion: Motion, edges: Values) -> str:
    part = motion.program.part
    if part is None:
        return ""
    lines = list(dict.fromkeys(part.source_line[motion.segments.piece[edges]].tolist()))
    shown = ", ".join(map(str, lines[:_LISTED]))
    more = len(lines) - _LISTED
    return f"; they begin lines {shown}" + (f" and {more} more" if more > 0 else "")


def _left_as_planned(motion: Motion) -> str:
    if not motion.left_as_planned:
        return ""
    return (
        f"{motion.left_as_planned} stretches between stops keep their first, slower plan: there is "
        "too much of them to plan for the least time, or the motion all but stands still"
    )
