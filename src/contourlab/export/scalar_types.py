"""Scalar types of generated C: which C type stands for which NumPy type, and literals of each.

``float64`` is the *real* type, double or single by choice; every other type keeps its width.
Literals of real numbers are written with ``%.17g`` and come back exactly, infinities, NaN, signed
zeros and denormals too.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from contourlab.errors import ConfigurationError, choices

__all__ = ["PRECISIONS", "Precision", "c_type", "is_real", "literal", "suffix_of", "supported"]

PRECISIONS = ("double", "single")

_TYPES = {
    "bool": "bool", "int8": "int8_t", "int16": "int16_t", "int32": "int32_t", "int64": "int64_t",
    "uint8": "uint8_t", "uint16": "uint16_t", "uint32": "uint32_t", "uint64": "uint64_t",
    "float32": "float",
}  # fmt: skip
_SUFFIXES = {
    "bool": "b", "int8": "i8", "int16": "i16", "int32": "i32", "int64": "i64", "uint8": "u8",
    "uint16": "u16", "uint32": "u32", "uint64": "u64", "float32": "f32", "float64": "r",
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Precision:
    """Of the real type.

    Parameters
    ----------
    name
        ``"double"`` or ``"single"``.

    Raises
    ------
    ConfigurationError
        Another name.
    """

    name: str = "double"

    def __post_init__(self) -> None:
        if self.name not in PRECISIONS:
            raise ConfigurationError(
                f"precision must be double or single, got {self.name!r}; "
                + choices(self.name, PRECISIONS)
            )

    @property
    def single(self) -> bool:
        """Whether reals are of single precision."""
        return self.name == "single"

    @property
    def c_type(self) -> str:
        """The C type behind the real type."""
        return "float" if self.single else "double"

    @property
    def numpy(self) -> type:
        """The NumPy type of a real."""
        return np.float32 if self.single else np.float64


def supported(dtype: Any) -> bool:
    """Return whether values of a type can be exported.

    Parameters
    ----------
    dtype
        NumPy type.
    """
    return str(dtype) in _SUFFIXES


def is_real(dtype: Any) -> bool:
    """Return whether a type is one of floating-point numbers.

    Parameters
    ----------
    dtype
        NumPy type.
    """
    return bool(np.issubdtype(dtype, np.floating))


def c_type(dtype: Any, real: str) -> str:
    """Return the C type of a NumPy type.

    Parameters
    ----------
    dtype
        NumPy type.
    real
        Name of the real type.
    """
    return real if str(dtype) == "float64" else _TYPES[str(dtype)]


def suffix_of(dtype: Any) -> str:
    """Return the ending of a helper function's name for a type.

    Parameters
    ----------
    dtype
        NumPy type.
    """
    return _SUFFIXES[str(dtype)]


def literal(value: Any, dtype: Any, precision: Precision) -> str:
    """Return a constant as it is written in C.

    Parameters
    ----------
    value
        One number.
    dtype
        Its NumPy type.
    precision
        Of the real type.
    """
    kind = np.dtype(dtype)
    if kind == np.bool_:
        return "true" if value else "false"
    if kind.kind in "iu":
        return _integer(int(value), kind)
    single = kind == np.float32 or precision.single
    with np.errstate(over="ignore", under="ignore"):
        number = float(np.float32(value)) if single else float(value)
    if np.isnan(number):
        return "NAN"
    if np.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    text = f"{number:.17g}"
    if not any(mark in text for mark in ".en"):
        text += ".0"
    return text + ("f" if single else "")


def _integer(value: int, kind: Any) -> str:
    info = np.iinfo(kind)
    bits = info.bits
    if kind.kind == "i" and value == info.min and bits >= 32:
        return f"INT{bits}_MIN"
    if bits == 64:
        return f"INT64_C({value})" if kind.kind == "i" else f"UINT64_C({value})"
    return f"{value}" if kind.kind == "i" else f"{value}u"
