"""Which axis can be the master of a path, and how its coordinate runs along it.

A master is *monotone* if its coordinate only rises or only falls along the path, and *rotational*
if it swings between the same two ends (Assumptions 3.1 and 3.2). A coordinate that stands still
over a stretch (the side of a rectangle) or that turns back elsewhere than at the ends of its range
has no position variable: the place on the path does not follow from the position.

Paths are looked at on a grid, 2048 points over the domain, and turning points are found to rounding
by Newton's method.

Remark 2.1 says to take the least precise axis for the master, because the slaves make up for its
error. Of the axes that can be the master, :func:`choose_master` takes the one that answers most
slowly, by its model: mass over viscous drag, if the model has any.

References
----------
.. [CaoZhang] Assumptions 3.1 and 3.2, Remark 2.1.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from contourlab.configuration import Configuration, is_concrete, real, static
from contourlab.contours.base import Contour
from contourlab.errors import RefusedError
from contourlab.machines.base import NominalModel
from contourlab.typing import Array

__all__ = [
    "MasterMotion",
    "choose_master",
    "master_motion",
    "path_grid",
    "path_rows",
    "why_not_master",
]

POINTS = 2048
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
    """Whether it is ``centre + amplitude cos(p + phase)`` in the contour parameter p."""
    steepest: Float[Array, ""] = real(above=0.0)
    """Largest |m'| [m per unit of the parameter]."""
    centre: Float[Array, ""] = real(unit="m")
    """Middle of its range."""
    amplitude: Float[Array, ""] = real(unit="m", above=0.0)
    """Half its range: R of (6)."""
    phase: Float[Array, ""] = real(unit="rad")
    """Of the cosine; 0 if it is none."""


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
    grid, value, slope = _rows(path, axis)
    low, high = _ends(path, axis, grid, value, slope)
    centre, amplitude = 0.5 * (low + high), 0.5 * (high - low)
    rotational = bool(np.any(slope > 0.0) and np.any(slope < 0.0))
    phase = 0.0
    cosine = False
    if rotational:
        phase = float(np.arctan2(-slope[0], value[0] - centre) - grid[0])
        off = value - centre - amplitude * np.cos(grid + phase)
        cosine = bool(np.max(np.abs(off)) <= COSINE * amplitude)
    return MasterMotion(
        axis=axis, rotational=rotational, cosine=cosine, steepest=np.max(np.abs(slope)),
        centre=np.asarray(centre), amplitude=np.asarray(amplitude),
        phase=np.asarray(phase if cosine else 0.0),
    )  # fmt: skip


def why_not_master(path: Contour, axis: int) -> str:
    """Return why an axis can be no master of a path, and where, as the end of a sentence; else "".

    Parameters
    ----------
    path
        In the space of the axes.
    axis
        Which axis.
    """
    grid, value, slope = _rows(path, axis)
    steepest = np.max(np.abs(slope))
    extent = np.max(np.abs(np.asarray(path_rows(path, grid, 2))[:, 1]))
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


@functools.partial(jax.jit, static_argnames=("order",))
def path_rows(path: Contour, parameter: Array, order: int) -> Array:
    """Return derivatives at many parameters, shape (n, order + 1, n_axes).

    Parameters
    ----------
    path
        In the space of the axes.
    parameter
        Shape (n,).
    order
        Highest derivative; static.
    """
    return jax.vmap(lambda p: path.derivatives(p, order))(parameter)


def path_grid(path: Contour) -> NDArray[Any]:
    """Return the parameters at which a path is looked at, both ends of its domain included.

    Parameters
    ----------
    path
        In the space of the axes.
    """
    low, high = (float(np.asarray(end)) for end in path.domain)
    return np.linspace(low, high, POINTS + 1)


def _rows(path: Contour, axis: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    grid = path_grid(path)
    rows = np.asarray(path_rows(path, grid, 2))
    return grid, rows[:, 0, axis], rows[:, 1, axis]


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
