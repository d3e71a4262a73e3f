"""Figure and table of a chattering study: what a softer gain costs, and where it swings."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from contourlab.reports.canvas import INK, MUTED, bare, literal, new_figure, write_png
from contourlab.reports.palette import look

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

    from contourlab.simulation.chattering import Chattering

__all__ = ["chattering_table", "write_chattering_figure"]

TICKS = 8
"""So many values on the horizontal axis are all written."""
_MICRO = {"guard": "guard [µm]"}
"""Names of lengths that are shown in µm."""


def write_chattering_figure(
    study: Chattering, file: str | FilePath, *, force: bool = False
) -> None:
    """Write a study as PNG: amplitude of the limit cycle, its frequency, the largest contour error.

    Parameters
    ----------
    study
        What was found.
    file
        Where.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        The file exists already, or its folder cannot be used.
    """
    write_png(_figure(study), FilePath(file), force=force)


def _over(study: Chattering) -> tuple[str, Any]:
    """Return the name of what is varied, and its values, as shown."""
    if study.field in _MICRO:
        return _MICRO[study.field], 1e6 * study.values
    return study.field.replace("_", " "), study.values


def _figure(study: Chattering) -> Figure:
    name, values = _over(study)
    figure = new_figure(11.0, 4.4)
    panels = figure.subplots(1, 3)
    loud = np.where(study.quiet, np.nan, study.amplitude)
    shown = (
        ("amplitude of the limit cycle [µm]", 1e6 * loud),
        ("its frequency [Hz]", study.frequency_hz),
        ("largest contour error, start included [µm]", 1e6 * study.contour_error_max),
    )
    for axes, (title, table) in zip(panels, shown, strict=True):
        frequency = table is study.frequency_hz
        bare(axes)
        axes.grid(which="major", color="#e8ebef", lw=0.8)
        axes.set_xscale("log")
        axes.set_yscale("linear" if frequency else "log")
        for k, row in enumerate(table):
            style = look(k)
            label = f"{1e3 * study.sample_times[k]:g} ms"
            axes.plot(values, row, color=style.light, ls=style.line_style, marker=style.marker,
                      ms=4, lw=1.5, label=literal(label))  # fmt: skip
        axes.set_title(literal(title, 60), loc="left", fontsize=10, color=INK)
        axes.set_xlabel(literal(name), color=MUTED)
        axes.set_xlim(0.9 * values[0], 1.1 * values[-1])
        if frequency:
            axes.set_ylim(bottom=0.0)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda x, _: f"{x:g}")
            axis.set_minor_formatter(lambda _x, _: "")
        if len(values) <= TICKS:
            axes.set_xticks(values)
            axes.set_xticks([], minor=True)
    figure.legend(*panels[2].get_legend_handles_labels(), loc="outside lower left", frameon=False,
                  ncols=6, fontsize=9.5, labelcolor=INK)  # fmt: skip
    figure.suptitle(
        literal(f"Limit cycle over {name.split(' [')[0]} and sample time; no point: quiet", 120),
        x=0.01, ha="left", fontsize=11, color=INK,
    )  # fmt: skip
    return figure


def chattering_table(study: Chattering) -> Table:
    """Return a study as a table for the terminal: one row for each sample time.

    Parameters
    ----------
    study
        What was found.
    """
    from rich import box
    from rich.table import Table

    name, values = _over(study)
    table = Table(box=box.SIMPLE_HEAD, title=f"limit cycle [µm] at [Hz], over the {name}",
                  title_justify="left", pad_edge=False)  # fmt: skip
    table.add_column("sample time [ms]", justify="right")
    for value in values:
        table.add_column(f"{value:g}", justify="right")
    table.add_column("quiet from", justify="right")
    least = study.least_quiet * (1e6 if study.field in _MICRO else 1.0)
    for k, sample_time in enumerate(study.sample_times):
        cells = [
            "diverged" if np.isnan(amplitude) else "quiet" if quiet
            else f"{1e6 * amplitude:.2g} at {hz:.0f}"
            for amplitude, quiet, hz in zip(
                study.amplitude[k], study.quiet[k], study.frequency_hz[k], strict=True
            )
        ]  # fmt: skip
        last = "-" if np.isnan(least[k]) else f"{least[k]:g}"
        table.add_row(f"{1e3 * sample_time:g}", *cells, last)
    return table
