"""How much work a step is at the most: operations, counted along the longest way."""

from __future__ import annotations

from typing import Any

from contourlab.export.expressions import Expression
from contourlab.export.statements import Assign, Block, Branch, Break, Copy, For, Set, Store
from contourlab.export.statements import Variable as Declared

__all__ = ["count_operations"]


def count_operations(block: Block, *, searches_once: bool = False) -> int:
    """Return the worst number of operations of a block.

    Every operation on a scalar counts one, functions of libm too; loops count as often as they can
    run, branches as their longest. Copies and moves count nothing.

    Parameters
    ----------
    block
        Of a function.
    searches_once
        Whether a loop that ends by itself, within a bound, counts as one pass.
    """
    return sum(_operations(one, searches_once) for one in block.statements)


def _operations(statement: Any, once: bool) -> int:
    if isinstance(statement, Assign | Set | Declared):
        return _inside(statement.expression)
    if isinstance(statement, Store):
        return _inside(statement.expression) + int(statement.add)
    if isinstance(statement, Break):
        return _inside(statement.condition)
    if isinstance(statement, For):
        passes = min(int(statement.count), 1) if once and statement.note else int(statement.count)
        return passes * count_operations(statement.body, searches_once=once)
    if isinstance(statement, Branch):
        longest = max(count_operations(one, searches_once=once) for one in statement.blocks)
        return _inside(statement.selector) + longest
    assert isinstance(statement, Copy) or not hasattr(statement, "expression")
    return 0


def _inside(expression: Expression | None) -> int:
    if expression is None or expression.op in ("constant", "name", "load"):
        return 0
    return 1 + sum(_inside(arg) for arg in expression.args)
