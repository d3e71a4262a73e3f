"""What each axis can do, and feeds as people write them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from contourlab.configuration import Configuration, real
from contourlab.errors import ConfigurationError, FeedError
from contourlab.typing import Array
from contourlab.units import parse_quantity

__all__ = ["AxisLimits", "metres_per_second", "positive"]


class AxisLimits(Configuration):
    """Largest velocity, acceleration and jerk of each axis.

    Parameters
    ----------
    velocity
        One number for all axes or shape (n_axes,), > 0 [m/s].
    acceleration
        Likewise [m/s²].
    jerk
        Likewise [m/s³].

    Raises
    ------
    ConfigurationError
        A limit that is not > 0 or not finite; arrays of different lengths.
    """

    velocity: Float[Array, "*axes"] = real(unit="m/s", above=0.0, ndim=1)
    acceleration: Float[Array, "*axes"] = real(unit="m/s^2", above=0.0, ndim=1)
    jerk: Float[Array, "*axes"] = real(unit="m/s^3", above=0.0, ndim=1)

    def check(self) -> None:
        """Raise ConfigurationError unless the arrays that are given per axis agree."""
        shapes = [np.shape(x) for x in (self.velocity, self.acceleration, self.jerk)]
        if any(len(shape) > 1 for shape in shapes):
            raise ConfigurationError(f"limits must be numbers or one per axis, got {shapes}")
        lengths = {shape[0] for shape in shapes if shape}
        if len(lengths) > 1:
            raise ConfigurationError(
                f"velocity, acceleration and jerk are for {sorted(lengths)} axes: "
                "give one number, or as many as there are axes"
            )

    def for_axes(self, n_axes: int) -> AxisLimits:
        """Return the limits with one number per axis.

        Parameters
        ----------
        n_axes
            Count of axes.

        Raises
        ------
        FeedError
            The limits are for another number of axes.
        """
        values = {}
        for name in ("velocity", "acceleration", "jerk"):
            value = np.asarray(getattr(self, name))
            if value.ndim and value.shape != (n_axes,):
                raise FeedError(
                    f"limits: {name} is given for {value.shape[0]} axes, "
                    f"the contour has {n_axes}: give one number, or {n_axes}"
                )
            values[name] = np.broadcast_to(value, (n_axes,)).copy()
        return AxisLimits(**values)


def metres_per_second(value: Any, name: str) -> float:
    """Return a speed in m/s from a number in m/s or a text with its unit.

    Parameters
    ----------
    value
        Such as ``0.05`` or ``"3000 mm/min"``.
    name
        What is being read, for the message.

    Raises
    ------
    FeedError
        Not a number, not finite, or not > 0.
    UnitError
        A text without a unit of velocity.
    """
    speed = parse_quantity(value, "velocity", name) if isinstance(value, str) else value
    return positive(speed, name, "m/s")


def positive(value: Any, name: str, unit: str) -> float:
    """Return a number that must be finite and > 0.

    Parameters
    ----------
    value
        What was given.
    name, unit
        For the message.

    Raises
    ------
    FeedError
        Not a number, not finite, or not > 0.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise FeedError(f"{name} must be a number > 0 {unit}, got {value!r}") from None
    if not (math.isfinite(number) and number > 0):
        raise FeedError(f"{name} must be > 0 {unit} and finite, got {number:g}")
    return number


LARGEST_RECORD = 20_000_000
"""Samples of a reference at most: some 3 GB for two axes."""


def sample_count(samples: float, sample_time: float) -> int:
    """Return a number of samples that memory can hold.

    Parameters
    ----------
    samples
        As many as the motion takes.
    sample_time
        [s], for the message.

    Raises
    ------
    FeedError
        More than :data:`LARGEST_RECORD`.
    """
    if not samples <= LARGEST_RECORD:
        raise FeedError(
            f"the motion takes {samples:.3g} samples of {sample_time:g} s, more than "
            f"{LARGEST_RECORD}; take a longer sample_time, or a shorter part or duration"
        )
    return int(samples)
