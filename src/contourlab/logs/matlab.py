"""Logs in MAT files: arrays and structures of arrays, such as Simulink and dSPACE write.

Version 7.3 is HDF5. In older ones a variable is a column if it is a vector, several if it is a
matrix; the fields of structures are called by their path, ``log.signals.values``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import LogError
from contourlab.logs.hdf5 import gathered, split_columns
from contourlab.logs.source import MOST_SAMPLES, Columns, Source

__all__ = ["open_matlab"]

DEEPEST = 6
"""Structures within structures that are looked into."""
MOST_VALUES = 10 * MOST_SAMPLES
"""Numbers in all variables of a file."""
_ARRAYS = ("double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64",
           "uint64", "logical")  # fmt: skip

Values = NDArray[Any]


def open_matlab(name: str) -> Source:
    """Return a log in a MAT file of version 4 or 5, opened.

    Parameters
    ----------
    name
        The file.

    Raises
    ------
    LogError
        It is damaged, too large, or holds no numbers.
    """
    arrays: dict[str, Values] = {}
    for variable, shape, kind in _read(name, "whosmat"):
        size = int(np.prod(np.asarray(shape, float))) if len(shape) else 0
        if size > MOST_VALUES:
            raise LogError(f"{name}: variable {variable} claims {size} values, too many")
        if kind in (*_ARRAYS, "struct"):
            arrays[variable] = np.zeros(0)
    if not arrays:
        raise LogError(f"{name}: holds no columns of numbers")
    found = _read(name, "loadmat", variable_names=list(arrays), simplify_cells=True)
    arrays = {}
    for variable, value in found.items():
        if not variable.startswith("__"):
            _flatten(variable, value, arrays, DEEPEST)
    columns: dict[str, tuple[str, Any]] = {}
    for path, values in arrays.items():
        for column, how in split_columns(path, values.shape, values.dtype):
            columns[column] = (path, how)
    if not columns:
        raise LogError(f"{name}: holds no columns of numbers")

    def read(wanted: Sequence[str]) -> Columns:
        return gathered(name, {one: _part(arrays, *columns[one]) for one in wanted})

    return Source(name=name, format="MAT", names=tuple(columns), read=read)


def _read(name: str, what: str, **options: Any) -> Any:
    import warnings

    import scipy.io

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return getattr(scipy.io, what)(name, **options)
    except Exception as error:  # noqa: BLE001  (SciPy raises whatever a damaged file makes it)
        text = " ".join(str(error).split())[:120] or type(error).__name__
        raise LogError(f"{name}: is no sound MAT file ({text})") from None


def _flatten(path: str, value: Any, arrays: dict[str, Values], depth: int) -> None:
    if isinstance(value, dict):
        for key, inner in value.items():
            if depth > 0:
                _flatten(f"{path}.{key}", inner, arrays, depth - 1)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for k, inner in enumerate(value.ravel()[:100]):
            if depth > 0:
                _flatten(f"{path}.{k}", inner, arrays, depth - 1)
    elif isinstance(value, np.ndarray):
        arrays[path] = value
    elif isinstance(value, float | int):
        arrays[path] = np.array([value])


def _part(arrays: dict[str, Values], path: str, how: Any) -> Values:
    values = arrays[path]
    if how is None:
        return values.ravel().astype(float)
    if isinstance(how, str):
        return values[how].astype(float)
    across, k = how
    return (values[k, :] if across == 0 else values[:, k]).astype(float)
