"""``simulate(..., engine="c")``: the whole loop as C, compiled, run over the reference.

What is computed is what :mod:`contourlab.simulation.loop` says, traced; so the recording has the
same columns and the same numbers, to rounding: the compiler keeps every multiplication and addition
apart, where JAX joins some, and functions such as the sine are those of the C library. A decision
that hangs on the last bit may fall otherwise: a count of an encoder, a stick or slip, a pass of an
iteration. :func:`contourlab.export.compare_engines` says whether one did, and which.

The state before the first step, the geometry of the path and random numbers come from JAX. C runs
in pieces of a tenth of a second at the most, between which an interrupt is heard.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.errors import ConfigurationError, ExportError, RefusedError
from contourlab.export.library_cache import compiled_library
from contourlab.export.loop_source import FUNCTION, LoopSource, Parts, is_code, loop_source
from contourlab.simulation.engines import ClosedLoop, Outcome
from contourlab.simulation.jax_engine import start
from contourlab.simulation.loop import Carry, chunk_size, geometry_rows, split

__all__ = ["FLAGS", "CEngine", "CompiledLoop"]

FLAGS = ("-std=c99", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
"""Flags beside the level: numbers are those of the text, floating-point traps and ``errno`` are not
asked for."""
PIECE = 0.1
"""Longest time in C without a look at interrupts [s], as far as steps take equally long."""
_KEPT = 32
"""Loops of this process that are kept ready."""


@dataclasses.dataclass(frozen=True)
class CEngine:
    """The engine ``"c"``, with its options.

    Parameters
    ----------
    optimise
        The compiler's level, 0 to 3. Numbers do not depend on it.
    folder
        Where compiled loops are kept; ``contourlab/c`` in the user's cache folder if not given.

    Raises
    ------
    ConfigurationError
        A level that there is not.
    """

    optimise: int = 3
    folder: Path | str | None = None
    name: str = dataclasses.field(default="c", init=False)

    def __post_init__(self) -> None:
        if self.optimise not in (0, 1, 2, 3):
            raise ConfigurationError(f"optimise must be 0, 1, 2 or 3, got {self.optimise!r}")

    def run(self, loop: ClosedLoop, told: Callable[[float], None]) -> Outcome:
        """Return what happened until the run was over; an interrupt is heard between pieces.

        Parameters
        ----------
        loop
            What to run.
        told
            Called with the fraction done.

        Raises
        ------
        RefusedError
            There is no compiler, or the loop uses what cannot be exported; says which and where.
        """
        needs, contour = loop.needs, loop.reference.contour
        size = chunk_size(loop.reference.n_samples)
        compiled: CompiledLoop | None = None
        for points in split(loop.reference, size, needs.preview, loop.length):
            geometry = np.asarray(_geometry(contour, points.parameter[:size], needs.derivatives))
            if compiled is None:
                carry = start(loop.machine, loop.law, contour, points, loop.key, needs)
                compiled = self._prepared(loop, carry, points, geometry)
            for _ in compiled.steps(points, geometry):
                told(min(1.0, compiled.done / loop.length))
            if compiled.over:
                break
        assert compiled is not None
        return compiled.outcome()

    def _prepared(
        self, loop: ClosedLoop, carry: Carry, points: Any, geometry: NDArray[Any]
    ) -> CompiledLoop:
        parts = Parts(
            loop.machine, loop.law, loop.disturbances, np.asarray(loop.reference.sample_time),
            np.asarray(loop.reach), carry, jax.tree.map(lambda one: one[0], points), geometry[0],
            loop.needs,
        )  # fmt: skip
        try:
            source = _kept_source(parts)
            library = compiled_library(
                source.text, flags=(f"-O{self.optimise}", *FLAGS),
                folder=None if self.folder is None else Path(self.folder),
            )  # fmt: skip
        except ExportError as error:
            raise RefusedError(f"engine c: {error}") from error
        return CompiledLoop(source, library, parts, loop.length)


@functools.partial(jax.jit, static_argnames=("order",))
def _geometry(contour: Contour, parameter: Any, order: int) -> Any:
    return geometry_rows(contour, parameter, order)


_sources: OrderedDict[Any, LoopSource] = OrderedDict()


def _kept_source(parts: Parts) -> LoopSource:
    """Return a loop as C; from memory if one of the same structure was written before."""
    leaves, structure = jax.tree.flatten((parts.given, parts.carry, parts.point, parts.geometry))
    arrays = [_array(one) for one in leaves]
    n_given = len(jax.tree.leaves(parts.given))
    key = (
        structure, parts.needs, tuple((one.shape, str(one.dtype)) for one in arrays),
        tuple(one.tobytes() for one in arrays[:n_given] if is_code(one)),
    )  # fmt: skip
    if key not in _sources:
        _sources[key] = loop_source(parts)
        while len(_sources) > _KEPT:
            _sources.popitem(last=False)
    _sources.move_to_end(key)
    return _sources[key]


def _array(leaf: Any) -> NDArray[Any]:
    if hasattr(leaf, "dtype") and jax.numpy.issubdtype(leaf.dtype, jax.dtypes.prng_key):
        raise ExportError(
            "the law, the machine or a state holds a random key of JAX's own type; keep its words "
            "(jax.random.key_data) instead"
        )
    return np.ascontiguousarray(leaf).reshape(np.shape(leaf))


class CompiledLoop:
    """A compiled loop in the middle of a run.

    Parameters
    ----------
    source
        What was compiled.
    library
        From it.
    parts
        Of the loop; the state is that before the first step.
    length
        Steps of the run at the most.
    """

    def __init__(
        self, source: LoopSource, library: ctypes.CDLL, parts: Parts, length: int
    ) -> None:  # fmt: skip
        self.source, self.length = source, length
        self._call = getattr(library, FUNCTION)
        self._call.restype = None
        self._given = [_array(one) for one in jax.tree.leaves(parts.given)]
        leaves, structure = jax.tree.flatten(parts.carry)
        self._state = [np.array(one) for one in leaves]
        place: Carry = jax.tree.unflatten(structure, range(len(leaves)))
        self._place: Any = place
        first = len(self._given)
        self._keys = [place - first for place in source.draws.keys]
        self._out = [np.empty((length, *shape), dtype) for _, shape, dtype in source.outputs]
        self._steps = 256

    @property
    def done(self) -> int:
        """Steps that were run."""
        return int(self._state[self._place.step])

    @property
    def diverged(self) -> int:
        """Row at which the run diverged, -1 if it did not."""
        return int(self._state[self._place.diverged_step])

    @property
    def finished(self) -> int:
        """Row at which the law said that it had arrived, -1 if it did not."""
        return int(self._state[self._place.finished_step])

    @property
    def over(self) -> bool:
        """Whether the run has diverged or arrived, or has its length."""
        return self.diverged >= 0 or self.finished >= 0 or self.done >= self.length

    def outcome(self) -> Outcome:
        """Return what happened so far."""
        values = {
            key: one[: self.done]
            for (key, _, _), one in zip(self.source.outputs, self._out, strict=True)
        }
        return Outcome(values, self.diverged, self.finished)

    def steps(self, points: Any, geometry: NDArray[Any]) -> Iterator[int]:
        """Run a chunk; yield after each piece, which is short enough to be waited for.

        Parameters
        ----------
        points
            The reference, and those rows of the preview.
        geometry
            A row for each step of the chunk.
        """
        size = len(geometry)
        keys, drawn = self.source.draws.draw([self._state[k] for k in self._keys], size)
        rows = [np.ascontiguousarray(one) for one in (*jax.tree.leaves(points), geometry, *drawn)]
        begin = self.done
        end = min(begin + size, self.length)
        while self.done < end and not self.over:
            done = self.done
            count = min(self._steps, end - done)
            begun = time.perf_counter()
            self._call(
                ctypes.c_int32(count), _pointers(self._given), _pointers(self._state),
                _pointers(rows, done - begin), _pointers(self._out, done),
            )  # fmt: skip
            taken = time.perf_counter() - begun
            if taken > PIECE:
                self._steps = max(1, int(count * 0.5 * PIECE / taken))
            elif taken < 0.25 * PIECE and count == self._steps:
                self._steps = 4 * self._steps
            yield self.done
        for place, key in zip(self._keys, keys, strict=True):
            self._state[place] = np.array(key)


def _pointers(arrays: Sequence[NDArray[Any]], row: int = 0) -> Any:
    """Return where arrays, or rows of them, are in memory."""
    places = [one.ctypes.data + (row * one.strides[0] if row else 0) for one in arrays]
    return (ctypes.c_void_p * max(len(places), 1))(*places)
