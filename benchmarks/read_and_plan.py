"""Reading a long part program, and planning the feed of long paths.

python benchmarks/read_and_plan.py [--json]
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np

import contourlab as cl
from contourlab.contours import Path, read_gcode_text
from contourlab.feedrate import AxisLimits, plan_feed

PIECES = 100_000
LIMITS = AxisLimits(velocity=1.0, acceleration=10.0, jerk=1000.0)


def program():
    """Half lines, half full circles."""
    lines = ["G21 G90 G17 F3000"]
    for k in range(PIECES // 2):
        lines += [f"G1 X{k % 400 + 1} Y{k % 300 + 1}", "G3 I1.5 J0"]
    return "\n".join([*lines, "M2"])


def smooth_polyline():
    """A wide circle in short chords: no corner stops."""
    angle = np.linspace(0.0, 6.0, PIECES + 1)
    return Path.polyline(2.0 * np.column_stack([np.cos(angle), np.sin(angle)]))


def staircase():
    """A corner after every line."""
    steps = np.arange(PIECES + 1)
    return Path.polyline(1e-3 * np.column_stack([(steps + 1) // 2, steps // 2]))


def timed(function):
    begin = time.perf_counter()
    result = function()
    return time.perf_counter() - begin, result


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    text = program()
    seconds, part = timed(lambda: read_gcode_text(text, name="long.ngc"))
    rows.append({"what": "read G-code", "pieces": part.n_pieces, "samples": 0, "s": seconds})
    for what, path in (("polyline", smooth_polyline()), ("exact stops", staircase())):
        cl.feedrate.plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.05)  # compiles
        seconds, plan = timed(
            lambda path=path: plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.05)
        )
        rows.append(
            {"what": f"plan, {what}", "pieces": path.n_pieces,
             "samples": plan.reference.n_samples, "s": seconds}
        )  # fmt: skip
    if options.json:
        print(json.dumps({"rows": rows}))
        return
    for row in rows:
        print(
            f"{row['what']:20} {row['pieces']:8d} pieces {row['samples']:9d} samples "
            f"{row['s']:7.2f} s"
        )


if __name__ == "__main__":
    main()
