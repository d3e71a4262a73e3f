"""Reads a part program in G-code (RS-274 as LinuxCNC speaks it) into a part.

Read: G0 G1, G2 G3 with I J K (G90.1, G91.1) or R, helices and turns P, G4, G5 G5.1 G5.2 G5.3, polar
coordinates @ ^, G10 L2 L20, G17 to G19, G20 G21, G52 to G59.3, G61 G61.1 G64, G90 to G94, F, M2
M30, M70 to M73, M98 M99, o-words, parameters and expressions, comments, line numbers, block delete.
Accepted because they change nothing here: G8 G40 G49 G80, and G43, the path being that of the
tool's tip. Words that do not move the tool (S, T, M3
to M9 and their like, N, G96 to G99) are listed in :attr:`Part.ignored`. Everything else that would
move the tool, or change where it goes, is refused with file, line and word.

The contour is in machine coordinates; work offsets are zero when the program begins. A subprogram
in another file is looked for in the folder of the program.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path as FilePath

from contourlab.contours.gcode.interpreter import Interpreter
from contourlab.contours.gcode.sources import LARGEST_FILE, read_text, split_lines
from contourlab.contours.part import Part, make_part, unfit_spline
from contourlab.errors import GcodeError, PartError

__all__ = ["LARGEST_FILE", "MOST_LINES", "read_gcode", "read_gcode_text"]

MOST_LINES = 10_000_000
"""Lines in a program."""


def read_gcode(
    path: str | os.PathLike[str],
    *,
    axes: Sequence[str] = ("X", "Y", "Z"),
    default_units: str = "mm",
    block_delete: bool = False,
    start: Sequence[float | int] = (0.0, 0.0, 0.0),
) -> Part:
    """Return the part that a program file describes.

    Parameters
    ----------
    path
        The file: UTF-8 (or any superset of ASCII, outside comments ASCII only).
    axes
        Coordinates of the contour, two or three of X, Y, Z. Motion in another one is refused.
    default_units
        ``"mm"`` or ``"inch"``: units before the first G20 or G21. LinuxCNC takes them from the
        machine.
    block_delete
        Whether lines that start with ``/`` are skipped (the switch of that name on a machine).
    start
        Where the machine stands before the first move [m]; program zero by default. The contour
        begins there.

    Raises
    ------
    GcodeError
        The file cannot be read, or is refused: file, line and word.
    ConfigurationError
        An option that is not allowed.
    """
    name = os.fspath(path)
    text, _ = read_text(FilePath(name))
    return read_gcode_text(
        text, name=name, axes=axes, default_units=default_units, block_delete=block_delete,
        start=start, folder=FilePath(name).parent,
    )  # fmt: skip


def read_gcode_text(
    text: str,
    *,
    name: str = "program",
    axes: Sequence[str] = ("X", "Y", "Z"),
    default_units: str = "mm",
    block_delete: bool = False,
    start: Sequence[float | int] = (0.0, 0.0, 0.0),
    folder: str | os.PathLike[str] | None = None,
) -> Part:
    """Return the part that the text of a program describes.

    Parameters
    ----------
    text
        The program.
    name
        What to call it in messages.
    axes, default_units, block_delete, start
        As in :func:`read_gcode`.
    folder
        Where files of subprograms may stand; without it the program cannot call another file.

    Raises
    ------
    GcodeError
        The program is refused: name, line and word.
    ConfigurationError
        An option that is not allowed.
    """
    if text.count("\n") > MOST_LINES:
        raise GcodeError(f"has more than {MOST_LINES} lines", file=name)
    lines = split_lines(text)
    interpreter = Interpreter(
        name=name, axes=axes, default_units=default_units, block_delete=block_delete, start=start,
        folder=None if folder is None else FilePath(folder),
    )  # fmt: skip
    read = interpreter.run(lines)
    if not len(read.moves):
        raise GcodeError("nothing moves, so there is no contour", file=name)
    try:
        return make_part(
            read.moves, axes=axes, source=name, lines=lines, ignored=read.ignored,
            warnings=read.warnings, largest_center_move=read.largest_center_move,
            files=read.files,
        )  # fmt: skip
    except PartError:
        unfit = unfit_spline(read.moves)
        if unfit is None:
            raise
        piece, reason = unfit
        raise GcodeError(reason, file=name, line=int(read.moves.source_line[piece])) from None
