"""One closed loop: a machine, a law and a reference give a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.base import Controller
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation.checks import (
    as_disturbances,
    as_reference,
    check_loop,
    check_seed,
    snake_case,
)
from contourlab.simulation.engines import ClosedLoop, Engine, find_engine
from contourlab.simulation.loop import DIVERGED_FACTOR, run_length
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
    engine: str | Engine = "jax",
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
    engine
        What computes the loop: ``"jax"``, or ``"c"``, the whole loop as C by the road of export,
        compiled where a compiler is found. A long run of few axes is several times faster in C; the
        numbers are the same to rounding. Or an engine with options of its own, such as
        :class:`contourlab.export.CEngine`.

    Returns
    -------
    Recording
        Cut short if the run diverged; its ``status`` and ``warnings`` then say when and on which
        axis, and its metrics are NaN.

    Raises
    ------
    RefusedError
        Machine, law and contour do not go together. The engine cannot compute this loop: no
        compiler, or an operation that cannot be exported; says which and where it comes from.
    TravelError
        The reference leaves the machine's travel.
    SimulationError
        An engine, seed or disturbance that there is not.
    """
    reference = as_reference(reference)
    disturbances = as_disturbances(disturbances, machine)
    check_seed(seed)
    chosen = find_engine(engine)
    check_loop(machine, controller, reference)
    needs = controller.needs
    law = controller.bind(reference.contour, reference.sample_time)
    n = run_length(reference, needs)
    loop = ClosedLoop(
        machine.bind(reference.sample_time), law, disturbances, reference, needs,
        jax.random.key(seed), loop_reach(reference), n,
    )  # fmt: skip
    outcome = chosen.run(loop, progress or (lambda done: None))
    values, diverged, finished = outcome.values, outcome.diverged, outcome.finished
    if 0 <= finished < diverged:
        diverged = -1  # what came after the end does not count
    axis = -1
    if 0 <= diverged < n:
        row = min(diverged, reference.n_samples - 1)
        error = np.abs(values["actual"][diverged] - np.asarray(reference.position)[row])
        axis = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
        # at least one row stays: the first, which is the reference's own start
        values = {key: rows[: max(diverged, 1)] for key, rows in values.items()}
    elif 0 <= finished < n:
        values = {key: rows[: finished + 1] for key, rows in values.items()}
    return build_recording(
        machine, controller, law, reference, values, disturbances, seed, scenario,
        name or snake_case(type(controller).__name__), diverged if axis >= 0 else -1, axis,
        late=needs.own_time and axis < 0 and not 0 <= finished < n, engine=chosen.name,
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
