"""PNG figures of a comparison, for documents and for the top of a README."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from contourlab.reports.canvas import (
    INK,
    MUTED,
    PATH,
    RULE,
    SHOWN_STOPS,
    bare,
    draw_error,
    draw_path,
    legend_below,
    literal,
    new_figure,
    write_png,
)
from contourlab.reports.decimation import kept_rows, spans
from contourlab.reports.drawing import Drawing, Run, make_drawing
from contourlab.reports.feed_strip import feed_figure, feed_strip
from contourlab.reports.panels import Panel, command_panels, tracking_panels
from contourlab.reports.strips import spread_figure
from contourlab.reports.wording import command_limits, result_sentences
from contourlab.units import to_um

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from contourlab.simulation.comparison import Comparison

__all__ = ["write_figures"]

CURVE_POINTS = 20_000
BARS = 6
LIMIT_SHOWN = 0.35
"""A limit is drawn if a command reaches this share of it."""


def write_figures(
    comparison: Comparison,
    folder: str | FilePath,
    *,
    magnification: float | None = None,
    force: bool = False,
) -> list[FilePath]:
    """Write a comparison as PNG: path, errors, commands, summary, feed and spread.

    Parameters
    ----------
    comparison
        With one recording or more.
    folder
        Where; made if it is missing.
    magnification
        Factor by which deviations from the path are drawn larger; chosen from the data if None.
    force
        Whether existing files may be replaced.

    Returns
    -------
    list of pathlib.Path
        The files; ``path.png`` only of two coordinates or more, ``commands.png`` and
        ``tracking_error.png`` only of what was recorded, ``spread.png`` only if values varied,
        ``feed.png`` only if the feed was planned.

    Raises
    ------
    OutputError
        One of the files exists already (then none is written), or the folder cannot be used.
    ConfigurationError
        The factor is not a finite number > 0.
    """
    from contourlab.recordings.files import refuse_existing

    makers: dict[str, Callable[[Drawing], Figure]] = {
        "path": _path_figure,
        "contour_error": _error_figure,
        "tracking_error": _tracking_figure,
        "commands": _command_figure,
        "summary": _summary_figure,
        "spread": spread_figure,
        "feed": _feed_figure,
    }
    for name, signal in (("commands", "command"), ("tracking_error", "tracking_error")):
        if not any(signal in r.dataset for r in comparison.recordings.values()):
            del makers[name]
    if np.shape(next(iter(comparison.recordings.values()))["tool"])[1] == 1:
        del makers["path"]  # of one axis alone there is no picture
    if not comparison.spread:
        del makers["spread"]
    if not comparison.plans:
        del makers["feed"]
    files = [FilePath(folder) / f"{name}.png" for name in makers]
    for file in files:
        refuse_existing(file, force=force)
    drawing = make_drawing(comparison, magnification)
    for file, make in zip(files, makers.values(), strict=True):
        write_png(make(drawing), file, force=force)
    return files


def _feed_figure(drawing: Drawing) -> Figure:
    comparison = drawing.comparison
    several = len(comparison.plans) > 1
    return feed_figure(
        [
            (name if several else "", feed_strip(plan, comparison.part))
            for name, plan in comparison.plans.items()
        ]
    )


def _path_figure(drawing: Drawing) -> Figure:
    box = np.ptp(drawing.path[:, :2], axis=0)
    height = float(np.clip(8.6 * box[1] / max(box[0], 1e-12), 3.0, 8.0))
    height = height if drawing.shown == 2 else 6.5
    figure = new_figure(9.6, height + 1.3 + 0.24 * len(drawing.runs))
    axes = figure.add_subplot(projection="3d") if drawing.shown == 3 else figure.add_subplot()
    draw_path(axes, drawing)
    axes.set_title(_path_title(drawing), loc="left", fontsize=11, color=INK)
    legend_below(figure, drawing, worst=True)
    return figure


def _path_title(drawing: Drawing) -> str:
    factor = f"{drawing.magnification:.6g}"
    return f"The path; deviation drawn {factor} × larger" + (
        f"\n{drawing.projection}" if drawing.projection else ""
    )


def _error_figure(drawing: Drawing) -> Figure:
    figure = new_figure(10.0, 6.2 + 0.24 * len(drawing.runs))
    upper, lower = figure.subplots(2, 1, sharey=True)
    draw_error(upper, drawing, "distance")
    draw_error(lower, drawing, "time")
    upper.set_xlabel("distance along the path [mm]", color=MUTED)
    lower.set_xlabel("time [s]", color=MUTED)
    upper.set_title("Contour error", loc="left", fontsize=11, color=INK)
    if len(drawing.stops.time):
        upper.set_title("dotted: exact stops", loc="right", fontsize=9, color=MUTED)
    legend_below(figure, drawing, worst=True)
    return figure


def _command_figure(drawing: Drawing) -> Figure:
    panels = command_panels(drawing)
    figure, rows = _axis_figure(drawing, panels)
    for panel, axes in zip(panels, rows, strict=True):
        for run in drawing.worst_first:
            if run in panel.runs:
                _draw_command(axes, run, panel.axis)
        title = literal(panel.title, 50) + _draw_limit(axes, panel)
        axes.set_title(title, loc="left", fontsize=10, color=INK)
        axes.set_ylabel(f"command [{panel.unit}]", color=MUTED)
    return figure


def _tracking_figure(drawing: Drawing) -> Figure:
    panels = tracking_panels(drawing)
    figure, rows = _axis_figure(drawing, panels)
    for panel, axes in zip(panels, rows, strict=True):
        _draw_tracking(axes, drawing, panel)
    return figure


def _draw_tracking(axes: Axes, drawing: Drawing, panel: Panel) -> None:
    axes.axhline(0.0, color=RULE, lw=1.0, zorder=1)
    largest = 0.0
    for run in drawing.worst_first:
        if run not in panel.runs:
            continue
        error = np.asarray(run.recording["tracking_error"], float)[: len(run.time), panel.axis]
        kept = kept_rows(len(error), CURVE_POINTS, [error])
        axes.plot(run.time[kept], 1e6 * error[kept], color=run.look.light,
                  ls=run.look.line_style, lw=1.0)  # fmt: skip
        if run in drawing.framed:  # one far worse leaves the picture
            largest = max(largest, 1e6 * float(np.nanmax(np.abs(error), initial=0.0)))
    if 0.0 < largest < np.inf:
        axes.set_ylim(-1.1 * largest, 1.1 * largest)
    axes.set_title(literal(panel.title, 50), loc="left", fontsize=10, color=INK)
    axes.set_ylabel("tracking error [µm]", color=MUTED)


def _axis_figure(drawing: Drawing, panels: Sequence[Panel]) -> tuple[Figure, Any]:
    """Return an empty figure of rows over a common time."""
    figure = new_figure(10.0, min(1.1 + 1.75 * len(panels), 40.0))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes in rows:
        bare(axes)
        axes.margins(x=0.0)
        if drawing.one_motion and len(drawing.stops.time) <= SHOWN_STOPS:
            for at in drawing.stops.time:
                axes.axvline(at, color=PATH, lw=0.8, ls=":", zorder=1)
    rows[-1].set_xlabel("time [s]", color=MUTED)
    legend_below(figure, drawing, worst=False)
    return figure, rows


def _draw_command(axes: Axes, run: Run, axis: int) -> None:
    command = np.asarray(run.recording["command"], float)[: len(run.time), axis]
    kept = kept_rows(len(command), CURVE_POINTS, [command])
    axes.plot(run.time[kept], command[kept], color=run.look.light, ls=run.look.line_style, lw=1.0)
    limit = command_limits(run.recording)[axis]
    for a, b in spans(np.abs(command) >= limit * (1.0 - 1e-12), gap=len(command) // 500):
        end = run.time[min(b + 1, len(run.time) - 1)]
        axes.axvspan(run.time[a], end, color=run.look.light, alpha=0.15, lw=0)


def _draw_limit(axes: Axes, panel: Panel) -> str:
    limit = panel.limit
    if not np.isfinite(limit):
        return "   no limit"
    words = f"   limit ±{limit:.4g} {panel.unit}"
    peak = max(
        float(np.max(np.abs(np.asarray(run.recording["command"])[: len(run.time), panel.axis])))
        for run in panel.runs
    )
    if peak < LIMIT_SHOWN * limit:
        return words + ", outside the picture"
    for sign in (-1.0, 1.0):
        axes.axhline(sign * limit, color=INK, lw=0.9, ls=(0, (5, 4)))
    return words + "; shaded where it is reached"


def _summary_figure(drawing: Drawing) -> Figure:
    figure = new_figure(12.8, 5.6)
    sentence = result_sentences(drawing)[0]
    n_lines = -(-len(sentence) // 106)
    sentence = "\n".join(textwrap.wrap(sentence, len(sentence) // n_lines + 8))
    figure.suptitle(
        literal(sentence, 320), x=0.01, ha="left", fontsize=13, weight="bold", color=INK
    )
    halves: Any = figure.subfigures(1, 2, width_ratios=(1.45, 1.0), wspace=0.02)
    left, right = halves
    axes = left.add_subplot(projection="3d") if drawing.shown == 3 else left.add_subplot()
    if drawing.shown > 1:
        draw_path(axes, drawing)
        axes.set_title(_path_title(drawing), loc="left", fontsize=10, color=MUTED)
    else:
        bare(axes)
        for panel in tracking_panels(drawing)[:1]:
            _draw_tracking(axes, drawing, panel)
        axes.set_xlabel("time [s]", color=MUTED)
    shown = drawing.runs[:BARS]
    bars, curve = right.subplots(2, 1, height_ratios=(0.4 + 0.52 * len(shown), 2.2))
    full = max(run.largest for run in drawing.framed) or 1.0
    _draw_bars(bars, shown, full, len(drawing.runs) - len(shown))
    draw_error(curve, drawing, "distance", labels=False)
    curve.set_xlabel("distance along the path [mm]", color=MUTED)
    return figure


def _draw_bars(axes: Axes, runs: tuple[Run, ...], full: float, hidden: int) -> None:
    bare(axes)
    axes.grid(False)
    axes.spines[["bottom", "left"]].set_visible(False)
    axes.tick_params(length=0, labelbottom=False)
    for row, run in enumerate(runs):
        rms, largest = _metric(run, "rms"), _metric(run, "max")
        axes.text(0.0, row - 0.36, literal(run.name, 40), va="bottom", fontsize=10, weight="bold",
                  color=run.look.light)  # fmt: skip
        if not np.isfinite(rms):
            words = run.status if run.diverged else "no figures"
            axes.text(0.0, row, literal(f"✕ {words}", 60), va="center", fontsize=9, color=MUTED)
            continue
        end = min(largest, 1.1 * full)  # a run far worse than the best is cut
        axes.barh(row, end, height=0.2, color=run.look.light, alpha=0.35, lw=0)
        axes.barh(row, min(rms, end), height=0.44, color=run.look.light, lw=0)
        cut = "… " if end < largest else ""
        words = f"{cut}{to_um(rms)} rms, {to_um(largest)} max"
        axes.text(end + 0.02 * full, row, words, va="center", fontsize=9, color=INK)
    axes.set_xlim(0.0, 1.7 * full)
    axes.set_ylim(len(runs) - 0.6, -0.95)
    axes.set_yticks([])
    more = f"; {hidden} more in the report" if hidden else ""
    axes.set_title(f"contour error [µm]{more}", loc="left", fontsize=10, color=MUTED)


def _metric(run: Run, name: str) -> float:
    value: Any = run.metrics.get(f"contour_error_{name}", np.nan)
    return float(value)
