"""Predictive contouring: what the weights across the path gain over predictive control by axis.

    python examples/06_predictive.py [--all] [FIGURE.png]

prints a table in µm for a figure of eight on a feed drive with dry friction and, if a file is
named, draws the contour error. With ``--all`` it adds a noisy sensor, a cutting force, three axes.

Laws are not told of the friction: what they remove they have seen in the positions.
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl

FEED, T = 0.006, 5e-3  # m/s, s
everything = "--all" in sys.argv
files = [Path(name) for name in sys.argv[1:] if name.endswith(".png")]
drive = cl.machines.published.el_khalick_feed_drive
eight = cl.contours.FigureEight(half_sizes=(0.005, 0.005))
knot = cl.contours.Lissajous(amplitudes=0.005, frequencies=(1, 2, 1), phases=(0.0, 0.0, np.pi / 2))
force = tuple(
    cl.machines.SineDisturbance(axis=axis, amplitude=150.0, frequency_hz=10.0) for axis in (0, 1)
)  # N, at the table
cases = {"figure of eight": (drive(), eight, ())}
if everything:
    cases["with 1 um of noise"] = (drive(noise=1e-6), eight, ())
    cases["with a cutting force"] = (drive(), eight, force)
    cases["in space"] = (drive(n_axes=3), knot, ())


def laws(model, noisy):
    """By axis, and as contouring control with two settings; C filters where there is noise."""
    common = {"model": model, "friction_compensation": 0.0}
    if noisy:
        common["noise_polynomial"] = (1.0, -1.6, 0.64)
    contouring = cl.controllers.PredictiveContouring
    even = {"normal_input_weight": 1e-11, "tangential_input_weight": 1e-11}  # m²/V²
    light = {**even, "normal_input_weight": 1e-14}
    return {
        "by axis": cl.controllers.AxisPredictive(input_weight=1e-11, **common),
        "error across x 10": contouring(**common, **even, contour_weight=10.0),
        "commands across / 1000": contouring(**common, **light, contour_weight=1.0),
    }


print(f"{'contour error [um]':22} {'law':24} {'rms':>9} {'max':>9} {'tracking':>9}")
for name, (machine, contour, disturbances) in cases.items():
    reference = cl.feedrate.constant_feed(contour, feed=FEED, sample_time=T)
    comparison = cl.compare(
        machine, laws(machine.nominal, "noise" in name), reference, disturbances=disturbances
    )
    curves = []
    # the start from rest on a moving reference is left out, and the stop at the end
    window = (1.0, reference.duration - 0.2)
    inside = (reference.time > window[0]) & (reference.time < window[1])
    for law, recording in comparison.recordings.items():
        m = recording.metrics_between(*window)
        print(
            f"{name:22} {law:24} {m['contour_error_rms'] * 1e6:9.3f} "
            f"{m['contour_error_max'] * 1e6:9.3f} {m['tracking_error_max'] * 1e6:9.3f}"
        )
        curves.append((law, 1e6 * np.asarray(recording["contour_error"])[inside]))
    for file in files[:1] if name == "figure of eight" else []:
        figure = cl.reports.PaperFigure(
            name=file.stem, title="Figure of eight, 6 mm/s, 0.1 V of dry friction: predictive laws",
            y_label="contour error [µm]", time=reference.time[inside], curves=tuple(curves),
        )  # fmt: skip
        cl.reports.write_paper_figures([figure], file.parent, force=True)
