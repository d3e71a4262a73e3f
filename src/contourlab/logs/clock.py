"""The instants of a log: from a column, from a sample time, or unknown."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import LogError, UnitError
from contourlab.logs.written_units import guess_time_unit, known_unit
from contourlab.units import parse_quantity

__all__ = ["Clock", "clock_of_column", "clock_of_steps", "seconds"]

Values = NDArray[Any]
AGREE = 0.05
"""Share by which a stated sample time may differ from that of the time column."""


class Clock(NamedTuple):
    """Instants of the samples that are kept."""

    time: Values
    """[s]"""
    keep: Values
    """Which samples these are."""
    sample_time: float
    """[s]"""
    unit: str
    unit_stated: bool
    n_repeated: int
    warnings: tuple[str, ...]


def seconds(value: float | str | None, name: str = "sample_time") -> float | None:
    """Return a stated time in seconds.

    Parameters
    ----------
    value
        A number [s] or a text with its unit.
    name
        Of the option.

    Raises
    ------
    UnitError
        It is none, or not > 0.
    """
    if value is None:
        return None
    if isinstance(value, str):
        found = parse_quantity(value, "time", name)
    elif isinstance(value, bool) or not isinstance(value, int | float):
        raise UnitError(f"{name} must be a time, got {value!r}")
    else:
        found = float(value)
    if not 0.0 < found < np.inf:
        raise UnitError(f"{name} must be > 0 s, got {value!r}")
    return found


def clock_of_steps(index: Values, step: float | None) -> Clock:
    """Return instants that are counted: of equal steps, or in samples if the step is not known.

    Parameters
    ----------
    index
        Number of each sample; what is missing in it was lost.
    step
        Time between samples [s].
    """
    keep = np.ones(len(index), bool)
    if step is not None:
        return Clock(index * step, keep, step, "s", True, 0, ())
    said = (
        "the log has neither a column of time nor a sample time: times are in samples, and nothing "
        "that depends on time can be said in seconds; give sample_time"
    )
    return Clock(index.astype(float), keep, 1.0, "samples", False, 0, (said,))


def clock_of_column(
    values: Values, row: Values, *, name: str, column: str, unit: str | None,
    stated: bool, sample_time: float | None,
) -> Clock:  # fmt: skip
    """Return the instants of a column of time.

    Parameters
    ----------
    values
        The column; NaN where it has no number.
    row
        Number of each sample in the file, for messages.
    name, column
        The file and the column.
    unit
        Of the column: as stated or as the file writes it; None if neither says.
    stated
        Whether the column was named by the user, so that a sample time beside it must agree.
    sample_time
        As stated [s].

    Raises
    ------
    LogError
        Time runs backwards or stands still, or the sample time contradicts it.
    """
    warnings = []
    finite = np.isfinite(values)
    if not finite.any():
        raise LogError(f"{name}: the column of time, {column!r}, holds no numbers")
    kept = values[finite]
    steps = np.diff(kept)
    back = np.flatnonzero(steps < 0.0)
    places = np.flatnonzero(finite)
    if len(back):
        at = int(back[0])
        raise LogError(
            f"{name}: time runs backwards: {column!r} is {kept[at + 1]:.9g} in sample "
            f"{row[places[at + 1]]} and {kept[at]:.9g} in the one before ({len(back)} such "
            "places); cut the log there, or leave the column out and give sample_time"
        )
    fresh = np.concatenate([[True], steps > 0.0])
    if fresh.sum() < 2 and len(kept) > 1:
        raise LogError(f"{name}: the column of time, {column!r}, is constant")
    keep = np.zeros(len(values), bool)
    keep[places[fresh]] = True
    n_repeated = int(len(kept) - fresh.sum())
    time = kept[fresh]
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    size = None if unit is None else known_unit(unit, "time")
    if unit is not None and size is None:
        raise UnitError(f"{name}: the unit of {column!r}, {unit!r}, is none of time")
    if size is None:
        if sample_time is not None:
            size, unit = sample_time / step, f"{sample_time:g} s a step"
        else:
            unit = guess_time_unit(step)
            size = known_unit(unit, "time") or 1.0
            warnings.append(
                f"the unit of the time column {column!r} is not stated: taken for {unit}, from its "
                f"steps of {step:.6g}"
            )
    time, step = (time - time[0]) * size, step * size
    if sample_time is not None and abs(step / sample_time - 1.0) > AGREE:
        said = f"{column!r} has steps of {step:.6g} s, and sample_time is {sample_time:.6g} s"
        if stated:
            raise LogError(f"{name}: {said}: give one of them")
        warnings.append(f"{said}: the column counts")
    if n_repeated:
        warnings.append(
            f"{n_repeated} of {len(values)} samples repeat the instant of the one before and are "
            "left out"
        )
    return Clock(time, keep, step, unit or "s", unit is not None and not warnings[:1],
                 n_repeated, tuple(warnings))  # fmt: skip
