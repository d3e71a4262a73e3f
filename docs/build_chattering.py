# ruff: noqa: D103
"""Builds docs/chattering.md and its figure from a run: numbers in the page are never typed.

    python docs/build_chattering.py

Takes a minute, most of it compiling.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import contourlab as cl
from contourlab.machines.published.ghaffari import ghaffari_disturbance
from contourlab.papers.newton_runs import proposed, sliding_mode

HERE = Path(__file__).parent
MICRO = 1e-6
PUSH = {"kp": 1.0, "ki": 10.0, "kd": 0.1, "cutoff": 100.0}
"""Of the paper's coupling [V], [V/s], [V s], [1/s]."""


def table(study):
    head = ["sample time", *(f"{v / MICRO:g} µm" for v in study.values), "quiet from"]
    lines = [head, ["---:"] * len(head)]
    for k, sample_time in enumerate(study.sample_times):
        cells = [
            "quiet" if quiet else f"{amplitude / MICRO:.2g} µm, {hz:.0f} Hz"
            for amplitude, quiet, hz in zip(
                study.amplitude[k], study.quiet[k], study.frequency_hz[k], strict=True
            )
        ]
        least = study.least_quiet[k]
        last = "-" if np.isnan(least) else f"{least / MICRO:g} µm"
        lines.append([f"{1e3 * sample_time:g} ms", *cells, last])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def limit(law, model, sample_time):
    """The guard at which the linear loop has no phase left; the formula of the page."""
    bound = law.bind(cl.contours.Line(start=(0.0, 0.0), end=(1.0, 0.0)), sample_time)
    per_mass = np.asarray(model.gain) / np.asarray(model.mass)
    high = PUSH["kp"] + PUSH["kd"] * PUSH["cutoff"]
    lead = (PUSH["kd"] * PUSH["cutoff"] ** 2 - PUSH["ki"]) / high
    damping = np.asarray(law.error_rate) + np.asarray(law.integral_rate)
    damping = damping + np.asarray(bound.switching_gain) * per_mass
    return float(np.max(0.5 * sample_time * per_mass * high / (damping + lead)))


def main():
    machine = cl.machines.published.ghaffari_two_axes()
    axis = sliding_mode(machine.nominal, "matched")
    study = cl.simulation.chattering(
        machine, proposed(axis), feed="20 mm/s", disturbances=ghaffari_disturbance(),
        values=np.array((0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)) * MICRO,
        sample_times=(5e-5, 1e-4, 2e-4, 5e-4, 1e-3),
    )  # fmt: skip
    cl.reports.write_chattering_figure(study, HERE / "images" / "chattering.png", force=True)
    limits = ", ".join(
        f"{limit(axis, machine.nominal, t) / MICRO:.2g} µm at {1e3 * t:g} ms"
        for t in study.sample_times
    )
    best = study.contour_error_max[-1] / MICRO
    at = int(np.nanargmin(best))
    page = PAGE.format(
        table=table(study), limits=limits, best=f"{best[at]:.2g}",
        guard=f"{study.values[at] / MICRO:g}", wide=f"{best[-1]:.2g}", narrow=f"{best[0]:.2g}",
        largest=f"{study.values[-1] / MICRO:g}", least=f"{study.values[0] / MICRO:g}",
    )  # fmt: skip
    (HERE / "chattering.md").write_text(page)


PAGE = """# Chattering: which guard, which boundary layer?

This page is built from a run (`python docs/build_chattering.py`).

A law that is steep about zero error does not come to rest when it is sampled too slowly. It swings
about the path, with an amplitude that no lower guard reduces. `cl.simulation.chattering` runs your
machine, with its delays and encoders, along a straight line for several sample times and values of
one number of the law, and says where it swings, how far and how fast:

```python
import contourlab as cl

machine = cl.machines.published.ghaffari_two_axes()
axis = cl.controllers.IntegralSlidingMode.by_bandwidth(machine.nominal, 2.0, disturbance_bound=0.25)
law = cl.controllers.NewtonCrossCoupled(
    axis=axis, guard=1e-6, kp=1.0, ki=10.0, kd=0.1, derivative_cutoff_hz=16.0
)
study = cl.simulation.chattering(
    machine, law, values=[1e-6, 1e-5], sample_times=[1e-3], duration=1.0
)
print(study.amplitude, study.frequency_hz, study.least_quiet)
```

`cl.reports.chattering_table` and `write_chattering_figure` show the study. `field` names another
number, such as `"axis.boundary_layer"`. On machines with friction and encoders take `quiet_below`
at a few encoder counts; `examples/04_newton.py` does that.

## The two axes of the paper

The proposed law, -0.15 V on both axes, 20 mm/s, the matched disturbance estimate. Amplitude and
frequency of the limit cycle of the contour error, over the guard:

{table}

![amplitude, frequency and largest contour error over the guard](images/chattering.png)

The right panel is why a guard is chosen just above the limit. At the longest sample time the
largest contour error, start included, is {best} µm with a guard of {guard} µm. More guard gives
away stiffness ({wide} µm at {largest} µm), less swings ({narrow} µm at {least} µm).

## Where the limit comes from

Above its filter the coupling is a gain kp + N kd (N = 2π times the cut-off) over the guard δ.
With the mass it crosses at ω² = K (kp + N kd) / (M δ). What phase there is comes from the velocity
feedback of the axis law and from the filtered derivative, each a rate over ω; what is lost is half
a sample, ω T / 2, and the delay of drive and sensors in full. The loop is quiet for

    δ > T K (kp + N kd) / (2 M R),    R = a + b + κ K/M + (N² kd - ki) / (kp + N kd)

with a, b and κ of the sliding mode. Here the limit is {limits}.

A delay counts twice: T + 2 delay in place of T. The guard has to grow with the sample time and with
the push of the coupling; more damping in the axis law lets it shrink.
"""


if __name__ == "__main__":
    main()
