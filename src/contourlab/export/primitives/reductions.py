"""Sums, extremes, their places, and running sums: over dimensions, in the order of the elements."""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, constant, name, operation
from contourlab.export.flatten import Equation
from contourlab.export.primitives.emission import Emission
from contourlab.export.statements import Set, Store
from contourlab.export.values import Atoms, Known, Stored, Value, flat_index, indices
from contourlab.export.zeros import filled

__all__ = ["REDUCTIONS"]

_UNROLLED = 32
"""Up to so many elements a reduction is written out."""

_OPS = {
    "reduce_sum": "add", "reduce_prod": "mul", "reduce_max": "max", "reduce_min": "min",
    "reduce_and": "and", "reduce_or": "or", "reduce_xor": "xor",
}  # fmt: skip
_RUNNING = {"cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}


def neutral(op: str, dtype: Any) -> Any:
    """Return the result of a reduction over nothing.

    Parameters
    ----------
    op
        Name of the operation.
    dtype
        NumPy type.
    """
    if op in ("max", "min"):
        if np.dtype(dtype).kind == "f":
            return -np.inf if op == "max" else np.inf
        if dtype == np.bool_:
            return op == "min"
        info = np.iinfo(dtype)
        return info.min if op == "max" else info.max
    return {"add": 0, "mul": 1, "and": -1 if dtype != np.bool_ else True, "or": 0, "xor": 0}[op]


def _split(shape: Any, axes: Any) -> tuple[list[int], list[int]]:
    inner = sorted(int(a) % len(shape) for a in axes) if shape else []
    return [k for k in range(len(shape)) if k not in inner], inner


def _whole(outer: list[int], inner: list[int], at: Any, over: Any) -> Any:
    found: list[Any] = [None] * (len(outer) + len(inner))
    for k, index in zip(outer, at, strict=True):
        found[k] = index
    for k, index in zip(inner, over, strict=True):
        found[k] = index
    return tuple(found)


def _reduce(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    op, out, source = _OPS[equation.primitive], equation.outputs[0], args[0]
    outer, inner = _split(source.shape, equation.params["axes"])
    builder = emission.builder
    over_shape = tuple(source.shape[k] for k in inner)
    count = int(np.prod(over_shape, dtype=int))
    start = constant(neutral(op, out.dtype), out.dtype)
    if count == 0:
        return [Known(np.broadcast_to(start.value, out.shape))]

    if op == "add" and (written := _sparse_sum(emission, equation, source, outer, inner)):
        return [written]

    def folded(at: Any) -> Expression:
        """Written out; in a loop where there are many."""
        if count <= _UNROLLED:
            total: Expression | None = None
            for over in indices(over_shape):
                one = builder.bind(source.at(builder, _whole(outer, inner, at, over)))
                total = one if total is None else builder.bind(operation(op, out.dtype, total, one))
            assert total is not None
            return total
        total = builder.variable(out.dtype, start)
        with builder.loops(over_shape) as over:
            one = builder.bind(source.at(builder, _whole(outer, inner, at, over)))
            builder.add(Set(str(total.value), operation(op, out.dtype, total, one), builder.line))
        return total

    n_out = int(np.prod(out.shape, dtype=int))
    if n_out <= 16 and n_out * min(count, _UNROLLED) <= 128:
        return [emission.scalars(out, [folded(at) for at in indices(out.shape)])]
    label = builder.array(out.dtype, n_out)
    with builder.loops(out.shape) as at:
        builder.add(Store(label, flat_index(out.shape, at), folded(at), builder.line))
    return [Stored(out.shape, out.dtype, label)]


def _sparse_sum(
    emission: Emission, equation: Equation, source: Value, outer: list[int], inner: list[int]
) -> Value | None:
    """Return a sum of which most terms are zero by construction: the others are written out.

    The first dimension that stays is a loop; what is zero there is so whatever its counter is.
    """
    pattern, out, builder = filled(source), equation.outputs[0], emission.builder
    if pattern is None or out.dtype.kind != "f" or int(np.prod(out.shape)) <= 16:
        return None
    looped = outer[0]
    pattern = np.asarray(pattern.any(axis=looped, keepdims=True))
    rest = [k for k in outer if k != looped]
    if pattern.mean() > 0.6 or max(pattern.sum(), np.prod([source.shape[k] for k in rest])) > 600:
        return None
    label = builder.array(out.dtype, int(np.prod(out.shape, dtype=int)))
    with builder.loops((source.shape[looped],)) as (k,):
        for at in indices(tuple(source.shape[n] for n in rest)):
            total: Expression | None = None
            for over in indices(tuple(source.shape[n] for n in inner)):
                place = {looped: k, **dict(zip(rest, at, strict=True)),
                         **dict(zip(inner, over, strict=True))}  # fmt: skip
                spot = tuple(0 if n == looped else place[n].constant for n in range(len(place)))
                if not pattern[spot]:
                    continue
                one = builder.bind(source.at(builder, tuple(place[n] for n in range(len(place)))))
                total = one if total is None else builder.bind(
                    operation("add", out.dtype, total, one))  # fmt: skip
            value = constant(0, out.dtype) if total is None else total
            target = tuple(place_of for place_of in (k, *at))
            builder.add(Store(label, flat_index(out.shape, target), value, builder.line))
    return Stored(out.shape, out.dtype, label)


def _running(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    op, out, source = _RUNNING[equation.primitive], equation.outputs[0], args[0]
    axis, backwards = equation.params["axis"], equation.params["reverse"]
    builder, length = emission.builder, source.shape[axis]
    if source.small:
        found: dict[Any, Expression] = {}
        for at in indices(out.shape):
            turned = at if not backwards else _turned(at, axis, length)
            one = builder.bind(source.at(builder, turned))
            before = at[axis].constant - 1
            if before >= 0:
                last = found[_put(at, axis, before, length, backwards)]
                one = builder.bind(operation(op, out.dtype, last, one))
            found[tuple(k.constant for k in turned)] = one
        elements = [found[tuple(k.constant for k in at)] for at in indices(out.shape)]
        return [Atoms(builder, out.shape, out.dtype, elements)]
    label = builder.array(out.dtype, int(np.prod(out.shape)))
    rest = tuple(n for k, n in enumerate(out.shape) if k != axis)
    with builder.loops(rest) as others:
        total = builder.variable(out.dtype, constant(neutral(op, out.dtype), out.dtype))
        with builder.loop(length) as k:
            place = k * -1 + (length - 1) if backwards else k
            at = (*others[:axis], place, *others[axis:])
            one = builder.bind(source.at(builder, at))
            builder.add(Set(str(total.value), operation(op, out.dtype, total, one), builder.line))
            builder.add(Store(label, flat_index(out.shape, at), total, builder.line))
    return [Stored(out.shape, out.dtype, label)]


def _turned(at: Any, axis: int, length: int) -> Any:
    return tuple(k * -1 + (length - 1) if n == axis else k for n, k in enumerate(at))


def _put(at: Any, axis: int, place: int, length: int, backwards: bool) -> tuple[int, ...]:
    where = length - 1 - place if backwards else place
    return tuple(where if n == axis else k.constant for n, k in enumerate(at))


def _argument(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    """The first place of the extreme; NaN counts as extreme."""
    out, source, builder = equation.outputs[0], args[0], emission.builder
    outer, inner = _split(source.shape, equation.params["axes"])
    length = source.shape[inner[0]]
    greater = "gt" if equation.primitive == "argmax" else "lt"

    def better(one: Expression, best: Expression) -> Expression:
        test = operation(greater, np.bool_, one, best)
        if np.dtype(source.dtype).kind != "f":
            return test
        nan = operation("ne", np.bool_, one, one)
        held = operation("eq", np.bool_, best, best)
        return operation("or", np.bool_, test, operation("and", np.bool_, nan, held))

    def found(at: Any) -> Expression:
        best = builder.variable(source.dtype)
        place = builder.variable(out.dtype, constant(0, out.dtype))
        first = builder.bind(source.at(builder, _whole(outer, inner, at, indices((1,))[0])))
        builder.add(Set(str(best.value), first, builder.line))
        with builder.loop(length) as k:
            one = builder.bind(source.at(builder, _whole(outer, inner, at, (k,))))
            test = builder.bind(better(one, best), keep=True)
            number = operation("cast", out.dtype, name(str(k), np.dtype(np.int32)))
            for target, new in ((place, number), (best, one)):
                chosen = operation("select", target.dtype, test, new, target)
                builder.add(Set(str(target.value), chosen, builder.line))
        return place

    if int(np.prod(out.shape, dtype=int)) <= 16:
        elements = [builder.bind(found(at), keep=True) for at in indices(out.shape)]
        return [Atoms(builder, out.shape, out.dtype, elements)]
    label = builder.array(out.dtype, int(np.prod(out.shape)))
    with builder.loops(out.shape) as at:
        builder.add(Store(label, flat_index(out.shape, at), found(at), builder.line))
    return [Stored(out.shape, out.dtype, label)]


def _known(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    """Return what follows from known whole numbers and truths; others are computed."""
    source = args[0]
    if isinstance(source, Known) and source.dtype.kind in "iub" and equation.primitive in _OPS:
        op, axes = _OPS[equation.primitive], tuple(equation.params["axes"])
        ufunc = {"add": np.add, "mul": np.multiply, "max": np.maximum, "min": np.minimum,
                 "and": np.bitwise_and, "or": np.bitwise_or, "xor": np.bitwise_xor}[op]  # fmt: skip
        if source.size:
            return [Known(ufunc.reduce(source.array, axis=axes).astype(equation.outputs[0].dtype))]
    return _reduce(emission, equation, args)


REDUCTIONS = {
    **dict.fromkeys(_OPS, _known),
    **dict.fromkeys(_RUNNING, _running),
    "argmax": _argument,
    "argmin": _argument,
}
