"""A slow stage and a fast scanner on one contour: synchronised, or step and scan.

    python examples/05_macro_micro.py [FIGURE.png]

The tool is where the scanner points in the frame of the stage, four axes for two coordinates. The
contour is a circle of 10 mm with twenty loops of 1 mm on it.

*Together*: the stage goes round the circle and the scanner draws the loops, both at the same time.
Once every axis runs by itself, by a PID with full feed-forward; once they are *synchronised*: the
stage's X axis, the slowest, is the master, and the other three follow where it is
(``InternalModelContouring``), so that the scanner takes up the errors of the stage.
*Step and scan*: the stage stands in one of eight fields after the other and the scanner draws what
lies in the field, by the same PID. The tool is off while the stage steps and settles.

Like for like: the same machine, the same contour, and one round in the same 10 s; step and scan
also in twice the time, which shows what its error costs. The stage has dry friction, gains that are
2 % off, and encoders of 10 nm; it is an emulation. Printed: time for one round, and the contour
error in um while the tool is on, over the last whole round of one and a quarter.
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl

T = 1e-3
STAGE, SCANNER, LOOPS, ROUND = 10e-3, 1e-3, 20, 10.0  # m, m, -, s
FIELDS, STEP, SETTLE = 8, 0.5, 0.1  # number, s, s
machine = cl.machines.published.cao_zhang_emulated_stage(n_axes=4, resolution=10e-9)
matrix = np.asarray(machine.tool.matrix)
axes = cl.contours.Lissajous(
    amplitudes=(STAGE, STAGE, SCANNER, SCANNER), frequencies=(1.0, 1.0, LOOPS, LOOPS),
    phases=(0.5 * np.pi, 0.0, 0.5 * np.pi, 0.0),
)  # fmt: skip
tool = cl.contours.combined(axes, matrix)
pid = cl.controllers.AxisPid(
    model=machine.nominal, kp=(35e3, 11e3, 5e2, 5e2), ki=(170e3, 54e3, 2e4, 2e4),
    kd=(400.0, 180.0, 0.0, 0.0), velocity_feed_forward=1.0, acceleration_feed_forward=1.0,
)  # fmt: skip
law = cl.controllers.InternalModelContouring(
    axis=pid, disturbance_observer_hz=40.0,
    stabiliser_gain=1e3 * np.array([(-1500.0, -947.0), (-41.15, -26.41), (-41.15, -26.41)]),
)  # fmt: skip


def together(controller):
    """Return the contour error [um] over the last round."""
    reference = cl.feedrate.constant_rate(
        axes, rate=2.0 * np.pi / ROUND, duration=1.25 * ROUND, sample_time=T
    )
    recording = cl.simulate(machine, controller, cl.replace(reference, contour=tool))
    return 1e6 * np.abs(np.asarray(recording["contour_error"]))[round(0.25 * ROUND / T) :]


def step_and_scan(seconds):
    """Return the contour error [um] with the tool on, over the last round, which takes seconds."""
    scan = seconds / FIELDS - STEP - SETTLE
    share = 2.0 * np.pi / FIELDS
    rows = {"parameter": [], "rate": [], "stage": [], "on": []}

    def stretch(parameter, rate, stage, on):
        n = len(parameter)
        for name, values in (
            ("parameter", parameter), ("rate", np.full(n, rate)),
            ("stage", np.broadcast_to(stage, (n, 2))), ("on", np.full(n, on)),
        ):  # fmt: skip
            rows[name].append(values)

    for field in range(FIELDS + FIELDS // 4):
        middle = (field + 0.5) * share
        here, there = (STAGE * np.array([np.cos(a), np.sin(a)]) for a in (middle, middle + share))
        n = round(scan / T)
        stretch(share * (field + np.arange(n) / n), share / scan, here, True)
        n = round(STEP / T)
        s = (np.arange(n)[:, None] + 1.0) / n
        blend = s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)
        rest = np.full(n, share * (field + 1))
        stretch(rest, 0.0, here + blend * (there - here), False)
        stretch(rest[: round(SETTLE / T)], 0.0, there, False)
    parameter, rate, stage, on = (np.concatenate(rows[name]) for name in rows)
    turn = parameter[:, None] * np.array([1.0, LOOPS])
    wanted = STAGE * np.stack([np.cos(turn[:, 0]), np.sin(turn[:, 0])], 1) - SCANNER * np.stack(
        [np.cos(turn[:, 1]), np.sin(turn[:, 1])], 1
    )
    position = np.concatenate([stage, stage - wanted], 1)
    velocity = np.gradient(position, T, axis=0)
    reference = cl.recordings.Reference(
        sample_time=T, parameter=parameter, parameter_rate=rate,
        parameter_acceleration=np.zeros(len(parameter)), position=position, velocity=velocity,
        acceleration=np.gradient(velocity, T, axis=0), jerk=np.zeros_like(position), contour=tool,
    )  # fmt: skip
    error = 1e6 * np.abs(np.asarray(cl.simulate(machine, pid, reference)["contour_error"]))
    last = np.arange(len(error)) >= len(error) - round(seconds / T)
    return error[last & on]


runs = {
    "together, every axis by itself": (ROUND, together(pid)),
    "together, synchronised": (ROUND, together(law)),
    "step and scan": (ROUND, step_and_scan(ROUND)),
    "step and scan, slower": (2.0 * ROUND, step_and_scan(2.0 * ROUND)),
}
print(f"{'':32}{'one round [s]':>14}{'rms [um]':>10}{'max [um]':>10}")
for name, (seconds, error) in runs.items():
    print(f"{name:32}{seconds:14.1f}{np.sqrt(np.mean(error**2)):10.3f}{np.max(error):10.3f}")

for file in sys.argv[1:]:
    import matplotlib.pyplot as plt

    figure, plot = plt.subplots(figsize=(9.0, 3.6), layout="constrained")
    for name, (_, error) in runs.items():
        plot.semilogy(np.linspace(0.0, 1.0, len(error)), error, label=name, lw=1.0)
    plot.set_xlabel("share of the round with the tool on")
    plot.set_ylabel("contour error [µm]")
    plot.set_ylim(1e-4, None)
    plot.margins(x=0.0)
    figure.legend(loc="outside upper left", frameon=False, ncols=2)
    figure.savefig(Path(file), dpi=120)
