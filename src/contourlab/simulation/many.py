"""Many closed loops at once: ``vmap`` over the same code as one run.

Metrics are reduced chunk by chunk; only what ``record`` names is kept. A diverged lane freezes and
reports when; its metrics are NaN. The exact contour error of a chunk is found outside the loop, all
lanes and steps in one batch, where points that need a longer search do not hold up the others.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.controllers.base import Controller, Needs
from contourlab.errors import RecordingError, SimulationError, choices
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.reference import Reference, ReferencePoint
from contourlab.simulation.checks import as_disturbances, as_reference, check_loop, check_seed
from contourlab.simulation.judged import ESTIMATE, EXACT, Judged
from contourlab.simulation.loop import (
    Carry,
    Rows,
    chunk_size,
    end_step,
    first_carry,
    geometry_rows,
    run_chunk,
    run_length,
    split,
)
from contourlab.simulation.run import loop_reach
from contourlab.simulation.variation import (
    HashableTree,
    lane_seeds,
    lane_values,
    mapped_axes,
    varied,
)
from contourlab.typing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MANY_METRICS", "RECORDABLE", "simulate_many"]

MANY_METRICS = (
    "contour_error_rms", "contour_error_max", "contour_error_mean", "tracking_error_rms",
    "tracking_error_max", "command_rms", "command_max", "saturation_time",
    "cycle_time", "estimate_error_rms", "estimate_error_max",
)  # fmt: skip
RECORDABLE = ("actual", "measured", "command", "tracking_error", "contour_error_vector", "status")


class _Sums(eqx.Module):
    """Running sums and maxima of one lane."""

    count: Array
    sums: dict[str, Any]
    maxima: dict[str, Any]


def simulate_many(
    machine: Machine,
    controller: Controller,
    reference: Reference | Plan,
    *,
    vary: Mapping[str, Any],
    metrics: Sequence[str] | None = None,
    record: Sequence[str] = (),
    disturbances: Sequence[Disturbance] | Disturbance = (),
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Run many closed loops that differ in some values, zipped, and return their metrics.

    Parameters
    ----------
    machine, controller, reference
        As for ``simulate``.
    vary
        Values by dotted path, beginning with ``controller``, ``machine`` or ``disturbances``, such
        as ``{"controller.kp": values, "machine.dynamics.mass": values}``, or ``"seed"``. The first
        dimension of each is the lane. A name that stands only once further down may be written
        short: ``machine.mass``.
    metrics
        Names; by default all that can be had, of :data:`MANY_METRICS`.
    record
        Signals to keep for every lane, of :data:`RECORDABLE`.
    disturbances
        Efforts that act on the axes.
    seed
        Of lane 0; lane k has ``seed + k`` unless ``"seed"`` is varied.
    progress
        Called with the fraction done.

    Returns
    -------
    xarray.Dataset
        On the dimension ``lane``: the varied values, the metrics (per axis where they are),
        ``diverged_at`` [s] (NaN if it did not) and ``diverged_axis``, and what was recorded, on
        (lane, time, ...).

    Raises
    ------
    ConfigurationError
        A path names nothing, or some lane's value is out of bounds.
    SimulationError
        Lanes of different number, nothing to vary, or a law that is synthesised on the host and
        varied.
    """
    reference = as_reference(reference)
    disturbances = as_disturbances(disturbances, machine)
    check_seed(seed)
    check_loop(machine, controller, reference)
    machine.bind(reference.sample_time)  # checks that need values: done once, before tracing
    law = controller.bind(reference.contour, reference.sample_time)
    lanes, values = lane_values(vary)
    loop = {"machine": machine, "controller": controller, "disturbances": disturbances}
    batched = varied(loop, values)
    needs = controller.needs
    if needs.host_synthesis and any(path.startswith("controller") for path in values):
        raise SimulationError(
            f"{type(controller).__name__} is synthesised on the host and cannot be varied in a "
            "batch; run simulate for each value"
        )
    keys = jax.vmap(jax.random.key)(lane_seeds(values, seed, lanes))
    wanted = _wanted_metrics(metrics, law, reference, needs)
    for name in record:
        if name not in RECORDABLE:
            raise RecordingError(f"cannot record {name!r}; {choices(name, RECORDABLE)}")
    in_axes = mapped_axes(loop, batched)
    n, size = run_length(reference, needs), chunk_size(reference.n_samples)
    if lanes * size > 2**22:
        size = 256
    reach = loop_reach(reference)
    # static, since the number of commands that wait in a drive's delay depends on it
    sample_time = float(np.asarray(reference.sample_time))
    inner = tuple(name for name in wanted if name not in EXACT | ESTIMATE | {"cycle_time"})
    judged = Judged(reference.contour, wanted, lanes)
    judge = bool(judged.names) or "contour_error_vector" in record
    streams = {name for name in record if name != "contour_error_vector"}
    streams |= {"tool"} if judge else set()
    streams |= {"contour_error_estimate"} if ESTIMATE & set(wanted) else set()
    carry: Any = None
    kept: list[dict[str, Any]] = []
    streams |= {"path_parameter"} if judge and needs.own_time else set()
    chunks = split(reference, size, needs.preview, n)
    for number, points in enumerate(chunks):
        if carry is None:
            carry = _first(batched, reference.contour, points, keys, sample_time,
                           in_axes=in_axes, needs=needs, wanted=inner)  # fmt: skip
        carry, out = _chunk(
            batched, reference.contour, carry, points, sample_time, reach,
            np.int32(n), in_axes=in_axes, needs=needs, n_steps=size, wanted=inner,
            record=tuple(sorted(streams)),
        )  # fmt: skip
        rows = {name: np.asarray(value) for name, value in out.items()}
        if judge:
            end = np.asarray(end_step(carry[0], np.int32(n)))
            valid = number * size + np.arange(size) < end[:, None]
            vector = judged.add(rows, valid, np.asarray(points.parameter)[:size])
            rows["contour_error_vector"] = vector
        if record:
            kept.append({name: rows[name] for name in record})
        if progress is not None:
            progress((number + 1) / len(chunks))
        if bool(np.all(np.asarray(end_step(carry[0], np.int32(n))) <= (number + 1) * size)):
            break
    return _dataset(machine, reference, values, carry, wanted, kept, n, judged, needs)


def _wanted_metrics(
    names: Sequence[str] | None, law: Any, reference: Reference, needs: Needs
) -> tuple[str, ...]:
    for name in names or ():
        if name not in MANY_METRICS:
            raise RecordingError(f"no metric {name!r} in a batch; {choices(name, MANY_METRICS)}")
    estimates = _has_estimate(law, reference, needs)
    if names is None:
        return tuple(m for m in MANY_METRICS if estimates or m not in ESTIMATE)
    if not estimates and ESTIMATE & set(names):
        raise RecordingError("the law does not report a contour_error_estimate")
    return tuple(names)


def _has_estimate(law: Any, reference: Reference, needs: Needs) -> bool:
    def shape() -> Any:
        first = split(reference, 1, needs.preview)[0]
        geometry = geometry_rows(reference.contour, first.parameter[:1], needs.derivatives)
        from contourlab.recordings.sample import Sample

        here = jax.tree.map(lambda x: jnp.asarray(x)[0], first)
        ahead = jax.tree.map(lambda x: jnp.asarray(x)[1:], first)
        sample = Sample(jnp.zeros(()), here, geometry[0], ahead, here.position, here.velocity)
        _, state = law.step(law.init(sample), sample)
        return law.telemetry(state)

    return "contour_error_estimate" in jax.eval_shape(shape)


@functools.partial(jax.jit, static_argnames=("sample_time", "in_axes", "needs", "wanted"))
def _first(
    loop: Any, contour: Contour, points: ReferencePoint, keys: Array, sample_time: float, *,
    in_axes: HashableTree, needs: Needs, wanted: tuple[str, ...],
) -> tuple[Carry, _Sums]:  # fmt: skip
    geometry = geometry_rows(contour, points.parameter[:1], needs.derivatives)
    n_axes = points.position.shape[-1]

    def lane(loop: Any, key: Array) -> tuple[Carry, _Sums]:
        machine = loop["machine"].bind(sample_time)
        law = loop["controller"].bind(contour, sample_time)
        carry = first_carry(machine, law, Rows(points, geometry), key, needs)
        zero, vector = jnp.zeros(()), jnp.zeros(n_axes)
        names = [m for m in wanted if not m.endswith("_max")]
        sums = {m: vector if m == "command_rms" else zero for m in names}
        tops = [m for m in wanted if m.endswith("_max")]
        maxima = {m: vector if m == "command_max" else zero for m in tops}
        return carry, _Sums(zero, sums, maxima)

    return jax.vmap(lane, in_axes=(in_axes.tree(), 0))(loop, keys)


@functools.partial(
    jax.jit,
    static_argnames=("sample_time", "in_axes", "needs", "n_steps", "wanted", "record"),
    donate_argnums=(2,),
)
def _chunk(
    loop: Any, contour: Contour, carry: Any, points: ReferencePoint, sample_time: float, reach: Any,
    n_samples: Any, *, in_axes: HashableTree, needs: Needs, n_steps: int, wanted: tuple[str, ...],
    record: tuple[str, ...],
) -> tuple[Any, dict[str, Array]]:  # fmt: skip
    geometry = geometry_rows(contour, points.parameter[:n_steps], needs.derivatives)
    here = jax.tree.map(lambda x: x[:n_steps], points)

    def lane(loop: Any, carry: tuple[Carry, _Sums]) -> Any:
        machine = loop["machine"].bind(sample_time)
        law = loop["controller"].bind(contour, sample_time)
        before, sums = carry
        after, out = run_chunk(
            machine, law, loop["disturbances"], before, Rows(points, geometry), sample_time, reach,
            needs=needs, n_steps=n_steps, freeze=True,
        )  # fmt: skip
        step = before.step + jnp.arange(n_steps, dtype=jnp.int32)
        valid = step < end_step(after, n_samples)
        signals = dict(out)
        wanted_at = here.position
        if needs.own_time:
            signals["path_parameter"] = out["telemetry"]["path_parameter"]
            wanted_at = jax.vmap(contour.position)(signals["path_parameter"])
        signals["tracking_error"] = wanted_at - out["actual"]
        if "tool" in record:
            signals["tool"] = jax.vmap(machine.tool.tool_from_axes)(out["actual"])
        if "contour_error_estimate" in record:
            signals["contour_error_estimate"] = out["telemetry"]["contour_error_estimate"]
        limit = machine.command_limit
        sums = _reduce(sums, signals, valid, limit, wanted)
        return (after, sums), {name: signals[name] for name in record}

    return jax.vmap(lane, in_axes=(in_axes.tree(), 0))(loop, carry)  # type: ignore[no-any-return]


def _reduce(
    sums: _Sums, signals: dict[str, Any], valid: Array, limit: Array, wanted: tuple[str, ...]
) -> _Sums:
    def size(x: Array) -> Array:
        return jnp.sqrt(jnp.sum(x * x, axis=-1))

    magnitude: dict[str, Callable[[], Array]] = {
        "tracking_error": lambda: size(signals["tracking_error"]),
        "command": lambda: jnp.abs(signals["command"]),
        "saturation": lambda: jnp.any(
            jnp.abs(signals["command"]) >= limit * (1.0 - 1e-12), axis=-1
        ).astype(float),
    }
    kinds = {name: name.rsplit("_", 1) for name in wanted}
    masked = {}
    for what in {what for what, _ in kinds.values()}:
        value = magnitude[what]()
        mask = valid if value.ndim == 1 else valid[:, None]
        masked[what] = jnp.where(mask, value, 0.0)
    new_sums, maxima = dict(sums.sums), dict(sums.maxima)
    for name, (what, how) in kinds.items():
        value = masked[what]
        if how == "max":
            maxima[name] = jnp.maximum(maxima[name], jnp.max(value, axis=0))
        else:
            new_sums[name] = new_sums[name] + jnp.sum(value**2 if how == "rms" else value, axis=0)
    return _Sums(sums.count + jnp.sum(valid), new_sums, maxima)


def _dataset(
    machine: Machine, reference: Reference, values: Mapping[str, Any], carry: Any,
    wanted: tuple[str, ...], kept: list[dict[str, Any]], n: int, judged: Judged, needs: Needs,
) -> xr.Dataset:  # fmt: skip
    import xarray as xr

    from contourlab.recordings.metrics import METRICS

    state, sums = carry
    totals = {**sums.sums, **judged.sums}
    maxima = {**sums.maxima, **judged.maxima}
    step = np.asarray(state.diverged_step)
    diverged = (step >= 0) & (step < n)
    count = np.maximum(np.asarray(sums.count), 1.0)
    sample_time = float(np.asarray(reference.sample_time))
    data: dict[str, Any] = {}
    for path, value in values.items():
        extra = [f"{path}_{k}" for k in range(value.ndim - 1)]
        data[path] = (("lane", *extra), value)
    for name in wanted:
        if name == "cycle_time":
            result = (np.asarray(end_step(state, np.int32(n))) - 1) * sample_time
            done = np.asarray(state.finished_step)
            if needs.own_time:  # a lane that has not arrived has no cycle time
                result = np.where((done >= 0) & (done < n), result, np.nan)
        elif name in maxima:
            result = np.asarray(maxima[name])
        else:
            total = np.asarray(totals[name])
            mean = total / (count[:, None] if total.ndim == 2 else count)
            if name == "saturation_time":
                result = total * sample_time
            else:
                result = np.sqrt(mean) if name.endswith("_rms") else mean
        mask = diverged[:, None] if result.ndim == 2 else diverged
        result = np.where(mask, np.nan, result)
        dims = ("lane", "axis") if result.ndim == 2 else ("lane",)
        data[name] = (dims, result, {"units": METRICS[name].unit, "meaning": METRICS[name].meaning})
    data["diverged_at"] = (
        ("lane",),
        np.where(diverged, step * sample_time, np.nan),
        {"units": "s"},
    )
    data["diverged_axis"] = (("lane",), _axes_lost(machine, state, reference, step, diverged))
    if kept:
        same = machine.tool.n_coordinates is None
        for name in kept[0]:
            rows = np.concatenate([part[name] for part in kept], axis=1)[:, :n]
            inner = () if rows.ndim == 2 else ("axis",)
            if name == "contour_error_vector" and not same:
                inner = ("coordinate",)
            data[name] = (("lane", "time", *inner), rows)
    coords: dict[str, Any] = {"axis": list(machine.names)}
    if kept:
        n_kept = min(n, sum(len(next(iter(part.values()))[0]) for part in kept))
        coords["time"] = ("time", np.arange(n_kept) * sample_time, {"units": "s"})
    return xr.Dataset(data, coords=coords, attrs={"n_samples": n, "sample_time": sample_time})


def _axes_lost(
    machine: Machine, state: Carry, reference: Reference, step: Any, diverged: Any
) -> NDArray[Any]:
    bound = machine.bind(reference.sample_time)
    position = np.asarray(jax.vmap(bound.true_position)(state.machine))
    wanted = np.asarray(reference.position)[np.clip(step, 0, reference.n_samples - 1)]
    error = np.abs(position - wanted)
    axis = np.argmax(np.where(np.isfinite(error), error, np.inf), axis=1)
    return np.where(diverged, np.asarray(machine.names, dtype=object)[axis], "").astype(str)
