"""Exported C: nanoseconds a step, state and code, against the JAX step it was made from.

Every law in a loop of its own, its inputs recorded and replayed inside C. The JAX step is the
compiled scan over the same inputs. The constrained predictive law also against DAQP's C solver on
the very programs of its loop, made dense (condensed) for it.

    python benchmarks/export.py [--json] [--only NAME] [--flags "-O3"]
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# before JAX: XLA's fused multiply-adds round otherwise than C's two operations
os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} --xla_cpu_max_isa=AVX".strip()

import jax
import numpy as np

from contourlab.export import check_parity, compile_c, find_compiler, generate, record_loop
from contourlab.export.c_target import size_of
from contourlab.testing.condensed_program import condensed_program

ROOT = Path(__file__).parents[1]
DRIVER = r"""
#define _POSIX_C_SOURCE 199309L
#include "law.c"
#include <stdlib.h>
#include <time.h>
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}
static int order(const void *a, const void *b)
{
    const double d = *(const double *)a - *(const double *)b;
    return (d > 0) - (d < 0);
}
void timed(const law_parameters *p, const law_inputs *rows, long n, long repeats, double *found);
void timed(const law_parameters *p, const law_inputs *rows, long n, long repeats, double *found)
{
    static law_state state;
    static law_outputs out;
    double *each = malloc((size_t)n * sizeof *each);
    found[0] = 1e300;
    for (long r = 0; r < repeats; ++r) {
        law_init(p, rows, &state);
        const double begin = now();
        for (long k = 0; k < n; ++k) law_step(p, rows + k, &state, &out);
        const double mean = (now() - begin) / (double)n;
        if (mean < found[0]) found[0] = mean;
    }
    law_init(p, rows, &state);
    for (long k = 0; k < n; ++k) {
        const double begin = now();
        law_step(p, rows + k, &state, &out);
        each[k] = now() - begin;
    }
    qsort(each, (size_t)n, sizeof *each, order);
    found[1] = each[n / 2];
    found[2] = each[n * 99 / 100];
    free(each);
}
"""


def loops():
    """Return the loops of the tests of the export: one for every law."""
    spec = importlib.util.spec_from_file_location("loops", ROOT / "tests" / "export" / "loops.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def in_jax(recorded, repeats=3):
    """Return nanoseconds of a compiled JAX step over the recorded inputs."""
    law = recorded.law
    samples = jax.tree.map(jax.numpy.asarray, recorded.samples)

    @jax.jit
    def run(samples):
        def step(state, sample):
            command, state = law.step(state, sample)
            return state, command

        first = jax.tree.map(lambda x: x[0], samples)
        return jax.lax.scan(step, law.init(first), samples)[1]

    run(samples).block_until_ready()
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        run(samples).block_until_ready()
        best = min(best, time.perf_counter() - begin)
    return 1e9 * best / recorded.n_steps


def in_c(generated, recorded, compiled, folder, flags):
    """Return best mean, median and 99th percentile of a step in C [ns], and bytes of code."""
    (folder / "driver.c").write_text(DRIVER)
    library, item = folder / "driver.so", folder / "law.o"
    common = [find_compiler(), "-std=c99", "-ffp-contract=off", *flags.split()]
    subprocess.run([*common, "-shared", "-fPIC", "-o", library, folder / "driver.c", "-lm"],
                   check=True)  # fmt: skip
    subprocess.run([*common, "-c", "-o", item, folder / "law.c"], check=True)
    sizes = subprocess.run(["size", item], check=True, capture_output=True, text=True).stdout
    rows = compiled.rows(recorded.inputs(generated.inputs))
    found = (ctypes.c_double * 3)()
    repeats = max(3, 20_000 // recorded.n_steps)
    ctypes.CDLL(str(library)).timed(
        ctypes.byref(compiled.parameters), rows, ctypes.c_long(recorded.n_steps),
        ctypes.c_long(repeats), found,
    )  # fmt: skip
    return [*found], int(sizes.splitlines()[1].split()[0])


def daqp_times(recorded, count=40):
    """Return the median time of DAQP's C on programs of the loop [ns]; None without it.

    Soft rows are soft by DAQP's own measure: it is asked for a time, not for our command.
    """
    try:
        import daqp
    except ImportError:
        return None
    law, times = recorded.law, []
    state = law.init(recorded.first())
    step, program_at = jax.jit(law.step.__func__), jax.jit(law.program_at.__func__)
    for k in range(min(count, recorded.n_steps)):
        sample = recorded.at(k)
        dense = condensed_program(program_at(law, state, sample))
        low, high = np.maximum(dense.lower, -1e30), np.minimum(dense.upper, 1e30)
        rows = np.ascontiguousarray(dense.rows)
        sense = np.where(np.isfinite(dense.penalty), 8, 0).astype(np.int32)
        best = np.inf
        for _ in range(3):
            *_, flag, info = daqp.solve(dense.hessian, dense.gradient, rows, high, low, sense)
            if flag < 0:
                raise RuntimeError(f"DAQP found no solution at step {k}: {flag}")
            best = min(best, info["solve_time"] + info["setup_time"])
        times.append(1e9 * best)
        _, state = step(law, state, sample)
    return float(np.median(times))


def measured(name, module, flags):
    machine, law, reference = module.loop(name, 2.0)
    recorded = record_loop(machine, law, reference)
    generated = generate(recorded.law, recorded.first(), sample_time=recorded.sample_time,
                         prefix="law")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        compiled = compile_c(generated, folder)
        parity = check_parity(generated, compiled, recorded)
        (mean, median, high), code = in_c(generated, recorded, compiled, Path(folder), flags)
    row = {
        "law": name, "c_ns": mean, "c_median_ns": median, "c_99_ns": high,
        "jax_ns": in_jax(recorded), "operations": generated.operations,
        "state_bytes": size_of(generated, generated.state), "code_bytes": code,
        "lines": generated.source.count("\n"), "difference": parity.relative,
        "bound": parity.bound.relative, "flipped": len(parity.flipped), "steps": parity.steps,
    }  # fmt: skip
    if name == "ModelPredictiveContouring":
        row["daqp_ns"] = daqp_times(recorded)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--flags", default="-O3")
    arguments = parser.parse_args()
    module, rows = loops(), []
    for name in module.NAMES:
        if arguments.only not in name:
            continue
        rows.append(measured(name, module, arguments.flags))
        if not arguments.json:
            r = rows[-1]
            print(
                f"{name:38s} C {r['c_ns']:9.0f} ns (median {r['c_median_ns']:.0f}, 99 % "
                f"{r['c_99_ns']:.0f})  JAX {r['jax_ns']:9.0f} ns  state {r['state_bytes']:5d} B  "
                f"code {r['code_bytes']:6d} B  differs {r['difference']:.1e}"
                + (f"  DAQP {r['daqp_ns']:.0f} ns" if r.get("daqp_ns") else ""),
                flush=True,
            )
    if arguments.json:
        json.dump({"flags": arguments.flags, "rows": rows}, sys.stdout)


if __name__ == "__main__":
    main()
