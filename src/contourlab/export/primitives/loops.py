"""Loops and branches: they stay what they are, and every loop has a bound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from contourlab.errors import ExportError
from contourlab.export.expressions import Index
from contourlab.export.flatten import Equation, Program
from contourlab.export.primitives.emission import Emission, run
from contourlab.export.primitives.trip_counts import greatest_trip_count
from contourlab.export.statements import Branch, Break, Builder, Copy, Set
from contourlab.export.values import (
    SMALL,
    Atoms,
    Known,
    Rule,
    Stored,
    Value,
    atoms,
    indices,
    stored,
)
from contourlab.export.zeros import filled

__all__ = ["LOOPS"]


class Carry:
    """What one pass through a loop hands to the next: scalars that change, or an array.

    Parameters
    ----------
    builder
        Where statements go.
    first
        Its value before the loop.
    """

    def __init__(self, builder: Builder, first: Value) -> None:
        self.first = first
        if first.size == 0:
            self.value: Value = first
        elif first.size <= SMALL:
            start = [builder.bind(one) for one in atoms(builder, first).elements]
            self.elements = [builder.variable(one.dtype, one) for one in start]
            self.value = Atoms(builder, first.shape, first.dtype, self.elements)
        else:
            target = builder.array(first.dtype, first.size)
            self.value = stored(builder, first, target)

    def inside(self, builder: Builder) -> Value:
        """Return its value in the body: scalars may be needed as an array of this pass.

        Parameters
        ----------
        builder
            Where statements go.
        """
        if isinstance(self.value, Atoms):
            return Atoms(builder, self.value.shape, self.value.dtype, self.elements)
        return self.value


def update(builder: Builder, carries: Sequence[Carry], values: Sequence[Value]) -> None:
    """Give carries new values, all at once.

    Parameters
    ----------
    builder
        Where statements go.
    carries
        Of the loop.
    values
        What they become.
    """
    names = {str(e.value) for c in carries if isinstance(c.value, Atoms) for e in c.elements}
    arrays = {c.value.array for c in carries if isinstance(c.value, Stored)}
    last: list[Any] = []
    for carry, value in zip(carries, values, strict=True):
        if value.size == 0:
            continue
        if isinstance(carry.value, Atoms):
            for target, one in zip(carry.elements, atoms(builder, value).elements, strict=True):
                if one.key == target.key:
                    continue
                if one.op == "name" and one.value in names:
                    one = builder.bind(one, keep=True)
                elif not one.is_constant:
                    kept = builder.bind(one)
                    for statement in builder.stack[-1].statements:
                        if getattr(statement, "name", None) == kept.value:
                            statement.keep = True
                last.append(Set(str(target.value), one, builder.line))
        else:
            assert isinstance(carry.value, Stored)
            new = value
            if isinstance(new, Stored) and new.array == carry.value.array and not new.offset.terms:
                continue
            whole = isinstance(new, Stored) and new.offset == Index()
            if not whole or new.array in arrays:  # type: ignore[attr-defined]
                new = stored(builder, new, builder.array(new.dtype, new.size))
            assert isinstance(new, Stored)
            last.append(Copy(carry.value.array, new.array, new.size, builder.line))
    for statement in last:
        builder.add(statement)


def _ready(builder: Builder, value: Value) -> Value:
    """Return a value that may be read many times."""
    if isinstance(value, Rule):
        ready = atoms(builder, value) if value.small else stored(builder, value)
        ready.pattern = value.pattern
        return ready
    return value


def _scan(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    params, builder = equation.params, emission.builder
    body: Program = params["jaxpr"]
    n_consts, n_carry, length = params["num_consts"], params["num_carry"], params["length"]
    consts = [_ready(builder, one) for one in args[:n_consts]]
    rows = [_ready(builder, one) for one in args[n_consts + n_carry :]]
    carries = [Carry(builder, one) for one in args[n_consts : n_consts + n_carry]]
    outs = equation.outputs[n_carry:]
    if length == 0:
        return [
            *(one.first for one in carries), *(Known(np.zeros(o.shape, o.dtype)) for o in outs)
        ]  # fmt: skip
    labels = [
        builder.array(out.dtype, int(np.prod(out.shape))) if 0 not in out.shape else ""
        for out in outs
    ]
    with builder.loop(length, backwards=params["reverse"]) as k:
        inside = [one.inside(builder) for one in carries]
        here = [_row(builder, row, k) for row in rows]
        found = run(builder, body, [*consts, *inside, *here])
        for label, out, value in zip(labels, outs, found[n_carry:], strict=True):
            if label:
                _put_row(builder, label, out.shape[1:], value, k)
        update(builder, carries, found[:n_carry])
    results: list[Value] = [
        Stored(out.shape, out.dtype, label) if label else Known(np.zeros(out.shape, out.dtype))
        for out, label in zip(outs, labels, strict=True)
    ]
    return [*(one.inside(builder) for one in carries), *results]


def _row(builder: Builder, rows: Value, k: Index) -> Value:
    shape = rows.shape[1:]
    size = int(np.prod(shape, dtype=int))
    if size == 0:
        return Known(np.zeros(shape, rows.dtype))
    if isinstance(rows, Stored):
        row: Value = Stored(shape, rows.dtype, rows.array, rows.offset + k * size)
    else:
        row = Rule(shape, rows.dtype, lambda b, index: rows.at(b, (k, *index)), cheap=True)
    if row.small:
        row = atoms(builder, row)
    pattern = filled(rows)
    if pattern is not None and not pattern.any(axis=0).all():
        row.pattern = pattern.any(axis=0)
    return row


def _put_row(builder: Builder, label: str, shape: Any, value: Value, k: Index) -> None:
    from contourlab.export.statements import Store
    from contourlab.export.values import flat_index

    size = int(np.prod(shape, dtype=int))
    if value.size <= SMALL:
        for at in indices(shape):
            element = builder.bind(value.at(builder, at))
            builder.add(Store(label, flat_index(shape, at) + k * size, element, builder.line))
        return
    with builder.loops(shape) as at:
        element = builder.bind(value.at(builder, at))
        builder.add(Store(label, flat_index(shape, at) + k * size, element, builder.line))


def _while(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    params, builder = equation.params, emission.builder
    n_cond, n_body = params["cond_nconsts"], params["body_nconsts"]
    condition: Program = params["cond_jaxpr"]
    body: Program = params["body_jaxpr"]
    args = [_ready(builder, one) for one in args]
    first = args[n_cond + n_body :]
    bound = greatest_trip_count(emission, equation)
    if bound is None:
        raise ExportError(
            f"a while loop at {equation.line or 'an unknown line'} has no bound that can be "
            "proved, and a real-time step needs one: count the passes, and let the condition say "
            "`& (count < limit)` with a count that starts at a number and grows by one"
        )
    carries = [Carry(builder, one) for one in first]
    with builder.loop(bound, note="at most"):
        inside = [one.inside(builder) for one in carries]
        go_on = run(builder, condition, [*args[:n_cond], *inside])[0]
        builder.add(Break(builder.bind(go_on.at(builder, ())), builder.line))
        found = run(builder, body, [*args[n_cond : n_cond + n_body], *inside])
        update(builder, carries, found)
    return [one.inside(builder) for one in carries]


def _cond(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    params, builder = equation.params, emission.builder
    branches: tuple[Program, ...] = params["branches"]
    chosen, *operands = args
    which = builder.bind(chosen.at(builder, ()))
    if which.is_constant:
        number = min(max(int(which.value), 0), len(branches) - 1)
        return run(builder, branches[number], operands)
    operands = [_ready(builder, one) for one in operands]
    results: list[Value] = []
    for out in equation.outputs:
        size = int(np.prod(out.shape, dtype=int))
        if size <= SMALL:
            names = [builder.variable(out.dtype) for _ in range(size)]
            results.append(Atoms(builder, out.shape, out.dtype, names))
        else:
            results.append(Stored(out.shape, out.dtype, builder.array(out.dtype, size)))
    blocks = []
    for branch in branches:
        with builder.block() as block:
            found = run(builder, branch, operands)
            for target, value in zip(results, found, strict=True):
                if isinstance(target, Stored):
                    stored(builder, value, target.array)
                else:
                    assert isinstance(target, Atoms)
                    elements = [builder.bind(value.at(builder, at)) for at in indices(value.shape)]
                    for one, new in zip(target.elements, elements, strict=True):
                        builder.add(Set(str(one.value), new, builder.line))
        blocks.append(block)
    builder.add(Branch(which, blocks, builder.line))
    return results


LOOPS = {"scan": _scan, "while": _while, "cond": _cond}
