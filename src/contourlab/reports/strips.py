"""How a metric is distributed over the samples of a variation: a strip of points per run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contourlab.reports.canvas import INK, MUTED, bare, literal, new_figure
from contourlab.reports.drawing import Drawing, Run
from contourlab.reports.spread_table import SPREAD_METRICS
from contourlab.units import to_um

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Strip", "Strips", "spread_figure", "strips_of"]

POINTS = 800
"""Most points of a strip; of more samples, an even choice over their order, both ends kept."""
WIDE = 20.0
"""Values that span more than this ratio are drawn on a logarithmic axis."""
DRAWN = 2
"""So many of the table's metrics are drawn."""
JITTER = 0.28


@dataclass(frozen=True, eq=False)
class Strip:
    """One metric of one run over the samples, in µm."""

    run: Run
    values: NDArray[np.float64]
    """Of samples that did not diverge, in order of size."""
    low: float
    median: float
    high: float
    """Infinite if more than 5 % of the samples diverged."""
    nominal: float
    """Of the run as it stands; NaN if that diverged."""
    n_samples: int
    n_diverged: int

    @property
    def offset(self) -> NDArray[np.float64]:
        """How far each point is moved across the strip, -1 to 1, so that they do not hide."""
        golden = 0.6180339887498949
        place: NDArray[np.float64] = np.mod(np.arange(len(self.values)) * golden, 1.0)
        return 2.0 * place - 1.0


@dataclass(frozen=True, eq=False)
class Strips:
    """One metric of all runs."""

    title: str
    logarithmic: bool
    rows: tuple[Strip, ...]


def strips_of(drawing: Drawing) -> tuple[Strips, ...]:
    """Return what is drawn of the spread: contour error, rms and max; empty if nothing varied.

    Parameters
    ----------
    drawing
        The comparison.
    """
    spread = drawing.comparison.spread
    runs = [run for run in drawing.runs if run.name in spread]
    if not runs:
        return ()
    found = []
    for metric, title in SPREAD_METRICS[:DRAWN]:
        rows = tuple(_strip(run, drawing, metric) for run in runs)
        shown = np.concatenate([row.values for row in rows])
        positive = shown[shown > 0.0]
        wide = len(positive) > 0 and float(positive.max() / positive.min()) > WIDE
        found.append(Strips(title, wide, rows))
    return tuple(found)


def _strip(run: Run, drawing: Drawing, metric: str) -> Strip:
    spread = drawing.comparison.spread[run.name]
    values = np.sort(spread.values(metric)) * 1e6
    values = values[np.isfinite(values)]
    if len(values) > POINTS:
        values = values[np.unique(np.linspace(0, len(values) - 1, POINTS).astype(int))]
    statistic = spread.statistic(metric)
    assert not isinstance(statistic, list)
    nominal = run.metrics.get(metric, math.nan)
    return Strip(
        run=run, values=values, low=statistic.low * 1e6, median=statistic.median * 1e6,
        high=statistic.high * 1e6,
        nominal=math.nan if isinstance(nominal, list) else float(nominal) * 1e6,
        n_samples=spread.n_samples, n_diverged=spread.n_diverged,
    )  # fmt: skip


def spread_figure(drawing: Drawing) -> Figure:
    """Return the figure of the spread, for paper.

    Parameters
    ----------
    drawing
        Of a comparison with a variation.
    """
    found = strips_of(drawing)
    n_rows = len(found[0].rows)
    figure = new_figure(10.0, 1.7 + 0.62 * n_rows)
    columns = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for axes, strips in zip(columns, found, strict=True):
        _draw(axes, strips)
    columns[0].set_yticks(range(n_rows), [_label(strip) for strip in found[0].rows])
    for tick, strip in zip(columns[0].get_yticklabels(), found[0].rows, strict=True):
        tick.set_color(strip.run.look.light)
        tick.set_fontsize(9.5)
    columns[0].set_ylim(n_rows - 0.4, -0.6)
    n = found[0].rows[0].n_samples
    figure.suptitle(
        f"{n} samples: dots; bar from 5 to 95 %, tick at the median; ◇ the run as it stands",
        x=0.01, ha="left", fontsize=10, color=MUTED,
    )  # fmt: skip
    return figure


def _label(strip: Strip) -> str:
    name = strip.run.name if len(strip.run.name) <= 32 else strip.run.name[:31] + "…"
    lost = f"\n{strip.n_diverged} of {strip.n_samples} diverged" if strip.n_diverged else ""
    return literal(name) + lost


def _draw(axes: Axes, strips: Strips) -> None:
    bare(axes)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    shown = np.concatenate([strip.values for strip in strips.rows])
    end = float(shown.max()) if len(shown) else 1.0
    for row, strip in enumerate(strips.rows):
        colour = strip.run.look.light
        axes.plot(strip.values, row + JITTER * strip.offset, ls="", marker="o", ms=3, mew=0,
                  color=colour, alpha=0.35)  # fmt: skip
        if math.isfinite(strip.low):
            high = strip.high if math.isfinite(strip.high) else end
            axes.plot([strip.low, high], [row, row], color=colour, lw=3.2, solid_capstyle="butt",
                      ls="-" if math.isfinite(strip.high) else ":")  # fmt: skip
        if math.isfinite(strip.median):
            axes.plot([strip.median], [row], ls="", marker="|", ms=17, mew=2.4, color=colour)
            axes.annotate(
                to_um(strip.median * 1e-6), (strip.median, row), (0, 11),
                textcoords="offset points", ha="center", fontsize=8.5, color=INK, zorder=7,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
            )  # fmt: skip
        if math.isfinite(strip.nominal):
            axes.plot([strip.nominal], [row], ls="", marker="D", ms=6, mfc="white", mec=INK,
                      mew=1.1, zorder=6)  # fmt: skip
    if strips.logarithmic:
        from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_xlim(left=0.0)
    axes.set_title(strips.title, loc="left", fontsize=11, color=INK)
    axes.set_xlabel("[µm]" + (", logarithmic" if strips.logarithmic else ""), color=MUTED)
