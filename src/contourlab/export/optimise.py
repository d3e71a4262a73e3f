"""Leaving out what has no use, and joining what is used once.

Both change the text alone: every value that is left is computed by the same operations.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable
from typing import Any

from contourlab.export.expressions import Expression, Index
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
    Variable,
)

__all__ = ["drop_unused", "join_single_uses", "names_of"]

_LONGEST = 24
"""Operations in one expression at the most."""


def names_of(expression: Expression | Index | None) -> list[str]:
    """Return the names of scalars and arrays that an expression reads, one for each time.

    Parameters
    ----------
    expression
        Or an index; nothing for None.
    """
    if expression is None:
        return []
    if isinstance(expression, Index):
        return [key for key, _ in expression.terms]
    if expression.op == "name":
        return [str(expression.value)]
    if expression.op == "load":
        return [expression.args[0], *names_of(expression.args[1])]
    return [name for arg in expression.args for name in names_of(arg)]


def _reads(statement: Any) -> list[str]:
    """Return what a statement itself reads, bodies aside."""
    if isinstance(statement, Assign | Set | Variable):
        return names_of(statement.expression)
    if isinstance(statement, Store):
        return names_of(statement.expression) + names_of(statement.index)
    if isinstance(statement, Copy):
        return [statement.source]
    if isinstance(statement, Break):
        return names_of(statement.condition)
    if isinstance(statement, Branch):
        return names_of(statement.selector)
    return []


def _target(statement: Any) -> str | None:
    if isinstance(statement, Assign | Variable | Declare):
        return statement.name
    if isinstance(statement, Set | Copy):
        return None if statement.external else statement.target
    if isinstance(statement, Store):
        return statement.array
    return None


def _bodies(statement: Any) -> list[Block]:
    if isinstance(statement, For):
        return [statement.body]
    return list(statement.blocks) if isinstance(statement, Branch) else []


def drop_unused(block: Block, results: Iterable[str] = ()) -> None:
    """Leave out every statement that does not matter for what the caller gets.

    Parameters
    ----------
    block
        Of a function; changed in place.
    results
        Arrays that belong to the caller.
    """
    makers: dict[str, list[tuple[Any, tuple[str, ...]]]] = {}
    wanted: list[str] = list(results)

    def visit(block: Block, control: tuple[str, ...]) -> None:
        stops = [n for s in block.statements if isinstance(s, Break) for n in _reads(s)]
        control = (*control, *stops)
        for statement in block.statements:
            target = _target(statement)
            if target is not None:
                makers.setdefault(target, []).append((statement, control))
            elif isinstance(statement, Set | Copy):
                wanted.extend((*_reads(statement), *control))
            own = (*control, *_reads(statement)) if isinstance(statement, Branch) else control
            for body in _bodies(statement):
                visit(body, own)

    visit(block, ())
    used: set[str] = set()
    while wanted:
        name = wanted.pop()
        if name in used:
            continue
        used.add(name)
        for statement, control in makers.get(name, ()):
            wanted.extend((*_reads(statement), *control))
    _sweep(block, used)


def _sweep(block: Block, used: set[str]) -> None:
    kept = []
    for statement in block.statements:
        target = _target(statement)
        if target is not None and target not in used:
            continue
        for body in _bodies(statement):
            _sweep(body, used)
        if isinstance(statement, For) and not any(
            not isinstance(s, Break) for s in statement.body.statements
        ):
            continue
        if isinstance(statement, Branch) and not any(b.statements for b in statement.blocks):
            continue
        kept.append(statement)
    block.statements[:] = kept


def join_single_uses(block: Block) -> None:
    """Put scalars that are used once, on the same line of the law, where they are used.

    Parameters
    ----------
    block
        Of a function; changed in place.
    """
    count: Counter[str] = Counter()

    def visit(block: Block) -> None:
        for statement in block.statements:
            count.update(_reads(statement))
            for body in _bodies(statement):
                visit(body)

    visit(block)
    _join(block, count)


def _join(block: Block, count: Counter[str]) -> None:
    waiting: dict[str, Assign] = {}
    gone: set[int] = set()
    for statement in block.statements:
        for body in _bodies(statement):
            _join(body, count)
        replaceable = {}
        for one in _expressions(statement):
            for name in _plain_names(one):
                assign = waiting.get(name)
                if assign is not None and _may_join(assign, statement):
                    replaceable[name] = assign
        if replaceable:
            budget = _LONGEST - sum(one.size for one in _expressions(statement))
            chosen: dict[str, Expression] = {}
            for name, assign in replaceable.items():
                if assign.expression.size <= max(budget, 2):
                    chosen[name] = assign.expression
                    budget -= assign.expression.size
                    gone.add(id(assign))
            _substitute(statement, chosen)
        if isinstance(statement, Assign) and not statement.keep and count[statement.name] == 1:
            waiting[statement.name] = statement
    block.statements[:] = [one for one in block.statements if id(one) not in gone]


def _may_join(assign: Assign, statement: Any) -> bool:
    return assign.expression.op in ("load", "name") or assign.line == statement.line


def _expressions(statement: Any) -> list[Expression]:
    if isinstance(statement, Assign | Set | Store):
        return [statement.expression]
    if isinstance(statement, Variable):
        return [] if statement.expression is None else [statement.expression]
    if isinstance(statement, Break):
        return [statement.condition]
    return [statement.selector] if isinstance(statement, Branch) else []


def _plain_names(expression: Expression) -> list[str]:
    if expression.op == "name":
        return [str(expression.value)]
    if expression.op == "load":
        return []
    return [name for arg in expression.args for name in _plain_names(arg)]


def _substitute(statement: Any, chosen: dict[str, Expression]) -> None:
    for field in ("expression", "condition", "selector"):
        found = getattr(statement, field, None)
        if isinstance(found, Expression):
            setattr(statement, field, _replaced(found, chosen))


def _replaced(expression: Expression, chosen: dict[str, Expression]) -> Expression:
    if expression.op == "name":
        return chosen.get(str(expression.value), expression)
    if expression.op in ("constant", "load"):
        return expression
    args = tuple(_replaced(arg, chosen) for arg in expression.args)
    size = 1 + sum(arg.size for arg in args)
    return dataclasses.replace(expression, args=args, size=size)
