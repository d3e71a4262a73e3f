"""The texts of a program: its own file, and those of subprograms that stand in files beside it.

``o<name> call`` looks for ``name.ngc`` in the folder of the program and nowhere else. A name with a
path in it is refused, and so is a file that is not a regular one in that folder, such as a symbolic
link that leads out of it.
"""

from __future__ import annotations

import re
import stat
from bisect import bisect_left
from collections.abc import Sequence
from pathlib import Path

from contourlab.contours.gcode.statements import Statement
from contourlab.errors import GcodeError

__all__ = ["LARGEST_FILE", "MOST_FILES", "Source", "Sources", "read_text", "split_lines"]

LARGEST_FILE = 256 * 2**20
"""Bytes in the files of a program together."""

MOST_FILES = 1000
"""Files of a program."""

_CONTROL = re.compile(r"[\s/]*(?:[nN][\s0-9.]*)?(?:[oO]|[mM][\s0]*9\s*[89]|%)")
_NAME = re.compile(r"[a-z0-9_][a-z0-9_.+\-]*")


class Source:
    """The text of one file.

    Parameters
    ----------
    name
        Name in messages.
    lines
        Text, without line ends.
    number
        0 for the program, 1 and more for subprograms in other files.
    """

    __slots__ = ("_controls", "has_control", "lines", "name", "number", "statements")

    def __init__(self, name: str, lines: Sequence[str], number: int = 0) -> None:
        self.name, self.lines, self.number = name, lines, number
        self.has_control = any(_CONTROL.match(line) is not None for line in lines)
        """Whether a line may be run again."""
        self.statements: dict[int, Statement | None] = {}
        """What lines say, once they have been read."""
        self._controls: list[int] | None = None

    def next_control(self, line: int) -> int:
        """Return the next line that may hold an o-word, counted from 0; behind the last if none.

        Parameters
        ----------
        line
            Where to begin.
        """
        if self._controls is None:
            self._controls = [k for k, text in enumerate(self.lines) if _CONTROL.match(text)]
        at = bisect_left(self._controls, line)
        return self._controls[at] if at < len(self._controls) else len(self.lines)


class Sources:
    """The files of a program, read when they are called.

    Parameters
    ----------
    main
        The program.
    folder
        Where its subprograms may stand; None if they may not.
    size
        Bytes of the program.
    """

    def __init__(self, main: Source, folder: Path | None, size: int) -> None:
        self.all = [main]
        self._folder = folder
        self._size = size
        self._named: dict[str, Source | None] = {}

    def find(self, name: str) -> Source | None:
        """Return the file of a subprogram, None if there is none of that name.

        Parameters
        ----------
        name
            Name of the subprogram.

        Raises
        ------
        GcodeError
            A name that may not be looked for, or a file that may not be read.
        """
        if name in self._named:
            return self._named[name]
        if not _NAME.fullmatch(name) or ".." in name:
            raise GcodeError(
                "a subprogram in another file is looked for in the folder of the program only: "
                "its name may have letters, digits, _ - + and ."
            )
        self._named[name] = source = None if self._folder is None else self._read(name)
        return source

    def _read(self, name: str) -> Source | None:
        assert self._folder is not None
        path = self._folder / f"{name}.ngc"
        try:
            if not path.exists():
                return None
            folder, real = self._folder.resolve(), path.resolve()
        except (OSError, ValueError, RuntimeError):
            return None
        if real.parent != folder:
            raise GcodeError(f"the file {path.name} is not in the folder of the program")
        if len(self.all) >= MOST_FILES:
            raise GcodeError(f"the program is in more than {MOST_FILES} files")
        text, size = read_text(path, LARGEST_FILE - self._size)
        self._size += size
        source = Source(str(path), split_lines(text), len(self.all))
        self.all.append(source)
        return source


def read_text(path: Path, most: int | None = None) -> tuple[str, int]:
    """Return the text of a file and its size in bytes.

    Parameters
    ----------
    path
        The file: UTF-8, or any superset of ASCII.
    most
        Bytes that it may have; :data:`LARGEST_FILE` by default.

    Raises
    ------
    GcodeError
        It cannot be read, is not a regular file, or is too large.
    """
    name = str(path)
    most = LARGEST_FILE if most is None else most
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise GcodeError("is not a regular file", file=name)
        with path.open("rb") as stream:
            data = stream.read(most + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise GcodeError(f"cannot be read: {reason}", file=name) from None
    if len(data) > most:
        raise GcodeError(f"is larger than {LARGEST_FILE // 2**20} MiB", file=name)
    return data.decode("utf-8-sig", errors="replace"), len(data)


def split_lines(text: str) -> list[str]:
    """Return the lines of a text, without their ends.

    Parameters
    ----------
    text
        Lines end in LF or CR LF.
    """
    lines = text.replace("\r\n", "\n").split("\n")
    if lines and not lines[-1]:
        lines.pop()
    return lines
