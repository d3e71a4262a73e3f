"""One closed loop: a machine, a law and a reference give a recording."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from numpy.typing import NDArray

import contourlab
from contourlab.contours.base import Contour
from contourlab.contours.foot_points import foot_point
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.errors import RefusedError, SimulationError, TravelError
from contourlab.machines import BoundMachine, Disturbance, Machine
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation.loop import (
    DIVERGED_FACTOR,
    Carry,
    Rows,
    chunk_size,
    first_carry,
    geometry_rows,
    outputs_of,
    run_chunk,
    split,
)

__all__ = ["COMMAND_UNITS", "check_loop", "loop_reach", "simulate"]

COMMAND_UNITS = {"voltage": "V", "force": "N", "velocity": "m/s", "position": "m"}

Progress = Callable[[float], None]


def simulate(
    machine: Machine,
    controller: Controller,
    reference: Reference,
    *,
    disturbances: Sequence[Disturbance] = (),
    seed: int = 0,
    name: str | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Run one closed loop and return its recording, judged by the exact contour error.

    The machine starts at rest at the first reference point. Row k of the recording is the state at
    t_k and the command that the law gave there.

    Parameters
    ----------
    machine
        The machine, with everything that the law does not know.
    controller
        A control law's configuration.
    reference
        What is asked of the axes.
    disturbances
        Efforts that act on the axes, on a schedule.
    seed
        Of the run's random numbers (sensor noise).
    name
        What to call the controller in the recording; its class name by default.
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
    disturbances = tuple(disturbances)
    check_loop(machine, controller, reference)
    needs = controller.needs
    bound_machine = machine.bind(reference.sample_time)
    law = controller.bind(reference.contour, reference.sample_time)
    n, size = reference.n_samples, chunk_size(reference.n_samples)
    reach = loop_reach(reference)
    key = jax.random.key(seed)
    carry: Carry | None = None
    parts: list[dict[str, NDArray[Any]]] = []
    for number, points in enumerate(split(reference, size, needs.preview)):
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
        error = np.abs(values["actual"][diverged] - np.asarray(reference.position)[diverged])
        axis = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
        # at least one row stays: the first, which is the reference's own start
        values = {key: rows[: max(diverged, 1)] for key, rows in values.items()}
    elif int(carry.finished_step) >= 0:
        values = {key: rows[: int(carry.finished_step) + 1] for key, rows in values.items()}
    return _recording(
        machine, controller, law, reference, values, disturbances, seed,
        name or type(controller).__name__, diverged if axis >= 0 else -1, axis,
    )  # fmt: skip


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
    if not isinstance(reference, Reference):
        raise SimulationError(
            "reference must be a Reference, as cl.feedrate makes it, "
            f"got {type(reference).__name__}"
        )
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
    check_travel(machine, reference)


def _shown(value: Any) -> str:
    """Return a configuration with its numbers."""
    return eqx.tree_pformat(value, short_arrays=False)


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


def _recording(
    machine: Machine, controller: Controller, law: BoundController,
    reference: Reference, values: dict[str, NDArray[Any]],
    disturbances: tuple[Disturbance, ...], seed: int, name: str, diverged: int, axis: int,
) -> Recording:  # fmt: skip
    import xarray as xr

    n = len(values["actual"])
    actual = values["actual"]
    tool = np.asarray(jax.vmap(machine.tool.tool_from_axes)(actual))
    parameter = np.asarray(reference.parameter)[:n]
    foot = foot_point(reference.contour, tool, near=parameter)
    wanted = np.asarray(reference.position)[:n]
    unit = COMMAND_UNITS[machine.command]
    planar = reference.contour.n_axes == 2
    same = machine.tool.n_coordinates is None
    coordinates = list(machine.names) if same else [f"c{k}" for k in range(tool.shape[1])]
    metres = {"units": "m"}
    data: dict[str, Any] = {
        "reference": (("time", "axis"), wanted, metres),
        "actual": (("time", "axis"), actual, metres),
        "measured": (("time", "axis"), values["measured"], metres),
        "tracking_error": (("time", "axis"), wanted - actual, metres),
        "command": (("time", "axis"), values["command"], {"units": unit, "kind": machine.command}),
        "command_limit": (
            ("axis",), np.broadcast_to(np.asarray(machine.drive.command_limit), (machine.n_axes,)),
            {"units": unit},
        ),
        "tool": (("time", "coordinate"), tool, metres),
        "contour_error": (
            ("time",), np.asarray(foot.distance),
            {**metres, "sign": "along the left normal" if planar else "norm", "kind": "local"},
        ),
        "contour_error_vector": (("time", "coordinate"), np.asarray(foot.vector), metres),
        "foot_parameter": (("time",), np.asarray(foot.parameter)),
        "reference_parameter": (("time",), parameter),
        "status": (("time",), values["status"], {"meaning": ", ".join(law.statuses)}),
    }  # fmt: skip
    for key, rows in values.items():
        if not key.startswith("telemetry."):
            continue
        label = key.removeprefix("telemetry.")
        last = {machine.n_axes: "axis", len(coordinates): "coordinate"}
        if rows.ndim == 1:
            data[label] = (("time",), rows)
        elif label == "contour_error_estimate":
            data[label] = (("time", "coordinate"), rows, metres)
        else:
            inner = [last.get(s, f"{label}_{i}") for i, s in enumerate(rows.shape[1:])]
            data[label] = (("time", *inner), rows)
    warnings = list(reference.warnings)
    attributes: dict[str, Any] = {
        "contourlab": contourlab.__version__,
        "controller": name,
        "controller_class": type(controller).__name__,
        "configuration": _shown(controller),
        "machine": _shown(machine),
        "contour": type(reference.contour).__name__,
        "disturbances": _shown(disturbances),
        "sample_time": float(np.asarray(reference.sample_time)),
        "seed": seed,
        "outcome": "normal",
    }
    if diverged >= 0:
        when = diverged * float(np.asarray(reference.sample_time))
        outcome = f"diverged at {when:.4g} s on axis {machine.names[axis]}"
        attributes |= {
            "outcome": outcome, "diverged_at": when, "diverged_axis": machine.names[axis]
        }  # fmt: skip
        warnings.append(f"the run {outcome}: it was stopped there and has no figures")
    abnormal = np.unique(values["status"][values["status"] != 0])
    for number in abnormal:
        share = float(np.mean(values["status"] == number))
        meaning = law.statuses[number] if 0 <= number < len(law.statuses) else f"status {number}"
        warnings.append(f"{meaning} during {100 * share:.3g} % of the samples")
    attributes["warnings"] = json.dumps(warnings)
    time = np.arange(n) * float(np.asarray(reference.sample_time))
    dataset = xr.Dataset(
        data,
        coords={
            "time": ("time", time, {"units": "s"}),
            "axis": list(machine.names),
            "coordinate": coordinates,
        },
        attrs=attributes,
    )
    return Recording(dataset)
