"""Natural local approximation: the helix in simulation, ellipse and figure of eight on a stage.

The helix is simulated as the paper says. As printed it cannot give the published errors: the law
is told B = 180 for z, which is right, while x and y are wrong by 5; what the wrong B makes is then
not along the path, and 5 c γ_z / (2π f_b)² of it stands across the path in both methods. With 185
for z (5 more on every axis) the wrong part is along the velocity. What is left depends on the
sample time: a command that is held is late by T / 2 behind a viscous drag of 200 1/s.

The stage is hardware. What is run here is an emulation whose parameters were fitted to some of the
published figures (:func:`~contourlab.machines.published.meng_emulated_stage`); it can show whether
the relations between the figures follow from the method, not what the stage did.

References
----------
.. [MengLouZhou] section IV, Tables I and II, Figures 3 to 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from contourlab.machines.published.meng import EMULATION
from contourlab.papers.natural_local_rows import (
    COLUMNS,
    GAINS,
    HELIX,
    TABLES,
    VARIANTS,
    gains_text,
    helix_rows,
    speed_row,
    stage_rows,
)
from contourlab.papers.natural_local_runs import FIRST, NATURAL, helix_run, stage_run
from contourlab.papers.paper import Paper, Progress
from contourlab.recordings import Recording
from contourlab.reports.reproduction import PaperFigure, Reproduction

__all__ = ["PAPER"]


def _run(progress: Progress) -> Reproduction:
    total = 4 * len(VARIANTS) + sum(len(table) for table in TABLES.values())
    done = iter(range(1, total + 1))

    def tick(recording: Recording) -> Recording:
        progress(PAPER.slug, next(done) / total)
        return recording

    helix = {
        (case, law, k): tick(
            helix_run(
                law, GAINS[k], viscous_z=viscous, sample_time=period, hold_compensation=hold
            )
        )
        for case, (viscous, period, hold, _) in VARIANTS.items()
        for law, k in HELIX
    }  # fmt: skip
    stage = {
        (contour, law, f): tick(stage_run(contour, law, float(f)))
        for contour, table in TABLES.items()
        for law, f in table
    }
    means = {key: 1e6 * _number(run, "contour_error_mean") for key, run in helix.items()}
    rows = [*helix_rows(means)]
    for contour, table in TABLES.items():
        found = {(law, f): _columns(stage[contour, law, f]) for law, f in table}
        rows += [*stage_rows(contour, table, found), speed_row(contour)]
    return Reproduction(
        paper=PAPER.slug,
        title=PAPER.title,
        rows=tuple(rows),
        figures=tuple(_figures(helix, stage)),
        assumed=(
            "Helix: c = 0.1 m is per second, velocity is true, the command is held exactly, the "
            "machine starts at rest on a reference that moves, the mean is over all 4 periods.",
            *EMULATION,
            "Tables: two rounds, with the start from rest on a reference that moves; 'Con. Input' "
            "is the rms.",
        ),
    )


def _number(recording: Recording, name: str) -> float:
    return float(np.asarray(recording.metrics[name]))


def _columns(recording: Recording) -> tuple[float, ...]:
    x, y = np.asarray(recording.metrics["command_rms"])
    scale = {"um": 1e6, "mm": 1e3}
    errors = [scale[unit] * _number(recording, name) for name, unit in COLUMNS[:4]]
    return (*errors, float(x), float(y))


def _figures(
    helix: Mapping[tuple[str, str, int], Recording], stage: Mapping[tuple[str, str, int], Recording]
) -> Iterable[PaperFigure]:
    names = {FIRST: "first order", NATURAL: "natural local"}

    def curves(runs: Mapping[str, Recording], until: float) -> dict[str, Any]:
        time = np.asarray(next(iter(runs.values()))["time"])
        kept = time <= until
        return {
            "time": time[kept],
            "curves": tuple(
                (names[law], 1e6 * np.abs(np.asarray(run["contour_error"]))[kept])
                for law, run in runs.items()
            ),
        }

    case = "B of z 185"
    for k, number in ((0, 3), (1, 4)):
        runs = {law: helix[case, law, k] for law in names}
        yield PaperFigure(
            name=f"natural_local_figure_{number}", y_label="contour error [µm]",
            title=f"Helix, f = {gains_text(k)}; 1 ms, the law told 185 for z (Figure {number})",
            **curves(runs, 2.0),
        )  # fmt: skip
    for contour, number in (("ellipse", 5), ("figure of eight", 6)):
        runs = {law: stage[contour, law, 100] for law in names}
        yield PaperFigure(
            name=f"natural_local_figure_{number}", y_label="contour error [µm]",
            title=f"{contour.capitalize()}, f = (15, 100) Hz, emulated stage (Figure {number})",
            **curves(runs, np.inf),
        )  # fmt: skip


PAPER = Paper(
    slug="natural-local",
    title="Natural local approximation based contouring control (Meng, Lou, Zhou)",
    figures=tuple(f"natural_local_figure_{number}" for number in (3, 4, 5, 6)),
    run=_run,
)
