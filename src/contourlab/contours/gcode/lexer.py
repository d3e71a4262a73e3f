"""From a line of text to words: comments and blanks out, a letter and a value each.

Blanks and tabs mean nothing outside comments, not even inside a number (``X1 0`` is X10), and case
means nothing. Lines of plain words are read here by two regular expressions; every other line goes
through :mod:`~contourlab.contours.gcode.statements`.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from contourlab.errors import GcodeError

__all__ = ["LONGEST_LINE", "Word", "plain_words", "shortened", "shown", "strip_comments"]

LONGEST_LINE = 4096
"""Characters in a line; LinuxCNC itself stops at 255."""

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
_WORD = re.compile(rf"([A-Za-z@^$])({_NUMBER})")
_ACTIVE = re.compile(r"[(;]\s*(abort|py|pyrun)\s*,|[(;]\s*(pyreload)", re.I)
_SHOWN = 24


class Word(NamedTuple):
    """A letter and its value."""

    letter: str
    """Upper case."""
    value: float
    text: str
    """As written, without blanks."""


def strip_comments(line: str) -> str:
    """Return a line without comments and blanks.

    Parameters
    ----------
    line
        One line of the program, without its line end.

    Returns
    -------
    str
        What is left, in the case it was written in.

    Raises
    ------
    GcodeError
        A line too long, a comment that is open or nested, or that makes LinuxCNC stop or run
        Python, a character that is not ASCII outside comments.
    """
    if len(line) > LONGEST_LINE:
        raise GcodeError(f"the line has {len(line)} characters, at most {LONGEST_LINE} are read")
    if "\r" in line:
        raise GcodeError("a carriage return inside a line; lines end in LF or CR LF")
    code = line if "(" not in line and ";" not in line else _outside_comments(line)
    if not code.isascii():
        foreign = next(character for character in code if not character.isascii())
        raise GcodeError("the character is not ASCII and not in a comment", word=ascii(foreign))
    return code.replace(" ", "").replace("\t", "")


def _outside_comments(line: str) -> str:
    kept: list[str] = []
    at = 0
    while True:
        opening, semicolon = line.find("(", at), line.find(";", at)
        if semicolon >= 0 and (opening < 0 or semicolon < opening):
            _refuse_active(line, semicolon)
            kept.append(line[at:semicolon])
            return "".join(kept)
        if opening < 0:
            kept.append(line[at:])
            return "".join(kept)
        closing = line.find(")", opening)
        if closing < 0:
            raise GcodeError("the comment is not closed in its line", word="(")
        if line.find("(", opening + 1, closing) >= 0:
            raise GcodeError("a comment may not hold another one", word="(")
        _refuse_active(line, opening)
        kept.append(line[at:opening])
        at = closing + 1


def _refuse_active(line: str, at: int) -> None:
    match = _ACTIVE.match(line, at)
    if match is not None:
        name = (match.group(1) or match.group(2)).upper()
        does = "stops the program" if name == "ABORT" else "runs Python"
        raise GcodeError(f"the comment {does} in LinuxCNC; it is not read", word=f"({name}")


def plain_words(code: str) -> list[Word] | None:
    """Return the words of a line in which every value is a number, None for another line.

    Parameters
    ----------
    code
        A line from :func:`strip_comments`, without a block delete mark.

    Raises
    ------
    GcodeError
        A number that is too large.
    """
    pairs = _WORD.findall(code)
    words = [Word(letter.upper(), float(digits), letter + digits) for letter, digits in pairs]
    if sum([len(word.text) for word in words]) != len(code):
        return None
    for word in words:
        if word.value - word.value != 0.0:
            raise GcodeError("the number is too large", word=shortened(word.text))
    return words


def shown(code: str) -> str:
    """Return the word at the start of what is left of a line, fit to be printed.

    Parameters
    ----------
    code
        What is left of the line.
    """
    end = next((k for k in range(1, len(code)) if code[k].isalpha()), len(code))
    text = shortened(code[:end])
    return text if text.isprintable() else ascii(text)[1:-1]


def shortened(text: str) -> str:
    """Return the beginning of a long word.

    Parameters
    ----------
    text
        The word.
    """
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
