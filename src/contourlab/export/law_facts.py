"""What a target must know of a law beside its C code: what it commands, and what it asks for."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np

from contourlab.controllers.base import BoundController, Controller, Needs

__all__ = ["LawFacts"]


@dataclasses.dataclass(frozen=True)
class LawFacts:
    """What a target must know of a law.

    Parameters
    ----------
    name
        Of the law, for people.
    n_axes
        Number of axes.
    needs
        What the law asks of the loop.
    command_limit
        Per axis, in SI; infinite where the law has none.
    statuses
        What each status number means.
    """

    name: str
    n_axes: int
    needs: Needs
    command_limit: tuple[float, ...]
    statuses: tuple[str, ...]

    @staticmethod
    def of(controller: Controller, bound: BoundController) -> LawFacts:
        """Return the facts of a law.

        Parameters
        ----------
        controller
            Its configuration.
        bound
            The same, bound.
        """
        n = controller.n_axes
        limits = next(_named(bound, "command_limit"), np.inf)
        return LawFacts(
            name=type(controller).__name__,
            n_axes=n,
            needs=controller.needs,
            command_limit=tuple(np.broadcast_to(np.asarray(limits, float), (n,)).tolist()),
            statuses=tuple(bound.statuses),
        )


def _named(root: Any, name: str) -> Iterator[Any]:
    """Yield every field of that name in a tree of configurations, the outermost first."""
    queue = deque([root])
    while queue:
        item = queue.popleft()
        if not dataclasses.is_dataclass(item):
            continue
        for field in dataclasses.fields(item):
            value = getattr(item, field.name)
            if field.name == name and value is not None:
                yield value
            queue.append(value)
