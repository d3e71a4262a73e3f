"""Statements as C text."""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.errors import ExportError
from contourlab.export.expressions import Expression, Index
from contourlab.export.scalar_types import Precision, c_type, is_real, literal, suffix_of
from contourlab.export.statements import (
    Assign,
    Block,
    Branch,
    Break,
    Copy,
    Declare,
    For,
    Set,
    Store,
    Table,
    Variable,
)

__all__ = ["Printer", "comment"]

_INFIX = {"add": ("+", 12), "sub": ("-", 12), "mul": ("*", 13), "div": ("/", 13)}
_COMPARE = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
_LIBM = {
    "sqrt", "cbrt", "exp", "exp2", "expm1", "log", "log1p", "sin", "cos", "tan", "asin", "acos",
    "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "floor", "ceil", "rint",
    "round", "nextafter", "pow", "erf", "erfc", "lgamma",
}  # fmt: skip
_LIBM_NAMES = {"abs": "fabs", "rem": "fmod"}


def comment(text: str) -> str:
    """Return words as a comment of C, whatever is in them; nothing for none.

    Parameters
    ----------
    text
        In one line.
    """
    for sign, plain in (("*/", "* /"), ("/*", "/ *"), ("\\", " "), ("??", "? ?")):
        text = text.replace(sign, plain)
    text = text.strip()
    return f"/* {text} */" if text else ""


class Printer:
    """Writes the statements of one file.

    Parameters
    ----------
    prefix
        Of every name outside a function.
    precision
        Of reals.
    """

    def __init__(self, prefix: str, precision: Precision) -> None:
        self.prefix, self.precision = prefix, precision
        self.real = f"{prefix}_real"
        self.helpers: dict[str, tuple[str, Any]] = {}
        """Helper functions in use: name to what and for which type."""

    def block(self, block: Block, indent: int = 1, line: str = "") -> list[str]:
        """Return the lines of a block.

        Parameters
        ----------
        block
            What to write.
        indent
            How deep it is.
        line
            Of the law, of what stands before it.
        """
        found: list[str] = []
        pad = "    " * indent
        for statement in block.statements:
            if statement.line and statement.line != line:
                line = statement.line
                found.append(f"{pad}/* {line} */")
            found += self._statement(statement, indent, pad, line)
        return found

    def table(self, table: Table) -> list[str]:
        """Return the lines of a constant array.

        Parameters
        ----------
        table
            What to write.
        """
        values = np.asarray(table.values)
        kind = c_type(values.dtype, self.real)
        rows = [literal(one, values.dtype, self.precision) for one in values]
        lines = [f"static const {kind} {self.prefix}_{table.name}[{values.size}] = {{"]
        lines += ["    " + ", ".join(rows[k : k + 4]) + "," for k in range(0, len(rows), 4)]
        return [*lines, "};"]

    def _statement(self, s: Any, indent: int, pad: str, line: str) -> list[str]:
        if isinstance(s, Assign):
            kind = c_type(s.expression.dtype, self.real)
            return [f"{pad}const {kind} {s.name} = {self.text(s.expression)};"]
        if isinstance(s, Variable):
            start = "" if s.expression is None else f" = {self.text(s.expression)}"
            return [f"{pad}{c_type(s.dtype, self.real)} {s.name}{start};"]
        if isinstance(s, Set):
            return [f"{pad}{s.target} = {self.text(s.expression)};"]
        if isinstance(s, Declare):
            return [f"{pad}{c_type(s.dtype, self.real)} {s.name}[{s.size}];"]
        if isinstance(s, Store):
            sign = "+=" if s.add else "="
            return [f"{pad}{self._array(s.array)}[{s.index}] {sign} {self.text(s.expression)};"]
        if isinstance(s, Copy):
            target, source = self._array(s.target), self._array(s.source)
            return [f"{pad}memcpy({target}, {source}, {s.size} * sizeof {target}[0]);"]
        if isinstance(s, For):
            note = f" /* {s.note} {s.count} */" if s.note else ""
            k = s.counter
            head = (
                f"for (int32_t {k} = {int(s.count) - 1}; {k} >= 0; --{k})"
                if s.backwards
                else f"for (int32_t {k} = 0; {k} < {s.count}; ++{k})"
            )
            body = self.block(s.body, indent + 1, line)
            return [f"{pad}{head} {{{note}", *body, f"{pad}}}"]
        if isinstance(s, Break):
            return [f"{pad}if (!{self.text(s.condition, 14)}) break;"]
        assert isinstance(s, Branch)
        return self._branch(s, indent, pad, line)

    def _branch(self, s: Branch, indent: int, pad: str, line: str) -> list[str]:
        selector = self.text(s.selector)
        if s.selector.dtype == np.bool_:
            no, yes = s.blocks
            if not no.statements:
                return [f"{pad}if ({selector}) {{", *self.block(yes, indent + 1, line), f"{pad}}}"]
            if not yes.statements:
                text = self.text(s.selector, 14)
                return [f"{pad}if (!{text}) {{", *self.block(no, indent + 1, line), f"{pad}}}"]
            cases = [(f"if ({selector})", yes), ("else", no)]
        else:
            bound = self.text(s.selector, 10)
            last = len(s.blocks) - 1
            cases = [(f"if ({bound} <= 0)", s.blocks[0])]
            cases += [(f"else if ({bound} == {k})", s.blocks[k]) for k in range(1, last)]
            cases += [("else", s.blocks[last])]
        found: list[str] = []
        for head, body in cases:
            opening = f"{pad}{head} {{" if not found else f"{pad}}} {head} {{"
            found += [opening, *self.block(body, indent + 1, line)]
        return [*found, f"{pad}}}"]

    def _array(self, array: str) -> str:
        return f"{self.prefix}_{array}" if array.startswith("table_") else array

    def helper(self, what: str, dtype: Any) -> str:
        """Return the name of a helper function, which will be written into the file.

        Parameters
        ----------
        what
            It does.
        dtype
            NumPy type that it is for.
        """
        name = f"{self.prefix}_{what}_{suffix_of(dtype)}"
        self.helpers[name] = (what, np.dtype(dtype))
        return name

    def text(self, e: Expression, above: int = 0) -> str:
        """Return an expression, in parentheses where what surrounds it needs them.

        Parameters
        ----------
        e
            The expression.
        above
            How tightly what is around it binds.
        """
        text, own = self._text(e)
        return f"({text})" if own < above else text

    def _text(self, e: Expression) -> tuple[str, int]:
        if e.op == "constant":
            text = literal(e.value, e.dtype, self.precision)
            return text, 12 if text.startswith("-") else 16
        if e.op == "name":
            return str(e.value), 16
        if e.op == "load":
            array, index = e.args
            assert isinstance(index, Index)
            return f"{self._array(array)}[{index}]", 16
        if e.op in _INFIX and is_real(e.dtype):
            sign, level = _INFIX[e.op]
            left, right = self.text(e.args[0], level), self.text(e.args[1], level + 1)
            return f"{left} {sign} {right}", level
        if e.op in _COMPARE:
            level = 9 if e.op in ("eq", "ne") else 10
            # a comparison inside a comparison is always in parentheses
            left, right = (self.text(arg, 11) for arg in e.args)
            return f"{left} {_COMPARE[e.op]} {right}", level
        if e.op == "select":
            test, yes, no = (
                self.text(e.args[0], 4),
                self.text(e.args[1], 4),
                self.text(e.args[2], 4),
            )
            return f"{test} ? {yes} : {no}", 3
        if e.op == "neg" and is_real(e.dtype):
            return f"-{self.text(e.args[0], 15)}", 14
        if e.op == "cast":
            return self._cast(e)
        if e.dtype == np.bool_ and e.op in ("and", "or", "xor", "not", "isfinite"):
            return self._logic(e)
        if is_real(e.dtype) and (e.op in _LIBM or e.op in _LIBM_NAMES):
            args = ", ".join(
                self.text(arg) if is_real(arg.dtype) else f"({c_type(e.dtype, self.real)})"
                + self.text(arg, 15)
                for arg in e.args
            )  # fmt: skip
            return f"{self._libm(e)}({args})", 16
        return self._helped(e)

    def _libm(self, e: Expression) -> str:
        name = _LIBM_NAMES.get(e.op, e.op)
        single = self.precision.single or str(e.dtype) == "float32"
        return name + ("f" if single else "")

    def _logic(self, e: Expression) -> tuple[str, int]:
        if e.op == "not":
            return f"!{self.text(e.args[0], 14)}", 14
        if e.op == "isfinite":
            return f"isfinite({self.text(e.args[0])})", 16
        if e.op == "xor":
            left, right = (self.text(arg, 11) for arg in e.args)
            return f"{left} != {right}", 9
        level, sign = (5, "&&") if e.op == "and" else (4, "||")
        parts = [
            self.text(arg, level if arg.op == e.op and arg.dtype == np.bool_ else 9)
            for arg in e.args
        ]
        return f" {sign} ".join(parts), level

    def _cast(self, e: Expression) -> tuple[str, int]:
        arg = e.args[0]
        if is_real(arg.dtype) and not is_real(e.dtype):
            name = self.helper(f"to_{suffix_of(e.dtype)}", arg.dtype)
            return f"{name}({self.text(arg)})", 16
        return f"({c_type(e.dtype, self.real)}){self.text(arg, 14)}", 14

    def _bits(self, e: Expression) -> tuple[str, int]:
        arg = e.args[0]
        if self.precision.single and np.dtype(np.float64) in (e.dtype, arg.dtype):
            raise ExportError("bits of float64 have no meaning in single precision")
        target = c_type(e.dtype, self.real)
        name = f"{self.prefix}_bits_{suffix_of(arg.dtype)}_to_{suffix_of(e.dtype)}"
        self.helpers[name] = (f"bits_{target}", np.dtype(arg.dtype))
        return f"{name}({self.text(arg)})", 16

    def _helped(self, e: Expression) -> tuple[str, int]:
        what, kind = e.op, e.dtype
        if what == "clamp_index":
            self.helpers[f"{self.prefix}_clamp_index"] = ("clamp_index", np.dtype(np.int32))
            return f"{self.prefix}_clamp_index({self.text(e.args[0])}, {self.text(e.args[1])})", 16
        if what in ("lt_to", "le_to"):
            name = self.helper(what, e.args[0].dtype)
            return f"{name}({', '.join(self.text(arg) for arg in e.args)})", 16
        if what == "bits":
            return self._bits(e)
        if kind.kind in "iu" and what in ("and", "or", "xor", "not"):
            if what == "not":
                return f"({c_type(kind, self.real)})~{self.text(e.args[0], 14)}", 14
            sign = {"and": "&", "or": "|", "xor": "^"}[what]
            left, right = (self.text(arg, 14) for arg in e.args)
            return f"{left} {sign} {right}", 6
        from contourlab.export.c_helpers import has_helper

        if not has_helper(what, kind):
            raise ExportError(f"{what} of numbers of type {kind} cannot be exported")
        name = self.helper(what, kind)
        return f"{name}({', '.join(self.text(arg) for arg in e.args)})", 16
