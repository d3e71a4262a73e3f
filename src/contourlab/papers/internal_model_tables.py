"""All runs behind the tables and figures of Cao and Zhang, made once.

References
----------
.. [CaoZhang] section 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace as changed
from contourlab.machines.published import cao_zhang_stage, cao_zhang_stage_and_scanner
from contourlab.papers.internal_model_runs import (
    LAWS,
    Figures,
    emulated,
    figures_of,
    four_axes,
    hardware_reference,
    law,
    run,
    shaken_reference,
    simulated_reference,
    thinned,
)
from contourlab.recordings import Recording

__all__ = ["CONTOURS", "NAMES", "WINDOW", "Curves", "Tables", "run_tables"]

CONTOURS = ("sinusoid", "circle", "heart")
NAMES = dict(zip(LAWS, ("PID", "cross-coupled", "task frame", "internal model"), strict=True))
WINDOW = (2.0, 20.0)
"""Over which figures are taken [s]: assumed."""
ENGAGED = 8.0
"""When the slaves of the four-axis simulation are engaged [s], as in Figure 9; figures from 0.1 s
later on."""
HARDWARE_ENGAGED = 2.0
"""Likewise in the emulated experiment [s]: assumed."""
Curves = tuple[NDArray[Any], tuple[tuple[str, NDArray[Any]], ...]]
"""Time [s], and curves [um] by name."""


@dataclass
class Tables:
    """What the tables and figures are made of."""

    simulated: dict[tuple[str, str], Figures] = field(default_factory=dict)
    """Table 1 as printed."""
    doubled: dict[tuple[str, str], Figures] = field(default_factory=dict)
    """With radius 2, where that was tried."""
    fast: dict[str, Figures] = field(default_factory=dict)
    """The task frame law at 0.25 ms."""
    filtered: Figures = field(default_factory=lambda: Figures(np.nan, np.nan))
    """PID on the sinusoid with a filtered derivative, from 0 s."""
    emulated: dict[tuple[str, str], Figures] = field(default_factory=dict)
    """Table 3."""
    shaken: Figures = field(default_factory=lambda: Figures(np.nan, np.nan))
    """Figure 5."""
    four_axes: Figures = field(default_factory=lambda: Figures(np.nan, np.nan))
    """Figure 9."""
    four_axes_emulated: Figures = field(default_factory=lambda: Figures(np.nan, np.nan))
    """Figure 13."""
    curves: dict[str, Curves] = field(default_factory=dict)
    """By name of the figure."""


def run_tables(progress: Callable[[float], None], contours: tuple[str, ...] = CONTOURS) -> Tables:
    """Run all experiments.

    Parameters
    ----------
    progress
        Called with the share done.
    contours
        Those of Tables 1 and 3 that are wanted.
    """
    tables = Tables()
    stage = cao_zhang_stage()
    total = len(contours) * (2 * len(LAWS) + 3) + 4
    done = iter(range(1, total + 2))

    def one(name: str, reference: Any, machine: Any = None, **changes: Any) -> Recording:
        chosen = stage if machine is None else machine
        found = run(law(name, chosen, **changes), reference, chosen)
        progress(min(1.0, next(done) / total))
        return found

    for number, contour in enumerate(contours):
        shown, emulation = [], []
        for name in LAWS:
            recording = one(name, simulated_reference(contour))
            tables.simulated[contour, name] = figures_of(recording, *WINDOW)
            time, error = thinned(recording)
            shown.append((NAMES[name], error))
            if contour != "sinusoid" and name != LAWS[3]:
                twice = one(name, simulated_reference(contour, 2.0))
                tables.doubled[contour, name] = figures_of(twice, *WINDOW)
            recording = one(name, hardware_reference(contour), emulated())
            tables.emulated[contour, name] = figures_of(recording, *WINDOW)
            emulation.append((NAMES[name], thinned(recording)[1]))
        index = CONTOURS.index(contour)
        tables.curves[f"internal_model_figure_{6 + index}"] = (time, tuple(shown))
        tables.curves[f"internal_model_figure_{10 + index}"] = (time, tuple(emulation))
        # the printed models hold at 1 ms: their continuous form for a faster loop
        continuous = changed(stage, dynamics=_continuous(stage))
        quick = simulated_reference(contour, 1.0, 20.0, 0.25e-3)
        tables.fast[contour] = figures_of(one(LAWS[2], quick, continuous), *WINDOW)
        del number
    start = one(LAWS[0], simulated_reference("sinusoid"), derivative_cutoff_hz=50.0 / (2.0 * np.pi))
    tables.filtered = figures_of(start, 0.0, 20.0)
    shaken = one(LAWS[3], shaken_reference())
    tables.shaken = figures_of(shaken, *WINDOW)
    time, error = thinned(shaken)
    tables.curves["internal_model_figure_5"] = (time[time >= 1.0], (
        ("internal model", error[time >= 1.0]),
    ))  # fmt: skip
    four = one(LAWS[3], four_axes(), cao_zhang_stage_and_scanner(), engage_time=ENGAGED)
    tables.four_axes = figures_of(four, ENGAGED + 0.1, 20.0)
    tables.curves["internal_model_figure_9"] = _of(four)
    four = one(
        LAWS[3], four_axes(0.03, 0.003, (0.2 * np.pi, 2.0 * np.pi)),
        emulated(resolution=(10e-9, 10e-9, 100e-9, 100e-9), n_axes=4),
        engage_time=HARDWARE_ENGAGED,
    )  # fmt: skip
    tables.four_axes_emulated = figures_of(four, HARDWARE_ENGAGED + 0.1, 20.0)
    tables.curves["internal_model_figure_13"] = _of(four)
    return tables


def _of(recording: Recording) -> Curves:
    time, error = thinned(recording)
    return time, (("internal model", error),)


def _continuous(stage: Any) -> Any:
    return stage.dynamics.continuous()
