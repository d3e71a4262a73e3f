"""Moves: the pieces of a part file as plain arrays, and the path that they make.

Lines and arcs are rows of the helical formula, splines rational Bézier curves; a path may need
several pieces for one spline, so that its parameter is arc length to the last digits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray

from contourlab.contours.bezier_rows import bezier_rows, elevated
from contourlab.contours.path import Path
from contourlab.contours.path_rows import path_fields
from contourlab.errors import GeometryError

__all__ = ["Moves", "helical_rows", "path_of_moves", "unfit_spline"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Moves:
    """The pieces of a program in X, Y, Z, one row each; no row for a move of no length."""

    start: Float[np.ndarray, "n 3"]
    """First points [m]."""
    end: Float[np.ndarray, "n 3"]
    """Last points [m]; where the program says, to the last bit of its number in metres."""
    center: Float[np.ndarray, "n 3"]
    """Centres of arcs at the height of their start [m]; NaN for lines and splines."""
    normal: Float[np.ndarray, "n 3"]
    """Unit normals of the plane of the arc; of the selected plane for lines."""
    angle: Float[np.ndarray, " n"]
    """Swept angle about the normal, whole turns included [rad]; clockwise negative, 0 for lines."""
    spline: Int[np.ndarray, " n"]
    """Row of ``control_points`` that the piece is, -1 for lines and arcs."""
    control_points: tuple[NDArray[Any], ...]
    """Rational Bézier curves: homogeneous control points (w x, w y, w z, w), (degree + 1, 4)."""
    source_line: Int[np.ndarray, " n"]
    """Line of the program, counted from 1; of the call, for a piece from another file."""
    file: Int[np.ndarray, " n"]
    """Which file the piece comes from, 0 for the program."""
    file_line: Int[np.ndarray, " n"]
    """Line in that file."""
    feed: Float[np.ndarray, " n"]
    """Programmed feed along the path [m/s]; NaN for rapids."""
    rapid: Bool[np.ndarray, " n"]
    """Whether the piece is a rapid (G0)."""
    blend: Float[np.ndarray, " n"]
    """Blend tolerance in force [m]: NaN is an exact stop, inf a blend without tolerance."""
    merge: Float[np.ndarray, " n"]
    """Tolerance within which lines may be merged (Q of G64) [m]; NaN for not at all."""
    dwell: Float[np.ndarray, " n"]
    """Waiting after the piece [s]."""
    dwell_before: float
    """Waiting before the first piece [s]."""

    def __len__(self) -> int:
        return len(self.angle)


def helical_rows(moves: Moves) -> tuple[NDArray[Any], ...]:
    """Return the rows of :meth:`Path.from_helical` for the moves, in three dimensions.

    With the radius vector ρ from the centre to the start, the plane's normal n, the angle φ and the
    rise h along n, the length is L = √((|ρ|φ)² + h²) and

        U = |ρ||φ|/L sign(φ) n×ρ/|ρ|,  V = -|ρ||φ|/L ρ/|ρ|,  W = h/L n,  rate = |φ|/L.

    Parameters
    ----------
    moves
        Lines and arcs; rows of splines mean nothing.

    Returns
    -------
    tuple of arrays
        ``start``, ``tangent_vector``, ``normal_vector``, ``axial_vector`` (n, 3), ``angle_rate``
        and ``length`` (n,), ``source_line`` (n,) int32.
    """
    chord = moves.end - moves.start
    turning = moves.angle != 0.0
    radius = np.where(turning[:, None], moves.start - moves.center, 0.0)
    size = np.sqrt(np.sum(radius * radius, axis=1))
    rise = np.where(turning, np.sum(chord * moves.normal, axis=1), 0.0)
    swept = np.abs(moves.angle)
    straight = np.sqrt(np.sum(chord * chord, axis=1))
    length = np.where(turning, np.hypot(size * swept, rise), straight)
    outward = radius / np.where(turning, size, 1.0)[:, None]
    sideways = np.cross(moves.normal, outward) * np.sign(moves.angle)[:, None]
    share = (size * swept / length)[:, None]
    straight = np.where(turning, 1.0, straight)  # a full circle has no chord
    tangent = np.where(turning[:, None], share * sideways, chord / straight[:, None])
    return (
        moves.start,
        tangent,
        np.where(turning[:, None], -share * outward, 0.0),
        np.where(turning[:, None], (rise / length)[:, None] * moves.normal, 0.0),
        swept / length,
        length,
        moves.source_line,
    )


def path_of_moves(moves: Moves, columns: tuple[int, ...]) -> tuple[Path, NDArray[Any]]:
    """Return the path, and for each of its pieces the move that it comes from.

    Parameters
    ----------
    moves
        One or more.
    columns
        Coordinates of the path, of X, Y, Z by number.

    Raises
    ------
    GeometryError
        A spline with a cusp.
    """
    pick = list(columns)
    straight = np.flatnonzero(moves.spline < 0)
    curved = np.flatnonzero(moves.spline >= 0)
    start, u, v, w, rate, length, line = helical_rows(_taken(moves, straight))
    start, u, v, w = start[:, pick], u[:, pick], v[:, pick], w[:, pick]
    if not len(curved):
        return Path.from_helical(start, u, v, w, rate, length, line), straight
    curves = [moves.control_points[row] for row in moves.spline[curved]]
    count = max(len(curve) for curve in curves)
    rows = np.concatenate([elevated(curve[None][..., [*pick, 3]], count) for curve in curves])
    rows, inverse, lengths, owner = bezier_rows(rows)
    # order by the move they come from, stretches of one spline as they are
    owners = np.concatenate([straight, curved[owner]])
    order = np.argsort(owners, kind="stable")
    owners = owners[order]

    def merged(helical: Any, bezier: Any) -> Any:
        return np.concatenate([helical, bezier])[order]

    none = np.zeros((len(rows), len(pick)))
    kinds = merged(np.full(len(straight), -1, np.int32), np.arange(len(rows), dtype=np.int32))
    fields = path_fields(
        merged(start, rows[:, 0, :-1] / rows[:, 0, -1:]),
        merged(u, none), merged(v, none), merged(w, none),
        merged(rate, np.zeros(len(rows))), merged(length, lengths), kinds, rows, inverse,
        moves.source_line[owners], False,
    )  # fmt: skip
    return Path(**fields), owners


def _taken(moves: Moves, rows: NDArray[Any]) -> Moves:
    """Return some of the moves."""
    arrays = {
        name: value[rows] for name, value in vars(moves).items() if isinstance(value, np.ndarray)
    }
    return replace(moves, **arrays) if len(rows) < len(moves) else moves


def unfit_spline(moves: Moves) -> tuple[int, str] | None:
    """Return the first spline that cannot be a piece of a path and the reason, None if all can.

    Parameters
    ----------
    moves
        Of a program.
    """
    for piece in np.flatnonzero(moves.spline >= 0):
        try:
            bezier_rows(moves.control_points[moves.spline[piece]][None])
        except GeometryError as error:
            reason = str(error).partition("0 ")[2] or str(error)
            return int(piece), f"the spline {reason}"
    return None
