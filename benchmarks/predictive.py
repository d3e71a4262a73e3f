"""The quadratic programs of predictive contouring, solved here and by others, per solve.

python benchmarks/predictive.py [--json] [--horizons 10,20,30,50]

The programs are those of consecutive samples on a figure of eight under a voltage limit. Rounds
are interleaved: every solver takes one program after the other, several times, and medians are
compared. What is compared is the first input, in volts, against the solver at its tightest (DAQP).
The stopping row is soft here and hard for the others: its multiplier stays below the penalty.
Dense solvers take the condensed program; condensing is not counted. All get the scaled program. A
solver that is not installed is left out and named.
"""

from __future__ import annotations

import argparse
import importlib
import json
import time

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

import contourlab as cl
from contourlab.controllers.quadratic_program import solve_program
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes
from contourlab.testing.samples import make_samples, sample_at

T, SAMPLES, FIRST, ROUNDS = 5e-3, 30, 60, 5


def machine():
    return Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=44.8844, viscous=278.255, friction=Friction(coulomb=0.1, smoothing_velocity=1e-6)
        ),
        drive=Drive(command="voltage", command_limit=20.0),
        sensor=Encoder(),
        substeps=20,
    )


def programs(horizon):
    """Programs of consecutive samples, their warm starts, and milliseconds per step of the loop."""
    eight = cl.contours.FigureEight(
        half_sizes=(5e-3, 5e-3), rotation=np.pi, start_angle=-0.5 * np.pi
    )
    stage = machine()
    law = cl.controllers.ModelPredictiveContouring(
        model=stage.nominal, speed_limit=0.06, velocity_limit=0.06, horizon=horizon
    )
    bound, plant = law.bind(eight, T), stage.bind(T)
    first = sample_at(make_samples(eight, 2, T, law.needs), 0)

    def sample(state):
        import dataclasses

        shown = plant.measure(state)
        return dataclasses.replace(first, position=shown.position, velocity=shown.velocity)

    def step(carry, _):
        law_state, axes = carry
        now = sample(axes)
        command, after = bound.step(law_state, now)
        axes = plant.advance(axes, command, jnp.zeros(2))
        return (after, axes), (bound.program_at(law_state, now), law_state.multipliers)

    def loop(carry, _):
        law_state, axes = carry
        command, after = bound.step(law_state, sample(axes))
        return (after, plant.advance(axes, command, jnp.zeros(2))), after.iterations

    axes = plant.init(eight.position(0.0))
    start = bound.init(sample(axes)), axes
    taken = jax.jit(lambda c: jax.lax.scan(step, c, None, length=FIRST + SAMPLES))(start)[1]
    whole = jax.jit(lambda c: jax.lax.scan(loop, c, None, length=200))
    jax.block_until_ready(whole(start))
    times = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        iterations = jax.block_until_ready(whole(start))[1]
        times.append((time.perf_counter() - begin) / 200)
    each = [jax.tree.map(lambda x, k=k: x[FIRST + k], taken) for k in range(SAMPLES)]
    volts = np.asarray(bound.planner.input_scale)[:2]
    return each, 1e3 * float(np.median(times)), float(np.mean(iterations)), volts


def condensed(p):
    """H, f, A, l, u over the inputs alone."""
    d = np.asarray(p.dynamics)
    n_x, n_u, n = d.shape[0], d.shape[1] - d.shape[0], len(p.gradient)
    a, c = np.zeros((n_x, n * n_u)), np.asarray(p.start)
    hessian, slope = np.zeros((n * n_u, n * n_u)), np.zeros(n * n_u)
    rows, low, high = [], [], []
    for j in range(n):
        pick = np.zeros((n_u, n * n_u))
        pick[:, j * n_u : (j + 1) * n_u] = np.eye(n_u)
        y, z = np.vstack([a, pick]), np.concatenate([c, np.zeros(n_u)])
        h = np.asarray(p.hessian)[j]
        hessian += y.T @ h @ y
        slope += y.T @ (h @ z + np.asarray(p.gradient)[j])
        e = np.asarray(p.rows)[j]
        rows.append(e @ y)
        low.append(np.asarray(p.lower)[j] - e @ z)
        high.append(np.asarray(p.upper)[j] - e @ z)
        a, c = d @ y, d @ z
    hessian += a.T @ np.asarray(p.terminal_hessian) @ a
    slope += a.T @ (np.asarray(p.terminal_hessian) @ c + np.asarray(p.terminal_gradient))
    rows, low, high = np.concatenate(rows), np.concatenate(low), np.concatenate(high)
    keep = np.isfinite(low) | np.isfinite(high)
    return 0.5 * (hessian + hessian.T), slope, rows[keep], low[keep], high[keep]


def sparse(p):
    """P, q, equalities, rows with bounds over (x_0, u_0, ..., x_N)."""
    d = np.asarray(p.dynamics)
    n_x, n_y, n = d.shape[0], d.shape[1], len(p.gradient)
    cost = sp.block_diag([*np.asarray(p.hessian), np.asarray(p.terminal_hessian)], "csc")
    slope = np.concatenate([np.asarray(p.gradient).reshape(-1), np.asarray(p.terminal_gradient)])
    total = n * n_y + n_x
    equal = sp.lil_matrix(((n + 1) * n_x, total))
    equal[:n_x, :n_x] = np.eye(n_x)
    for j in range(n):
        at = (j + 1) * n_x
        equal[at : at + n_x, j * n_y : (j + 1) * n_y] = -d
        equal[at : at + n_x, (j + 1) * n_y : (j + 1) * n_y + n_x] = np.eye(n_x)
    right = np.concatenate([np.asarray(p.start), np.zeros(n * n_x)])
    rows = sp.hstack([
        sp.block_diag(list(np.asarray(p.rows)), "csc"),
        sp.csc_matrix((n * p.rows.shape[1], n_x)),
    ]).tocsc()  # fmt: skip
    low, high = np.asarray(p.lower).reshape(-1), np.asarray(p.upper).reshape(-1)
    keep = np.isfinite(low) | np.isfinite(high)
    return cost, slope, equal.tocsc(), right, rows[keep], low[keep], high[keep], n_x


def rivals():
    """Solvers by name: from a program to a function that solves it and gives the first input."""
    found = {}

    def module(name):
        try:
            return importlib.import_module(name)
        except ImportError:
            return None

    if (daqp := module("daqp")) is not None:

        def with_daqp(p):
            h, f, a, low, high = condensed(p)
            sense = np.zeros(len(low), np.int32)
            low, high = np.maximum(low, -1e30), np.minimum(high, 1e30)
            a = np.ascontiguousarray(a)
            return lambda: daqp.solve(h, f, a, high, low, sense)[0][:2]

        found["daqp, condensed"] = with_daqp
    if (quadprog := module("quadprog")) is not None:

        def with_quadprog(p):
            h, f, a, low, high = condensed(p)
            c = np.vstack([a[np.isfinite(low)], -a[np.isfinite(high)]]).T.copy()
            b = np.concatenate([low[np.isfinite(low)], -high[np.isfinite(high)]])
            return lambda: quadprog.solve_qp(h, -f, c, b)[0][:2]

        found["quadprog, condensed"] = with_quadprog
    if (piqp := module("piqp")) is not None:

        def with_piqp(p):
            cost, slope, equal, right, rows, low, high, n_x = sparse(p)
            solver = piqp.SparseSolver()
            solver.settings.eps_abs = solver.settings.eps_rel = 1e-8
            solver.settings.verbose = False
            solver.setup(cost, slope, equal, right, rows, low, high)

            def solve():
                solver.update(cost, slope, equal, right, rows, low, high)
                solver.solve()
                return np.asarray(solver.result.x)[n_x : n_x + 2]

            return solve

        found["piqp, sparse"] = with_piqp
    if (osqp := module("osqp")) is not None:

        def with_osqp(p):
            cost, slope, equal, right, rows, low, high, n_x = sparse(p)
            solver = osqp.OSQP()
            solver.setup(
                sp.triu(cost, format="csc"), slope, sp.vstack([equal, rows], format="csc"),
                np.concatenate([right, low]), np.concatenate([right, high]),
                eps_abs=1e-6, eps_rel=1e-6, max_iter=20000, verbose=False,
            )  # fmt: skip

            def solve():
                solver.cold_start() if hasattr(solver, "cold_start") else None
                return np.asarray(solver.solve().x)[n_x : n_x + 2]

            return solve

        found["osqp 1e-6, sparse"] = with_osqp
    missing = [n for n in ("daqp", "quadprog", "piqp", "osqp") if module(n) is None]
    return found, missing


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--horizons", default="10,20,30,50")
    options = parser.parse_args()
    others, missing = rivals()
    rows = []
    for horizon in (int(text) for text in options.horizons.split(",")):
        given, loop_ms, iterations, volts = programs(horizon)
        cold = jax.jit(lambda p: solve_program(p, jnp.zeros((p.rows.shape[0], 3))).inputs[0, :2])
        warm = jax.jit(
            lambda p, w: solve_program(p, jnp.zeros((p.rows.shape[0], 3)), warm=w).inputs[0, :2]
        )
        makers = {
            "contourlab, warm": lambda p, w, f=warm: lambda: np.asarray(f(p, w)),
            "contourlab, cold": lambda p, w, f=cold: lambda: np.asarray(f(p)),
            **{name: lambda p, w, m=make: m(p) for name, make in others.items()},
        }
        solvers = {name: [make(*one) for one in given] for name, make in makers.items()}
        answers = {n: np.array([s() for s in group]) for n, group in solvers.items()}
        judge = "daqp, condensed" if "daqp, condensed" in answers else "contourlab, cold"
        times = {name: [] for name in solvers}
        for _ in range(ROUNDS):
            for k in range(SAMPLES):
                for name, group in solvers.items():
                    begin = time.perf_counter()
                    group[k]()
                    times[name].append(time.perf_counter() - begin)
        for name in solvers:
            wrong = np.max(np.abs(answers[name] - answers[judge]) * volts)
            rows.append({
                "horizon": horizon, "solver": name,
                "us_per_solve": 1e6 * float(np.median(times[name])),
                "first_input_error_V": float(wrong),
            })  # fmt: skip
        rows.append({
            "horizon": horizon, "solver": "whole loop, per step", "us_per_solve": 1e3 * loop_ms,
            "iterations": iterations,
        })  # fmt: skip
    if options.json:
        print(json.dumps({"judge": judge, "missing": missing, "rows": rows}))
        return
    print(f"first inputs against {judge}; not installed: {', '.join(missing) or 'none'}")
    for row in rows:
        wrong = row.get("first_input_error_V")
        more = f"{row['iterations']:9.1f} iterations" if wrong is None else f"{wrong:12.1e} V"
        print(f"N = {row['horizon']:3} {row['solver']:24} {row['us_per_solve']:10.0f} us {more}")


if __name__ == "__main__":
    main()
