"""Tables of numbers in text: any separator, decimal points or commas, a heading or none.

What separates columns is found from the text where that leaves one reading; where it leaves two,
the table is refused until the separator is stated. Every number is read, or refused with its line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError, PartError

__all__ = ["Table", "read_table"]

MOST_COLUMNS = 1000
_SEPARATORS = (";", "\t", "|")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_COMMA_NUMBER = re.compile(r"[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]{1,4})?")
_NO_NAME = re.compile(r"(?:[+-]?(?:nan|inf|infinity))?", re.IGNORECASE)
_LOOKED_AT = 100
"""Lines from which the separator is found."""
_SHOWN = 40


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers and where they stand."""

    values: NDArray[Any]
    """Shape (n_rows, n_columns)."""
    line: NDArray[Any]
    """Line of each row, counted from 1."""
    heading: tuple[str, ...]
    """Names of the columns; empty if there is no heading."""
    delimiter: str
    """What separates columns; empty for blanks."""
    decimal: str
    """``"."`` or ``","``."""


def read_table(
    lines: Sequence[str],
    *,
    name: str,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str = "#",
    columns: Sequence[int] | None = None,
) -> Table:
    """Return the table of a text.

    Parameters
    ----------
    lines
        The text, without line ends.
    name
        Of the file, for messages.
    delimiter
        What separates columns: one character, or ``" "`` for blanks of any number; found if None.
    decimal
        ``"."`` or ``","``; found if None.
    header
        Whether the first line that is no comment names the columns; if None, it does when it holds
        something that is not a number.
    comment
        With what a comment begins, to the end of its line; empty for no comments.
    columns
        Which columns are numbers, from 0; all if None.

    Raises
    ------
    PartError
        No rows, rows of different length, something that is not a number (also NaN): with its line.
    ConfigurationError
        An option that is not allowed.
    """
    if delimiter is not None and (not isinstance(delimiter, str) or len(delimiter) != 1):
        raise ConfigurationError(f"delimiter must be one character, got {delimiter!r}")
    if decimal not in (None, ".", ","):
        raise ConfigurationError(f"decimal must be '.' or ',', got {decimal!r}")
    if decimal is not None and decimal == delimiter:
        raise ConfigurationError(f"delimiter and decimal must differ, both are {decimal!r}")
    rows = []
    for k, text in enumerate(lines, 1):
        kept = text.split(comment, 1)[0] if comment else text
        if kept.strip():
            rows.append((k, kept.strip(" \r\n\0") if delimiter == "\t" else kept.strip()))
    if not rows:
        raise PartError(f"{name}: has no points")
    looked = [text for _, text in rows[:_LOOKED_AT]]
    sample = looked[1:] or looked
    found = delimiter if delimiter is not None else _delimiter(sample, decimal, name)
    point = decimal if decimal is not None else _decimal(sample, found)

    def split(text: str) -> list[str]:
        fields = text.split() if found in ("", " ") else [t.strip() for t in text.split(found)]
        return [_unquoted(field) for field in fields] if '"' in text else fields

    first = split(rows[0][1])
    heading: tuple[str, ...] = ()
    words = _numeric(point)
    named = header
    if named is None:
        named = not any(words(word) or _NO_NAME.fullmatch(word) for word in first)
    if named:
        heading = tuple(word.strip("\"'") for word in first)
        rows = rows[1:]
        if not rows:
            raise PartError(f"{name}: has a heading and no points")
    values, width = _values(rows, split, point, heading, columns, name)
    return Table(
        values=values.reshape(len(rows), width),
        line=np.array([k for k, _ in rows], np.int32),
        heading=heading,
        delimiter=found,
        decimal=point,
    )


def _unquoted(field: str) -> str:
    """Return a field without the quotes round it; half of a pair stays, and is no number."""
    if len(field) > 1 and field[0] == field[-1] == '"' and '"' not in field[1:-1]:
        return field[1:-1].strip()
    return field


def _values(
    rows: list[tuple[int, str]], split: Any, point: str, heading: tuple[str, ...],
    columns: Sequence[int] | None, name: str,
) -> tuple[NDArray[Any], int]:  # fmt: skip
    width = len(heading) or len(split(rows[0][1]))
    if width > MOST_COLUMNS:
        raise PartError(f"{name}: has {width} columns, more than {MOST_COLUMNS}")
    wanted = range(width) if columns is None else list(columns)
    for column in wanted:
        if isinstance(column, bool) or not isinstance(column, int) or not 0 <= column < width:
            raise PartError(f"{name}: has no column {column!r}, only 0 to {width - 1}")
    good = _numeric(point)
    numbers = []
    for line, text in rows:
        fields = split(text)
        if len(fields) == width + 1 and not fields[-1]:
            fields.pop()  # a separator at the end of the line
        if len(fields) != width:
            raise PartError(
                f"{name}:{line}: has {len(fields)} columns, the lines before have {width}"
            )
        for column in wanted:
            field = fields[column]
            if not good(field):
                _refuse(name, line, column, heading, field, point)
            numbers.append(float(field.replace(",", ".") if point == "," else field))
    return np.array(numbers), len(wanted)


def _refuse(
    name: str, line: int, column: int, heading: tuple[str, ...], field: str, point: str
) -> NoReturn:
    what = heading[column] if heading else f"column {column}"
    shown = field if len(field) <= _SHOWN else f"{field[:_SHOWN]}..."
    said = f"is {shown!r}" if field else "is missing"
    how = " with a decimal comma" if point == "," else ""
    raise PartError(f"{name}:{line}: {what} {said}, which is not a finite number{how}")


def _numeric(point: str) -> Any:
    plain = _NUMBER.fullmatch
    if point == ".":
        return plain
    return lambda field: _COMMA_NUMBER.fullmatch(field) or ("." not in field and plain(field))


def _delimiter(sample: list[str], decimal: str | None, name: str) -> str:
    for separator in _SEPARATORS:
        if any(separator in text for text in sample):
            return separator
    if not any("," in text for text in sample) or decimal == ",":
        return ""
    if decimal == ".":
        return ","
    # 1,5 2,5 may be two numbers or three
    blanks = [text.split() for text in sample]
    if all(len(w) > 1 and all(_COMMA_NUMBER.fullmatch(t) for t in w) for w in blanks):
        raise PartError(
            f"{name}: the comma may separate columns or be a decimal comma: "
            "give delimiter and decimal"
        )
    return ","


def _decimal(sample: list[str], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    text = " ".join(sample)
    return "," if "," in text and "." not in text else "."
