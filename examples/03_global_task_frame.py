"""Learning the machine while it cuts: adaptive robust laws on a free-form contour.

    python examples/03_global_task_frame.py [FIGURE.png]

The gantry of the paper carries 5 kg that its laws are not told of. They run a spline through
points, round and round; the table says what is left of the contour error in the last round and what
each law then takes for the masses. In the second half the laws are soft along the contour, do not
adapt and know of no dry friction: the tool lags by three millimetres, and the local frame takes the
bend of the contour over the lag for an error.

If a file is named, the contour error of the second half is drawn.
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl

# a closed curve of no formula: a rounded bean, through points
angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
radius = 0.06 * (1.0 + 0.25 * np.cos(2.0 * angle) + 0.1 * np.sin(3.0 * angle))
points = np.stack([radius * np.cos(angle), 0.12 + radius * np.sin(angle)], axis=1)
contour = cl.contours.interpolating_spline(points, closed=True).spline.to_path()

machine = cl.machines.published.hu_gantry(payload=True)
ROUND = 2.0  # s
reference = cl.feedrate.constant_feed(
    contour, feed=float(contour.length) / ROUND, duration=4.0 * ROUND, sample_time=5e-4
)
last = (3.0 * ROUND, 4.0 * ROUND)
gains = {"model": machine.nominal, "error_decay": (30.0, 100.0), "feedback_gain": (60.0, 100.0),
         "uncertainty": 0.8, "disturbance_limit": 1.0}  # fmt: skip
Direct, Integrated = cl.controllers.DirectAdaptiveRobust, cl.controllers.IntegratedAdaptiveRobust
laws = {"direct": Direct(**gains), "integrated": Integrated(**gains)}

print(f"{'last round':12} {'rms [um]':>9} {'max [um]':>9} {'mass X':>8} {'mass Y':>8}")
for name, recording in cl.compare(machine, laws, reference).recordings.items():
    m = recording.metrics_between(*last)
    mass = np.asarray(recording["mass_estimate"])[-1]
    print(
        f"{name:12} {1e6 * m['contour_error_rms']:9.3f} {1e6 * m['contour_error_max']:9.3f} "
        f"{mass[0]:8.4f} {mass[1]:8.4f}"
    )
print(f"{'true':12} {'':9} {'':9} {0.19:8.4f} {0.62:8.4f}\n")

# no adaptation, soft along, and told of no dry friction: the tool lags
told = cl.replace(machine.nominal, coulomb=np.zeros(2))
fixed = {"model": told, "error_decay": (15.0, 100.0), "feedback_gain": (4.0, 100.0),
         "uncertainty": 0.0, "disturbance_limit": 1e-6, "adaptation_rate": (1e-9,) * 4}  # fmt: skip
frames = {"global": cl.controllers.GlobalTaskFrame(), "local": cl.controllers.LocalTaskFrame()}
soft = {name: Direct(**fixed, frame=frame) for name, frame in frames.items()}
comparison = cl.compare(machine, soft, reference)
print(f"{'soft along':12} {'rms [um]':>9} {'max [um]':>9} {'lag, max [um]':>14}")
curves = []
inside = (reference.time >= last[0]) & (reference.time < last[1])
for name, recording in comparison.recordings.items():
    m = recording.metrics_between(*last)
    lag = np.max(np.abs(np.asarray(recording["task_error"])[inside, 0]))
    print(
        f"{name:12} {1e6 * m['contour_error_rms']:9.2f} {1e6 * m['contour_error_max']:9.2f} "
        f"{1e6 * lag:14.0f}"
    )
    curves.append((f"{name} frame", 1e6 * np.asarray(recording["contour_error"])[inside]))
for file in [Path(name) for name in sys.argv[1:] if name.endswith(".png")][:1]:
    figure = cl.reports.PaperFigure(
        name=file.stem, title="Soft along the contour, no adaptation, no dry friction in the model",
        y_label="contour error [µm]", time=reference.time[inside] - last[0], curves=tuple(curves),
    )  # fmt: skip
    cl.reports.write_paper_figures([figure], file.parent, force=True)
