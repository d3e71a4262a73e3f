"""Cycle time against a bound on the contour error, on the bracket: predictive contouring alone.

    python examples/bracket/trade_off.py [FIGURE.png]

The law plans its own speed up to 0.5 m/s, whatever the program's F words, with the axes'
acceleration limit and a bound on its errors. Errors weigh little, so that the bound decides. Each
line is one run. The bound is soft and of the plan: at corners, where the path's direction jumps
between two samples, the tool may go beyond it.
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl
from contourlab.reports import trade_off_rows, write_trade_off_figure

BOUNDS_UM = (400.0, 200.0, 100.0, 50.0, 25.0)
SPEED, SAMPLE_TIME = 0.5, 1e-3  # m/s, s


def law(machine, bound):
    """Return the law with a bound on the contour error [m]."""
    return cl.controllers.ModelPredictiveContouring(
        model=machine.nominal, speed_limit=SPEED, horizon=40, acceleration_limit=15.0,
        contour_weight=1e7, lag_weight=1e7, progress_reward=5.0, contour_error_limit=bound,
        mass_uncertainty=0.0,  # the model is the machine's own: only the bound is to count
    )  # fmt: skip


def trade_off(bounds_um=BOUNDS_UM):
    """Yield each bound [m] with its recording."""
    part = cl.contours.read_gcode(Path(__file__).with_name("bracket.ngc"), axes=("X", "Y"))
    machine = cl.machines.examples.linear_motor_stage(computing_delay=1e-4)
    # of it the law takes where to start
    start = cl.feedrate.constant_feed(part.path, feed=SPEED, sample_time=SAMPLE_TIME)
    for bound in bounds_um:
        yield 1e-6 * bound, cl.simulate(machine, law(machine, 1e-6 * bound), start)


def main():
    """Print the table, and draw it if a file is given."""
    runs = {}
    print("bound [um]  cycle [s]  rms [um]  largest [um]  over the bound  no solution")
    for bound, run in trade_off():
        runs[bound] = run
        row = trade_off_rows({bound: run})[0]
        failed = int(np.sum(np.asarray(run["status"]) == 3))
        print(
            f"{1e6 * bound:10.0f} {row['cycle_time']:10.3f} {1e6 * row['contour_error_rms']:9.1f} "
            f"{1e6 * row['contour_error_max']:13.1f} {100.0 * row['beyond']:13.2f} % {failed:12d}",
            flush=True,
        )
    for file in sys.argv[1:]:
        title = "Bracket, predictive contouring: cycle time against a bound on the contour error"
        write_trade_off_figure(trade_off_rows(runs), file, title=title, force=True)


if __name__ == "__main__":
    main()
