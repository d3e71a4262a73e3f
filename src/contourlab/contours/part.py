"""A part: the contour of a part file, with what the file says beside the geometry.

Every reader of part files ends in :class:`Moves`, plain arrays in three dimensions;
:func:`make_part` chooses the coordinates that form the contour and turns the moves into a
:class:`Path`. Lines stay lines, arcs arcs, helices helices and splines splines: nothing is cut into
chords. A spline may become several pieces of the path, each with the entries of its move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from contourlab.contours.moves import Moves, helical_rows, path_of_moves, unfit_spline
from contourlab.contours.path import Path
from contourlab.errors import ConfigurationError, GeometryError, PartError

__all__ = [
    "Ignored",
    "Moves",
    "Part",
    "SourceFile",
    "axis_columns",
    "helical_rows",
    "make_part",
    "unfit_spline",
]

_AXES = "XYZ"
_FLAT = 1e-12
"""A spline that rises by no more than this lies in a plane [m]."""


@dataclass(frozen=True, slots=True)
class Ignored:
    """A word that was read and does not move the tool."""

    line: int
    """Where it stands first, counted from 1."""
    count: int
    """How many times it stands in the program."""


class SourceFile(NamedTuple):
    """A file that a part comes from."""

    name: str
    """As given, or as found."""
    lines: Sequence[str]
    """Its text."""


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
    """Line of the file that made the piece, counted from 1.

    For a piece from a subprogram in another file it is the line of the call.
    """
    feed: Float[np.ndarray, " n"] = field(repr=False)
    """Programmed feed [m/s]; NaN for rapids."""
    rapid: Bool[np.ndarray, " n"] = field(repr=False)
    """Whether the piece is a rapid."""
    blend: Float[np.ndarray, " n"] = field(repr=False)
    """Blend tolerance in force [m]: NaN is an exact stop, inf a blend without tolerance."""
    dwell: Float[np.ndarray, " n"] = field(repr=False)
    """Waiting after the piece [s]."""
    merge: Float[np.ndarray, " n"] | None = field(default=None, repr=False)
    """Tolerance within which lines may be merged (Q of G64) [m]; NaN, the default, for none."""
    file: Int[np.ndarray, " n"] | None = field(default=None, repr=False)
    """Which of ``files`` the piece comes from; 0 is the part file itself, and the default."""
    file_line: Int[np.ndarray, " n"] | None = field(default=None, repr=False)
    """Line in that file; ``source_line`` by default."""
    files: tuple[SourceFile, ...] = field(default=(), repr=False)
    """The part file and the files that it calls; the part file by default."""
    dwell_before: float = 0.0
    """Waiting before the first piece [s]."""
    ignored: Mapping[str, Ignored] = field(default_factory=lambda: MappingProxyType({}))
    """Words that do not move the tool, by word."""
    warnings: tuple[str, ...] = ()
    """What the reader wants seen: one sentence each."""
    largest_center_move: float = 0.0
    """The farthest that an arc's programmed centre was moved to reach its end point exactly [m]."""

    def __post_init__(self) -> None:
        for name, value in (
            ("merge", np.full(len(self.source_line), np.nan)),
            ("file", np.zeros(len(self.source_line), np.int32)),
            ("file_line", self.source_line),
        ):
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        if not self.files:
            object.__setattr__(self, "files", (SourceFile(self.source, self.lines),))

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
        assert self.file is not None
        assert self.file_line is not None
        number = int(self.file[piece])
        if number == 0:
            return f"{self.source}:{line}: {self.lines[line - 1].strip()}"
        file, own = self.files[number], int(self.file_line[piece])
        text = file.lines[own - 1].strip()
        return f"{file.name}:{own}: {text} (called at {self.source}:{line})"

    def restricted(
        self,
        *,
        lines: tuple[int, int] | None = None,
        plane: str | None = None,
        feed_only: bool = False,
    ) -> Part:
        """Return the part made of some consecutive pieces of this one.

        Parameters
        ----------
        lines
            First and last line of the program whose pieces are kept.
        plane
            ``"XY"``, ``"ZX"``, ...: pieces along which the other coordinate changes are left out,
            and the coordinate with them, so that the contour is planar. Stretches of rapids alone
            are left out too. What is left must be one stretch.
        feed_only
            Whether rapids at the beginning and at the end are left out.

        Raises
        ------
        PartError
            Nothing is left, or pieces that are not connected; says which lines are.
        ConfigurationError
            An option that is not allowed.
        """
        from contourlab.contours.restricted import restricted_part  # which makes parts

        return restricted_part(self, lines=lines, plane=plane, feed_only=feed_only)


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


def make_part(
    moves: Moves,
    *,
    axes: Sequence[str],
    source: str,
    lines: Sequence[str],
    ignored: Mapping[str, Ignored] | None = None,
    warnings: Sequence[str] = (),
    largest_center_move: float = 0.0,
    files: Sequence[SourceFile] = (),
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
    ignored, warnings, largest_center_move, files
        See :class:`Part`.

    Raises
    ------
    PartError
        No moves, motion outside ``axes``, or a spline with a cusp.
    """
    columns = axis_columns(axes)
    if not len(moves):
        raise PartError(f"{source}: nothing moves, so there is no contour")
    _check_axes(moves, columns, axes, source)
    try:
        path, owner = path_of_moves(moves, columns)
    except GeometryError as error:
        unfit = unfit_spline(moves)
        line = int(moves.source_line[unfit[0]]) if unfit else 0
        raise PartError(f"{source}:{line}: {unfit[1] if unfit else error}") from None
    last = np.append(owner[1:] != owner[:-1], True)
    return Part(
        path=path,
        axes=tuple(axes),
        source=source,
        lines=tuple(lines),
        source_line=moves.source_line[owner],
        feed=moves.feed[owner],
        rapid=moves.rapid[owner],
        blend=moves.blend[owner],
        merge=moves.merge[owner],
        file=moves.file[owner],
        file_line=moves.file_line[owner],
        files=tuple(files),
        dwell=np.where(last, moves.dwell[owner], 0.0),
        dwell_before=moves.dwell_before,
        ignored=MappingProxyType(dict(ignored or {})),
        warnings=tuple(warnings),
        largest_center_move=largest_center_move,
    )


def _check_axes(moves: Moves, columns: Sequence[int], axes: Sequence[str], source: str) -> None:
    """Refuse motion in a coordinate that is not asked for."""
    for k in set(range(3)) - set(columns):
        across = np.hypot(*(moves.normal[:, j] for j in range(3) if j != k))
        moving = (moves.start[:, k] != moves.end[:, k]) | ((moves.angle != 0.0) & (across > 0.0))
        for piece in np.flatnonzero(moves.spline >= 0):
            control = moves.control_points[moves.spline[piece]]
            moving[piece] |= bool(np.ptp(control[:, k] / control[:, 3]) > _FLAT)
        if moving.any():
            line = int(moves.source_line[int(np.argmax(moving))])
            raise PartError(f"{source}:{line}: moves in {_AXES[k]}, which is not in axes {axes!r}")
