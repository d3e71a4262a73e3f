"""The loop itself: a chunk of control steps, for one machine or, under ``vmap``, for many.

Row k: measure at t_k, step, and command k (after the machine's computing delay) acts on
[t_k, t_k+1). The loop runs in chunks of fixed size, so that a longer run does not recompile, long
work shows progress, and a run that diverges stops early.

A run has *diverged* when a position is not finite or is further from its reference than
:data:`DIVERGED_FACTOR` times the extent of the reference (at least 1 m). A diverged lane freezes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.controllers.base import BoundController, Needs
from contourlab.machines import BoundMachine, Disturbance
from contourlab.recordings.reference import Reference, ReferencePoint
from contourlab.recordings.sample import Sample
from contourlab.typing import Array, Scalar

__all__ = [
    "Carry",
    "Rows",
    "chunk_size",
    "control_step",
    "end_step",
    "first_carry",
    "geometry_rows",
    "outputs_of",
    "run_chunk",
    "run_length",
    "split",
]

DIVERGED_FACTOR = 10.0
CHUNKS = (256, 1024, 4096, 16384)
OWN_TIME = 4
"""How much longer than its reference a law that plans its own time may take."""


class Carry(eqx.Module):
    """What one control step hands to the next."""

    machine: Any
    law: Any
    step: Array
    """Number of the next row, int32."""
    diverged_step: Array
    """Row at which the run diverged, -1 if it did not; int32."""
    finished_step: Array
    """Row at which the law said that it had arrived, -1 if it did not; int32."""


class Rows(eqx.Module):
    """One chunk of the reference, with ``preview`` rows more than there are steps."""

    points: ReferencePoint
    geometry: Array
    """(n_steps, order + 1, n_coordinates)."""


def chunk_size(n_samples: int) -> int:
    """Return the largest standard chunk that is not longer than a run (at least the smallest).

    Parameters
    ----------
    n_samples
        Length of the run.
    """
    return max((size for size in CHUNKS if size <= n_samples), default=CHUNKS[0])


def run_length(reference: Reference, needs: Needs) -> int:
    """Return how many samples a run may take: those of its reference.

    A law that plans its own time may take :data:`OWN_TIME` times as many.

    Parameters
    ----------
    reference
        The whole record.
    needs
        Of the law.
    """
    return reference.n_samples * (OWN_TIME if needs.own_time else 1)


def split(
    reference: Reference, size: int, preview: int, length: int | None = None
) -> list[ReferencePoint]:
    """Return a reference in chunks of ``size + preview`` rows, padded with its rest point.

    Parameters
    ----------
    reference
        The whole record.
    size
        Steps per chunk.
    preview
        Rows ahead.
    length
        Samples of the run, not fewer than the reference has; as many if not given.
    """
    length = reference.n_samples if length is None else length

    def rows_of(rows: Any, rest: Any, first: int) -> Any:
        found = np.asarray(rows)[first : first + size + preview]
        lacking = size + preview - len(found)
        if not lacking:
            return found
        return np.concatenate([found, np.broadcast_to(rest, (lacking, *found.shape[1:]))])

    points, rest = reference.points, reference.rest_point()
    return [
        jax.tree.map(lambda x, y, k=k: rows_of(x, y, k * size), points, rest)
        for k in range(-(-length // size))
    ]


def geometry_rows(contour: Contour, parameter: Array, order: int) -> Array:
    """Return contour derivatives at many parameters, (n, order + 1, n_coordinates).

    Parameters
    ----------
    contour
        The path.
    parameter
        Shape (n,).
    order
        Highest derivative; -1 gives no rows.
    """
    if order < 0:
        return jnp.zeros((parameter.shape[0], 0, contour.n_axes))
    return jax.vmap(lambda p: contour.derivatives(p, order))(parameter)


def _sample(
    machine: BoundMachine, state: Any, rows: Rows, at: Array, time: Scalar, preview: int
) -> Sample:
    measurement = machine.measure(state)

    def ahead(x: Array) -> Array:
        return jax.lax.dynamic_slice_in_dim(x, at + 1, preview)

    return Sample(
        time=time,
        reference=jax.tree.map(lambda x: x[at], rows.points),
        geometry=rows.geometry[at],
        preview=jax.tree.map(ahead, rows.points),
        position=measurement.position,
        velocity=measurement.velocity,
    )


def first_carry(
    machine: BoundMachine, law: BoundController, rows: Rows, key: Array, needs: Needs
) -> Carry:
    """Return the carry before the first step: the machine at rest at the first reference point.

    Parameters
    ----------
    machine, law
        Both bound.
    rows
        The first chunk.
    key
        Key of the run's random numbers.
    needs
        Of the law.
    """
    rows = jax.tree.map(jnp.asarray, rows)
    state = machine.init(rows.points.position[0], key)
    zero = jnp.zeros((), jnp.int32)
    sample = _sample(machine, state, rows, zero, jnp.zeros(()), needs.preview)
    return Carry(state, law.init(sample), zero, zero - 1, zero - 1)


def control_step(
    machine: BoundMachine,
    law: BoundController,
    disturbances: tuple[Disturbance, ...],
    carry: Carry,
    sample: Sample,
    reach: Scalar,
    *,
    freeze: bool,
) -> tuple[Carry, dict[str, Any]]:
    """Return the carry after one step, and what happened in it.

    Parameters
    ----------
    machine, law, disturbances
        The closed loop.
    carry
        From the step before.
    sample
        What the law is given at this instant.
    reach
        A position further than this from its reference has diverged [m].
    freeze
        Whether a diverged run keeps its last state; static.
    """
    n_axes = sample.position.shape[-1]
    actual = machine.true_position(carry.machine)
    command, law_state = law.step(carry.law, sample)
    disturbance = sum((d.value(sample.time, n_axes) for d in disturbances), start=jnp.zeros(n_axes))
    machine_state = machine.advance(carry.machine, command, disturbance)
    lost = ~jnp.all(jnp.abs(actual - sample.reference.position) <= reach)  # NaN is lost too
    diverged = jnp.where(lost & (carry.diverged_step < 0), carry.step, carry.diverged_step)
    done = law.finished(law_state) & (carry.finished_step < 0)
    finished = jnp.where(done, carry.step, carry.finished_step)
    if freeze:
        keep = (diverged >= 0) | (carry.finished_step >= 0)
        machine_state, law_state = jax.tree.map(
            lambda new, old: jnp.where(keep, old, new),
            (machine_state, law_state),
            (carry.machine, carry.law),
        )
    out = {
        "actual": actual,
        "measured": sample.position,
        "command": command,
        "telemetry": dict(law.telemetry(law_state)),
        "status": law.status(law_state),
    }
    return Carry(machine_state, law_state, carry.step + 1, diverged, finished), out


def run_chunk(
    machine: BoundMachine,
    law: BoundController,
    disturbances: tuple[Disturbance, ...],
    carry: Carry,
    rows: Rows,
    sample_time: Scalar,
    reach: Scalar,
    *,
    needs: Needs,
    n_steps: int,
    freeze: bool,
) -> tuple[Carry, dict[str, Any]]:
    """Return the carry after a chunk of steps, and what happened at each.

    Parameters
    ----------
    machine, law, disturbances
        The closed loop.
    carry
        From the chunk before.
    rows
        The reference in this chunk.
    sample_time
        [s].
    reach
        A position further than this from its reference has diverged [m].
    needs
        Of the law; static.
    n_steps
        Steps in the chunk; static.
    freeze
        Whether a diverged run keeps its last state (needed for lanes of ``vmap``); static.
    """
    rows = jax.tree.map(jnp.asarray, rows)

    def step(carry: Carry, at: Array) -> tuple[Carry, dict[str, Any]]:
        time = carry.step * sample_time
        sample = _sample(machine, carry.machine, rows, at, time, needs.preview)
        return control_step(machine, law, disturbances, carry, sample, reach, freeze=freeze)

    return jax.lax.scan(step, carry, jnp.arange(n_steps, dtype=jnp.int32))


def end_step(carry: Carry, n_samples: Array | np.int32) -> Array:
    """Return the number of rows that count: up to where a run diverged, arrived, or ended.

    Parameters
    ----------
    carry
        After some chunk.
    n_samples
        Length of the whole run.
    """
    lost, done = carry.diverged_step, carry.finished_step
    end = jnp.where(lost < 0, n_samples, lost)
    return jnp.minimum(end, jnp.where(done < 0, n_samples, done + 1))


def outputs_of(out: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Return a chunk's outputs as NumPy arrays, telemetry under ``telemetry.name``.

    Parameters
    ----------
    out
        As ``run_chunk`` gave it.
    """
    flat = {key: np.asarray(value) for key, value in out.items() if key != "telemetry"}
    flat.update({f"telemetry.{k}": np.asarray(v) for k, v in out["telemetry"].items()})
    return flat
