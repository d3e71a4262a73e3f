"""Reads a measured log of any known kind."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import LogError, UnitError
from contourlab.logs.clock import Clock, clock_of_column, clock_of_steps, seconds
from contourlab.logs.columns import Choice, choose_columns, find_column, guess_time, listed
from contourlab.logs.log import ColumnUse, Log
from contourlab.logs.source import Columns, Source
from contourlab.logs.text import HEAD_BYTES, open_text
from contourlab.logs.written_units import (
    check_same,
    guess_length,
    known_unit,
    stated_unit,
    unit_of,
)

__all__ = ["open_log", "read_log"]

_HDF5 = b"\x89HDF\r\n\x1a\n"
_ROTARY = ("A", "B", "C")
_COMMAND_UNITS = {"force": "N", "velocity": "m/s"}
Values = NDArray[Any]


def open_log(
    path: str | os.PathLike[str],
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str | None = None,
) -> Source:
    """Return a log's columns without reading their numbers.

    Parameters
    ----------
    path
        The file; its kind is found from its first bytes.
    delimiter, decimal, header, comment
        Of a text log: separator (``" "`` for blanks), ``"."`` or ``","``, whether the first line
        names the columns, with what comments begin. Found if None.

    Returns
    -------
    Source
        Names, units and what the format says.

    Raises
    ------
    LogError
        The file cannot be read or holds no log.
    ConfigurationError
        An option that is not allowed.
    """
    name = os.fspath(path)
    try:
        if not stat.S_ISREG(Path(name).stat().st_mode):
            raise LogError(f"{name}: is not a regular file")
        with Path(name).open("rb") as stream:
            head = stream.read(HEAD_BYTES)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise LogError(f"{name}: cannot be read: {reason}") from None
    if not head:
        raise LogError(f"{name}: is empty")
    binary = _binary(name, head)
    if binary is not None:
        return binary
    return open_text(
        name, head, delimiter=delimiter, decimal=decimal, header=header, comment=comment
    )


def _binary(name: str, head: bytes) -> Source | None:
    if head[:8] == _HDF5 or head[512:520] == _HDF5:
        from contourlab.logs.hdf5 import open_hdf5
        from contourlab.logs.netcdf import is_recording, open_recording

        return open_recording(name) if is_recording(name) else open_hdf5(name)
    if head[:4] in (b"MDF ", b"UnFi"):
        from contourlab.logs.mdf import open_mdf

        return open_mdf(name)
    if head[:3] == b"CDF":
        raise LogError(f"{name}: is netCDF classic, which is not read: convert it to netCDF-4")
    if head[:6] == b"MATLAB" or name.lower().endswith(".mat"):
        from contourlab.logs.matlab import open_matlab

        return open_matlab(name)
    return None


def read_log(
    path: str | os.PathLike[str] | Source,
    *,
    commanded: str | Sequence[str] | None = None,
    actual: str | Sequence[str] | None = None,
    command: str | Sequence[str] | None = None,
    time: str | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    command_unit: str | None = None,
    sample_time: float | str | None = None,
    axes: str | Sequence[str] | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str | None = None,
) -> Log:
    """Return a measured log: CSV, halsampler, halscope, MAT, HDF5, MDF, or our own netCDF.

    Columns, units and instants that are not stated are taken from the file, and where it does not
    say, guessed; ``columns`` and ``warnings`` of the log show what was.

    Parameters
    ----------
    path
        The file, or what :func:`open_log` returned.
    commanded, actual, command
        Columns of the positions asked for, of those measured, and of what the drives were told:
        names with commas, or a sequence, in the order of the axes. A number counts columns from 0.
    time
        Column of time; found by its name if None. With ``sample_time`` and no ``time``, instants
        are counted.
    unit
        Of the positions: ``"mm"``, ``"deg"``, or a length such as ``"0.1 um"`` for counts.
    time_unit, command_unit
        Of these columns.
    sample_time
        Time between samples, a number [s] or a text with its unit.
    axes
        Names of the axes, in the order of the columns.
    delimiter, decimal, header, comment
        As for :func:`open_log`.

    Returns
    -------
    Log
        In SI, in order of time, without samples that lack a position.

    Raises
    ------
    LogError
        The file cannot be read, a column is not there or holds no numbers, time runs backwards,
        fewer than two samples are left, or nothing moves.
    UnitError
        A unit that is none, or contradicts the file.
    ConfigurationError
        An option that is not allowed.
    """
    if isinstance(path, Source):
        source = path
    else:
        source = open_log(
            path, delimiter=delimiter, decimal=decimal, header=header, comment=comment
        )
    name = source.name
    step = seconds(sample_time)
    names = listed(axes, "axes")
    if names is not None and len(names) == 1 and len(names[0]) <= 3 and names[0].isalpha():
        names = list(names[0])  # XY is X and Y
    chosen, axis_names = choose_columns(
        source, commanded=listed(commanded, "commanded"), actual=listed(actual, "actual"),
        command=listed(command, "command"), axes=names,
    )  # fmt: skip
    time_column = None
    if time is not None:
        time_column = find_column(source, time, "time")
    elif step is None:
        time_column = guess_time(source)
    used = {column for choice in chosen.values() for column in choice.names}
    if time_column in used:
        if time is not None:
            raise LogError(f"{name}: {time_column!r} cannot be the time and a position too")
        time_column = None
    wanted = list(dict.fromkeys(
        [c for choice in chosen.values() for c in choice.names]
        + [c for c in (time_column, source.counter) if c is not None]
    ))  # fmt: skip
    columns = source.read(wanted)
    linear, rotary, silent = _kinds(source, chosen, axis_names, unit)

    def log_of(which: list[int], unit: str | None) -> Log:
        own = {role: choice._replace(names=tuple(choice.names[k] for k in which))
               for role, choice in chosen.items()}  # fmt: skip
        return _log(source, columns, own, tuple(axis_names[k] for k in which), time_column,
                    time is not None, unit, time_unit, command_unit, step)  # fmt: skip

    if not rotary:
        return log_of(linear, unit)
    turned = " and ".join(axis_names[k] for k in rotary)
    if linear and not _moves(columns, chosen, rotary):
        log = log_of(linear, unit)
        said = f"{turned}: rotary, and at rest in all of the log: left out"
        return replace(log, warnings=(*log.warnings, said))
    guessed = {axis_names[k] for k in silent} if len(silent) == len(rotary) else set()
    turning = log_of(rotary, "deg" if guessed else None if linear else unit)
    turning = replace(turning, columns=tuple(
        replace(use, unit_stated=use.unit_stated and use.axis not in guessed)
        for use in turning.columns
    ))  # fmt: skip
    letters = (
        f"{turned}: taken for deg, as a letter of A, B, C without a unit is a rotary axis"
        if guessed
        else ""
    )
    if not linear:
        return replace(turning, warnings=tuple(filter(None, [*turning.warnings, letters])))
    log = log_of(linear, unit)
    own = [f"{turned}: {text}" for text in turning.warnings if text not in log.warnings]
    return replace(
        log, rotary=turning,
        warnings=tuple(filter(None, dict.fromkeys([*log.warnings, *own, letters]))),
        columns=(*log.columns, *(use for use in turning.columns if use.role != "time")),
    )  # fmt: skip


def _moves(columns: Columns, chosen: dict[str, Choice], which: list[int]) -> bool:
    """Return whether any of the axes changes its position."""
    for role in ("commanded", "actual"):
        for k in which if role in chosen else ():
            values = columns.values[chosen[role].names[k]]
            values = values[np.isfinite(values)]
            if len(values) and np.ptp(values) > 0.0:
                return True
    return False


def _kinds(
    source: Source, chosen: dict[str, Choice], axes: tuple[str, ...], unit: str | None
) -> tuple[list[int], list[int], list[int]]:
    """Return the linear and the rotary axes, and those that are it by their letter alone."""
    if unit is not None and stated_unit(unit, "unit")[1] == "angle":
        return [], list(range(len(axes))), []
    written = [
        [w for role in ("commanded", "actual") if role in chosen
         for w in [unit_of(chosen[role].names[k], source.units.get(chosen[role].names[k], ""))]]
        for k in range(len(axes))
    ]  # fmt: skip
    angles = [k for k, units in enumerate(written)
              if any(known_unit(w, "angle") is not None for w in units)]  # fmt: skip
    silent = [k for k, axis in enumerate(axes) if axis in _ROTARY and not any(written[k])]
    if len(silent) == len(axes) and unit is not None:  # then the user says that they are lengths
        silent = []
    rotary = sorted({*angles, *silent})
    return [k for k in range(len(axes)) if k not in rotary], rotary, silent


def _log(
    source: Source, columns: Columns, chosen: dict[str, Choice], axes: tuple[str, ...],
    time_column: str | None, time_stated: bool, unit: str | None, time_unit: str | None,
    command_unit: str | None, step: float | None,
) -> Log:  # fmt: skip
    name = source.name
    rows = {
        role: np.column_stack([columns.values[one] for one in choice.names])
        for role, choice in chosen.items()
    }
    n = len(next(iter(rows.values())))
    present = np.ones(n, bool)
    for role in ("commanded", "actual"):
        if role in rows:
            present &= np.isfinite(rows[role]).all(axis=1)
    n_missing = int(n - present.sum())
    _refuse_missing(source, chosen, rows, present)
    clock, time_said = _clock(source, columns, time_column, time_stated, time_unit, step, n)
    keep = clock.keep & present
    if keep.sum() < 2:
        raise LogError(f"{name}: {int(keep.sum())} sample is left; a motion takes two or more")
    positions = [rows[role][keep] for role in ("commanded", "actual") if role in rows]
    size, dimension, shown, said = _unit(source, chosen, unit, positions)
    warnings = [*columns.notes, *time_said, *clock.warnings, *said]
    guessed = [role for role, choice in chosen.items() if not choice.stated]
    for role in guessed:
        warnings.insert(
            0,
            f"the {role} positions are taken from {', '.join(chosen[role].names)}, by their names",
        )
    if n_missing:
        warnings.append(f"{n_missing} of {n} samples lack a position and are left out")
    if len(columns.lost_after):
        warnings.append(f"samples were lost at {len(columns.lost_after)} places, as the log says")
    _refuse_still(source, chosen, rows, keep, axes)
    index = np.flatnonzero(keep)
    lost = np.searchsorted(index, columns.lost_after, side="right") - 1
    command, written = _command(source, chosen, rows, keep, command_unit)
    row = np.flatnonzero(keep)
    time_of = np.full(n, np.nan)
    time_of[clock.keep] = clock.time
    time = time_of[keep]
    return Log(
        source=name, format=source.format, axes=axes, time=time - time[0],
        sample_time=clock.sample_time,
        timed=clock.unit != "samples",
        commanded=rows["commanded"][keep] * size if "commanded" in rows else None,
        actual=rows["actual"][keep] * size, command=command, command_unit=written,
        dimension=dimension, scale=size, row=row,
        columns=_uses(chosen, axes, shown, not said, time_column,
                      time_stated or source.time is not None, clock, written),
        n_missing=n_missing, n_repeated=clock.n_repeated, lost_after=np.unique(lost[lost >= 0]),
        warnings=tuple(dict.fromkeys(warnings)), notes=source.notes,
    )  # fmt: skip


def _refuse_missing(
    source: Source, chosen: dict[str, Choice], rows: dict[str, Values], present: Values
) -> None:
    if present.any():
        return
    for role, choice in chosen.items():
        for k, column in enumerate(choice.names):
            if role in rows and not np.isfinite(rows[role][:, k]).any():
                raise LogError(f"{source.name}: column {column!r} holds no numbers")
    raise LogError(f"{source.name}: no sample holds a position of every axis")


def _clock(
    source: Source, columns: Columns, time_column: str | None, stated: bool,
    time_unit: str | None, step: float | None, n: int,
) -> tuple[Clock, list[str]]:  # fmt: skip
    row = np.arange(n)
    if time_column is not None:
        written = unit_of(time_column, source.units.get(time_column, ""))
        unit = time_unit or written or None
        if time_unit is None and unit is not None and known_unit(unit, "time") is None:
            unit = None
        clock = clock_of_column(
            columns.values[time_column], row, name=source.name, column=time_column, unit=unit,
            stated=stated, sample_time=step,
        )  # fmt: skip
        said = []
        if not stated and source.time is None:
            said.append(f"time is taken from the column {time_column!r}, by its name")
        return clock, said
    given = step if step is not None else source.sample_time
    if source.counter is not None:
        count = columns.values[source.counter]
        if np.isfinite(count).all() and (np.diff(count) > 0).all():
            row = (count - count[0]).astype(np.int64)
    return clock_of_steps(row, given), []


def _unit(
    source: Source, chosen: dict[str, Choice], unit: str | None, positions: list[Values]
) -> tuple[float, str, str, list[str]]:
    """Return size, kind and name of the unit of positions, and a sentence if it was guessed."""
    own = {c: unit_of(c, source.units.get(c, "")) for role in ("commanded", "actual")
           if role in chosen for c in chosen[role].names}  # fmt: skip
    if unit is not None:
        size, dimension = stated_unit(unit, "unit")
        for column, written in own.items():
            check_same(source.name, column, written, unit, size)
        return size, dimension, unit, []
    known = {w: known_unit(w, d) for w in own.values() for d in ("length", "angle")
             if known_unit(w, d) is not None}  # fmt: skip
    if len({round(np.log(size), 9) for size in known.values() if size}) > 1:
        raise UnitError(
            f"{source.name}: the positions are in different units: "
            + ", ".join(f"{c} in {w}" for c, w in own.items())
        )
    if known:
        written = next(iter(known))
        size = known[written] or 1.0
        dimension = "length" if known_unit(written, "length") is not None else "angle"
        silent = [c for c, w in own.items() if w not in known]
        said = [f"{', '.join(silent)} state no unit: taken for {written}, as the others"]
        return size, dimension, written, said if silent else []
    foreign = [f"{c} in {w}" for c, w in own.items() if w]
    if foreign:
        raise UnitError(f"{source.name}: {', '.join(foreign)}: no unit of length or angle; "
                        "state it with unit")  # fmt: skip
    with np.errstate(all="ignore"):
        extent = max(float(np.ptp(p, axis=0).max()) for p in positions)
    guess = guess_length(extent)
    return (
        known_unit(guess, "length") or 1.0, "length", guess,
        [f"the unit of the positions is not stated: taken for {guess}, since they extend over "
         f"{extent:.4g}; every figure rests on that, so state it with unit"],
    )  # fmt: skip


def _refuse_still(
    source: Source, chosen: dict[str, Choice], rows: dict[str, Values], keep: Values,
    axes: tuple[str, ...],
) -> None:  # fmt: skip
    pairs: tuple[tuple[str, str], ...] = (("actual", "commanded"), ("commanded", "actual"))
    spans: dict[str, Values] = {
        role: np.ptp(rows[role][keep], axis=0) for role in pairs[0] if role in rows
    }
    if not any((span > 0.0).any() for span in spans.values()):
        raise LogError(f"{source.name}: nothing moves: every position column is constant")
    if "commanded" not in spans:
        return
    for k, axis in enumerate(axes):
        for role, other in pairs:
            # one quantum of the other may be noise; a motion that is many times it is not
            if spans[role][k] == 0.0 and spans[other][k] > 0.05 * spans[other].max():
                raise LogError(
                    f"{source.name}: column {chosen[role].names[k]!r} is constant while "
                    f"{chosen[other].names[k]!r} moves by {spans[other][k]:.6g}: is it the {role} "
                    f"position of {axis}?"
                )


def _command(
    source: Source, chosen: dict[str, Choice], rows: dict[str, Values], keep: Values,
    unit: str | None,
) -> tuple[Values | None, str]:  # fmt: skip
    if "command" not in rows:
        return None, ""
    column = chosen["command"].names[0]
    written = unit or unit_of(column, source.units.get(column, ""))
    for dimension, si in _COMMAND_UNITS.items():
        size = known_unit(written, dimension) if written else None
        if size is not None:
            return rows["command"][keep] * size, si
    return rows["command"][keep], written


def _uses(
    chosen: dict[str, Choice], axes: tuple[str, ...], unit: str, unit_stated: bool,
    time_column: str | None, time_stated: bool, clock: Clock, command_unit: str,
) -> tuple[ColumnUse, ...]:  # fmt: skip
    uses = []
    if time_column is not None:
        uses.append(ColumnUse("time", "", time_column, clock.unit, time_stated, clock.unit_stated))
    for role, choice in chosen.items():
        for axis, column in zip(axes, choice.names, strict=True):
            position = role != "command"
            uses.append(ColumnUse(
                role, axis, column, unit if position else command_unit, choice.stated,
                unit_stated if position else bool(command_unit),
            ))  # fmt: skip
    return tuple(uses)
