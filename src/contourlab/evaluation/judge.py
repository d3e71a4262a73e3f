"""The exact contour error of a log against the path that was commanded."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.contours import Path, foot_point, read_points
from contourlab.errors import ContourlabError, LogError
from contourlab.evaluation.stretches import stretches

__all__ = ["SPLINE_POINTS", "Judged", "against_commanded", "tangents"]

SPLINE_POINTS = 50_000
"""Most points of a stretch that a spline is fitted to."""
_STANDS = 1e-12
"""Steps shorter than this are no motion [m]."""

Values = NDArray[Any]


class Judged(NamedTuple):
    """Every sample against a path."""

    error: Values
    """Contour error, signed in the plane and a norm otherwise [m]; NaN where it is not judged."""
    vector: Values
    """From the actual position to the path [m]."""
    foot: Values
    """Point of the path that is nearest [m]."""
    parameter: Values
    """Its arc length from the start of the path [m]."""
    tangent: Values
    """Unit tangent there."""
    piece: Values
    """Piece of the path; -1 where there is none."""
    length: float
    """Of the path [m]."""


def empty(n: int, n_axes: int) -> Judged:
    """Return a record in which nothing is judged.

    Parameters
    ----------
    n, n_axes
        Its shape.
    """
    rows = [np.full((n, n_axes), np.nan) for _ in range(3)]
    one = np.full(n, np.nan)
    return Judged(one, rows[0], rows[1], one.copy(), rows[2], np.full(n, -1), 0.0)


def against_commanded(
    commanded: Values, actual: Values, jumps: Values, left_out: Values, *,
    spline: bool = False, tolerance: float | None = None,
) -> Judged:  # fmt: skip
    """Return the contour error against the path through the commanded positions.

    Parameters
    ----------
    commanded, actual
        Shape (n, n_axes) [m].
    jumps
        Rows after which the record jumps: the path is broken there.
    left_out
        Which rows are not judged.
    spline
        Whether a spline is laid through the positions; else lines join them.
    tolerance
        How far the spline may be from them [m]; through them if None.

    Raises
    ------
    LogError
        The commanded positions stand still, or a spline is asked of too many.
    """
    n, n_axes = commanded.shape
    found = empty(n, n_axes)
    length = 0.0
    pieces = 0
    for at in stretches(n, jumps):
        if left_out[at].all():
            continue
        part = _stretch(commanded[at], actual[at], spline, tolerance)
        if part is None:
            continue
        for whole, rows in zip(found[:-1], part[:-1], strict=True):
            whole[at] = rows
        found.parameter[at] += length
        found.piece[at] += pieces
        pieces += int(part.piece.max()) + 1
        length += part.length
    if length == 0.0:
        raise LogError("the commanded positions describe no path: nothing moves between its breaks")
    found.error[left_out] = np.nan
    return found._replace(length=length)


def _stretch(
    commanded: Values, actual: Values, spline: bool, tolerance: float | None
) -> Judged | None:
    step = np.linalg.norm(np.diff(commanded, axis=0), axis=1)
    moves = np.concatenate([[True], step > _STANDS])
    vertices = commanded[moves]
    if len(vertices) < 2:
        return None
    at = np.concatenate([[0.0], np.cumsum(np.where(step > _STANDS, step, 0.0))])
    if not spline:
        legs = np.diff(vertices, axis=0)
        size = np.linalg.norm(legs, axis=1)
        starts = np.concatenate([[0.0], np.cumsum(size)[:-1]])

        def look(_: Path, parameter: Values) -> tuple[Values, Values]:
            piece = np.clip(np.searchsorted(starts, parameter, side="right") - 1, 0, len(size) - 1)
            return piece, legs[piece] / size[piece, None]

        return against_path(
            Path.polyline(vertices), actual, at, open_ends=_open_ends(step), look=look
        )
    if len(vertices) > SPLINE_POINTS:
        raise LogError(
            f"a spline is fitted to at most {SPLINE_POINTS} points, got {len(vertices)}: take "
            "the polyline, or cut the log"
        )
    try:
        path = read_points(
            vertices, unit="m", spline=True, tolerance=tolerance,
            parametrisation="chord", axes=[f"a{k}" for k in range(commanded.shape[1])],
        ).path  # fmt: skip
    except ContourlabError as error:
        raise LogError(f"no spline through the commanded positions: {error}") from None
    near = at * (float(path.length) / at[-1])
    near = np.asarray(foot_point(path, commanded, near=near).parameter)
    return against_path(path, actual, near, open_ends=_open_ends(step))


def _open_ends(step: Values) -> tuple[bool, bool]:
    """Return whether a stretch begins and ends in motion."""
    usual = 0.2 * float(np.median(step[step > _STANDS]))
    return bool(step[0] > usual), bool(step[-1] > usual)


def against_path(
    path: Path, actual: Values, near: Values, *, open_ends: tuple[bool, bool] = (False, False),
    look: Callable[[Path, Values], tuple[Values, Values]] | None = None,
) -> Judged:  # fmt: skip
    """Return the local contour error against a path.

    Parameters
    ----------
    path
        The path.
    actual
        Shape (n, n_axes) [m].
    near
        Where the reference is on it, shape (n,) [m].
    open_ends
        Whether the path goes on before its start and after its end: the record began or ended in
        motion. Samples that are beyond an open end are not judged.
    look
        What returns pieces and tangents of the path; :func:`tangents` if None.
    """
    feet = foot_point(path, actual, near=near)
    parameter = np.asarray(feet.parameter)
    piece, tangent = (look or tangents)(path, parameter)
    vector, error = np.asarray(feet.vector), np.asarray(feet.distance).copy()
    length = float(path.length)
    along = np.einsum("ij,ij->i", vector, tangent)
    tiny = 1e-9 * length
    if open_ends[0]:
        error[(parameter <= tiny) & (along > 0.0)] = np.nan
    if open_ends[1]:
        error[(parameter >= length - tiny) & (along < 0.0)] = np.nan
    return Judged(error, vector, np.asarray(feet.position), parameter, tangent, piece, length)


def tangents(path: Path, parameter: Values) -> tuple[Values, Values]:
    """Return pieces and unit tangents of a path at parameters, in batches.

    Parameters
    ----------
    path
        The path.
    parameter
        Shape (n,) [m].
    """
    domain = float(path.length)
    s = np.asarray(parameter, float)
    s = np.mod(s, domain) if path.closed else np.clip(s, 0.0, domain)
    s = np.where(np.isfinite(s), s, 0.0)
    size = 1 << max(int(np.ceil(np.log2(max(len(s), 1)))), 8)
    piece, tangent = _looking()(path, np.pad(s, (0, size - len(s))))
    return np.asarray(piece)[: len(s)].copy(), np.asarray(tangent)[: len(s)].copy()


@cache
def _looking() -> Any:
    """Return the batch look-up, compiled once for every shape of path."""
    import jax
    import jax.numpy as jnp

    def batch(path: Path, parameters: Any) -> Any:
        def at(value: Any) -> Any:
            piece = path.find(value)
            slope = path.derivatives(value, 1, piece)[1]
            return piece, slope / jnp.maximum(jnp.linalg.norm(slope), 1e-300)

        return jax.vmap(at)(parameters)

    return jax.jit(batch)
