"""The corners of a comparison as a table: worst and median over the corners, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from contourlab.reports.wording import NONE, Cell, significant
from contourlab.units import to_um

if TYPE_CHECKING:
    from contourlab.recordings.corners import CornerFigure
    from contourlab.simulation.comparison import Comparison

__all__ = ["CornerColumn", "corner_columns", "corner_json"]


@dataclass(frozen=True)
class CornerColumn:
    """Worst and median of one figure, a cell per run."""

    name: str
    unit: str
    worst: tuple[Cell, ...]
    lines: tuple[int, ...]
    """Source line of the move that ends at the worst corner; 0 if unknown."""
    median: tuple[Cell, ...]


def corner_columns(comparison: Comparison) -> list[CornerColumn]:
    """Return the table of corners; empty if the path has none.

    The best worst case and the best median of a machine's controllers are marked; times are not
    ranked.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    from contourlab.recordings.corners import summarise_corners

    if not comparison.corners:
        return []
    names = comparison.names
    held = [summarise_corners(comparison.corners.get(name, ())) for name in names]
    machines = [comparison.pair(name)[0] for name in names]
    columns = []
    for key, name in (
        ("overshoot", "overshoot"), ("undershoot", "undershoot"), ("time", "time"),
        ("error_max", "contour error"),
    ):  # fmt: skip
        figures = [figure.get(key) for figure in held]
        scale = 1e3 if key == "time" else 1.0
        columns.append(
            CornerColumn(
                name=name, unit="ms" if key == "time" else "µm",
                worst=_ranked([f.worst * scale if f else math.nan for f in figures], key, machines),
                lines=tuple(f.line if f else 0 for f in figures),
                median=_ranked(
                    [f.median * scale if f else math.nan for f in figures], key, machines
                ),
            )
        )  # fmt: skip
    return columns


def _ranked(values: list[float], key: str, machines: list[str]) -> tuple[Cell, ...]:
    texts = [_text(value, key) for value in values]
    cells = []
    for value, text, machine in zip(values, texts, machines, strict=True):
        own = [
            (v, t)
            for v, t, where in zip(values, texts, machines, strict=True)
            if where == machine and math.isfinite(v)
        ]
        differ = key != "time" and len({t for _, t in own}) > 1
        cells.append(Cell(text, differ and math.isfinite(value) and text == min(own)[1]))
    return tuple(cells)


def _text(value: float, key: str) -> str:
    if not math.isfinite(value):
        return NONE
    return significant(value, 4) if key == "time" else to_um(value)


def corner_json(comparison: Comparison, name: str) -> dict[str, Any] | None:
    """Return the corners of a run for programs, in SI; None if there are none.

    Parameters
    ----------
    comparison
        With one recording or more.
    name
        Of the run.
    """
    from contourlab.recordings.corners import summarise_corners

    passes = comparison.corners.get(name, ())
    if not passes:
        return None
    figures: Mapping[str, CornerFigure] = summarise_corners(passes)
    return {
        "count": len(passes),
        "radius": comparison.corner_radius,
        **{
            key: {"worst": figure.worst, "median": figure.median, "line": figure.line or None}
            for key, figure in figures.items()
        },
        "each": [
            {
                "parameter": one.corner.parameter,
                "position": np.asarray(one.corner.position).tolist(),
                "angle": one.corner.angle,
                "line": one.corner.line_before or None,
                "overshoot": one.overshoot,
                "undershoot": one.undershoot,
                "time": one.time if math.isfinite(one.time) else None,
                "error_max": one.error_max,
            }
            for one in passes
        ],
    }
