"""How long planned motions take, against ruckig, toppra and LinuxCNC.

ruckig plans time-optimal motions with limited jerk from point to point: a straight line from rest
to rest, the same limits along it. toppra plans time-optimal motions on a path under velocity and
acceleration limits, without a jerk limit: what a jerk limit costs is the other column. LinuxCNC's
planner runs whole programs, without a jerk limit, where it is installed; its own time is counted in
servo cycles (``linuxcnc_cycle_time.py``).

python benchmarks/cycle_time.py [--json] [--no-linuxcnc]
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from pathlib import Path as FilePath

import numpy as np
import ruckig
import toppra
from toppra import algorithm, constraint, interpolator

import contourlab as cl
from contourlab.contours import Ellipse, Path, read_gcode_text
from contourlab.feedrate import AxisLimits, plan_feed
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives

NO_JERK_LIMIT = 1e6
FEED = 10.0  # m/s: the axes decide
PROGRAMS = FilePath("/usr/share/linuxcnc/ncfiles")
toppra.setup_logging("ERROR")


class GeometricPath(interpolator.AbstractGeometricPath):
    """A contour over its arc length, as toppra wants it."""

    def __init__(self, contour):
        self.contour, self.table = contour, ArcLength(contour)
        self.dof = contour.n_axes
        self.path_interval = np.array([0.0, self.table.length])

    dof = None
    path_interval = None

    def __call__(self, arc, order=0):
        place = self.table.parameter_at(np.clip(np.atleast_1d(arc), 0.0, self.table.length))
        d = contour_derivatives(self.contour, place)
        return d[:, 0] if order == 0 else arc_derivatives(d)[:, order - 1]


def by_toppra(contour, limits, cells=2000):
    path = GeometricPath(contour)
    n = contour.n_axes
    v, a = (np.broadcast_to(x, n) for x in (limits.velocity, limits.acceleration))
    constraints = [
        constraint.JointVelocityConstraint(np.stack([-v, v], axis=1)),
        constraint.JointAccelerationConstraint(np.stack([-a, a], axis=1)),
    ]
    grid = np.linspace(0.0, path.table.length, cells + 1)
    begin = time.perf_counter()
    solver = algorithm.TOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel")
    _, speed, _ = solver.compute_parameterization(0.0, 0.0)
    return float(
        np.sum(2.0 * np.diff(grid) / (speed[1:] + speed[:-1]))
    ), time.perf_counter() - begin


def by_ruckig(length, velocity, acceleration, jerk):
    given = ruckig.InputParameter(1)
    given.current_position, given.target_position = [0.0], [length]
    given.max_velocity, given.max_acceleration, given.max_jerk = [velocity], [acceleration], [jerk]
    trajectory = ruckig.Trajectory(1)
    begin = time.perf_counter()
    ruckig.Ruckig(1).calculate(given, trajectory)
    return trajectory.duration, time.perf_counter() - begin


def planned(contour, limits, feed=FEED, **options):
    plan_feed(contour, limits=limits, sample_time=1e-3, feed=feed, **options)  # compiles
    begin = time.perf_counter()
    plan = plan_feed(contour, limits=limits, sample_time=1e-3, feed=feed, **options)
    return plan.cycle_time, time.perf_counter() - begin


def limits_of(velocity, acceleration, jerk):
    return AxisLimits(velocity=velocity, acceleration=acceleration, jerk=jerk)


def spline(seed, axes=2, n=12):
    """A smooth random path: cubic Bézier pieces with continuous second derivatives."""
    from scipy.interpolate import CubicSpline

    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(n + 1, axes)), axis=0) * 0.02
    s = CubicSpline(np.arange(n + 1), points)
    value, slope = points, s(np.arange(n + 1), 1)
    curves = np.stack(
        [value[:-1], value[:-1] + slope[:-1] / 3, value[1:] - slope[1:] / 3, value[1:]], axis=1
    )
    return Path.from_bezier(curves)


def lines():
    rows = []
    for length, velocity, acceleration, jerk in (
        (0.3, 0.4, 5.0, 100.0), (0.01, 0.4, 5.0, 100.0), (0.001, 0.4, 5.0, 100.0),
        (1.0, 1.0, 10.0, 500.0),
    ):  # fmt: skip
        path = Path.polyline([[0.0, 0.0], [length, 0.0]])
        ours, took = planned(path, limits_of(velocity, acceleration, jerk))
        theirs, their_took = by_ruckig(length, velocity, acceleration, jerk)
        rows.append(
            {"what": f"line of {1e3 * length:g} mm", "rival": "ruckig", "cycle_s": ours,
             "rival_s": theirs, "ratio": ours / theirs, "took_s": took, "rival_took_s": their_took}
        )  # fmt: skip
    return rows


def smooth_paths():
    rows = []
    paths = {"ellipse 60 x 20 mm": Ellipse(semi_axes=(0.03, 0.01))}
    paths |= {f"random spline {k}": spline(k) for k in range(3)}
    paths |= {"random spline 3, three axes": spline(3, axes=3)}
    for name, contour in paths.items():
        theirs, their_took = by_toppra(contour, limits_of(1.0, 5.0, 1.0))
        for jerk in (NO_JERK_LIMIT, 5000.0, 500.0, 100.0):
            limits = limits_of(1.0, 5.0, jerk)
            ours, took = planned(contour, limits)
            first, first_took = planned(contour, limits, fastest=False)
            rows.append(
                {"what": name, "rival": "toppra", "jerk": jerk, "cycle_s": ours,
                 "rival_s": theirs, "ratio": ours / theirs, "took_s": took,
                 "rival_took_s": their_took, "first_plan_s": first, "first_took_s": first_took}
            )  # fmt: skip
    return rows


def programs():
    """Whole programs, their feeds raised so that the axes decide, under both path modes."""
    from linuxcnc_cycle_time import linuxcnc_cycle_time

    rows = []
    for name, faster in (("arcspiral.ngc", 100.0), ("tort.ngc", 50.0)):
        text = (PROGRAMS / name).read_text()
        for mode in ("G61", "G64 P0.05"):
            theirs = linuxcnc_cycle_time(
                PROGRAMS / name, velocity=0.5, acceleration=5.0, startup=f"G21 {mode}",
                feed_override=faster,
            )  # fmt: skip
            part = read_gcode_text(f"G21 {mode}\n{text}", name=name)
            feed = np.where(part.rapid, 1.0, faster * part.feed)
            for jerk in (NO_JERK_LIMIT, 5000.0, 500.0):
                ours, took = planned(part, limits_of(0.5, 5.0, jerk), feed=feed)
                over = max(theirs["acceleration_over_limit"])
                rows.append(
                    {"what": f"{name}, {mode}", "rival": "LinuxCNC", "jerk": jerk, "cycle_s": ours,
                     "rival_s": theirs["cycle_time_s"], "ratio": ours / theirs["cycle_time_s"],
                     "took_s": took, "rival_over_limit": over}
                )  # fmt: skip
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--no-linuxcnc", action="store_true")
    options = parser.parse_args()
    rows = lines() + smooth_paths()
    if shutil.which("linuxcnc") and not options.no_linuxcnc:
        rows += programs()
    if options.json:
        print(json.dumps({"version": cl.__version__, "rows": rows}))
        return
    print("| what | jerk [m/s³] | cycle [s] | rival | its cycle [s] | ratio | planning [s] |")
    print("|---|---|---|---|---|---|---|")
    for row in rows:
        jerk = row.get("jerk")
        jerk = "" if jerk is None else "none" if jerk == NO_JERK_LIMIT else f"{jerk:g}"
        print(
            f"| {row['what']} | {jerk} | {row['cycle_s']:.4f} | {row['rival']} "
            f"| {row['rival_s']:.4f} | {row['ratio']:.3f} | {row['took_s']:.3f} |"
        )


if __name__ == "__main__":
    main()
