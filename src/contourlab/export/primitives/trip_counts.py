"""How often a while loop can run: proved from its counter, or not known.

A loop is bounded if one condition of its conjunction compares a carry with a number, and every pass
moves that carry towards the number by a fixed amount, 1 or more. One whose condition is a truth
that the first pass makes false runs once. What the carry starts from and the
number need only have bounds of their own: intervals of whole numbers are followed through the
program (clipping, choices, sums).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from contourlab.export.flatten import Equation, Program, Variable
from contourlab.export.primitives.emission import Emission
from contourlab.export.values import Known

__all__ = ["greatest_trip_count"]

Interval = tuple[float, float]
_ALL: Interval = (-np.inf, np.inf)


def greatest_trip_count(emission: Emission, equation: Equation) -> int | None:
    """Return a bound on the passes of a while loop, or None.

    Parameters
    ----------
    emission
        Of the program that holds the loop.
    equation
        The loop.
    """
    params = equation.params
    n_cond, n_body = params["cond_nconsts"], params["body_nconsts"]
    condition: Program = params["cond_jaxpr"]
    body: Program = params["body_jaxpr"]
    outer = Intervals(emission.program, emission.intervals)
    start = [outer.of(emission.known(one)) for one in equation.inputs]
    carries = condition.inputs[n_cond:]
    inside: dict[Variable, Interval] = dict(
        zip(condition.inputs[:n_cond], start[:n_cond], strict=True)
    )
    for number, carry in enumerate(carries):  # a carry that never changes
        if body.outputs[number] is body.inputs[n_body + number]:
            inside[carry] = start[n_cond + n_body + number]
    known = Intervals(condition, inside)
    found: list[int] = [1] if _runs_once(condition, carries, body) else []
    for operation, left, right in _conditions(condition):
        for counter, limit, sign in ((left, right, 1), (right, left, -1)):
            if not isinstance(counter, Variable) or counter not in carries:
                continue
            number = carries.index(counter)
            step = _step(body, n_body + number, number)
            towards = {"lt": 1, "le": 1, "gt": -1, "ge": -1}[operation] * sign
            if step is None or step * towards <= 0:
                continue
            first, last = start[n_cond + n_body + number], known.of(limit)
            way = last[1] - first[0] if towards > 0 else first[1] - last[0]
            if not np.isfinite(way):
                continue
            passes = np.ceil(way / abs(step)) if operation in ("lt", "gt") else (
                np.floor(way / abs(step)) + 1)  # fmt: skip
            found.append(max(int(passes), 0))
    return min(found, default=None)


def _runs_once(condition: Program, carries: Any, body: Program) -> bool:
    """Return whether a condition is a carry that the first pass makes false."""
    made = {equation.outputs[0]: equation for equation in condition.equations}
    wanted = list(condition.outputs)
    while wanted:
        one = wanted.pop()
        equation = made.get(one) if isinstance(one, Variable) else None
        stops = False
        if equation is not None and equation.primitive == "and":
            wanted += equation.inputs
        elif equation is not None and equation.primitive == "not":
            one, stops = equation.inputs[0], True
        if isinstance(one, Variable) and one in carries:
            after = body.outputs[carries.index(one)]
            if (
                isinstance(after, Known)
                and after.size == 1
                and bool(after.array.ravel()[0]) is stops
            ):
                return True
    return False


def _conditions(program: Program) -> list[tuple[str, Any, Any]]:
    """Return the comparisons that all must hold."""
    made = {equation.outputs[0]: equation for equation in program.equations}
    found: list[tuple[str, Any, Any]] = []
    wanted = list(program.outputs)
    while wanted:
        one = wanted.pop()
        equation = made.get(one) if isinstance(one, Variable) else None
        if equation is None:
            continue
        if equation.primitive in ("and", "convert_element_type", "reshape", "squeeze"):
            wanted += equation.inputs
        elif equation.primitive in ("lt", "le", "gt", "ge"):
            left, right = equation.inputs
            found.append((equation.primitive, left, right))
    return found


def _step(body: Program, position: int, number: int) -> int | None:
    """Return by how much every pass changes a carry of whole numbers."""
    out, carry = body.outputs[number], body.inputs[position]
    made = {equation.outputs[0]: equation for equation in body.equations}
    equation = made.get(out) if isinstance(out, Variable) else None
    if equation is None or equation.primitive not in ("add", "sub"):
        return None
    a, b = equation.inputs
    if equation.primitive == "add" and b is carry:
        a, b = b, a
    if a is not carry or not isinstance(b, Known) or b.size != 1 or b.dtype.kind not in "iu":
        return None
    value = int(b.array.ravel()[0])
    return value if equation.primitive == "add" else -value


class Intervals:
    """Bounds of the whole numbers of a program.

    Parameters
    ----------
    program
        Whose.
    inputs
        Bounds of its inputs, as far as they are known; filled with what is found.
    """

    def __init__(self, program: Program, inputs: dict[Variable, Interval]) -> None:
        self.made = {out: one for one in program.equations for out in one.outputs}
        self.found = inputs

    def of(self, atom: Any, depth: int = 0) -> Interval:
        """Return the bounds of a variable.

        Parameters
        ----------
        atom
            A variable or known numbers.
        depth
            How many equations back the search is; it ends after some.
        """
        if isinstance(atom, Known):
            if atom.size == 0 or atom.dtype.kind not in "iu":
                return _ALL
            return float(atom.array.min()), float(atom.array.max())
        if atom not in self.found:
            self.found[atom] = self._made(atom, depth) if depth < 40 else _ALL
        return self.found[atom]

    def _made(self, atom: Variable, depth: int) -> Interval:
        equation = self.made.get(atom)
        if equation is None or atom.dtype is None or np.dtype(atom.dtype).kind not in "iu":
            return _ALL
        inputs = [self.of(one, depth + 1) for one in equation.inputs]
        kinds = [np.dtype(one.dtype).kind for one in equation.inputs if one.dtype is not None]
        name = equation.primitive
        if name == "convert_element_type":
            if kinds == ["b"]:
                return 0.0, 1.0
            return inputs[0] if _fits(inputs[0], atom.dtype) else _ALL
        if name in ("broadcast_in_dim", "reshape", "squeeze", "slice", "transpose", "rev",
                    "gather", "dynamic_slice"):  # fmt: skip
            return inputs[0]
        if name == "max":
            return max(a for a, _ in inputs), max(b for _, b in inputs)
        if name == "min":
            return min(a for a, _ in inputs), min(b for _, b in inputs)
        if name == "clamp":
            low, _, high = inputs
            return low[0], high[1]
        if name == "select_n":
            return min(a for a, _ in inputs[1:]), max(b for _, b in inputs[1:])
        if name == "mul":
            ends = [a * b for a in inputs[0] for b in inputs[1]]
            found = (min(ends), max(ends)) if np.all(np.isfinite(ends)) else _ALL
            return found if _fits(found, atom.dtype) else _ALL
        if name in ("concatenate", "stack"):
            return min(a for a, _ in inputs), max(b for _, b in inputs)
        found = _ALL
        if name == "add":
            found = inputs[0][0] + inputs[1][0], inputs[0][1] + inputs[1][1]
        elif name == "sub":
            found = inputs[0][0] - inputs[1][1], inputs[0][1] - inputs[1][0]
        return found if _fits(found, atom.dtype) else _ALL


def _fits(interval: Interval, dtype: Any) -> bool:
    info = np.iinfo(dtype)
    return bool(info.min <= interval[0] and interval[1] <= info.max)
