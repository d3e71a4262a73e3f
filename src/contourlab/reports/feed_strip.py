"""The feed along the path, and a strip under it that says which limit holds it back where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.reports.canvas import INK, MUTED, PATH, bare, literal, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from contourlab.contours.part import Part
    from contourlab.feedrate import Plan

__all__ = ["FeedStrip", "feed_figure", "feed_strip", "said", "strip_svg"]

Values = NDArray[Any]

_FINER = 16
COLUMNS = 700
"""The path is drawn in so many columns; each shows the limit that binds longest in it."""
_HUES = {"velocity": 205.0, "acceleration": 22.0, "jerk": 285.0}
_PLAIN = {"feed": "#9fb8a5", "rest": "#1b1f24", "none": "#e1e5ea"}
_SAID = {"feed": "programmed feed", "none": "none: speeding up or slowing down", "rest": "at rest"}
_RAPID = 3.0
"""Rapids faster than the cut by more than this are cut off."""
_WIDTH, _HEIGHT, _LEFT, _TOP, _BAND = 1120.0, 250.0, 62.0, 14.0, 24.0


@dataclass(frozen=True, eq=False, kw_only=True)
class FeedStrip:
    """What is drawn of a plan, column by column along the path."""

    edges: Values
    """Arc lengths, shape (n + 1,) [m]."""
    limit: Values
    """Index of the limit that binds longest in each column, shape (n,)."""
    low: Values
    """Least and greatest speed in each column, shape (n,) [m/s]."""
    high: Values
    programmed: Values
    """Greatest programmed feed in each column [m/s]; NaN where rapids are left to the limits."""
    line: Values
    """Line of the program at the start of each column; 0 without a program."""
    names: tuple[str, ...]
    shares: tuple[tuple[str, float], ...]
    """Share of the cycle time of each limit that binds somewhere, largest first."""
    cycle_time: float

    @property
    def top(self) -> float:
        """Largest speed drawn [m/s]: rapids that are much faster than the cut are cut off."""
        fastest = float(self.high.max())
        asked = self.programmed[np.isfinite(self.programmed)]
        cutting = float(asked.max(initial=0.0))
        return 1.25 * cutting if 0.0 < _RAPID * cutting < fastest else 1.08 * max(fastest, cutting)

    @property
    def note(self) -> str:
        """What the drawing leaves out, empty if nothing."""
        if self.high.max() <= self.top:
            return ""
        return f"rapids reach {6e4 * float(self.high.max()):.4g} mm/min, beyond the drawing"

    def runs(self) -> list[tuple[int, int, int]]:
        """Return first column, column after the last, and limit of stretches with one limit."""
        cuts = np.flatnonzero(np.diff(self.limit)) + 1
        first = np.concatenate([[0], cuts]).tolist()
        last = np.concatenate([cuts, [len(self.limit)]]).tolist()
        return [(a, b, int(self.limit[a])) for a, b in zip(first, last, strict=True)]

    def colour(self, name: str) -> str:
        """Return the colour of a limit: a hue for its kind, a lightness for its axis.

        Parameters
        ----------
        name
            One of ``names``.
        """
        if name in _PLAIN:
            return _PLAIN[name]
        kind, axis = name.split(" ", 1)
        axes = [other.split(" ", 1)[1] for other in self.names if other.startswith(kind + " ")]
        place = axes.index(axis) / max(1, len(axes) - 1)
        return _hsl(_HUES[kind], 0.62, 0.40 + 0.30 * place)


def _hsl(hue: float, saturation: float, lightness: float) -> str:
    import colorsys

    red, green, blue = colorsys.hls_to_rgb(hue / 360.0, lightness, saturation)
    return f"#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"


def said(name: str) -> str:
    """Return a limit as a reader knows it.

    Parameters
    ----------
    name
        As in :class:`contourlab.feedrate.Binding`.
    """
    if name in _SAID:
        return _SAID[name]
    kind, axis = name.split(" ", 1)
    return f"{kind} of {axis}"


def feed_strip(plan: Plan, part: Part | None = None) -> FeedStrip:
    """Return what is to be drawn of a plan.

    Parameters
    ----------
    plan
        From :func:`contourlab.feedrate.plan_feed`.
    part
        Where its contour came from, for the lines of the program.
    """
    from contourlab.feedrate import binding_limits

    binding = binding_limits(plan)
    length = float(plan.profile.arc[-1])
    n = int(min(COLUMNS, max(1, len(binding.arc) // 4)))
    edges = np.linspace(0.0, length, n + 1)
    rest = len(binding.names) - 2
    moving = binding.limit != rest
    column = np.clip((binding.arc / length * n).astype(int), 0, n - 1)
    votes = np.zeros((n, len(binding.names)))
    np.add.at(votes, (column[moving], binding.limit[moving]), 1.0)
    empty = votes.sum(axis=1) == 0.0
    limit = votes.argmax(axis=1)
    # a column between two instants takes the limit of the instant before it
    known = np.maximum.accumulate(np.where(empty, 0, np.arange(n)))
    limit = limit[known]
    fine = np.linspace(0.0, length, 8 * n + 1)
    speed = plan.profile.at(plan.profile.time_at(fine))[1]
    windows = np.stack([speed[k : 8 * n + k - 7 : 8] for k in range(9)], axis=1)
    return FeedStrip(
        edges=edges, limit=limit, low=windows.min(axis=1), high=windows.max(axis=1),
        programmed=_programmed(plan, edges), line=_lines(plan, part, edges[:-1]),
        names=binding.names, shares=tuple(binding.shares().items()), cycle_time=plan.cycle_time,
    )  # fmt: skip


def _piece(plan: Plan, arc: Values) -> Values:
    from contourlab.contours.path import Path

    contour = plan.reference.contour
    if not isinstance(contour, Path):
        return np.zeros(len(arc), int)
    breaks = np.asarray(contour.breaks, float)
    found = np.searchsorted(breaks - breaks[0], arc, side="right") - 1
    return np.clip(found, 0, contour.n_pieces - 1)


def _programmed(plan: Plan, edges: Values) -> Values:
    """Return the greatest programmed feed on the pieces that each column touches."""
    fine = np.interp(
        np.arange(_FINER * (len(edges) - 1) + 1) / _FINER, np.arange(len(edges)), edges
    )
    first, last = _piece(plan, edges[:-1]), _piece(plan, edges[1:] - 1e-12 * edges[-1])
    feed = plan.feed[_piece(plan, 0.5 * (fine[1:] + fine[:-1]))].reshape(-1, _FINER)
    few = np.maximum(plan.feed[first], plan.feed[last])
    most = np.maximum(feed.max(axis=1), few)
    return np.where(np.isfinite(most), most, np.nan)


def _lines(plan: Plan, part: Part | None, arc: Values) -> Values:
    contour = plan.reference.contour
    if part is None or not hasattr(contour, "source_line"):
        return np.zeros(len(arc), int)
    return np.asarray(contour.source_line)[_piece(plan, arc)]


def feed_figure(strips: Sequence[tuple[str, FeedStrip]]) -> Figure:
    """Return a figure: for each plan the feed over the path with the strip under it.

    Parameters
    ----------
    strips
        Name of the machine (empty if there is one) and what to draw.
    """
    from matplotlib.patches import Patch

    figure = new_figure(10.0, 0.6 + 2.9 * len(strips))
    ratios = [5.0, 1.0] * len(strips)
    axes = figure.subplots(2 * len(strips), 1, squeeze=False, height_ratios=ratios)[:, 0]
    for (name, strip), upper, lower in zip(strips, axes[::2], axes[1::2], strict=True):
        x = 1e3 * 0.5 * (strip.edges[1:] + strip.edges[:-1])
        upper.step(x, 6e4 * strip.programmed, where="mid", color=PATH, lw=1.0, ls="--")
        upper.fill_between(x, 6e4 * strip.low, 6e4 * strip.high, color=INK, lw=0.8)
        upper.set_ylabel("feed [mm/min]")
        upper.set_ylim(0.0, 6e4 * strip.top)
        title = f"planned feed, cycle time {strip.cycle_time:.4g} s (dashed: programmed)"
        title += f"; {strip.note}" if strip.note else ""
        upper.set_title(literal(f"{name}: {title}" if name else title), loc="left", fontsize=10)
        bare(upper)
        upper.tick_params(labelbottom=False)
        for first, last, limit in strip.runs():
            lower.axvspan(
                1e3 * strip.edges[first], 1e3 * strip.edges[last], lw=0,
                color=strip.colour(strip.names[limit]),
            )  # fmt: skip
        lower.set_yticks([])
        lower.set_xlabel("along the path [mm]")
        for axis in (upper, lower):
            axis.set_xlim(0.0, 1e3 * strip.edges[-1])
        for side in lower.spines.values():
            side.set_visible(False)
        lower.legend(
            handles=[
                Patch(color=strip.colour(limit), label=f"{said(limit)} {100 * share:.3g} %")
                for limit, share in strip.shares
            ],
            loc="upper center", bbox_to_anchor=(0.5, -1.1), ncols=4, frameon=False, fontsize=8,
            labelcolor=MUTED,
        )  # fmt: skip
    return figure


def strip_svg(strip: FeedStrip, label: str = "") -> str:
    """Return the same as inline SVG, with the program's lines as tooltips of the strip.

    Parameters
    ----------
    strip
        What to draw.
    label
        What it shows, for readers who do not see it.
    """
    from markupsafe import escape

    length, n = strip.edges[-1], len(strip.limit)
    base = _HEIGHT - 26.0 - _BAND - 8.0
    top = strip.top
    x = _LEFT + (_WIDTH - _LEFT - 8.0) * strip.edges / length

    def height(speed: float) -> float:
        return base - (base - _TOP) * min(speed / top, 1.0)

    rows = [
        f'<svg class="feed" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" '
        f'aria-label="{escape(label or "planned feed along the path")}">'
    ]
    for value in _ticks(6e4 * top):
        y = height(value / 6e4)
        rows.append(
            f'<line class="grid" x1="{_LEFT:g}" x2="{_WIDTH - 8:g}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        rows.append(f'<text x="{_LEFT - 8:g}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    rows.append(f'<text x="{_LEFT - 8:g}" y="{_TOP - 2:g}" text-anchor="end">mm/min</text>')
    dashed, pen = [], "M"
    for k in range(n):
        if not np.isfinite(strip.programmed[k]):
            pen = "M"
            continue
        y = height(float(strip.programmed[k]))
        dashed.append(f"{pen}{x[k]:.1f} {y:.1f}L{x[k + 1]:.1f} {y:.1f}")
        pen = "L"
    rows.append(f'<path class="programmed" d="{"".join(dashed)}"/>')
    upper = [f"{0.5 * (x[k] + x[k + 1]):.1f} {height(float(strip.high[k])):.1f}" for k in range(n)]
    lower = [f"{0.5 * (x[k] + x[k + 1]):.1f} {height(float(strip.low[k])):.1f}" for k in range(n)]
    rows.append(f'<path class="speed" d="M{"L".join(upper + lower[::-1])}Z"/>')
    for first, last, limit in strip.runs():
        name = strip.names[limit]
        where = f"{1e3 * strip.edges[first]:.4g} to {1e3 * strip.edges[last]:.4g} mm"
        if strip.line[first]:
            a, b = sorted((int(strip.line[first]), int(strip.line[last - 1])))
            where += f", line {a}" if a == b else f", lines {a} to {b}"
        rows.append(
            f'<rect x="{x[first]:.1f}" y="{base + 8:.1f}" width="{x[last] - x[first]:.1f}" '
            f'height="{_BAND:g}" fill="{strip.colour(name)}">'
            f"<title>{escape(said(name))}, {where}</title></rect>"
        )
    for value in _ticks(1e3 * length):
        at = _LEFT + (_WIDTH - _LEFT - 8.0) * value / (1e3 * length)
        rows.append(f'<text x="{at:.1f}" y="{_HEIGHT - 8:g}" text-anchor="middle">{value:g}</text>')
    rows.append(f'<text x="{_WIDTH - 8:g}" y="{_HEIGHT - 8:g}" text-anchor="end">mm</text></svg>')
    return "".join(rows)


def _ticks(top: float) -> list[float]:
    """Return round values from 0, four to eight of them."""
    step = 10.0 ** np.floor(np.log10(top / 4.0))
    for factor in (1.0, 2.0, 2.5, 5.0, 10.0):
        if top / (factor * step) <= 8.0:
            return [float(k * factor * step) for k in range(int(0.97 * top / (factor * step)) + 1)]
    return [0.0]
