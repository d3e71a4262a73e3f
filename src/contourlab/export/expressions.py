"""Expressions of generated C: small immutable trees over one scalar each, folded as they are made.

An expression has a NumPy type. Operations on constants are carried out; multiplying by one,
choosing between equal things and the like leave no operation. Nothing is folded that would change
a value: 0 x is not 0 where x is NaN, x + 0 is not x where x is -0.

Indices into arrays are affine (:class:`Index`): a constant and loop counters with whole factors.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

__all__ = ["Expression", "Index", "constant", "fold", "load", "name", "operation"]


@dataclasses.dataclass(frozen=True)
class Index:
    """A whole number: ``constant`` and the sum of factors times named whole numbers."""

    constant: int = 0
    terms: tuple[tuple[str, int], ...] = ()

    @staticmethod
    def of(value: Index | int | str) -> Index:
        """Return an index of a number or of a name.

        Parameters
        ----------
        value
            An index, a number or the name of a whole number.
        """
        if isinstance(value, Index):
            return value
        return Index(0, ((value, 1),)) if isinstance(value, str) else Index(int(value))

    @property
    def known(self) -> bool:
        """Whether it is a number."""
        return not self.terms

    def __add__(self, other: Index | int) -> Index:
        other = Index.of(other)
        terms = dict(self.terms)
        for key, factor in other.terms:
            terms[key] = terms.get(key, 0) + factor
        kept = tuple(sorted((k, f) for k, f in terms.items() if f))
        return Index(self.constant + other.constant, kept)

    def __mul__(self, factor: int) -> Index:
        if factor == 0:
            return Index()
        return Index(self.constant * factor, tuple((k, f * factor) for k, f in self.terms))

    def __str__(self) -> str:
        parts = []
        for key, factor in self.terms:
            sign = "-" if factor < 0 else "+"
            parts.append((sign, key if abs(factor) == 1 else f"{abs(factor)} * {key}"))
        if self.constant or not parts:
            parts.append(("-" if self.constant < 0 else "+", str(abs(self.constant))))
        first = ("-" if parts[0][0] == "-" else "") + parts[0][1]
        return first + "".join(f" {sign} {text}" for sign, text in parts[1:])


@dataclasses.dataclass(frozen=True, eq=False)
class Expression:
    """One scalar: a constant, a name, an element of an array, or an operation on expressions."""

    op: str
    dtype: Any
    args: tuple[Any, ...] = ()
    value: Any = None
    key: Any = None
    size: int = 1

    @property
    def is_constant(self) -> bool:
        """Whether its value is known."""
        return self.op == "constant"

    @property
    def atomic(self) -> bool:
        """Whether there is nothing to compute."""
        return self.op in ("constant", "name")


def constant(value: Any, dtype: Any) -> Expression:
    """Return a constant.

    Parameters
    ----------
    value
        One number.
    dtype
        Its NumPy type.
    """
    dtype = np.dtype(dtype)
    number = np.asarray(value).astype(dtype)[()]
    # bytes tell -0 from 0, and NaN is itself
    return Expression("constant", dtype, value=number, key=("c", str(dtype), number.tobytes()))


def name(text: str, dtype: Any) -> Expression:
    """Return a named scalar.

    Parameters
    ----------
    text
        Its name in C.
    dtype
        NumPy type.
    """
    return Expression("name", np.dtype(dtype), value=text, key=("n", text))


def load(array: str, index: Index, dtype: Any) -> Expression:
    """Return an element of an array.

    Parameters
    ----------
    array
        Its name in C.
    index
        Which element.
    dtype
        NumPy type.
    """
    return Expression("load", np.dtype(dtype), (array, index), key=("l", array, index))


def operation(op: str, dtype: Any, *args: Expression) -> Expression:
    """Return an operation on expressions, or what it folds to.

    Parameters
    ----------
    op
        Name of the operation, as in ``fold``.
    dtype
        NumPy type of the result.
    *args
        What it acts on.
    """
    dtype = np.dtype(dtype)
    if op in _FOLDS and all(arg.is_constant for arg in args):
        return constant(fold(op, dtype, *(arg.value for arg in args)), dtype)
    simple = _simplified(op, dtype, args)
    if simple is not None:
        return simple
    key = (op, str(dtype), *(arg.key for arg in args))
    return Expression(op, dtype, args, key=key, size=1 + sum(arg.size for arg in args))


def _is(arg: Expression, number: float | int) -> bool:
    return arg.is_constant and bool(arg.value == number)


def _simplified(op: str, dtype: Any, args: tuple[Expression, ...]) -> Expression | None:
    if op == "mul" and dtype != np.bool_:
        if _is(args[0], 1):
            return args[1]
        if _is(args[1], 1):
            return args[0]
    elif op == "div" and _is(args[1], 1):
        return args[0]
    elif op in ("add", "sub") and _is(args[1], 0):
        zero = args[1].value
        if dtype.kind in "iu" or (dtype.kind == "f" and bool(np.signbit(zero)) == (op == "add")):
            return args[0]
    elif op == "add" and _is(args[0], 0):
        if dtype.kind in "iu" or (dtype.kind == "f" and bool(np.signbit(args[0].value))):
            return args[1]
    elif op == "and" and dtype == np.bool_:
        for one, other in (args, args[::-1]):
            if one.is_constant:
                return other if one.value else one
    elif op == "or" and dtype == np.bool_:
        for one, other in (args, args[::-1]):
            if one.is_constant:
                return one if one.value else other
    elif op == "select":
        if args[0].is_constant:
            return args[1] if args[0].value else args[2]
        if args[1].key == args[2].key:
            return args[1]
    elif op == "cast" and args[0].dtype == dtype:
        return args[0]
    elif op == "not" and args[0].op == "not":
        return args[0].args[0]  # type: ignore[no-any-return]
    return None


def _divided(a: Any, b: Any) -> Any:
    if np.asarray(a).dtype.kind == "f":
        return np.divide(a, b)
    if np.any(np.asarray(b) == 0):
        return np.where(b == 0, -1, np.trunc(np.divide(a, np.where(b == 0, 1, b))))
    return np.sign(a) * np.sign(b) * (np.abs(a) // np.abs(b))


def _remainder(a: Any, b: Any) -> Any:
    if np.asarray(a).dtype.kind == "f":
        return np.fmod(a, b)
    return np.where(b == 0, a, np.fmod(a, np.where(b == 0, 1, b)))


def _rounded_away(a: Any) -> Any:
    return np.copysign(np.floor(np.abs(a) + 0.5), a) if np.ndim(a) else _away(float(a))


def _away(a: float) -> float:
    whole = np.trunc(a)
    return float(np.copysign(abs(whole) + (abs(a - whole) >= 0.5), a)) if np.isfinite(a) else a


_FOLDS: dict[str, Callable[..., Any]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": _divided, "rem": _remainder,
    "neg": np.negative, "abs": np.abs, "sign": np.sign,
    "max": np.maximum, "min": np.minimum, "pow": np.power,
    "sqrt": np.sqrt, "cbrt": np.cbrt, "exp": np.exp, "exp2": np.exp2, "expm1": np.expm1,
    "log": np.log, "log1p": np.log1p, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "asinh": np.arcsinh,
    "acosh": np.arccosh, "atanh": np.arctanh,
    "floor": np.floor, "ceil": np.ceil, "rint": np.rint, "round": np.vectorize(_away),
    "nextafter": np.nextafter, "isfinite": np.isfinite,
    "lt": np.less, "le": np.less_equal, "gt": np.greater, "ge": np.greater_equal,
    "eq": np.equal, "ne": np.not_equal,
    "and": np.bitwise_and, "or": np.bitwise_or, "xor": np.bitwise_xor, "not": np.invert,
    "select": np.where, "cast": lambda a: a,
}  # fmt: skip


def fold(op: str, dtype: Any, *values: Any) -> Any:
    """Return the result of an operation on known values, elementwise.

    Parameters
    ----------
    op
        Name of the operation.
    dtype
        NumPy type of the result.
    *values
        Numbers or arrays.
    """
    with np.errstate(all="ignore"):
        if op == "cast":
            return converted(values[0], dtype)
        return np.asarray(_FOLDS[op](*values)).astype(dtype)


def foldable(op: str) -> bool:
    """Return whether an operation on constants is carried out.

    Parameters
    ----------
    op
        Name of the operation.
    """
    return op in _FOLDS


def converted(value: Any, dtype: Any) -> Any:
    """Return values in another type; beyond the range of whole numbers they saturate, NaN is 0.

    Parameters
    ----------
    value
        Numbers.
    dtype
        NumPy type.
    """
    value, dtype = np.asarray(value), np.dtype(dtype)
    if dtype.kind in "iu" and value.dtype.kind == "f":
        info = np.iinfo(dtype)
        whole = np.trunc(np.where(np.isnan(value), 0.0, value))
        inside = (whole > float(info.min)) & (whole < float(info.max))
        plain = np.where(inside, whole, 0.0).astype(dtype)
        return np.where(inside, plain, np.where(whole <= float(info.min), info.min, info.max)
                        ).astype(dtype)  # fmt: skip
    if dtype == np.bool_:
        return value != 0
    return value.astype(dtype)
