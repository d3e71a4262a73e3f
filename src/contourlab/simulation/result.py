"""From the outputs of a loop to a recording."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import numpy as np
from numpy.typing import NDArray

import contourlab
from contourlab.contours.foot_points import foot_point
from contourlab.controllers.base import BoundController, Controller, Needs
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference

__all__ = ["COMMAND_UNITS", "build_recording"]

COMMAND_UNITS = {"voltage": "V", "force": "N", "velocity": "m/s", "position": "m"}


def build_recording(
    machine: Machine, controller: Controller, law: BoundController,
    reference: Reference, values: Mapping[str, NDArray[Any]],
    disturbances: tuple[Disturbance, ...], seed: int, scenario: str, name: str,
    diverged: int, axis: int, *, late: bool = False, engine: str = "jax",
) -> Recording:  # fmt: skip
    """Return what happened as a recording, judged by the exact contour error.

    Parameters
    ----------
    machine, controller, law, reference, disturbances, seed, scenario, name
        The run.
    values
        Outputs of the loop, cut where the run ended.
    diverged, axis
        Row and axis at which it diverged, -1 if it did not.
    late
        Whether a law that plans its own time has not arrived.
    engine
        What computed the loop.
    """
    import xarray as xr

    n = len(values["actual"])
    actual = values["actual"]
    tool = np.asarray(jax.vmap(machine.tool.tool_from_axes)(actual))
    if controller.needs.own_time:  # its reference is where it is on the contour by its own plan
        parameter = np.asarray(values["telemetry.path_parameter"])
        wanted = np.asarray(jax.jit(jax.vmap(reference.contour.position))(parameter))
    else:
        parameter = np.asarray(reference.parameter)[:n]
        wanted = np.asarray(reference.position)[:n]
    foot = foot_point(reference.contour, tool, near=parameter)
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
        last = {len(coordinates): "coordinate", machine.n_axes: "axis"}
        if rows.ndim == 1:
            data[label] = (("time",), rows)
        elif label == "contour_error_estimate":
            data[label] = (("time", "coordinate"), rows, metres)
        else:
            inner = [last.get(s, f"{label}_{i}") for i, s in enumerate(rows.shape[1:])]
            data[label] = (("time", *inner), rows)
    followed = () if controller.needs.own_time else reference.motion_warnings
    warnings = [
        sentence
        for sentence in reference.warnings
        if sentence in followed or sentence not in reference.motion_warnings
    ]
    warnings += _cut_short(controller.needs, reference)
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
        "scenario": scenario,
        "engine": engine,
        "outcome": "normal",
    }
    attributes = {**law.facts(), **attributes}
    warnings += law.warnings()
    if diverged >= 0:
        when = diverged * float(np.asarray(reference.sample_time))
        outcome = f"diverged at {when:.4g} s on axis {machine.names[axis]}"
        attributes |= {
            "outcome": outcome, "diverged_at": when, "diverged_axis": machine.names[axis]
        }  # fmt: skip
        warnings.append(f"the run {outcome}: it was stopped there and has no figures")
    if late:
        seconds = n * float(np.asarray(reference.sample_time))
        warnings.append(f"the law had not arrived at the end of the contour after {seconds:.4g} s")
        if attributes["outcome"] == "normal":
            attributes["outcome"] = "not arrived"
    abnormal = np.unique(values["status"][values["status"] != 0])
    for number in abnormal:
        share = float(np.mean(values["status"] == number))
        meaning = law.statuses[number] if 0 <= number < len(law.statuses) else f"status {number}"
        warnings.append(f"{meaning} during {100 * share:.3g} % of the samples")
    warnings += _beyond_travel(machine, actual, reference)
    unfinished = _not_finite(values, machine, reference)
    if unfinished:
        warnings += unfinished
        if attributes["outcome"] == "normal":
            attributes["outcome"] = "not finite"
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


def _cut_short(needs: Needs, reference: Reference) -> list[str]:
    """Say that a law which looks ahead sees a moving reference stop where its record ends."""
    speed = float(np.linalg.norm(np.asarray(reference.velocity)[-1]))
    if needs.preview < 2 or needs.own_time or speed == 0.0:
        return []
    ahead = min(needs.preview, reference.n_samples) * float(np.asarray(reference.sample_time))
    return [
        f"the reference ends at {speed:.4g} m/s: the law, which looks ahead, sees it stop there "
        f"and slows down in the last {ahead:.4g} s"
    ]


def _beyond_travel(machine: Machine, actual: NDArray[Any], reference: Reference) -> list[str]:
    """Say where the machine itself, not the reference, left the travel."""
    travel = np.broadcast_to(np.asarray(machine.travel), (machine.n_axes, 2))
    excess = np.maximum(actual - travel[:, 1], travel[:, 0] - actual)
    said = []
    for axis in np.flatnonzero((excess > 0.0).any(axis=0)):
        first = int(np.argmax(excess[:, axis] > 0.0)) * float(np.asarray(reference.sample_time))
        said.append(
            f"axis {machine.names[axis]} left its travel by up to "
            f"{excess[:, axis].max() * 1e6:.4g} um, first at {first:.4g} s"
        )
    return said


def _not_finite(
    values: Mapping[str, NDArray[Any]], machine: Machine, reference: Reference
) -> list[str]:
    """Say which recorded signals hold NaN or infinity, and since when."""
    said = []
    for key, rows in values.items():
        if rows.dtype.kind != "f" or np.isfinite(rows).all():
            continue
        flat = ~np.isfinite(rows.reshape(len(rows), -1))
        row = int(np.argmax(flat.any(axis=1)))
        where = ""
        if rows.shape[1:] == (machine.n_axes,):
            where = f" on axis {machine.names[int(np.argmax(flat[row]))]}"
        first = row * float(np.asarray(reference.sample_time))
        said.append(f"{key.removeprefix('telemetry.')} is not finite{where} from {first:.4g} s")
    return said


def _shown(value: Any) -> str:
    """Return a configuration with its numbers."""
    return eqx.tree_pformat(value, short_arrays=False)
