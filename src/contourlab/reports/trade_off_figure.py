"""The figure of a trade: how long a part takes, and what its error is, over the bound on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from contourlab.errors import ConfigurationError
from contourlab.reports.canvas import INK, MUTED, bare, literal, new_figure, write_png
from contourlab.reports.palette import look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from contourlab.recordings.recording import Recording

__all__ = ["trade_off_rows", "write_trade_off_figure"]


def trade_off_rows(runs: Mapping[float, Recording]) -> list[dict[str, float]]:
    """Return one row for each bound, the loosest first.

    Parameters
    ----------
    runs
        Recordings by the bound on the contour error that they were made with [m].

    Returns
    -------
    list
        Of ``bound`` [m], ``cycle_time`` [s], ``contour_error_rms`` and ``contour_error_max`` [m],
        and ``beyond``, the share of samples whose error is larger than the bound.
    """
    rows = []
    for bound in sorted(runs, reverse=True):
        run = runs[bound]
        error = np.abs(np.asarray(run["contour_error"]))
        names = ("cycle_time", "contour_error_rms", "contour_error_max")
        rows.append({
            "bound": bound, **{name: float(np.asarray(run.metrics[name])) for name in names},
            "beyond": float(np.mean(error > bound)),
        })  # fmt: skip
    return rows


def write_trade_off_figure(
    rows: Sequence[Mapping[str, float]],
    file: str | FilePath,
    *,
    title: str = "Cycle time against a bound on the contour error",
    force: bool = False,
) -> None:
    """Write cycle time, and the errors that were found, over the bound, as PNG.

    Parameters
    ----------
    rows
        As ``trade_off_rows`` made them, two or more.
    file
        Where.
    title
        Above the figure.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    ConfigurationError
        Fewer than two rows.
    OutputError
        The file exists already, or its folder cannot be used.
    """
    if len(rows) < 2:
        raise ConfigurationError(f"a trade-off needs two rows or more, got {len(rows)}")
    write_png(_figure(rows, title), FilePath(file), force=force)


def _figure(rows: Sequence[Mapping[str, float]], title: str) -> Figure:
    figure = new_figure(9.0, 3.6)
    left, right = figure.subplots(1, 2)
    bound = 1e6 * np.array([row["bound"] for row in rows])
    time, rms, most = (
        np.array([row[name] for row in rows])
        for name in ("cycle_time", "contour_error_rms", "contour_error_max")
    )
    one, two = look(0), look(1)
    left.plot(bound, time, color=one.light, marker=one.marker, ms=5, lw=1.8)
    left.set_ylabel("cycle time [s]", color=MUTED)
    right.plot(bound, bound, color=MUTED, lw=1.0, ls=":", label="the bound")
    for values, style, name in ((most, one, "largest"), (rms, two, "rms")):
        right.plot(bound, 1e6 * values, color=style.light, marker=style.marker, ms=5, lw=1.8,
                   ls=style.line_style, label=name)  # fmt: skip
    right.set_ylabel("contour error [µm]", color=MUTED)
    right.set_yscale("log")
    right.legend(frameon=False, fontsize=9, labelcolor=INK)
    for axes in (left, right):
        bare(axes)
        axes.set_xscale("log")
        axes.set_xticks(bound)
        axes.set_xticks([], minor=True)
        axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
        axes.set_xlabel("bound on the contour error [µm]", color=MUTED)
    figure.suptitle(literal(title, 120), x=0.01, ha="left", fontsize=11, color=INK)
    return figure
