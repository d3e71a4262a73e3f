"""Predictive contouring where its model is wrong, observed and not, with and without a reserve.

python benchmarks/predictive_robustness.py [--json]

The figure of eight of docs/mpcc.md, rest to rest under 20 V. In each case one thing is not as the
law believes. No times are measured: every figure is the same on every machine.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

import contourlab as cl
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes

T, SPEED = 5e-3, 0.06
EIGHT = cl.contours.FigureEight(half_sizes=(5e-3, 5e-3), rotation=np.pi, start_angle=-0.5 * np.pi)


def machine(*, limit=20.0, coulomb=0.1, encoder=None, delay=0.0):
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=44.8844, viscous=278.255,
            friction=Friction(coulomb=coulomb, smoothing_velocity=1e-6),
        ),
        drive=Drive(command="voltage", command_limit=limit, computing_delay=delay),
        sensor=encoder or Encoder(),
        substeps=20,
    )  # fmt: skip


def run(truth, *, mass=1.0, told=True, **settings):
    """One run: the model is the machine's own but for its mass and whether friction is told."""
    nominal = truth.nominal
    coulomb = np.asarray(nominal.coulomb) * float(told)
    model = cl.replace(nominal, mass=mass * np.asarray(nominal.mass), coulomb=coulomb)
    law = cl.controllers.ModelPredictiveContouring(model=model, speed_limit=SPEED, **settings)
    start = cl.feedrate.constant_feed(EIGHT, feed=SPEED, sample_time=T)
    found = cl.simulate(truth, law, start)
    return {
        "cycle_s": found.metrics["cycle_time"],
        "rms_um": 1e6 * found.metrics["contour_error_rms"],
        "max_um": 1e6 * found.metrics["contour_error_max"],
        "status": found.status,
        "unsolved": int(np.sum(np.asarray(found["status"]) == 3)),
    }


SETTINGS = {
    "as given": {},
    "no reserve": {"mass_uncertainty": 0.0},
    "contour_weight 1e10": {"contour_weight": 1e10},
    "horizon 30": {"horizon": 30},
    "10 V": {"limit": 10.0},
}
WRONG = {
    "exact": {},
    "mass believed 30 % more": {"mass": 1.3},
    "mass believed 30 % less": {"mass": 0.7},
    "the same, and that is stated": {"mass": 0.7, "mass_uncertainty": 0.43},
    "the same, at most 0.3 m/s² planned": {"mass": 0.7, "acceleration_limit": 0.3},
    "friction of 0.1 V not told": {"told": False},
    "friction of 1 V told": {"coulomb": 1.0},
    "friction of 1 V not told": {"coulomb": 1.0, "told": False},
    "the same, mass 30 % unsure": {"coulomb": 1.0, "told": False, "mass_uncertainty": 0.3},
    "encoder of 1 um, noise 0.5 um": {"encoder": Encoder(resolution=1e-6, noise=5e-7)},
    "the same, no reserve": {
        "encoder": Encoder(resolution=1e-6, noise=5e-7),
        "mass_uncertainty": 0.0,
    },
    "the same, observer at 5 Hz": {
        "encoder": Encoder(resolution=1e-6, noise=5e-7),
        "observer_bandwidth_hz": 5.0,
    },
    "delay of 1 ms not told": {"delay": 1e-3},
    "delay of a sample, 5 ms, not told": {"delay": 5e-3},
}
OF_MACHINE = ("limit", "coulomb", "encoder", "delay")


def cases():
    """Rows of the tables: name, whether the disturbance is observed, figures."""
    for name, changes in SETTINGS.items():
        truth = machine(**{k: v for k, v in changes.items() if k in OF_MACHINE})
        yield name, True, run(truth, **{k: v for k, v in changes.items() if k not in OF_MACHINE})
    for name, changes in WRONG.items():
        truth = machine(**{k: v for k, v in changes.items() if k in OF_MACHINE})
        rest = {k: v for k, v in changes.items() if k not in OF_MACHINE}
        for observed in (True, False):
            yield name, observed, run(truth, observe_disturbance=observed, **rest)


UNCERTAIN = (0.0, 0.1, 0.2, 0.3, 0.5)
HEAVIER = (-0.5, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.5)


def reserves(duration_s=4.0):
    """Rows of the table of reserves: stated uncertainty, true mass over the model's, figures."""
    stated, heavier = (x.ravel() for x in np.meshgrid(UNCERTAIN, HEAVIER, indexing="ij"))
    truth = machine()
    law = cl.controllers.ModelPredictiveContouring(model=truth.nominal, speed_limit=SPEED)
    mass = np.asarray(truth.nominal.mass) / (1.0 + heavier[:, None])
    start = cl.feedrate.constant_feed(EIGHT, feed=SPEED, sample_time=T, duration=duration_s / 4.0)
    found = cl.simulate_many(
        truth, law, start,
        vary={"controller.model.mass": mass, "controller.mass_uncertainty": stated},
        metrics=["cycle_time", "contour_error_rms", "contour_error_max"], record=["status"],
    )  # fmt: skip
    for k in range(len(stated)):
        cycle = float(found["cycle_time"][k])
        status = np.asarray(found["status"])[k][: int(cycle / T) if np.isfinite(cycle) else None]
        yield {
            "case": f"machine {100.0 * heavier[k]:+.0f} %, stated {100.0 * stated[k]:.0f} %",
            "heavier": float(heavier[k]),
            "mass_uncertainty": float(stated[k]),
            "cycle_s": cycle,
            "rms_um": 1e6 * float(found["contour_error_rms"][k]),
            "max_um": 1e6 * float(found["contour_error_max"][k]),
            "samples_of_status_1": int(np.sum(status == 1)),
            "unsolved": int(np.sum(status == 3)),
        }


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    for name, observed, found in cases():
        rows.append({"case": name, "observed": observed, **found})
        if not options.json:
            print(
                f"{name:36} {'observed' if observed else 'not observed':13} "
                f"{found['cycle_s']:7.3f} s  rms {found['rms_um']:9.3f}  max {found['max_um']:9.3f}"
                f" um  {found['status']}, {found['unsolved']} unsolved", flush=True,
            )  # fmt: skip
    kept = []
    for row in reserves():
        kept.append(row)
        if not options.json:
            print(
                f"{row['case']:36} {row['cycle_s']:7.3f} s  rms {row['rms_um']:9.3f}  max "
                f"{row['max_um']:9.3f} um  {row['samples_of_status_1']} samples of status 1",
                flush=True,
            )  # fmt: skip
    if options.json:
        print(json.dumps({"rows": rows, "reserves": kept}))


if __name__ == "__main__":
    main()
