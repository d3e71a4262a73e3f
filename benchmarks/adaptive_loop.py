"""An adaptive loop: least squares, projection and ten substeps of dry friction in the plant.

The paper's experiment I on its gantry, 300 000 control steps of 0.2 ms: the integrated law with the
local frame, with the global frame by an implicit form, and on a contour that has none. The loop
alone is timed, compiled before; the foot points by which a recording is judged are not in it (those
of the law's own frame are).

    python benchmarks/adaptive_loop.py [--json] [--steps 300000]
"""

from __future__ import annotations

import argparse
import json
import time

import jax
import numpy as np

import contourlab as cl
from contourlab.papers.global_task_frame_runs import (
    experiment_reference,
    machine_of,
    paper_law,
)
from contourlab.simulation.jax_engine import advance, start
from contourlab.simulation.loop import chunk_size, split
from contourlab.simulation.run import loop_reach

CASES = {
    "C1, global frame by its implicit form": ("C1", "implicit"),
    "C2, global frame by its implicit form": ("C2", "implicit"),
    "C2, global frame by foot points": ("C2", "foot_point"),
    "C3, local frame": ("C3", None),
}


def law_of(name, form, model):
    law = paper_law(name, model)
    return law if form is None else cl.configuration.replace_at(law, "frame.form", form)


def loop(machine, law, reference):
    """Return a function that runs the compiled loop alone."""
    period = reference.sample_time
    bound, bound_law = machine.bind(period), law.bind(reference.contour, period)
    size = chunk_size(reference.n_samples)
    chunks = [jax.tree.map(jax.numpy.asarray, c) for c in split(reference, size, 0)]
    reach, key = loop_reach(reference), jax.random.key(0)

    def run():
        carry = start(bound, bound_law, reference.contour, chunks[0], key, law.needs)
        rows = []
        for points in chunks:
            carry, out = advance(
                bound, bound_law, reference.contour, (), carry, points, period, reach, law.needs,
                size,
            )  # fmt: skip
            rows.append(out["actual"])
        jax.block_until_ready(rows)

    return run


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--steps", type=int, default=300_000)
    options = parser.parse_args()
    machine = machine_of("encoder only")
    reference = experiment_reference("I", 0, options.steps * 2e-4)
    results = {}
    for name, (law, form) in CASES.items():
        run = loop(machine, law_of(law, form, machine.nominal), reference)
        run()
        times = []
        for _ in range(3):
            begun = time.process_time(), time.perf_counter()
            run()
            times.append((time.process_time() - begun[0], time.perf_counter() - begun[1]))
        best = np.min(times, axis=0)
        results[name] = {
            "steps": reference.n_samples,
            "processor_s": float(best[0]),
            "elapsed_s": float(best[1]),
            "us_per_step": float(1e6 * best[1] / reference.n_samples),
        }
    if options.json:
        print(json.dumps(results, indent=1))
        return
    print(f"{reference.n_samples} steps; best of three")
    for name, found in results.items():
        print(
            f"{name:40} {found['elapsed_s']:7.2f} s elapsed {found['processor_s']:7.2f} s of the "
            f"processor {found['us_per_step']:7.2f} us per step"
        )


if __name__ == "__main__":
    main()
