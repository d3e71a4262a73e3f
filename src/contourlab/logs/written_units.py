"""Units as logs write them: in headings, in a row or attribute of their own, or nowhere.

A unit that is neither stated nor written is guessed from the size of the motion, and the guess is
said wherever a figure rests on it.
"""

from __future__ import annotations

import re

from contourlab.errors import LogError, UnitError
from contourlab.units import DIMENSIONS, parse_quantity

__all__ = [
    "check_same", "guess_length", "guess_time_unit", "known_unit", "split_title", "stated_unit",
    "unit_of",
]  # fmt: skip

_TITLE = re.compile(r"\s*(.*?)\s*(?:\[\s*([^\]\[]*?)\s*\]|\(\s*([^()]*?)\s*\))\s*")
_SUFFIX = re.compile(r"(.+?)[_/ ]([^\s_/]+)")
_SPELT = {
    "millimeter": "mm", "millimetre": "mm", "millimeters": "mm", "millimetres": "mm",
    "meter": "m", "metre": "m", "metres": "m", "meters": "m", "micron": "um", "microns": "um",
    "micrometer": "um", "micrometre": "um", "inches": "in", "second": "s", "seconds": "s",
    "sec": "s", "milliseconds": "ms", "msec": "ms", "degree": "deg", "degrees": "deg", "°": "deg",
    "nsec": "ns", "usec": "us",
}  # fmt: skip
_TIMES = {**DIMENSIONS["time"], "ns": 1e-9, "h": 3600.0}
_DIMENSIONS = ("length", "angle", "time", "velocity", "force", "frequency")


def known_unit(text: str, dimension: str) -> float | None:
    """Return the size of a written unit in SI; None if it is none of that kind.

    Parameters
    ----------
    text
        As written.
    dimension
        ``length``, ``angle``, ``time``, ...
    """
    plain = _SPELT.get(text.strip().casefold(), text.strip())
    table = _TIMES if dimension == "time" else DIMENSIONS[dimension]
    return table.get(plain, table.get(plain.lower()) if plain.lower() in ("mm", "um") else None)


def split_title(title: str) -> tuple[str, str]:
    """Return a heading's name and what it says of its unit, empty if nothing.

    Parameters
    ----------
    title
        Such as ``X [mm]``, ``X (mm)``, ``x_mm``.
    """
    match = _TITLE.fullmatch(title)
    if match and match[1]:
        return match[1], match[2] or match[3] or ""
    match = _SUFFIX.fullmatch(title)
    if match and match[2] not in ("m", "g", "min", "in", "s", "N"):
        if any(known_unit(match[2], one) is not None for one in _DIMENSIONS):
            return match[1], match[2]
    elif match and match[2] in ("m", "s") and "_" in title:
        return match[1], match[2]
    return title.strip(), ""


def unit_of(title: str, stated: str) -> str:
    """Return the unit of a column as the file writes it, empty if it does not.

    Parameters
    ----------
    title
        Its heading.
    stated
        What the file says beside the heading; empty if nothing.
    """
    return stated or split_title(title)[1]


def guess_length(extent: float) -> str:
    """Return the likely unit of positions that extend over so many of it.

    A machine's motion is taken to lie between 1 mm and 10 m: less than one is metres, up to ten
    thousand is millimetres, more is micrometres.

    Parameters
    ----------
    extent
        Largest travel of an axis, in the unit.
    """
    if extent < 1.0:
        return "m"
    return "mm" if extent < 1e4 else "um"


def guess_time_unit(step: float) -> str:
    """Return the likely unit of instants that are so far apart.

    Samples are taken to be between 20 µs and 0.5 s apart: less than a half is seconds, up to
    twenty milliseconds, up to twenty thousand microseconds, more nanoseconds.

    Parameters
    ----------
    step
        Median distance of neighbours, in the unit.
    """
    if step < 0.5:
        return "s"
    if step < 20.0:
        return "ms"
    return "us" if step < 2e4 else "ns"


def stated_unit(unit: str, name: str) -> tuple[float, str]:
    """Return the size of a unit that a user stated, and its kind.

    Parameters
    ----------
    unit
        Such as ``mm`` or ``0.1 um``, of length or angle.
    name
        Of the option.

    Raises
    ------
    UnitError
        It is neither.
    """
    for dimension in ("length", "angle"):
        size = known_unit(unit, dimension) if isinstance(unit, str) else None
        if size is not None:
            return size, dimension
    if isinstance(unit, str) and any(letter.isdigit() for letter in unit):
        size = parse_quantity(unit, "length", name)
        if size > 0.0:
            return size, "length"
    raise UnitError(f"{name} must be a unit of length or angle, such as mm, m, um, in or deg, "
                    f"got {unit!r}")  # fmt: skip


def check_same(name: str, column: str, unit: str, given: str, size: float) -> None:
    """Raise LogError if a file's unit contradicts a stated one.

    Parameters
    ----------
    name, column
        The file and the column.
    unit
        What the file says.
    given, size
        What the user says, and its size.
    """
    own = known_unit(unit, "length") or known_unit(unit, "angle")
    if own is not None and abs(own / size - 1.0) > 1e-9:
        raise LogError(f"{name}: column {column!r} is in {unit}, but unit is {given!r}")
