"""What a log cannot show: its resolution, its holes, its sampling rate.

**Grid.** A value on a grid of step q says only that the truth is within q/2. With unit normal n of
the path, steps q of the actual and p of the commanded position, a contour error is then known to

    ± Σ_i |n_i| (q_i + p_i) / 2                                                          (1)

and an axis that follows perfectly would be seen with the root mean square

    √(Σ_i n_i² (q_i² + p_i²) / 12).                                                      (2)

**Sampling.** The path between two commanded positions is not in the log. On a smooth one it leaves
the chord by at most |Δ²p| / 8, with Δ² the second difference; where it turns sharply, by up to half
of that difference, since the corner may lie anywhere between the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.evaluation.grid import grid_steps
from contourlab.evaluation.stretches import Breaks, stretches
from contourlab.logs.log import Log
from contourlab.units import to_um

__all__ = ["Resolution", "find_resolution"]

SHARP = np.deg2rad(20.0)
"""Turn from step to step above which the path has a corner there [rad]."""
HELD_AT_END = 0.01
"""Share of samples at the largest value from which a signal counts as limited."""

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Resolution:
    """How well a log can tell a contour error."""

    actual_step: tuple[float, ...]
    """Coarsest step of the grid of each axis' actual position [m]; 0 for none."""
    commanded_step: tuple[float, ...]
    """The same of the commanded position; empty if it is not in the log."""
    digits: bool
    """Whether the steps grow with the value: significant digits were cut off."""
    half_width: Float[np.ndarray, " n_samples"] = field(repr=False)
    """(1) at every sample, and what sampling adds there [m]."""
    floor_rms: float
    """(2), over all samples: what a perfect machine would be seen with [m]."""
    tracking_half_width: Float[np.ndarray, " n_samples"] = field(repr=False)
    """How far a tracking error may be off at every sample, √Σ(q_i + p_i)²/4 [m]."""
    tracking_floor_rms: float
    """What a machine without any would be seen with, √Σ(q_i² + p_i²)/12 over all samples [m]."""
    chord: float
    """Largest distance by which the path may leave the straight line between samples [m]."""
    warnings: tuple[str, ...] = ()


def find_resolution(
    log: Log, breaks: Breaks, tangent: Values, judged: Values, *, spline: bool, part: bool
) -> Resolution:
    """Return what a log cannot show.

    Parameters
    ----------
    log
        The log.
    breaks
        Where it is broken.
    tangent
        Of the path at each sample, shape (n, n_axes).
    judged
        Which samples have a contour error.
    spline
        Whether a spline stands for the path, so that chords are not.
    part
        Whether the contour is a part file's, so that the commanded grid does not count.
    """
    actual = _steps(log.actual, log.scale)
    commanded = None if log.commanded is None else _steps(log.commanded, log.scale)
    across = np.sqrt(np.clip(1.0 - np.nan_to_num(tangent) ** 2, 0.0, 1.0))
    both = actual + (0.0 if part or commanded is None else commanded)
    half = 0.5 * np.sum(across * both, axis=1)  # (1), with |n_i| <= √(1 - t_i²)
    square = actual**2 + (0.0 if part or commanded is None else commanded**2)
    variance = np.sum(across**2 * square, axis=1) / 12.0  # (2)
    floor = float(np.sqrt(variance[judged].mean())) if judged.any() else 0.0
    own = actual if commanded is None else actual + commanded
    tracking = 0.5 * np.linalg.norm(own, axis=1)
    squares = actual**2 + (0.0 if commanded is None else commanded**2)
    seen = float(np.sqrt(np.mean(np.sum(squares, axis=1)[judged]) / 12.0)) if judged.any() else 0.0
    warnings = _grid_words(log, actual, commanded)
    position = log.actual if log.commanded is None else log.commanded
    sagitta, sharp = _chords(position, breaks, log.n_samples)
    counted = sagitta[judged] if judged.any() else np.zeros(1)
    chord = float(counted.max())
    if not part:
        half = half + (0.0 if spline else sagitta)
    else:
        half = half + _chords(log.actual, breaks, log.n_samples)[0]
    steps = actual if commanded is None else np.maximum(actual, commanded)
    grid = float(steps.max()) if len(steps) else 0.0
    corners = int((sharp & judged).sum())
    if chord > max(grid, 1e-6):
        said = (
            f"between samples the path may leave the straight line by up to {to_um(chord)} um: the "
            f"sampling rate is low for its curvature"
        )
        if corners:
            said += f" ({corners} samples lie at turns of more than 20 degrees, whose corners may "
            said += "be anywhere between samples)"
        warnings.append(said)
    warnings += _break_words(log, breaks)
    warnings += _saturation(log)
    return Resolution(
        tuple(float(c) for c in actual.max(axis=0)),
        () if commanded is None else tuple(float(c) for c in commanded.max(axis=0)),
        bool((actual.max(axis=0) > 5.0 * np.min(actual, axis=0)).any() and grid > 0.0),
        half, floor, tracking, seen, chord, tuple(warnings),
    )  # fmt: skip


def _steps(rows: Values, scale: float) -> Values:
    """Return the grid's step at every value, shape of rows [m]."""
    return np.column_stack([grid_steps(column / scale) for column in rows.T]) * scale


def _grid_words(log: Log, actual: Values, commanded: Values | None) -> list[str]:
    said = []
    for what, steps in (("actual", actual), ("commanded", commanded)):
        if steps is None or not (steps > 0.0).any():
            continue
        largest, least = steps.max(axis=0), steps.min(axis=0)
        parts = [
            f"{axis} {to_um(b)} um"
            + (f" (down to {to_um(a)} um for small values)" if b > 5 * a else "")
            for axis, a, b in zip(log.axes, least, largest, strict=True)
            if b > 0.0
        ]
        grown = bool((largest > 5.0 * least).any())
        why = ", digits were cut off" if grown else ""
        said.append(f"the {what} positions lie on a grid of {', '.join(parts)}{why}")
    return said


def _chords(position: Values, breaks: Breaks, n: int) -> tuple[Values, Values]:
    """Return how far the path may leave its chord at each sample, and where it turns."""
    chord, sharp = np.zeros(n), np.zeros(n, bool)
    for at in stretches(n, breaks.jumps):
        p = position[at]
        if len(p) < 3:
            continue
        step = np.diff(p, axis=0)
        size = np.linalg.norm(step, axis=1)
        bend = np.linalg.norm(np.diff(step, axis=0), axis=1)
        dot = np.einsum("ij,ij->i", step[1:], step[:-1])
        both = size[1:] * size[:-1]
        # part of the bend is a change of speed, which leaves no chord: only what turns counts
        cosine = np.clip(dot / np.where(both > 0.0, both, 1.0), -1.0, 1.0)
        angle = np.where(both > 0.0, np.arccos(cosine), 0.0)
        turning = np.minimum(bend, 2.0 * np.maximum(size[1:], size[:-1]) * np.sin(0.5 * angle))
        turns = angle > SHARP
        inner = chord[at][1:-1]
        inner[:] = np.where(turns, turning / 2.0, turning / 8.0)
        sharp[at][1:-1] = turns
        # either end of a chord counts
        spread = chord[at].copy()
        spread[1:] = np.maximum(spread[1:], chord[at][:-1])
        spread[:-1] = np.maximum(spread[:-1], chord[at][1:])
        chord[at] = spread
    return chord, sharp


def _break_words(log: Log, breaks: Breaks) -> list[str]:
    said = []
    time = log.time
    if len(breaks.jumps):
        at = time[breaks.jumps[0]]
        where = f"{at:.6g} s" if log.timed else f"sample {int(log.row[breaks.jumps[0]])}"
        said.append(
            f"the positions jump at {len(breaks.jumps)} places, by up to "
            f"{breaks.largest_jump * 1e3:.4g} mm from one sample to the next, the first after "
            f"{where}: values dropped out; the path is broken there"
        )
    if breaks.held.any():
        said.append(
            f"{int(breaks.held.sum())} of {log.n_samples} samples stand still between two jumps: "
            "they are taken for drop-outs and not judged"
        )
    if len(breaks.gaps):
        said.append(
            f"samples are missing at {len(breaks.gaps)} places"
            + (f", {breaks.lost_time:.4g} s in all" if log.timed and breaks.lost_time else "")
        )
    repeated = int(breaks.repeated.sum())
    if repeated > max(3, 0.01 * log.n_samples):
        said.append(
            f"{repeated} of {log.n_samples} samples repeat the one before although the axes move: "
            "the log is taken faster than its values change"
        )
    return said


def _saturation(log: Log) -> list[str]:
    said = []
    n = log.n_samples
    if log.command is not None:
        for axis, column in zip(log.axes, log.command.T, strict=True):
            finite = column[np.isfinite(column)]
            if not len(finite) or not np.ptp(finite):
                continue
            for sign, end in (("largest", finite.max()), ("least", finite.min())):
                at_end = int((finite == end).sum())
                if at_end >= max(5, HELD_AT_END * n) and end != 0.0:
                    said.append(
                        f"the command of {axis} is at its {sign} value, {end:.5g} "
                        f"{log.command_unit}".rstrip()
                        + f", in {at_end} samples: the drive may be at its limit"
                    )
    if log.commanded is not None:
        for axis, wanted, got in zip(log.axes, log.commanded.T, log.actual.T, strict=True):
            for end, beyond in ((got.max(), wanted > got.max()), (got.min(), wanted < got.min())):
                held = (got == end) & beyond
                runs = np.flatnonzero(np.diff(np.concatenate([[0], held.view(np.int8), [0]])))
                longest = int(np.diff(runs)[::2].max()) if len(runs) else 0
                step = np.abs(np.diff(wanted))[held[1:]]
                if longest >= 5 and step.sum() > 10.0 * np.median(np.abs(np.diff(got))) + 1e-9:
                    said.append(
                        f"the actual position of {axis} stands at its end, {end * 1e3:.6g} mm, for "
                        f"{longest} samples while the command goes on: the signal is limited"
                    )
    return said
