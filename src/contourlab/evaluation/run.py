"""A measured log judged by the exact contour error."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours import Path
from contourlab.contours.base import Contour
from contourlab.contours.files import metres
from contourlab.contours.part import Part
from contourlab.errors import ConfigurationError, LogError, choices
from contourlab.evaluation.alignment import Alignment, align, follow
from contourlab.evaluation.causes import Cause, decompose
from contourlab.evaluation.causes.decompose import Record
from contourlab.evaluation.causes.sensors import check_side
from contourlab.evaluation.circles import find_circular_test
from contourlab.evaluation.judge import Judged, against_commanded, against_path
from contourlab.evaluation.part_of import read_part
from contourlab.evaluation.resolution import Resolution, find_resolution
from contourlab.evaluation.result import Evaluation, WorstPoint
from contourlab.evaluation.stretches import Breaks, find_breaks, stretches
from contourlab.evaluation.tracking import track_axes
from contourlab.logs.log import Log
from contourlab.logs.netcdf import of_recording
from contourlab.logs.read import read_log
from contourlab.recordings.metrics import MetricValue
from contourlab.recordings.recording import Recording

__all__ = ["PATHS", "evaluate"]

PATHS = ("polyline", "spline")
WORST = 8
"""Places that are listed."""
ROUNDING = 1e-13
"""Of the largest coordinate: less is what computing makes."""
LEAST = 3
"""Samples of a log that is judged: two make a line, of which no sample tells anything."""
FEW = 50
"""Judged samples from which an rms is known to a tenth, 1 / √(2 n), if they are independent."""
MATCH = 0.005
"""Share of the part's extent beyond which a commanded position is not on it."""

Values = NDArray[Any]


def evaluate(
    log: str | os.PathLike[str] | Log | Recording,
    *,
    contour: Any = None,
    align_part: bool = True,
    path: str = "polyline",
    tolerance: float | str | None = None,
    measured: str | None = None,
    pitch: float | str | Any = None,
    circular: bool = True,
    **reading: Any,
) -> Evaluation:
    """Return the contour error of a measured log, what it is worth, and where it comes from.

    Parameters
    ----------
    log
        A file (see :func:`~contourlab.logs.read_log`), a log, or a recording.
    contour
        What the tool should have followed: a part file, a ``Part`` or a contour. If None, the path
        through the commanded positions.
    align_part
        Whether the log is laid on the part by a rotation and a shift, which are reported; else it
        is taken as it stands.
    path
        Between commanded positions: ``polyline``, or a ``spline`` through them.
    tolerance
        How far that spline may be from them, a number [m] or a text with its unit; through them if
        None.
    measured
        Where the actual position was measured: ``motor``, ``scale`` or ``tool``. It decides which
        causes can be in it.
    pitch
        Period of cyclic errors, such as the lead of a screw, for all axes or one each: numbers [m]
        or texts; looked for if None.
    circular
        Whether a circular test is looked for.
    **reading
        Options of :func:`~contourlab.logs.read_log`, with a file.

    Returns
    -------
    Evaluation
        Figures in SI, warnings, causes, the worst points.

    Raises
    ------
    LogError
        The log cannot be read or judged, or the part does not match it.
    PartError
        The part cannot be read.
    ConfigurationError
        An option that is not allowed.
    """
    if path not in PATHS:
        raise ConfigurationError(f"unknown path {path!r}; {choices(path, PATHS)}")
    check_side(measured)
    within = None if tolerance is None else metres(tolerance, "tolerance")
    if within is not None and path != "spline":
        raise ConfigurationError("tolerance goes with path = 'spline': lines join every position")
    read = _log(log, reading)
    if read.n_samples < LEAST:
        raise LogError(
            f"{read.source}: {read.n_samples} samples are left: a contour error takes {LEAST} or "
            "more"
        )
    rotary = track_axes(read.rotary) if read.rotary is not None else ()
    beside = [
        f"{' and '.join(read.rotary.axes)}: rotary, so tracked by itself and in no contour error; "
        "where it moves, that of the other axes is not the tool's on the part, which takes the "
        "kinematic chain"
    ] if read.rotary is not None else []  # fmt: skip
    if read.dimension != "length":
        raise LogError(_angles(read))
    if not 2 <= read.n_axes <= 3:
        raise LogError(
            f"{read.source}: a contour error takes 2 or 3 axes, got {read.n_axes} "
            f"({', '.join(read.axes)}): name their columns with commanded and actual"
            + "".join(f"; {one.axis} is rotary: {one.in_words()}" for one in rotary)
        )
    pitches = _pitches(pitch, read.n_axes)
    if contour is None and read.commanded is None:
        raise LogError(
            f"{read.source}: without commanded positions there is no path: name their columns with "
            "commanded, or give a part with contour"
        )
    breaks = find_breaks(read)
    part: Part | None = None
    alignment: Alignment | None = None
    own = np.zeros(read.n_samples)
    said: list[str] = []
    if contour is None:
        assert read.commanded is not None
        judged = against_commanded(
            read.commanded, read.actual, breaks.jumps, breaks.held, spline=path == "spline",
            tolerance=within,
        )  # fmt: skip
    else:
        part, line = _contour(contour, read.axes)
        cuts = None if part is None else ~part.rapid
        judged, alignment, own, said = _against_part(read, breaks, line, cuts, fit=align_part)
    good = np.isfinite(judged.error)
    if not good.any():
        raise LogError(f"{read.source}: no sample can be judged")
    resolution = find_resolution(
        read, breaks, judged.tangent, good, spline=path == "spline" and contour is None,
        part=contour is not None,
    )  # fmt: skip
    recording = _recording(read, judged)
    metrics = _metrics(recording, read, judged, good, resolution)
    causes: tuple[Cause, ...] = ()
    cause_warnings: tuple[str, ...] = ()
    if read.commanded is not None:
        causes, cause_warnings = _causes(read, breaks, judged, own, measured, pitches, resolution)
    test = None
    if circular:
        test = find_circular_test(read, breaks.held, measured)
    if test is not None:
        pair = [read.axes.index(axis) for axis in test.axes]
        step = np.asarray(resolution.actual_step)[pair]
        test = replace(test, half_width=0.5 * float(np.linalg.norm(step)))
    warnings = [*read.warnings, *said, *resolution.warnings, *_worth(metrics), *cause_warnings]
    if test is not None:
        warnings += list(test.warnings)
    few = _few(int(good.sum()))
    if few:
        warnings.insert(0, few)
    left = int((~good & ~breaks.held).sum())
    if left and contour is None:
        warnings.append(f"{left} samples lie beyond the ends of the recorded path: not judged")
    options = {
        "contour error against": "the part"
        if contour is not None
        else f"the {path} through commands",
        "position measured on": measured or "not stated",
    }
    return Evaluation(
        log=read, recording=recording, metrics=metrics,
        warnings=tuple(dict.fromkeys([*warnings, *beside])),
        causes=causes, worst=_worst(read, judged, good, resolution, causes, part),
        resolution=resolution, circular=test, part=part, alignment=alignment, judged=good,
        piece=judged.piece, foot=judged.foot, options=options, rotary=rotary,
    )  # fmt: skip


def _angles(read: Log) -> str:
    """Return why angles alone have no contour error, and what can be said of them."""
    said = (
        f"{read.source}: a contour error is a length at the tool, and the positions are angles: "
        "that takes the kinematic chain, which is not in a log"
    )
    if any(use.role == "actual" and not use.unit_stated for use in read.columns):
        said += " (taken for deg by the letters A, B, C: state unit if they are lengths)"
    axes = "; ".join(f"{one.axis}: {one.in_words()}" for one in track_axes(read))
    return f"{said}. How the axes follow, each in its own unit: {axes}" if axes else said


def _few(n: int) -> str:
    """Return what cannot be said of so few judged samples; empty if there are enough."""
    if n >= FEW:
        return ""
    known = f", its rms is known to {100.0 / (2.0 * n) ** 0.5:.0f} % at best"
    return (
        f"no more than {n} sample{'s' if n > 1 else ''} can be judged: the largest error is that "
        f"of these instants{known}, and what was between them is not in the log"
    )


def _log(log: str | os.PathLike[str] | Log | Recording, reading: dict[str, Any]) -> Log:
    if isinstance(log, str | os.PathLike):
        return read_log(log, **reading)
    if isinstance(log, Recording):
        return read_log(
            of_recording(log, str(log.dataset.attrs.get("controller", "recording"))), **reading
        )
    if reading:
        raise ConfigurationError(f"{', '.join(reading)} go with a file: the log was read already")
    return log


def _pitches(pitch: Any, n_axes: int) -> tuple[float, ...] | None:
    if pitch is None:
        return None
    given = pitch.split(",") if isinstance(pitch, str) else pitch
    several = list(given) if isinstance(given, list | tuple) else [given]
    sizes = tuple(metres(one.strip() if isinstance(one, str) else one, "pitch") for one in several)
    if len(sizes) not in (1, n_axes):
        raise ConfigurationError(f"pitch must have one value or {n_axes}, got {len(sizes)}")
    return sizes * n_axes if len(sizes) == 1 else sizes


def _contour(contour: Any, axes: tuple[str, ...]) -> tuple[Part | None, Path]:
    if isinstance(contour, str | os.PathLike):
        contour = read_part(contour, axes)
    if isinstance(contour, Part):
        return contour, contour.path
    if isinstance(contour, Path):
        return None, contour
    if isinstance(contour, Contour):
        return None, Path.from_contour(contour, 1e-9)
    raise ConfigurationError(f"contour must be a part file, a part or a contour, got {contour!r}")


def _against_part(
    log: Log, breaks: Breaks, path: Path, cuts: Values | None, *, fit: bool
) -> tuple[Judged, Alignment, Values, list[str]]:
    """Return the log against a part, and what its commands leave of it along the normal."""
    leading = log.actual if log.commanded is None else log.commanded
    step = np.linalg.norm(np.diff(leading, axis=0, prepend=leading[:1]), axis=1)
    moving = (step > 0.0) & ~breaks.held
    if moving.sum() < 3:
        raise LogError(f"{log.source}: nothing moves between its breaks")
    found = align(path, leading[moving], fit=fit, cuts=cuts)
    placed = found.to_part(leading)
    place, away = follow(path, placed)
    extent = float(np.ptp(np.concatenate([placed[moving], _ends(path)]), axis=0).max())
    limit = MATCH * extent
    on_part = (away <= limit) & ~breaks.held
    share = float((on_part & moving).sum() / moving.sum())
    how = "after it was laid on it" if fit else "as it stands; it was not aligned"
    if share < 0.5:
        raise LogError(
            f"{log.source}: the part does not match the log: half of the commanded positions are "
            f"more than {found.median * 1e3:.4g} mm from it {how}, up to "
            f"{found.largest * 1e3:.4g} mm"
        )
    judged = against_path(path, found.to_part(log.actual), place)
    error = np.where(on_part, judged.error, np.nan)
    pieces = np.unique(judged.piece[on_part & moving])
    lengths = np.diff(np.asarray(path.breaks))
    if cuts is not None and cuts.any():
        lengths = np.where(cuts, lengths, 0.0)  # a rapid need not be in the log
    covered = float(lengths[pieces].sum() / lengths.sum())
    found = replace(found, on_part=share, covered=min(covered, 1.0))
    said = []
    if share < 0.98:
        said.append(
            f"{100 * (1 - share):.3g} % of the moving samples are more than {limit * 1e3:.3g} mm "
            f"from the part, up to {found.largest * 1e3:.4g} mm: an approach, or the part is "
            "another one; they are not judged"
        )
    if covered < 0.9:
        said.append(f"the log runs along {100 * covered:.3g} % of the part")
    turned = judged._replace(
        error=error, vector=found.to_machine(judged.vector),
        tangent=found.to_machine(judged.tangent), foot=log.actual + found.to_machine(judged.vector),
    )  # fmt: skip
    # along the same normal: n·(f - r) is the commands' own part and what lag does on curves
    commands = np.zeros(log.n_samples)
    if log.commanded is not None:
        own = against_path(path, placed, place)
        commands = np.where(np.isfinite(error), own.error, 0.0)
        if path.n_axes == 3:
            normal = _normals(turned, error)
            commands = np.nan_to_num(np.einsum("ij,ij->i", normal, found.to_machine(own.vector)))
    return turned, found, commands, said


def _ends(path: Path) -> Values:
    return np.stack(
        [np.asarray(path.position(path.domain[0])), np.asarray(path.position(path.domain[1]))]
    )


def _normals(judged: Judged, error: Values) -> Values:
    """Return unit vectors on which the contour error is measured; NaN where none is."""
    if judged.vector.shape[1] == 2:
        normal = np.column_stack([-judged.tangent[:, 1], judged.tangent[:, 0]])
        # at corners and ends the vector is no normal of the path
        size = np.linalg.norm(judged.vector, axis=1)
        along = np.abs(np.einsum("ij,ij->i", judged.vector, judged.tangent))
        bent = (along > 1e-6 * size) & (size > 0.0)
        own = judged.vector / np.where(size > 0.0, size, 1.0)[:, None]
        normal = np.where(bent[:, None], own * np.sign(error)[:, None], normal)
    else:
        size = np.linalg.norm(judged.vector, axis=1)
        normal = judged.vector / np.where(size > 0.0, size, 1.0)[:, None]
    return np.where(np.isfinite(error)[:, None], normal, np.nan)


def _recording(log: Log, judged: Judged) -> Recording:
    recording = log.recording()
    data = recording.dataset
    metre = {"units": "m"}
    data["contour_error"] = ("time", judged.error, metre)
    data["contour_error_vector"] = (("time", "coordinate"), judged.vector, metre)
    data["tool"] = (("time", "coordinate"), log.actual, metre)
    data["foot_parameter"] = ("time", judged.parameter, metre)
    if log.commanded is not None:
        lag = np.einsum("ij,ij->i", log.commanded - log.actual, judged.tangent)
        data["lag_error"] = ("time", lag, metre)
    return recording


def _metrics(
    recording: Recording, log: Log, judged: Judged, good: Values, resolution: Resolution
) -> dict[str, MetricValue]:
    kept = Recording(recording.dataset.isel(time=np.flatnonzero(good)))
    metrics: dict[str, MetricValue] = {
        name: kept.metrics[name]
        for name in ("contour_error_rms", "contour_error_max", "contour_error_mean")
    }
    error = np.abs(judged.error[good])
    half = resolution.half_width[good]
    metrics["contour_error_max_uncertainty"] = float(half[int(error.argmax())])
    # by which the rms may be off: no more than the mean square of what each sample may be off
    metrics["contour_error_rms_uncertainty"] = float(np.sqrt(np.mean(half**2)))
    metrics["contour_error_floor_rms"] = resolution.floor_rms
    if log.commanded is not None:
        metrics["tracking_error_rms"] = kept.metrics["tracking_error_rms"]
        metrics["tracking_error_max"] = kept.metrics["tracking_error_max"]
        tracking = np.linalg.norm(np.asarray(kept["tracking_error"]), axis=1)
        half = resolution.tracking_half_width[good]
        metrics["tracking_error_max_uncertainty"] = float(half[int(tracking.argmax())])
        metrics["tracking_error_floor_rms"] = resolution.tracking_floor_rms
        lag = np.asarray(kept["lag_error"])
        metrics["lag_error_rms"] = float(np.sqrt(np.mean(lag**2)))
        metrics["lag_error_max"] = float(np.abs(lag).max())
        own = np.abs(np.asarray(kept["tracking_error"]))
        metrics["axis_tracking_error_max"] = [float(v) for v in own.max(axis=0)]
    metrics["path_length"] = judged.length
    metrics["judged_samples"] = float(good.sum())
    if log.timed:
        metrics["cycle_time"] = log.duration
    return metrics


def _worth(metrics: dict[str, MetricValue]) -> list[str]:
    from contourlab.units import to_um

    largest, half = metrics["contour_error_max"], metrics["contour_error_max_uncertainty"]
    rms, floor = metrics["contour_error_rms"], metrics["contour_error_floor_rms"]
    assert isinstance(largest, float)
    assert isinstance(half, float)
    assert isinstance(rms, float)
    assert isinstance(floor, float)
    said = []
    if half > 0.5 * largest:
        known = (
            f"the largest contour error, {to_um(largest)} um, is known to ± {to_um(half)} um only"
        )
        coarse = ": the log is too coarse to tell it from none" if half >= largest else ""
        said.append(known + coarse)
    if floor > 0.5 * rms:
        said.append(
            f"a machine without any error would show {to_um(floor)} um rms in this log, by its "
            f"grid alone, and this one shows {to_um(rms)} um"
        )
    return said


def _causes(
    log: Log, breaks: Breaks, judged: Judged, own: Values, measured: str | None,
    pitches: tuple[float, ...] | None, resolution: Resolution,
) -> tuple[tuple[Cause, ...], tuple[str, ...]]:  # fmt: skip
    assert log.commanded is not None
    error = judged.error
    parts = stretches(log.n_samples, np.union1d(breaks.jumps, breaks.gaps))
    step = np.maximum(np.asarray(resolution.actual_step), np.asarray(resolution.commanded_step))
    record = Record(
        axes=log.axes, commanded=log.commanded, actual=log.actual, normal=_normals(judged, error),
        error=error, own=np.where(np.isfinite(error), own, 0.0), parts=parts,
        sample_time=log.sample_time, timed=log.timed, step=step,
    )  # fmt: skip
    from contourlab.evaluation.causes.decompose import usable_rows

    rms = float(np.sqrt(np.nanmean(error**2)))
    if len(usable_rows(record)) < 100:
        return (), ("too few connected samples to tell where the error comes from",)
    if rms < ROUNDING * float(np.nanmax(np.abs(log.commanded))):
        return (), ("the contour error is no more than rounding: there is nothing to explain",)
    if resolution.floor_rms > 0.7 * rms:
        return (), (
            "where the error comes from is not looked for: it is not above what the grid of the "
            "log makes",
        )
    found = decompose(record, measured=measured, pitch=pitches)
    return found.causes, found.warnings


def _worst(
    log: Log, judged: Judged, good: Values, resolution: Resolution, causes: tuple[Cause, ...],
    part: Part | None,
) -> tuple[WorstPoint, ...]:  # fmt: skip
    """Return the largest errors, each from a place of its own."""
    size = np.where(good, np.abs(judged.error), -1.0)
    apart = 0.03 * float(np.ptp(log.actual[good], axis=0).max())
    found: list[WorstPoint] = []
    order = np.argsort(size)[::-1][:50_000]
    for row in order.tolist():
        if size[row] <= 0.0 or len(found) >= WORST:
            break
        here = log.actual[row]
        if any(np.linalg.norm(here - other.position) < apart for other in found):
            continue
        place = float(judged.parameter[row])
        where = f"{place * 1e3:.4g} mm along the path"
        if part is not None and 0 <= judged.piece[row] < part.n_pieces:
            where = part.describe(int(judged.piece[row]))
        signals = [(abs(float(c.signal[row])), c.name) for c in causes if c.signal is not None]
        found.append(WorstPoint(
            row=row, time=float(log.time[row]), error=float(judged.error[row]),
            half_width=float(resolution.half_width[row]),
            position=tuple(float(v) for v in log.actual[row]), where=where,
            cause=max(signals)[1] if signals else "",
        ))  # fmt: skip
    return tuple(found)
