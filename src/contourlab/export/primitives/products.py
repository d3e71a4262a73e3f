"""Products of vectors and matrices; sums run over the contracted dimensions in their order."""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, constant, operation
from contourlab.export.flatten import Equation
from contourlab.export.primitives.emission import Emission
from contourlab.export.statements import Set, Store
from contourlab.export.values import Atoms, Known, Stored, Value, flat_index, indices, stored
from contourlab.export.zeros import filled

__all__ = ["dot_general"]

_WRITTEN_OUT = 128
"""Up to so many products everything is written out."""

_SPARSE = 0.6
"""Share of entries up to which the zeros of an operand are made use of."""
_STATEMENTS = 600
"""Products that are written out for it at the most."""


def _in_memory(builder: Any, value: Value) -> Value:
    found = stored(builder, value)
    found.pattern = value.pattern
    return found


def _by_sum(value: Value, batch: Any, total: Any, free: Any) -> Any:
    """Return where an operand may be other than zero: (summed, free), whatever the batch is."""
    pattern = filled(value)
    if pattern is None:
        return None
    order = (*batch, *total, *free)
    n_batch, n_sum = len(batch), len(total)
    turned = pattern.transpose(order)
    turned = np.asarray(turned.any(axis=tuple(range(n_batch))))
    count = int(np.prod(turned.shape[:n_sum], dtype=int))
    return turned.reshape(count, -1)


def _rows(pattern: Any, value: Value, free: Any, at: Any) -> Any:
    """Return which summed entries count for one place of the free dimensions; None for all."""
    if pattern is None:
        return None
    place = flat_index(tuple(value.shape[k] for k in free), at)
    return pattern[:, place.constant] if place.known else None


def _written(left: Any, right: Any, rows: Any, columns: Any) -> tuple[bool, bool] | None:
    """Return whether rows and columns of a product are written out; None if nothing is gained."""
    sparse = [one is not None and one.mean() <= _SPARSE for one in (left, right)]
    if not any(sparse):
        return None
    count = [int(one.sum()) if one is not None else 0 for one in (left, right)]
    if all(sparse):
        products = int((left.astype(int).T @ right.astype(int)).sum())
        outputs = int(np.prod(rows, dtype=int) * np.prod(columns, dtype=int))
        if max(products, outputs) <= _STATEMENTS:
            return True, True
    if sparse[0] and count[0] <= _STATEMENTS and (not sparse[1] or count[0] <= count[1]):
        return True, False
    if sparse[1] and count[1] <= _STATEMENTS:
        return False, True
    return None


def dot_general(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    """Return the value of a product.

    Parameters
    ----------
    emission
        Of the program.
    equation
        What to write.
    args
        Left and right operand.
    """
    out, builder = equation.outputs[0], emission.builder
    (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
    left, right = args
    left_free = [k for k in range(len(left.shape)) if k not in (*left_sum, *left_batch)]
    right_free = [k for k in range(len(right.shape)) if k not in (*right_sum, *right_batch)]
    over_shape = tuple(left.shape[k] for k in left_sum)
    count, n_out = int(np.prod(over_shape, dtype=int)), int(np.prod(out.shape, dtype=int))
    if count == 0:
        return [Known(np.zeros(out.shape, out.dtype))]
    n_batch, n_left = len(left_batch), len(left_free)

    def index_of(side: str, at: Any, over: Any) -> Any:
        batch, total = at[:n_batch], over
        if side == "left":
            places = (left_batch, left_sum, left_free)
            free = at[n_batch : n_batch + n_left]
        else:
            places = (right_batch, right_sum, right_free)
            free = at[n_batch + n_left :]
        found: dict[int, Any] = {}
        for keys, values in zip(places, (batch, total, free), strict=True):
            found.update(zip(keys, values, strict=True))
        return tuple(found[k] for k in range(len(found)))

    def product(at: Any, over: Any) -> Expression:
        a = builder.bind(left.at(builder, index_of("left", at, over)))
        b = builder.bind(right.at(builder, index_of("right", at, over)))
        a, b = (operation("cast", out.dtype, x) for x in (a, b))
        return operation("and" if out.dtype == np.bool_ else "mul", out.dtype, a, b)

    # where both may be other than zero, by sum and free dimensions, whatever the batch
    filled_left = _by_sum(left, left_batch, left_sum, left_free)
    filled_right = _by_sum(right, right_batch, right_sum, right_free)
    overs = indices(over_shape)

    def total(at: Any) -> Expression:
        found: Expression | None = None
        row, column = at[n_batch : n_batch + n_left], at[n_batch + n_left :]
        wanted = _rows(filled_left, left, left_free, row)
        if wanted is not None:
            others = _rows(filled_right, right, right_free, column)
            wanted = wanted if others is None else wanted & others
        else:
            wanted = _rows(filled_right, right, right_free, column)
        for number, over in enumerate(overs):
            if wanted is not None and not wanted[number]:
                continue
            one = builder.bind(product(at, over))
            found = one if found is None else builder.bind(operation("add", out.dtype, found, one))
        return constant(0, out.dtype) if found is None else found

    if n_out <= 16 and n_out * count <= _WRITTEN_OUT:
        elements = [total(at) for at in indices(out.shape)]
        return [Atoms(builder, out.shape, out.dtype, elements)]
    # operands in memory: they are read several times
    left, right = (x if x.cheap else _in_memory(builder, x) for x in (left, right))
    label = builder.array(out.dtype, n_out)
    zero = constant(0, out.dtype)
    batch_shape, rest = out.shape[:n_batch], out.shape[n_batch:]
    row_shape, column_shape = rest[:n_left], rest[n_left:]
    plan = _written(filled_left, filled_right, row_shape, column_shape)
    if plan is not None:
        # the sparse side is written out, the other is a loop
        loop_rows, loop_columns = not plan[0], not plan[1]
        with (
            builder.loops(batch_shape) as batch,
            builder.loops(row_shape if loop_rows else ()) as rows_at,
            builder.loops(column_shape if loop_columns else ()) as columns_at,
        ):
            for row in [rows_at] if loop_rows else indices(row_shape):
                for several in [columns_at] if loop_columns else indices(column_shape):
                    element = (*batch, *row, *several)
                    place = flat_index(out.shape, element)
                    builder.add(Store(label, place, total(element), builder.line))
        return [Stored(out.shape, out.dtype, label)]
    columns = right_free and out.shape[-1] > 1
    if columns:
        # rows of the result are sums of rows on the right: the inner loop runs along memory
        with builder.loops(out.shape[:-1]) as rows:
            with builder.loop(out.shape[-1]) as column:
                place = flat_index(out.shape, (*rows, column))
                builder.add(Store(label, place, zero, builder.line))
            with builder.loops(over_shape) as over:
                factor = builder.bind(left.at(builder, index_of("left", (*rows, 0), over)))
                with builder.loop(out.shape[-1]) as column:
                    at = (*rows, column)
                    other = builder.bind(right.at(builder, index_of("right", at, over)))
                    one = operation("mul", out.dtype, factor, other)
                    place = flat_index(out.shape, at)
                    builder.add(Store(label, place, one, builder.line, add=True))
        return [Stored(out.shape, out.dtype, label)]
    with builder.loops(out.shape) as at:
        place = flat_index(out.shape, at)
        if count <= 16:
            builder.add(Store(label, place, total(at), builder.line))
        else:
            sum_ = builder.variable(out.dtype, zero)
            with builder.loops(over_shape) as over:
                one = builder.bind(product(at, over))
                added = operation("add", out.dtype, sum_, one)
                builder.add(Set(str(sum_.value), added, builder.line))
            builder.add(Store(label, place, sum_, builder.line))
    return [Stored(out.shape, out.dtype, label)]
