"""Random numbers of a loop, drawn before it runs.

The keys of a run follow one from the other and from nothing else. So the equations of a control
step fall in two: those that depend on the keys alone, which JAX carries out beforehand, giving a
row of numbers for each step; and the rest, which takes that row. The numbers are those that the
loop in JAX would draw, to the last bit.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend import core
from numpy.typing import NDArray

from contourlab.errors import ExportError

__all__ = ["Draws", "separate_draws"]


@dataclasses.dataclass(frozen=True, eq=False)
class Draws:
    """A step without its random numbers, and what gives them.

    Parameters
    ----------
    step
        Of the inputs named in ``leading`` and of the step's inputs but for the keys.
    keys
        Places of the keys among the inputs of the whole step.
    key_outputs
        Places of the new keys among its outputs.
    shapes
        Shape and type of the numbers that are drawn for each step.
    leading
        What stands before the inputs of ``step``: the number of a draw, or an array that is known.
    known
        From the keys to the new keys and the numbers of one step; None if nothing is drawn.
    """

    step: Any
    keys: tuple[int, ...]
    key_outputs: tuple[int, ...]
    shapes: tuple[tuple[tuple[int, ...], Any], ...]
    leading: tuple[int | NDArray[Any], ...]
    known: Any

    def draw(self, keys: Sequence[Any], n_steps: int) -> tuple[list[Any], list[NDArray[Any]]]:
        """Return the keys after some steps, and the numbers of each.

        Parameters
        ----------
        keys
            Before them.
        n_steps
            How many.
        """
        if self.known is None:
            return [], []
        after, rows = self._program(n_steps)(list(keys))
        return list(after), [np.asarray(row) for row in rows]

    def _program(self, n_steps: int) -> Any:
        return _drawing(self, n_steps)


@functools.lru_cache(maxsize=64)
def _drawing(draws: Draws, n_steps: int) -> Any:
    n_keys = len(draws.keys)

    def one(keys: Any, _: Any) -> Any:
        found = jax.core.eval_jaxpr(draws.known.jaxpr, draws.known.consts, *keys)
        return found[:n_keys], found[n_keys:]

    return jax.jit(lambda keys: jax.lax.scan(one, keys, length=n_steps))


def separate_draws(closed: Any, carries: Sequence[tuple[int, int]]) -> Draws:
    """Return a step without what its keys alone decide.

    Parameters
    ----------
    closed
        Jaxpr of the step.
    carries
        Places, among its inputs and among its outputs, of what one step hands to the next.

    Raises
    ------
    ExportError
        What is drawn depends on the run.
    """
    kinds = [getattr(var.aval, "dtype", None) for var in closed.jaxpr.invars]
    keys = [(a, b) for a, b in carries if kinds[a] == np.uint32]
    while keys:
        known, rest, unknown, drawn = _split(closed, [a for a, _ in keys])
        kept = [(a, b) for a, b in keys if not unknown[b]]
        if len(kept) == len(keys):
            break
        keys = kept
    if not keys:
        return Draws(closed, (), (), (), (), None)
    for aval in drawn:
        if jnp.issubdtype(aval.dtype, jax.dtypes.prng_key):
            raise ExportError(
                "a random key is used together with the state of the run: only numbers that depend "
                "on the keys alone can be drawn beforehand"
            )
    outputs = [known.jaxpr.outvars[_place(unknown, b)] for _, b in keys]
    numbers = list(known.jaxpr.outvars[len(known.jaxpr.outvars) - len(drawn) :])
    constants, which = _constant_outputs(known, numbers)
    leading: list[int | NDArray[Any]] = []
    kept_numbers: list[Any] = []
    for number, constant in zip(numbers, which, strict=True):
        if constant is None:
            leading.append(len(kept_numbers))
            kept_numbers.append(number)
        else:
            leading.append(constants[constant])
    program = core.ClosedJaxpr(
        known.jaxpr.replace(outvars=[*outputs, *kept_numbers]), known.consts
    )  # fmt: skip
    shapes = tuple((tuple(v.aval.shape), np.dtype(v.aval.dtype)) for v in kept_numbers)
    return Draws(
        rest, tuple(a for a, _ in keys), tuple(b for _, b in keys), shapes, tuple(leading), program
    )


def _split(closed: Any, keys: list[int]) -> Any:
    from jax._src.interpreters import partial_eval

    unknown = [k not in keys for k in range(len(closed.jaxpr.invars))]
    return partial_eval.partial_eval_jaxpr_nounits(closed, unknown, instantiate=False)


def _place(unknown: Sequence[bool], output: int) -> int:
    """Return where a known output of the whole stands among the known ones."""
    return sum(not one for one in unknown[:output])


def _constant_outputs(known: Any, numbers: list[Any]) -> tuple[list[Any], list[int | None]]:
    """Return what of the numbers does not even depend on the keys."""
    from jax._src.interpreters import partial_eval

    asked = core.ClosedJaxpr(known.jaxpr.replace(outvars=list(numbers)), known.consts)
    every = [True] * len(known.jaxpr.invars)
    fixed, _, unknown, _ = partial_eval.partial_eval_jaxpr_nounits(asked, every, instantiate=False)
    values = [np.asarray(one) for one in jax.core.eval_jaxpr(fixed.jaxpr, fixed.consts)]
    which: list[int | None] = []
    for number, one in enumerate(unknown):
        which.append(None if one else _place(unknown, number))
    return values, which
