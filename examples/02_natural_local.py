"""A soft tangent and a stiff normal: what the natural local law gains over the tangent frame.

    python examples/02_natural_local.py [--all] [FIGURE.png]

prints a table in µm for the figure of eight and, if a file is named, draws the contour error. With
``--all`` it takes one law more, and the paper's helix and a spline in space with an inflection.

The law is told 5 % too little viscous friction, so that every run lags along the path: with
f_t = 4 Hz by some two millimetres.
"""

import sys
from pathlib import Path

import numpy as np

import contourlab as cl

# a wave in space, nearly flat: its curvature all but vanishes in the middle
control = np.array([[-0.03, 0.0, 0.0], [-0.018, -0.02, 2e-4], [-0.006, -0.02, -2e-4],
                    [0.006, 0.02, -2e-4], [0.018, 0.02, 2e-4], [0.03, 0.0, 0.0]])  # fmt: skip
contours = {"figure of eight": cl.contours.FigureEight(half_sizes=(0.03, 0.03))}
if "--all" in sys.argv:
    from contourlab.papers.natural_local_runs import MengHelix

    contours["helix of the paper"] = MengHelix()
    contours["spline, inflection"] = cl.contours.Path.from_bezier(control[None])
files = [Path(name) for name in sys.argv[1:] if name.endswith(".png")]
FEED = 0.15  # m/s


def stage(n):
    """Axes behind drives that take a voltage; what laws are told is wrong by 5 %."""
    machine = cl.machines.Machine(
        names=("X", "Y", "Z")[:n],
        dynamics=cl.machines.RigidAxes(mass=1.0, viscous=np.array([200.0, 225.0, 210.0])[:n]),
        drive=cl.machines.Drive(command="voltage"),
        sensor=cl.machines.Encoder(resolution=1e-7),
    )
    told = cl.replace(machine.nominal, viscous=0.95 * np.asarray(machine.nominal.viscous))
    return cl.replace(machine, nominal_model=told)


def laws(model):
    """The first-order law, the paper's, and what the restored terms and the cubic add."""
    common = {"model": model, "bandwidth_hz": (4.0, 25.0)}
    natural = cl.controllers.NaturalLocalTaskFrame
    chosen = {
        "first order": cl.controllers.FirstOrderTaskFrame(**common),
        "natural, paper's terms": natural(**common, estimate="natural", curvature_rates=False),
        "extended, all terms": natural(**common),
    }
    if "--all" in sys.argv:
        chosen["natural, all terms"] = natural(**common, estimate="natural")
    return chosen


print(f"{'contour error [um]':20} {'law':24} {'rms':>9} {'max':>9} {'lag, max':>9}")
for name, contour in contours.items():
    machine = stage(contour.n_axes)
    reference = cl.feedrate.constant_feed(contour, feed=FEED, sample_time=5e-4)
    comparison = cl.compare(machine, laws(machine.nominal), reference)
    curves = []
    for law, recording in comparison.recordings.items():
        # the start from rest on a moving reference is left out, and the sudden stop at the end
        window = (0.1, reference.duration - 0.02)
        m = recording.metrics_between(*window)
        lag = np.max(np.abs(np.asarray(recording["task_error"])[:, 0]))
        print(
            f"{name:20} {law:24} {m['contour_error_rms'] * 1e6:9.2f} "
            f"{m['contour_error_max'] * 1e6:9.2f} {lag * 1e6:9.0f}"
        )
        inside = (reference.time > window[0]) & (reference.time < window[1])
        curves.append((law, 1e6 * np.abs(np.asarray(recording["contour_error"]))[inside]))
    for file in files[:1] if name == "figure of eight" else []:
        title = "Figure of eight at 9 m/min: soft along the path (4 Hz), stiff across (25 Hz)"
        figure = cl.reports.PaperFigure(
            name=file.stem, title=title, y_label="contour error [µm]",
            time=reference.time[inside], curves=tuple(curves),
        )  # fmt: skip
        cl.reports.write_paper_figures([figure], file.parent, force=True)
