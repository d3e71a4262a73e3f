"""What every reader of logs returns: columns that are read when they are asked for.

A log of a million rows has fifty columns of which four are wanted. So a reader looks at the names
first, and the numbers of the chosen columns are read in a second step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import LogError

__all__ = ["MOST_SAMPLES", "Columns", "Source", "refuse_length"]

MOST_SAMPLES = 20_000_000
"""Rows of a log; a column of so many takes 160 MB."""

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Columns:
    """Numbers of some columns, all of one length."""

    values: Mapping[str, Values]
    """float64, shape (n,) each; NaN where the log holds no number."""
    lost_after: Values = field(default_factory=lambda: np.zeros(0, int))
    """Rows after which the log itself says that samples were lost."""
    notes: tuple[str, ...] = ()
    """What was done to the numbers, in sentences."""


@dataclass(frozen=True, eq=False)
class Source:
    """A log that was opened: what its columns are called, and how they are read."""

    name: str
    """Of the file, as given."""
    format: str
    """What kind of file it is, for people."""
    names: tuple[str, ...]
    """Of the columns, each one once."""
    read: Callable[[Sequence[str]], Columns] = field(repr=False)
    """Reads columns by name."""
    units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Units that the file states, by column, as they are written there."""
    sample_time: float | None = None
    """Time between samples that the file states [s]."""
    time: str | None = None
    """The column of time, where the format says which it is."""
    counter: str | None = None
    """A column that counts samples, from which lost ones are seen."""
    named: bool = True
    """Whether the file names its columns; else their names are their numbers."""
    roles: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: MappingProxyType({}))
    """Columns whose meaning the format states, by ``commanded``, ``actual`` and ``command``."""
    axes: tuple[str, ...] = ()
    """Names of the axes that the format states, with ``roles``."""
    notes: tuple[str, ...] = ()
    """How the file was understood, in sentences."""


def refuse_length(name: str, n_rows: int) -> None:
    """Raise LogError if a log is too long to be held.

    Parameters
    ----------
    name
        Of the file.
    n_rows
        How long it is.
    """
    if n_rows > MOST_SAMPLES:
        raise LogError(f"{name}: has more than {MOST_SAMPLES} samples: cut it")
