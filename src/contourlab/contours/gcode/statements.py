"""What a line is: a block of words, a block with values to be worked out, or an o-word.

A line is parsed once. A :class:`Block` of plain numbers is done; a :class:`Dynamic` one is worked
out whenever its line runs: all values of the line are read from left to right with the parameters
as they were, then its assignments take effect, then its words are executed.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.expressions import Value, read_expression, read_name, read_value
from contourlab.contours.gcode.lexer import Word, plain_words, shortened, shown
from contourlab.contours.gcode.parameters import ARGUMENTS, Parameters, whole
from contourlab.errors import GcodeError

__all__ = ["END", "Control", "Dynamic", "Statement", "read_statement"]

_OUT_OF_PLACE = {
    ")": "closes no comment",
    "/": "the block delete mark may stand only at the start of a line",
    "%": "may stand only alone on the first line of the program and on its last",
    "O": "an o-word may stand only at the start of a line",
}
_NUMBERED = re.compile(r"[nN][0-9]+\.?[0-9]*(?=[oOmM])")
_CALL = re.compile(r"[mM]0*9([89])(?![0-9.])")
_KEYWORD = re.compile(
    r"sub|endsub|call|do|while|repeat|if|elseif|else|endif|break|continue|endwhile|endrepeat|return",
    re.I,
)
_WITH_TEST = frozenset(("while", "repeat", "if", "elseif"))
_MAY_RETURN = frozenset(("endsub", "return"))


class Control:
    """An o-word, or M98 and M99.

    Parameters
    ----------
    kind
        ``"sub"``, ``"call"``, ``"while"``, ..., ``"program"`` for a bare O number, ``"m98"``,
        ``"m99"``.
    label
        Its name, or the value that gives its number.
    rest
        What stands behind the keyword.
    text
        The line as written, without blanks.
    """

    __slots__ = ("_label", "_rest", "_values", "kind", "text")

    def __init__(self, kind: str, label: str | Value, rest: str, text: str) -> None:
        self.kind = kind
        self.text = shortened(text)
        self._label, self._rest = label, rest
        self._values: list[Value] | None = None

    def label(self, parameters: Parameters) -> str:
        """Return the name of the label; of a number, its digits.

        Parameters
        ----------
        parameters
            As they are now.
        """
        if isinstance(self._label, str):
            return self._label
        value = self._label if isinstance(self._label, float) else self._label(parameters)
        return str(whole(value))

    def values(self, parameters: Parameters) -> list[float]:
        """Return the values in brackets: the test, the arguments, the value returned.

        They are parsed when they are first needed: an o-word that is skipped may hold anything.

        Parameters
        ----------
        parameters
            As they are now.

        Raises
        ------
        GcodeError
            A bracket is missing, too many, or something else stands there.
        """
        if self._values is None:
            self._values = self._read()
        return [v if isinstance(v, float) else v(parameters) for v in self._values]

    def subprogram(self, parameters: Parameters) -> tuple[str, int]:
        """Return what M98 calls, P, and how often, L.

        Parameters
        ----------
        parameters
            As they are now.

        Raises
        ------
        GcodeError
            P is missing, or another word stands there.
        """
        words = plain_words(self._rest)
        if words is None:
            words = _read_dynamic(self._rest).words(parameters)
        values = {word.letter: word.value for word in words}
        if len(values) < len(words) or not {"P"} <= values.keys() <= {"P", "L"}:
            raise GcodeError("M98 takes P, the number of a program, and L, how often")
        times = whole(values.get("L", 1.0))
        if times < 0:
            raise GcodeError("L, how often M98 calls, must be >= 0")
        return str(whole(values["P"])), times

    def _read(self) -> list[Value]:
        most = ARGUMENTS if self.kind == "call" else 1
        if self.kind not in _WITH_TEST and self.kind not in _MAY_RETURN and self.kind != "call":
            most = 0
        values: list[Value] = []
        at = 0
        while at < len(self._rest) and self._rest[at] == "[" and most:
            value, at = read_expression(self._rest, at)
            values.append(value)
            if len(values) > most:
                raise GcodeError(f"{self.kind} takes at most {most} values in brackets")
        if at < len(self._rest):
            raise GcodeError(f"does not belong behind {self.kind}: {shown(self._rest[at:])}")
        if self.kind in _WITH_TEST and not values:
            raise GcodeError(f"{self.kind} needs its value in brackets [...]")
        return values


class _Setting(NamedTuple):
    """An assignment: a name, or the value that gives a number."""

    target: str | Value
    value: Value
    text: str

    def place(self, parameters: Parameters) -> str | int:
        """Return the name or number that is set; a name exists from here on."""
        target = self.target
        if isinstance(target, str):
            parameters.declare(target)
            return target
        return whole(target if isinstance(target, float) else target(parameters))


class _Given(NamedTuple):
    """A word whose value has to be worked out."""

    letter: str
    value: Value
    text: str


class Dynamic:
    """A block with values to be worked out, or with assignments.

    Parameters
    ----------
    items
        Words and assignments in the order of the line.
    """

    __slots__ = ("_fixed", "_items", "_template")

    def __init__(self, items: list[_Setting | _Given]) -> None:
        self._items = items
        words = [item for item in items if isinstance(item, _Given)]
        # G, M and N words that are plain numbers need to be looked up once only
        self._fixed = not any(w.letter in "GMN" and not isinstance(w.value, float) for w in words)
        self._template: Block | None = None

    def block(self, parameters: Parameters) -> Block | None:
        """Read the values, make the assignments, and return the words; None without words.

        Parameters
        ----------
        parameters
            As they are now; the assignments change them.

        Raises
        ------
        GcodeError
            A value that cannot be worked out, a parameter that cannot be set.
        """
        words = self.words(parameters)
        if not words:
            return None
        if not self._fixed:
            return Block(words)
        if self._template is None:
            self._template = Block(words)
        return self._template.filled(words)

    def words(self, parameters: Parameters) -> list[Word]:
        """Read the values, make the assignments, and return the words with their values.

        Parameters
        ----------
        parameters
            As they are now; the assignments change them.

        Raises
        ------
        GcodeError
            A value that cannot be worked out, a parameter that cannot be set.
        """
        words: list[Word] = []
        settings: list[tuple[str | int, float, str]] = []
        text = ""
        try:
            for item in self._items:
                value, text = item.value, item.text
                if isinstance(item, _Given):
                    number = value if isinstance(value, float) else value(parameters)
                    words.append(Word(item.letter, number, text))
                    continue
                place = item.place(parameters)
                number = value if isinstance(value, float) else value(parameters)
                settings.append((place, number, text))
            for place, number, written in settings:
                text = written
                if isinstance(place, str):
                    parameters.set_named(place, number)
                else:
                    parameters.set_number(place, number)
        except GcodeError as error:
            raise GcodeError(error.message, word=error.word or shortened(text)) from None
        return words


Statement = Block | Dynamic | Control

END = Control("end", "", "", "%")
"""The last % of a program."""


def read_statement(code: str) -> Statement:
    """Return what a line says.

    Parameters
    ----------
    code
        A line from :func:`~contourlab.contours.gcode.lexer.strip_comments`, not empty, without a
        block delete mark.

    Raises
    ------
    GcodeError
        A character that starts no word, a letter without a value, an o-word without a keyword.
    """
    first = code[0]
    if first in "nN" or first in "oOmM":
        control = _read_control(code)
        if control is not None:
            return control
    words = plain_words(code)
    if words is not None:
        for word in words:
            if word.letter == "O":
                raise GcodeError(_OUT_OF_PLACE["O"], word=word.text)
        return Block(words)
    return _read_dynamic(code)


def _read_control(code: str) -> Control | None:
    number = _NUMBERED.match(code)
    at = number.end() if number else 0
    call = _CALL.match(code, at)
    if call is not None:
        if call.group(1) == "9":
            if call.end() < len(code):
                raise GcodeError("M99 stands alone in its line", word=shown(code[call.end() :]))
            return Control("m99", "", "", code)
        return Control("m98", "", code[call.end() :], code)
    if code[at] not in "oO":
        return None
    label: str | Value
    try:
        if code[at + 1 : at + 2] == "<":
            label, at = read_name(code, at + 1)
        else:
            label, at = read_value(code, at + 1)
            if isinstance(label, float):
                label = str(whole(label))
        if at == len(code):
            return Control("program", label, "", code)
        keyword = _KEYWORD.match(code, at)
        if keyword is None:
            raise GcodeError(
                "the o-word needs one of sub, endsub, call, return, if, elseif, else, endif, "
                "while, endwhile, do, repeat, endrepeat, break, continue"
            )
    except GcodeError as error:
        raise GcodeError(error.message, word=error.word or shortened(code)) from None
    kind = keyword.group().lower()
    return Control(kind, label, code[keyword.end() :], code)


def _read_dynamic(code: str) -> Dynamic:
    items: list[_Setting | _Given] = []
    at = 0
    while at < len(code):
        letter = code[at].upper()
        begin = at
        if letter in _OUT_OF_PLACE:
            raise GcodeError(
                _OUT_OF_PLACE[letter], word=letter if letter != "O" else shown(code[at:])
            )
        if not ("A" <= letter <= "Z" or letter in "@^$#"):
            raise GcodeError("a word must begin with a letter", word=shown(code[at:]))
        try:
            if letter == "#":
                setting, at = _read_setting(code, at)
                items.append(setting)
                continue
            if code[at + 1 : at + 3] in ("++", "+-", "-+", "--"):
                raise GcodeError("the letter needs one sign only")
            value, at = read_value(code, at + 1)
        except GcodeError as error:
            raise GcodeError(error.message, word=error.word or shown(code[begin:])) from None
        items.append(_Given(letter, value, code[begin:at]))
    return Dynamic(items)


def _read_setting(code: str, at: int) -> tuple[_Setting, int]:
    begin = at
    target: str | Value
    if code[at + 1 : at + 2] == "<":
        target, at = read_name(code, at + 1)
    else:
        target, at = read_value(code, at + 1)
    if code[at : at + 1] != "=":
        raise GcodeError("a parameter at the start of a word is set: = is missing")
    value, at = read_value(code, at + 1)
    return _Setting(target, value, code[begin:at]), at
