"""From a line of text to words: comments and blanks out, a letter and a value each.

Blanks and tabs mean nothing outside comments, not even inside a number (``X1 0`` is X10), and case
means nothing. Reading a value is a function of its own, :func:`read_value`: whatever else than a
number may stand behind a letter one day has its place there.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from contourlab.errors import GcodeError

__all__ = ["LONGEST_LINE", "Word", "read_value", "read_words", "strip_comments"]

LONGEST_LINE = 4096
"""Characters in a line; LinuxCNC itself stops at 255."""

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
_VALUE = re.compile(_NUMBER)
_WORD = re.compile(rf"([A-Za-z])({_NUMBER})")
_SHOWN = 24

_NOT_READ = {
    "#": "parameters (#) are not read by this version",
    "[": "expressions [...] are not read by this version",
    "@": "polar coordinates (@ ^) are not read by this version",
    "^": "polar coordinates (@ ^) are not read by this version",
    "$": "spindle numbers ($) are not read by this version",
    "O": "o-words (subroutines, loops, conditions) are not read by this version",
}
_OUT_OF_PLACE = {
    ")": "closes no comment",
    "/": "the block delete mark may stand only at the start of a line",
    "%": "may stand only alone on the first line of the program and on its last",
    "\r": "a carriage return inside a line; lines end in LF or CR LF",
}


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
        A line too long, a comment that is open or nested, a character that is not ASCII outside
        comments.
    """
    if len(line) > LONGEST_LINE:
        raise GcodeError(f"the line has {len(line)} characters, at most {LONGEST_LINE} are read")
    if "\r" in line:
        raise GcodeError(_OUT_OF_PLACE["\r"])
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
        kept.append(line[at:opening])
        at = closing + 1


def read_words(code: str) -> list[Word]:
    """Return the words of a line.

    Parameters
    ----------
    code
        A line from :func:`strip_comments`, without a block delete mark.

    Raises
    ------
    GcodeError
        A character that starts no word, a letter without a value, a number that is no number.
    """
    pairs = _WORD.findall(code)
    words = [Word(letter.upper(), float(digits), letter + digits) for letter, digits in pairs]
    if sum([len(word.text) for word in words]) != len(code):
        return _read_one_by_one(code)
    for word in words:
        if word.letter == "O":
            raise GcodeError(_NOT_READ["O"], word=word.text)
        if word.value - word.value != 0.0:
            raise GcodeError("the number is too large", word=_shortened(word.text))
    return words


def _read_one_by_one(code: str) -> list[Word]:
    words = []
    at = 0
    while at < len(code):
        letter = code[at].upper()
        if letter in _NOT_READ:
            raise GcodeError(_NOT_READ[letter], word=_shortened(code[at:]))
        if letter in _OUT_OF_PLACE:
            raise GcodeError(_OUT_OF_PLACE[letter], word=letter)
        if not "A" <= letter <= "Z":
            raise GcodeError("a word must begin with a letter", word=_shown(code[at:]))
        value, end = read_value(code, at + 1)
        words.append(Word(letter, value, code[at:end]))
        at = end
    return words


def read_value(code: str, at: int) -> tuple[float, int]:
    """Return the value that stands at a place in a line, and the place behind it.

    Parameters
    ----------
    code
        A line without comments and blanks.
    at
        Place behind the letter.

    Raises
    ------
    GcodeError
        No number (an exponent is none: E is a letter), one too large, a parameter or expression.
    """
    word = _shown(code[at - 1 :])
    if at < len(code) and code[at] in "#[":
        raise GcodeError(_NOT_READ[code[at]], word=word)
    match = _VALUE.match(code, at)
    if match is None:
        raise GcodeError("the letter needs a number such as 12, -3.5 or .25", word=word)
    value = float(match.group())
    if not math.isfinite(value):
        raise GcodeError("the number is too large", word=_shortened(code[at - 1 : match.end()]))
    return value, match.end()


def _shown(code: str) -> str:
    end = next((k for k in range(1, len(code)) if code[k].isalpha()), len(code))
    text = _shortened(code[:end])
    return text if text.isprintable() else ascii(text)[1:-1]


def _shortened(text: str) -> str:
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
