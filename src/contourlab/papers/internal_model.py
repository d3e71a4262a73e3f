"""Time-varying internal model contouring in the position domain: Cao and Zhang.

The simulations can be run as they are printed, and the figures of PID and cross-coupling come out
where the contour is that of the paper. The published maxima on the sinusoid are no maxima of a
steady state; circle and heart fit with twice the printed radius. The published figures of the
internal model are numerical noise of how its coefficients were computed: with the coefficients in
closed form the error is at rounding, so that these are taken for bounds.

The experiments can be emulated only. Their order of controllers is asked for, on a stage with dry
friction, wrong gains and encoders of 10 nm; in the emulation it depends on these, which is shown.

References
----------
.. [CaoZhang] section 6, Tables 1 and 3, Figures 5 to 13.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from contourlab.papers.internal_model_claims import claim_rows
from contourlab.papers.internal_model_runs import (
    COUPLED,
    HARDWARE_SMOOTHING,
    LAWS,
    SCANNER_PID,
    SMOOTHING,
    Figures,
)
from contourlab.papers.internal_model_tables import (
    CONTOURS,
    Tables,
    run_tables,
)
from contourlab.papers.paper import MATCH, Paper, Progress, close
from contourlab.reports.reproduction import PaperFigure, PaperRow, Reproduction

__all__ = ["ASSUMED", "PAPER", "TABLE_1", "TABLE_3", "table_1_rows", "table_3_rows"]

PID, CCC, TCF, TV = LAWS
TABLE_1: dict[tuple[str, str], tuple[float, float]] = {
    ("sinusoid", PID): (8.7e-4, 1.7e-3), ("sinusoid", CCC): (4.3e-4, 8.4e-4),
    ("sinusoid", TCF): (6.5e-7, 1.0e-6), ("sinusoid", TV): (2.6e-11, 5.1e-9),
    ("circle", PID): (1.1e-3, 1.6e-3), ("circle", CCC): (5.7e-4, 8.2e-4),
    ("circle", TCF): (6.6e-7, 1.0e-6), ("circle", TV): (2.6e-11, 5.0e-9),
    ("heart", PID): (1.6e-3, 5.8e-3), ("heart", CCC): (9.0e-4, 7.4e-3),
    ("heart", TCF): (2.8e-4, 3.5e-3), ("heart", TV): (2.7e-7, 1.5e-5),
}  # fmt: skip
"""Rms and maximum [mm]."""
TABLE_3: dict[tuple[str, str], tuple[float, float]] = {
    ("sinusoid", PID): (0.47, 4.62), ("sinusoid", CCC): (0.23, 2.36),
    ("sinusoid", TCF): (0.15, 1.44), ("sinusoid", TV): (0.04, 0.23),
    ("circle", PID): (9.98, 17.40), ("circle", CCC): (4.99, 8.76),
    ("circle", TCF): (0.84, 1.54), ("circle", TV): (0.06, 0.26),
    ("heart", PID): (3.12, 28.06), ("heart", CCC): (1.53, 13.94),
    ("heart", TCF): (0.23, 1.59), ("heart", TV): (0.06, 0.91),
}  # fmt: skip
"""Rms and maximum [um]."""
TASK_FRAME = (
    ": the task frame law has no integral, so that friction and a wrong gain act on it in full; "
    "see the rows of the robustness"
)
QUANTITIES = ("contour_error_rms", "contour_error_max")
FLOORS_UM = (1e-13, 1e-6)
"""Below which nothing is drawn, in simulations and in emulations [um]."""
ASSUMED = (
    "The models and gains are in mm and volts: the paper prints no units of them.",
    "The axes start at rest on a reference that moves at once. Figures are over 2 to 20 s: the "
    "paper does not say over what it takes them.",
    "The PID has no filter on its derivative and no feed-forward; the cross-coupling is the PID on "
    "the estimated contour error vector added, by the tangent at the reference point, which is "
    "what gains K = 1 make of it.",
    f"The heart is r2 = sin t + (cos^2 t + d^2)^(1/3) with d = {SMOOTHING:g}, and "
    f"{HARDWARE_SMOOTHING:g} in the experiments: printed, it is not real for cos t < 0 and has "
    "cusps.",
    "The task frame law is told M, B and the stiffness of the printed poles and gains, finds the "
    "velocity by the difference of two positions, and does not allow for the held command.",
    f"That d = {SMOOTHING:g} is a fit after the fact, not a setting of the paper's: it brings the "
    "maximum of PID with twice the radius to the printed one. Every figure at the heart's cusps "
    "hangs on it.",
    "The internal model takes the printed pulse transfer functions, K and F; its second signal is "
    "the one that turns best on each contour, the master is predicted by an observer of 100 Hz "
    "and its amplitude compensated (Remark 4.1).",
    "The experiments are an emulation: dry friction of 0.05 V, gains of +2 and -2 %, encoders of "
    "10 nm (printed). Friction and gain errors are assumed, not fitted.",
    f"The cross-coupling acts from the start in the simulations, and from {COUPLED:g} s in the "
    "experiments, where the paper enables it 'not immediately' and does not say when; figures are "
    "taken from 2 s.",
    f"Until they are engaged, at 8 s, X3 and X4 run by a PID of {SCANNER_PID[0][0]:g} V/mm and "
    f"{SCANNER_PID[1][0]:g} V/(mm s).",
)


def table_1_rows(tables: Tables) -> list[PaperRow]:
    """Return the rows of Table 1, as printed and with the radius that fits.

    Parameters
    ----------
    tables
        Of the runs.
    """
    rows = []
    for contour in CONTOURS:
        for controller in LAWS:
            found = tables.simulated[contour, controller]
            twice = tables.doubled.get((contour, controller))
            fast = tables.fast.get(contour) if controller == TCF else None
            told = tables.true_velocity.get(contour) if controller == TCF else None
            pairs = zip(
                QUANTITIES, TABLE_1[contour, controller], _mm(found),
                *((None, None) if one is None else _mm(one) for one in (twice, fast, told)),
                strict=True,
            )  # fmt: skip
            for quantity, published, value, doubled, finer, ideal in pairs:
                verdict, why = _simulated(
                    contour, controller, quantity, published, value, doubled, finer, ideal,
                    tables.filtered,
                )  # fmt: skip
                rows.append(_row(
                    "Table 1, simulation", contour, controller, quantity, "mm", published, value,
                    verdict, why,
                ))  # fmt: skip
                if doubled is not None:
                    good = close(doubled, published)
                    rows.append(_row(
                        "Table 1, simulation", f"{contour}, radius 2", controller, quantity, "mm",
                        published, doubled, "matched" if good else "differs",
                        "radius 2 is assumed, where 1 is printed: a fit after the fact, to which "
                        + ("this figure agrees" if good else "this figure does not agree"),
                    ))  # fmt: skip
    return rows


def _simulated(
    contour: str, controller: str, quantity: str, published: float, value: float,
    doubled: float | None, finer: float | None, ideal: float | None, filtered: Figures,
) -> tuple[str, str]:  # fmt: skip
    if controller == TV:
        if value <= published:
            return "relation", (
                "below the published figure, which is numerical noise of integrating (18) near "
                "the instants at which the exosystem does not turn (its maximum is hundreds of "
                "times its rms); the error is at rounding where the master's angle is exact"
            )
        return "differs", "above the published figure"
    if close(value, published):
        return "matched", ""
    if doubled is not None and close(doubled, published):
        return "differs", (
            f"with twice the printed radius it is {doubled:.4g}: a contour of radius 2, or an "
            "error measured by a factor of two, in the paper; it cannot be told which"
        )
    if contour == "sinusoid" and controller != TCF and quantity == "contour_error_max":
        return "differs", (
            "rms over maximum is 0.51 in print, less than the 0.71 of a sine, which is what the "
            "steady error is: the printed maximum is of a start. With a filter of N = 50/s on the "
            f"derivative and the start counted, PID has {1e3 * filtered.largest:.3g} mm"
        )
    if controller == TCF and finer is not None and contour != "heart":
        return "differs", (
            "the error of this law is that of holding the command over a sample, proportional to "
            f"it: at 0.25 ms it is {finer:.3g} mm. A simulation of the law in continuous time "
            "would print less"
        )
    if controller == TCF and ideal is not None and value > ideal:
        return "differs", (
            "the law finds the velocity by the difference of two positions, which is half a sample "
            f"late where the rounded cusps accelerate; told the true one it has {ideal:.3g} mm. "
            "How the paper finds it, and how it rounds the cusps, is not printed"
        )
    return "differs", (
        "at the notch and the tip the figure depends on how the cusps are rounded, and on a "
        "filter of the derivative; neither is printed"
    )


def table_3_rows(tables: Tables) -> list[PaperRow]:
    """Return the rows of Table 3, of the emulated experiments.

    Parameters
    ----------
    tables
        Of the runs.
    """
    rows = []
    for contour in CONTOURS:
        for controller in LAWS:
            # the task frame among all, the others among themselves
            others = [law for law in LAWS if controller == TCF or law != TCF]
            for index, (quantity, published) in enumerate(
                zip(QUANTITIES, TABLE_3[contour, controller], strict=True)
            ):
                word = ("rms", "maximum")[index]
                value = _um(tables.emulated[contour, controller])[index]
                place = _below(contour, controller, others, tables, index)
                among = "the four" if controller == TCF else "the three without the task frame"
                why = (
                    f"emulation; relation: above and below the same laws by {word}, among {among}"
                    if place
                    else f"emulation; not above and below the same laws by {word}, among {among}"
                    + (TASK_FRAME if controller == TCF else "")
                )
                rows.append(_row(
                    "Table 3, emulation", contour, controller, quantity, "um", published, value,
                    "relation" if place else "differs", why,
                ))  # fmt: skip
    return rows


def _below(
    contour: str, controller: str, among: list[str], tables: Tables, index: int
) -> bool:  # fmt: skip
    """Return whether a law is above and below the same others as in print, by rms or maximum."""
    printed = TABLE_3[contour, controller][index]
    found = _um(tables.emulated[contour, controller])[index]
    return all(
        (TABLE_3[contour, other][index] < printed)
        == (_um(tables.emulated[contour, other])[index] < found)
        for other in among
        if other != controller
    )


def _row(
    experiment: str, case: str, controller: str, quantity: str, unit: str,
    published: float | None, value: float, verdict: str, why: str,
) -> PaperRow:  # fmt: skip
    tolerance = f"matched is within {100 * MATCH:g} %" if verdict == "matched" else ""
    return PaperRow(
        experiment=experiment, case=case, controller=controller, quantity=quantity, unit=unit,
        published=published, reproduced=value, verdict=verdict,
        note="; ".join(text for text in (tolerance, why) if text),
    )  # fmt: skip


def _mm(figures: Figures) -> tuple[float, float]:
    return 1e3 * figures.rms, 1e3 * figures.largest


def _um(figures: Figures) -> tuple[float, float]:
    return 1e6 * figures.rms, 1e6 * figures.largest


TITLES = {
    5: "Master's error of 0.1 sin 5t mm, internal model (Figure 5)",
    6: "Sinusoid, simulated (Figure 6)",
    7: "Circle, simulated (Figure 7)",
    8: "Heart, simulated (Figure 8)",
    9: "Four axes, slaves engaged at 8 s (Figure 9)",
    10: f"Sinusoid, emulated, cross-coupling engaged at {COUPLED:g} s (Figure 10)",
    11: f"Circle, emulated, cross-coupling engaged at {COUPLED:g} s (Figure 11)",
    12: f"Heart, emulated, cross-coupling engaged at {COUPLED:g} s (Figure 12)",
    13: "Four axes, emulated, slaves engaged at 2 s (Figure 13)",
}


def _figures(tables: Tables, sweep: PaperFigure) -> Iterable[PaperFigure]:
    for number, title in TITLES.items():
        name = f"internal_model_figure_{number}"
        time, curves = tables.curves[name]
        # what is at rounding would stretch the scale to the bottom
        floor = FLOORS_UM[number >= 10]
        floored = tuple((label, np.maximum(values, floor)) for label, values in curves)
        yield PaperFigure(
            name=name, title=title, y_label="contour error [µm]", time=time, curves=floored,
            log_y=True,
        )  # fmt: skip
    yield sweep


def _run(progress: Progress) -> Reproduction:
    tables = run_tables(lambda share: progress(PAPER.slug, 0.5 * share))
    rows, sweep = claim_rows(tables, lambda share: progress(PAPER.slug, 0.5 + 0.5 * share))
    return Reproduction(
        paper=PAPER.slug, title=PAPER.title, assumed=ASSUMED,
        rows=(*table_1_rows(tables), *table_3_rows(tables), *rows),
        figures=tuple(_figures(tables, sweep)),
    )  # fmt: skip


PAPER = Paper(
    slug="internal-model",
    title="Time-varying internal model contouring in the position domain (Cao, Zhang)",
    figures=(
        *(f"internal_model_figure_{number}" for number in TITLES),
        "internal_model_master_error",
    ),
    run=_run,
)
