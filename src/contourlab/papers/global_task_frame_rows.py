"""The published figures of the global task frame, and what becomes of each.

A figure is ``matched`` within 5 %. On the plausible machine it is a ``relation`` if its ratio to
that of C2 in Set 1 is the published one within 15 %: the level of the error is the machine's, which
the paper does not describe. Everything else ``differs``, with the reason.

References
----------
.. [HuYaoWang] Tables I and II, Figures 7 and 8.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from contourlab.papers.global_task_frame_runs import (
    DECAY,
    EXPERIMENTS,
    GAIN,
    INITIAL,
    SAMPLE_TIME,
    STEP,
    Run,
)
from contourlab.papers.paper import MATCH, change_percent, close
from contourlab.reports.reproduction import PaperRow

__all__ = ["TABLES", "Runs", "claim_rows", "estimate_rows", "rate_bias", "step_peak", "table_rows"]

Key: TypeAlias = tuple[str, str, int, str, str]
"""Experiment, machine, set, law, rate."""
Runs: TypeAlias = Mapping[Key, Run]
Published: TypeAlias = Mapping[tuple[str, int], tuple[float, float, float, float]]

TABLES: dict[str, Published] = {
    "I": {
        ("C1", 1): (2.42, 8.57, 0.42, 0.70), ("C2", 1): (2.42, 8.15, 0.42, 0.68),
        ("C3", 1): (3.30, 10.14, 0.41, 0.70), ("C1", 2): (2.50, 9.52, 0.54, 0.78),
        ("C2", 2): (2.44, 8.38, 0.54, 0.78), ("C3", 2): (3.38, 10.21, 0.54, 0.78),
        ("C1", 3): (2.73, 37.48, 0.42, 0.75), ("C2", 3): (2.73, 36.52, 0.42, 0.74),
        ("C3", 3): (3.54, 36.54, 0.42, 0.75),
    },
    "II": {
        ("C1", 1): (2.57, 8.72, 0.33, 0.62), ("C2", 1): (2.60, 9.64, 0.33, 0.61),
        ("C3", 1): (4.15, 13.98, 0.32, 0.61), ("C1", 2): (2.74, 9.93, 0.38, 0.66),
        ("C2", 2): (2.74, 9.74, 0.38, 0.67), ("C3", 2): (4.19, 15.72, 0.38, 0.68),
        ("C1", 3): (2.91, 36.10, 0.33, 0.68), ("C2", 3): (2.93, 35.30, 0.33, 0.67),
        ("C3", 3): (4.40, 38.51, 0.32, 0.68),
    },
}  # fmt: skip
"""Tables I and II: rms and largest contour error [um], rms of both commands [V]."""
COLUMNS = (
    ("contour_error_rms", "um"), ("contour_error_max", "um"), ("command_rms_x", "V"),
    ("command_rms_y", "V"),
)  # fmt: skip
CLASSES = {
    "C1": "direct_adaptive_robust", "C2": "integrated_adaptive_robust",
    "C3": "integrated_adaptive_robust (local frame)",
}  # fmt: skip
SAME_RATIO = 0.15
DISTINCT = 1e-4
"""Share of the largest eigenvalue of (26) from which the least counts as excitation."""
TRUE = {
    1: np.array([[0.12, 0.55], [0.35, 0.5], [0.1, 0.13]]),
    2: np.array([[0.19, 0.62], [0.35, 0.5], [0.1, 0.13]]),
}
"""Mass, viscous and Coulomb friction off line, by set; section IV."""
UNITS = {"mass": "V/(m/s^2)", "viscous": "V/(m/s)", "coulomb": "V", "disturbance": "V"}
PLAUSIBLE = "plausible"
DIFFERENCE, ROTATED = "coordinates", "velocity"


def columns(run: Run) -> tuple[float, float, float, float]:
    """Return a run's figures in the units of the tables.

    Parameters
    ----------
    run
        Of one experiment.
    """
    return 1e6 * run.rms, 1e6 * run.largest, *run.command_rms


def rate_bias(name: str) -> tuple[float, float]:
    """Return mean and rms over a turn of -T κ v² / (2 Λ) = -T a b ω³ / (2 Λ v) [m].

    Parameters
    ----------
    name
        ``"I"`` or ``"II"``.
    """
    (a, b), omega = EXPERIMENTS[name].semi_axes, EXPERIMENTS[name].omega
    phase = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    speed = omega * np.hypot(a * np.cos(phase), b * np.sin(phase))
    bias = -SAMPLE_TIME * a * b * omega**3 / (2.0 * DECAY[1] * speed)
    return float(np.mean(bias)), float(np.sqrt(np.mean(bias**2)))


def step_peak(mass: float) -> float:
    """Return the peak of the normal error after a step of 0.6 V, by linear theory [m].

    e / d = p / ((M p² + K p + γ) (p + Λ)), with K and Λ of the normal direction and γ = K Λ.

    Parameters
    ----------
    mass
        M [V/(m/s²)].
    """
    from scipy.signal import impulse

    gain, decay = GAIN[1], DECAY[1]
    system = ([1.0], np.polymul([mass, gain, gain * decay], [1.0, decay]))
    _, response = impulse(system, T=np.linspace(0.0, 0.2, 20001))
    return float(STEP * np.max(np.abs(response)))


def table_rows(name: str, kind: str, runs: Runs) -> Iterable[PaperRow]:
    """Return the rows of one table on one machine.

    Parameters
    ----------
    name
        Experiment.
    kind
        Machine.
    runs
        All that were run.
    """
    table = TABLES[name]
    reference = columns(runs[name, kind, 1, "C2", DIFFERENCE])
    for (law, test), published in table.items():
        for rate in (DIFFERENCE, ROTATED) if law == "C3" else (DIFFERENCE,):
            found = columns(runs[name, kind, test, law, rate])
            for k, (quantity, unit) in enumerate(COLUMNS):
                if rate == ROTATED and k > 1:
                    continue
                wanted, now = table["C2", 1][k], reference[k]
                verdict = _verdict(kind, found[k], published[k], found[k] / now,
                                   published[k] / wanted)  # fmt: skip
                note = _note(name, kind, law, test, rate, k, verdict, found[k] / now,
                             published[k] / wanted)  # fmt: skip
                case = f"Set {test}" + (", rate from velocity" if rate == ROTATED else "")
                yield _row(name, kind, case, CLASSES[law], quantity, unit, published[k], found[k],
                           verdict, note)  # fmt: skip


def _verdict(kind: str, value: float, published: float, ratio: float, said: float) -> str:
    if close(value, published):
        return "matched"
    if kind == PLAUSIBLE and abs(ratio / said - 1.0) <= SAME_RATIO:
        return "relation"
    return "differs"


def _note(name: str, kind: str, law: str, test: int, rate: str, k: int, verdict: str,
          ratio: float, said: float) -> str:  # fmt: skip
    note = f"hardware figure against {_machine(kind)}; matched is within {100 * MATCH:g} %"
    if kind == PLAUSIBLE:
        note += (
            f", relation within {100 * SAME_RATIO:g} % of the published ratio to C2 in Set 1 "
            f"({said:.2f} in print, {ratio:.2f} here)"
        )
    if rate == ROTATED:
        mean, rms = rate_bias(name)
        note += (
            "; its rate is a differenced velocity turned into the frame, which leaves "
            f"-T kappa v^2 / (2 Lambda) = {1e6 * mean:.2f} um on average ({1e6 * rms:.2f} rms)"
        )
    elif law == "C3" and k < 2:
        note += (
            "; with the same rate the local frame is not told from the global one: kappa e_m^2 / 2 "
            "is nanometres where e_m is micrometres"
        )
    if verdict != "differs":
        return note
    return f"{note}; {_reason(name, kind, law, test, rate, k)}"


def _reason(name: str, kind: str, law: str, test: int, rate: str, k: int) -> str:
    """Say why a figure differs."""
    if k > 1:
        return (
            "the identified friction and masses do not need the printed command on this ellipse, "
            "whatever the law"
        )
    if test == 3 and k == 1:
        peak = 1e6 * step_peak(0.55)
        return (
            f"linear theory of the printed gains gives {peak:.1f} um for the whole step across the "
            "contour, so the printed peak takes a lower gain or a larger step"
        )
    if rate == ROTATED and name == "II":
        return "the bias explains what C3 is above C2 in experiment I, and half of it in II"
    if kind != PLAUSIBLE:
        return (
            "encoders and the identified friction alone leave a small share of the printed error: "
            "what made the rest on the gantry (cogging, presliding, delay) is not in this machine"
        )
    if law == "C3":
        return "the printed excess of C3 is not due to the frame"
    return "the largest error is that of a few reversals, where the assumed friction counts"


def _machine(kind: str) -> str:
    if kind == PLAUSIBLE:
        return (
            "an emulation (cogging, presliding, delay: assumed; amplitude and pitch of the cogging "
            "are round numbers near those that an earlier simulation was fitted with to the rms of "
            "Set 1, so that the level in Set 1 is no prediction; another pitch moves the rms "
            "between about 1.4 and 2.8 um)"
        )
    return "a simulation with encoders and identified friction only"


def _row(
    name: str, kind: str, case: str, controller: str, quantity: str, unit: str,
    published: float | None, reproduced: float, verdict: str, note: str,
) -> PaperRow:  # fmt: skip
    return PaperRow(
        experiment=f"experiment {name}, {kind}", case=case, controller=controller,
        quantity=quantity, unit=unit, published=published, reproduced=float(reproduced),
        verdict=verdict, note=note,
    )  # fmt: skip


def claim_rows(name: str, kind: str, runs: Runs) -> Iterable[PaperRow]:
    """Return the rows of what the text claims of a table.

    Parameters
    ----------
    name
        Experiment.
    kind
        Machine.
    runs
        All that were run.
    """
    table = TABLES[name]

    def at(law: str, test: int = 1, rate: str = DIFFERENCE) -> Any:
        return columns(runs[name, kind, test, law, rate])

    def say(case: str, law: str, quantity: str, unit: str, published: float | None, value: float,
            holds: bool, note: str) -> PaperRow:  # fmt: skip
        verdict = "relation" if holds else "differs"
        note = f"{note}; {_machine(kind)}"
        return _row(name, kind, case, law, quantity, unit, published, value, verdict, note)

    def spread(values: Any) -> float:
        return 100.0 * float((np.max(values) - np.min(values)) / np.mean(values))

    change = -change_percent(at("C2")[0], at("C2", 2)[0])
    said = -change_percent(table["C2", 1][0], table["C2", 2][0])
    yield say("Set 1 to Set 2", CLASSES["C2"], "change of rms by the payload", "%", said, change,
              abs(change) < 10.0, "'almost the same'; relation: less than 10 %")  # fmt: skip
    laws = ("C1", "C2", "C3")
    for k, axis in ((2, "x"), (3, "y")):
        values = [[at(law, test)[k] for law in laws] for test in (1, 2, 3)]
        printed = [[table[law, test][k] for law in laws] for test in (1, 2, 3)]
        worst, most = max(map(spread, values)), max(map(spread, printed))
        yield say("all sets", "", f"spread of command_rms_{axis} over the laws", "%", most, worst,
                  worst < 5.0, "'almost the same amount of control efforts'; relation: less than "
                  "5 %")  # fmt: skip
    peaks = [at(law, 3)[1] for law in laws]
    yield say("Set 3", "", "spread of the peak over the laws", "%",
              spread([table[law, 3][1] for law in laws]), spread(peaks), spread(peaks) < 10.0,
              "the largest error over the step is that of the loop, not of the law; relation: less "
              "than 10 %")  # fmt: skip
    ratio = at("C1")[0] / at("C2")[0]
    yield say("Set 1", "", "rms of C1 over C2", "", table["C1", 1][0] / table["C2", 1][0], ratio,
              abs(ratio - 1.0) < 0.05,
              "equal in print; relation: within 5 %; where nothing but the law's own error is "
              "left, the wrong parameters of C1 show")  # fmt: skip
    frame_note = "'the superiority of the global TCF'; relation: above 1.05"
    for case, ours, mixed in (
        ("Set 1, same rate", at("C3")[0] / at("C2")[0], False),
        ("Set 1, same rate (velocity)", at("C3", 1, ROTATED)[0] / at("C2", 1, ROTATED)[0], False),
        ("Set 1, C3 rate from velocity, C2 of coordinates", at("C3", 1, ROTATED)[0] / at("C2")[0],
         True),
    ):  # fmt: skip
        why = frame_note
        if ours < 1.05:
            why += (
                "; the frames cannot be told apart at tracking errors of micrometres, and the "
                "error that the local frame makes, kappa e_m^2 / 2, is outwards, not the negative "
                "offset of Figure 4"
            )
        elif mixed:
            why += "; printed ordering; not evidence for the frame: it is the rate that makes it"
        yield say(case, "", "rms of C3 over C2", "", table["C3", 1][0] / table["C2", 1][0], ours,
                  ours > 1.05, why)  # fmt: skip
    gap = float(np.sqrt(max(at("C3", 1, ROTATED)[0] ** 2 - at("C2")[0] ** 2, 0.0)))
    wanted = float(np.sqrt(table["C3", 1][0] ** 2 - table["C2", 1][0] ** 2))
    bias = 1e6 * rate_bias(name)[1]
    yield say("Set 1, C3 rate from velocity", CLASSES["C3"], "root of rms² of C3 - rms² of C2",
              "um", wanted, gap, close(bias, wanted, 0.1),
              f"the bias of the rate predicts {bias:.2f} um; relation: the printed gap within 10 % "
              "of it")  # fmt: skip
    mean = 1e6 * runs[name, kind, 1, "C3", ROTATED].mean
    expected = 1e6 * rate_bias(name)[0]
    yield say("Set 1, C3 rate from velocity", CLASSES["C3"], "mean contour error", "um", None, mean,
              close(mean, expected, 0.05),
              f"'a constant negative offset'; the bias of the rate predicts {expected:.2f} um; "
              "relation: within 5 % of it")  # fmt: skip
    run = runs[name, kind, 1, "C2", DIFFERENCE]
    if run.excitation is not None:
        for number, label in enumerate("xy"):
            value, largest = (float(v) for v in run.excitation[:, number])
            yield say("Set 1", CLASSES["C2"], f"excitation over a turn, {label}", "V^2 s", None,
                      value, value > DISTINCT * largest,
                      "least eigenvalue of (26) over one turn, each parameter in units of its "
                      f"range; relation: above {DISTINCT:g} of the largest ({largest:.3g}), which "
                      "tells all parameters apart")  # fmt: skip


def estimate_rows(name: str, kind: str, test: int, runs: Runs) -> Iterable[PaperRow]:
    """Return the rows of the parameter estimates: X in Set 1 (Figure 7), Y in Set 2 (Figure 8).

    Parameters
    ----------
    name
        Experiment.
    kind
        Machine.
    test
        1 or 2.
    runs
        All that were run.
    """
    axis = test - 1
    figure = {1: "Figure 7", 2: "Figure 8"}[test]
    label = "xy"[axis]
    for law in ("C2", "C3"):
        run = runs[name, kind, test, law, DIFFERENCE]
        for row, parameter in enumerate(("mass", "viscous", "coulomb")):
            truth = float(TRUE[test][row, axis])
            value = float(run.estimates[parameter][-1, axis])
            begun = float(INITIAL[row, axis])
            near = abs(value - truth) <= 0.5 * abs(begun - truth)
            verdict = "matched" if close(value, truth) else "relation" if near else "differs"
            note = (
                f"{figure}: 'consistently approach the off-line values' (published is that value); "
                f"after {run.time[-1]:.0f} s, from {begun:g}; matched is within {100 * MATCH:g} %, "
                f"relation: half of the start's error; {_machine(kind)}"
            )
            if close(begun, truth):
                note += "; it begins there: no evidence of convergence"
            if parameter == "mass":
                note += "; encoder counts and cogging bias the mass (errors in variables)"
            yield _row(name, kind, f"Set {test}, {figure}", CLASSES[law], f"{parameter}_{label}",
                       UNITS[parameter], truth, value, verdict, note)  # fmt: skip
    errors = {law: _distance(runs[name, kind, test, law, DIFFERENCE], test) for law in ("C1", "C2")}
    value = errors["C1"] / errors["C2"]
    yield _row(name, kind, f"Set {test}", CLASSES["C1"], "parameter error of C1 over C2", "", None,
               value, "relation" if value > 1.5 else "differs",
               "'cannot be achieved by C1': rms over both axes of the relative errors of mass, "
               "viscous and Coulomb friction at the end; relation: above 1.5; "
               f"{_machine(kind)}")  # fmt: skip


def _distance(run: Run, test: int) -> float:
    found = np.stack([run.estimates[n][-1] for n in ("mass", "viscous", "coulomb")])
    return float(np.sqrt(np.mean((found / TRUE[test] - 1.0) ** 2)))
