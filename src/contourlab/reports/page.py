"""The report of a comparison as one HTML page.

``#magnification=500`` at the end of the page's address sets the factor.
"""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from contourlab.reports.canvas import SHOWN_STOPS
from contourlab.reports.closeup import closeup
from contourlab.reports.corner_table import corner_columns
from contourlab.reports.decimation import kept_rows, shape_rows, spans
from contourlab.reports.drawing import FAR_WORSE, Drawing, Run, make_drawing
from contourlab.reports.feed_strip import feed_strip, said, strip_svg
from contourlab.reports.html import packed, page_text, write_page
from contourlab.reports.panels import Panel, command_panels, tracking_panels
from contourlab.reports.provenance import provenance
from contourlab.reports.spread_table import SPREAD_METRICS, spread_rows, spread_sentences
from contourlab.reports.strips import Strip, strips_of
from contourlab.reports.wording import command_limits, result_sentences, table_columns

if TYPE_CHECKING:
    from contourlab.simulation.comparison import Comparison

__all__ = ["write_report"]

CURVE_POINTS = 12_000
DATA_BYTES = 4_000_000
"""Room for the curves of all controllers; with many of them each is drawn with fewer points."""


def write_report(
    comparison: Comparison,
    file: str | FilePath,
    *,
    magnification: float | None = None,
    force: bool = False,
) -> FilePath:
    """Write a comparison as one self-contained HTML page; opens without a network.

    Parameters
    ----------
    comparison
        With one recording or more.
    file
        Where, usually ``.html``.
    magnification
        Factor by which deviations from the path are drawn larger at first (the reader can change
        it); chosen from the data if None.
    force
        Whether an existing file may be replaced.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    OutputError
        The file exists already, or cannot be written.
    ConfigurationError
        The factor is not a finite number > 0.
    """
    return write_page(lambda: _page(make_drawing(comparison, magnification)), file, force=force)


def _page(drawing: Drawing) -> str:
    comparison = drawing.comparison
    rows = _points_per_curve(drawing)
    return page_text(
        "report.html",
        styles=(),
        scripts=("runs.js", "figures.js", "axis_figures.js", "report.js"),
        data=_payload(drawing, rows),
        looks=[run.look for run in drawing.runs],
        title=comparison.title or "Contouring comparison",
        sentences=[*result_sentences(drawing), *spread_sentences(comparison)],
        columns=table_columns(comparison),
        runs=drawing.runs,
        rows=_rows(drawing),
        several=comparison.several,
        one_motion=drawing.one_motion,
        feeds=_feeds(comparison),
        spread=spread_rows(comparison),
        spread_heads=[title for _, title in SPREAD_METRICS],
        corners=corner_columns(comparison),
        n_corners=max((len(passes) for passes in comparison.corners.values()), default=0),
        corner_radius=f"{comparison.corner_radius * 1e3:.4g}",
        has_path=drawing.shown > 1,
        has_closeups=drawing.shown > 1 and bool(drawing.good),
        signed=drawing.signed,
        projection=drawing.projection,
        unlocated=not any(run.line.any() for run in drawing.runs),
        stops=len(drawing.stops.time),
        stops_drawn=len(drawing.stops.time) <= SHOWN_STOPS,
        has_commands=bool(command_panels(drawing)),
        has_tracking=bool(tracking_panels(drawing)),
        thinned=[(run.name, len(run.time)) for run in drawing.runs if len(run.time) > rows],
        points_per_curve=rows,
        warnings=_warnings(drawing),
        provenance=provenance(comparison),
    )


def _rows(drawing: Drawing) -> list[dict[str, Any]]:
    """Return the rows of the table: the number of a run, or why there is none."""
    comparison = drawing.comparison
    numbers = {run.name: number for number, run in enumerate(drawing.runs)}
    rows = []
    for name in comparison.rows:
        machine, controller = comparison.pair(name)
        refusal = comparison.refusals.get(name)
        word, _, reason = ("" if refusal is None else refusal.status).partition(": ")
        rows.append(
            {"machine": machine, "controller": controller, "run": numbers.get(name),
             "refused": word, "reason": reason}
        )  # fmt: skip
    return rows


def _feeds(comparison: Comparison) -> list[dict[str, Any]]:
    """Return for each plan its drawing and the shares of the limits that bind."""
    from markupsafe import Markup

    found = []
    for name, plan in comparison.plans.items():
        strip = feed_strip(plan, comparison.part)
        label = "planned feed along the path" + (f", {name}" if len(comparison.plans) > 1 else "")
        found.append(
            {
                "name": name if len(comparison.plans) > 1 else "",
                "svg": Markup(strip_svg(strip, label)),
                "note": strip.note,
                "cycle_time": f"{strip.cycle_time:.4g}",
                "shares": [
                    (strip.colour(limit), said(limit), f"{100 * share:.3g}")
                    for limit, share in strip.shares
                ],
            }
        )
    return found


def _warnings(drawing: Drawing) -> list[tuple[int | None, str, str]]:
    """Return all warnings once each: number of the controller if it is one's own, who, what."""
    comparison = drawing.comparison
    references = comparison.reference_warnings
    common = list(dict.fromkeys(text for said in references.values() for text in said))
    of_part = list(comparison.part.warnings) if comparison.part is not None else []
    found: list[tuple[int | None, str, str]] = [(None, "part", text) for text in of_part]
    for text in common:
        if text not in of_part:
            of = [name for name, said in references.items() if text in said]
            who = "reference" if len(of) == len(references) else f"reference of {', '.join(of)}"
            found.append((None, who, text))
    for k, run in enumerate(drawing.runs):
        found += [(k, run.name, text) for text in run.recording.warnings if text not in common]
    return found


def _points_per_curve(drawing: Drawing) -> int:
    n_axes = len(np.asarray(drawing.runs[0].recording["axis"]))
    numbers = 4 + 2 * len(drawing.coordinates) + 2 + 2 * n_axes
    return int(min(CURVE_POINTS, DATA_BYTES / (len(drawing.runs) * numbers * 5.4)))


def _payload(drawing: Drawing, n_points: int) -> dict[str, Any]:
    runs = [_run(drawing, run, n_points) for run in drawing.runs]
    numbers = {run.name: k for k, run in enumerate(drawing.runs)}
    lines = {int(n) for run in runs for n in np.unique(run.pop("_lines"))}
    lines |= {int(n) for n in drawing.stops.line}
    shown = drawing.shown
    return {
        "magnification": drawing.magnification,
        "coordinates": list(drawing.coordinates),
        "shown": shown,
        "signed": drawing.signed,
        "far_worse": FAR_WORSE,
        "commands": [_panel(panel, numbers, limited=True) for panel in command_panels(drawing)],
        "tracking": [_panel(panel, numbers) for panel in tracking_panels(drawing)],
        "spread": [
            {
                "title": strips.title,
                "logarithmic": strips.logarithmic,
                "rows": [_strip(strip, numbers[strip.run.name]) for strip in strips.rows],
            }
            for strips in strips_of(drawing)
        ],
        "lines": {str(n): drawing.line_text(n) for n in sorted(lines) if n},
        "path": [packed(column * 1e3) for column in drawing.path[:, :shown].T],
        "stops": {
            "time": drawing.stops.time.tolist(),
            "distance": (drawing.stops.distance * 1e3).tolist(),
            "position": (drawing.stops.position[:, :shown].T * 1e3).tolist(),
            "line": drawing.stops.line.tolist(),
            "lines_shown": len(drawing.stops.time) <= SHOWN_STOPS,
            "times_shown": drawing.one_motion,
        },
        "runs": runs,
    }


def _panel(panel: Panel, numbers: dict[str, int], *, limited: bool = False) -> dict[str, Any]:
    return {
        "axis": panel.axis,
        "title": panel.title,
        "unit": panel.unit,
        **({"limit": _finite(panel.limit)} if limited else {}),
        "runs": [numbers[run.name] for run in panel.runs],
    }


def _strip(strip: Strip, number: int) -> dict[str, Any]:
    return {
        "run": number,
        "values": packed(strip.values),
        "offset": packed(strip.offset),
        "low": _finite(strip.low),
        "median": _finite(strip.median),
        "high": _finite(strip.high),
        "nominal": _finite(strip.nominal),
        "samples": strip.n_samples,
        "diverged": strip.n_diverged,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _run(drawing: Drawing, run: Run, n_points: int) -> dict[str, Any]:
    n = len(run.time)
    shape = shape_rows(run.foot, n_points // 2)
    kept = np.union1d(kept_rows(n, n_points // 2, [run.error]), shape)
    mm, um = 1e3, 1e6
    shown = drawing.shown
    worst = None
    if run.worst is not None:
        worst = {
            "row": int(np.searchsorted(kept, run.worst)),
            "where": drawing.where(run, run.worst, text=False),
        }
    return {
        "name": run.name,
        "light": run.look.light,
        "dark": run.look.dark,
        "dash": run.look.dash,
        "symbol": run.look.symbol,
        "diverged": run.diverged,
        "cut": n < run.recording.n_samples,
        "status": run.status,
        "worst": worst,
        "time": packed(run.time[kept]),
        "distance": packed(run.distance[kept] * mm),
        "error": packed(run.error[kept] * um),
        "foot": [packed(column * mm) for column in run.foot[kept, :shown].T],
        "vector": [packed(column * mm) for column in run.vector[kept, :shown].T],
        "line": packed(run.line[kept]),
        "_lines": run.line[kept],
        "axes": _axis_curves(run, n_points),
        "closeup": _closeup(drawing, run),
    }


def _axis_curves(run: Run, n_points: int) -> dict[str, Any]:
    """Return commands and tracking errors per axis, and when each command was at its limit."""
    dataset, n = run.recording.dataset, len(run.time)
    curves = {
        name: np.asarray(dataset[name], float)[:n].T * scale
        for name, scale in (("command", 1.0), ("tracking_error", 1e6))
        if name in dataset
    }
    kept = kept_rows(n, n_points, [row for rows in curves.values() for row in rows])
    saturated = []
    if "command" in curves:
        for command, limit in zip(curves["command"], command_limits(run.recording), strict=True):
            at = spans(np.abs(command) >= limit * (1.0 - 1e-12), gap=n // 500)
            saturated.append([[run.time[a], run.time[min(b + 1, n - 1)]] for a, b in at])
    return {
        "time": packed(run.time[kept]),
        "distance": packed(run.distance[kept] * 1e3),
        "saturated": saturated,
        **{name: [packed(row[kept]) for row in rows] for name, rows in curves.items()},
    }


def _closeup(drawing: Drawing, run: Run) -> dict[str, Any] | None:
    near = closeup(drawing, run)
    if near is None:
        return None
    numbers = {run.name: k for k, run in enumerate(drawing.runs)}
    return {
        "half": near.half * 1e6,
        "axes": list(near.axes),
        "path": (near.path.T * 1e6).round(4).tolist(),
        "tracks": [
            {"run": numbers[name], "points": (track.T * 1e6).round(4).tolist()}
            for name, track in near.tracks.items()
        ],
        "actual": (near.actual * 1e6).tolist(),
        "reference": (near.reference * 1e6).tolist(),
        "lag": near.lag * 1e6,
    }
