"""One closed loop: a machine, a law and a reference give a recording."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.feedrate import Plan
from contourlab.machines import BoundMachine, Disturbance, Machine
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation.checks import (
    as_disturbances,
    as_reference,
    check_loop,
    check_seed,
    snake_case,
)
from contourlab.simulation.loop import (
    DIVERGED_FACTOR,
    Carry,
    Rows,
    chunk_size,
    first_carry,
    geometry_rows,
    outputs_of,
    run_chunk,
    run_length,
    split,
)
from contourlab.simulation.result import build_recording

__all__ = ["loop_reach", "simulate"]

Progress = Callable[[float], None]


def simulate(
    machine: Machine,
    controller: Controller,
    reference: Reference | Plan,
    *,
    disturbances: Sequence[Disturbance] | Disturbance = (),
    seed: int = 0,
    name: str | None = None,
    scenario: str = "",
    progress: Progress | None = None,
) -> Recording:
    """Run one closed loop and return its recording, judged by the exact contour error.

    The machine starts at rest at the first reference point. Row k of the recording is the state at
    t_k and the command that the law gave there. A law that plans its own time ends the run when it
    has arrived, before the reference ends or after; its reference is then the place on the contour
    where it is by its own plan.

    Parameters
    ----------
    machine
        The machine, with everything that the law does not know.
    controller
        A control law's configuration.
    reference
        What is asked of the axes: a reference, or a plan that holds one.
    disturbances
        Efforts that act on the axes, on a schedule.
    seed
        Of the run's random numbers (sensor noise).
    name
        What to call the controller in the recording; its class in snake case by default.
    scenario
        Text of the scenario that the run belongs to, kept in the recording.
    progress
        Called with the fraction done, 0 to 1.

    Returns
    -------
    Recording
        Cut short if the run diverged; its ``status`` and ``warnings`` then say when and on which
        axis, and its metrics are NaN.

    Raises
    ------
    RefusedError
        Machine, law and contour do not go together.
    TravelError
        The reference leaves the machine's travel.
    """
    reference = as_reference(reference)
    disturbances = as_disturbances(disturbances, machine)
    check_seed(seed)
    check_loop(machine, controller, reference)
    needs = controller.needs
    bound_machine = machine.bind(reference.sample_time)
    law = controller.bind(reference.contour, reference.sample_time)
    n, size = run_length(reference, needs), chunk_size(reference.n_samples)
    reach = loop_reach(reference)
    key = jax.random.key(seed)
    carry: Carry | None = None
    parts: list[dict[str, NDArray[Any]]] = []
    for number, points in enumerate(split(reference, size, needs.preview, n)):
        if carry is None:
            carry = _start(bound_machine, law, reference.contour, points, key, needs)
        carry, out = _advance(
            bound_machine, law, reference.contour, disturbances, carry, points,
            reference.sample_time, reach, needs, size,
        )  # fmt: skip
        parts.append(outputs_of(out))
        if progress is not None:
            progress(min(1.0, (number + 1) * size / n))
        if int(carry.diverged_step) >= 0 or int(carry.finished_step) >= 0:
            break
    assert carry is not None
    values = {key: np.concatenate([part[key] for part in parts])[:n] for key in parts[0]}
    diverged = int(carry.diverged_step)
    axis = -1
    if 0 <= diverged < n:
        row = min(diverged, reference.n_samples - 1)
        error = np.abs(values["actual"][diverged] - np.asarray(reference.position)[row])
        axis = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
        # at least one row stays: the first, which is the reference's own start
        values = {key: rows[: max(diverged, 1)] for key, rows in values.items()}
    elif 0 <= int(carry.finished_step) < n:
        values = {key: rows[: int(carry.finished_step) + 1] for key, rows in values.items()}
    return build_recording(
        machine, controller, law, reference, values, disturbances, seed, scenario,
        name or snake_case(type(controller).__name__), diverged if axis >= 0 else -1, axis,
        late=needs.own_time and axis < 0 and not 0 <= int(carry.finished_step) < n,
    )  # fmt: skip


def loop_reach(reference: Reference) -> NDArray[Any]:
    """Return the distance from its reference at which a run counts as diverged [m].

    Parameters
    ----------
    reference
        What is asked of the axes.
    """
    extent = float(np.max(np.ptp(np.asarray(reference.position), axis=0)))
    return np.asarray(DIVERGED_FACTOR * max(extent, 0.1))


@functools.partial(jax.jit, static_argnames=("needs",))
def _start(
    machine: BoundMachine, law: BoundController, contour: Contour, points: Any, key: Any,
    needs: Needs,
) -> Carry:  # fmt: skip
    geometry = geometry_rows(contour, points.parameter[:1], needs.derivatives)
    return first_carry(machine, law, Rows(points, geometry), key, needs)


@functools.partial(jax.jit, static_argnames=("needs", "n_steps"))
def _advance(
    machine: BoundMachine, law: BoundController, contour: Contour, disturbances: Any, carry: Carry,
    points: Any, sample_time: Any, reach: Any, needs: Needs, n_steps: int,
) -> tuple[Carry, Any]:  # fmt: skip
    geometry = geometry_rows(contour, points.parameter[:n_steps], needs.derivatives)
    return run_chunk(
        machine, law, disturbances, carry, Rows(points, geometry), sample_time, reach,
        needs=needs, n_steps=n_steps, freeze=False,
    )  # fmt: skip
