"""How a text log is written: separator, decimal sign, comments, heading, row of units.

The head of the file is read in every dialect that logs come in; the one stands that makes the most
of it numbers. What is in front of the table (a preamble of a data logger) is passed over and said.
"""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from contourlab.errors import ConfigurationError, LogError
from contourlab.units import DIMENSIONS

__all__ = ["Dialect", "find_dialect", "is_comment", "split_fields"]

MOST_COLUMNS = 2000
DIALECTS = (
    (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), ("|", ","), (",", "."),
    (" ", "."), (" ", ","),
)  # fmt: skip
COMMENTS = ("#", "%", "//", "!", "'")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_COMMA_NUMBER = re.compile(r"[+-]?(?:[0-9]+,?[0-9]*|,[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_BLANKS = re.compile(r'"[^"]*"|\S+')
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "inf", "-inf", "+inf"})
_UNITS = frozenset(unit for units in DIMENSIONS.values() for unit in units) | frozenset(
    {"", "-", "1", "%", "A", "V", "Nm", "°", "deg", "ns", "count", "counts", "cts", "bool", "W"}
)
_HIGH = 0.8
"""Share of the lines of a table that must look like its rows."""


@dataclass(frozen=True)
class Dialect:
    """How the table of a text log is written."""

    delimiter: str
    """One character; a blank stands for blanks of any number."""
    decimal: str
    width: int
    """Number of columns."""
    first: int
    """Lines in front of the first row of numbers."""
    heading: tuple[str, ...]
    """Names of the columns; empty if there are none."""
    units: tuple[str, ...]
    """The row of units below the heading; empty if there is none."""
    preamble: int
    """Lines in front of the heading that are no comments."""
    comments: tuple[str, ...]
    """Comments in front of the table, without their sign."""
    trailing: bool
    """Whether rows end in a separator."""


def is_comment(line: str, comment: str | None) -> bool:
    """Return whether a line is a comment, or blank.

    Parameters
    ----------
    line
        Without its end.
    comment
        With what a comment begins; the usual ones if None, none if empty.
    """
    text = line.strip()
    if not text:
        return True
    if comment is not None:
        return bool(comment) and text.startswith(comment)
    return text.startswith(COMMENTS) or (text.startswith(";") and not _numeric(text[1:2], "."))


def split_fields(line: str, delimiter: str) -> list[str]:
    """Return the fields of a line, without quotes round them.

    Parameters
    ----------
    line
        Without its end.
    delimiter
        As in :class:`Dialect`.
    """
    if delimiter == " ":
        return [_bare(field) for field in _BLANKS.findall(line)]
    if '"' in line:  # a field may hold the delimiter
        with contextlib.suppress(csv.Error):
            fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
            return [_bare(field) for field in fields]
    return [_bare(field) for field in line.split(delimiter)]


def _bare(field: str) -> str:
    text = field.strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'":
        return text[1:-1].strip()
    return text


def _numeric(field: str, decimal: str) -> bool:
    pattern = _NUMBER if decimal == "." else _COMMA_NUMBER
    return pattern.fullmatch(field) is not None


def _row(fields: Sequence[str], decimal: str) -> int:
    """Return how many fields of a line are numbers."""
    return sum(_numeric(field, decimal) for field in fields)


def find_dialect(
    lines: Sequence[str],
    *,
    name: str,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str | None = None,
) -> Dialect:
    """Return how a text is written.

    Parameters
    ----------
    lines
        The head of the text, without line ends.
    name
        Of the file, for messages.
    delimiter, decimal, header, comment
        What is known; found if None.

    Raises
    ------
    LogError
        No table of numbers is found.
    ConfigurationError
        An option that is not allowed.
    """
    _check(delimiter, decimal)
    kept = [(k, line) for k, line in enumerate(lines) if not is_comment(line, comment)]
    if not kept:
        raise LogError(f"{name}: holds no samples")
    best: tuple[float, int, str, str, int] | None = None
    for separator, point in _candidates(delimiter, decimal):
        found = _score([line for _, line in kept], separator, point)
        if found is not None and (best is None or found[:2] > best[:2]):
            best = (found[0], found[1], separator, point, found[2])
    if best is None:
        raise LogError(
            f"{name}: no table of numbers is found in it; a log is text in columns, or a MAT, "
            "HDF5, netCDF or MDF4 file"
        )
    _, _, separator, point, width = best
    if width > MOST_COLUMNS:
        raise LogError(f"{name}: has {width} columns, more than {MOST_COLUMNS}")
    return _placed(lines, kept, separator, point, width, header, comment)


def _check(delimiter: str | None, decimal: str | None) -> None:
    if delimiter is not None and (not isinstance(delimiter, str) or len(delimiter) != 1):
        raise ConfigurationError(f"delimiter must be one character, got {delimiter!r}")
    if decimal not in (None, ".", ","):
        raise ConfigurationError(f"decimal must be '.' or ',', got {decimal!r}")
    if decimal is not None and decimal == delimiter:
        raise ConfigurationError(f"delimiter and decimal must differ, both are {decimal!r}")


def _candidates(delimiter: str | None, decimal: str | None) -> list[tuple[str, str]]:
    if delimiter is not None:
        points = (".", ",") if decimal is None else (decimal,)
        return [(delimiter, point) for point in points if point != delimiter]
    return [(d, p) for d, p in DIALECTS if decimal in (None, p)]


def _score(lines: Sequence[str], delimiter: str, decimal: str) -> tuple[float, int, int] | None:
    """Return how well a dialect fits, how many numbers it finds, and the width of the table."""
    rows = [split_fields(line, delimiter) for line in lines]
    tail = rows[len(rows) // 2 :]  # a preamble is in front
    widths = [len(row) - (len(row) > 1 and row[-1] == "") for row in tail]
    width = max(set(widths), key=widths.count)
    same = [row[:width] for row, w in zip(tail, widths, strict=True) if w == width]
    numbers = sum(_row(row, decimal) for row in same)
    if numbers == 0:
        return None
    missing = sum(field.lower() in _MISSING for row in same for field in row)
    share = (numbers + missing) / (width * len(same)) * len(same) / len(tail)
    return round(share, 6), numbers, width


def _placed(
    lines: Sequence[str], kept: list[tuple[int, str]], delimiter: str, decimal: str, width: int,
    header: bool | None, comment: str | None,
) -> Dialect:  # fmt: skip
    rows = [split_fields(line, delimiter)[: width + 1] for _, line in kept]
    fits = [width <= len(row) <= width + 1 and _row(row, decimal) > 0 for row in rows]
    if header is False:
        begin = 0
    else:
        begin = next(
            (k for k, ok in enumerate(fits) if ok and sum(fits[k:]) >= _HIGH * len(fits[k:])), 0
        )
        if header and begin == 0:
            begin = 1
    heading: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    above = begin - 1
    if above >= 0 and header is not False:
        row = rows[above][:width]
        if above >= 1 and len(row) == width and all(field.strip("[]()") in _UNITS for field in row):
            units = tuple(field.strip("[]()") for field in row)
            above -= 1
            row = rows[above][:width]
        # a heading may be shorter or longer than the rows by an end that is empty
        if len(row) >= max(1, width - 1) and _row(row, decimal) < max(1, len(row)):
            heading = tuple(row) + ("",) * (width - len(row))
        else:
            above += 1
    first = kept[begin][0] if begin < len(kept) else len(lines)
    comments = tuple(
        re.sub(r"^(?:[#%!';]|//)+", "", line.strip()).strip()
        for line in lines[:first]
        if line.strip() and is_comment(line, comment)
    )
    if not heading and header is not False:  # as numpy.savetxt writes it, behind its sign
        for text in reversed(comments):
            fields = split_fields(text, delimiter)
            if len(fields) == width and not _row(fields, decimal):
                heading = tuple(fields)
                break
    return Dialect(
        delimiter, decimal, width, first, heading, units, max(above, 0) if heading else begin,
        comments, begin < len(rows) and len(rows[begin]) > width,
    )  # fmt: skip
