"""The parameters at which a path is looked at before a loop begins, and its derivatives there.

A path of pieces is looked at piece by piece, so that nothing is too short to be seen: on every
piece at its start, its middle and between, and on arcs every eighth of π at least, which is where
a coordinate of an arc can turn back. On a spline the spans between knots are the pieces. Any other
formula is looked at on a grid of :data:`POINTS`; what it does between two of them is not seen.

Derivatives are right-sided at joints, so that the start of a piece belongs to the piece.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.path import Path
from contourlab.contours.spline import Spline
from contourlab.contours.wrapped import Reversed, Stretch, Transformed
from contourlab.typing import Array

__all__ = ["fine_grid", "path_grid", "path_rows"]

POINTS = 2048
"""On a formula without pieces."""
PER_PIECE = 8
"""On a piece, at least."""
TURN = np.pi / 8.0
"""On an arc, at most between two points [rad]."""


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
    breaks, angles = _pieces(path)
    if breaks is None:
        return np.linspace(low, high, POINTS + 1)
    counts = np.maximum(PER_PIECE, np.ceil(angles / TURN).astype(int))
    owner = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = breaks[owner] + np.diff(breaks)[owner] * (within / counts[owner])
    return np.concatenate([[low], at[(at > low) & (at < high)], [high]])


def fine_grid(path: Contour) -> NDArray[Any]:
    """Return the parameters of :func:`path_grid` and a uniform grid, for least and largest values.

    Parameters
    ----------
    path
        In the space of the axes.
    """
    low, high = (float(np.asarray(end)) for end in path.domain)
    return np.union1d(path_grid(path), np.linspace(low, high, POINTS + 1))


def _pieces(path: Contour) -> tuple[NDArray[Any] | None, Any]:
    """Return the parameters between which pieces lie, and by how much each turns if it is an arc.

    No parameters for a formula without pieces.
    """
    if isinstance(path, Path):
        breaks = np.asarray(path.breaks)
        return breaks, np.abs(np.asarray(path.angle_rate)) * np.diff(breaks)
    if isinstance(path, Spline):
        knots = np.unique(np.asarray(path.knot_vector))
        low, high = (float(np.asarray(end)) for end in path.domain)
        breaks = np.concatenate([[low], knots[(knots > low) & (knots < high)], [high]])
        return breaks, np.zeros(len(breaks) - 1)
    if isinstance(path, Reversed):
        inner, angles = _pieces(path.inner)
        start, end = (float(np.asarray(edge)) for edge in path.domain)
        return (None if inner is None else (start + end - inner)[::-1]), angles[::-1]
    if isinstance(path, Transformed | Stretch):
        return _pieces(path.inner)
    return None, np.zeros(0)
