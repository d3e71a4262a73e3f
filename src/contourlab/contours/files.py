"""Part files as bytes, no more of them than is allowed."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from contourlab.errors import PartError, UnitError
from contourlab.units import DIMENSIONS, parse_quantity

__all__ = ["LARGEST_FILE", "metres", "read_bytes", "unit_size"]

LARGEST_FILE = 256 * 2**20
"""Bytes of a part file."""


def read_bytes(path: str | os.PathLike[str], most: int = LARGEST_FILE) -> bytes:
    """Return the bytes of a regular file.

    Parameters
    ----------
    path
        The file.
    most
        Bytes that it may have.

    Raises
    ------
    PartError
        It cannot be read, is not a regular file, or is too large.
    """
    name = os.fspath(path)
    try:
        if not stat.S_ISREG(Path(name).stat().st_mode):
            raise PartError(f"{name}: is not a regular file")
        with Path(name).open("rb") as stream:
            data = stream.read(most + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise PartError(f"{name}: cannot be read: {reason}") from None
    if len(data) > most:
        raise PartError(f"{name}: is larger than {most // 2**20} MiB")
    return data


def unit_size(unit: object, name: str = "unit") -> float:
    """Return the size of a unit of length in metres.

    Parameters
    ----------
    unit
        ``"mm"``, or a length that one unit of the file is, such as ``"0.1 mm"``.
    name
        Of the option, for the message.

    Raises
    ------
    UnitError
        Not a unit of length, or not > 0.
    """
    lengths = DIMENSIONS["length"]
    if isinstance(unit, str) and unit in lengths:
        return lengths[unit]
    if not isinstance(unit, str) or not any(letter.isdigit() for letter in unit):
        raise UnitError(f"{name} must be a unit of length such as m, mm, um or in, got {unit!r}")
    size = parse_quantity(unit, "length", name)
    if not size > 0.0:
        raise UnitError(f"{name} must be > 0, got {unit!r}")
    return size


def metres(value: object, name: str) -> float:
    """Return a length > 0 in metres.

    Parameters
    ----------
    value
        A number in metres, or a text with its unit.
    name
        Of the option, for the message.

    Raises
    ------
    UnitError
        Not a length, or not > 0.
    """
    if isinstance(value, str):
        size = parse_quantity(value, "length", name)
    elif isinstance(value, bool) or not isinstance(value, int | float):
        raise UnitError(f"{name} must be a length, got {value!r}")
    else:
        size = float(value)
    if not 0.0 < size < float("inf"):
        raise UnitError(f"{name} must be > 0 m, got {value!r}")
    return size
