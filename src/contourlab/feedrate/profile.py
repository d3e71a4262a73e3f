"""A planned motion in arc length over time, between the samples too."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CubicProfile", "Profile"]

Values = NDArray[Any]


class Profile(abc.ABC):
    """Arc length over time, from the start of the contour."""

    time: Values
    """Instants between which the motion is smooth, ascending, shape (n,) [s]."""
    arc: Values
    """Arc length at each [m]."""
    duration: float
    """Time of arrival, dwells after it included [s]."""

    @abc.abstractmethod
    def at(self, time: Values) -> tuple[Values, Values, Values, Values]:
        """Return arc length, speed, acceleration and jerk at some instants, right-sided.

        Parameters
        ----------
        time
            Shape (n,) [s]; before the start and after the end the motion rests.
        """

    def time_at(self, arc: Values) -> Values:
        """Return the instant at which each arc length is reached, the last one where it is held.

        Parameters
        ----------
        arc
            Shape (n,) [m].
        """
        arc = np.asarray(arc, float)
        k = np.clip(np.searchsorted(self.arc, arc, side="right") - 1, 0, len(self.time) - 1)
        low = self.time[k]
        high = np.append(self.time[1:], self.time[-1])[k]
        guess = low
        for _ in range(60):
            here, speed, _, _ = self.at(guess)
            beyond = here > arc
            high = np.where(beyond, np.minimum(high, guess), high)
            low = np.where(beyond, low, np.maximum(low, guess))
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = guess - (here - arc) / speed
            inside = (newton >= low) & (newton <= high)
            following = np.where(inside, newton, 0.5 * (low + high))
            settled = np.abs(following - guess) <= 1e-15 * self.duration
            guess = following
            if settled.all():
                break
        return guess


@dataclass(frozen=True, eq=False)
class CubicProfile(Profile):
    """Pieces of constant jerk; interval k starts at instant k."""

    time: Values
    arc: Values
    speed: Values
    """At each instant [m/s]."""
    acceleration: Values
    """To the right of the instant [m/s²]."""
    jerk: Values
    """To the right of the instant [m/s³]."""
    duration: float

    def at(self, time: Values) -> tuple[Values, Values, Values, Values]:
        """Return arc length, speed, acceleration and jerk at some instants, right-sided.

        Parameters
        ----------
        time
            Shape (n,) [s]; before the start and after the end the motion rests.
        """
        time = np.asarray(time, float)
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 1)
        h = np.maximum(time - self.time[k], 0.0)
        v, a, j = self.speed[k], self.acceleration[k], self.jerk[k]
        arc = self.arc[k] + h * (v + h * (0.5 * a + h * j / 6.0))
        following = np.minimum(k + 1, len(self.time) - 1)
        return (
            np.minimum(arc, self.arc[following]),
            np.maximum(v + h * (a + 0.5 * h * j), 0.0),
            a + h * j,
            j,
        )
