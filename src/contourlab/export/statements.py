"""Statements of generated C, and the builder that puts them into blocks.

A scalar is assigned once, where it is made, and is known by its expression: the same expression in
reach gives the same name. What changes (loop counters, carries of loops, results of branches) is
declared and set. An array is written in full before it is read; only carries are written again, at
the end of a pass through their loop.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, Index, name

__all__ = [
    "Assign", "Block", "Branch", "Break", "Builder", "Copy", "Declare", "For", "Set", "Store",
    "Table", "Variable",
]  # fmt: skip


@dataclasses.dataclass
class Assign:
    """A new scalar that does not change."""

    name: str
    expression: Expression
    line: str
    keep: bool = False
    """Whether it must be computed here: something that it reads changes further on."""


@dataclasses.dataclass
class Variable:
    """Declaration of a scalar that changes."""

    name: str
    dtype: Any
    line: str
    expression: Expression | None = None


@dataclasses.dataclass
class Set:
    """A scalar or an element of the caller's structures gets a new value."""

    target: str
    expression: Expression
    line: str
    external: bool = False
    """Whether it is the caller's, and so always of use."""


@dataclasses.dataclass
class Declare:
    """Declaration of an array."""

    name: str
    dtype: Any
    size: int
    line: str


@dataclasses.dataclass
class Store:
    """An element of an array gets a value, or something added."""

    array: str
    index: Index
    expression: Expression
    line: str
    add: bool = False


@dataclasses.dataclass
class Copy:
    """A whole array is copied."""

    target: str
    source: str
    size: int
    line: str
    external: bool = False


@dataclasses.dataclass
class For:
    """A loop with a fixed number of passes, or with as many as a name says."""

    counter: str
    count: int | str
    body: Block
    line: str
    note: str = ""
    backwards: bool = False


@dataclasses.dataclass
class Branch:
    """One of several blocks, chosen by a whole number; two by a truth value."""

    selector: Expression
    blocks: list[Block]
    line: str


@dataclasses.dataclass
class Break:
    """Leaves the loop unless a condition holds."""

    condition: Expression
    line: str


@dataclasses.dataclass
class Table:
    """A constant array of the file."""

    name: str
    values: Any


class Block:
    """Statements in their order, and the expressions that have names in it."""

    def __init__(self) -> None:
        self.statements: list[Any] = []
        self.names: dict[Any, Expression] = {}


class Builder:
    """Puts statements into blocks; makes names; keeps the tables of the file.

    Parameters
    ----------
    tables
        Shared by the functions of a file.
    """

    def __init__(self, tables: dict[Any, Table]) -> None:
        self.tables = tables
        self.stack: list[Block] = [Block()]
        self.line = ""
        self._counts: dict[str, int] = {}

    @property
    def depth(self) -> int:
        """How deep the current block is."""
        return len(self.stack) - 1

    def add(self, statement: Any, depth: int | None = None) -> None:
        """Put a statement at the end of the current block, or of one around it.

        Parameters
        ----------
        statement
            Any statement.
        depth
            Of the block; the current one by default.
        """
        self.stack[-1 if depth is None else depth].statements.append(statement)

    def fresh(self, stem: str) -> str:
        """Return a name that is not taken.

        Parameters
        ----------
        stem
            How it begins.
        """
        number = self._counts.get(stem, 0)
        self._counts[stem] = number + 1
        return f"{stem}{number}"

    def bind(self, expression: Expression, *, keep: bool = False) -> Expression:
        """Return a name for an expression, computing it in the current block if it has none.

        Parameters
        ----------
        expression
            What to name; constants and names stay as they are.
        keep
            Whether it must be computed here; then a name is made in any case.
        """
        if expression.is_constant or (expression.op == "name" and not keep):
            return expression
        if not keep:
            for block in reversed(self.stack):
                found = block.names.get(expression.key)
                if found is not None:
                    return found
        label = name(self.fresh("v"), expression.dtype)
        self.add(Assign(label.value, expression, self.line, keep))
        if not keep:
            self.stack[-1].names[expression.key] = label
        return label

    def index_name(self, expression: Expression) -> Index:
        """Return a whole number that is only known at run time, as an index.

        Parameters
        ----------
        expression
            Of a whole type, within the bounds of int32.
        """
        if expression.is_constant:
            return Index(int(expression.value))
        label = self.bind(expression)
        return Index.of(str(label.value))

    def array(self, dtype: Any, size: int, depth: int | None = None) -> str:
        """Declare an array and return its name.

        Parameters
        ----------
        dtype
            NumPy type.
        size
            Number of elements.
        depth
            Of the block; the current one by default.
        """
        label = self.fresh("a")
        self.add(Declare(label, np.dtype(dtype), size, self.line), depth)
        return label

    def variable(self, dtype: Any, expression: Expression | None = None) -> Expression:
        """Declare a scalar that changes and return it.

        Parameters
        ----------
        dtype
            NumPy type.
        expression
            What it starts as.
        """
        label = self.fresh("c")
        self.add(Variable(label, np.dtype(dtype), self.line, expression))
        return name(label, dtype)

    def table(self, values: Any) -> str:
        """Return the name of a constant array of the file.

        Parameters
        ----------
        values
            Its numbers; equal tables are one.
        """
        flat = np.ascontiguousarray(values)
        key = (str(flat.dtype), flat.size, flat.tobytes())
        if key not in self.tables:
            self.tables[key] = Table(f"table_{len(self.tables)}", flat.ravel())
        return self.tables[key].name

    @contextlib.contextmanager
    def block(self) -> Iterator[Block]:
        """Open a block; what is added goes there until it is closed."""
        block = Block()
        self.stack.append(block)
        try:
            yield block
        finally:
            self.stack.pop()

    @contextlib.contextmanager
    def loop(self, count: int | str, note: str = "", *, backwards: bool = False) -> Iterator[Index]:
        """Open a loop and give its counter; it is put into the block around it when it closes.

        Parameters
        ----------
        count
            Number of passes, or the name of a whole number that says.
        note
            A word on the number of passes.
        backwards
            Whether the counter falls.
        """
        line, counter = self.line, self.fresh("i")
        with self.block() as body:
            yield Index.of(counter)
        self.add(For(counter, count, body, line, note, backwards))

    @contextlib.contextmanager
    def loops(self, shape: tuple[int, ...]) -> Iterator[tuple[Index, ...]]:
        """Open one loop in another over a shape; dimensions of one need none.

        Parameters
        ----------
        shape
            Numbers of passes.
        """
        with contextlib.ExitStack() as stack:
            yield tuple(
                Index(0) if count == 1 else stack.enter_context(self.loop(count)) for count in shape
            )
