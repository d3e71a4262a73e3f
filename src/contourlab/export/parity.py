"""Whether exported code gives the numbers that JAX gave: replayed open loop, step by step.

A difference is judged against the peak of the command. Decisions (status, finished, whole numbers
in telemetry) that came out otherwise are listed, each with its step.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from contourlab.export.compiled import CompiledController
from contourlab.export.generate import GeneratedC
from contourlab.export.golden import RecordedLoop

__all__ = ["Bound", "Parity", "check_parity", "parity_bound"]

EXACT = 1e-12
ITERATED = 1e-9
SINGLE = 1e-3


@dataclasses.dataclass(frozen=True)
class Bound:
    """How far exported commands may be from JAX's.

    Parameters
    ----------
    relative
        Of the peak command.
    reason
        Why it is not the usual 1e-12; empty where it is.
    """

    relative: float
    reason: str = ""


@dataclasses.dataclass(frozen=True)
class Parity:
    """What a replay showed.

    Parameters
    ----------
    difference
        Largest difference of a command [command unit].
    peak
        Largest command [command unit].
    steps
        Replayed.
    flipped
        Decisions that came out otherwise: (step, output, in JAX, exported).
    bound
        That was judged by.
    """

    difference: float
    peak: float
    steps: int
    flipped: tuple[tuple[int, str, int, int], ...]
    bound: Bound

    @property
    def relative(self) -> float:
        """Largest difference over the peak command."""
        return self.difference / self.peak if self.peak else self.difference

    @property
    def holds(self) -> bool:
        """Whether the commands are within the bound."""
        return self.relative <= self.bound.relative


def parity_bound(generated: GeneratedC) -> Bound:
    """Return the bound for a law.

    Parameters
    ----------
    generated
        The law.
    """
    if generated.precision == "single":
        return Bound(
            SINGLE,
            "single precision: 6e-8 of every number, which differences of positions over a sample "
            "time raise, and which changes decisions",
        )
    if generated.iterates:
        return Bound(
            ITERATED,
            "the law iterates until it has converged: the last step is as far from the limit as "
            "its tolerance, and rounding may take one step more or less",
        )
    return Bound(EXACT)


def check_parity(generated: GeneratedC, compiled: CompiledController, loop: RecordedLoop) -> Parity:
    """Return how the compiled law compares with JAX over a recorded loop.

    Parameters
    ----------
    generated
        The law.
    compiled
        From it.
    loop
        Its inputs and JAX's outputs.
    """
    inputs = loop.inputs(generated.inputs)
    rows = [{key: value[k] for key, value in inputs.items()} for k in range(loop.n_steps)]
    compiled.init(rows[0])
    found = [compiled.step(row) for row in rows]
    command = np.array([one["command"] for one in found])
    wanted = np.asarray(loop.outputs["command"])
    away = np.abs(command - wanted)
    flipped: list[tuple[int, str, int, int]] = []
    for field in generated.outputs:
        if field.dtype != "int32":
            continue
        ours = np.array([one[field.name] for one in found]).reshape(loop.n_steps, -1)
        theirs = np.asarray(loop.outputs[field.path]).reshape(loop.n_steps, -1)
        for k, n in np.argwhere(ours != theirs):
            flipped.append((int(k), field.name, int(theirs[k, n]), int(ours[k, n])))
    worst: Any = np.max(np.where(np.isnan(away), np.inf, away)) if away.size else 0.0
    peak = float(np.max(np.abs(wanted))) if wanted.size else 0.0
    return Parity(
        float(worst), peak, loop.n_steps, tuple(flipped), parity_bound(generated)
    )  # fmt: skip
