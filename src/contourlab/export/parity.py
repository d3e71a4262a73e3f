"""Whether exported code gives the numbers that JAX gave: replayed open loop, step by step.

The command and every real number of the telemetry are compared, each difference judged against the
peak of what it belongs to. The bound is 1e-12 of it, unless the law itself makes more of less: the
replay is repeated with inputs that are changed by one rounding, and where that moves an output so
far that thirty such roundings are more than 1e-12 of its peak, they are the bound. So a law with
high gains on differences of positions, or one that iterates, has a bound that follows from its own
numbers, and so has an error of micrometres that is the difference of positions of metres.
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

__all__ = ["Bound", "Compared", "Parity", "check_parity", "unmeasured_bound"]

EXACT = 1e-12
ROUNDINGS = 30.0
"""Roundings inside a step that may act together as much as one of every input."""

LOOSEST = 0.1
"""Of commands; beyond this the exported law is another law: in single precision some are."""

WHOLE = 1.0
"""Of telemetry: what a rounding moves by its whole peak, or makes no number, cannot be compared,
and a bound without end would say that it had been."""


@dataclasses.dataclass(frozen=True)
class Bound:
    """How far an exported output may be from JAX's.

    Parameters
    ----------
    relative
        Of its peak, for a command that of the command.
    reason
        Why it is not the usual 1e-12; empty where it is.
    """

    relative: float
    reason: str = ""


@dataclasses.dataclass(frozen=True)
class Compared:
    """One quantity of the telemetry over a replay.

    Parameters
    ----------
    name
        Of the output.
    difference
        Largest [its own unit].
    peak
        Largest value in JAX [its own unit].
    bound
        That it was judged by.
    """

    name: str
    difference: float
    peak: float
    bound: Bound

    @property
    def relative(self) -> float:
        """Largest difference over the peak."""
        return self.difference / self.peak if self.peak else self.difference

    @property
    def holds(self) -> bool:
        """Whether it is within its bound."""
        return self.relative <= self.bound.relative


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
        That commands were judged by.
    telemetry
        Its real numbers, compared likewise.
    stack
        What a call of the compiled law takes of the stack, libm apart [bytes]; None if the
        compiler did not say.
    """

    difference: float
    peak: float
    steps: int
    flipped: tuple[tuple[int, str, int, int], ...]
    bound: Bound
    telemetry: tuple[Compared, ...] = ()
    stack: int | None = None

    @property
    def relative(self) -> float:
        """Largest difference over the peak command."""
        return self.difference / self.peak if self.peak else self.difference

    @property
    def holds(self) -> bool:
        """Whether the commands are within the bound, and all telemetry within its own."""
        within = self.relative <= self.bound.relative
        return within and all(one.holds for one in self.telemetry)


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
    difference, peak = _largest(found["command"], wanted), _peak(wanted)
    flipped = [
        (k, field.name, int(theirs), int(ours))
        for field in generated.outputs
        if field.dtype == "int32"
        for k, theirs, ours in _unlike(loop.outputs[field.path], found[field.name])
    ]
    nudged = compiled.replay(_nudged(inputs, generated.precision))
    moved = _largest(nudged["command"], found["command"])
    bound = _bound(generated, "command", moved / peak if peak else moved, LOOSEST)
    telemetry = []
    for field in generated.outputs:
        if field.dtype == "int32" or field.name == "command":
            continue
        theirs, ours = np.asarray(loop.outputs[field.path]), found[field.name]
        top, away = _peak(theirs), _largest(nudged[field.name], ours)
        limit = _bound(generated, field.name, away / top if top else away, WHOLE)
        telemetry.append(Compared(field.name, _largest(ours, theirs), top, limit))
    return Parity(
        difference, peak, loop.n_steps, tuple(flipped), bound, tuple(telemetry), compiled.stack
    )


def _bound(generated: GeneratedC, name: str, moved: float, loosest: float) -> Bound:
    if ROUNDINGS * moved <= EXACT:
        return Bound(EXACT)
    why = "single precision: " if generated.precision == "single" else ""
    why += "the law iterates until it has converged, and " if generated.iterates else ""
    return Bound(
        min(ROUNDINGS * moved, loosest),
        f"{why}one rounding of its inputs moves the {name} by {moved:.2g} of the peak",
    )


def _largest(ours: NDArray[Any], theirs: NDArray[Any]) -> float:
    """Return the largest difference; what is a number on one side alone is infinitely far away."""
    if not theirs.size:
        return 0.0
    same = (ours == theirs) | (np.isnan(ours) & np.isnan(theirs))
    with np.errstate(invalid="ignore"):
        away = np.abs(ours - theirs)
    return float(np.max(np.where(same, 0.0, np.where(np.isfinite(away), away, np.inf))))


def _peak(values: NDArray[Any]) -> float:
    """Return the largest number there is."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


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
