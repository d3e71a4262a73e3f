"""Cycle time against a bound on the contour error, on the bracket: predictive contouring alone.

    python examples/bracket/trade_off.py [FIGURE.png]

The law plans its own speed up to 0.5 m/s, whatever the program's F words, with the axes'
acceleration limit and a bound on its errors. Each line is one run. The bound is soft and of the
plan: at corners, where the path's direction jumps between two samples, the tool may go beyond it.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import contourlab as cl

BOUNDS_UM = (400.0, 200.0, 100.0, 50.0, 25.0)
SPEED, SAMPLE_TIME = 0.5, 1e-3  # m/s, s

part = cl.contours.read_gcode(Path(__file__).with_name("bracket.ngc"), axes=("X", "Y"))
machine = cl.machines.examples.linear_motor_stage(computing_delay=1e-4)
# of it the law takes where to start
start = cl.feedrate.constant_feed(part.path, feed=SPEED, sample_time=SAMPLE_TIME)
rows = []
print("bound [um]  cycle [s]  rms [um]  largest [um]  over the bound  no solution")
for bound in BOUNDS_UM:
    law = cl.controllers.ModelPredictiveContouring(
        model=machine.nominal, speed_limit=SPEED, horizon=40, acceleration_limit=15.0,
        contour_weight=1e7, lag_weight=1e7, progress_reward=5.0, contour_error_limit=bound * 1e-6,
        observer_bandwidth_hz=100.0,
    )  # fmt: skip
    run = cl.simulate(machine, law, start)
    error = 1e6 * np.abs(np.asarray(run["contour_error"]))
    failed = int(np.sum(np.asarray(run["status"]) == 3))
    over = 100.0 * float(np.mean(error > bound))
    rows.append((bound, run.metrics["cycle_time"], np.max(error)))
    print(
        f"{bound:10.0f} {rows[-1][1]:10.3f} {1e6 * run.metrics['contour_error_rms']:9.1f} "
        f"{rows[-1][2]:13.1f} {over:13.2f} % {failed:12d}",
        flush=True,
    )
for file in sys.argv[1:]:
    bounds, times, _ = np.array(rows).T
    axes = plt.figure(figsize=(6.0, 4.0), layout="constrained").add_subplot()
    axes.semilogx(bounds, times, "o-")
    axes.set(xlabel="bound on the contour error [µm]", ylabel="cycle time [s]", title="Bracket")
    axes.grid(visible=True, alpha=0.3)
    axes.figure.savefig(file, dpi=120)
