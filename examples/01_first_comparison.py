"""An ellipse at speed: two axis controllers and cross-coupled control on the same machine.

Run it from anywhere: ``python examples/01_first_comparison.py``. It prints a table in µm.
"""

import numpy as np

import contourlab as cl

contour = cl.contours.Ellipse(semi_axes=(0.03, 0.01))
reference = cl.feedrate.constant_rate(contour, rate=1.8 * np.pi, duration=2.2, sample_time=5e-4)
machine = cl.machines.published.meng_xy_stage()

pid = cl.controllers.AxisPid.by_pole_placement(
    machine.nominal, bandwidth_hz=60.0, derivative_cutoff_hz=600.0
)
controllers = {
    "pid": pid,
    "pid, feed-forward": cl.replace(
        pid, velocity_feed_forward=1.0, acceleration_feed_forward=1.0, friction_feed_forward=1.0
    ),
    # the gains towards the path are twice those of the axes
    "cross-coupled": cl.controllers.CrossCoupled(
        axis=pid,
        estimator=cl.contour_errors.OsculatingCircleEstimator(),
        kp=2.0 * pid.kp.max(),
        ki=2.0 * pid.ki.max(),
    ),
}
comparison = cl.compare(machine, controllers, reference)

print(f"{'controller':20} {'rms':>10} {'max':>10} {'tracking rms':>14}   [um]")
for name, recording in comparison.recordings.items():
    m = recording.metrics
    print(
        f"{name:20} {m['contour_error_rms'] * 1e6:10.2f} {m['contour_error_max'] * 1e6:10.2f} "
        f"{m['tracking_error_rms'] * 1e6:14.2f}"
    )
print(f"closest to the path: {comparison.best('contour_error_rms')}")
