"""A log of positions and commands, and the machine that made it.

The log is simulated, so that what is found can be compared with what is true: a stage on linear
motors with other masses and more friction than its data sheet says, a computing delay, encoders of
1 µm. ``examples/logs/simulated_stage.csv`` was written by this file.

    contourlab identify examples/logs/simulated_stage.csv --report identified.html \
        --output examples/logs/machine.toml
    contourlab compare examples/logs/identified.toml --output result
"""

from pathlib import Path

import numpy as np

import contourlab as cl

stage = cl.machines.linear_motor_stage(encoder=1e-6, computing_delay=0.8e-3)
friction = cl.machines.Friction(
    coulomb=(9.0, 5.0), coulomb_backward=(8.0, 5.0), smoothing_velocity=1e-4
)
true = cl.replace(
    stage, dynamics=cl.machines.RigidAxes(mass=(6.2, 3.4), viscous=(31.0, 20.0), friction=friction)
)

# a few rounds at a varied rate: several speeds, both ways, accelerations that matter
time = np.arange(3001) * 1e-3
rate, swing, beat = 6.0, 1.2, 5.3
reference = cl.recordings.Reference.along(
    cl.contours.Lissajous(amplitudes=(0.06, 0.05), frequencies=(1, 2), phases=(0.3, 0.0)),
    sample_time=1e-3,
    parameter=rate * time + swing * np.sin(beat * time),
    parameter_rate=rate + swing * beat * np.cos(beat * time),
    parameter_acceleration=-swing * beat**2 * np.sin(beat * time),
    parameter_jerk=-swing * beat**3 * np.cos(beat * time),
)
law = cl.controllers.AxisPid.by_pole_placement(stage.nominal, bandwidth_hz=20.0)
recording = cl.simulate(true, law, reference, seed=1)


def log_of(recording):
    """Columns and their names, as a controller would write them."""
    columns = [1e3 * recording["time"].values]
    heads = ["time [ms]"]
    signals = (("reference", "set", 1e3, "mm"), ("measured", "actual", 1e3, "mm"),
               ("command", "force", 1.0, "N"))  # fmt: skip
    for name, word, scale, unit in signals:
        for axis in "XY":
            columns.append(scale * recording[name].sel(axis=axis).values)
            heads.append(f"{axis}_{word} [{unit}]")
    return np.column_stack(columns), heads


def write_log(file):
    """Write the log as CSV, with the digits of a controller."""
    rows, heads = log_of(recording)
    digits = ["%.0f"] + ["%.4f"] * 2 + ["%.3f"] * 4
    np.savetxt(file, rows, fmt=digits, delimiter=",", header=",".join(heads), comments="")


if __name__ == "__main__":
    import sys

    if len(sys.argv) > 1:
        write_log(Path(sys.argv[1]))

found = cl.identification.identify_machine(recording)
print(found)
for axis, mass in zip(found.axes, (6.2, 3.4), strict=True):
    print(f"{axis.axis}: {mass} kg is within {axis['mass'].low:.5f} to {axis['mass'].high:.5f} kg")
