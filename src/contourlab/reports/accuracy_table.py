"""An accuracy study for the terminal, for programs and as a table in a file."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, NamedTuple

from contourlab.reports.tables import ascii_text
from contourlab.units import to_um

if TYPE_CHECKING:
    from rich.table import Table

    from contourlab.contour_errors.accuracy import AccuracyRow, AccuracyStudy, StudiedContour

__all__ = [
    "ACCURACY_FILES", "Condition", "accuracy_json", "accuracy_notes", "accuracy_tables",
    "condition_words", "conditions", "write_accuracy",
]  # fmt: skip

ACCURACY_FILES = ("accuracy.json", "accuracy.csv", "accuracy.png")
LAGS_ABREAST = 5
"""So many lags have room in 80 columns."""


class Condition(NamedTuple):
    """Rows that differ in estimator and lag only stand together."""

    contour: str
    offset: float
    feed: float
    resolution: float


def conditions(study: AccuracyStudy) -> dict[Condition, list[AccuracyRow]]:
    """Return the rows of a study by contour, offset, feed and resolution.

    Parameters
    ----------
    study
        What was found.
    """
    found: dict[Condition, list[AccuracyRow]] = {}
    for row in study.rows:
        key = Condition(row.contour, row.offset, row.feed, row.resolution)
        found.setdefault(key, []).append(row)
    return found


def condition_words(condition: Condition) -> str:
    """Return what a condition is, its contour aside.

    Parameters
    ----------
    condition
        Of the study.
    """
    resolution = condition.resolution
    encoders = f"encoders of {to_um(resolution)} µm" if resolution else "exact encoders"
    feed = f"{condition.feed * 60e3:.4g} mm/min"
    sign = "-" if condition.offset < 0.0 else ""
    return f"offset {sign}{to_um(abs(condition.offset))} µm, {feed}, {encoders}"


def accuracy_tables(study: AccuracyStudy) -> list[Table]:
    """Return a table for the terminal for each contour and condition: errors in µm over the lag.

    The words are ASCII, as in the table of a comparison.

    Parameters
    ----------
    study
        What was found.
    """
    contours = {contour.name: contour for contour in study.contours}
    return [
        _table(condition, rows, contours[condition.contour])
        for condition, rows in conditions(study).items()
    ]


def _table(condition: Condition, rows: list[AccuracyRow], contour: StudiedContour) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    lags = list(dict.fromkeys(row.lag for row in rows))
    estimators = list(dict.fromkeys(row.estimator for row in rows))
    known = {(row.estimator, row.lag): row for row in rows}
    title = f"{_contour_words(contour)}\n{condition_words(condition)}; errors in µm"
    table = Table(title=Text(ascii_text(title, keep="\n"), style="bold"), title_justify="left",
                  box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)  # fmt: skip
    table.add_column("estimator\nmean, below it max", no_wrap=len(lags) <= LAGS_ABREAST)
    for lag in lags:
        table.add_column(f"lag\n{lag * 1e3:.4g} mm", justify="right", no_wrap=True)
    table.add_column("ns per\ncall", justify="right", no_wrap=True)
    for name in estimators:
        own = [known[name, lag] for lag in lags]
        costs = [row.cost_ns for row in own if row.cost_ns is not None]
        cost = f"{max(costs):.0f}" if costs else "-"
        for field, head, end in (("error_mean", ascii_text(name), cost), ("error_max", "", "")):
            table.add_row(head, *(_um(getattr(row, field)) for row in own), end)
    return table


def _um(metres: float | None) -> str:
    """Return a length in µm that is short: below a picometre there is nothing to tell."""
    if metres is None:
        return "-"
    if metres < 1e-12:
        return "< 1e-6"
    return to_um(metres) if metres >= 1e-9 else f"{metres * 1e6:.1e}".replace("e-0", "e-")


def _contour_words(contour: StudiedContour) -> str:
    radius = 1e3 / contour.curvature_max if contour.curvature_max > 1e-9 else float("inf")
    bend = f"least radius {radius:.4g} mm" if radius < 1e6 else "straight"
    return f"{contour.name}: {contour.description}, {contour.length * 1e3:.4g} mm long, {bend}"


def accuracy_notes(study: AccuracyStudy) -> list[str]:
    """Return why figures are missing, each reason once.

    Parameters
    ----------
    study
        What was found.
    """
    reasons: dict[tuple[str, str], list[str]] = {}
    for row in study.rows:
        if row.note:
            contours = reasons.setdefault((row.estimator, row.note), [])
            if row.contour not in contours:
                contours.append(row.contour)
    return [f"{name} on {', '.join(on)}: {note}" for (name, note), on in reasons.items()]


def accuracy_json(study: AccuracyStudy, files: Iterable[FilePath] | None = None) -> dict[str, Any]:
    """Return a study as ``contourlab estimate-accuracy --json`` prints it.

    Parameters
    ----------
    study
        What was found.
    files
        Where it was written, if it was.

    Returns
    -------
    dict
        ``schema``; ``rows`` in SI with null where there is no figure, each with its ``note``;
        ``contours``; ``sample_time``, ``start_up``, ``points``; ``files``.
    """
    return {
        "schema": "contourlab.estimate-accuracy/1",
        "rows": [dataclasses.asdict(row) for row in study.rows],
        "contours": [dataclasses.asdict(contour) for contour in study.contours],
        "sample_time": study.sample_time,
        "start_up": study.start_up,
        "points": study.points,
        "files": [str(file) for file in files or ()],
    }


def write_accuracy(
    study: AccuracyStudy, folder: str | FilePath, *, force: bool = False
) -> list[FilePath]:
    """Write a study as JSON, as a table in CSV and as a figure.

    Parameters
    ----------
    study
        What was found.
    folder
        Where; made if it is missing.
    force
        Whether existing files may be replaced.

    Returns
    -------
    list of pathlib.Path
        The files.

    Raises
    ------
    OutputError
        One of the files exists already (then none is written), or the folder cannot be used.
    """
    from contourlab.recordings.files import atomic_file, refuse_existing
    from contourlab.reports.accuracy_figure import write_accuracy_figure

    files = [FilePath(folder) / name for name in ACCURACY_FILES]
    for file in files:
        refuse_existing(file, force=force)
    document, sheet, figure = files
    with atomic_file(document, force=force) as name:
        text = json.dumps(accuracy_json(study), allow_nan=False, ensure_ascii=False, indent=1)
        FilePath(name).write_text(text + "\n", encoding="utf-8")
    with atomic_file(sheet, force=force) as name, open(name, "w", newline="") as out:
        writer = csv.writer(out)
        fields = [field.name for field in dataclasses.fields(study.rows[0])]
        writer.writerow(fields)
        for row in study.rows:
            writer.writerow([_in_csv(getattr(row, field)) for field in fields])
    write_accuracy_figure(study, figure, force=force)
    return files


def _in_csv(value: Any) -> Any:
    if value is None:
        return ""
    return format(value, ".17g") if isinstance(value, float) else value
