"""Small functions that generated C calls where C's own operators would do something else.

Whole numbers wrap, as JAX's do, where C leaves it undefined; division by zero has a result; reals
become whole numbers by saturation; extremes pass NaN on.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.export.scalar_types import Precision, c_type, is_real

__all__ = ["has_helper", "helper_text"]

_REAL = {"max", "min", "sign"}
_WHOLE = {
    "add", "sub", "mul", "div", "rem", "neg", "abs", "sign", "max", "min", "shift_left",
    "shift_right_logical", "shift_right_arithmetic",
}  # fmt: skip


def has_helper(what: str, dtype: Any) -> bool:
    """Return whether there is a helper.

    Parameters
    ----------
    what
        It does.
    dtype
        NumPy type that it is for.
    """
    if what.startswith("to_"):
        return is_real(dtype)
    return what in (_REAL if is_real(dtype) else _WHOLE)


def helper_text(name: str, what: str, dtype: Any, real: str, precision: Precision) -> str:
    """Return a helper function.

    Parameters
    ----------
    name
        Of the function.
    what
        It does.
    dtype
        NumPy type that it is for.
    real
        Name of the real type.
    precision
        Of reals.
    """
    if what == "clamp_index":
        return (
            f"static inline int32_t {name}(int64_t i, int32_t top)\n"
            "{\n    return i < 0 ? 0 : i > top ? top : (int32_t)i;\n}\n"
        )
    kind = c_type(dtype, real)
    if what in ("lt_to", "le_to"):
        # -0 comes before 0, NaN after everything
        equal = (
            "a == 0 && signbit(a) && !signbit(b)"
            if what == "lt_to"
            else "a != 0 || signbit(a) || !signbit(b)"
        )
        nan = "a == a" if what == "lt_to" else "true"
        return (
            f"static inline bool {name}({kind} a, {kind} b)\n{{\n"
            f"    if (b != b) return {nan};\n"
            f"    return a < b || (a == b && ({equal}));\n}}\n"
        )
    if what.startswith("bits_"):
        target = what.removeprefix("bits_")
        return (
            f"static inline {target} {name}({kind} a)\n{{\n"
            f"    {target} b;\n    memcpy(&b, &a, sizeof b);\n    return b;\n}}\n"
        )
    if what.startswith("to_"):
        return _conversion(name, what, kind)
    body = _real_body(what) if is_real(dtype) else _whole_body(what, np.dtype(dtype), kind)
    two = what not in ("neg", "abs", "sign")
    arguments = f"{kind} a, {kind} b" if two else f"{kind} a"
    return f"static inline {kind} {name}({arguments})\n{{\n    {body}\n}}\n"


def _real_body(what: str) -> str:
    return {
        # NaN is passed on
        "max": "return a > b || a != a ? a : b;",
        "min": "return a < b || a != a ? a : b;",
        "sign": "return a > 0 ? 1 : a < 0 ? -1 : a;",
    }[what]


def _whole_body(what: str, dtype: Any, kind: str) -> str:
    signed = dtype.kind == "i"
    bits = dtype.itemsize * 8
    wide = f"uint{max(bits, 32)}_t"
    least = f"INT{bits}_MIN"
    if what in ("add", "sub", "mul"):
        sign = {"add": "+", "sub": "-", "mul": "*"}[what]
        return f"return ({kind})(({wide})a {sign} ({wide})b);"
    if what == "neg":
        return f"return ({kind})(0u - ({wide})a);"
    if what == "abs":
        return f"return a < 0 ? ({kind})(0u - ({wide})a) : a;" if signed else "return a;"
    if what == "sign":
        return f"return ({kind})((a > 0) - (a < 0));" if signed else "return a != 0;"
    if what in ("max", "min"):
        return f"return a {'>' if what == 'max' else '<'} b ? a : b;"
    if what == "div":
        if not signed:
            return f"return b == 0 ? ({kind})-1 : ({kind})(a / b);"
        return f"return b == 0 ? -1 : a == {least} && b == -1 ? a : ({kind})(a / b);"
    if what == "rem":
        if not signed:
            return f"return b == 0 ? a : ({kind})(a % b);"
        return f"return b == 0 ? a : a == {least} && b == -1 ? 0 : ({kind})(a % b);"
    unsigned = f"uint{bits}_t"
    far = f"({unsigned})b >= {bits}u"
    if what == "shift_left":
        return f"return {far} ? 0 : ({kind})(({wide})a << b);"
    if what == "shift_right_logical":
        return f"return {far} ? 0 : ({kind})(({unsigned})a >> b);"
    if signed:  # written so that no negative number is shifted
        return f"return a < 0 ? ({kind})~(~a >> ({far} ? {bits - 1} : b)) : ({far} ? 0 : a >> b);"
    return f"return {far} ? 0 : a >> b;"


def _conversion(name: str, what: str, kind: str) -> str:
    suffix = what.removeprefix("to_")
    signed, bits = suffix[0] == "i", int(suffix[1:])
    target = f"{'int' if signed else 'uint'}{bits}_t"
    top = f"{'INT' if signed else 'UINT'}{bits}_MAX"
    bottom = f"INT{bits}_MIN" if signed else "0"
    # powers of two, which every real type holds exactly
    high, low = 2.0 ** (bits - signed), -(2.0 ** (bits - 1)) if signed else 0.0
    return (
        f"static inline {target} {name}({kind} a)\n{{\n"
        "    if (a != a) return 0;\n"
        f"    if (a >= ({kind}){high:.1f}) return {top};\n"
        f"    if (a <= ({kind}){low:.1f}) return {bottom};\n"
        f"    return ({target})a;\n}}\n"
    )
