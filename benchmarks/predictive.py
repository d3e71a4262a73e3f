"""The quadratic programs of predictive contouring, solved here and by others, per solve.

python benchmarks/predictive.py [--json] [--horizons 10,20,30,50] [--rounds 5]

The programs are those of consecutive samples on a figure of eight under a voltage limit, taken from
the closed loop, all in scaled variables. Rounds are interleaved: every solver takes one program
after the other, several times, and medians are compared. Whether a solver says that it succeeded is
counted. What is compared is the first input, in volts, against a judge that is not ours: DAQP's
dual active set, which ends at an exact active set; quadprog's is a second one. Soft rows are hard
for the others: their multipliers stay below the penalty, which is checked.

Dense solvers take the program condensed to its inputs, sparse ones as it is; to make that form is
not in their times and is told apart, as is the setup of those that have one. "Warm" is from the
program of the sample before, for ours from its multipliers, for OSQP and ProxQP from its primal and
dual solution; nobody starts from the solution itself. Ours is timed as a call from Python, like the
others, and in a compiled loop, as the law runs it. do-mpc solves another, nonlinear program with
IPOPT, of the same size: its row is what a step costs, not what a program does.
A solver that is not installed is named.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import json
import os
import time
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

import contourlab as cl
from contourlab.controllers.quadratic_program import solve_program
from contourlab.machines import Drive, Encoder, Friction, Machine, RigidAxes
from contourlab.testing.condensed_program import condensed_program
from contourlab.testing.samples import make_samples, sample_at

T, SAMPLES, FIRST = 5e-3, 30, 60
MASS, VISCOUS, LIMIT, SPEED = 44.8844, 278.255, 20.0, 0.06
NAMES = ("daqp", "quadprog", "proxsuite", "piqp", "osqp", "do_mpc")


def module(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def eight():
    return cl.contours.FigureEight(
        half_sizes=(5e-3, 5e-3), rotation=np.pi, start_angle=-0.5 * np.pi
    )


def programs(horizon, rounds):
    """Programs of consecutive samples, their warm starts, and the loop's time and iterations."""
    stage = Machine(
        names=("X", "Y"),
        dynamics=RigidAxes(
            mass=MASS, viscous=VISCOUS, friction=Friction(coulomb=0.1, smoothing_velocity=1e-6)
        ),
        drive=Drive(command="voltage", command_limit=LIMIT), sensor=Encoder(), substeps=20,
    )  # fmt: skip
    law = cl.controllers.ModelPredictiveContouring(
        model=stage.nominal, speed_limit=SPEED, velocity_limit=SPEED, horizon=horizon,
        mass_uncertainty=0.0,  # the model is the machine's own; its rows would be more
    )  # fmt: skip
    bound, plant = law.bind(eight(), T), stage.bind(T)
    first = sample_at(make_samples(eight(), 2, T, law.needs), 0)

    def sample(state):
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

    axes = plant.init(eight().position(0.0))
    start = bound.init(sample(axes)), axes
    taken = jax.jit(lambda c: jax.lax.scan(step, c, None, length=FIRST + SAMPLES))(start)[1]
    whole = jax.jit(lambda c: jax.lax.scan(loop, c, None, length=200))
    iterations = np.asarray(jax.block_until_ready(whole(start))[1])
    times = [clocked(lambda: jax.block_until_ready(whole(start))) / 200 for _ in range(rounds)]
    part = jax.tree.map(lambda x: x[FIRST:], taken)
    volts = np.asarray(bound.planner.input_scale)[:2]
    return part, float(np.median(times)), iterations, volts


def clocked(action):
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def sparse(p):
    """P, q, equalities, rows with bounds over (x_0, u_0, ..., x_N), and where u_0 is."""
    p_ = jax.tree.map(np.asarray, p)
    d = np.asarray(p.dynamics.back(jnp.eye(p.dynamics.n_states))).T
    n_x, n_y = d.shape
    n, n_z = p.n_stages, p_.state_hessian.shape[-1]
    total = n * n_y + n_x
    cost, slope = sp.lil_matrix((total, total)), np.zeros(total)
    for j in range(n):
        at, after = j * n_y, (j + 1) * n_y
        cost[at : at + n_y, at : at + n_y] += p_.stage_hessian
        slope[at : at + n_y] += p_.stage_gradient[j]
        cost[after : after + n_z, after : after + n_z] += p_.state_hessian[j]
        slope[after : after + n_z] += p_.state_gradient[j]
    equal = sp.lil_matrix(((n + 1) * n_x, total))
    equal[:n_x, :n_x] = np.eye(n_x)
    rows, low, high = [], [], []

    def add(normals, at, lower, upper):
        for k in np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)):
            row = sp.lil_matrix((1, total))
            row[0, at : at + normals.shape[1]] = normals[k]
            rows.append(row)
            low.append(lower[k])
            high.append(upper[k])

    for j in range(n):
        at, after = j * n_y, (j + 1) * n_y
        equal[(j + 1) * n_x : (j + 2) * n_x, at:after] = -d
        equal[(j + 1) * n_x : (j + 2) * n_x, after : after + n_x] = np.eye(n_x)
        add(np.eye(n_y - n_x), at + n_x, p_.lower[j], p_.upper[j])
        for r in p_.rows:
            pick = (lambda x: x) if r.over == "end" else (lambda x, j=j: x[j])
            if r.over != "end" or j == n - 1:
                upper = pick(r.upper)
                lower = np.full_like(upper, -np.inf) if r.lower is None else pick(r.lower)
                add(pick(r.normals), at if r.over == "stage" else after, lower, upper)
    right = np.concatenate([p_.start, np.zeros(n * n_x)])
    return (
        cost.tocsc(), slope, equal.tocsc(), right, sp.vstack(rows, format="csc"),
        np.array(low), np.array(high), n_x,
    )  # fmt: skip


def with_daqp(p):
    daqp, d = module("daqp"), condensed_program(p)
    sense = np.zeros(len(d.lower), np.int32)
    low, high = np.maximum(d.lower, -1e30), np.minimum(d.upper, 1e30)
    rows = np.ascontiguousarray(d.rows)

    def solve():
        x, _, flag, info = daqp.solve(d.hessian, d.gradient, rows, high, low, sense)
        return x[:2], flag == 1, info["lam"]

    return solve


def with_quadprog(p):
    quadprog, d = module("quadprog"), condensed_program(p)
    below, above = np.isfinite(d.lower), np.isfinite(d.upper)
    c = np.vstack([d.rows[below], -d.rows[above]]).T.copy()
    b = np.concatenate([d.lower[below], -d.upper[above]])
    # it raises if there is no solution
    return lambda: (quadprog.solve_qp(d.hessian, -d.gradient, c, b)[0][:2], True)


def with_proxqp(p, before=None):
    proxsuite = module("proxsuite")

    def made(p):
        d = condensed_program(p)
        qp = proxsuite.proxqp.dense.QP(len(d.gradient), 0, len(d.lower))
        qp.settings.eps_abs, qp.settings.eps_rel = 1e-8, 0.0
        qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS
        low, high = np.maximum(d.lower, -1e20), np.minimum(d.upper, 1e20)
        qp.init(d.hessian, d.gradient, None, None, d.rows, low, high)
        return qp

    qp = made(p)
    solved = proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED
    start = ()
    if before is not None:
        last = made(before)
        last.solve()
        start = (np.array(last.results.x), np.zeros(0), np.array(last.results.z))
        qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START

    def solve():
        qp.solve(*start)
        return np.array(qp.results.x)[:2], qp.results.info.status == solved

    return solve


def with_piqp(kind):
    def make(p):
        piqp = module("piqp")
        cost, slope, equal, right, rows, low, high, n_x = sparse(p)
        solver = piqp.SparseSolver()
        solver.settings.eps_abs = solver.settings.eps_rel = 1e-8
        solver.settings.verbose = False
        solver.settings.kkt_solver = getattr(piqp.KKTSolver, kind)
        solver.setup(cost, slope, equal, right, rows, low, high)

        def solve():
            solver.update(cost, slope, equal, right, rows, low, high)
            status = solver.solve()
            good = status == piqp.Status.PIQP_SOLVED
            return np.asarray(solver.result.x)[n_x : n_x + 2], good

        return solve

    return make


def with_osqp(p, before=None):
    osqp = module("osqp")

    def made(p):
        cost, slope, equal, right, rows, low, high, n_x = sparse(p)
        solver = osqp.OSQP()
        solver.setup(
            sp.triu(cost, format="csc"), slope, sp.vstack([equal, rows], format="csc"),
            np.concatenate([right, low]), np.concatenate([right, high]),
            eps_abs=1e-6, eps_rel=1e-6, max_iter=20000, verbose=False, warm_starting=True,
        )  # fmt: skip
        return solver, n_x

    solver, n_x = made(p)
    start = {"x": np.zeros(len(sparse(p)[1])), "y": np.zeros(solver.m)}
    if before is not None:
        found = made(before)[0].solve()
        start = {"x": np.array(found.x), "y": np.array(found.y)}

    def solve():
        solver.warm_start(**start)
        found = solver.solve()
        return np.array(found.x)[n_x : n_x + 2], found.info.status_val == 1

    return solve


def rivals():
    """Makers by name: from a program and the one before to what solves it."""
    every = {
        "daqp, condensed": ("daqp", lambda p, _: with_daqp(p)),
        "quadprog, condensed": ("quadprog", lambda p, _: with_quadprog(p)),
        "proxqp 1e-8, condensed, cold": ("proxsuite", lambda p, _: with_proxqp(p)),
        "proxqp 1e-8, condensed, warm": ("proxsuite", with_proxqp),
        "piqp 1e-8, sparse": ("piqp", lambda p, _: with_piqp("sparse_ldlt")(p)),
        "piqp 1e-8, multistage": ("piqp", lambda p, _: with_piqp("sparse_multistage")(p)),
        "osqp 1e-6, sparse, cold": ("osqp", lambda p, _: with_osqp(p)),
        "osqp 1e-6, sparse, warm": ("osqp", with_osqp),
    }
    return {name: make for name, (needs, make) in every.items() if module(needs) is not None}


def nonlinear(horizon, steps=12):
    """Seconds per step of do-mpc on the nonlinear program of the same law; None without it."""
    do_mpc, casadi = module("do_mpc"), module("casadi")
    if do_mpc is None or casadi is None:
        return None
    path = cl.controllers.ModelPredictiveContouring(
        model=Machine(
            names=("X", "Y"), dynamics=RigidAxes(mass=MASS, viscous=VISCOUS),
            drive=Drive(command="voltage", command_limit=LIMIT),
        ).nominal,
        speed_limit=SPEED, horizon=2,
    ).bind(eight(), T).path  # fmt: skip
    length = float(path.length)
    s_grid = np.linspace(-0.1 * length, 1.1 * length, 400)
    # in millimetres: IPOPT has no scaling of ours
    points = 1e3 * np.asarray(jax.vmap(lambda s: path.end_point(s))(jnp.asarray(s_grid)))
    x_of, y_of = (
        casadi.interpolant(name, "bspline", [1e3 * s_grid], points[:, k])
        for k, name in enumerate("xy")
    )
    model = do_mpc.model.Model("discrete")
    q = model.set_variable("_x", "q", (2, 1))
    v = model.set_variable("_x", "v", (2, 1))
    s = model.set_variable("_x", "s")
    u = model.set_variable("_u", "u", (2, 1))
    vs = model.set_variable("_u", "vs")
    a = VISCOUS / MASS
    decay = np.exp(-a * T)
    gain = 1e3 / MASS
    model.set_rhs("q", q + (1 - decay) / a * v + gain / a * (T - (1 - decay) / a) * u)
    model.set_rhs("v", decay * v + gain * (1 - decay) / a * u)
    model.set_rhs("s", s + T * vs)
    point = casadi.vertcat(x_of(s), y_of(s))
    slope = casadi.jacobian(point, s)
    tangent = slope / casadi.norm_2(slope)
    e = point - q
    lag = tangent.T @ e
    model.set_expression("cost", 1e3 * (e.T @ e - lag**2) + 1e2 * lag**2)
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}
    mpc.settings.n_horizon, mpc.settings.t_step = horizon, T
    mpc.settings.nlpsol_opts = quiet
    mpc.set_objective(mterm=model.aux["cost"], lterm=model.aux["cost"] - 2e-2 * vs)
    mpc.set_rterm(u=1e-4, vs=1e-4)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -LIMIT, LIMIT
    mpc.bounds["lower", "_u", "vs"], mpc.bounds["upper", "_u", "vs"] = 0.0, 1e3 * SPEED
    mpc.bounds["upper", "_x", "s"] = 1e3 * length
    mpc.setup()
    state = np.concatenate([1e3 * np.asarray(path.end_point(0.0)), np.zeros(3)])[:, None]
    mpc.x0 = state
    mpc.set_initial_guess()
    times = []
    for _ in range(steps):
        begin = time.perf_counter()
        w = mpc.make_step(state)
        times.append(time.perf_counter() - begin)
        if not mpc.solver_stats["success"]:
            return float("nan")
        x, v_, s_ = state[:2], state[2:4], state[4:]
        state = np.vstack([
            x + (1 - decay) / a * v_ + gain / a * (T - (1 - decay) / a) * w[:2],
            decay * v_ + gain * (1 - decay) / a * w[:2], s_ + T * w[2:],
        ])  # fmt: skip
    return float(np.median(times[2:]))


def measure(horizon, rounds):
    """Rows of the table for one horizon."""
    given, loop, iterations, volts = programs(horizon, rounds)
    each = [jax.tree.map(lambda x, k=k: x[k], given) for k in range(SAMPLES)]
    none = jnp.zeros((horizon, 3))

    @jax.jit
    def cold(p):
        found = solve_program(p, none)
        return found.inputs[0, :2], found.converged

    @jax.jit
    def warm(p, w):
        found = solve_program(p, none, warm=w)
        return found.inputs[0, :2], found.converged

    in_loop = {
        "contourlab, warm, in a loop": jax.jit(lambda g: jax.lax.map(lambda a: warm(*a), g)),
        "contourlab, cold, in a loop": jax.jit(lambda g: jax.lax.map(lambda a: cold(a[0]), g)),
    }
    makers = {
        "contourlab, warm": lambda p, w, _: lambda: jax.block_until_ready(warm(p, w)),
        "contourlab, cold": lambda p, w, _: lambda: jax.block_until_ready(cold(p)),
        **{name: lambda p, w, b, m=make: m(p, b) for name, make in rivals().items()},
    }
    solvers, setup = {}, {}
    for name, make in makers.items():
        begin = time.perf_counter()
        befores = [each[max(k - 1, 0)][0] for k in range(SAMPLES)]
        solvers[name] = [make(*one, b) for one, b in zip(each, befores, strict=True)]
        setup[name] = (time.perf_counter() - begin) / SAMPLES
    answers = {name: [solve() for solve in group] for name, group in solvers.items()}
    judge = "daqp, condensed" if "daqp, condensed" in answers else "quadprog, condensed"
    if judge == "daqp, condensed":
        for (p, _), found in zip(each, answers[judge], strict=True):
            soft = condensed_program(p).penalty
            assert np.all(np.abs(found[2]) <= soft), "a soft row gives way: not the same program"
    right = np.array([found[0] for found in answers[judge]])
    times = {name: [] for name in [*solvers, *in_loop]}
    for f in in_loop.values():
        jax.block_until_ready(f(given))
    for _ in range(rounds):
        for k in range(SAMPLES):
            for name, group in solvers.items():
                times[name].append(clocked(group[k]))
        for name, f in in_loop.items():
            taken = clocked(lambda f=f: jax.block_until_ready(f(given)))
            times[name].append(taken / SAMPLES)
    rows = []
    for name in times:
        found = answers[name.replace(", in a loop", "")]
        wrong = np.abs(np.array([np.asarray(a[0]) for a in found]) - right) * volts
        ours = name.startswith("contourlab")
        rows.append({
            "horizon": horizon, "solver": name, "us_per_solve": 1e6 * float(np.median(times[name])),
            "first_input_error_V": float(np.max(wrong)),
            "failed": sum(not bool(a[1]) for a in found),
            "setup_us": None if ours else 1e6 * setup[name],
        })  # fmt: skip
    rows.append({
        "horizon": horizon, "solver": "whole loop, per step", "us_per_solve": 1e6 * loop,
        "iterations_mean": float(np.mean(iterations)), "iterations_max": int(np.max(iterations)),
    })  # fmt: skip
    return judge, rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--horizons", default="10,20,30,50")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if module("daqp") is None and module("quadprog") is None:
        raise SystemExit("needs daqp or quadprog as a judge: pip install '.[benchmark]'")
    rows, judge = [], ""
    load = os.getloadavg()[0]
    for horizon in (int(text) for text in options.horizons.split(",")):
        judge, found = measure(horizon, options.rounds)
        rows += found
        taken = nonlinear(horizon)
        if taken is not None:
            rows.append({
                "horizon": horizon, "solver": "do-mpc, nonlinear step", "us_per_solve": 1e6 * taken
            })  # fmt: skip
    missing = [name for name in NAMES if module(name) is None]
    if options.json:
        print(json.dumps({"judge": judge, "missing": missing, "load": load, "rows": rows}))
        return
    print(f"first inputs against {judge}; not installed: {', '.join(missing) or 'none'}; "
          f"load {load:.1f} on {os.cpu_count()} cores")  # fmt: skip
    for row in rows:
        more = ""
        if "first_input_error_V" in row:
            more = f"{row['first_input_error_V']:10.1e} V {row['failed']:3} failed"
            if row["setup_us"] is not None:
                more += f"  condensing or setup in Python {row['setup_us']:8.0f} us"
        if "iterations_mean" in row:
            more = f"{row['iterations_mean']:8.1f} iterations, {row['iterations_max']} at most"
        print(f"N = {row['horizon']:3} {row['solver']:30} {row['us_per_solve']:9.0f} us {more}")


if __name__ == "__main__":
    main()
