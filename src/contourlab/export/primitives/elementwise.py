"""Operations that act on each element by itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, Index, constant, fold, foldable, operation
from contourlab.export.flatten import Equation
from contourlab.export.primitives.emission import Emission
from contourlab.export.statements import Builder
from contourlab.export.values import Known, Value, indices

__all__ = ["ELEMENTWISE", "elementwise"]

Element = Callable[[Builder, Any, dict[str, Any], list[Expression]], Expression]


def _plain(op: str) -> Element:
    def element(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
        del b, params
        return operation(op, dtype, *args)

    return element


def _integer_pow(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    """Repeated squaring, in the order in which JAX multiplies."""
    count, base = abs(int(params["y"])), args[0]
    result: Expression | None = None
    while count:
        if count & 1:
            result = base if result is None else b.bind(operation("mul", dtype, result, base))
        count >>= 1
        if count:
            base = b.bind(operation("mul", dtype, base, base))
    one = constant(1, dtype)
    if result is None:
        return one
    return operation("div", dtype, one, result) if params["y"] < 0 else result


def _square(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del b, params
    return operation("mul", dtype, args[0], args[0])


def _rsqrt(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del params
    root = b.bind(operation("sqrt", dtype, args[0]))
    return operation("div", dtype, constant(1, dtype), root)


def _logistic(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del params
    power = b.bind(operation("exp", dtype, operation("neg", dtype, args[0])))
    one = constant(1, dtype)
    return operation("div", dtype, one, operation("add", dtype, one, power))


def _clamp(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del params
    low, x, high = args
    return operation("min", dtype, b.bind(operation("max", dtype, x, low)), high)


def _round(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del b
    even = int(params["rounding_method"]) == 1
    return operation("rint" if even else "round", dtype, args[0])


def _select(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del params
    which, *cases = args
    if which.dtype == np.bool_:
        return operation("select", dtype, which, cases[1], cases[0]) if len(cases) > 1 else cases[0]
    found = cases[-1]
    for k in range(len(cases) - 2, -1, -1):
        test = operation("le", np.bool_, which, constant(k, which.dtype))
        found = b.bind(operation("select", dtype, test, cases[k], found))
    return found


def _total_order(op: str) -> Element:
    """Comparison in which every number has a place: -0 below 0, NaN above all."""

    def element(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
        del b, params
        real = np.dtype(args[0].dtype).kind == "f"
        return operation(f"{op}_to" if real else op, dtype, *args)

    return element


def _bits(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del b, params
    return operation("bits", dtype, args[0])


def _convert(b: Builder, dtype: Any, params: Any, args: list[Expression]) -> Expression:
    del b, params
    if dtype == np.bool_ and args[0].dtype != np.bool_:
        return operation("ne", dtype, args[0], constant(0, args[0].dtype))
    return operation("cast", dtype, args[0])


ELEMENTWISE: dict[str, Element] = {
    **{
        op: _plain(op)
        for op in (
            "add", "sub", "mul", "div", "rem", "neg", "sign", "max", "min", "pow", "sqrt", "cbrt",
            "exp", "exp2", "expm1", "log", "log1p", "sin", "cos", "tan", "asin", "acos", "atan",
            "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "floor", "ceil", "abs",
            "nextafter", "lt", "le", "gt", "ge", "eq", "ne", "and", "or", "xor", "not",
            "erf", "erfc", "lgamma",
        )
    },
    "add_any": _plain("add"),
    "is_finite": _plain("isfinite"),
    "shift_left": _plain("shift_left"),
    "shift_right_logical": _plain("shift_right_logical"),
    "shift_right_arithmetic": _plain("shift_right_arithmetic"),
    "lt_to": _total_order("lt"),
    "le_to": _total_order("le"),
    "bitcast_convert_type": _bits,
    "integer_pow": _integer_pow,
    "square": _square,
    "rsqrt": _rsqrt,
    "logistic": _logistic,
    "clamp": _clamp,
    "round": _round,
    "select_n": _select,
    "convert_element_type": _convert,
}  # fmt: skip


def elementwise(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    """Return the value of an equation that acts on each element by itself.

    Parameters
    ----------
    emission
        Of the program.
    equation
        What to write.
    args
        Values of its operands; scalars go with any shape.
    """
    out = equation.outputs[0]
    element = ELEMENTWISE[equation.primitive]
    if all(isinstance(arg, Known) for arg in args) and foldable(equation.primitive):
        arrays = [arg.array for arg in args if isinstance(arg, Known)]
        return [Known(np.broadcast_to(fold(equation.primitive, out.dtype, *arrays), out.shape))]

    def place(arg: Value, index: Any) -> Any:
        """Scalars and dimensions of one go with any shape."""
        if arg.shape in (out.shape, ()):
            return index if arg.shape else ()
        return tuple(k if n != 1 else Index() for k, n in zip(index, arg.shape, strict=True))

    def one(builder: Builder, index: Any) -> Expression:
        found = [builder.bind(arg.at(builder, place(arg, index))) for arg in args]
        return element(builder, out.dtype, equation.params, found)

    if all(isinstance(arg, Known) for arg in args) and out.shape:
        found = [one(emission.builder, at) for at in indices(out.shape)]
        if all(each.is_constant for each in found):
            return [Known(np.array([x.value for x in found], out.dtype).reshape(out.shape))]
    return [emission.rule(out, one)]
