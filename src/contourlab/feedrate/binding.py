"""Which limit holds a planned motion back, place by place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.path import Path
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives

if TYPE_CHECKING:
    from contourlab.feedrate.plan import Plan

__all__ = ["NEAR", "Binding", "binding_limits"]

Values = NDArray[Any]

NEAR = 0.9
"""A limit binds where this share of it is taken, or more."""
_POINTS = 20_000


@dataclass(frozen=True, eq=False, kw_only=True)
class Binding:
    """Cells of time, all of one length, and the limit that binds in each."""

    names: tuple[str, ...]
    """``"feed"``, ``"velocity X"``, ``"acceleration X"``, ``"jerk X"`` and so on, one of each kind
    for each axis; then ``"rest"`` at stops and ``"none"``, where no limit is near."""
    time: Values
    """Middle of each cell, shape (n,) [s]."""
    arc: Values
    """Arc length there [m]."""
    limit: Values
    """Index of the name of the limit that binds in each cell, shape (n,)."""
    share: Values
    """Largest share of a limit that is taken there."""

    def shares(self) -> Mapping[str, float]:
        """Return the share of the cycle time for which each limit binds, largest first."""
        count = np.bincount(self.limit, minlength=len(self.names)) / len(self.limit)
        order = np.argsort(-count, kind="stable")
        return {self.names[k]: float(count[k]) for k in order if count[k] > 0.0}

    def stretches(self) -> list[tuple[float, float, str]]:
        """Return consecutive stretches of arc length [m] and the name of what binds there."""
        moving = self.limit != self.names.index("rest")
        arc, limit = self.arc[moving], self.limit[moving]
        if not len(arc):
            return []
        starts = np.concatenate([[0], np.flatnonzero(np.diff(limit)) + 1])
        middle = 0.5 * (arc[starts[1:]] + arc[starts[1:] - 1])
        edges = np.concatenate([[0.0], middle, [self.arc[-1]]])
        return [
            (float(a), float(b), self.names[k])
            for a, b, k in zip(edges[:-1], edges[1:], limit[starts].tolist(), strict=True)
        ]


def binding_limits(plan: Plan, *, points: int = _POINTS) -> Binding:
    """Return which limit a plan comes nearest to, place by place.

    Of all limits the one is named of which the largest share is taken, if that is at least
    ``NEAR``. Elsewhere the motion speeds up or slows down for a place nearby.

    Parameters
    ----------
    plan
        From :func:`contourlab.feedrate.plan_feed`.
    points
        Count of cells at most; short plans have four to a sample.
    """
    reference, profile = plan.reference, plan.profile
    contour = reference.contour
    n = int(min(points, 4 * reference.n_samples))
    time = profile.duration * (np.arange(n) + 0.5) / n
    arc, v, a, j = (x[:, None] for x in profile.at(time))
    table = ArcLength(contour)
    r = arc_derivatives(contour_derivatives(contour, table.parameter_at(arc[:, 0])))
    shares = [
        (r[:, 0] * v) / np.asarray(plan.limits.velocity),
        (r[:, 1] * v**2 + r[:, 0] * a) / np.asarray(plan.limits.acceleration),
        (r[:, 2] * v**3 + 3.0 * r[:, 1] * v * a + r[:, 0] * j) / np.asarray(plan.limits.jerk),
    ]
    piece = np.zeros(n, int)
    if isinstance(contour, Path):
        breaks = np.asarray(contour.breaks, float)
        piece = np.searchsorted(breaks - breaks[0], arc[:, 0], side="right") - 1
        piece = np.clip(piece, 0, contour.n_pieces - 1)
    every = np.abs(np.concatenate([v / plan.feed[piece][:, None], *shares], axis=1))
    axes = plan.axes
    kinds = ("velocity", "acceleration", "jerk")
    names = ("feed", *(f"{kind} {axis}" for kind in kinds for axis in axes), "rest", "none")
    best = every.argmax(axis=1)
    largest = every[np.arange(n), best]
    limit = np.where(largest >= NEAR, best, len(names) - 1)
    limit = np.where(v[:, 0] <= 0.0, len(names) - 2, limit)
    return Binding(names=names, time=time, arc=arc[:, 0], limit=limit, share=largest)
