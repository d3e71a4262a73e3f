"""contourlab's own recordings as logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contourlab.errors import LogError, RecordingError
from contourlab.logs.hdf5 import gathered
from contourlab.logs.source import Columns, Source
from contourlab.recordings.recording import Recording

__all__ = ["is_recording", "of_recording", "open_recording"]


def is_recording(name: str) -> bool:
    """Return whether an HDF5 file is a recording of ours.

    Parameters
    ----------
    name
        The file.
    """
    import h5py

    try:
        with h5py.File(name, "r") as file:
            return "time" in file and ("reference" in file or "contourlab" in file.attrs)
    except Exception:  # noqa: BLE001  (a damaged file is refused by whoever reads it next)
        return False


def open_recording(name: str) -> Source:
    """Return a recording's netCDF file, opened.

    Parameters
    ----------
    name
        The file.

    Raises
    ------
    LogError
        It is damaged.
    """
    try:
        recording = Recording.load(name)
    except RecordingError as error:
        raise LogError(str(error)) from None
    except Exception as error:  # noqa: BLE001  (xarray raises whatever a damaged file makes it)
        text = " ".join(str(error).split())[:120] or type(error).__name__
        raise LogError(f"{name}: is no sound recording ({text})") from None
    return of_recording(recording, name)


def of_recording(recording: Recording, name: str) -> Source:
    """Return a recording as a log; its columns are called as in ``Recording.to_pandas``.

    Parameters
    ----------
    recording
        A run, or a log.
    name
        Of it, for messages.

    Raises
    ------
    LogError
        It has no numbers over time.
    """
    table = recording.to_pandas()
    table.insert(0, "time", table.index.to_numpy())
    names = tuple(str(column) for column in table.columns)
    axes = [str(label) for label in np.asarray(recording.dataset.coords.get("axis", []))]
    units = {"time": "s"}
    for one, variable in recording.dataset.data_vars.items():
        for column in names:
            if column == one or column.startswith(f"{one}_"):
                unit = variable.attrs.get("units", variable.attrs.get("unit", ""))
                units[column] = str(unit) or "m"
    held = recording.dataset.variables
    shown = "measured" if "measured" in held else "actual"
    roles = {
        role: tuple(f"{variable}_{axis}" for axis in axes)
        for role, variable in (
            ("commanded", "reference"),
            ("actual", shown),
            ("command", "command"),
        )
        if variable in held and all(f"{variable}_{axis}" in names for axis in axes)
    }

    def read(wanted: Sequence[str]) -> Columns:
        return gathered(name, {one: table[one].to_numpy(float).copy() for one in wanted})

    return Source(
        name=name, format="recording", names=names, read=read, units=units, time="time",
        roles=roles, axes=tuple(axes),
    )  # fmt: skip
