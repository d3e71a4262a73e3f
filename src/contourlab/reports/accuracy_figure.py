"""The figure of an accuracy study: mean and largest error of every estimator over the lag."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from contourlab.reports.accuracy_table import Condition, condition_words, conditions
from contourlab.reports.canvas import INK, MUTED, bare, literal, new_figure, write_png
from contourlab.reports.palette import look

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from contourlab.contour_errors.accuracy import AccuracyRow, AccuracyStudy

__all__ = ["write_accuracy_figure"]

FLOOR = 1e-6
"""Errors below this are drawn at it [µm]."""
TICKS = 8
"""So many values on the horizontal axis are all written."""
_OVER = {
    "lag": ("lag [mm]", 1e3),
    "resolution": ("resolution of the encoders [µm]", 1e6),
    "feed": ("feed [mm/min]", 60e3),
    "offset": ("offset [µm]", 1e6),
}
"""What may stand on the horizontal axis: name, factor; the first that takes several values does."""


def write_accuracy_figure(
    study: AccuracyStudy, file: str | FilePath, *, force: bool = False
) -> None:
    """Write the errors of a study as PNG: a row per contour, mean on the left, largest right.

    They are drawn over the lag, or if there is one lag only over the resolution, feed or offset,
    whichever takes several values; the other conditions are the first ones of the study.

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


def _figure(study: AccuracyStudy) -> Figure:
    from matplotlib.lines import Line2D

    several = [name for name in _OVER if len({getattr(row, name) for row in study.rows}) > 1]
    over = several[0] if several else "lag"
    fixed = {name: getattr(study.rows[0], name) for name in _OVER if name != over}
    shown = [
        row for row in study.rows
        if row.error_max is not None and all(getattr(row, n) == v for n, v in fixed.items())
    ]  # fmt: skip
    names = list(dict.fromkeys(row.estimator for row in study.rows))
    looks = {name: look(k) for k, name in enumerate(names)}
    contours = [c.name for c in study.contours]
    figure = new_figure(10.0, 1.3 + 2.5 * len(contours) + 0.22 * -(-len(names) // 4))
    grid = figure.subplots(len(contours), 2, sharex=True, sharey="row", squeeze=False)
    for pair, contour in zip(grid, contours, strict=True):
        own = [row for row in shown if row.contour == contour]
        for axes, field, word in zip(
            pair, ("error_mean", "error_max"), ("mean", "largest"), strict=True
        ):
            _draw(axes, own, over, field, looks)
            axes.set_title(literal(f"{contour.replace('_', ' ')}: {word}", 60), loc="left",
                           fontsize=10, color=INK)  # fmt: skip
        pair[0].set_ylabel("error [µm]", color=MUTED)
    for axes in grid[-1]:
        axes.set_xlabel(_OVER[over][0], color=MUTED)
    drawn = {row.estimator for row in shown}
    handles = [
        Line2D([], [], color=looks[name].light, ls=looks[name].line_style, lw=1.8,
               marker=looks[name].marker, ms=5, label=" " + literal(name.replace("_", " "), 40))
        for name in names if name in drawn
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower left", frameon=False, fontsize=9.5, ncols=4,
                  handlelength=3.2, labelcolor=INK)  # fmt: skip
    first = next(iter(conditions(study)))
    figure.suptitle(_title(first, over, study), x=0.01, ha="left", fontsize=11, color=INK)
    return figure


def _title(first: Condition, over: str, study: AccuracyStudy) -> str:
    words = condition_words(first).split(", ")
    kept = [w for w, name in zip(words, ("offset", "feed", "resolution"), strict=True)
            if name != over]  # fmt: skip
    if over != "lag":
        kept.insert(0, f"lag {study.rows[0].lag * 1e3:.4g} mm")
    floor = "below 1e-6 µm drawn there"
    return literal(f"Error of the estimate's size: {', '.join(kept)}; {floor}", 160)


def _draw(axes: Axes, rows: list[AccuracyRow], over: str, field: str, looks: Any) -> None:
    bare(axes)
    axes.grid(which="major", color="#e8ebef", lw=0.8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    factor = _OVER[over][1]
    for name, style in looks.items():
        own = sorted(
            (abs(getattr(row, over)) * factor, getattr(row, field) * 1e6)
            for row in rows if row.estimator == name
        )  # fmt: skip
        points = np.array([(x, max(y, FLOOR)) for x, y in own if x > 0.0]).reshape(-1, 2)
        axes.plot(*points.T, color=style.light, ls=style.line_style, marker=style.marker, ms=4,
                  lw=1.5)  # fmt: skip
    top = max((getattr(row, field) * 1e6 for row in rows), default=1.0)
    axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    values = sorted({abs(getattr(row, over)) * factor for row in rows} - {0.0})
    if 0 < len(values) <= TICKS:
        axes.set_xticks(values)
        axes.set_xticks([], minor=True)
    axes.yaxis.set_major_formatter(lambda y, _: _plain(y))
    axes.set_ylim(0.5 * FLOOR, max(10.0 * FLOOR, 3.0 * top))


def _plain(value: float) -> str:
    if 1e-3 <= value <= 1e4:
        return f"{value:g}"
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
