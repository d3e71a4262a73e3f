"""Predictive contouring: a circle and a figure of eight on a biaxial feed drive, in simulation.

The paper's two claims hold where a disturbance is there to be removed and the law has enough free
commands; they turn round with a noisy sensor, and they are one claim: across the path only
ρ_n / ρ_cn matters. Of the second, ρ_t = 10³ ρ_n, one of two readings does what the paper says. The
disturbance model, which it does not state, matters more than either.

References
----------
.. [ElKhalickUchiyama] Table 1, equations (21) to (25), Figures 3 to 7.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from contourlab.papers.paper import Paper, Progress
from contourlab.papers.predictive_rows import (
    bound_rows,
    model_rows,
    robust_rows,
    space_rows,
    study_rows,
)
from contourlab.papers.predictive_runs import (
    ASSUMED,
    CONTOUR,
    EQUAL,
    LOWERED,
    PLAIN,
    RAISED,
    WINDOW,
    Case,
    Errors,
    cases,
    judged,
    run_case,
)
from contourlab.recordings import Recording
from contourlab.reports.reproduction import PaperFigure, Reproduction

__all__ = ["PAPER"]


def _run(progress: Progress) -> Reproduction:
    todo = list(cases())
    found: dict[Case, Errors] = {}
    drawn: dict[Case, Recording] = {}
    for k, case in enumerate(todo):
        recording = run_case(case)
        found[case] = judged(case, recording)
        if case.model == PLAIN and not case.axis and not case.change:
            drawn[case] = recording
        progress(PAPER.slug, (k + 1) / len(todo))
    return Reproduction(
        paper=PAPER.slug,
        title=PAPER.title,
        rows=(
            *model_rows(), *study_rows(found), *bound_rows(found), *robust_rows(found),
            *space_rows(found),
        ),
        figures=tuple(_figures(drawn)),
        assumed=ASSUMED,
    )  # fmt: skip


DRAWN = {
    "4": ("circle", CONTOUR),
    "5": ("figure of eight", CONTOUR),
    "6": ("circle", LOWERED),
    "6_raised": ("circle", RAISED),
    "7": ("figure of eight", LOWERED),
    "7_raised": ("figure of eight", RAISED),
}
"""Trajectory and weights of (b); 6 and 7 in both readings of ρ_t = 10³ ρ_n."""


def _figures(drawn: Mapping[Case, Recording]) -> Iterator[PaperFigure]:
    for number, (contour, weights) in DRAWN.items():
        runs = {
            f"({letter}) {what}": drawn[Case(contour, weights=what)]
            for letter, what in (("a", EQUAL), ("b", weights))
        }
        time = np.asarray(next(iter(runs.values()))["time"])
        kept = (time >= WINDOW[0]) & (time <= WINDOW[1])
        yield PaperFigure(
            name=f"predictive_figure_{number}",
            title=f"{contour.capitalize()}, {PLAIN} (Figure {number.partition('_')[0]}, {weights})",
            y_label="contour error [µm]",
            time=time[kept],
            curves=tuple(
                (name, 1e6 * np.asarray(run["contour_error"])[kept]) for name, run in runs.items()
            ),
        )


PAPER = Paper(
    slug="predictive",
    title="Model predictive approach to contouring control (El Khalick, Uchiyama)",
    figures=tuple(f"predictive_figure_{number}" for number in DRAWN),
    run=_run,
)
