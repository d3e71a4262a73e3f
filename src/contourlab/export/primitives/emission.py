"""Where equations become statements: the values of variables, and when a value is carried out.

A rule for the elements of a large array is kept as a rule only if it is used once, by something
that reads each element once; otherwise it is carried out where it is made.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from contourlab.errors import ExportError
from contourlab.export.flatten import Equation, Program, Variable, unsupported_type
from contourlab.export.statements import Builder
from contourlab.export.values import Atoms, Indices, Known, Rule, Value, atoms, stored
from contourlab.export.zeros import pattern_after

__all__ = ["Emission", "run"]

_READ_ONCE = {
    "reshape", "transpose", "squeeze", "slice", "rev", "expand_dims", "concatenate", "stack",
    "reduce_sum", "reduce_max", "reduce_min", "reduce_prod", "reduce_or", "reduce_and",
    "broadcast_in_dim", "pad", "split", "argmax", "argmin",
}  # fmt: skip

Handler = Callable[["Emission", Equation, list[Value]], Sequence[Value]]


class Emission:
    """The state of writing one program.

    Parameters
    ----------
    builder
        Where statements go.
    program
        What is written.
    inputs
        Values of its inputs.
    """

    def __init__(self, builder: Builder, program: Program, inputs: Sequence[Value]) -> None:
        self.builder = builder
        self.program = program
        self.values: dict[Variable, Value] = dict(zip(program.inputs, inputs, strict=True))
        self.consumers = program.consumers()
        self.intervals: dict[Variable, tuple[float, float]] = {}

    def value(self, atom: Variable | Known) -> Value:
        """Return the value of an operand.

        Parameters
        ----------
        atom
            A variable or known numbers.
        """
        return self.values[atom] if isinstance(atom, Variable) else atom

    def known(self, atom: Variable | Known) -> Variable | Known:
        """Return an operand as numbers, if they are known by now.

        Parameters
        ----------
        atom
            A variable or known numbers.
        """
        value = self.value(atom)
        return value if isinstance(value, Known) else atom

    def _kept(self, out: Variable) -> bool:
        """Return whether a rule for a variable may stay one."""
        from contourlab.export.primitives.elementwise import ELEMENTWISE

        users = self.consumers.get(out, [])
        if len(users) != 1 or users[0] is None:
            return False
        user = users[0]
        if user.primitive == "broadcast_in_dim" or user.primitive in ELEMENTWISE:
            # repeated, it would be computed for every copy
            return bool(np.prod(user.outputs[0].shape) == np.prod(out.shape))
        return user.primitive in _READ_ONCE

    def rule(
        self, out: Variable, element: Callable[[Builder, Indices], Any], *, cheap: bool = False
    ) -> Value:
        """Return the value of a variable whose elements follow a rule.

        Parameters
        ----------
        out
            The variable.
        element
            Gives an element from a builder and an index.
        cheap
            Whether the rule only looks up an element of something else.
        """
        value = Rule(out.shape, out.dtype, element, cheap=cheap)
        if value.small:
            return atoms(self.builder, value)
        if cheap or self._kept(out):
            return value
        return stored(self.builder, value)

    def scalars(self, out: Variable, elements: list[Any]) -> Atoms:
        """Return scalars as the value of a variable.

        Parameters
        ----------
        out
            The variable.
        elements
            Expressions in the order of memory.
        """
        bound = [self.builder.bind(one) for one in elements]
        return Atoms(self.builder, out.shape, out.dtype, bound)


def _known(value: Value) -> Value:
    """Return a value as numbers, where all its elements turned out to be constant."""
    if value.size == 0:
        return Known(np.zeros(value.shape, value.dtype))
    if isinstance(value, Atoms) and all(one.is_constant for one in value.elements):
        return Known(
            np.array([one.value for one in value.elements], value.dtype).reshape(value.shape)
        )
    return value


def run(builder: Builder, program: Program, inputs: Sequence[Value]) -> list[Value]:
    """Write a program and return the values of its outputs.

    Parameters
    ----------
    builder
        Where statements go.
    program
        What to write.
    inputs
        Values of its inputs.

    Raises
    ------
    ExportError
        A primitive or a type that cannot be exported; names it and the line of the law.
    """
    from contourlab.export.primitives.table import handler

    emission = Emission(builder, program, inputs)
    outside = builder.line
    for equation in program.equations:
        builder.line = equation.line or outside
        for out in equation.outputs:
            if wrong := unsupported_type(out):
                raise ExportError(
                    f"{equation.primitive} gives numbers of type {wrong}, which cannot be "
                    f"exported ({equation.line or 'no line known'})"
                )
        args = [emission.value(one) for one in equation.inputs]
        found = handler(equation)(emission, equation, args)
        pattern = pattern_after(equation, args)
        if pattern is not None:
            found[0].pattern = pattern
        for out, value in zip(equation.outputs, found, strict=True):
            emission.values[out] = _known(value)
    builder.line = outside
    return [emission.value(one) for one in program.outputs]
