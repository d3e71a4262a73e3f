"""One closed loop: contourlab's two engines against NumPy, python-control and C by hand.

The same two axes (mass and viscous friction, exact zero-order hold) under the same PID with
filtered derivative and feed-forward, along the same ellipse. All of them must give the same motion
before any is timed. Ratios are taken in one run on one machine.

    python benchmarks/closed_loop.py [--json] [--steps 300000]
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

import contourlab as cl
from contourlab.export.c_engine import CEngine
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes
from contourlab.simulation.engines import ClosedLoop
from contourlab.simulation.jax_engine import advance, start
from contourlab.simulation.loop import chunk_size, geometry_rows, split
from contourlab.simulation.run import loop_reach

DT = 1e-3
MASS, VISCOUS = np.array([5.0, 3.0]), np.array([20.0, 15.0])
CUTOFF = 200.0

C_SOURCE = r"""
#include <math.h>
/* mass-damper axes, exact zero-order hold; PID with filtered derivative and feed-forward */
void loop(long n, const double *r, const double *v, const double *a, const double *p, double *out)
{
    const double dt = p[0], decay = p[1];
    double q[2], w[2] = {0, 0}, I[2] = {0, 0}, last[2], d[2] = {0, 0};
    for (int i = 0; i < 2; i++) { q[i] = r[i]; last[i] = 0.0; }
    for (long k = 0; k < n; k++) {
        for (int i = 0; i < 2; i++) {
            const double *g = p + 2 + 6 * i; /* kp ki kd M B limit */
            double e = r[2 * k + i] - q[i];
            out[2 * k + i] = q[i];
            d[i] = decay * d[i] + (1.0 - decay) * (e - last[i]) / dt;
            last[i] = e;
            double ff = g[3] * a[2 * k + i] + g[4] * v[2 * k + i];
            double u = g[0] * e + g[1] * I[i] + g[2] * d[i] + ff;
            double c = fmin(fmax(u, -g[5]), g[5]);
            if ((u - c) * e <= 0.0) I[i] += e * dt;
            double tau = g[3] / g[4], x = exp(-dt / tau), s = c / g[4];
            q[i] += s * dt + (w[i] - s) * tau * (1.0 - x);
            w[i] = s + (w[i] - s) * x;
        }
    }
}
"""


def scenario(steps, friction=False):
    contour = cl.contours.Ellipse(semi_axes=(0.03, 0.01))
    reference = cl.feedrate.constant_rate(
        contour, rate=1.8 * np.pi, duration=(steps - 1) * DT, sample_time=DT
    )
    machine = Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=MASS, viscous=VISCOUS, gain=1.0,
            friction=Friction(coulomb=[8.0, 6.0], breakaway=[10.0, 8.0]) if friction else None,
        ),
        drive=Drive(command="force", command_limit=[300.0, 300.0]),
        sensor=Encoder(velocity="ideal"),
    )  # fmt: skip
    law = cl.controllers.AxisPid.by_pole_placement(
        machine.nominal, 20.0, derivative_cutoff_hz=CUTOFF, velocity_feed_forward=1.0,
        acceleration_feed_forward=1.0,
    )  # fmt: skip
    return machine, law, reference


def jax_loop(machine, law, reference):
    """Return a function that runs the compiled loop alone: no foot points, no recording."""
    bound, bound_law = machine.bind(DT), law.bind(reference.contour, DT)
    size = chunk_size(reference.n_samples)
    chunks = [jax.tree.map(jax.numpy.asarray, c) for c in split(reference, size, 0)]
    reach, key = loop_reach(reference), jax.random.key(0)

    def run():
        carry = start(bound, bound_law, reference.contour, chunks[0], key, law.needs)
        rows = []
        for points in chunks:
            carry, out = advance(
                bound, bound_law, reference.contour, (), carry, points, DT, reach, law.needs, size
            )
            rows.append(out["actual"])
        jax.block_until_ready(rows)
        return rows

    return run


def c_engine_loop(machine, law, reference):
    """Return a function that runs the loop as ``engine="c"`` compiles it: no foot points."""
    needs = law.needs
    loop = ClosedLoop(
        machine=machine.bind(DT), law=law.bind(reference.contour, DT), reference=reference,
        disturbances=(), reach=loop_reach(reference), key=jax.random.key(0), needs=needs,
        length=reference.n_samples,
    )  # fmt: skip
    size = chunk_size(reference.n_samples)
    chunks = [
        (points, np.asarray(geometry_rows(reference.contour, points.parameter[:size],
                                          needs.derivatives)))
        for points in split(reference, size, needs.preview, loop.length)
    ]  # fmt: skip

    points, geometry = chunks[0]
    carry = start(loop.machine, loop.law, reference.contour, points, loop.key, needs)
    compiled = CEngine()._prepared(loop, carry, points, geometry)
    first = [one.copy() for one in compiled._state]

    def run():
        for one, value in zip(compiled._state, first, strict=True):
            one[...] = value
        for rows in chunks:
            for _ in compiled.steps(*rows):
                pass
        return compiled.outcome().values["actual"]

    return run


def numpy_loop(law, reference, steps):
    r, v, a = (
        np.asarray(x)[:steps]
        for x in (reference.position, reference.velocity, reference.acceleration)
    )
    kp, ki, kd = (np.broadcast_to(np.asarray(g), 2) for g in (law.kp, law.ki, law.kd))
    decay, tau = np.exp(-2 * np.pi * CUTOFF * DT), MASS / VISCOUS
    x = np.exp(-DT / tau)

    def run():
        q, w = r[0].copy(), np.zeros(2)
        integral, last, d = np.zeros(2), np.zeros(2), np.zeros(2)
        out = np.empty((steps, 2))
        for k in range(steps):
            e = r[k] - q
            out[k] = q
            d = decay * d + (1 - decay) * (e - last) / DT
            last = e
            u = kp * e + ki * integral + kd * d + MASS * a[k] + VISCOUS * v[k]
            c = np.clip(u, -300.0, 300.0)
            integral = integral + np.where((u - c) * e > 0, 0.0, e * DT)
            s = c / VISCOUS
            q = q + s * DT + (w - s) * tau * (1 - x)
            w = s + (w - s) * x
        return out

    return run


def c_loop(law, reference, folder, flags=("-O2",)):
    source, library = folder / "loop.c", folder / "loop.so"
    source.write_text(C_SOURCE)
    subprocess.run(["gcc", *flags, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).loop
    steps = reference.n_samples
    arrays = [
        np.ascontiguousarray(x)
        for x in (reference.position, reference.velocity, reference.acceleration)
    ]
    gains = [np.broadcast_to(np.asarray(g), 2) for g in (law.kp, law.ki, law.kd)]
    p = [DT, np.exp(-2 * np.pi * CUTOFF * DT)]
    for i in range(2):
        p += [gains[0][i], gains[1][i], gains[2][i], MASS[i], VISCOUS[i], 300.0]
    p, out = np.array(p), np.empty((steps, 2))
    pointer = ctypes.POINTER(ctypes.c_double)

    def run():
        function(ctypes.c_long(steps), *(x.ctypes.data_as(pointer) for x in (*arrays, p, out)))
        return out

    return run


def control_loop(law, reference, steps):
    import control

    kp, ki, kd = (np.broadcast_to(np.asarray(g), 2) for g in (law.kp, law.ki, law.kd))
    decay, tau = np.exp(-2 * np.pi * CUTOFF * DT), MASS / VISCOUS
    x = np.exp(-DT / tau)
    r, v, a = (
        np.asarray(y)[:steps]
        for y in (reference.position, reference.velocity, reference.acceleration)
    )

    def law_output(z, y):
        e = y[0:2] - y[6:8]
        d = decay * z[4:6] + (1 - decay) * (e - z[2:4]) / DT
        return kp * e + ki * z[0:2] + kd * d + MASS * y[4:6] + VISCOUS * y[2:4], e, d

    def law_update(t, z, y, params):
        u, e, d = law_output(z, y)
        held = (u - np.clip(u, -300.0, 300.0)) * e > 0
        return np.concatenate([z[0:2] + np.where(held, 0.0, e * DT), e, d])

    controller = control.nlsys(
        law_update,
        lambda t, z, y, params: law_output(z, y)[0],
        inputs=8,
        outputs=2,
        states=6,
        dt=DT,
        name="law",
    )

    def plant_update(t, z, u, params):
        s = np.clip(u, -300.0, 300.0) / VISCOUS
        q = z[0:2] + s * DT + (z[2:4] - s) * tau * (1 - x)
        return np.concatenate([q, s + (z[2:4] - s) * x])

    plant = control.nlsys(
        plant_update,
        lambda t, z, u, params: z[0:2],
        inputs=2,
        outputs=2,
        states=4,
        dt=DT,
        name="plant",
    )
    loop = control.interconnect(
        [plant, controller],
        connections=[["plant.u[0]", "law.y[0]"], ["plant.u[1]", "law.y[1]"],
                     ["law.u[6]", "plant.y[0]"], ["law.u[7]", "plant.y[1]"]],
        inplist=[f"law.u[{i}]" for i in range(6)], outlist=["plant.y[0]", "plant.y[1]"],
    )  # fmt: skip
    times = np.arange(steps) * DT
    inputs = np.concatenate([r, v, a], axis=1).T
    start = np.concatenate([r[0], np.zeros(8)])

    def run():
        return control.input_output_response(loop, times, inputs, start).outputs.T

    return run


def best(function, repeats):
    function()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--steps", type=int, default=300_000)
    options = parser.parse_args()
    machine, law, reference = scenario(options.steps)
    few = 2000
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        ours, c = jax_loop(machine, law, reference), c_loop(law, reference, Path(folder))
        python = numpy_loop(law, reference, few)
        control = control_loop(law, reference, few)
        truth = np.asarray(jax.numpy.concatenate(ours()))[: options.steps]
        exported = c_engine_loop(machine, law, reference)
        differences = {
            "engine c": np.abs(exported() - truth).max(),
            "C by hand": np.abs(c() - truth).max(),
            "NumPy loop": np.abs(python() - truth[:few]).max(),
            "python-control": np.abs(control() - truth[:few]).max(),
        }
        assert max(differences.values()) < 1e-12, differences
        rows = [
            ("contourlab, compiled", best(ours, 7) / options.steps * 1e6, 0.0),
            ("contourlab, engine c", best(exported, 7) / options.steps * 1e6,
             differences["engine c"]),
            ("C by hand, gcc -O2", best(c, 7) / options.steps * 1e6, differences["C by hand"]),
            ("NumPy loop", best(python, 3) / few * 1e6, differences["NumPy loop"]),
            ("python-control input_output_response", best(control, 1) / few * 1e6,
             differences["python-control"]),
        ]  # fmt: skip
        stiff, law2, _ = scenario(options.steps, friction=True)
        friction = best(jax_loop(stiff, law2, reference), 3)
        cl.simulate(machine, law, reference)  # compiles
        begin = time.perf_counter()
        cl.simulate(machine, law, reference)
        whole = time.perf_counter() - begin
    base = rows[0][1]
    result = {
        "steps": options.steps,
        "rows": [
            {
                "loop": name,
                "us_per_step": us,
                "ratio": us / base,
                "max_difference_m": float(difference),
            }
            for name, us, difference in rows
        ],
        "friction_ten_substeps_us_per_step": friction / options.steps * 1e6,
        "simulate_with_exact_error_and_recording_us_per_step": whole / options.steps * 1e6,
    }
    if options.json:
        print(json.dumps(result))
        return
    print(f"{'loop':40} {'us/step':>9} {'ratio':>9} {'difference [m]':>15}")
    for row in result["rows"]:
        print(
            f"{row['loop']:40} {row['us_per_step']:9.3f} {row['ratio']:9.2f} "
            f"{row['max_difference_m']:15.1e}"
        )
    print(f"with friction, ten substeps: {result['friction_ten_substeps_us_per_step']:.3f} us/step")
    print(
        "simulate, foot points and recording included: "
        f"{result['simulate_with_exact_error_and_recording_us_per_step']:.3f} us/step"
    )


if __name__ == "__main__":
    main()
