"""Which controller runs on which machine, along which reference: checked before anything runs.

A law that a machine or the contour does not take is refused there and runs elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx

from contourlab.controllers.base import Controller
from contourlab.errors import ContourlabError, RefusedError, SimulationError, choices
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.simulation.checks import as_disturbances, snake_case, why_refused

__all__ = [
    "ONLY",
    "Controllers",
    "Loop",
    "Refusal",
    "named_controllers",
    "pair_loops",
    "run_label",
]

ONLY = "machine"
"""What the one machine of a comparison is called if it was given no name."""

Controllers = Mapping[str, Controller | RefusedError | Mapping[str, Controller | RefusedError]]


@dataclass(frozen=True)
class Refusal:
    """A law that has no recording on a machine, and why."""

    machine_name: str
    controller_name: str
    reason: str
    failed: bool = False
    """Whether it was taken, and could not be computed."""

    @property
    def status(self) -> str:
        """What a table says: ``refused: ...`` or ``failed: ...``."""
        return f"{'failed' if self.failed else 'refused'}: {self.reason}"


@dataclass(frozen=True, eq=False)
class Loop:
    """One controller on one machine."""

    machine_name: str
    controller_name: str
    machine: Machine
    controller: Controller
    reference: Reference
    disturbances: tuple[Disturbance, ...]

    @property
    def parts(self) -> dict[str, Any]:
        """What paths of values that vary begin with."""
        return {
            "machine": self.machine,
            "controller": self.controller,
            "disturbances": self.disturbances,
        }


def run_label(machine: str, controller: str) -> str:
    """Return what a run is called where there are several machines.

    Parameters
    ----------
    machine, controller
        Names of the two.
    """
    return f"{controller} on {machine}"


def named_controllers(controllers: Controllers | Sequence[Controller]) -> Controllers:
    """Return controllers by name; a sequence by class in snake case, numbered if it must be.

    Parameters
    ----------
    controllers
        As for ``compare``.
    """
    if isinstance(controllers, Mapping):
        return controllers
    kinds = [snake_case(type(controller).__name__) for controller in controllers]
    named = {}
    for k, (kind, controller) in enumerate(zip(kinds, controllers, strict=True)):
        name = kind if kinds.count(kind) == 1 else f"{kind}_{kinds[: k + 1].count(kind)}"
        named[name] = controller
    return named


def pair_loops(
    machines: Mapping[str, Machine],
    controllers: Controllers,
    references: Mapping[str, Reference],
    disturbances: Sequence[Disturbance] | Disturbance,
) -> dict[str, Loop | Refusal]:
    """Return all loops of a comparison by what their runs are called, machine after machine.

    In place of a loop stands why a law cannot run there.

    Parameters
    ----------
    machines, references
        By name of the machine; one or more.
    controllers
        By name; an error in place of a controller is why it was refused when it was made.
    disturbances
        The same on every machine.

    Raises
    ------
    RefusedError, TravelError, GeometryError
        No controller can run: each is refused by the contour or a machine, or the part leaves the
        travel.
    SimulationError, ConfigurationError
        Nothing to run, a value that is wrong wherever the law runs, names that clash, machines with
        different axes or contours.
    """
    if not controllers:
        raise SimulationError("compare needs one controller or more")
    _same_axes(machines)
    _same_contour(references)
    found: dict[str, Loop | Refusal] = {}
    refused: list[tuple[Refusal, ContourlabError]] = []
    for where, machine in machines.items():
        efforts = as_disturbances(disturbances, machine)
        own = _on(where, controllers, machines)
        if not own:
            raise SimulationError(f"no controller runs on machine {where}")
        for name, controller in own.items():
            label = run_label(where, name) if len(machines) > 1 else name
            if label in found:
                raise SimulationError(f"two runs would be called {label!r}; rename a controller")
            if isinstance(controller, RefusedError):
                found[label] = refusal = Refusal(where, name, str(controller))
                refused.append((refusal, controller))
            else:
                found[label] = Loop(where, name, machine, controller, references[where], efforts)
    for label, loop in found.items():
        if isinstance(loop, Refusal):
            continue
        try:
            error = why_refused(loop.machine, loop.controller, loop.reference)
        except ContourlabError as mistake:
            if len(machines) == 1:
                raise
            raise _of_run(loop.controller_name, loop.machine_name, mistake) from mistake
        if error is not None:
            found[label] = refusal = Refusal(loop.machine_name, loop.controller_name, str(error))
            refused.append((refusal, error))
    if len(refused) == len(found):
        refusal, first = refused[0]
        if len(machines) == 1:
            raise first
        raise _of_run(refusal.controller_name, refusal.machine_name, first) from first
    return found


def _of_run(controller: str, machine: str, error: ContourlabError) -> ContourlabError:
    return type(error)(f"{controller} on machine {machine}: {error}")


def _same_axes(machines: Mapping[str, Machine]) -> None:
    (first, machine), *others = machines.items()
    for name, other in others:
        if other.names != machine.names:
            raise SimulationError(
                f"machine {name} has axes {', '.join(other.names)} and {first} has "
                f"{', '.join(machine.names)}: the machines of a comparison need the same axes"
            )


def _same_contour(references: Mapping[str, Reference]) -> None:
    (first, reference), *others = references.items()
    for name, other in others:
        same = other.contour is reference.contour
        if not same and not bool(eqx.tree_equal(other.contour, reference.contour)):
            raise SimulationError(
                f"the references of {first} and {name} must follow the same contour"
            )


def _on(
    machine: str, controllers: Controllers, machines: Mapping[str, Machine]
) -> dict[str, Controller | RefusedError]:
    """Return the controllers that run on a machine, or why they were refused."""
    found: dict[str, Controller | RefusedError] = {}
    for name, controller in controllers.items():
        if isinstance(controller, Mapping):
            unknown = [where for where in controller if where not in machines]
            if unknown:
                raise RefusedError(
                    f"controller {name} runs on machine {unknown[0]!r}; "
                    + choices(unknown[0], machines)
                )
            if machine in controller:
                found[name] = controller[machine]
        else:
            found[name] = controller
    return found
