"""Predictive contouring: from figures of closed loops to rows with a verdict and the reason.

The paper prints no error; its figures have no readable scale here and rest on settings that it does
not state. What can be judged is its claims (:mod:`~contourlab.papers.predictive_claims`): a row is
``relation`` if the claim that it belongs to holds, ``differs`` with the reason if not. What claims
are measured against is ``relation`` if both studies of weights improve on it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from contourlab.controllers.held_model import held_polynomials
from contourlab.machines.published.el_khalick import PRINTED, el_khalick_feed_drive
from contourlab.papers.paper import change_percent
from contourlab.papers.predictive_claims import FALL, Found, base_of, holds, why
from contourlab.papers.predictive_runs import (
    BOUNDS,
    CONTOUR,
    EQUAL,
    FREE,
    LOWERED,
    MODELS,
    PLAIN,
    RAISED,
    ROBUST,
    SAMPLE_TIME,
    WEIGHTS,
    Case,
    Errors,
    tried,
)
from contourlab.reports.reproduction import PaperRow

__all__ = ["bound_rows", "model_rows", "robust_rows", "space_rows", "study_rows"]

AXIS, LAW = "axis_predictive", "predictive_contouring"
STUDIES = {CONTOUR: 0, LOWERED: 1, RAISED: 1}
FIGURES = {"circle": ("4", "6"), "figure of eight": ("5", "7")}
SAME = 1e-4
"""Relative difference up to which two laws count as one: rounding, amplified by a loop."""
NO_NUMBER = "the paper prints no number and no horizon, weight of inputs or disturbance model"
FELL = f"relation: rms at least {FALL:g} % below that of (a), the largest error below it too"
IMPROVED = f"relation: both studies of weights improve on it, the rms by {FALL:g} % at least"
DECIDES = (
    "assumed disturbance models beside each other, Q = 1 - 1/q: which disturbances the law expects "
    "decides more than the weights that the paper studies"
)


def _row(experiment: str, case: str, controller: str, quantity: str, unit: str, reproduced: float,
         holds_good: bool, note: str) -> PaperRow:  # fmt: skip
    return PaperRow(
        experiment=experiment, case=case, controller=controller, quantity=quantity, unit=unit,
        published=None, reproduced=reproduced, verdict="relation" if holds_good else "differs",
        note=note,
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
        for axis, machine_name in enumerate(machine.names):
            value = float(values[axis])
            good = abs(value - printed) <= half
            note = (
                "Table 1 with a zero-order hold of 5 ms, in m and V (the references are in mm); "
                "matched is equal to the printed digits"
            )
            if not good:
                note += f"; {_slip(name, value, numerator[axis], denominator[axis])}"
            yield PaperRow(
                experiment="feed drive (Table 1, equation 21)", case=f"axis {machine_name}",
                controller="", quantity=name, unit=unit, published=printed, reproduced=value,
                verdict="matched" if good else "differs", note=note,
            )  # fmt: skip


def _slip(name: str, value: float, numerator: np.ndarray, denominator: np.ndarray) -> str:
    """Say what a misprinted second coefficient of B does to the velocity per volt."""
    if name != "B, second":
        return "not explained"
    first, second = PRINTED["numerator"]
    lag = PRINTED["denominator"][2]  # A = (1 - 1/q) (1 - lag/q)
    exact = numerator.sum() / (1.0 - denominator[2])
    rounded = float(f"{value:.2g}")
    whole, rest = (
        -change_percent(exact, (first + b) / (1.0 - lag)) for b in (second, rounded)
    )  # fmt: skip
    return (
        f"it should round to {value:.2g}: the velocity per volt of (21) is {whole:.1f} % too "
        f"large; with that it is {rest:.1f} %, by the rounding of the other digits. (21) also "
        "prints B with a leading q^-1, which with the u(k-1) of (6) is one sample of delay too many"
    )


def study_rows(found: Found) -> Iterator[PaperRow]:
    """Yield Figures 4 to 7: both studies of weights, both trajectories, both readings.

    Parameters
    ----------
    found
        Errors of every case.
    """
    for contour, figures in FIGURES.items():
        for model in MODELS:
            experiment = f"{contour} (Figures {' and '.join(figures)}), {model}"
            base = Case(contour, model)
            axis = found[base._replace(axis=True)]
            yield from _base(experiment, f"law (9): {EQUAL}", AXIS, axis,
                             base, found, NO_NUMBER)  # fmt: skip
            case = f"Figures {' (a), '.join(figures)} (a): {EQUAL}"
            yield from _base(experiment, case, LAW, found[base], base, found, NO_NUMBER)
            ratio = found[base].rms / axis.rms
            yield _row(
                experiment, case, LAW, "rms, of that of (9)", "1", ratio, abs(ratio - 1.0) < SAME,
                "relation: with equal weights in both directions (10) is (9) on every axis; the "
                f"paper does not say so; within {SAME:g}",
            )  # fmt: skip
            for weights in list(WEIGHTS)[1:]:
                figure = figures[STUDIES[weights]]
                yield from _claim(experiment, f"Figure {figure} (b): {weights}",
                                  base._replace(weights=weights), found)  # fmt: skip
    one, other = found[Case(change="rho_n / 10")].rms, found[Case(weights=CONTOUR)].rms
    yield _row(
        f"circle (Figures 4 and 6), {PLAIN}", "(a) with rho_n / 10", LAW,
        "rms, of rho_cn = 10", "1", one / other, abs(one / other - 1.0) < 0.01,
        "relation: both claims are one, only rho_n / rho_cn matters across the path: rho_n / 10 "
        "does what rho_cn = 10 does, within 1 %",
    )  # fmt: skip


def _errors(experiment: str, case: str, controller: str, values: Errors, good: bool,
            note: str) -> Iterator[PaperRow]:  # fmt: skip
    for name, value in zip(("rms", "max"), values, strict=True):
        yield _row(experiment, case, controller, f"contour_error_{name}", "um", value, good, note)


def _base(experiment: str, case: str, controller: str, values: Errors, equal: Case,
          found: Found, what: str) -> Iterator[PaperRow]:  # fmt: skip
    """Yield what claims are measured against."""
    failing = [
        weights
        for weights in (CONTOUR, LOWERED)
        if not holds(values, found[equal._replace(weights=weights, axis=False)])
    ]
    note = f"{what}; {IMPROVED}"
    if failing:
        note += f"; not by {' nor '.join(failing)}, for the reason given there"
    yield from _errors(experiment, case, controller, values, not failing, note)


def _claim(experiment: str, label: str, case: Case, found: Found,
           what: str = "") -> Iterator[PaperRow]:  # fmt: skip
    base, values = base_of(found, case), found[case]
    good = holds(base, values)
    note = f"{NO_NUMBER}; {FELL}" + (f"; {what}" if what else "")
    if not good:
        note += f"; {why(found, case)}"
    yield from _errors(experiment, label, LAW, values, good, note)
    fall = change_percent(base.rms, values.rms)
    yield _row(experiment, label, LAW, "fall of the rms", "%", fall, good, note)


def bound_rows(found: Found) -> Iterator[PaperRow]:
    """Yield where the claims hold and where they turn round, and what the disturbance model does.

    Parameters
    ----------
    found
        Errors of every case.
    """
    for contour, model, change in BOUNDS:
        experiment = f"where the claims hold: {contour}, {change}, {model}"
        base = Case(contour, model, EQUAL, change)
        changed = f"assumed: {change}, otherwise as in the studies"
        yield from _base(experiment, f"(a) {EQUAL}", LAW, found[base], base, found, changed)
        for weights in tried(change):
            yield from _claim(experiment, f"(b) {weights}", base._replace(weights=weights), found,
                              changed)  # fmt: skip
    yield from _disturbance_rows(found)
    yield from _form_rows(found)


def _disturbance_rows(found: Found) -> Iterator[PaperRow]:
    """Yield disturbance models with one input filter, then input filters with one model."""
    filtered = Case("circle", PLAIN, EQUAL, "Q = 1 - 1/q")
    models = {
        "D = 1: no feedback": Case("circle", FREE, EQUAL, "D = 1"),
        "D = 1 - 1/q": Case("circle", FREE, EQUAL, "D = 1 - 1/q"),
        "D = A": filtered,
        "D = (1 - 1/q) A": Case("circle", FREE),
    }
    before = math.inf
    for name, case in models.items():
        after = found[case]
        yield from _errors(
            "circle: the disturbance model", name, LAW, after, after.rms < before,
            f"{NO_NUMBER}; {DECIDES}; relation: a smaller rms than in the row before",
        )  # fmt: skip
        before = after.rms
    by_model = found[filtered].rms / found[Case("circle", FREE)].rms
    filters = {
        "D = A": (filtered, Case("circle", PLAIN)),
        "D = (1 - 1/q) A": (Case("circle", FREE), Case("circle", FREE, EQUAL, "Q = 1")),
    }
    for name, (changes, values) in filters.items():
        ratio = found[changes].rms / found[values].rms
        yield _row(
            "circle: the input filter", f"{name}: Q = 1 - 1/q", LAW, "rms, of that with Q = 1",
            "1", ratio, abs(math.log(ratio)) < abs(math.log(by_model)),
            f"{NO_NUMBER}; relation: the input filter matters less than the disturbance model, "
            f"whose two readings differ by a factor of {by_model:.3g} at the same filter",
        )  # fmt: skip


def _form_rows(found: Found) -> Iterator[PaperRow]:
    experiment = "circle: what is printed"
    ratio = found[Case("circle", FREE, EQUAL, "printed form")].rms / found[Case("circle", FREE)].rms
    yield _row(
        experiment, f"independent model, as printed; {FREE}", LAW, "rms, of the realigned form",
        "1", ratio, abs(ratio - 1.0) < SAME,
        f"relation: the two forms are one law, within {SAME:g}; in the printed one the model's own "
        "output runs away from the machine's",
    )  # fmt: skip
    literal = found[Case("circle", PLAIN, LOWERED, "(6) and (21) as printed")]
    base = found[Case("circle", PLAIN, LOWERED)]
    yield from _errors(
        experiment, f"(6) and (21) literally; {PLAIN}; {LOWERED}", LAW, literal,
        literal.rms > 10.0 * base.rms,
        "the surplus sample of delay in the law's model; relation: more than ten times the rms "
        f"that the right delay leaves ({base.rms:.3g} um): with so light an input weight the loop "
        "swings",
    )  # fmt: skip


def robust_rows(found: Found) -> Iterator[PaperRow]:
    """Yield workpiece, cutting force and friction, on the figure of eight.

    Parameters
    ----------
    found
        Errors of every case.
    """
    yield from _beside(
        found,
        f"figure of eight: workpiece, cutting force, friction; {FREE}",
        {key: ("figure of eight", FREE, key, what) for key, what in ROBUST.items()},
    )


def space_rows(found: Found) -> Iterator[PaperRow]:
    """Yield three axes, which the paper leaves for later.

    Parameters
    ----------
    found
        Errors of every case.
    """
    what = "the paper leaves three axes for later; W = rho_n I + (rho_t - rho_n) t t'"
    chosen = {contour: (contour, PLAIN, "", what) for contour in ("helix", "Lissajous curve")}
    yield from _beside(found, f"three axes, {PLAIN}", chosen)


def _beside(
    found: Found, experiment: str, chosen: Mapping[str, tuple[str, str, str, str]]
) -> Iterator[PaperRow]:
    for name, (contour, model, change, what) in chosen.items():
        equal = Case(contour, model, EQUAL, "" if change == "as above" else change, axis=True)
        yield from _base(experiment, f"{name}: law (9)", AXIS, found[equal], equal, found,
                         f"assumed: {what}")  # fmt: skip
        for weights in (CONTOUR, LOWERED):
            yield from _claim(
                experiment, f"{name}: {weights}", equal._replace(weights=weights, axis=False),
                found, f"assumed: {what}; (a) is law (9)",
            )  # fmt: skip
