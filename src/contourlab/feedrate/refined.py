"""A plan of which some stretches run at another pace, in closed form between the samples too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly, make_interp_spline

from contourlab.feedrate.profile import Profile
from contourlab.feedrate.retiming import Retiming

__all__ = ["OwnMotion", "RefinedProfile"]

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class OwnMotion:
    """Arc length over own time: pieces of degree 5, four derivatives continuous in a stretch."""

    start: Values
    """Own time at the start of each piece, ascending, shape (n,) [s]."""
    coefficient: Values
    """From the fifth power of the time in the piece down to the constant, shape (6, n)."""

    @staticmethod
    def through(time: Values, arc: Values, start: float = 0.0) -> OwnMotion:
        """Return the motion of one stretch: at rest at both ends, through the given points.

        Parameters
        ----------
        time
            Own time from 0, ascending, shape (n,) [s].
        arc
            Shape (n,) [m].
        start
            Own time at its start [s].
        """
        rest = [(1, 0.0), (2, 0.0)]
        pieces = PPoly.from_spline(make_interp_spline(time, arc, k=5, bc_type=(rest, rest)))
        keep = np.diff(pieces.x) > 0.0  # the knots at both ends are repeated
        return OwnMotion(start + pieces.x[:-1][keep], pieces.c[:, keep])

    @staticmethod
    def join(rows: Sequence[OwnMotion]) -> OwnMotion:
        """Return several stretches in one.

        Parameters
        ----------
        rows
            In ascending order.
        """
        return OwnMotion(
            np.concatenate([row.start for row in rows]),
            np.concatenate([row.coefficient for row in rows], axis=1),
        )

    def at(self, u: Values) -> tuple[Values, Values, Values, Values]:
        """Return arc length and its first three derivatives over own time.

        Parameters
        ----------
        u
            Shape (m,) [s].
        """
        k = np.clip(np.searchsorted(self.start, u, side="right") - 1, 0, len(self.start) - 1)
        h = u - self.start[k]
        c5, c4, c3, c2, c1, c0 = self.coefficient[:, k]
        return (
            c0 + h * (c1 + h * (c2 + h * (c3 + h * (c4 + h * c5)))),
            c1 + h * (2.0 * c2 + h * (3.0 * c3 + h * (4.0 * c4 + h * 5.0 * c5))),
            2.0 * c2 + h * (6.0 * c3 + h * (12.0 * c4 + h * 20.0 * c5)),
            6.0 * c3 + h * (24.0 * c4 + h * 60.0 * c5),
        )


@dataclass(frozen=True, eq=False)
class RefinedProfile(Profile):
    """A first plan, and the stretches of it that another motion replaces.

    With s = S(u) and c = u'² the motion is v = S' √c, a = S'' c + S' c'/2 and
    j = √c (S''' c + 3/2 S'' c' + 1/2 S' c'').
    """

    time: Values
    arc: Values
    duration: float
    first: Profile
    """The first plan."""
    begins: Values
    """Instant at which each stretch begins, shape (n,) [s]."""
    arrives: Values
    """Instant at which each arrives [s]."""
    shift: Values
    """By how much each begins later than in the first plan [s]; negative for earlier."""
    edges: Values
    """Arc lengths of the stops, shape (n + 1,) [m]."""
    refined: Values
    """Whether each stretch is replaced, shape (n,)."""
    own: OwnMotion
    pace: Retiming

    def at(self, time: Values) -> tuple[Values, Values, Values, Values]:
        """Return arc length, speed, acceleration and jerk at some instants, right-sided.

        Parameters
        ----------
        time
            Shape (n,) [s]; before the start and after the end the motion rests.
        """
        time = np.asarray(time, float)
        k = np.clip(np.searchsorted(self.begins, time, side="right") - 1, 0, len(self.begins) - 1)
        s, v, a, j = self.first.at(time - self.shift[k])
        other = self.refined[k]
        if other.any():
            u, c, d, e = self.pace.at(time[other])
            s0, s1, s2, s3 = self.own.at(u)
            w = np.sqrt(c)
            s, v, a, j = (x.copy() for x in (s, v, a, j))
            s[other], v[other], a[other] = s0, np.maximum(s1 * w, 0.0), s2 * c + 0.5 * s1 * d
            j[other] = w * (s3 * c + 1.5 * s2 * d + 0.5 * s1 * e)
        there = time >= self.arrives[k]
        s = np.clip(s, self.edges[k], self.edges[k + 1])
        s = np.where(there, self.edges[k + 1], np.where(time <= self.begins[k], self.edges[k], s))
        resting = there | (time <= self.begins[k])
        v, a = np.where(resting, 0.0, v), np.where(resting, 0.0, a)
        return s, v, a, np.where(there | (time < self.begins[k]), 0.0, j)
