"""Which runs share a plot of one axis: of commands, those with the same unit and limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contourlab.reports.drawing import Drawing, Run
from contourlab.reports.wording import command_limits, command_unit

__all__ = ["Panel", "command_panels", "tracking_panels"]


@dataclass(frozen=True, eq=False)
class Panel:
    """One row of a figure over all axes."""

    axis: int
    title: str
    """Name of the axis; with the machine's if there is a panel for each."""
    unit: str
    limit: float
    """Of the command; infinite if there is none."""
    runs: tuple[Run, ...]


def command_panels(drawing: Drawing) -> list[Panel]:
    """Return the rows of the figure of commands: one per axis, or one per axis and machine.

    Machines share a row if their commands have the same unit and limits.

    Parameters
    ----------
    drawing
        The comparison.
    """
    runs = [run for run in drawing.runs if "command" in run.recording.dataset]
    machines = dict.fromkeys(run.machine for run in runs)
    first = {name: next(run for run in runs if run.machine == name) for name in machines}
    held = {
        (command_unit(run.recording), tuple(command_limits(run.recording)))
        for run in first.values()
    }
    together = len(held) <= 1
    panels = []
    for axis, label in enumerate(np.asarray(runs[0].recording["axis"]) if runs else ()):
        for name in list(machines)[:1] if together else machines:
            own = first[name].recording
            limit = command_limits(own)[axis]
            panels.append(
                Panel(
                    axis=axis,
                    title=str(label) if together else f"{label}, {name}",
                    unit=command_unit(own),
                    limit=limit if math.isfinite(limit) else math.inf,
                    runs=tuple(run for run in runs if together or run.machine == name),
                )
            )
    return panels


def tracking_panels(drawing: Drawing) -> list[Panel]:
    """Return the rows of the figure of tracking errors, one per axis; empty if none was recorded.

    Parameters
    ----------
    drawing
        The comparison.
    """
    runs = tuple(run for run in drawing.runs if "tracking_error" in run.recording.dataset)
    return [
        Panel(axis=axis, title=str(label), unit="µm", limit=math.inf, runs=runs)
        for axis, label in enumerate(np.asarray(runs[0].recording["axis"]) if runs else ())
    ]
