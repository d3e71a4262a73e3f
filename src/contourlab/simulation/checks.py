"""What goes together in a loop, and what does not: said before anything runs."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import numpy as np

from contourlab.configuration import snake_case
from contourlab.contours.combined import CombinedAxes
from contourlab.controllers.axis_controller import SHARED_AXES
from contourlab.controllers.base import Controller
from contourlab.errors import (
    ContourlabError,
    GeometryError,
    RefusedError,
    SimulationError,
    TravelError,
)
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, IdentityTool, Machine
from contourlab.recordings.reference import Reference

__all__ = [
    "as_disturbances",
    "as_reference",
    "check_loop",
    "check_seed",
    "check_travel",
    "snake_case",
    "why_refused",
]


def check_loop(machine: Machine, controller: Controller, reference: Reference) -> None:
    """Raise unless machine, law and reference go together and the travel suffices.

    Parameters
    ----------
    machine, controller, reference
        As for ``simulate``.

    Raises
    ------
    RefusedError
        Numbers of axes or kinds of command differ; says which.
    TravelError
        The reference leaves the machine's travel; says where.
    """
    for name, value, kind in (
        ("machine", machine, Machine),
        ("controller", controller, Controller),
        ("reference", reference, Reference),
    ):
        if not isinstance(value, kind):
            raise SimulationError(f"{name} must be a {kind.__name__}, got {type(value).__name__}")
    law = type(controller).__name__
    if controller.n_axes != machine.n_axes:
        raise RefusedError(
            f"{law} commands {controller.n_axes} axes, the machine has {machine.n_axes}"
        )
    if reference.n_axes != machine.n_axes:
        raise RefusedError(
            f"the reference has {reference.n_axes} axes, the machine has {machine.n_axes}"
        )
    if controller.needs.command != machine.command:
        raise RefusedError(
            f"{law} gives a {controller.needs.command} command, "
            f"the machine takes a {machine.command} command"
        )
    coordinates = machine.tool.n_coordinates or machine.n_axes
    if reference.contour.n_axes != coordinates:
        raise RefusedError(
            f"the contour has {reference.contour.n_axes} coordinates, the tool has {coordinates}"
        )
    if not isinstance(machine.tool, IdentityTool):
        needs = controller.needs
        of_contour = needs.contour or needs.derivatives >= 0 or needs.own_time
        if needs.axes_path:
            _check_axes_path(law, machine, reference)
        elif of_contour and not needs.tool_map:
            redundant = (
                f": {machine.n_axes} axes share {coordinates} coordinates, and a law that corrects "
                "the tool point by axis directions does not say how they would share the "
                f"correction; {SHARED_AXES}"
                if machine.n_axes > coordinates
                else ""
            )
            raise RefusedError(
                f"{law} takes no account of a tool map, and this machine's tool is a "
                f"{type(machine.tool).__name__}{redundant}"
            )
        _check_tool(machine, reference)
    check_travel(machine, reference)


def why_refused(
    machine: Machine, controller: Controller, reference: Reference
) -> ContourlabError | None:
    """Return why a law cannot run on a machine along a reference, None if it can.

    Parameters
    ----------
    machine, controller, reference
        As for ``simulate``.

    Raises
    ------
    ConfigurationError, SimulationError
        A value that is wrong wherever the law runs.
    """
    try:
        check_loop(machine, controller, reference)
        controller.bind(reference.contour, reference.sample_time)
    except (RefusedError, TravelError, GeometryError) as error:
        return error
    return None


def _check_axes_path(law: str, machine: Machine, reference: Reference) -> None:
    """Raise RefusedError unless the contour is a path in axes behind the machine's tool map."""
    contour = reference.contour
    if not isinstance(contour, CombinedAxes):
        raise RefusedError(
            f"{law} takes the path in the space of the axes, and this machine's tool is a "
            f"{type(machine.tool).__name__}: give the reference a contour of "
            "contours.combined(path_of_axes, tool_matrix)"
        )
    eye = np.eye(machine.n_axes)
    map_columns = jax.vmap(machine.tool.tool_from_axes)(eye)
    origin = np.asarray(machine.tool.tool_from_axes(np.zeros(machine.n_axes)))
    if not (
        np.allclose(np.asarray(map_columns).T, contour.matrix, rtol=0.0, atol=1e-12)
        and not origin.any()
    ):
        raise RefusedError(
            f"{law}: the contour combines the axes in another way than the machine's tool map"
        )


def _check_tool(machine: Machine, reference: Reference) -> None:
    """Raise RefusedError unless the tool of the reference runs on the contour."""
    rows = np.unique(np.linspace(0, reference.n_samples - 1, 200).astype(int))
    tool = jax.vmap(machine.tool.tool_from_axes)(np.asarray(reference.position)[rows])
    wanted = jax.vmap(lambda p: reference.contour.position(p))(
        np.asarray(reference.parameter)[rows]
    )
    away = np.linalg.norm(np.asarray(tool) - np.asarray(wanted), axis=1)
    extent = float(np.max(np.ptp(np.asarray(wanted), axis=0)))
    if not np.all(away <= 1e-9 * max(extent, 1e-3)):
        worst = int(np.argmax(away))
        raise RefusedError(
            "the reference's axis positions do not put the tool on the contour: it is "
            f"{away[worst] * 1e3:.3g} mm off at {reference.time[rows[worst]]:.4g} s"
        )


def as_reference(reference: Reference | Plan) -> Reference:
    """Return the reference of a plan, or the reference itself.

    Parameters
    ----------
    reference
        Either.
    """
    return reference.reference if isinstance(reference, Plan) else reference


def as_disturbances(
    disturbances: Sequence[Disturbance] | Disturbance, machine: Machine
) -> tuple[Disturbance, ...]:
    """Return disturbances as a tuple.

    Parameters
    ----------
    disturbances
        One or several.
    machine
        On whose axes they act.

    Raises
    ------
    SimulationError
        Something that is no disturbance, or one on an axis that the machine does not have.
    """
    several = (disturbances,) if isinstance(disturbances, Disturbance) else tuple(disturbances)
    for one in several:
        if not isinstance(one, Disturbance):
            raise SimulationError(f"disturbances must be Disturbances, got {type(one).__name__}")
        if one.axis >= machine.n_axes:
            raise SimulationError(
                f"a disturbance acts on axis {one.axis}, the machine has {machine.n_axes} axes "
                "(counted from 0)"
            )
    return several


def check_seed(seed: object) -> None:
    """Raise SimulationError unless a seed is a whole number >= 0.

    Parameters
    ----------
    seed
        Of a run.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise SimulationError(f"seed must be a whole number >= 0, got {seed!r}")


def check_travel(machine: Machine, reference: Reference) -> None:
    """Raise TravelError if a reference leaves a machine's travel; says where and by how much.

    Parameters
    ----------
    machine
        With its ``travel``.
    reference
        What is asked of the axes.
    """
    position = np.asarray(reference.position)
    travel = np.broadcast_to(np.asarray(machine.travel), (machine.n_axes, 2))
    excess = np.maximum(position - travel[:, 1], travel[:, 0] - position)
    if not (excess > 1e-12).any():
        return
    row, axis = np.unravel_index(int(np.argmax(excess)), excess.shape)
    lines = getattr(reference.contour, "source_line", None)
    where = f"at parameter {float(reference.parameter[row]):.6g}"
    if lines is not None:
        piece = int(reference.contour.find(reference.parameter[row]))  # type: ignore[attr-defined]
        where = f"in line {int(lines[piece])}" if int(lines[piece]) else where
    raise TravelError(
        f"the part leaves the travel of axis {machine.names[axis]}, "
        f"{travel[axis, 0] * 1e3:g} to {travel[axis, 1] * 1e3:g} mm: "
        f"it goes to {position[row, axis] * 1e3:.6g} mm {where}"
    )
