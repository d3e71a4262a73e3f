"""Which elements of arrays are zero by construction, whatever the numbers are.

Laws write dynamics and constraints into matrices that are mostly zeros: a zero array with a few
entries set, identities, padding. Where such zeros end up is followed through moves, products and
sums. Products with them are left out of sums; they would add nothing. Only a number that is not
finite makes a difference: zero times NaN is NaN, and what is left out does not spread it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.export.flatten import Equation
from contourlab.export.values import Known, Value

__all__ = ["Pattern", "filled", "pattern_after"]

Pattern = NDArray[np.bool_]
"""True where an element may be anything, False where it is zero."""

LARGEST = 20_000
"""Elements of arrays that are looked at."""


def filled(value: Value) -> Pattern | None:
    """Return where a value may be other than zero; None if anywhere.

    Parameters
    ----------
    value
        Of a variable.
    """
    if value.pattern is None and isinstance(value, Known) and value.size <= LARGEST:
        value.pattern = np.asarray(value.array != 0)
    pattern = value.pattern
    return None if pattern is None or pattern.all() else pattern


def pattern_after(equation: Equation, args: list[Value]) -> Pattern | None:
    """Return where the first result of an equation may be other than zero; None if anywhere.

    Parameters
    ----------
    equation
        Of a program.
    args
        Values of its operands.
    """
    out = equation.outputs[0]
    if np.prod(out.shape, dtype=int) > LARGEST or len(equation.outputs) > 1:
        return None
    rule = _RULES.get(equation.primitive)
    if rule is None or not any(filled(arg) is not None for arg in args):
        return None
    patterns = [
        one if (one := filled(arg)) is not None else np.ones(arg.shape, bool) for arg in args
    ]
    found = rule(equation, args, patterns)
    if found is None or np.all(found):
        return None
    return np.array(np.broadcast_to(found, out.shape))


def _moved(move: Callable[..., Any]) -> Any:
    return lambda equation, args, patterns: move(patterns[0], equation.params, equation.outputs[0])


def _broadcast(one: Pattern, params: Any, out: Any) -> Pattern:
    shape = [1] * len(out.shape)
    for k, n in zip(params["broadcast_dimensions"], one.shape, strict=True):
        shape[k] = n
    return np.broadcast_to(one.reshape(shape), out.shape)


def _slice(one: Pattern, params: Any, out: Any) -> Pattern:
    del out
    steps = params["strides"] or (1,) * one.ndim
    return one[tuple(map(slice, params["start_indices"], params["limit_indices"], steps))]


def _either(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    del args
    return np.asarray(np.logical_or(*patterns))


def _both(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    del args
    return np.asarray(np.logical_and(*patterns))


def _first(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    del args
    return np.broadcast_to(patterns[0], equation.outputs[0].shape)


def _chosen(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    found = patterns[1]
    for one in patterns[2:]:
        found = np.asarray(found | one)
    return found


def _concatenated(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    return np.concatenate(patterns, equation.params["dimension"])


def _stacked(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    axis = equation.params.get("axis", equation.params.get("dimension", 0))
    return np.stack(patterns, axis)


def _padded(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern | None:
    rules = equation.params["padding_config"]
    if patterns[1].any() or any(between or min(low, high) < 0 for low, high, between in rules):
        return None
    return np.pad(patterns[0], [(low, high) for low, high, _ in rules])


def _scattered(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern | None:
    if not isinstance(args[1], Known):
        return None
    import jax

    params = equation.params | {"update_jaxpr": None, "update_consts": ()}
    operand, updates = (patterns[k].astype(np.float64) for k in (0, 2))
    make = jax.lax.scatter if equation.primitive == "scatter" else jax.lax.scatter_add
    found = make(
        operand, args[1].array, updates, params["dimension_numbers"],
        indices_are_sorted=params["indices_are_sorted"], unique_indices=params["unique_indices"],
        mode=params["mode"],
    )  # fmt: skip
    pattern: Pattern = np.asarray(found) != 0
    return pattern


def _product(equation: Equation, args: Any, patterns: list[Pattern]) -> Pattern:
    (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
    letters = iter("abcdefghijklmnopqrstuvwxyz")
    left, right = ([""] * one.ndim for one in patterns)
    batch = []
    for k, n in zip(left_batch, right_batch, strict=True):
        left[k] = right[n] = next(letters)
        batch.append(left[k])
    for k, n in zip(left_sum, right_sum, strict=True):
        left[k] = right[n] = next(letters)
    free = []
    for side in (left, right):
        for k, letter in enumerate(side):
            if not letter:
                side[k] = next(letters)
                free.append(side[k])
    text = f"{''.join(left)},{''.join(right)}->{''.join(batch + free)}"
    return np.asarray(np.einsum(text, *(one.astype(float) for one in patterns)) > 0)


_RULES: dict[str, Any] = {
    "reshape": _moved(lambda one, params, out: one.reshape(out.shape)),
    "squeeze": _moved(lambda one, params, out: one.reshape(out.shape)),
    "expand_dims": _moved(lambda one, params, out: one.reshape(out.shape)),
    "transpose": _moved(lambda one, params, out: one.transpose(params["permutation"])),
    "rev": _moved(lambda one, params, out: np.flip(one, params["dimensions"])),
    "broadcast_in_dim": _moved(_broadcast),
    "slice": _moved(_slice),
    "reduce_sum": _moved(lambda one, params, out: np.asarray(one.any(axis=tuple(params["axes"])))),
    "neg": _first, "abs": _first, "convert_element_type": _first, "div": _first,
    "mul": _both, "add": _either, "sub": _either, "add_any": _either,
    "select_n": _chosen, "concatenate": _concatenated, "stack": _stacked, "pad": _padded,
    "scatter": _scattered, "scatter-add": _scattered, "scatter_add": _scattered,
    "dot_general": _product,
}  # fmt: skip
