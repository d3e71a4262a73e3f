"""Predictive contouring: the experiments of the paper, and what they are run with.

The paper prints trajectories, sample time and the two studies of weights, and no horizon, no weight
of the inputs, no disturbance model, no friction, no limit. What stands here for them is in
:data:`ASSUMED`, and is the same in every run that does not say otherwise.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from contourlab.contours import Circle, FigureEight, Helix, Lissajous
from contourlab.contours.base import Contour
from contourlab.controllers import AxisPredictive, Controller, PredictiveContouring
from contourlab.feedrate import constant_rate
from contourlab.machines import Disturbance, Machine, SineDisturbance, StepDisturbance
from contourlab.machines.published.el_khalick import PRINTED, el_khalick_feed_drive
from contourlab.recordings import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation import simulate

__all__ = [
    "ASSUMED",
    "CONTOURS",
    "MODELS",
    "ROBUST",
    "WEIGHTS",
    "WINDOW",
    "Case",
    "Errors",
    "cases",
    "judged",
    "paper_law",
    "paper_reference",
    "run_case",
]

SAMPLE_TIME = 0.005
"""T [s]."""
SIZE = 0.005
"""Radius of (22), amplitudes of (23) [m]."""
RATE = np.pi / 10.0
"""Of (22) and (23) [rad/s]."""
WINDOW = (2.0, 20.0)
"""What is judged [s]: the start is left out, and the reference goes on beyond the end."""
START = 0.5
"""Time that the start takes at the most [s]."""
HORIZONS: dict[str, Any] = {"prediction_horizon": 20, "control_horizon": 5, "minimum_horizon": 1}
INPUT_WEIGHT = 1e-11
"""ρ_n = ρ_t of the unweighted case [m²/V²]; 1e-5 in mm²/V²."""
EXTRA_TIME = 0.3
"""By which references go on after the window [s], more than any horizon here."""

MODELS: dict[str, dict[str, Any]] = {
    "D = A, Q = 1": {"disturbance_integrators": 0, "input_filter_numerator": (1.0,)},
    "D = (1 - 1/q) A, Q = 1 - 1/q": {},
}
"""The two readings: nearest to the printed (17), and free of offset."""
PLAIN, FREE = MODELS

WEIGHTS: dict[str, dict[str, float]] = {
    "rho_cn = 1, rho_t = rho_n": {},
    "rho_cn = 10": {"contour_weight": 10.0},
    "rho_n lowered to rho_t / 1000": {"normal_input_weight": 1e-3 * INPUT_WEIGHT},
    "rho_t raised to 1000 rho_n": {"tangential_input_weight": 1e3 * INPUT_WEIGHT},
}
"""Figures 4 (a) to 7 (b); the last two are two readings of ρ_t = 10³ ρ_n."""
EQUAL, CONTOUR, LOWERED, RAISED = WEIGHTS

CONTOURS = {"circle": 2, "figure of eight": 2, "helix": 3, "Lissajous curve": 3}
"""Number of axes of each; the last two are ours."""

ROBUST: dict[str, str] = {
    "as above": "nothing is changed",
    "workpiece of 50 kg": "50 kg more on both tables, of which the law is not told",
    "cutting force": "200 N with 100 N at a tooth frequency of 30 Hz (four teeth, 450 rev/min) on "
    "both axes from 3 s",
    "cutting force at 10 Hz": "the same with a tooth frequency of 10 Hz (four teeth, 150 rev/min)",
    "three times the friction": "0.3 V of Coulomb friction",
}
"""Changes that the paper speaks of and prints no value of; assumed."""

ASSUMED = (
    "Horizons: H_m = 1, H_p = 20 (0.1 s), H_c = 5; P = C = 1, phi = 1 - 1/q; d = 0, since the "
    "printed (6) and (21) together hold one sample of delay too many.",
    "Weights: rho_ct = 1 and rho_n = rho_t = 1e-5 mm^2/V^2 where a study does not change them.",
    "Disturbance model and input filter: two readings, D = A with Q = 1 (nearest to the printed "
    "(17)) and D = (1 - 1/q) A with Q = 1 - 1/q (no offset). With D = 1 the law has no feedback.",
    "The law's model is the printed (21), the machine's is Table 1; angle of each sample ahead; "
    "laws do not compensate friction. zeta of (13) is not explained in the paper and left out.",
    "The machine starts at rest on the path while the reference moves; judged from 2 s to 20 s, "
    "with a reference that goes on. Error figures are exact distances.",
    *el_khalick_feed_drive(n_axes=3).assumed,
)
"""What no experiment changes unless its rows say so."""


class Errors(NamedTuple):
    """Contour error of a closed loop within the window."""

    rms: float
    """[um]."""
    largest: float
    """[um]."""


class Case(NamedTuple):
    """One closed loop."""

    contour: str = "circle"
    model: str = PLAIN
    weights: str = EQUAL
    change: str = ""
    """What differs from the assumed settings, by a name of :data:`CHANGES` or :data:`ROBUST`."""
    axis: bool = False
    """Whether it is the per-axis law (9)."""


CHANGES: dict[str, dict[str, Any]] = {
    "H_c = 1": {"control_horizon": 1},
    "H_c = 2": {"control_horizon": 2},
    "H_p = 10": {"prediction_horizon": 10},
    "H_p = 30": {"prediction_horizon": 30},
    "H_p = 30, H_c = 10": {"prediction_horizon": 30, "control_horizon": 10},
    "one angle for the horizon": {"angle": "single"},
    "D = 1": {
        "disturbance_plant": False, "disturbance_integrators": 0, "form": "independent",
    },
    "D = 1 - 1/q": {
        "disturbance_plant": False, "disturbance_integrators": 1, "form": "independent",
    },
    "Q = 1": {"input_filter_numerator": (1.0,)},
    "Q = 1 - 1/q": {"input_filter_numerator": (1.0, -1.0)},
    "printed form": {"form": "independent"},
    "(6) and (21) as printed": {"plant_numerator": (0.0, *PRINTED["numerator"])},
    "no friction": {},
    "no friction, H_c = 10": {"control_horizon": 10},
    "noise of 0.1 um": {},
    "ten times faster": {},
    "ten times faster, H_c = 10": {"control_horizon": 10},
    "rho_n / 10": {"normal_input_weight": 0.1 * INPUT_WEIGHT},
}  # fmt: skip
"""Fields of the law, where it is the law that changes."""


@functools.cache
def paper_reference(contour: str, speed: float = 1.0) -> Reference:
    """Return one of the trajectories, (22), (23), or one of ours in space.

    Parameters
    ----------
    contour
        A name of :data:`CONTOURS`.
    speed
        Multiple of the printed rate; the record becomes as much shorter.
    """
    turns = (WINDOW[1] / speed + EXTRA_TIME) * RATE * speed / (2.0 * np.pi)
    size, quarter = np.array(SIZE), np.array(0.5 * np.pi)
    curves: dict[str, Any] = {
        "circle": lambda: Circle(radius=size, clockwise=True, start_angle=quarter),
        "figure of eight": lambda: FigureEight(
            half_sizes=np.full(2, SIZE), rotation=2.0 * quarter, start_angle=-quarter
        ),
        "helix": lambda: Helix(radius=size, pitch=np.array(0.02), turns=np.array(turns + 0.01)),
        "Lissajous curve": lambda: Lissajous(
            amplitudes=size, frequencies=(1, 2, 1), phases=np.array((0.0, 0.0, 0.5 * np.pi))
        ),
    }
    curve: Contour = curves[contour]()
    return constant_rate(
        curve, rate=RATE * speed, duration=WINDOW[1] / speed + EXTRA_TIME,
        sample_time=SAMPLE_TIME,
    )  # fmt: skip


def paper_law(case: Case, machine: Machine) -> Controller:
    """Return the law of a case.

    Parameters
    ----------
    case
        Which.
    machine
        What it is told of.
    """
    fields: dict[str, Any] = {
        "model": machine.nominal, "friction_compensation": 0.0,
        "plant_numerator": PRINTED["numerator"], "plant_denominator": PRINTED["denominator"],
        **HORIZONS, **MODELS[case.model],
    }  # fmt: skip
    fields |= CHANGES.get(case.change, {})
    if case.axis:
        return AxisPredictive(input_weight=np.array(INPUT_WEIGHT), **fields)
    weights = {
        "contour_weight": 1.0, "lag_weight": 1.0, "normal_input_weight": INPUT_WEIGHT,
        "tangential_input_weight": INPUT_WEIGHT,
    }  # fmt: skip
    return PredictiveContouring(**(weights | WEIGHTS[case.weights] | fields))


def run_case(case: Case) -> Recording:
    """Run one closed loop.

    Parameters
    ----------
    case
        Which.
    """
    friction = {"three times the friction": 0.3}.get(case.change, 0.1)
    if case.change.startswith("no friction"):
        friction = 0.0
    machine = el_khalick_feed_drive(
        n_axes=CONTOURS[case.contour], coulomb_voltage=friction,
        workpiece_mass=50.0 if case.change == "workpiece of 50 kg" else 0.0,
        noise=1e-7 if case.change == "noise of 0.1 um" else 0.0,
    )  # fmt: skip
    forces: list[Disturbance] = []
    if case.change.startswith("cutting force"):
        tooth = 10.0 if case.change.endswith("10 Hz") else 30.0
        for axis in range(machine.n_axes):
            forces += [
                StepDisturbance(axis=axis, amplitude=-200.0, start=3.0),
                SineDisturbance(axis=axis, amplitude=-100.0, start=3.0, frequency_hz=tooth),
            ]
    reference = paper_reference(case.contour, _speed(case))
    return simulate(machine, paper_law(case, machine), reference, disturbances=forces)


def _speed(case: Case) -> float:
    return 10.0 if case.change.startswith("ten times faster") else 1.0


def judged(case: Case, recording: Recording) -> Errors:
    """Return the contour error within the window.

    Parameters
    ----------
    case
        Which.
    recording
        Of it.
    """
    start, end = max(WINDOW[0] / _speed(case), START), WINDOW[1] / _speed(case)
    metrics = recording.metrics_between(start, end)
    rms, largest = (float(np.asarray(metrics[f"contour_error_{name}"])) for name in ("rms", "max"))
    return Errors(1e6 * rms, 1e6 * largest)


ONE_ANGLE = "one angle for the horizon"
BOUNDS: tuple[tuple[str, str, str], ...] = (
    ("circle", PLAIN, "H_c = 1"), ("circle", PLAIN, "H_c = 2"), ("circle", PLAIN, "H_p = 10"),
    ("circle", FREE, "H_p = 30"), ("circle", FREE, "H_p = 30, H_c = 10"),
    ("circle", PLAIN, ONE_ANGLE), ("figure of eight", PLAIN, ONE_ANGLE),
    ("circle", FREE, "no friction"), ("circle", FREE, "no friction, H_c = 10"),
    ("circle", FREE, "noise of 0.1 um"), ("circle", FREE, "ten times faster"),
    ("circle", FREE, "ten times faster, H_c = 10"),
)  # fmt: skip
"""Contour, model and change at which both claims are tried again."""


def tried(change: str) -> tuple[str, ...]:
    """Return the weights that are tried at a change.

    Parameters
    ----------
    change
        Of :data:`BOUNDS`.
    """
    return (CONTOUR, LOWERED, RAISED) if change == ONE_ANGLE else (CONTOUR, LOWERED)


def cases() -> Iterator[Case]:
    """Yield every closed loop of the reproduction."""
    planar: Sequence[str] = ("circle", "figure of eight")
    for model in MODELS:
        for contour in planar:
            yield Case(contour, model, axis=True)
            yield from (Case(contour, model, weights) for weights in WEIGHTS)
    yield Case(change="rho_n / 10")
    for contour, model, change in BOUNDS:
        for weights in (EQUAL, *tried(change)):
            yield Case(contour, model, weights, change)
    for change in ("D = 1", "D = 1 - 1/q"):
        yield Case("circle", FREE, EQUAL, change)
    yield Case("circle", PLAIN, EQUAL, "Q = 1 - 1/q")
    yield Case("circle", FREE, EQUAL, "Q = 1")
    yield Case("circle", PLAIN, LOWERED, "(6) and (21) as printed")
    yield Case("circle", FREE, EQUAL, "printed form")
    for change in ROBUST:
        if change != "as above":
            yield Case("figure of eight", FREE, EQUAL, change, axis=True)
            yield from (Case("figure of eight", FREE, w, change) for w in (CONTOUR, LOWERED))
    for contour in ("helix", "Lissajous curve"):
        yield Case(contour, axis=True)
        yield from (Case(contour, weights=w) for w in (CONTOUR, LOWERED))
