"""Which controller runs on which machine, along which reference: checked before anything runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx

from contourlab.controllers.base import Controller
from contourlab.errors import ContourlabError, RefusedError, SimulationError, choices
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference
from contourlab.simulation.checks import as_disturbances, check_loop, snake_case

__all__ = ["ONLY", "Controllers", "Loop", "named_controllers", "pair_loops", "run_label"]

ONLY = "machine"
"""What the one machine of a comparison is called if it was given no name."""

Controllers = Mapping[str, Controller | Mapping[str, Controller]]


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
) -> dict[str, Loop]:
    """Return all loops of a comparison by what their runs are called, machine after machine.

    Parameters
    ----------
    machines, references
        By name of the machine; one or more.
    controllers
        By name.
    disturbances
        The same on every machine.

    Raises
    ------
    RefusedError, TravelError
        A controller cannot take the contour or a machine; the part leaves the travel.
    SimulationError
        Nothing to run, names that clash, machines with different axes or contours.
    """
    if not controllers:
        raise SimulationError("compare needs one controller or more")
    _same_axes(machines)
    _same_contour(references)
    loops: dict[str, Loop] = {}
    for where, machine in machines.items():
        efforts = as_disturbances(disturbances, machine)
        own = _on(where, controllers, machines)
        if not own:
            raise SimulationError(f"no controller runs on machine {where}")
        for name, controller in own.items():
            label = run_label(where, name) if len(machines) > 1 else name
            if label in loops:
                raise SimulationError(f"two runs would be called {label!r}; rename a controller")
            loops[label] = Loop(where, name, machine, controller, references[where], efforts)
    for loop in loops.values():
        try:
            check_loop(loop.machine, loop.controller, loop.reference)
            loop.controller.bind(loop.reference.contour, loop.reference.sample_time)
        except ContourlabError as error:
            if len(machines) == 1:
                raise
            message = f"{loop.controller_name} on machine {loop.machine_name}: {error}"
            raise type(error)(message) from error
    return loops


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
) -> dict[str, Controller]:
    """Return the controllers that run on a machine."""
    found = {}
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
