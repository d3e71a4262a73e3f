"""What computes a loop: engines, and which there are.

An engine is given the whole closed loop and returns what happened. That of JAX is in this package.
Others stand where what they need stands: the one that compiles the loop as C uses the road of
``export``, which is built on this package. So this table knows their modules by name alone, and a
module is imported when a run asks for its engine.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from contourlab.controllers.base import BoundController, Needs
from contourlab.errors import SimulationError, choices
from contourlab.machines import BoundMachine, Disturbance
from contourlab.recordings.reference import Reference

__all__ = ["ENGINES", "ClosedLoop", "Engine", "Outcome", "find_engine"]

ENGINES: dict[str, tuple[str, str]] = {
    "jax": ("contourlab.simulation.jax_engine", "JaxEngine"),
    "c": ("contourlab.export.c_engine", "CEngine"),
}
"""Module and class of every engine, by name."""


@dataclasses.dataclass(frozen=True, eq=False)
class ClosedLoop:
    """What an engine runs: everything bound and checked.

    Parameters
    ----------
    machine, law
        Bound to the reference's contour and sample time.
    disturbances
        On the axes.
    reference
        What is asked of them.
    needs
        Of the law.
    key
        Of the run's random numbers.
    reach
        Distance from its reference at which the run counts as diverged [m].
    length
        Samples that the run may take; more than the reference has if the law plans its own time.
    """

    machine: BoundMachine
    law: BoundController
    disturbances: tuple[Disturbance, ...]
    reference: Reference
    needs: Needs
    key: Any
    reach: Any
    length: int


@dataclasses.dataclass(frozen=True, eq=False)
class Outcome:
    """What happened in a loop.

    Parameters
    ----------
    values
        ``actual``, ``measured``, ``command``, ``status`` and the law's telemetry as
        ``telemetry.NAME``, a row for each step. Rows after the end of the run may follow.
    diverged, finished
        Row at which the run diverged, at which the law said that it had arrived; -1 if not.
    """

    values: Mapping[str, NDArray[Any]]
    diverged: int
    finished: int


@runtime_checkable
class Engine(Protocol):
    """What computes a loop."""

    name: str
    """As recordings show it."""

    def run(self, loop: ClosedLoop, told: Callable[[float], None]) -> Outcome:
        """Return what happened until the run was over; an interrupt is heard on the way.

        Parameters
        ----------
        loop
            What to run.
        told
            Called now and then with the fraction done.
        """
        ...


def find_engine(engine: str | Engine) -> Engine:
    """Return an engine by its name, or the engine itself.

    Parameters
    ----------
    engine
        Either.

    Raises
    ------
    SimulationError
        There is none of this name; names those that there are.
    """
    if not isinstance(engine, str):
        if isinstance(engine, Engine) and not isinstance(engine, type):
            return engine
        raise SimulationError(
            f"engine must be a name or an engine, got {engine!r}; {choices('', ENGINES)}"
        )
    if engine not in ENGINES:
        raise SimulationError(f"unknown engine {engine!r}; {choices(engine, ENGINES)}")
    module, name = ENGINES[engine]
    made: Engine = getattr(importlib.import_module(module), name)()
    return made
