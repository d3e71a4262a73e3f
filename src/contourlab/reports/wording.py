"""The result in words and as a table, for the page and the terminal alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from contourlab.units import to_um

if TYPE_CHECKING:
    from contourlab.recordings.metrics import MetricValue
    from contourlab.recordings.recording import Recording
    from contourlab.reports.drawing import Drawing, Run
    from contourlab.simulation.comparison import Comparison

__all__ = ["Cell", "Column", "command_limits", "command_unit", "result_sentences", "table_columns"]

NONE = "–"
NAMED = 4
"""So many laws that were refused are named in a sentence."""
MICRONS = "\u00a0µm"  # a number and its unit stay on one line


@dataclass(frozen=True)
class Cell:
    """One value as text."""

    text: str
    best: bool = False


@dataclass(frozen=True)
class Column:
    """One column of the table: a group such as ``contour error``, a name in it, its unit."""

    group: str
    name: str
    unit: str
    cells: tuple[Cell, ...]
    note: str = ""
    """What else the head says, such as the limit of a command."""


def table_columns(comparison: Comparison) -> list[Column]:
    """Return the table of a comparison, one cell per run in each column.

    The best value of a column is marked where the values differ as they are printed, on each
    machine by itself; commands are not ranked.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    recordings = list(comparison.recordings.values())
    metrics = [dict(recording.metrics) for recording in recordings]
    machines = [comparison.pair(name)[0] for name in comparison.recordings]
    columns = []
    for group, name, key in (
        ("contour error", "rms", "contour_error_rms"),
        ("contour error", "max", "contour_error_max"),
        ("contour error", "mean", "contour_error_mean"),
        ("tracking error", "rms", "tracking_error_rms"),
        ("tracking error", "max", "tracking_error_max"),
        ("estimate error", "rms", "estimate_error_rms"),
        ("estimate error", "max", "estimate_error_max"),
    ):
        column = _column(metrics, machines, key, group, name, "µm")
        if column is not None:
            columns.append(column)
    columns += _command_columns(recordings, metrics)
    for name, key in (("at limit", "saturation_time"), ("cycle", "cycle_time")):
        column = _column(metrics, machines, key, "time", name, "s")
        if column is not None:
            columns.append(column)
    return columns


def _column(
    metrics: Sequence[dict[str, MetricValue]], machines: Sequence[str], key: str, group: str,
    name: str, unit: str,
) -> Column | None:  # fmt: skip
    if not any(key in held for held in metrics):
        return None
    values = []
    for held in metrics:
        value = held.get(key, math.nan)
        values.append(math.nan if isinstance(value, list) else float(value))
    texts = [_um(v) if unit == "µm" else significant(v, 4) for v in values]
    least = {}
    for machine in set(machines):
        finite = [
            (v, text)
            for v, text, where in zip(values, texts, machines, strict=True)
            if where == machine and math.isfinite(v)
        ]
        least[machine] = min(finite)[1] if len({text for _, text in finite}) > 1 else None
    cells = (Cell(t, t == least[where]) for t, where in zip(texts, machines, strict=True))
    return Column(group, name, unit, tuple(cells))


def _command_columns(
    recordings: Sequence[Recording], metrics: Sequence[dict[str, MetricValue]]
) -> list[Column]:
    if not any("command_max" in held for held in metrics):
        return []
    held = [r for r in recordings if "command" in r.dataset]
    first = held[0]
    units, limits = {command_unit(r) for r in held}, command_limits(first)
    unit = command_unit(first) if len(units) == 1 else ""
    columns = []
    for axis, label in enumerate(np.asarray(first["axis"])):
        cells = []
        for recording, metric in zip(recordings, metrics, strict=True):
            value = metric.get("command_max", math.nan)
            single = value[axis] if isinstance(value, list) else math.nan
            own = "" if unit or not math.isfinite(single) else f"\u00a0{command_unit(recording)}"
            cells.append(Cell(significant(single, 3) + own))
        limit = limits[axis]
        note = f"limit {limit:.4g}" if math.isfinite(limit) else "no limit"
        if len({command_limits(r)[axis] for r in held}) > 1:
            note = "limits differ"
        columns.append(Column("command max", str(label), unit, tuple(cells), note))
    return columns


def command_unit(recording: Recording) -> str:
    """Return the unit of the commands, such as V.

    Parameters
    ----------
    recording
        That holds ``command``.
    """
    return str(recording["command"].attrs.get("units", ""))


def command_limits(recording: Recording) -> list[float]:
    """Return the limit of each axis' command; infinite if there is none.

    Parameters
    ----------
    recording
        That holds ``command``.
    """
    if "command_limit" not in recording.dataset:
        return [math.inf] * int(recording.dataset.sizes["axis"])
    return [float(limit) for limit in np.asarray(recording["command_limit"])]


def significant(value: float, digits: int) -> str:
    """Return a number with so many significant digits and no exponent where it can be avoided.

    Parameters
    ----------
    value
        A number; not finite ones give a dash.
    digits
        How many.
    """
    if not math.isfinite(value):
        return NONE
    size = abs(value)
    if size == 0.0:
        return "0"
    if not 1e-4 <= size < 1e7:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"


def _um(metres: float) -> str:
    return to_um(metres) if math.isfinite(metres) else NONE


def result_sentences(drawing: Drawing) -> list[str]:
    """Return the result in plain words; the first sentence is the answer.

    Parameters
    ----------
    drawing
        Of the comparison.
    """
    refused = _refused(drawing.comparison)
    if drawing.comparison.several:
        return [*_several_machines(drawing), *refused]
    lost = [run for run in drawing.runs if run.diverged]
    ranked = sorted(
        (run for run in drawing.good if math.isfinite(_rms(run))), key=lambda run: _rms(run)
    )
    if not ranked:
        return [*_nobody(drawing.runs, lost), *refused]
    best = ranked[0]
    worst = "" if best.worst is None else drawing.where(best, best.worst)
    figures = f"{_um(_rms(best))}{MICRONS} rms, {_um(_max(best))}{MICRONS} at worst"
    sentences = []
    equal = [run.name for run in ranked if _um(_rms(run)) == _um(_rms(best))]
    if len(drawing.runs) == 1:
        sentences.append(
            f"{best.name} keeps the tool within {_um(_max(best))}{MICRONS} of the path: "
            f"{_um(_rms(best))}{MICRONS} rms, worst at {worst}."
        )
    elif len(ranked) == 1:
        sentences.append(
            f"{best.name} is the only controller that did not diverge: {figures} ({worst})."
        )
    elif len(equal) > 1:
        sentences.append(
            f"{_listed(equal)} keep the tool equally close to the path: {figures} ({worst})."
        )
    else:
        sentences.append(f"{best.name} keeps the tool closest to the path: {figures} ({worst}).")
        second = ranked[1]
        sentences.append(f"Next is {second.name} with {_um(_rms(second))}{MICRONS} rms.")
    calm = min(ranked, key=lambda run: _max(run))
    if len(ranked) > 1 and _um(_max(calm)) != _um(_max(best)):
        sentences.append(f"The smallest worst case is {calm.name}'s: {_um(_max(calm))}{MICRONS}.")
    sentences += [f"{run.name} {run.status}." for run in lost]
    return [*sentences, *refused]


def _refused(comparison: Comparison) -> list[str]:
    """Say which laws have no figures because they were refused, or failed; why is in the table."""
    sentences = []
    for failed, verb in ((False, "refused"), (True, "failed")):
        names = [name for name, one in comparison.refusals.items() if one.failed == failed]
        if not names:
            continue
        shown = _listed(names) if len(names) <= NAMED else f"{len(names)} runs"
        verb = verb if failed else f"{'was' if len(names) == 1 else 'were'} {verb}"
        sentences.append(f"{shown} {verb}; the table says why.")
    return sentences


def _several_machines(drawing: Drawing) -> list[str]:
    """Return who is best on each machine, and who is lost."""
    best: dict[str, Run | None] = {}
    comparison = drawing.comparison
    for machine in dict.fromkeys(comparison.pair(name)[0] for name in comparison.rows):
        runs = drawing.machines.get(machine, ())
        ranked = [run for run in runs if not run.diverged and math.isfinite(_rms(run))]
        best[machine] = min(ranked, key=_rms, default=None)
    lost = [f"{run.name} {run.status}." for run in drawing.runs if run.diverged]
    found = {machine: run for machine, run in best.items() if run is not None}
    if not found:
        return ["All runs diverged: there are no figures to compare.", *lost]
    size = {machine: f"{_um(_rms(run))}{MICRONS} rms" for machine, run in found.items()}
    winners = {run.controller for run in found.values()}
    if len(winners) == 1 and len(found) == len(best):
        both = "both" if len(found) == 2 else f"all {len(found)}"
        shown = _listed([f"{text} on {machine}" for machine, text in size.items()])
        head = (
            f"{next(iter(winners))} keeps the tool closest to the path on {both} machines: {shown}."
        )
    else:
        each = [f"on {m} {run.controller} ({size[m]})" for m, run in found.items()]
        head = f"Closest to the path: {_listed(each)}."
    worst = [
        f"On {machine} {run.controller} is off by {_um(_max(run))}{MICRONS} at worst "
        f"({drawing.where(run, run.worst)})."
        for machine, run in found.items()
        if run.worst is not None
    ]
    none = [
        f"On {machine} every controller diverged."
        if drawing.machines.get(machine)
        else f"On {machine} no controller runs."
        for machine in best
        if machine not in found
    ]
    return [head, *worst, *none, *lost]


def _nobody(runs: Sequence[Run], lost: Sequence[Run]) -> list[str]:
    if len(runs) == 1:
        run = runs[0]
        status = run.status if run.diverged else "has no finite contour error"
        return [f"{run.name} {status}: there are no figures."]
    if len(lost) == len(runs):
        head = f"All {len(runs)} controllers diverged: there are no figures to compare."
    else:
        head = "No controller has a finite contour error: there is nothing to compare."
    return [head, *(f"{run.name} {run.status}." for run in lost)]


def _rms(run: Run) -> float:
    return float(run.metrics.get("contour_error_rms", math.nan))  # type: ignore[arg-type]


def _max(run: Run) -> float:
    return float(run.metrics.get("contour_error_max", math.nan))  # type: ignore[arg-type]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + f" and {names[-1]}" if len(names) > 1 else names[0]
