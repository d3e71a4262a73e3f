"""Operations that only move elements: shapes, slices, joins, constants that count."""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, Index
from contourlab.export.flatten import Equation, Variable
from contourlab.export.primitives.emission import Emission
from contourlab.export.statements import Builder, Store
from contourlab.export.values import (
    Atoms,
    Known,
    Stored,
    Value,
    flat_index,
    indices,
    stored,
)

__all__ = ["VIEWS"]


def view(emission: Emission, out: Variable, source: Value, remap: Any) -> Value:
    """Return a value whose elements are elements of another.

    Parameters
    ----------
    emission
        Of the program.
    out
        The variable.
    source
        Where the elements are.
    remap
        Gives the index in the source from one of the variable.
    """
    return emission.rule(
        out, lambda builder, index: source.at(builder, remap(index)), cheap=source.cheap
    )


def _reshape(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    out, source = equation.outputs[0], args[0]
    if isinstance(source, Known):
        return [Known(source.array.reshape(out.shape))]
    if isinstance(source, Stored):
        return [Stored(out.shape, out.dtype, source.array, source.offset)]
    if isinstance(source, Atoms):
        return [Atoms(emission.builder, out.shape, out.dtype, source.elements)]
    before = [k for k, n in enumerate(source.shape) if n != 1]
    after = [k for k, n in enumerate(out.shape) if n != 1]
    if [source.shape[k] for k in before] == [out.shape[k] for k in after]:
        # only dimensions of one come or go

        def remap(index: Any) -> Any:
            found = [Index()] * len(source.shape)
            for k, n in zip(before, after, strict=True):
                found[k] = index[n]
            return tuple(found)

        return [view(emission, out, source, remap)]
    flat = stored(emission.builder, source)
    return [Stored(out.shape, out.dtype, flat.array, flat.offset)]


def _transpose(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    order, source = equation.params["permutation"], args[0]
    if isinstance(source, Known):
        return [Known(source.array.transpose(order))]
    back = np.argsort(order)
    remap = lambda index: tuple(index[k] for k in back)  # noqa: E731
    return [view(emission, equation.outputs[0], source, remap)]


def _broadcast(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    out, source, where = equation.outputs[0], args[0], equation.params["broadcast_dimensions"]
    if isinstance(source, Known):
        shape = [1] * len(out.shape)
        for k, n in zip(where, source.shape, strict=True):
            shape[k] = n
        return [Known(np.broadcast_to(source.array.reshape(shape), out.shape))]

    def remap(index: Any) -> Any:
        return tuple(
            index[k] if n != 1 else Index() for k, n in zip(where, source.shape, strict=True)
        )

    if not isinstance(source, Stored | Atoms) and source.shape == ():
        source = Atoms(emission.builder, (), source.dtype,
                       [emission.builder.bind(source.at(emission.builder, ()))])  # fmt: skip
    return [view(emission, out, source, remap)]


def _slice(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    params, source = equation.params, args[0]
    start = params["start_indices"]
    steps = params["strides"] or (1,) * len(start)
    if isinstance(source, Known):
        limits = params["limit_indices"]
        cut = tuple(slice(a, b, s) for a, b, s in zip(start, limits, steps, strict=True))
        return [Known(source.array[cut])]

    def remap(index: Any) -> Any:
        return tuple(k * s + a for k, s, a in zip(index, steps, start, strict=True))

    return [view(emission, equation.outputs[0], source, remap)]


def _split(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    axis, source, first, found = equation.params["axis"], args[0], 0, []
    for out in equation.outputs:

        def remap(index: Any, first: int = first) -> Any:
            return tuple(k + first if n == axis else k for n, k in enumerate(index))

        found.append(view(emission, out, source, remap))
        first += out.shape[axis]
    return found


def _squeeze(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    return _reshape(emission, equation, args)


def _reverse(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    turned, source = equation.params["dimensions"], args[0]
    if isinstance(source, Known):
        return [Known(np.flip(source.array, turned))]

    def remap(index: Any) -> Any:
        return tuple(
            k * -1 + (n - 1) if d in turned else k
            for d, (k, n) in enumerate(zip(index, source.shape, strict=True))
        )

    return [view(emission, equation.outputs[0], source, remap)]


def _iota(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    del emission, args
    out, axis = equation.outputs[0], equation.params["dimension"]
    shape = [1] * len(out.shape)
    shape[axis] = out.shape[axis]
    row = np.arange(out.shape[axis]).astype(out.dtype).reshape(shape)
    return [Known(np.broadcast_to(row, out.shape))]


def _pieces(
    emission: Emission, out: Variable, pieces: list[tuple[Value, Any]], fill: Value | None = None
) -> Value:
    """Return a value put together from pieces, each with the place of its elements."""
    builder = emission.builder
    if int(np.prod(out.shape)) == 0:
        return Known(np.zeros(out.shape, out.dtype))
    small = int(np.prod(out.shape)) <= 16
    if small:
        elements: list[Expression | None] = [None] * int(np.prod(out.shape))
        for piece, place in pieces:
            for index in indices(piece.shape):
                at = place(index)
                if at is not None:
                    elements[flat_index(out.shape, at).constant] = piece.at(builder, index)
        if fill is not None:
            filler = builder.bind(fill.at(builder, ()))
            elements = [filler if one is None else one for one in elements]
        return emission.scalars(out, elements)
    label = builder.array(out.dtype, int(np.prod(out.shape)))
    if fill is not None:
        filler = builder.bind(fill.at(builder, ()))
        with builder.loop(int(np.prod(out.shape))) as k:
            builder.add(Store(label, k, filler, builder.line))
    for piece, place in pieces:
        if piece.size == 0:
            continue
        with builder.loops(piece.shape) as index:
            element = builder.bind(piece.at(builder, index))
            builder.add(Store(label, flat_index(out.shape, place(index)), element, builder.line))
    return Stored(out.shape, out.dtype, label)


def _concatenate(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    axis, out = equation.params["dimension"], equation.outputs[0]
    if all(isinstance(arg, Known) for arg in args):
        return [Known(np.concatenate([arg.array for arg in args if isinstance(arg, Known)], axis))]
    pieces, first = [], 0
    for arg in args:

        def place(index: Any, first: int = first) -> Any:
            return tuple(k + first if n == axis else k for n, k in enumerate(index))

        pieces.append((arg, place))
        first += arg.shape[axis]
    return [_pieces(emission, out, pieces)]


def _stack(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    out = equation.outputs[0]
    axis = equation.params.get("axis", equation.params.get("dimension", 0))
    if all(isinstance(arg, Known) for arg in args):
        return [Known(np.stack([arg.array for arg in args if isinstance(arg, Known)], axis))]
    pieces = []
    for number, arg in enumerate(args):

        def place(index: Any, number: int = number) -> Any:
            return (*index[:axis], Index(number), *index[axis:])

        pieces.append((arg, place))
    return [_pieces(emission, out, pieces)]


def _pad(emission: Emission, equation: Equation, args: list[Value]) -> list[Value]:
    out, (source, fill) = equation.outputs[0], args
    rules = equation.params["padding_config"]
    # negative padding cuts: leave out what falls outside
    low, high, keep = [], [], []
    for n, size, (before, _, between) in zip(source.shape, out.shape, rules, strict=True):
        inside = [k for k in range(n) if 0 <= before + k * (between + 1) < size]
        keep.append((inside[0], len(inside)) if inside else (0, 0))
        low.append(before)
        high.append(between + 1)

    def shown(builder: Builder, index: Any) -> Expression:
        return source.at(builder, tuple(k + a for k, (a, _) in zip(index, keep, strict=True)))

    def place(index: Any) -> Any:
        return tuple(
            (k + a) * step + before
            for k, (a, _), step, before in zip(index, keep, high, low, strict=True)
        )

    from contourlab.export.values import Rule

    part = Rule(tuple(n for _, n in keep), source.dtype, shown)
    pieces: list[tuple[Value, Any]] = [(part, place)] if part.size else []
    return [_pieces(emission, out, pieces, fill)]


VIEWS = {
    "reshape": _reshape,
    "expand_dims": _reshape,
    "squeeze": _squeeze,
    "transpose": _transpose,
    "broadcast_in_dim": _broadcast,
    "slice": _slice,
    "split": _split,
    "rev": _reverse,
    "iota": _iota,
    "concatenate": _concatenate,
    "stack": _stack,
    "pad": _pad,
}
