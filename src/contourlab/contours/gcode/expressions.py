"""Values: numbers, parameters, functions and expressions, compiled once and read many times.

A value is a float, or a function of the parameters that gives one: a line of a loop is parsed once.

    value      = number | [ value { operator value } ] | # value | #<name> | function[...] | -value
    operators    ** before * / MOD, before + -, before EQ NE GT GE LT LE, before AND OR XOR

All operators group from the left, also ``**`` (2**3**2 is 64); a sign belongs to its number, so
-2**2 is 4. Angles are in degrees. EQ and NE take numbers nearer than 0.0001 for equal, the result
of MOD is >= 0, ROUND takes halves away from zero. All this is LinuxCNC's.

Nothing that is not finite leaves a value: what would is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from contourlab.contours.gcode.parameters import EQUAL, Parameters, whole
from contourlab.errors import GcodeError

__all__ = ["DEEPEST", "Reader", "Value", "read_expression", "read_name", "read_value"]

DEEPEST = 50
"""How many brackets, signs and # may nest."""

Reader = Callable[[Parameters], float]
Value = float | Reader

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")
_FUNCTION = re.compile(r"(abs|acos|asin|atan|cos|exists|exp|fix|fup|ln|round|sin|sqrt|tan)\[", re.I)
_OPERATOR = re.compile(r"\*\*|[-+*/\]]|mod|and|xor|or|eq|ne|ge|gt|le|lt", re.I)
_DEGREES = math.pi / 180.0


def _divided(a: float, b: float) -> float:
    if b == 0.0:
        raise GcodeError("division by zero")
    return a / b


def _modulo(a: float, b: float) -> float:
    if b == 0.0 or not math.isfinite(a):
        raise GcodeError("the remainder of a division by zero")
    rest = math.fmod(a, b)
    return rest + abs(b) if rest < 0.0 else rest


def _power(a: float, b: float) -> float:
    if a < 0.0 and b != math.floor(b):
        raise GcodeError("a negative number has no power that is not whole")
    try:
        return float(a**b)
    except ZeroDivisionError:
        raise GcodeError("zero has no negative power") from None
    except OverflowError:
        raise GcodeError("the result is too large") from None


_BINARY: dict[str, tuple[int, Callable[[float, float], float]]] = {
    "**": (6, _power),
    "*": (5, lambda a, b: a * b),
    "/": (5, _divided),
    "mod": (5, _modulo),
    "+": (4, lambda a, b: a + b),
    "-": (4, lambda a, b: a - b),
    "eq": (3, lambda a, b: 1.0 if abs(a - b) < EQUAL else 0.0),
    "ne": (3, lambda a, b: 1.0 if abs(a - b) >= EQUAL else 0.0),
    "gt": (3, lambda a, b: 1.0 if a > b else 0.0),
    "ge": (3, lambda a, b: 1.0 if a >= b else 0.0),
    "lt": (3, lambda a, b: 1.0 if a < b else 0.0),
    "le": (3, lambda a, b: 1.0 if a <= b else 0.0),
    "and": (2, lambda a, b: 1.0 if a != 0.0 and b != 0.0 else 0.0),
    "or": (2, lambda a, b: 1.0 if a != 0.0 or b != 0.0 else 0.0),
    "xor": (2, lambda a, b: 1.0 if (a != 0.0) != (b != 0.0) else 0.0),
}


def _within_one(function: Callable[[float], float], name: str) -> Callable[[float], float]:
    def degrees(a: float) -> float:
        if not -1.0 <= a <= 1.0:
            raise GcodeError(f"{name} takes a number from -1 to 1, got {a:g}")
        return function(a) / _DEGREES

    return degrees


def _exponential(a: float) -> float:
    try:
        return math.exp(a)
    except OverflowError:
        raise GcodeError("the result is too large") from None


def _logarithm(a: float) -> float:
    if a <= 0.0:
        raise GcodeError(f"LN takes a number > 0, got {a:g}")
    return math.log(a)


def _root(a: float) -> float:
    if a < 0.0:
        raise GcodeError(f"SQRT takes a number >= 0, got {a:g}")
    return math.sqrt(a)


_UNARY: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "acos": _within_one(math.acos, "ACOS"),
    "asin": _within_one(math.asin, "ASIN"),
    "cos": lambda a: math.cos(a * _DEGREES),
    "exp": _exponential,
    "fix": lambda a: float(math.floor(a)),
    "fup": lambda a: float(math.ceil(a)),
    "ln": _logarithm,
    "round": lambda a: math.copysign(math.floor(abs(a) + 0.5), a),
    "sin": lambda a: math.sin(a * _DEGREES),
    "sqrt": _root,
    "tan": lambda a: math.tan(a * _DEGREES),
}


def read_value(code: str, at: int, depth: int = 0) -> tuple[Value, int]:
    """Return the value that stands at a place in a line, and the place behind it.

    Parameters
    ----------
    code
        A line without comments and blanks.
    at
        Where the value begins.
    depth
        How deep in brackets it stands.

    Raises
    ------
    GcodeError
        No value, one that is too large, brackets that do not close or nest too deep.
    """
    if depth > DEEPEST:
        raise GcodeError(f"brackets, signs and # may nest {DEEPEST} deep")
    start = code[at : at + 1]
    if start == "[":
        return read_expression(code, at, depth)
    if start == "#":
        return _parameter(code, at, depth)
    match = _NUMBER.match(code, at)
    if match is not None:
        number = float(match.group())
        if not math.isfinite(number):
            raise GcodeError("the number is too large")
        return number, match.end()
    if start and start in "+-":
        value, end = read_value(code, at + 1, depth + 1)
        return (value if start == "+" else _applied(lambda a: -a, value)), end
    match = _FUNCTION.match(code, at)
    if match is not None:
        return _function(code, match, depth)
    raise GcodeError("a value is missing: a number, #parameter, [expression] or FUNCTION[...]")


def read_expression(code: str, at: int, depth: int = 0) -> tuple[Value, int]:
    """Return the value of what stands in brackets, and the place behind the closing one.

    Parameters
    ----------
    code
        A line without comments and blanks.
    at
        Place of the opening bracket.
    depth
        How deep in brackets it stands.

    Raises
    ------
    GcodeError
        No bracket here, an operator that is unknown, or a bracket that does not close.
    """
    if code[at : at + 1] != "[":
        raise GcodeError("an expression in brackets [...] is missing")
    value, at = read_value(code, at + 1, depth + 1)
    values, operators = [value], list[tuple[int, Any]]()
    while True:
        match = _OPERATOR.match(code, at)
        if match is None:
            if at >= len(code):
                raise GcodeError("the bracket [ is not closed")
            raise GcodeError(
                "an operator is missing: ** * / MOD + - EQ NE GT GE LT LE AND OR XOR, or ]"
            )
        name, at = match.group().lower(), match.end()
        precedence = 0 if name == "]" else _BINARY[name][0]
        while operators and operators[-1][0] >= precedence:
            right = values.pop()
            values.append(_combined(operators.pop()[1], values.pop(), right))
        if name == "]":
            return _finite(values[0]), at
        operators.append(_BINARY[name])
        value, at = read_value(code, at, depth + 1)
        values.append(value)


def read_name(code: str, at: int) -> tuple[str, int]:
    """Return the name in <...>, in lower case, and the place behind it.

    Parameters
    ----------
    code
        A line without comments and blanks.
    at
        Place of the ``<``.

    Raises
    ------
    GcodeError
        The name is empty or not closed.
    """
    end = code.find(">", at)
    if end < 0:
        raise GcodeError("the name <...> is not closed")
    if end == at + 1:
        raise GcodeError("the name <> is empty")
    return code[at + 1 : end].lower(), end + 1


def _parameter(code: str, at: int, depth: int) -> tuple[Value, int]:
    if code[at + 1 : at + 2] == "<":
        name, end = read_name(code, at + 1)
        return (lambda parameters: parameters.named(name)), end
    index, end = read_value(code, at + 1, depth + 1)
    if isinstance(index, float):
        number = whole(index)
        return (lambda parameters: parameters.number(number)), end
    inner = index
    return (lambda parameters: parameters.number(whole(inner(parameters)))), end


def _exists(code: str, at: int, depth: int) -> tuple[Value, int]:
    """Read what stands in EXISTS[...], from behind its bracket."""
    if code[at : at + 1] != "#":
        raise GcodeError("EXISTS takes a parameter: EXISTS[#<name>]")
    if code[at + 1 : at + 2] == "<":
        name, end = read_name(code, at + 1)
        reader: Value = lambda parameters: float(parameters.exists(name))  # noqa: E731
    else:
        index, end = read_value(code, at + 1, depth + 1)
        reader = _applied(lambda number: float(Parameters.in_range(whole(number))), index)
    if code[end : end + 1] != "]":
        raise GcodeError("EXISTS takes one parameter: EXISTS[#<name>]")
    return reader, end + 1


def _function(code: str, match: re.Match[str], depth: int) -> tuple[Value, int]:
    name = match.group(1).lower()
    if name == "exists":
        return _exists(code, match.end(), depth)
    value, end = read_expression(code, match.end() - 1, depth + 1)
    if name != "atan":
        return _finite(_applied(_UNARY[name], value)), end
    if code[end : end + 1] != "/":
        raise GcodeError("ATAN takes two brackets: ATAN[y]/[x]")
    other, end = read_expression(code, end + 1, depth + 1)
    return _combined(lambda y, x: math.atan2(y, x) / _DEGREES, value, other), end


def _applied(function: Callable[[float], float], value: Value) -> Value:
    if isinstance(value, float):
        return function(value)
    inner = value
    return lambda parameters: function(inner(parameters))


def _combined(function: Callable[[float, float], float], left: Value, right: Value) -> Value:
    if isinstance(left, float):
        first = left
        if isinstance(right, float):
            return function(first, right)
        after = right
        return lambda parameters: function(first, after(parameters))
    before = left
    if isinstance(right, float):
        second = right
        return lambda parameters: function(before(parameters), second)
    follow = right
    return lambda parameters: function(before(parameters), follow(parameters))


def _finite(value: Value) -> Value:
    if isinstance(value, float):
        if value - value != 0.0:
            raise GcodeError("the result is too large")
        return value
    inner = value

    def checked(parameters: Parameters) -> float:
        result = inner(parameters)
        if result - result != 0.0:
            raise GcodeError("the result is too large")
        return result

    return checked
