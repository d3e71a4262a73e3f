"""Estimators run over many samples at once, and timed in a loop.

An estimator without a state is evaluated in one batch; one with a state is scanned, in chunks of
fixed size so that a longer motion does not recompile, several offsets and resolutions abreast.
"""

from __future__ import annotations

import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contour_errors.accuracy_samples import Motion
from contourlab.contour_errors.base import Estimator
from contourlab.recordings.reference import ReferencePoint
from contourlab.recordings.sample import Sample

__all__ = ["has_state", "nanoseconds_per_call", "run_estimator"]

Values = NDArray[Any]

_CHUNKS = (256, 2048, 16384)
_LOOP_ROWS = 512
"""Samples that the timed loop goes through again and again."""
_LEAST_CALLS = 2048
_SHORTEST = 4e-3
"""Of a timed run [s]: the clock and the call from Python are then below a percent."""
_REPEATS = 5


def has_state(bound: Estimator, motion: Motion) -> bool:
    """Return whether an estimator remembers anything from sample to sample.

    Parameters
    ----------
    bound
        As ``bind`` returned it.
    motion
        Any, of two rows or more.
    """
    first = _sample(_cut(_shared(bound, motion), 0), motion.position[0, 0], motion.velocity[0, 0])
    return bool(jax.tree.leaves(jax.eval_shape(bound.init, first)))


def run_estimator(bound: Estimator, motion: Motion, resolution: Values, *, state: bool) -> Values:
    """Return the estimates of a motion, shape (n_offsets, n_resolutions, n, n_axes) [m].

    Parameters
    ----------
    bound
        As ``bind`` returned it.
    motion
        What it sees.
    resolution
        Of the encoders, shape (n_resolutions,) [m].
    state
        Whether it has one; ``has_state``.
    """
    shared = _shared(bound, motion)
    position, velocity = motion.measured(resolution)
    size = next((size for size in _CHUNKS if motion.n_rows <= size), _CHUNKS[-1])
    carried: Any = None
    if state:
        first = _cut(shared, 0)
        carried = _initial(bound, first, position[:, 0], velocity[:, 0])
    blocks = []
    for start in range(0, motion.n_rows, size):
        stop = min(start + size, motion.n_rows)
        rows = jax.tree.map(lambda x, a=start, b=stop: _pad(x[a:b], size, 0), shared)
        lanes = [_pad(x[:, start:stop], size, 1) for x in (position, velocity)]
        if state:
            estimates, carried = _scanned(bound, carried, rows, *lanes)
        else:
            estimates = _at_once(bound, rows, *lanes)
        blocks.append(np.asarray(estimates)[:, : stop - start])
    found = np.concatenate(blocks, axis=1)
    return found.reshape(len(motion.position), len(resolution), *found.shape[1:])


def nanoseconds_per_call(bound: Estimator, motion: Motion) -> float:
    """Return what one call costs in a compiled loop on this machine [ns].

    The loop scans 512 samples of the motion, read from memory, over and over, and keeps the sum of
    the estimates; the best of five runs counts. Reading the samples and the loop are included, the
    contour's derivatives at the reference are not: a control loop has them before it starts.

    Parameters
    ----------
    bound
        As ``bind`` returned it.
    motion
        What it sees; the first offset is taken.
    """
    at = np.arange(_LOOP_ROWS) % motion.n_rows
    shared = jax.tree.map(lambda x: jnp.asarray(x[at]), _shared(bound, motion))
    position, velocity = jnp.asarray(motion.position[0][at]), jnp.asarray(motion.velocity[0][at])
    on_device = jax.tree.map(jnp.asarray, bound)
    times = 1

    def run(times: int) -> float:
        begin = time.perf_counter()
        _looped(on_device, shared, position, velocity, times).block_until_ready()
        return time.perf_counter() - begin

    run(times)  # compiles
    taken = run(times)
    times = max(_LEAST_CALLS // _LOOP_ROWS, int(np.ceil(_SHORTEST / max(taken, 1e-7))))
    taken = min(run(times) for _ in range(_REPEATS))
    return 1e9 * taken / (times * _LOOP_ROWS)


def _shared(bound: Estimator, motion: Motion) -> tuple[Values, ReferencePoint, Values]:
    # what the lanes of a motion have in common
    order = bound.needs.derivatives
    return (motion.time, motion.reference, motion.geometry[:, : order + 1])


def _cut(shared: Any, row: int) -> Any:
    return jax.tree.map(lambda x: x[row], shared)


def _pad(rows: Values, size: int, axis: int) -> Values:
    missing = size - rows.shape[axis]
    return np.pad(rows, [(0, missing if k == axis else 0) for k in range(rows.ndim)], mode="edge")


def _sample(row: Any, position: Any, velocity: Any) -> Sample:
    moment, reference, geometry = row
    ahead = jax.tree.map(lambda x: jnp.zeros((0, *jnp.shape(x))), reference)
    return Sample(moment, reference, geometry, ahead, position, velocity)


@jax.jit
def _initial(bound: Estimator, first: Any, position: Any, velocity: Any) -> Any:
    return jax.vmap(lambda p, v: bound.init(_sample(first, p, v)))(position, velocity)


@jax.jit
def _scanned(bound: Estimator, states: Any, rows: Any, position: Any, velocity: Any) -> Any:
    def lane(state: Any, position: Any, velocity: Any) -> Any:
        def one(state: Any, row: Any) -> Any:
            estimate, state = bound.step(state, _sample(*row))
            return state, estimate

        state, estimates = jax.lax.scan(one, state, (rows, position, velocity))
        return estimates, state

    return jax.vmap(lane)(states, position, velocity)


@jax.jit
def _at_once(bound: Estimator, rows: Any, position: Any, velocity: Any) -> Any:
    def one(row: Any, p: Any, v: Any) -> Any:
        sample = _sample(row, p, v)
        return bound.step(bound.init(sample), sample)[0]

    return jax.vmap(jax.vmap(one), in_axes=(None, 0, 0))(rows, position, velocity)


@jax.jit
def _looped(bound: Estimator, rows: Any, position: Any, velocity: Any, times: Any) -> Any:
    def one(carry: Any, row: Any) -> Any:
        state, total = carry
        estimate, state = bound.step(state, _sample(*row))
        return (state, total + estimate), None

    def again(_: Any, carry: Any) -> Any:
        return jax.lax.scan(one, carry, (rows, position, velocity))[0]

    first = jax.tree.map(lambda x: x[0], (rows, position, velocity))
    begin = (bound.init(_sample(*first)), jnp.zeros(position.shape[1]))
    return jax.lax.fori_loop(0, times, again, begin)[1]
