"""Elements at places that are only known at run time; JAX's rules for places that do not exist.

A slice that would leave the array is moved back inside. A gather clamps, or fills; a scatter
drops, or clamps. Where JAX is promised that places exist, C clamps too: nothing outside is read or
written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jax.lax import GatherScatterMode

from contourlab.errors import ExportError
from contourlab.export.expressions import Expression, Index, constant, operation
from contourlab.export.flatten import Equation
from contourlab.export.primitives.emission import Emission
from contourlab.export.statements import Block, Branch, Builder, Store
from contourlab.export.values import (
    Atoms,
    Known,
    Stored,
    Value,
    flat_index,
    indices,
    stored,
)

__all__ = ["INDEXING"]

_INT = np.dtype(np.int32)


def clamped(builder: Builder, value: Expression, top: int) -> Expression:
    """Return a whole number moved into 0 to ``top``.

    Parameters
    ----------
    builder
        Where statements go.
    value
        Of any whole type.
    top
        Greatest value.
    """
    if top <= 0:
        return constant(0, _INT)
    if value.is_constant:
        return constant(min(max(int(value.value), 0), top), _INT)
    wide = operation("cast", np.int64, value)
    return builder.bind(operation("clamp_index", _INT, wide, constant(top, _INT)))


def _starts(builder: Builder, starts: list[Value], shape: Any, sizes: Any) -> list[Index]:
    return [
        builder.index_name(clamped(builder, builder.bind(one.at(builder, ())), n - size))
        for one, n, size in zip(starts, shape, sizes, strict=True)
    ]


def _dynamic_slice(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    source, *starts = args
    out, builder = equation.outputs[0], emission.builder
    if not source.cheap:
        source = stored(builder, source)
    first = _starts(builder, starts, source.shape, equation.params["slice_sizes"])

    def element(builder: Builder, index: Any) -> Expression:
        return source.at(builder, tuple(k + a for k, a in zip(index, first, strict=True)))

    return [emission.rule(out, element, cheap=True)]


def _dynamic_update_slice(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    source, update, *starts = args
    out, builder = equation.outputs[0], emission.builder
    first = _starts(builder, starts, source.shape, update.shape)
    if source.small and all(one.known for one in first):
        elements = [builder.bind(source.at(builder, at)) for at in indices(source.shape)]
        for at in indices(update.shape):
            place = tuple(k + a for k, a in zip(at, first, strict=True))
            elements[flat_index(out.shape, place).constant] = builder.bind(update.at(builder, at))
        return [Atoms(builder, out.shape, out.dtype, elements)]
    if source.small and update.size == 1:
        new = builder.bind(update.at(builder, (Index(),) * len(update.shape)))
        elements = []
        for at in indices(source.shape):
            here: Expression = constant(True, np.bool_)
            for k, a in zip(at, first, strict=True):
                if a.known:
                    same = constant(a.constant == k.constant, np.bool_)
                else:
                    from contourlab.export.expressions import name

                    same = operation("eq", np.bool_, name(str(a), _INT), constant(k.constant, _INT))
                here = operation("and", np.bool_, here, same)
            old = builder.bind(source.at(builder, at))
            elements.append(builder.bind(operation("select", out.dtype, here, new, old)))
        return [Atoms(builder, out.shape, out.dtype, elements)]
    if not update.cheap:
        update = stored(builder, update)
    label = stored(builder, source, builder.array(out.dtype, source.size)).array
    with builder.loops(update.shape) as at:
        place = tuple(k + a for k, a in zip(at, first, strict=True))
        element = builder.bind(update.at(builder, at))
        builder.add(Store(label, flat_index(out.shape, place), element, builder.line))
    return [Stored(out.shape, out.dtype, label)]


def _places(builder: Builder, where: Value, batch: Any, count: int) -> list[Expression]:
    """Return the places that a row of indices names."""
    return [builder.bind(where.at(builder, (*batch, Index(k)))) for k in range(count)]


def _in_bounds(places: list[Expression], tops: list[int]) -> Expression:
    found: Expression = constant(True, np.bool_)
    for place, top in zip(places, tops, strict=True):
        if place.dtype.kind != "u":
            low = operation("ge", np.bool_, place, constant(0, place.dtype))
            found = operation("and", np.bool_, found, low)
        high = operation("le", np.bool_, place, constant(max(top, -1), place.dtype))
        found = operation("and", np.bool_, found, high)
    return found


def fill_value(params: dict[str, Any], dtype: Any) -> Any:
    """Return what a gather gives for a place that does not exist.

    Parameters
    ----------
    params
        Of the equation.
    dtype
        NumPy type.
    """
    if params.get("fill_value") is not None:
        return params["fill_value"]
    kind = np.dtype(dtype)
    if kind.kind == "f":
        return np.nan
    if kind == np.bool_:
        return True
    return np.iinfo(kind).min if kind.kind == "i" else np.iinfo(kind).max


def _gather(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    (source, where), params, out = args, equation.params, equation.outputs[0]
    dims, sizes, mode = params["dimension_numbers"], params["slice_sizes"], params["mode"]
    builder = emission.builder
    if not source.cheap:
        source = stored(builder, source)
    if not where.cheap:
        where = stored(builder, where)
    removed = (*dims.collapsed_slice_dims, *dims.operand_batching_dims)
    window = [k for k in range(len(source.shape)) if k not in removed]
    batch_out = [k for k in range(len(out.shape)) if k not in dims.offset_dims]
    tops = [source.shape[k] - sizes[k] for k in dims.start_index_map]

    def element(builder: Builder, index: Any) -> Expression:
        batch = [index[k] for k in batch_out]
        raw = _places(builder, where, batch, len(dims.start_index_map))
        at: list[Index] = [Index() for _ in source.shape]
        for k, place, top in zip(dims.start_index_map, raw, tops, strict=True):
            at[k] = builder.index_name(clamped(builder, place, top))
        for own, other in zip(
            dims.operand_batching_dims, dims.start_indices_batching_dims, strict=True
        ):
            at[own] = at[own] + batch[other]
        for k, n in zip(window, dims.offset_dims, strict=True):
            at[k] = at[k] + index[n]
        found = source.at(builder, tuple(at))
        if mode == GatherScatterMode.FILL_OR_DROP:
            filler = constant(fill_value(params, out.dtype), out.dtype)
            inside = builder.bind(_in_bounds(raw, tops))
            found = operation("select", out.dtype, inside, builder.bind(found), filler)
        return found

    return [emission.rule(out, element)]


_COMBINE = {
    "scatter": None, "scatter-add": "add", "scatter_add": "add", "scatter-sub": "sub",
    "scatter_sub": "sub", "scatter-mul": "mul", "scatter_mul": "mul", "scatter-min": "min",
    "scatter_min": "min", "scatter-max": "max", "scatter_max": "max",
}  # fmt: skip


def _scatter(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    (source, where, updates), params = args, equation.params
    out, builder, combine = equation.outputs[0], emission.builder, _COMBINE[equation.primitive]
    dims, mode = params["dimension_numbers"], params["mode"]
    removed = (*dims.inserted_window_dims, *dims.operand_batching_dims)
    window = [k for k in range(len(source.shape)) if k not in removed]
    batch_in = [k for k in range(len(updates.shape)) if k not in dims.update_window_dims]
    extent = [1] * len(source.shape)
    for k, n in zip(window, dims.update_window_dims, strict=True):
        extent[k] = updates.shape[n]
    mapped = dims.scatter_dims_to_operand_dims
    tops = [source.shape[k] - extent[k] for k in mapped]
    if not updates.cheap:
        updates = stored(builder, updates)

    def target(index: Any) -> tuple[list[Index], Expression]:
        batch = [index[k] for k in batch_in]
        raw = _places(builder, where, batch, len(mapped))
        inside = (
            constant(True, np.bool_) if mode == GatherScatterMode.CLIP else _in_bounds(raw, tops)
        )
        at: list[Index] = [Index() for _ in source.shape]
        for k, place, top in zip(mapped, raw, tops, strict=True):
            at[k] = builder.index_name(clamped(builder, place, top))
        for own, other in zip(
            dims.operand_batching_dims, dims.scatter_indices_batching_dims, strict=True
        ):
            at[own] = at[own] + batch[other]
        for k, n in zip(window, dims.update_window_dims, strict=True):
            at[k] = at[k] + index[n]
        return at, inside

    def combined(old: Expression, new: Expression) -> Expression:
        return new if combine is None else builder.bind(operation(combine, out.dtype, old, new))

    if source.small and isinstance(where, Known):
        elements = [builder.bind(source.at(builder, at)) for at in indices(source.shape)]
        for index in indices(updates.shape):
            at, inside = target(index)
            if inside.value:
                element = flat_index(out.shape, tuple(at)).constant
                new = builder.bind(updates.at(builder, index))
                elements[element] = combined(elements[element], new)
        return [Atoms(builder, out.shape, out.dtype, elements)]
    label = stored(builder, source, builder.array(out.dtype, source.size)).array
    with builder.loops(updates.shape) as index:
        at, inside = target(index)
        place = flat_index(out.shape, tuple(at))
        with builder.block() as put:
            from contourlab.export.expressions import load

            new = builder.bind(updates.at(builder, index))
            if combine is not None:
                new = operation(combine, out.dtype, load(label, place, out.dtype), new)
            builder.add(Store(label, place, new, builder.line))
        if inside.is_constant:
            if inside.value:
                builder.stack[-1].statements += put.statements
        else:
            builder.add(Branch(builder.bind(inside), [Block(), put], builder.line))
    return [Stored(out.shape, out.dtype, label)]


def _sort(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    """Insertion sort: stable; NaN last; only for one dimension."""
    params, builder = equation.params, emission.builder
    if any(len(arg.shape) != 1 for arg in args) or params["num_keys"] != 1:
        raise ExportError(
            f"sort of several dimensions or keys cannot be exported ({equation.line}): sort rows "
            "one by one, by one key"
        )
    n = args[0].shape[0]
    label = [stored(builder, arg, builder.array(arg.dtype, n)).array for arg in args]
    from contourlab.export.expressions import load

    # passes of neighbours that are put in order: as many as there are elements
    with builder.loop(n), builder.loop(max(n - 1, 1)) as k:
        if n > 1:
            a, b = (load(label[0], place, args[0].dtype) for place in (k, k + 1))
            wrong = operation("gt", np.bool_, a, b)
            if args[0].dtype.kind == "f":
                nan = operation("ne", np.bool_, a, a)
                number = operation("eq", np.bool_, b, b)
                wrong = operation("or", np.bool_, wrong, operation("and", np.bool_, nan, number))
            test = builder.bind(wrong, keep=True)
            for name_, arg in zip(label, args, strict=True):
                pair = [
                    builder.bind(load(name_, place, arg.dtype), keep=True) for place in (k, k + 1)
                ]
                for place, (one, other) in ((k, pair), (k + 1, pair[::-1])):
                    new = operation("select", arg.dtype, test, other, one)
                    builder.add(Store(name_, place, new, builder.line))
    return [Stored(arg.shape, arg.dtype, one) for arg, one in zip(args, label, strict=True)]


INDEXING = {
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
    "sort": _sort,
    **dict.fromkeys(_COMBINE, _scatter),
}
