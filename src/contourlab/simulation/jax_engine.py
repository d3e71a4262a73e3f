"""The loop as JAX compiles it: chunks of ``lax.scan``."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.controllers.base import BoundController, Needs
from contourlab.machines import BoundMachine
from contourlab.simulation.engines import ClosedLoop, Outcome
from contourlab.simulation.loop import (
    Carry,
    Rows,
    chunk_size,
    first_carry,
    geometry_rows,
    outputs_of,
    run_chunk,
    split,
)

__all__ = ["JaxEngine", "advance", "start"]


class JaxEngine:
    """The engine ``"jax"``."""

    name = "jax"

    def run(self, loop: ClosedLoop, told: Callable[[float], None]) -> Outcome:
        """Return what happened until the run was over; an interrupt is heard between chunks.

        Parameters
        ----------
        loop
            What to run.
        told
            Called with the fraction done.
        """
        contour, needs = loop.reference.contour, loop.needs
        size = chunk_size(loop.reference.n_samples)
        carry: Carry | None = None
        parts: list[dict[str, NDArray[Any]]] = []
        for points in split(loop.reference, size, needs.preview, loop.length):
            if carry is None:
                carry = start(loop.machine, loop.law, contour, points, loop.key, needs)
            carry, out = advance(
                loop.machine, loop.law, contour, loop.disturbances, carry, points,
                loop.reference.sample_time, loop.reach, needs, size,
            )  # fmt: skip
            parts.append(outputs_of(out))
            told(min(1.0, len(parts) * size / loop.length))
            if int(carry.diverged_step) >= 0 or int(carry.finished_step) >= 0:
                break
        assert carry is not None
        values = {
            key: np.concatenate([part[key] for part in parts])[: loop.length] for key in parts[0]
        }
        return Outcome(values, int(carry.diverged_step), int(carry.finished_step))


@functools.partial(jax.jit, static_argnames=("needs",))
def start(
    machine: BoundMachine, law: BoundController, contour: Contour, points: Any, key: Any,
    needs: Needs,
) -> Carry:  # fmt: skip
    """Return the carry before the first step.

    Parameters
    ----------
    machine, law, contour
        Bound machine and law, and the path.
    points
        The first chunk of the reference.
    key
        Of the run's random numbers.
    needs
        Of the law; static.
    """
    geometry = geometry_rows(contour, points.parameter[:1], needs.derivatives)
    return first_carry(machine, law, Rows(points, geometry), key, needs)


@functools.partial(jax.jit, static_argnames=("needs", "n_steps"))
def advance(
    machine: BoundMachine, law: BoundController, contour: Contour, disturbances: Any, carry: Carry,
    points: Any, sample_time: Any, reach: Any, needs: Needs, n_steps: int,
) -> tuple[Carry, Any]:  # fmt: skip
    """Return the carry after a chunk, and what happened in it.

    Parameters
    ----------
    machine, law, contour, disturbances
        Bound machine and law, the path, and what disturbs.
    carry
        From the chunk before.
    points
        The chunk of the reference.
    sample_time, reach
        Both as for ``run_chunk``.
    needs, n_steps
        Likewise; static.
    """
    geometry = geometry_rows(contour, points.parameter[:n_steps], needs.derivatives)
    return run_chunk(
        machine, law, disturbances, carry, Rows(points, geometry), sample_time, reach,
        needs=needs, n_steps=n_steps, freeze=False,
    )  # fmt: skip
