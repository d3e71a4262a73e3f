"""A whole loop, recorded as the law saw it: what exported code is judged by.

The loop is that of ``simulate``; beside what a recording holds, every input of the law is kept.
Replaying these open loop into the exported code must give the recorded outputs.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import part
from contourlab.contours.base import Contour
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.export.fields import Field
from contourlab.export.tracing import law_outputs
from contourlab.machines import BoundMachine, Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.recordings.sample import Sample
from contourlab.simulation.checks import as_disturbances, check_loop, check_seed
from contourlab.simulation.loop import (
    Rows,
    chunk_size,
    first_carry,
    geometry_rows,
    run_chunk,
    run_length,
    split,
)
from contourlab.simulation.run import loop_reach

__all__ = ["RecordedLoop", "record_loop"]


@dataclasses.dataclass(frozen=True, eq=False)
class RecordedLoop:
    """Inputs and outputs of a law, step by step.

    Parameters
    ----------
    law
        As it was bound.
    sample_time
        [s].
    samples
        What it was given: leading dimension is the step.
    outputs
        What it gave, by name.
    controller
        The law's configuration.
    """

    law: BoundController
    sample_time: float
    samples: Sample
    outputs: Mapping[str, NDArray[Any]]
    controller: Controller

    @property
    def n_steps(self) -> int:
        """Number of steps."""
        return int(np.shape(self.samples.time)[0])

    def first(self) -> Sample:
        """Return the first sample."""
        return self.at(0)

    def at(self, k: int) -> Sample:
        """Return one sample.

        Parameters
        ----------
        k
            Of which step.
        """
        return jax.tree.map(lambda one: one[k], self.samples)  # type: ignore[no-any-return]

    def inputs(self, fields: Sequence[Field]) -> dict[str, NDArray[Any]]:
        """Return the inputs by field name, one row for each step.

        Parameters
        ----------
        fields
            Of the exported inputs.
        """
        found = {}
        for field in fields:
            value: Any = self.samples
            for word in field.path.split("."):
                value = getattr(value, word)
            found[field.name] = np.asarray(value)
        return found


class _Watched(BoundController):
    """A law that reports what it was given."""

    law: BoundController = part()

    def init(self, sample: Sample) -> Any:
        return (
            self.law.init(sample),
            sample,
            law_outputs(self.law, sample.position, self.law.init(sample)),
        )

    def step(self, state: Any, sample: Sample) -> tuple[Any, Any]:
        command, after = self.law.step(state[0], sample)
        return command, (after, sample, law_outputs(self.law, command, after))

    def telemetry(self, state: Any) -> dict[str, Any]:
        return {"sample": state[1], "outputs": state[2]}

    def finished(self, state: Any) -> Any:
        return self.law.finished(state[0])


def record_loop(
    machine: Machine,
    controller: Controller,
    reference: Reference,
    *,
    disturbances: Sequence[Disturbance] | Disturbance = (),
    seed: int = 0,
    steps: int | None = None,
) -> RecordedLoop:
    """Return a loop as the law saw it.

    Parameters
    ----------
    machine, controller, reference
        As for ``simulate``.
    disturbances, seed
        As for ``simulate``.
    steps
        How many at the most; the whole loop if not given.

    Raises
    ------
    RefusedError
        Machine, law and contour do not go together.
    ExportError
        The loop diverges within these steps.
    """
    from contourlab.errors import ExportError

    disturbances = as_disturbances(disturbances, machine)
    check_seed(seed)
    check_loop(machine, controller, reference)
    needs = controller.needs
    law = controller.bind(reference.contour, reference.sample_time)
    n = run_length(reference, needs)
    n = n if steps is None else min(n, steps)
    size = chunk_size(n)
    watched = _Watched(law=law)
    bound, reach = machine.bind(reference.sample_time), loop_reach(reference)
    carry, parts = None, []
    for points in split(reference, size, needs.preview, max(n, reference.n_samples)):
        if carry is None:
            carry = _first(bound, watched, reference.contour, points, jax.random.key(seed), needs)
        carry, out = _chunk(
            bound, watched, reference.contour, disturbances, carry, points,
            reference.sample_time, reach, needs, size,
        )  # fmt: skip
        parts.append(jax.tree.map(np.asarray, out["telemetry"]))
        done = int(carry.finished_step)
        if len(parts) * size >= n or done >= 0 or int(carry.diverged_step) >= 0:
            break
    assert carry is not None
    if 0 <= int(carry.diverged_step) < n:
        raise ExportError(
            f"the loop diverges at {int(carry.diverged_step) * float(reference.sample_time):.4g} s:"
            " a law is exported together with a loop in which it works"
        )
    if int(carry.finished_step) >= 0:
        n = min(n, int(carry.finished_step) + 1)
    rows = jax.tree.map(lambda *x: np.concatenate(x)[:n], *parts)
    return RecordedLoop(
        law, float(reference.sample_time), rows["sample"], rows["outputs"], controller
    )


@functools.partial(jax.jit, static_argnames=("needs",))
def _first(
    machine: BoundMachine, law: BoundController, contour: Contour, points: Any, key: Any,
    needs: Needs,
) -> Any:  # fmt: skip
    geometry = geometry_rows(contour, points.parameter[:1], needs.derivatives)
    return first_carry(machine, law, Rows(points, geometry), key, needs)


@functools.partial(jax.jit, static_argnames=("needs", "n_steps"))
def _chunk(
    machine: BoundMachine, law: BoundController, contour: Contour, disturbances: Any, carry: Any,
    points: Any, sample_time: Any, reach: Any, needs: Needs, n_steps: int,
) -> Any:  # fmt: skip
    geometry = geometry_rows(contour, points.parameter[:n_steps], needs.derivatives)
    return run_chunk(
        machine, law, disturbances, carry, Rows(points, geometry), sample_time, reach,
        needs=needs, n_steps=n_steps, freeze=False,
    )  # fmt: skip
