"""Logs in MDF, versions 3 and 4, read by asammdf (the extra ``logs``)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contourlab.errors import LogError
from contourlab.logs.hdf5 import gathered
from contourlab.logs.source import Columns, Source, refuse_length

__all__ = ["TIME", "open_mdf"]

IDENTIFICATION, HEADER = 64, 104
"""Bytes of the first blocks of a file."""
TIME = "time"
"""What the time stamps of the chosen channels are called."""


def open_mdf(name: str) -> Source:
    """Return a log in MDF, opened.

    Parameters
    ----------
    name
        The file.

    Raises
    ------
    LogError
        asammdf is not installed; the file is damaged or holds no channels.
    """
    units: dict[str, str] = {}
    _refuse_short(name)
    with _opened(name) as file:
        names = []
        for number, group in enumerate(file.groups):
            for place, channel in enumerate(group.channels):
                if (
                    channel.name
                    and channel.name not in names
                    and not _is_master(file, number, place)
                ):
                    names.append(channel.name)
    if not names:
        raise LogError(f"{name}: holds no channels")

    def read(wanted: Sequence[str]) -> Columns:
        channels = [one for one in wanted if one != TIME]
        with _opened(name) as file:
            try:
                signals = [_first(file, one) for one in channels]
            except Exception as error:  # noqa: BLE001  (whatever a damaged file makes it raise)
                raise LogError(f"{name}: is no sound MDF file ({_said(error)})") from None
        for one, signal in zip(channels, signals, strict=True):
            refuse_length(name, len(signal.samples))
            if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "fiub":
                raise LogError(f"{name}: channel {one!r} is not made of single numbers")
        notes = []
        found: dict[str, Any] = {}
        if signals:
            # the slowest of the channels sets the instants, the others are interpolated
            clock = min(signals, key=lambda s: len(s.timestamps)).timestamps
            for one, signal in zip(channels, signals, strict=True):
                same = len(signal.timestamps) == len(clock) and np.array_equal(
                    signal.timestamps, clock
                )
                values = np.asarray(signal.samples, float)
                if not same:
                    notes.append(f"{one} was recorded at other instants and is interpolated")
                    values = np.interp(clock, signal.timestamps, values, np.nan, np.nan)
                found[one] = values.copy()
            if TIME in wanted:
                found[TIME] = np.asarray(clock, float).copy()
        columns = gathered(name, found)
        return Columns(columns.values, notes=tuple(notes))

    with _opened(name) as file:
        for one in names:
            try:
                unit = file.get_channel_unit(one, *file.channels_db[one][0])
            except Exception:  # noqa: BLE001  (a unit that cannot be read is no unit)
                continue
            if isinstance(unit, str) and unit:
                units[one] = unit
    shown = (*((TIME,) if TIME not in names else ()), *names)
    return Source(
        name=name, format="MDF", names=shown, read=read, units={**units, TIME: "s"},
        time=TIME if TIME not in names else None,
    )  # fmt: skip


def _is_master(file: Any, group: int, place: int) -> bool:
    return bool(file.masters_db.get(group, -1) == place)


def _first(file: Any, name: str) -> Any:
    group, place = file.channels_db[name][0]
    return file.get(name, group=group, index=place)


def _refuse_short(name: str) -> None:
    """Refuse a file that ends in its first two blocks, which asammdf takes badly."""
    with Path(name).open("rb") as stream:
        head = stream.read(IDENTIFICATION + HEADER + 1)
    if len(head) <= IDENTIFICATION + HEADER or not head[8:12].strip(b" \0.0123456789") == b"":
        raise LogError(f"{name}: is no sound MDF file (its header is cut off)")


def _opened(name: str) -> Any:
    try:
        from asammdf import MDF
    except ImportError:
        raise LogError(
            f"{name}: MDF files are read by asammdf, which is not installed: "
            "pip install contourlab[logs]"
        ) from None
    try:
        return MDF(name)
    except Exception as error:  # noqa: BLE001  (asammdf raises whatever a damaged file makes it)
        raise LogError(f"{name}: is no sound MDF file ({_said(error)})") from None


def _said(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
