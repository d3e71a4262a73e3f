"""What a variable of a law is while C is written: known, scalars, an array, or a rule for elements.

Small arrays are kept as scalars: their elements are names, and taking them apart costs nothing.
Larger ones are C arrays, or *rules*: how an element comes from others. A rule that is used once is
put into the loop that uses it; one that is used several times is carried out first, into an array.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from contourlab.export.expressions import Expression, Index, constant, load
from contourlab.export.statements import Builder, Store

__all__ = ["SMALL", "Atoms", "Known", "Rule", "Stored", "Value", "indices", "stored"]

SMALL = 16
"""Up to so many elements an array is kept as scalars."""

Indices = tuple[Index, ...]


def indices(shape: Sequence[int]) -> list[Indices]:
    """Return every index of a shape, in the order of memory.

    Parameters
    ----------
    shape
        Of an array.
    """
    return [tuple(Index(i) for i in one) for one in itertools.product(*map(range, shape))]


def flat_index(shape: Sequence[int], at: Indices) -> Index:
    """Return the place in memory of an element.

    Parameters
    ----------
    shape
        Of the array.
    at
        Its index.
    """
    place = Index()
    for count, index in zip(shape, at, strict=True):
        place = place * count + index
    return place


class Value:
    """A variable of the law.

    Parameters
    ----------
    shape
        Of the array; () for a scalar.
    dtype
        NumPy type.
    """

    cheap = True
    """Whether an element is just looked up."""
    pattern: Any = None
    """Where it may be other than zero, as an array of truths; None if anywhere."""

    def __init__(self, shape: Sequence[int], dtype: Any) -> None:
        self.shape = tuple(int(n) for n in shape)
        self.dtype = np.dtype(dtype)

    @property
    def size(self) -> int:
        """Number of elements."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def small(self) -> bool:
        """Whether it is kept as scalars."""
        return self.size <= SMALL

    def at(self, builder: Builder, index: Indices) -> Expression:
        """Return an element.

        Parameters
        ----------
        builder
            Where statements go, if any are needed.
        index
            Which.
        """
        raise NotImplementedError


class Known(Value):
    """Numbers that are known now.

    Parameters
    ----------
    array
        The numbers.
    """

    def __init__(self, array: Any) -> None:
        self.array = np.asarray(array)
        super().__init__(self.array.shape, self.array.dtype)
        # bytes tell -0 from 0, and NaN is itself
        data = np.frombuffer(np.ascontiguousarray(self.array).tobytes(), np.uint8)
        rows = data.reshape(self.size, -1) if self.size else data.reshape(0, 1)
        self.uniform = self.size > 0 and bool(np.all(rows == rows[0]))

    def at(self, builder: Builder, index: Indices) -> Expression:
        """Return an element: a constant, or one of a table."""
        if self.uniform:
            return constant(self.array.ravel()[0], self.dtype)
        if all(one.known for one in index):
            return constant(self.array[tuple(one.constant for one in index)], self.dtype)
        return load(builder.table(self.array), flat_index(self.shape, index), self.dtype)


class Atoms(Value):
    """Scalars, in the order of memory.

    Parameters
    ----------
    builder
        Where they were made.
    shape, dtype
        Of the value.
    elements
        Named or constant.
    """

    def __init__(
        self, builder: Builder, shape: Sequence[int], dtype: Any, elements: list[Expression]
    ) -> None:
        super().__init__(shape, dtype)
        self.elements = elements
        self._block = builder.stack[-1]
        self._array: str | None = None

    def at(self, builder: Builder, index: Indices) -> Expression:
        """Return an element; where the index is only known at run time, from an array of them."""
        place = flat_index(self.shape, index)
        if place.known:
            return self.elements[place.constant]
        if len({one.key for one in self.elements}) == 1:
            return self.elements[0]
        return load(self.array(builder), place, self.dtype)

    def array(self, builder: Builder) -> str:
        """Return an array of the scalars, made where they were made.

        Parameters
        ----------
        builder
            Where statements go.
        """
        if all(one.is_constant for one in self.elements):
            return builder.table(np.array([one.value for one in self.elements], self.dtype))
        if self._array is None:
            depth = builder.stack.index(self._block)
            self._array = builder.array(self.dtype, self.size, depth)
            for k, one in enumerate(self.elements):
                builder.add(Store(self._array, Index(k), one, builder.line), depth)
        return self._array


class Stored(Value):
    """An array in memory, dense, in C's order.

    Parameters
    ----------
    shape, dtype
        Of the value.
    array
        Its name in C.
    offset
        Where in it the value begins.
    """

    def __init__(
        self, shape: Sequence[int], dtype: Any, array: str, offset: Index | None = None
    ) -> None:
        super().__init__(shape, dtype)
        self.array = array
        self.offset = Index() if offset is None else offset

    def at(self, builder: Builder, index: Indices) -> Expression:
        """Return an element."""
        del builder
        return load(self.array, flat_index(self.shape, index) + self.offset, self.dtype)


class Rule(Value):
    """How an element comes from other values.

    Parameters
    ----------
    shape, dtype
        Of the value.
    element
        Gives an element from a builder and an index.
    cheap
        Whether it only looks up an element of something else.
    """

    def __init__(
        self, shape: Sequence[int], dtype: Any,
        element: Callable[[Builder, Indices], Expression], *, cheap: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(shape, dtype)
        self.element = element
        self.cheap = cheap

    def at(self, builder: Builder, index: Indices) -> Expression:
        """Return an element."""
        return self.element(builder, index)


def atoms(builder: Builder, value: Value) -> Atoms:
    """Return a value as scalars.

    Parameters
    ----------
    builder
        Where statements go.
    value
        Anything.
    """
    if isinstance(value, Atoms):
        return value
    elements = [builder.bind(value.at(builder, one)) for one in indices(value.shape)]
    return Atoms(builder, value.shape, value.dtype, elements)


def stored(builder: Builder, value: Value, target: str | None = None) -> Stored:
    """Return a value as an array in memory, which is written now unless there is one.

    Parameters
    ----------
    builder
        Where statements go.
    value
        Anything.
    target
        Array to write to in any case.
    """
    if target is None:
        if isinstance(value, Stored):
            return value
        if isinstance(value, Known):
            return Stored(value.shape, value.dtype, builder.table(value.array))
        if isinstance(value, Atoms):
            return Stored(value.shape, value.dtype, value.array(builder))
        target = builder.array(value.dtype, value.size)
    with builder.loops(value.shape) as at:
        place = flat_index(value.shape, at)
        builder.add(Store(target, place, builder.bind(value.at(builder, at)), builder.line))
    return Stored(value.shape, value.dtype, target)
