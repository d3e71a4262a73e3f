"""Whether a loop in C does what the same loop does in JAX: every signal, and every decision.

Both are closed loops, so a difference of the last bit goes round: what comes back is multiplied by
the gains, and a stable loop forgets it. A *decision* that falls otherwise (a count of an encoder, a
status) is no rounding any more: from there on the runs are two, though each is right. Such
decisions are listed, and the difference is that of the rows before the first.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from contourlab.controllers.base import Controller
from contourlab.feedrate import Plan
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.recording import Recording
from contourlab.recordings.reference import Reference
from contourlab.simulation.engines import Engine
from contourlab.simulation.run import simulate

__all__ = ["EngineParity", "compare_engines", "parity_of_recordings"]

BOUND = 1e-12
"""Of the peak of a signal."""
SIGNALS = ("actual", "measured", "command")


@dataclasses.dataclass(frozen=True)
class EngineParity:
    """How two runs of one loop compare.

    Parameters
    ----------
    differences
        Largest difference of each signal over its peak, up to the first decision that fell
        otherwise.
    flipped
        Decisions that fell otherwise: row, signal, and the values of both.
    steps
        Rows of the shorter run.
    same_length
        Whether both ended at the same row.
    after
        Largest differences over the peak in the whole run.
    """

    differences: Mapping[str, float]
    flipped: tuple[tuple[int, str, float, float], ...]
    steps: int
    same_length: bool
    after: Mapping[str, float]

    @property
    def largest(self) -> float:
        """Largest of ``differences``."""
        return max(self.differences.values())

    @property
    def holds(self) -> bool:
        """Whether no decision differs and no signal by more than 1e-12 of its peak."""
        return self.same_length and not self.flipped and self.largest <= BOUND


def compare_engines(
    machine: Machine,
    controller: Controller,
    reference: Reference | Plan,
    *,
    disturbances: Sequence[Disturbance] | Disturbance = (),
    seed: int = 0,
    engine: str | Engine = "c",
) -> EngineParity:
    """Run one loop in JAX and in another engine and return how they compare.

    Parameters
    ----------
    machine, controller, reference, disturbances, seed
        As for ``simulate``.
    engine
        The other one.
    """
    runs = [
        simulate(
            machine, controller, reference, disturbances=disturbances, seed=seed, engine=one
        )
        for one in ("jax", engine)
    ]  # fmt: skip
    resolution = np.broadcast_to(np.asarray(machine.sensor.resolution), (machine.n_axes,))
    return parity_of_recordings(*runs, resolution=resolution)


def parity_of_recordings(one: Recording, other: Recording, *, resolution: Any) -> EngineParity:
    """Return how two recordings of one loop compare.

    Parameters
    ----------
    one, other
        Both; that of JAX first.
    resolution
        Of the encoders, shape (n_axes,) [m]; 0 where there is none.
    """
    steps = min(one.n_samples, other.n_samples)
    pairs = {
        str(name): (
            np.asarray(one.dataset[name])[:steps], np.asarray(other.dataset[name])[:steps]
        )
        for name in one.dataset.data_vars
        if "time" in one.dataset[name].dims
    }  # fmt: skip
    flipped: list[tuple[int, str, float, float]] = []
    for name, (a, b) in pairs.items():
        if a.dtype.kind in "iub":
            other_way = a != b
        elif name == "measured" and np.any(resolution > 0.0):
            other_way = (np.abs(a - b) > 0.5 * resolution) & (resolution > 0.0)
        else:
            continue
        for place in np.argwhere(other_way):
            at = tuple(place)
            flipped.append((int(place[0]), name, float(a[at]), float(b[at])))
    flipped.sort(key=lambda row: row[0])
    first = flipped[0][0] if flipped else steps
    return EngineParity(
        _differences(pairs, first), tuple(flipped), steps,
        one.n_samples == other.n_samples, _differences(pairs, steps),
    )  # fmt: skip


def _differences(pairs: Mapping[str, Any], rows: int) -> dict[str, float]:
    found = {}
    for name in SIGNALS:
        a, b = pairs[name]
        peak = float(np.nanmax(np.abs(a), initial=0.0))
        away = np.abs(a[:rows] - b[:rows])
        away = np.where(np.isnan(a[:rows]) & np.isnan(b[:rows]), 0.0, away)
        worst = float(np.max(np.where(np.isnan(away), np.inf, away), initial=0.0))
        found[name] = worst / peak if peak else worst
    return found
