"""How small may the guard of Newton cross-coupling be? Ask the machine, then compare the laws.

A stage with linear motors, dry friction and 0.1 µm encoders. The chattering study runs the law
along a straight line for several guards and sample times and says from where on it swings. With the
guard that is quiet at the sample time of the controller, laws with the same gain near the path are
compared on an ellipse and, with a start that throws the tool off, on a fast circle.

    python examples/04_newton.py [chattering.png] [contour_error.png]
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl

SAMPLE_TIME = 5e-4
GUARDS = np.array((1.0, 2.0, 5.0, 10.0, 20.0, 50.0)) * 1e-6
PUSH = 10.0  # N on an axis, whatever the contour error

machine = cl.machines.examples.linear_motor_stage()
files = [Path(name) for name in sys.argv[1:] if name.endswith(".png")]
axis = cl.controllers.IntegralSlidingMode.by_bandwidth(
    machine.nominal, bandwidth_hz=12.0, disturbance_bound=20.0, disturbance_estimate="matched",
    friction_feed_forward=0.8,
)  # fmt: skip


def newton(guard):
    """The unity contour error through a PID on each axis, on top of the sliding mode."""
    return cl.controllers.NewtonCrossCoupled(
        axis=axis, guard=guard, kp=PUSH, ki=10.0 * PUSH, kd=0.01 * PUSH, derivative_cutoff_hz=50.0
    )


study = cl.simulation.chattering(
    machine, newton(GUARDS[0]), values=GUARDS, sample_times=(SAMPLE_TIME, 1e-3),
    feed="3000 mm/min", duration=1.5, quiet_below=0.5e-6,
)  # fmt: skip
print("limit cycle [um] over sample time and guard; . is quiet (below 0.5 um)")
print(f"{'':9}", *(f"{1e6 * guard:7g}" for guard in study.values), " um")
for sample_time, amplitudes, quiet in zip(
    study.sample_times, study.amplitude, study.quiet, strict=True
):
    cells = ["." if q else f"{1e6 * a:.2f}" for a, q in zip(amplitudes, quiet, strict=True)]
    print(f"{1e3 * sample_time:6g} ms", *(f"{cell:>7}" for cell in cells))
guard = float(study.least_quiet[study.sample_times == SAMPLE_TIME][0])
print(f"guard for {1e3 * SAMPLE_TIME:g} ms: {1e6 * guard:g} um\n")

# the plain couplings get the gain that the push has near the path
near = {"kp": PUSH / guard, "ki": 10.0 * PUSH / guard, "kd": 0.01 * PUSH / guard}
near |= {"derivative_cutoff_hz": 50.0}
laws = {
    "axes alone": axis,
    "variable gain": cl.controllers.VariableGainCrossCoupled(axis=axis, **near),
    "cross-coupled": cl.controllers.CrossCoupled(
        axis=axis, estimator=cl.contour_errors.NewtonEstimator(), **near
    ),
    "Newton": newton(guard),
    "Newton, along the path": cl.replace(newton(guard), form="normal"),
}
parts = {
    "ellipse at 6 m/min": (cl.contours.Ellipse(semi_axes=(0.03, 0.01)), "6 m/min"),
    "circle at 24 m/min": (cl.contours.Circle(radius=0.03), "24 m/min"),
}
curves = []
for part, (contour, feed) in parts.items():
    reference = cl.feedrate.constant_feed(contour, feed=feed, sample_time=SAMPLE_TIME, duration=2.0)
    comparison = cl.compare(machine, laws, reference)
    print(f"{part:24} {'rms':>7} {'max':>7} {'at start':>9} [um] {'command of X':>14} [N]")
    for name, recording in comparison.recordings.items():
        late = recording.metrics_between(0.5, 2.0)
        print(
            f"{name:24} {1e6 * late['contour_error_rms']:7.2f} "
            f"{1e6 * late['contour_error_max']:7.2f} "
            f"{1e6 * recording.metrics['contour_error_max']:9.1f} {'':4} "
            f"{recording.metrics['command_max'][0]:14.1f}"
        )
        if part.startswith("ellipse") and name not in ("axes alone", "variable gain"):
            values = 1e6 * np.abs(np.asarray(recording["contour_error"]))
            curves.append((name, values[reference.time > 0.5]))
            time = reference.time[reference.time > 0.5]
if files:
    cl.reports.write_chattering_figure(study, files[0], force=True)
if len(files) > 1:
    figure = cl.reports.PaperFigure(
        name=files[1].stem, title="Ellipse at 6 m/min on a stage with friction, after the start",
        y_label="contour error [µm]", time=time, curves=tuple(curves),
    )  # fmt: skip
    cl.reports.write_paper_figures([figure], files[1].parent, force=True)
