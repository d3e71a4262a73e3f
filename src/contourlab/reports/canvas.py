"""Pieces that several PNG figures share; matplotlib without its global state."""

from __future__ import annotations

import warnings
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from contourlab.reports.decimation import kept_rows, shape_rows
from contourlab.reports.drawing import Drawing, Run
from contourlab.units import to_um

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "INK", "MUTED", "PATH", "RULE", "SHOWN_STOPS", "bare", "draw_diverged", "draw_error",
    "draw_path", "legend_below", "literal", "new_figure", "write_png",
]  # fmt: skip

INK, MUTED, PATH, RULE, GRID = "#1b1f24", "#5b6570", "#8b949e", "#c3cad2", "#e8ebef"
DPI = 160
CURVE_POINTS = 20_000
SHOWN_STOPS = 300
"""More exact stops than this are not drawn as lines over curves."""


def literal(text: str, limit: int = 110) -> str:
    """Return text that matplotlib shows as it is: no formula, no control characters.

    Parameters
    ----------
    text
        From a file, perhaps.
    limit
        Longer text is cut: a name must not push the data out of the figure.
    """
    text = text if len(text) <= limit else text[: limit - 1] + "…"
    shown = "".join(c if c.isprintable() or c in "\n\u00a0" else "?" for c in text)
    return shown.replace("$", r"\$")


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure that is no part of pyplot.

    Parameters
    ----------
    width, height
        In inches.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.1)
    figure = Figure(figsize=(width, height), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def write_png(figure: Figure, file: FilePath, *, force: bool) -> None:
    """Write a figure as PNG, atomically.

    Parameters
    ----------
    figure
        As ``new_figure`` made it.
    file
        Where.
    force
        Whether an existing file may be replaced.
    """
    from contourlab.recordings.files import atomic_file

    with atomic_file(file, force=force) as temporary, warnings.catch_warnings():
        # a name in a script that the font lacks is drawn as boxes: no reason to speak of it
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(temporary, format="png", dpi=DPI)


def bare(axes: Axes) -> None:
    """Give axes the quiet look of the report.

    Parameters
    ----------
    axes
        Two-dimensional.
    """
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(RULE)
    axes.tick_params(colors=MUTED, labelsize=9)
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)


def draw_path(axes: Any, drawing: Drawing) -> None:
    """Draw the path and every controller's deviation magnified, in mm.

    Parameters
    ----------
    axes
        Two- or three-dimensional, as ``drawing.shown`` says.
    drawing
        The comparison.
    """
    shown = drawing.shown
    axes.plot(*(drawing.path[:, :shown].T * 1e3), color=PATH, lw=1.6, zorder=2)
    if shown == 3:
        axes.scatter(*(drawing.stops.position[:, :3].T * 1e3), marker="s", s=12, color=INK)
    else:
        axes.plot(*(drawing.stops.position[:, :2].T * 1e3), ls="", marker="s", ms=5.5,
                  mfc="none", mec=INK, mew=1.1, zorder=5)  # fmt: skip
    framed = drawing.framed
    for run in drawing.worst_first:
        drawn = run.drawn(drawing.magnification)[:, :shown] * 1e3
        kept = np.union1d(
            shape_rows(run.foot, CURVE_POINTS // 2),
            kept_rows(len(drawn), CURVE_POINTS // 2, [run.error]),
        )
        axes.plot(*drawn[kept].T, color=run.look.light, ls=run.look.line_style, zorder=3,
                  **_weight(drawing, run, 1.3))  # fmt: skip
        if run.diverged:
            draw_diverged(axes, run, drawn[-1])
        elif run.worst is not None and run in framed:
            axes.plot(*drawn[[run.worst]].T, ls="", marker=run.look.marker, ms=7,
                      color=run.look.light, mec="white", mew=1.0, zorder=6)  # fmt: skip
    curves = [run.drawn(drawing.magnification)[:, :shown] * 1e3 for run in framed]
    _frame(axes, np.concatenate([drawing.path[:, :shown] * 1e3, *curves]))
    for which, name in zip("xyz", drawing.coordinates[:shown], strict=False):
        axes.set(**{f"{which}label": f"{literal(name, 20)} [mm]"})
        getattr(axes, f"{which}axis").label.set_color(MUTED)
    if shown == 3:
        axes.tick_params(colors=MUTED, labelsize=8)
    else:
        bare(axes)


def _weight(drawing: Drawing, run: Run, width: float) -> dict[str, Any]:
    """Return how heavy a run's line is: thin if it diverged, pale if it leaves the picture."""
    if run not in drawing.framed:
        return {"lw": 0.6 * width, "alpha": 0.35}
    return {"lw": 0.7 * width, "alpha": 0.8} if run.diverged else {"lw": width, "alpha": 1.0}


def _frame(axes: Any, points: Any) -> None:
    """Let the axes show these points and no more, at equal scales."""
    from matplotlib.transforms import Bbox

    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    if len(low) == 3:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_aspect("equal")
    else:
        axes.set_aspect("equal", adjustable="datalim")
        axes.dataLim = Bbox([low, high])
        axes.autoscale_view()


def draw_diverged(axes: Any, run: Run, point: Any) -> None:
    """Mark where a diverged run leaves the picture.

    Parameters
    ----------
    axes
        Where.
    run
        That diverged.
    point
        Its last point in the picture, in the figure's units.
    """
    axes.plot(*(np.atleast_1d(x) for x in point), ls="", marker="X", ms=8, color=run.look.light,
              mec="white", mew=0.8, zorder=6)  # fmt: skip


def draw_error(
    axes: Axes, drawing: Drawing, over: Literal["distance", "time"], *, labels: bool = True
) -> None:
    """Draw the contour error of every controller in µm, exact stops dotted, worst points marked.

    Parameters
    ----------
    axes
        Where.
    drawing
        The comparison.
    over
        Distance along the path in mm, or time in s.
    labels
        Whether the worst points carry their source line.
    """
    bare(axes)
    scale = 1e3 if over == "distance" else 1.0
    if len(drawing.stops.time) <= SHOWN_STOPS and (over == "distance" or drawing.one_motion):
        for at in getattr(drawing.stops, over) * scale:
            axes.axvline(at, color=PATH, lw=0.8, ls=":", zorder=1)
    axes.axhline(0.0, color=RULE, lw=1.0, zorder=1)
    framed = drawing.framed
    low = min(float(np.nanmin(run.error)) for run in framed) * 1e6
    high = max(float(np.nanmax(run.error)) for run in framed) * 1e6
    step = 0.13 * ((high - low) or 1.0)
    first = min(float(getattr(run, over)[0]) for run in drawing.runs) * scale
    last = max(float(getattr(run, over)[-1]) for run in drawing.runs) * scale
    rows = {1: 0, -1: 0}
    for run in drawing.worst_first:
        x, y = getattr(run, over) * scale, run.error * 1e6
        kept = kept_rows(len(y), CURVE_POINTS, [run.error])
        axes.plot(x[kept], y[kept], color=run.look.light, ls=run.look.line_style, zorder=3,
                  **_weight(drawing, run, 1.0))  # fmt: skip
        if run.diverged:
            draw_diverged(axes, run, (x[-1], y[-1]))
        elif run.worst is not None and run in framed:
            at = (float(x[run.worst]), float(y[run.worst]))
            axes.plot(*at, ls="", marker=run.look.marker, ms=6.5, color=run.look.light,
                      mec="white", mew=0.9, zorder=6)  # fmt: skip
            if labels and run in drawing.labelled:
                side, left = 1 if at[1] >= 0.0 else -1, at[0] < 0.5 * (first + last)
                rows[side] += 1
                edge = (high if side > 0 else low) + side * step * (rows[side] - 0.3)
                words = f" {to_um(abs(run.error[run.worst]))} µm, {drawing.where(run, run.worst)} "
                axes.annotate(
                    literal(words), at, (at[0], edge), fontsize=8.5, color=run.look.light,
                    ha="left" if left else "right", va="center", zorder=7,
                    arrowprops={"arrowstyle": "-", "color": run.look.light, "lw": 0.8,
                                "shrinkA": 0, "shrinkB": 4, "relpos": (0.0 if left else 1.0, 0.5)},
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
                )  # fmt: skip
    axes.set_xlim(first, last if last > first else first + 1.0)
    bottom = low - step * (rows[-1] + 0.4) if drawing.signed else 0.0
    axes.set_ylim(bottom, high + step * (rows[1] + 0.4))
    axes.set_ylabel("contour error [µm]", color=MUTED)


def legend_below(figure: Figure, drawing: Drawing, *, worst: bool) -> None:
    """Put the controllers' names under a figure, outside the data.

    Parameters
    ----------
    figure
        With constrained layout.
    drawing
        The comparison.
    worst
        Whether each name is followed by its largest error and where that is: one per line.
    """
    from matplotlib.lines import Line2D

    handles = []
    for run in drawing.runs:
        words = run.name if len(run.name) <= 40 else run.name[:39] + "…"
        if run.diverged:
            words += f": {run.status}"
        elif worst and run.worst is not None:
            size = to_um(abs(float(run.error[run.worst])))
            words += f": {size} µm at worst, {drawing.where(run, run.worst)}"
            words += "" if run in drawing.framed else "; leaves the picture"
        marker = "X" if run.diverged else run.look.marker if worst else ""
        colour, label = run.look.light, " " + literal(words)  # a bare "_" would hide the entry
        handles.append(Line2D([], [], color=colour, ls=run.look.line_style, lw=2.2,
                              marker=marker, ms=6, mec=colour, label=label))  # fmt: skip
    figure.legend(handles=handles, loc="outside lower left", frameon=False, fontsize=9.5,
                  ncols=1 if worst else min(len(handles), 3), labelcolor=INK)  # fmt: skip
