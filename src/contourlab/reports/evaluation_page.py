"""The report of an evaluated log: one HTML page that holds everything it shows."""

from __future__ import annotations

import math
import re
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from contourlab.reports.decimation import kept_rows, shape_rows
from contourlab.reports.evaluation_table import (
    cause_figures,
    circle_rows,
    column_rows,
    figure_rows,
    headline,
    with_half_width,
)
from contourlab.reports.html import packed, page_text, write_page
from contourlab.reports.palette import look
from contourlab.reports.polar_plot import polar_plot
from contourlab.units import to_um

if TYPE_CHECKING:
    from contourlab.evaluation import Evaluation

__all__ = ["write_evaluation"]

POINTS = 20_000
DRAWN_CAUSES = 8


def write_evaluation(
    evaluation: Evaluation, file: str | FilePath, *, force: bool = False
) -> FilePath:
    """Write an evaluation as one self-contained HTML page; opens without a network.

    Parameters
    ----------
    evaluation
        What was found.
    file
        Where, usually ``.html``.
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
    """
    return write_page(lambda: _page(evaluation), file, force=force)


def _page(evaluation: Evaluation) -> str:
    from markupsafe import Markup

    import contourlab

    log, test = evaluation.log, evaluation.circular
    unit = "s" if log.timed else "samples"
    return page_text(
        "evaluation.html",
        styles=("evaluation.css",),
        scripts=("evaluation.js",),
        data=_payload(evaluation),
        title=f"Contour error of {evaluation.title}",
        sentences=[_micro(sentence) for sentence in headline(evaluation)],
        figures=[(name, _micro(value)) for name, value in figure_rows(evaluation)],
        columns=column_rows(evaluation),
        causes=[_cause(cause) for cause in evaluation.causes],
        worst=[
            (with_half_width(abs(w.error), w.half_width), f"{w.time:.6g}", w.where, w.cause)
            for w in evaluation.worst
        ],
        time_unit=unit,
        warnings=[_micro(warning) for warning in evaluation.warnings],
        polar=None if test is None else Markup(polar_plot(test)),
        circle=[(name, _micro(value)) for name, value in circle_rows(evaluation)],
        looks=[look(k) for k in range(DRAWN_CAUSES + 1)],
        signed=log.n_axes == 2,
        has_lag="lag_error" in evaluation.recording.dataset,
        facts=[
            ("log", f"{log.source}, {log.format}, {log.n_samples} samples"),
            *((name, value) for name, value in evaluation.options.items()),
            *((f"note {k}", note) for k, note in enumerate(log.notes, 1)),
            ("report written by", f"contourlab {contourlab.__version__}"),
        ],
    )


def _micro(text: str) -> str:
    """Return a text with the sign for micro, which a terminal may not have."""
    return re.sub(r" u(m|rad)\b", r" µ\1", text)


def _cause(cause: Any) -> dict[str, Any]:
    figures = math.isfinite(cause.rms)
    return {
        "name": cause.name,
        "state": cause.state,
        "rms": to_um(cause.rms) if figures else "–",
        "max": to_um(cause.max) if figures else "–",
        "share": f"{100 * cause.share:.1f}" if figures else "–",
        "bar": max(0.0, min(100.0, 100.0 * cause.share)) if figures else 0.0,
        "figures": _micro(cause_figures(cause)),
        "remedy": _micro(cause.remedy) if cause.state == "found" else "",
        "note": cause.note,
    }


def _payload(evaluation: Evaluation) -> dict[str, Any]:
    log = evaluation.log
    error = np.asarray(evaluation.recording["contour_error"], float) * 1e6
    vector = np.asarray(evaluation.recording["contour_error_vector"], float) * 1e3
    foot = evaluation.foot * 1e3
    n = log.n_samples
    shown = np.where(evaluation.judged, error, 0.0)
    kept = np.union1d(
        kept_rows(n, POINTS // 2, [shown]), shape_rows(np.nan_to_num(foot), POINTS // 2)
    )
    gaps = ~evaluation.judged[kept]

    def curve(values: Any) -> dict[str, str]:
        return packed(np.where(gaps, np.nan, np.asarray(values, float)[kept]))

    extent = float(np.nanmax(np.ptp(foot[evaluation.judged], axis=0), initial=0.0))
    largest = float(np.abs(error[evaluation.judged]).max()) * 1e-3
    factor = 1.0
    if largest > 0.0 and extent > 0.0:
        factor = float(f"{max(1.0, 0.08 * extent / largest):.1g}")
    drawn = [c for c in evaluation.causes if c.signal is not None][:DRAWN_CAUSES]
    curves = []
    if "lag_error" in evaluation.recording.dataset:
        curves.append(
            ("lag along the path", curve(np.asarray(evaluation.recording["lag_error"]) * 1e6))
        )
        tracking = np.asarray(evaluation.recording["tracking_error"]) * 1e6
        curves += [(axis, curve(column)) for axis, column in zip(log.axes, tracking.T, strict=True)]
    return {
        "timed": log.timed,
        "magnification": factor,
        "coordinates": list(log.axes),
        "time": packed(log.time[kept]),
        "error": curve(error),
        "half": curve(evaluation.resolution.half_width * 1e6),
        "foot": [curve(column) for column in foot.T[:2]],
        "vector": [curve(column) for column in vector.T[:2]],
        "causes": [
            {"name": c.name, "signal": curve(np.asarray(c.signal) * 1e6), "look": _colours(k)}
            for k, c in enumerate(drawn, 1)
        ],
        "own": _colours(0),
        "tracking": [
            {"name": name, "values": values, "look": _colours(k)}
            for k, (name, values) in enumerate(curves)
        ],
        "worst": [
            {
                "time": w.time, "error": w.error * 1e6, "where": w.where,
                "foot": [float(v) for v in foot[w.row, :2]],
                "vector": [float(v) for v in vector[w.row, :2]],
            }
            for w in evaluation.worst
        ],
    }  # fmt: skip


def _colours(number: int) -> dict[str, str]:
    style = look(number)
    return {"light": style.light, "dark": style.dark, "dash": style.dash}
