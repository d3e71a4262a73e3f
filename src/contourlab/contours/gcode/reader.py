"""Reads a part program in G-code (RS-274 as LinuxCNC speaks it) into a part.

Read: G0 G1 G2 G3 with I J K (G90.1, G91.1) or R, helices and turns P, G4, G17 to G19, G20 G21,
G90 G91, G61 G61.1 G64, F, comments, line numbers, block delete, %, M2 M30. Accepted because they
change nothing here: G8 G40 G49 G54 G80 G92.1 G92.2 G94. Words that do not move the tool (S, T, M3
to M9 and their like, N, G96 to G99) are listed in :attr:`Part.ignored`. Everything else that would
move the tool, or change where it goes, is refused with file, line and word.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from pathlib import Path as FilePath

from contourlab.contours.gcode.interpreter import Interpreter
from contourlab.contours.part import Part, make_part
from contourlab.errors import GcodeError

__all__ = ["LARGEST_FILE", "MOST_LINES", "read_gcode", "read_gcode_text"]

LARGEST_FILE = 256 * 2**20
"""Bytes in a program file."""

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
    try:
        file = FilePath(name)
        if not stat.S_ISREG(file.stat().st_mode):
            raise GcodeError("is not a regular file", file=name)
        with file.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise GcodeError(f"cannot be read: {reason}", file=name) from None
    if len(data) > LARGEST_FILE:
        raise GcodeError(f"is larger than {LARGEST_FILE // 2**20} MiB", file=name)
    text = data.decode("utf-8-sig", errors="replace")
    return read_gcode_text(
        text, name=name, axes=axes, default_units=default_units, block_delete=block_delete,
        start=start,
    )  # fmt: skip


def read_gcode_text(
    text: str,
    *,
    name: str = "program",
    axes: Sequence[str] = ("X", "Y", "Z"),
    default_units: str = "mm",
    block_delete: bool = False,
    start: Sequence[float | int] = (0.0, 0.0, 0.0),
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

    Raises
    ------
    GcodeError
        The program is refused: name, line and word.
    ConfigurationError
        An option that is not allowed.
    """
    if text.count("\n") > MOST_LINES:
        raise GcodeError(f"has more than {MOST_LINES} lines", file=name)
    lines = text.replace("\r\n", "\n").split("\n")
    if lines and not lines[-1]:
        lines.pop()
    interpreter = Interpreter(
        name=name, axes=axes, default_units=default_units, block_delete=block_delete, start=start
    )
    read = interpreter.run(lines)
    if not len(read.moves):
        raise GcodeError("nothing moves, so there is no contour", file=name)
    return make_part(
        read.moves, axes=axes, source=name, lines=lines, ignored=read.ignored,
        warnings=read.warnings, largest_center_move=read.largest_center_move,
    )  # fmt: skip
