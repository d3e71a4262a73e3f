"""A slow stage and a fast scanner on one contour: synchronised, or step and scan.

    python examples/05_macro_micro.py [FIGURE.png]

The tool is where the scanner points in the frame of the stage, four axes for two coordinates. The
contour is a circle of 10 mm with twenty loops of 1 mm on it.

*Synchronised*: the stage's X axis, the slowest, is the master; the other three follow where it is
(``InternalModelContouring``), so that stage and scanner move at the same time and errors of the
stage are taken up by the scanner.
*Step and scan*: the stage stands in one field after the other, the scanner draws what lies in the
field, by a PID with full feed-forward. The tool is off while the stage steps.

The stage has dry friction, gains that are 2 % off, and encoders of 10 nm; it is an emulation.
Printed: time for one round, and the contour error in um while the tool is on, after the start.
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl

T = 1e-3
STAGE, SCANNER, LOOPS, ROUND = 10e-3, 1e-3, 20, 10.0  # m, m, -, s
FIELDS, STEP = 8, 0.5  # number, s: a stage of 0.5 g could step faster, a laser must not
machine = cl.machines.published.cao_zhang_emulated_stage(n_axes=4, resolution=10e-9)
matrix = machine.tool.matrix
axes = cl.contours.Lissajous(
    amplitudes=(STAGE, STAGE, SCANNER, SCANNER), frequencies=(1.0, 1.0, LOOPS, LOOPS),
    phases=(0.5 * np.pi, 0.0, 0.5 * np.pi, 0.0),
)  # fmt: skip
tool = cl.contours.combined(axes, matrix)
rate = 2.0 * np.pi / ROUND
pid = cl.controllers.AxisPid(
    model=machine.nominal, kp=(35e3, 11e3, 5e2, 5e2), ki=(170e3, 54e3, 2e4, 2e4),
    kd=(400.0, 180.0, 0.0, 0.0), velocity_feed_forward=1.0, acceleration_feed_forward=1.0,
)  # fmt: skip

law = cl.controllers.InternalModelContouring(
    axis=pid, disturbance_observer_hz=40.0,
    stabiliser_gain=1e3 * np.array([(-1500.0, -947.0), (-41.15, -26.41), (-41.15, -26.41)]),
)  # fmt: skip
together = cl.feedrate.constant_rate(axes, rate=rate, duration=1.2 * ROUND, sample_time=T)
recording = cl.simulate(machine, law, cl.replace(together, contour=tool))
time = np.asarray(recording["time"])
synchronised = 1e6 * np.abs(np.asarray(recording["contour_error"]))[time >= 0.2 * ROUND]

# step and scan: parameter and stage over time, field by field
scan, step = ROUND / FIELDS, STEP
rows = {"parameter": [], "stage": [], "on": []}
for field in range(FIELDS):
    centre = np.array([np.cos, np.sin])  # of the middle of the field
    here, there = (
        STAGE * np.array([one((k + 0.5) * 2.0 * np.pi / FIELDS) for one in centre])
        for k in (field, field + 1)
    )
    p = field * scan * rate + rate * T * np.arange(round(scan / T))
    rows["parameter"].append(p)
    rows["stage"].append(np.tile(here, (len(p), 1)))
    rows["on"].append(np.ones(len(p), bool))
    s = (np.arange(round(step / T)) + 1.0) * T / step
    blend = s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)
    rows["parameter"].append(np.full(len(s), p[-1] + rate * T))
    rows["stage"].append(here + blend[:, None] * (there - here))
    rows["on"].append(np.zeros(len(s), bool))
parameter, stage, on = (np.concatenate(rows[name]) for name in ("parameter", "stage", "on"))
turn = parameter[:, None] * np.array([1.0, LOOPS])
wanted = STAGE * np.stack([np.cos(turn[:, 0]), np.sin(turn[:, 0])], 1) - SCANNER * np.stack(
    [np.cos(turn[:, 1]), np.sin(turn[:, 1])], 1
)
position = np.concatenate([stage, stage - wanted], 1)
velocity, zero = np.gradient(position, T, axis=0), np.zeros_like(position)
stepped = cl.recordings.Reference(
    sample_time=T, parameter=parameter, parameter_rate=np.gradient(parameter, T),
    parameter_acceleration=np.zeros(len(parameter)), position=position, velocity=velocity,
    acceleration=np.gradient(velocity, T, axis=0), jerk=zero, contour=axes,
)  # fmt: skip
alone = cl.replace(machine, tool=cl.machines.IdentityTool())  # judged here, in tool space
actual = np.asarray(cl.simulate(alone, pid, stepped)["actual"]) @ np.asarray(matrix).T
feet = cl.contours.foot_point(tool, actual[on], near=parameter[on])
scanned = 1e6 * np.abs(np.asarray(feet.distance))
half = len(scanned) // 5

print(f"{'':16}{'one round [s]':>14}{'rms [um]':>10}{'max [um]':>10}")
for name, seconds, error in (
    ("synchronised", ROUND, synchronised),
    ("step and scan", FIELDS * (scan + step), scanned[half:]),
):
    print(f"{name:16}{seconds:14.1f}{np.sqrt(np.mean(error**2)):10.3f}{np.max(error):10.3f}")

for file in sys.argv[1:]:
    import matplotlib.pyplot as plt

    figure, plot = plt.subplots(figsize=(9.0, 3.6), layout="constrained")
    plot.semilogy(T * np.arange(len(synchronised)), synchronised, label="synchronised", lw=1.0)
    plot.semilogy(T * np.arange(len(scanned[half:])), scanned[half:], label="step and scan", lw=1.0)
    plot.set_xlabel("time with the tool on [s]")
    plot.set_ylabel("contour error [µm]")
    plot.set_ylim(1e-4, None)
    plot.margins(x=0.0)
    figure.legend(loc="outside upper left", frameon=False, ncols=2)
    figure.savefig(Path(file), dpi=120)
