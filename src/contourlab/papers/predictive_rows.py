"""Predictive contouring: from figures of closed loops to rows with a verdict and the reason.

The paper prints no error; its figures have no readable scale here and rest on settings that it does
not state. What can be judged is its two claims: a larger weight of the error across the path, and a
smaller one of the commands across it, lower the contour error. A row of a claim is ``relation`` if
the rms falls by 5 % or more and the largest error falls too, ``differs`` with the reason if not.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

import numpy as np

from contourlab.controllers.held_model import held_polynomials
from contourlab.machines.published.el_khalick import PRINTED, el_khalick_feed_drive
from contourlab.papers.paper import change_percent
from contourlab.papers.predictive_runs import (
    BOUNDS,
    CONTOUR,
    EQUAL,
    FREE,
    LOWERED,
    MODELS,
    ONE_ANGLE,
    PLAIN,
    RAISED,
    ROBUST,
    SAMPLE_TIME,
    WEIGHTS,
    Case,
    tried,
)
from contourlab.reports.reproduction import PaperRow

__all__ = ["bound_rows", "model_rows", "robust_rows", "space_rows", "study_rows"]

Found = Mapping[Case, tuple[float, float]]
"""Rms and largest contour error [um]."""
AXIS, LAW = "axis_predictive", "predictive_contouring"
LETTERS = {EQUAL: "(a)", CONTOUR: "(b)", LOWERED: "(b)", RAISED: "(b)"}
STUDIES = {CONTOUR: 0, LOWERED: 1, RAISED: 1}
FIGURES = {"circle": ("4", "6"), "figure of eight": ("5", "7")}
SAME = 1e-4
"""Relative difference up to which two laws count as one: rounding, amplified by a loop."""
NO_NUMBER = "the paper prints no number and no horizon, weight of inputs or disturbance model"
FALL = 5.0
"""By how many percent the rms has to fall [%]."""
FELL = f"relation: rms at least {FALL:g} % below that of (a), the largest error below it too"
DECIDES = (
    "assumed disturbance models beside each other: which disturbances the law expects decides more "
    "than the weights that the paper studies"
)

KEPT = (
    "a command that is kept from the fifth sample to the twentieth misses a curve, by the square "
    "of the feed, and the larger weight enlarges that; with H_c = 10 (below) the rms falls"
)

WHY: dict[tuple[str, str], str] = {
    ("", RAISED): (
        "nothing is gained across the path, where rho_n / rho_cn is what it was; with the angle of "
        "each sample ahead, commands that are a thousand times cheaper across the tangent are "
        "pushed across the path as the tangent turns within the horizon; with one angle for the "
        "horizon (below) they are not"
    ),
    (ONE_ANGLE, RAISED): "nothing is gained across the path, where rho_n / rho_cn is what it was, "
    "and a lag e_t along a path of curvature kappa leaves kappa e_t^2 / 2",
    ("H_c = 1", ""): "one command for the whole horizon is fitted to all outputs: their common "
    "weight cancels, and that of the input is nothing beside it",
    ("H_p = 30", CONTOUR): "five free commands are too coarse for 0.15 s: the fifth is kept for 25 "
    "samples, and the larger weight asks for more than they can do; with H_c = 10 the claim holds",
    ("no friction", CONTOUR): f"without a disturbance a few nanometres are left: {KEPT}",
    ("ten times faster", CONTOUR): KEPT,
    ("ten times faster, H_c = 10", CONTOUR): "the rms falls; the peak where friction turns round "
    "is somewhat higher",
    ("noise of 0.1 um", CONTOUR): "the law follows noise: the stiffer across the path, the more",
    ("noise of 0.1 um", LOWERED): "the law follows noise: the stiffer across the path, the more",
    (
        "cutting force",
        CONTOUR,
    ): "the peaks of friction are lower, but what the force at 30 Hz leaves "
    "is larger, as behind every feedback at some frequencies; at 10 Hz the claim holds",
}
"""Why a claim fails, by change and weights; "" for any."""


def _why(change: str, weights: str) -> str:
    for key in ((change, weights), (change, ""), ("", weights)):
        if key in WHY:
            return WHY[key]
    return "not explained"


def _row(experiment: str, case: str, controller: str, quantity: str, unit: str, reproduced: float,
         verdict: str, note: str, published: float | None = None) -> PaperRow:  # fmt: skip
    return PaperRow(
        experiment=experiment, case=case, controller=controller, quantity=quantity, unit=unit,
        published=published, reproduced=reproduced, verdict=verdict, note=note,
    )  # fmt: skip


def model_rows() -> Iterator[PaperRow]:
    """Yield the sampled feed drive beside the printed polynomials (21)."""
    machine = el_khalick_feed_drive()
    numerator, denominator = (np.asarray(p) for p in held_polynomials(machine.nominal, SAMPLE_TIME))
    entries = [
        ("A, q^-1", "1", denominator[:, 1], PRINTED["denominator"][1], 0.005),
        ("A, q^-2", "1", denominator[:, 2], PRINTED["denominator"][2], 0.005),
        ("B, first", "m/V", numerator[:, 0], PRINTED["numerator"][0], 0.5e-8),
        ("B, second", "m/V", numerator[:, 1], PRINTED["numerator"][1], 0.5e-8),
    ]
    for name, unit, values, printed, half in entries:
        for axis, value in zip(machine.names, values, strict=True):
            good = abs(value - printed) <= half
            note = (
                "Table 1 with a zero-order hold of 5 ms, in m and V (the references are in mm); "
                "matched is equal to the printed digits"
            )
            if not good:
                note += (
                    f"; it should round to {value:.2g}: with the printed one the velocity per volt "
                    "is 3.9 % too large. (21) also prints B with a leading q^-1, which with the "
                    "u(k-1) of (6) is one sample of delay too many"
                )
            yield _row("feed drive (Table 1, equation 21)", f"axis {axis}", "", name, unit,
                       float(value), "matched" if good else "differs", note, printed)  # fmt: skip


def study_rows(found: Found) -> Iterator[PaperRow]:
    """Yield Figures 4 to 7: both studies of weights, both trajectories, both readings.

    Parameters
    ----------
    found
        Figures of every case.
    """
    for contour, figures in FIGURES.items():
        for model in MODELS:
            experiment = f"{contour} (Figures {' and '.join(figures)}), {model}"
            base = Case(contour, model)
            yield from _errors(experiment, f"(a) {EQUAL}: law (9)", AXIS,
                               found[base._replace(axis=True)], "relation",
                               f"{NO_NUMBER}; what the claims are measured against")  # fmt: skip
            ratio = found[base][0] / found[base._replace(axis=True)][0]
            yield _row(
                experiment, f"(a) {EQUAL}: law (10)", LAW, "rms, of that of (9)", "1",
                ratio, "relation" if abs(ratio - 1.0) < SAME else "differs",
                "relation: with equal weights in both directions (10) is (9) on every axis; the "
                f"paper does not say so; within {SAME:g}",
            )  # fmt: skip
            for weights in list(WEIGHTS)[1:]:
                figure = figures[STUDIES[weights]]
                yield from _claim(experiment, f"Figure {figure} (b): {weights}",
                                  found[base._replace(weights=weights)], found[base], "",
                                  weights)  # fmt: skip
    one, other = found[Case(change="rho_n / 10")][0], found[Case(weights=CONTOUR)][0]
    yield _row(
        f"circle (Figures 4 and 6), {PLAIN}", "(a) with rho_n / 10", LAW,
        "rms, of rho_cn = 10", "1", one / other,
        "relation" if abs(one / other - 1.0) < 0.01 else "differs",
        "relation: both claims are one, only rho_n / rho_cn matters across the path: rho_n / 10 "
        "does what rho_cn = 10 does, within 1 %",
    )  # fmt: skip


def _errors(experiment: str, case: str, controller: str, values: tuple[float, float], verdict: str,
            note: str) -> Iterator[PaperRow]:  # fmt: skip
    for name, value in zip(("rms", "max"), values, strict=True):
        yield _row(
            experiment, case, controller, f"contour_error_{name}", "um", value, verdict, note
        )


def _claim(experiment: str, case: str, values: tuple[float, float], base: tuple[float, float],
           change: str, weights: str, what: str = "") -> Iterator[PaperRow]:  # fmt: skip
    fall = change_percent(base[0], values[0])
    holds = fall >= FALL and values[1] < base[1]
    note = f"{NO_NUMBER}; {FELL}" + (f"; {what}" if what else "")
    if not holds:
        note += f"; {_why(change, weights)}"
    verdict = "relation" if holds else "differs"
    yield from _errors(experiment, case, LAW, values, verdict, note)
    yield _row(experiment, case, LAW, "fall of the rms", "%", fall, verdict, note)


def bound_rows(found: Found) -> Iterator[PaperRow]:
    """Yield where the claims hold and where they turn round, and what the disturbance model does.

    Parameters
    ----------
    found
        Figures of every case.
    """
    for contour, model, change in BOUNDS:
        experiment = f"where the claims hold: {contour}, {change}, {model}"
        base = Case(contour, model, EQUAL, change)
        changed = f"assumed: {change}, otherwise as in the studies"
        yield from _errors(experiment, f"(a) {EQUAL}", LAW, found[base], "relation",
                           f"{changed}; what the claims are measured against")  # fmt: skip
        for weights in tried(change):
            yield from _claim(experiment, f"(b) {weights}",
                              found[base._replace(weights=weights)], found[base], change, weights,
                              changed)  # fmt: skip
    experiment = "circle: the disturbance model"
    rows: list[tuple[str, Case]] = [
        ("D = 1, Q = 1 - 1/q: no feedback", Case("circle", FREE, EQUAL, "D = 1")),
        ("D = 1 - 1/q, Q = 1 - 1/q", Case("circle", FREE, EQUAL, "D = 1 - 1/q")),
        (PLAIN, Case("circle", PLAIN)),
        (FREE, Case("circle", FREE)),
    ]
    errors = [found[case][0] for _, case in rows]
    falls = all(after < before for before, after in itertools.pairwise(errors))
    verdict = "relation" if falls else "differs"
    note = f"{NO_NUMBER}; {DECIDES}; relation: rms falls from row to row"
    for name, case in rows:
        yield from _errors(experiment, name, LAW, found[case], verdict, note)
    yield from _form_rows(found)


def _form_rows(found: Found) -> Iterator[PaperRow]:
    experiment = "circle: what is printed"
    ratio = found[Case("circle", FREE, EQUAL, "printed form")][0] / found[Case("circle", FREE)][0]
    yield _row(
        experiment, f"independent model, as printed; {FREE}", LAW, "rms, of the realigned form",
        "1", ratio, "relation" if abs(ratio - 1.0) < SAME else "differs",
        f"relation: the two forms are one law, within {SAME:g}; in the printed one the model's own "
        "output runs away from the machine's",
    )  # fmt: skip
    literal = found[Case("circle", PLAIN, LOWERED, "(6) and (21) as printed")]
    base = found[Case("circle", PLAIN, LOWERED)]
    worse = literal[0] > 10.0 * base[0]
    yield from _errors(
        experiment, f"(6) and (21) literally; {PLAIN}; {LOWERED}", LAW, literal,
        "relation" if worse else "differs",
        "the surplus sample of delay in the law's model; relation: more than ten times the rms "
        f"that the right delay leaves ({base[0]:.3g} um): with so light an input weight the loop "
        "swings",
    )  # fmt: skip


def robust_rows(found: Found) -> Iterator[PaperRow]:
    """Yield workpiece, cutting force and friction, on the figure of eight.

    Parameters
    ----------
    found
        Figures of every case.
    """
    experiment = f"figure of eight: workpiece, cutting force, friction; {FREE}"
    yield from _beside(
        found,
        experiment,
        {key: ("figure of eight", FREE, key, what) for key, what in ROBUST.items()},
    )


def space_rows(found: Found) -> Iterator[PaperRow]:
    """Yield three axes, which the paper leaves for later.

    Parameters
    ----------
    found
        Figures of every case.
    """
    what = "the paper leaves three axes for later; W = rho_n I + (rho_t - rho_n) t t'"
    chosen = {contour: (contour, PLAIN, "", what) for contour in ("helix", "Lissajous curve")}
    yield from _beside(found, f"three axes, {PLAIN}", chosen)


def _beside(
    found: Found, experiment: str, chosen: Mapping[str, tuple[str, str, str, str]]
) -> Iterator[PaperRow]:
    for name, (contour, model, change, what) in chosen.items():
        key = "" if change == "as above" else change
        base = found[Case(contour, model, EQUAL, key, axis=True)]
        yield from _errors(experiment, f"{name}: law (9)", AXIS, base, "relation",
                       f"assumed: {what}; what the claims are measured against")  # fmt: skip
        for weights in (CONTOUR, LOWERED):
            values = found[Case(contour, model, weights, key)]
            yield from _claim(experiment, f"{name}: {weights}", values, base, key, weights,
                              f"assumed: {what}; (a) is law (9)")  # fmt: skip
