"""Whether exported code gives the numbers that JAX gave: replayed open loop, step by step.

A difference is judged against the peak of the command. The bound is 1e-12 of it, unless the law
itself makes more of less: the replay is repeated with inputs that are changed by one rounding, and
where the command moves more than 1e-12 the bound is a multiple of that. So a law with high gains on
differences of positions, or one that iterates, has a bound that follows from its own numbers.
Decisions (status, finished, whole numbers in telemetry) that came out otherwise are listed, each
with its step.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.export.compiled import CompiledController
from contourlab.export.generate import GeneratedC
from contourlab.export.golden import RecordedLoop

__all__ = ["Bound", "Parity", "check_parity", "unmeasured_bound"]

EXACT = 1e-12
ROUNDINGS = 30.0
"""Roundings inside a step that may act together as much as one of every input."""

LOOSEST = 0.1
"""Beyond this the exported law is another law: in single precision some are."""


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


def unmeasured_bound(generated: GeneratedC) -> Bound:
    """Return the bound where no compiler could measure one.

    Parameters
    ----------
    generated
        The law.
    """
    if generated.precision == "single":
        return Bound(1e-2, "single precision, and no compiler to measure what it means here")
    return Bound(1e-8, "no compiler to measure what roundings mean here")


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
    found = compiled.replay(inputs)
    wanted = np.asarray(loop.outputs["command"])
    difference = _largest(found["command"] - wanted)
    peak = float(np.max(np.abs(wanted))) if wanted.size else 0.0
    flipped = [
        (k, field.name, int(theirs), int(ours))
        for field in generated.outputs
        if field.dtype == "int32"
        for k, theirs, ours in _unlike(loop.outputs[field.path], found[field.name])
    ]
    moved = _largest(compiled.replay(_nudged(inputs, generated.precision))["command"]
                     - found["command"])  # fmt: skip
    bound = _bound(generated, moved / peak if peak else moved)
    return Parity(difference, peak, loop.n_steps, tuple(flipped), bound)


def _bound(generated: GeneratedC, moved: float) -> Bound:
    if moved <= EXACT:
        return Bound(EXACT)
    why = "single precision: " if generated.precision == "single" else ""
    why += "the law iterates until it has converged, and " if generated.iterates else ""
    return Bound(
        min(ROUNDINGS * moved, LOOSEST),
        f"{why}one rounding of its inputs moves the command by {moved:.2g} of the peak",
    )


def _largest(away: NDArray[Any]) -> float:
    """Return the largest of differences; a number that is none is infinitely far away."""
    if not away.size:
        return 0.0
    return float(np.max(np.where(np.isfinite(away), np.abs(away), np.inf)))


def _unlike(theirs: Any, ours: Any) -> list[tuple[int, Any, Any]]:
    theirs, ours = (np.asarray(one).reshape(len(one), -1) for one in (theirs, ours))
    return [(int(k), theirs[k, n], ours[k, n]) for k, n in np.argwhere(theirs != ours)]


def _nudged(inputs: dict[str, NDArray[Any]], precision: str) -> dict[str, NDArray[Any]]:
    """Return inputs that are one rounding away, up or down in turn."""
    rounding = 2.0**-24 if precision == "single" else 2.0**-53
    found = {}
    for number, (name, value) in enumerate(inputs.items()):
        sign = (-1.0) ** (np.arange(value.size) + np.arange(value.size) // 7 + number)
        found[name] = value * (1.0 + 2.0 * rounding * sign.reshape(value.shape))
    return found
