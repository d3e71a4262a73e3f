"""Logs in HDF5, among them MAT files of version 7.3 and netCDF-4.

Every numeric dataset of one dimension is a column, called by its path; of one with two dimensions,
every row or column across the longer one; of a table, every field. Datasets that lie in other
files are not followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import LogError
from contourlab.logs.source import Columns, Source, refuse_length

__all__ = ["gathered", "open_hdf5", "split_columns"]

MOST_WIDE = 256
"""Columns that a dataset of two dimensions may have; one with more is a picture, no log."""
MOST_DATASETS = 20_000
_UNIT_NAMES = ("units", "unit", "Unit", "Units")

Values = NDArray[Any]


def open_hdf5(name: str) -> Source:
    """Return a log in HDF5, opened.

    Parameters
    ----------
    name
        The file.

    Raises
    ------
    LogError
        It is damaged, or holds no numbers.
    """
    import h5py

    places: dict[str, tuple[str, Any]] = {}
    units: dict[str, str] = {}
    kind = "HDF5"

    def visit(path: str, item: Any) -> None:
        if (
            not isinstance(item, h5py.Dataset)
            or path.startswith("#")
            or len(places) > MOST_DATASETS
        ):
            return
        if item.external or item.is_virtual or item.shape is None:
            return
        for column, how in split_columns(path, item.shape, item.dtype):
            places[column] = (path, how)
            for key in _UNIT_NAMES:
                value = item.attrs.get(key)
                if isinstance(value, bytes):
                    value = value.decode("utf-8", errors="replace")
                if isinstance(value, str) and value:
                    units[column] = value
                    break

    try:
        with h5py.File(name, "r") as file:
            file.visititems(visit)
            if file.userblock_size >= 512:
                kind = "MAT 7.3"
    except Exception as error:  # noqa: BLE001  (h5py raises whatever a damaged file makes it)
        raise LogError(f"{name}: is no sound HDF5 file ({_short(error)})") from None
    if not places:
        raise LogError(f"{name}: holds no columns of numbers")

    def read(wanted: Sequence[str]) -> Columns:
        try:
            with h5py.File(name, "r") as file:
                found = {one: _part(file[places[one][0]], places[one][1]) for one in wanted}
        except LogError:
            raise
        except Exception as error:  # noqa: BLE001  (as above)
            raise LogError(f"{name}: is no sound HDF5 file ({_short(error)})") from None
        return gathered(name, found)

    return Source(name=name, format=kind, names=tuple(places), read=read, units=units)


def split_columns(path: str, shape: Sequence[int], kind: np.dtype[Any]) -> list[tuple[str, Any]]:
    """Return the columns that an array holds: their names, and where they lie in it.

    Parameters
    ----------
    path
        Name of the array.
    shape, kind
        Its shape and type.
    """
    if kind.names:
        if len(shape) != 1:
            return []
        return [(f"{path}.{f}", f) for f in kind.names if kind[f].kind in "fiub"]
    long = [size for size in shape if size > 1]
    if kind.kind not in "fiub" or not shape or len(shape) > 2 or 0 in shape:
        return []
    if len(long) < 2:
        return [(path, None)] if len(shape) <= 2 and max(shape) >= 1 else []
    across = 0 if shape[0] < shape[1] else 1
    if shape[across] > MOST_WIDE:
        return []
    return [(f"{path}.{k}", (across, k)) for k in range(shape[across])]


def _part(item: Any, how: Any) -> Values:
    refuse_length(str(item.name), max(item.shape, default=0))
    if how is None:
        return np.asarray(item[()], float).ravel()
    if isinstance(how, str):
        return np.asarray(item[how], float)
    across, k = how
    return np.asarray(item[k, :] if across == 0 else item[:, k], float)


def gathered(name: str, found: dict[str, Values]) -> Columns:
    """Return columns, checked to be of one length.

    Parameters
    ----------
    name
        Of the file.
    found
        The columns.

    Raises
    ------
    LogError
        Their lengths differ.
    """
    lengths = {one: len(values) for one, values in found.items()}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{one} {n}" for one, n in lengths.items())
        raise LogError(f"{name}: the columns have different numbers of samples: {said}")
    for values in found.values():
        values[~np.isfinite(values)] = np.nan
    if not lengths or next(iter(lengths.values())) == 0:
        raise LogError(f"{name}: holds no samples")
    return Columns(found)


def _short(error: Exception) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 120 else f"{text[:120]}..."
