"""A part: the contour of a part file, with what the file says beside the geometry.

Every reader of part files ends in :class:`Moves`, plain arrays in three dimensions;
:func:`make_part` chooses the coordinates that form the contour and turns the moves into a
:class:`Path`. Lines stay lines, arcs arcs and helices helices: nothing is cut into chords.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray

from contourlab.contours.path import Path
from contourlab.errors import ConfigurationError, PartError

__all__ = ["Ignored", "Moves", "Part", "axis_columns", "helical_rows", "make_part"]

_AXES = "XYZ"


@dataclass(frozen=True, slots=True)
class Ignored:
    """A word that was read and does not move the tool."""

    line: int
    """Where it stands first, counted from 1."""
    count: int
    """How many times it stands in the program."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Moves:
    """The pieces of a program in X, Y, Z, one row each; no row for a move of no length."""

    start: Float[np.ndarray, "n 3"]
    """First points [m]."""
    end: Float[np.ndarray, "n 3"]
    """Last points [m]; where the program says, to the last bit of its number in metres."""
    center: Float[np.ndarray, "n 3"]
    """Centres of arcs at the height of their start [m]; NaN for lines."""
    normal: Float[np.ndarray, "n 3"]
    """Unit normals of the plane of the arc; of the selected plane for lines."""
    angle: Float[np.ndarray, " n"]
    """Swept angle about the normal, whole turns included [rad]; clockwise negative, 0 for lines."""
    source_line: Int[np.ndarray, " n"]
    """Line of the program, counted from 1."""
    feed: Float[np.ndarray, " n"]
    """Programmed feed along the path [m/s]; NaN for rapids."""
    rapid: Bool[np.ndarray, " n"]
    """Whether the piece is a rapid (G0)."""
    blend: Float[np.ndarray, " n"]
    """Blend tolerance in force [m]: NaN is an exact stop, inf a blend without tolerance."""
    dwell: Float[np.ndarray, " n"]
    """Waiting after the piece [s]."""
    dwell_before: float
    """Waiting before the first piece [s]."""

    def __len__(self) -> int:
        return len(self.angle)


@dataclass(frozen=True, eq=False, kw_only=True)
class Part:
    """A contour and what its file says about it; lives on the host, is not a pytree.

    Arrays have one entry per piece of ``path``.
    """

    path: Path
    """The contour; its coordinates are ``axes``."""
    axes: tuple[str, ...]
    """Names of the coordinates of ``path``."""
    source: str
    """Name of the file as given."""
    lines: tuple[str, ...] = field(repr=False)
    """Text of the file; line k of the program is ``lines[k - 1]``."""
    source_line: Int[np.ndarray, " n"] = field(repr=False)
    """Line of the file that made the piece, counted from 1."""
    feed: Float[np.ndarray, " n"] = field(repr=False)
    """Programmed feed [m/s]; NaN for rapids."""
    rapid: Bool[np.ndarray, " n"] = field(repr=False)
    """Whether the piece is a rapid."""
    blend: Float[np.ndarray, " n"] = field(repr=False)
    """Blend tolerance in force [m]: NaN is an exact stop, inf a blend without tolerance."""
    dwell: Float[np.ndarray, " n"] = field(repr=False)
    """Waiting after the piece [s]."""
    dwell_before: float = 0.0
    """Waiting before the first piece [s]."""
    ignored: Mapping[str, Ignored] = field(default_factory=lambda: MappingProxyType({}))
    """Words that do not move the tool, by word."""
    warnings: tuple[str, ...] = ()
    """What the reader wants seen: one sentence each."""
    largest_center_move: float = 0.0
    """The farthest that an arc's programmed centre was moved to reach its end point exactly [m]."""

    @property
    def n_pieces(self) -> int:
        """Count of pieces."""
        return len(self.source_line)

    def describe(self, piece: int) -> str:
        """Return where a piece comes from, such as ``"bracket.ngc:12: G2 X40 Y5 I0 J-5"``.

        Parameters
        ----------
        piece
            Which piece, from 0; negative from the end.

        Raises
        ------
        PartError
            No such piece.
        """
        if not -self.n_pieces <= piece < self.n_pieces:
            raise PartError(f"piece must be within 0 to {self.n_pieces - 1}, got {piece}")
        line = int(self.source_line[piece])
        return f"{self.source}:{line}: {self.lines[line - 1].strip()}"


def axis_columns(axes: Sequence[str]) -> tuple[int, ...]:
    """Return the columns of X, Y, Z that form the contour, in the order asked.

    Parameters
    ----------
    axes
        Two or three different names of X, Y, Z.

    Raises
    ------
    ConfigurationError
        Anything else.
    """
    names = tuple(axes)
    known = all(isinstance(name, str) and len(name) == 1 and name in _AXES for name in names)
    if not known or len(set(names)) != len(names) or not 2 <= len(names) <= 3:
        raise ConfigurationError(
            f"axes must be two or three different ones of X, Y, Z, got {names!r}"
        )
    return tuple(_AXES.index(name) for name in names)


def helical_rows(moves: Moves) -> tuple[NDArray[Any], ...]:
    """Return the rows of :meth:`Path.from_helical` for the moves, in three dimensions.

    With the radius vector ρ from the centre to the start, the plane's normal n, the angle φ and the
    rise h along n, the length is L = √((|ρ|φ)² + h²) and

        U = |ρ||φ|/L sign(φ) n×ρ/|ρ|,  V = -|ρ||φ|/L ρ/|ρ|,  W = h/L n,  rate = |φ|/L.

    Parameters
    ----------
    moves
        Lines and arcs.

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


def make_part(
    moves: Moves,
    *,
    axes: Sequence[str],
    source: str,
    lines: Sequence[str],
    ignored: Mapping[str, Ignored] | None = None,
    warnings: Sequence[str] = (),
    largest_center_move: float = 0.0,
) -> Part:
    """Return the part made of moves.

    Parameters
    ----------
    moves
        One piece or more; nothing may move in a coordinate that is not in ``axes``.
    axes
        Coordinates of the contour, two or three of X, Y, Z.
    source, lines
        Name and text of the file.
    ignored, warnings, largest_center_move
        See :class:`Part`.

    Raises
    ------
    PartError
        No moves, or motion outside ``axes``.
    """
    columns = axis_columns(axes)
    if not len(moves):
        raise PartError(f"{source}: nothing moves, so there is no contour")
    start, tangent, normal, axial, rate, length, source_line = helical_rows(moves)
    others = [k for k in range(3) if k not in columns]
    for k in others:
        moving = (np.abs(np.stack([tangent[:, k], normal[:, k], axial[:, k]])) > 0).any(axis=0)
        if moving.any():
            line = int(source_line[int(np.argmax(moving))])
            raise PartError(f"{source}:{line}: moves in {_AXES[k]}, which is not in axes {axes!r}")
    pick = list(columns)
    path = Path.from_helical(
        start[:, pick], tangent[:, pick], normal[:, pick], axial[:, pick], rate, length, source_line
    )
    return Part(
        path=path,
        axes=tuple(axes),
        source=source,
        lines=tuple(lines),
        source_line=source_line,
        feed=moves.feed,
        rapid=moves.rapid,
        blend=moves.blend,
        dwell=moves.dwell,
        dwell_before=moves.dwell_before,
        ignored=MappingProxyType(dict(ignored or {})),
        warnings=tuple(warnings),
        largest_center_move=largest_center_move,
    )
