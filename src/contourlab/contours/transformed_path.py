"""Paths transformed row by row: the result is a path again."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import is_concrete, replace
from contourlab.contours.bezier_rows import bezier_rows, elevated
from contourlab.contours.circle import TURN
from contourlab.contours.helical import helical_ends
from contourlab.contours.path import Path
from contourlab.contours.path_rows import path_fields
from contourlab.errors import GeometryError
from contourlab.typing import Array, Scalar

__all__ = ["affine_path", "reversed_path", "similar_path", "stretch_of_path"]

_STRAIGHT = 1e-12
"""A helical piece that turns by no more than this is a line [rad]."""
_SPLINTER = 1e-12
"""A piece of which less than this fraction of the path is left is dropped."""

Rows = NDArray[Any]


def similar_path(path: Path, matrix: Array, offset: Array, factor: Scalar) -> Path:
    """Return a path after a similarity ``x -> matrix x + offset``, exactly; traceable.

    Parameters
    ----------
    path
        The path.
    matrix
        A rotation or reflection times the factor, shape (n_axes, n_axes).
    offset
        Shape (n_axes,) [m].
    factor
        By which lengths change, > 0.
    """
    matrix, offset = jnp.asarray(matrix), jnp.asarray(offset)
    turned = matrix / factor
    weights = jnp.asarray(path.control_points)[..., -1:]
    points = jnp.asarray(path.control_points)[..., :-1] @ matrix.T + weights * offset
    changed = {
        "breaks": jnp.asarray(path.breaks) * factor,
        "origin": jnp.asarray(path.origin) @ matrix.T + offset,
        "angle_rate": jnp.asarray(path.angle_rate) / factor,
        "control_points": jnp.concatenate([points, weights], axis=-1),
    }
    for name in ("tangent_vector", "normal_vector", "axial_vector"):
        changed[name] = jnp.asarray(getattr(path, name)) @ turned.T
    known = {k: np.asarray(v) if is_concrete(v) else v for k, v in changed.items()}
    return replace(path, **known)


def reversed_path(path: Path) -> Path:
    """Return a path run from its end to its start, exactly.

    Parameters
    ----------
    path
        The path.
    """
    breaks = np.asarray(path.breaks)
    length, rate = np.diff(breaks), np.asarray(path.angle_rate)
    u, v, w = (
        np.asarray(vector)
        for vector in (path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    end = np.array(helical_ends(np.asarray(path.origin), u, v, w, rate, length)[0])
    cosine, sine = np.cos(rate * length)[:, None], np.sin(rate * length)[:, None]
    control = np.asarray(path.control_points)[:, ::-1]
    rows = np.asarray(path.bezier_row)
    curved = rows >= 0
    if curved.any():
        first = control[rows[curved], 0]
        end[curved] = first[:, :-1] / first[:, -1:]
    # u backwards is 1 - u, over the arc length from the other end: x becomes -x
    inverse = -np.asarray(path.inverse_length) * (-1.0) ** np.arange(path.inverse_length.shape[-1])
    if len(inverse):
        inverse[:, 0] += 1.0
    return replace(
        path,
        breaks=breaks[0] + (breaks[-1] - breaks[::-1]),
        origin=end[::-1],
        tangent_vector=-(u * cosine + v * sine)[::-1],
        normal_vector=(v * cosine - u * sine)[::-1],
        axial_vector=-w[::-1],
        angle_rate=rate[::-1],
        bezier_row=rows[::-1],
        control_points=control,
        inverse_length=inverse,
        source_line=np.asarray(path.source_line)[::-1],
    )


def affine_path(path: Path, matrix: Array, offset: Array) -> Path:
    """Return a path after ``x -> matrix x + offset``, exactly: planar arcs become Bézier pieces.

    Parameters
    ----------
    path
        The path, of known numbers.
    matrix
        Shape (n_axes, n_axes), not singular.
    offset
        Shape (n_axes,) [m].

    Raises
    ------
    GeometryError
        A helix, which would be none any more; traced numbers.
    """
    if not all(is_concrete(value) for value in (matrix, offset, path.breaks, path.control_points)):
        raise GeometryError(
            "a path is scaled by different factors before tracing, not inside jit, vmap or grad"
        )
    matrix, offset = np.asarray(matrix), np.asarray(offset)
    kinds = np.asarray(path.bezier_row)
    rate, length = np.asarray(path.angle_rate), np.diff(np.asarray(path.breaks))
    lines = (kinds < 0) & (np.abs(rate) * length <= _STRAIGHT)
    arcs = (kinds < 0) & ~lines
    climb = np.linalg.norm(np.asarray(path.axial_vector), axis=1)
    if (arcs & (climb > 0.0)).any():
        at = int(np.argmax(arcs & (climb > 0.0)))
        raise GeometryError(
            f"piece {at} is a helix, which a path cannot hold after different factors on its axes"
        )
    parts: list[tuple[Rows, Rows]] = []  # control points and the pieces that they come from
    if arcs.any():
        parts.append(_arc_controls(path, np.flatnonzero(arcs)))
    if (kinds >= 0).any():
        own = np.flatnonzero(kinds >= 0)
        parts.append((np.asarray(path.control_points)[kinds[own]], own))
    n_axes = path.n_axes
    control, inverse = np.zeros((0, 2, n_axes + 1)), np.zeros((0, 1))
    curve_length, owner = np.zeros(0), np.zeros(0, np.intp)
    if parts:
        degree = max(rows.shape[1] for rows, _ in parts)
        rows = np.concatenate([elevated(rows, degree) for rows, _ in parts])
        source = np.concatenate([own for _, own in parts])
        order = np.argsort(source, kind="stable")
        rows, source = rows[order], source[order]
        points = rows[..., :-1] @ matrix.T + rows[..., -1:] * offset
        control, inverse, curve_length, made = bezier_rows(
            np.concatenate([points, rows[..., -1:]], axis=-1)
        )
        owner = source[made]
    straight = np.flatnonzero(lines)
    ends = helical_ends(
        np.asarray(path.origin), np.asarray(path.tangent_vector), np.asarray(path.normal_vector),
        np.asarray(path.axial_vector), rate, length,
    )[0]  # fmt: skip
    first = np.asarray(path.origin)[straight] @ matrix.T + offset
    steps = ends[straight] @ matrix.T + offset - first
    line_length = np.linalg.norm(steps, axis=1)
    piece = np.concatenate([straight, owner])
    order = np.argsort(piece, kind="stable")
    zero = np.zeros((len(piece), n_axes))
    tangent = np.concatenate([steps / line_length[:, None], zero[: len(owner)]])
    start = np.concatenate([first, control[:, 0, :-1] / control[:, 0, -1:]])
    number = np.concatenate([np.full(len(straight), -1), np.arange(len(owner))]).astype(np.int32)
    return Path(**path_fields(
        start[order], tangent[order], zero, zero, np.zeros(len(piece)),
        np.concatenate([line_length, curve_length])[order], number[order], control, inverse,
        np.asarray(path.source_line)[piece[order]], path.closed,
    ))  # fmt: skip


def _arc_controls(path: Path, arcs: Rows) -> tuple[Rows, Rows]:
    """Return planar arcs as rational quadratics of a quarter turn at most, and their pieces."""
    rate, length = np.asarray(path.angle_rate)[arcs], np.diff(np.asarray(path.breaks))[arcs]
    count = np.maximum(np.ceil(np.abs(rate) * length / (0.25 * TURN) - 1e-9), 1).astype(int)
    owner = np.repeat(np.arange(len(arcs)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    low, high = number / count[owner], (number + 1) / count[owner]
    origin, u, v, w = (
        np.asarray(vector)[arcs][owner]
        for vector in (path.origin, path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    first, tangent, _ = helical_ends(origin, u, v, w, rate[owner], length[owner] * low)
    last, _, _ = helical_ends(origin, u, v, w, rate[owner], length[owner] * high)
    half = 0.5 * np.abs(rate * length / count)[owner]
    # where the tangents at the two ends meet
    middle = first + tangent * (np.tan(half) / np.abs(rate[owner]))[:, None]
    weight = np.stack([np.ones_like(half), np.cos(half), np.ones_like(half)], axis=1)[..., None]
    points = np.stack([first, middle, last], axis=1)
    return np.concatenate([points * weight, weight], axis=-1), arcs[owner]


def stretch_of_path(path: Path, start: float, end: float) -> Path:
    """Return the stretch of a path between two arc lengths, an open path that begins at 0.

    Parameters
    ----------
    path
        The path, of known numbers.
    start, end
        Arc lengths [m], in order; on a closed path at most one round apart.
    """
    breaks = np.asarray(path.breaks)
    total = breaks[-1] - breaks[0]
    laps = np.floor((start - breaks[0]) / total) if path.closed else 0.0
    start, end = start - laps * total, end - laps * total
    pieces: list[tuple[int, float, float]] = []
    for lap in range(2 if path.closed else 1):
        edges = breaks + lap * total
        for k in np.flatnonzero((edges[1:] > start) & (edges[:-1] < end)):
            low, high = max(start, edges[k]), min(end, edges[k + 1])
            if high - low > _SPLINTER * total:
                pieces.append((int(k), float(low - edges[k]), float(high - edges[k])))
    return Path.join([_part_of_piece(path.piece(k), low, high) for k, low, high in pieces])


def _part_of_piece(piece: Path, low: float, high: float) -> Path:
    length = float(piece.length)
    if low <= 0.0 and high >= length:
        return piece
    if piece.kinds == "bezier":
        ends = np.asarray(piece.inverse_length)[0]
        u = np.clip(
            np.polynomial.chebyshev.chebval(2.0 * np.array([low, high]) / length - 1.0, ends), 0, 1
        )
        control = _blossomed(np.asarray(piece.control_points)[0], float(u[0]), float(u[1]))
        weights = control[:, -1]
        return Path.from_bezier(
            (control[:, :-1] / weights[:, None])[None], weights[None], piece.source_line
        )
    u, v, w = (
        np.asarray(vector)
        for vector in (piece.tangent_vector, piece.normal_vector, piece.axial_vector)
    )
    rate = np.asarray(piece.angle_rate)
    point, _, _ = helical_ends(np.asarray(piece.origin), u, v, w, rate, np.full(1, low))
    cosine, sine = np.cos(rate * low)[:, None], np.sin(rate * low)[:, None]
    return Path.from_helical(
        point, u * cosine + v * sine, v * cosine - u * sine, w, rate, np.full(1, high - low),
        piece.source_line,
    )  # fmt: skip


def _blossomed(control: Rows, low: float, high: float) -> Rows:
    """Return the control points of the part of a Bézier curve between two parameters."""

    def left(rows: Rows, u: float) -> Rows:
        kept = [rows[0]]
        while len(rows) > 1:
            rows = rows[:-1] + u * (rows[1:] - rows[:-1])
            kept.append(rows[0])
        return np.stack(kept)

    upto = left(control, high)
    return left(upto[::-1], 1.0 - low / high)[::-1]
