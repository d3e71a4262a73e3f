"""Products of vectors and matrices; sums run over the contracted dimensions in their order."""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, constant, operation
from contourlab.export.flatten import Equation
from contourlab.export.primitives.emission import Emission
from contourlab.export.statements import Set, Store
from contourlab.export.values import Atoms, Known, Stored, Value, flat_index, indices, stored

__all__ = ["dot_general"]

_WRITTEN_OUT = 128
"""Up to so many products everything is written out."""


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

    def total(at: Any) -> Expression:
        found: Expression | None = None
        for over in indices(over_shape):
            one = builder.bind(product(at, over))
            found = one if found is None else builder.bind(operation("add", out.dtype, found, one))
        assert found is not None
        return found

    if n_out <= 16 and n_out * count <= _WRITTEN_OUT:
        elements = [total(at) for at in indices(out.shape)]
        return [Atoms(builder, out.shape, out.dtype, elements)]
    # operands in memory: they are read several times
    left, right = (x if x.cheap else stored(builder, x) for x in (left, right))
    label = builder.array(out.dtype, n_out)
    zero = constant(0, out.dtype)
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
