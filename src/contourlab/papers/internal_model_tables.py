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

from contourlab.configuration import replace as changed
from contourlab.machines import Encoder
from contourlab.machines.published import cao_zhang_stage, cao_zhang_stage_and_scanner
from contourlab.papers.internal_model_runs import (
    COUPLED,
    LAWS,
    SHAKEN,
    Curves,
    Figures,
    emulated,
    figures_of,
    four_axes,
    hardware_reference,
    law,
    run,
    shaking,
    shown,
    simulated_reference,
)
from contourlab.recordings import Recording

__all__ = ["CONTOURS", "NAMES", "OBSERVER_HZ", "WINDOW", "Tables", "run_tables"]

CONTOURS = ("sinusoid", "circle", "heart")
NAMES = dict(zip(LAWS, ("PID", "cross-coupled", "task frame", "internal model"), strict=True))
WINDOW = (2.0, 20.0)
"""Over which figures are taken [s]: assumed."""
ENGAGED = 8.0
"""When the slaves of the four-axis simulation are engaged [s], as in Figure 9; figures from 0.1 s
later on."""
HARDWARE_ENGAGED = 2.0
"""Likewise in the emulated experiment [s]: assumed."""
OBSERVER_HZ = 40.0
"""Bandwidth of the slaves' disturbance observers: ours."""


@dataclass
class Tables:
    """What the tables and figures are made of."""

    simulated: dict[tuple[str, str], Figures] = field(default_factory=dict)
    """Table 1 as printed."""
    doubled: dict[tuple[str, str], Figures] = field(default_factory=dict)
    """With radius 2, where that was tried."""
    fast: dict[str, Figures] = field(default_factory=dict)
    """The task frame law at 0.25 ms."""
    true_velocity: dict[str, Figures] = field(default_factory=dict)
    """The task frame law on the heart, given the velocity itself, not a difference of positions."""
    filtered: Figures = field(default_factory=lambda: Figures(np.nan, np.nan))
    """PID on the sinusoid with a filtered derivative, from 0 s."""
    emulated: dict[tuple[str, str], Figures] = field(default_factory=dict)
    """Table 3."""
    shaken: dict[str, Figures] = field(default_factory=dict)
    """Figure 5: the master's error with its frequency ``known``, and ``unknown``."""
    shaken_master: float = np.nan
    """The master's error there, as it was [m]."""
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
    total = len(contours) * (2 * len(LAWS) + 3) + 6
    done = iter(range(1, total + 2))

    def one(
        name: str, reference: Any, machine: Any = None, *, disturbances: Any = (), **changes: Any
    ) -> Recording:
        chosen = stage if machine is None else machine
        found = run(law(name, chosen, **changes), reference, chosen, disturbances=disturbances)
        progress(min(1.0, next(done) / total))
        return found

    for contour in contours:
        simulated, emulation = {}, {}
        for name in LAWS:
            recording = simulated[NAMES[name]] = one(name, simulated_reference(contour))
            tables.simulated[contour, name] = figures_of(recording, *WINDOW)
            if contour != "sinusoid" and name != LAWS[3]:
                twice = one(name, simulated_reference(contour, 2.0))
                tables.doubled[contour, name] = figures_of(twice, *WINDOW)
            late = {"engage_time": COUPLED} if name == LAWS[1] else {}
            recording = one(name, hardware_reference(contour), emulated(), **late)
            emulation[NAMES[name]] = recording
            tables.emulated[contour, name] = figures_of(recording, *WINDOW)
        index = CONTOURS.index(contour)
        tables.curves[f"internal_model_figure_{6 + index}"] = shown(simulated)
        tables.curves[f"internal_model_figure_{10 + index}"] = shown(emulation)
        # the printed models hold at 1 ms: their continuous form for a faster loop
        continuous = changed(stage, dynamics=_continuous(stage))
        quick = simulated_reference(contour, 1.0, 20.0, 0.25e-3)
        tables.fast[contour] = figures_of(one(LAWS[2], quick, continuous), *WINDOW)
        if contour == "heart":
            seen = changed(continuous, sensor=Encoder(velocity="ideal"))
            told = one(LAWS[2], simulated_reference(contour), seen)
            tables.true_velocity[contour] = figures_of(told, *WINDOW)
    start = one(LAWS[0], simulated_reference("sinusoid"), derivative_cutoff_hz=50.0 / (2.0 * np.pi))
    tables.filtered = figures_of(start, 0.0, 20.0)
    _figure_5(tables, one)
    four = one(LAWS[3], four_axes(), cao_zhang_stage_and_scanner(), engage_time=ENGAGED)
    tables.four_axes = figures_of(four, ENGAGED + 0.1, 20.0)
    tables.curves["internal_model_figure_9"] = shown({NAMES[LAWS[3]]: four})
    four = one(
        LAWS[3], four_axes(0.03, 0.003, (0.2 * np.pi, 2.0 * np.pi)),
        emulated(resolution=(10e-9, 10e-9, 100e-9, 100e-9), n_axes=4),
        engage_time=HARDWARE_ENGAGED,
    )  # fmt: skip
    tables.four_axes_emulated = figures_of(four, HARDWARE_ENGAGED + 0.1, 20.0)
    tables.curves["internal_model_figure_13"] = shown({NAMES[LAWS[3]]: four})
    return tables


def _figure_5(tables: Tables, one: Callable[..., Recording]) -> None:
    """Run the sinusoid with r1 = t and a master that a disturbance shakes by 0.1 sin 5t."""
    push, reference = shaking(), simulated_reference("sinusoid")
    known = one(
        LAWS[3], reference, disturbances=push, disturbance_observer_hz=OBSERVER_HZ,
        disturbance_frequencies_hz=np.array([SHAKEN / (2.0 * np.pi)]),
        reject_on="slaves",
    )  # fmt: skip
    unknown = one(LAWS[3], reference, disturbances=push)
    tables.shaken = {
        "known": figures_of(known, *WINDOW), "unknown": figures_of(unknown, *WINDOW),
    }  # fmt: skip
    error = np.asarray(unknown["tracking_error"])[:, 0]
    tables.shaken_master = float(np.ptp(error[np.asarray(unknown["time"]) >= WINDOW[0]])) / 2.0
    tables.curves["internal_model_figure_5"] = shown({
        "frequency of the master's error known": known, "unknown": unknown,
    })  # fmt: skip


def _continuous(stage: Any) -> Any:
    return stage.dynamics.continuous()
