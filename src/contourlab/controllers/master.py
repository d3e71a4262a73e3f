"""Which axis can be the master of a path, and how its coordinate runs along it.

A master is *monotone* if its coordinate only rises or only falls along the path, and *rotational*
if it swings between the same two ends (Assumptions 3.1 and 3.2). A coordinate that stands still
over a stretch (the side of a rectangle) or that turns back elsewhere than at the ends of its range
has no position variable: the place on the path does not follow from the position.

Paths are looked at piece by piece (:mod:`~contourlab.controllers.path_grid`), so that a dwell is
seen however short it is beside the path; turning points are found to rounding by bisection. A
slope that vanishes at a point, at an end of the path or within, is no dwell: the place is then held
as at a turning point (:mod:`~contourlab.controllers.position_domain`).

Remark 2.1 says to take the least precise axis for the master, because the slaves make up for its
error. Of the axes that can be the master, :func:`choose_master` takes the one that answers most
slowly, by its model: mass over viscous drag, if the model has any.

References
----------
.. [CaoZhang] Assumptions 3.1 and 3.2, Remark 2.1.
"""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.configuration import Configuration, is_concrete, real, static
from contourlab.contours.base import Contour
from contourlab.controllers.path_grid import path_grid, path_rows
from contourlab.errors import RefusedError
from contourlab.machines.base import NominalModel
from contourlab.typing import Array

__all__ = [
    "MasterMotion",
    "choose_master",
    "master_motion",
    "why_not_master",
]

STILL = 1e-9
"""Slope below which a coordinate stands still, relative to its steepest."""
SAME_END = 1e-6
"""Difference of two ends of a swing that still counts as none, relative to the swing."""
COSINE = 1e-9
"""Deviation from a cosine that still counts as none, relative to its amplitude."""


class MasterMotion(Configuration):
    """How a master's coordinate runs along a path; made by :func:`master_motion`."""

    axis: int = static(minimum=0)
    """Which axis."""
    rotational: bool = static(flag=True)
    """Whether it swings, or only rises or falls."""
    cosine: bool = static(flag=True)
    """Whether it is ``centre + amplitude cos(κ p + phase)`` in the contour parameter p."""
    steepest: Float[Array, ""] = real(above=0.0)
    """Largest |m'| [m per unit of the parameter]."""
    centre: Float[Array, ""] = real(unit="m")
    """Middle of its range."""
    amplitude: Float[Array, ""] = real(unit="m", above=0.0)
    """Half its range: R of (6)."""
    phase: Float[Array, ""] = real(unit="rad")
    """Of the cosine; 0 if it is none."""
    angle_rate: Float[Array, ""] = real(above=0.0)
    """κ, angle per contour parameter: 1 on a curve over its angle, 1/R on a circle of radius R over
    arc length; 1 if it is no cosine."""


def master_motion(law: str, path: Contour, axis: int, names: tuple[str, ...]) -> MasterMotion:
    """Return how a coordinate runs along a path.

    Parameters
    ----------
    law
        Name of the law, for the message.
    path
        In the space of the axes; must not be traced.
    axis
        Which axis.
    names
        Of the axes, for the message.

    Raises
    ------
    RefusedError
        The axis can be no master; says where it fails.
    """
    if not all(is_concrete(leaf) for leaf in jax.tree.leaves(path)):
        raise RefusedError(
            f"{law} looks at the path before the loop and cannot be bound to a contour that is "
            "traced or varied"
        )
    why = why_not_master(path, axis)
    if why:
        others = [
            names[other]
            for other in range(path.n_axes)
            if other != axis and not why_not_master(path, other)
        ]
        rest = f"; {', '.join(others)} could be the master" if others else "; nor can another axis"
        raise RefusedError(f"{law} cannot have {names[axis]} for its master: it {why}{rest}")
    grid, value, slope, _ = _rows(path, axis)
    low, high = _ends(path, axis, grid, value, slope)
    centre, amplitude = 0.5 * (low + high), 0.5 * (high - low)
    rotational = bool(np.any(slope > 0.0) and np.any(slope < 0.0))
    phase, rate, cosine = 0.0, 1.0, False
    if rotational:
        rate, phase, cosine = _as_cosine(path, axis, grid, centre, amplitude)
    return MasterMotion(
        axis=axis, rotational=rotational, cosine=cosine, steepest=np.max(np.abs(slope)),
        centre=np.asarray(centre), amplitude=np.asarray(amplitude),
        phase=np.asarray(phase), angle_rate=np.asarray(rate),
    )  # fmt: skip


def _as_cosine(
    path: Contour, axis: int, grid: NDArray[Any], centre: float, amplitude: float
) -> tuple[float, float, bool]:
    """Return κ and the phase of a coordinate that is a cosine, and whether it is one."""
    value, slope, bend = np.asarray(path_rows(path, grid, 2))[:, :, axis].T
    off = value - centre
    squared = -float(bend @ off) / float(off @ off)  # m'' = -κ² (m - centre)
    if not squared > 0.0:
        return 1.0, 0.0, False
    rate = float(np.sqrt(squared))
    phase = float(np.arctan2(-slope[0] / rate, off[0]) - rate * grid[0])
    left = off - amplitude * np.cos(rate * grid + phase)
    left_slope = slope / rate + amplitude * np.sin(rate * grid + phase)
    worst = max(float(np.max(np.abs(left))), float(np.max(np.abs(left_slope))))
    return (rate, phase, True) if worst <= COSINE * amplitude else (1.0, 0.0, False)


def why_not_master(path: Contour, axis: int) -> str:
    """Return why an axis can be no master of a path, and where, as the end of a sentence; else "".

    Parameters
    ----------
    path
        In the space of the axes.
    axis
        Which axis.
    """
    grid, value, slope, extent = _rows(path, axis)
    steepest = np.max(np.abs(slope))
    if not steepest > STILL * max(extent, 1e-300):
        return "does not move along this path"
    still = np.abs(slope) <= STILL * steepest
    run = still[:-1] & still[1:]
    if run.any():
        first = int(np.argmax(run))
        last = first + int(np.argmin(np.append(run[first:], False)))
        return (
            f"stands still at {value[first] * 1e3:.6g} mm from parameter {grid[first]:.6g} to "
            f"{grid[last]:.6g}, where its position does not say how far the path has come"
        )
    turns = _turning_points(path, axis, grid, slope)
    if not len(turns):
        return ""
    level = np.asarray(path_rows(path, turns, 1))[:, 0, axis]
    low, high = min(value.min(), level.min()), max(value.max(), level.max())
    inside = np.minimum(level - low, high - level) > SAME_END * (high - low)
    if inside.any():
        at = int(np.argmax(inside))
        return (
            f"turns back at {level[at] * 1e3:.6g} mm, parameter {turns[at]:.6g}, within its range "
            f"of {low * 1e3:.6g} to {high * 1e3:.6g} mm: it is neither monotone nor R cos θ of an "
            "angle that only grows"
        )
    return ""


def choose_master(law: str, path: Contour, model: NominalModel, names: tuple[str, ...]) -> int:
    """Return the axis that should be the master (Remark 2.1).

    Parameters
    ----------
    law
        Name of the law, for the message.
    path
        In the space of the axes.
    model
        Of the axes.
    names
        Of the axes, for the message.

    Raises
    ------
    RefusedError
        No axis can; says why not, for each.
    """
    reasons = {axis: why_not_master(path, axis) for axis in range(path.n_axes)}
    able = [axis for axis, why in reasons.items() if not why]
    if not able:
        said = "; ".join(f"{names[axis]} {why}" for axis, why in reasons.items())
        raise RefusedError(f"{law} finds no axis that can be the master of this path: {said}")
    return max(able, key=lambda axis: _slowness(model)[axis])


def _slowness(model: NominalModel) -> NDArray[Any]:
    mass, viscous, gain = (np.asarray(x, float) for x in (model.mass, model.viscous, model.gain))
    slow = mass / np.maximum(viscous, 1e-12 * mass)
    # between axes without drag: the one with the least acceleration per command
    return slow * (1.0 + 1e-9 * mass / gain)  # type: ignore[no-any-return]


def _rows(path: Contour, axis: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], float]:
    """Return where the path is looked at, a coordinate and its slope, and the steepest of all."""
    grid = path_grid(path)
    rows = np.asarray(path_rows(path, grid, 1))
    return grid, rows[:, 0, axis], rows[:, 1, axis], float(np.max(np.abs(rows[:, 1])))


def _turning_points(
    path: Contour, axis: int, grid: NDArray[Any], slope: NDArray[Any]
) -> NDArray[Any]:
    """Return the parameters at which the coordinate turns back."""
    steepest = np.max(np.abs(slope))
    sign = np.where(np.abs(slope) <= STILL * steepest, 0.0, np.sign(slope))
    moving = np.flatnonzero(sign)
    change = np.flatnonzero(sign[moving][:-1] * sign[moving][1:] < 0.0)
    first, last = moving[change], moving[change + 1]
    if path.closed and len(moving) and sign[moving[0]] * sign[moving[-1]] < 0.0:
        return np.append(_refined(path, axis, grid, slope, first, last), grid[0])
    return _refined(path, axis, grid, slope, first, last)


def _refined(
    path: Contour, axis: int, grid: NDArray[Any], slope: NDArray[Any],
    first: NDArray[Any], last: NDArray[Any],
) -> NDArray[Any]:  # fmt: skip
    low, high, rising = grid[first], grid[last], slope[first] > 0.0
    for _ in range(50 if len(first) else 0):
        middle = 0.5 * (low + high)
        here = np.asarray(path_rows(path, middle, 1))
        before = (here[:, 1, axis] > 0.0) == rising
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.asarray(0.5 * (low + high))


def _ends(
    path: Contour, axis: int, grid: NDArray[Any], value: NDArray[Any], slope: NDArray[Any]
) -> tuple[float, float]:
    turns = _turning_points(path, axis, grid, slope)
    level = value
    if len(turns):
        level = np.append(value, np.asarray(path_rows(path, turns, 1))[:, 0, axis])
    return float(level.min()), float(level.max())
