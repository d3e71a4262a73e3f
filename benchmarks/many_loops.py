"""simulate_many for 1, 10, 100 and 1000 machines, per machine-step.

python benchmarks/many_loops.py [--json]
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np

import contourlab as cl
from contourlab.contours import Ellipse
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes

STEPS, DT = 2048, 1e-3

CASES = {
    "tracking metrics only": (False, ["tracking_error_rms", "tracking_error_max", "command_rms"]),
    "with the exact contour error": (False, ["contour_error_rms", "contour_error_max"]),
    "friction, ten substeps": (True, ["tracking_error_rms", "tracking_error_max"]),
    "friction and the exact contour error": (True, ["contour_error_rms", "contour_error_max"]),
}


def machine(friction):
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=[5.0, 3.0], viscous=[20.0, 15.0], gain=1.0,
            friction=Friction(coulomb=[8.0, 6.0], breakaway=[10.0, 8.0]) if friction else None,
        ),
        drive=Drive(command="force", command_limit=300.0),
        sensor=Encoder(velocity="ideal"),
    )  # fmt: skip


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    reference = cl.feedrate.constant_rate(
        Ellipse(semi_axes=(0.03, 0.01)), rate=6.0, duration=(STEPS - 1) * DT, sample_time=DT
    )
    rows = []
    for case, (friction, metrics) in CASES.items():
        stage = machine(friction)
        law = cl.controllers.AxisPid.by_pole_placement(
            stage.nominal, 20.0, derivative_cutoff_hz=200.0, velocity_feed_forward=1.0
        )
        for lanes in (1, 10, 100, 1000):
            kp = np.linspace(0.8, 1.2, lanes)[:, None] * np.asarray(law.kp)
            times = []
            for _ in range(3):
                begin = time.perf_counter()
                cl.simulate_many(stage, law, reference, vary={"controller.kp": kp}, metrics=metrics)
                times.append(time.perf_counter() - begin)
            rows.append(
                {
                    "case": case,
                    "machines": lanes,
                    "us_per_machine_step": min(times) / lanes / STEPS * 1e6,
                }
            )
    if options.json:
        print(json.dumps({"steps": STEPS, "rows": rows}))
        return
    for row in rows:
        print(f"{row['case']:38} {row['machines']:6d} {row['us_per_machine_step']:9.3f} us")


if __name__ == "__main__":
    main()
