"""A log of a machine with a known fault is judged, and the fault is found.

The log here is written by a simulation, as a controller would write it: a text with commands and
encoder positions in millimetres. One axis has lost motion and its neighbour a slower position loop.
"""

from pathlib import Path

import numpy as np

import contourlab as cl

machine = cl.machines.ball_screw_stage(n_axes=2)
contour = cl.contours.Circle(radius=0.03, center=(0.2, 0.2))
law = cl.controllers.Cascade(model=machine.nominal, position_gain=(30.0, 33.0))

# two turns forwards, and two backwards slower, from rest to rest
rates = []
for rate in (2.0, -1.0):
    ramp = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 100))
    turning = np.ones(round(2.2 * 2.0 * np.pi / abs(rate) / 2e-3))
    rates += [np.zeros(50), rate * ramp, rate * turning, rate * ramp[::-1]]
rate = np.concatenate(rates)
angle = np.cumsum(rate) * 2e-3
reference = cl.recordings.Reference.along(
    contour, sample_time=2e-3, parameter=angle, parameter_rate=rate,
    parameter_acceleration=np.gradient(rate, 2e-3), parameter_jerk=np.zeros_like(rate),
)  # fmt: skip
recording = cl.simulate(machine, law, reference)

commanded = np.asarray(recording["reference"])
actual = np.asarray(recording["actual"])
side = np.sign(np.gradient(actual[:, 1]))
actual[:, 1] -= 4e-6 * side  # 8 um of lost motion on Y

log = Path("circle.csv")
rows = np.column_stack([np.asarray(recording["time"]), 1e3 * commanded, 1e3 * actual])
heading = "time_s,X_set_mm,Y_set_mm,X_act_mm,Y_act_mm"
np.savetxt(log, rows, delimiter=",", header=heading, comments="", fmt="%.6f")

found = cl.evaluate(log, measured="tool")
largest, half = (found.metrics[f"contour_error_max{end}"] for end in ("", "_uncertainty"))
print(f"largest contour error {1e6 * largest:.1f} um, known to {1e6 * half:.2f} um")
for cause in found.causes:
    if cause.state == "found" and cause.remedy:
        print(f"{cause.name}: {1e6 * cause.rms:.2f} um rms; {cause.remedy}")
if found.circular is not None and found.circular.bidirectional is not None:
    print(f"G(b) of ISO 230-4: {1e6 * found.circular.bidirectional:.1f} um")
