"""How a rotary axis follows its command: in its own unit, and in no contour error.

A contour error is a length at the tool. What an angle does there is told by the kinematic chain
(where the axes of rotation lie and where the tool is), which is not in a log. So a rotary axis has
a tracking error, an rms of it, and the lag T of

    r - y = a + T ṙ + c sign(ṙ)                                                          (1)

by least squares over the samples in motion: offset, lag, and what friction leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.evaluation.stretches import find_breaks, stretches
from contourlab.logs.log import Log

__all__ = ["AxisTracking", "track_axes"]

LEAST = 20
"""Samples in motion from which (1) is fitted."""
VARIED = 0.1
"""A speed of which a and c cannot make up less than this share does not tell T."""
TOLD = 0.5
"""Share of the error's spread that (1) must explain for its T to be a lag."""

Values = NDArray[Any]


@dataclass(frozen=True)
class AxisTracking:
    """How one axis follows its command."""

    axis: str
    rms: float
    """Of the tracking error [rad]."""
    max: float
    """Largest tracking error [rad]."""
    half_width: float
    """How far a tracking error may be off by the grid of the log [rad]."""
    lag: float
    """T of (1) [s]; NaN where the motion does not tell it."""
    unit: str
    """As the log writes it: ``deg`` or ``rad``."""

    def json(self) -> dict[str, Any]:
        """Return it for JSON: SI, None for what is not known."""
        return {
            "axis": self.axis, "rms": self.rms, "max": self.max, "half_width": self.half_width,
            "lag": self.lag if np.isfinite(self.lag) else None, "unit": self.unit,
        }  # fmt: skip

    def in_words(self) -> str:
        """Return what the axis does in words, in its own unit."""
        size = np.pi / 180.0 if self.unit == "deg" else 1.0
        said = f"{self.rms / size:.4g} {self.unit} rms, {self.max / size:.4g} {self.unit} at most"
        if self.half_width > 0.0:
            said += f" (± {self.half_width / size:.2g} by the grid)"
        lag = f"lag {1e3 * self.lag:.4g} ms" if np.isfinite(self.lag) else "its lag is not told"
        return f"{said}, {lag}"


def track_axes(log: Log) -> tuple[AxisTracking, ...]:
    """Return how every axis of a log of angles follows its command; empty without commands.

    Parameters
    ----------
    log
        Angles; full turns between command and actual do not count.
    """
    if log.commanded is None:
        return ()
    from contourlab.evaluation.grid import grid_steps

    unit = next((use.unit for use in log.columns if use.role == "actual"), "rad")
    parts = stretches(log.n_samples, find_breaks(log).gaps)
    turn = 2.0 * np.pi
    found = []
    for axis, r, y in zip(log.axes, log.commanded.T, log.actual.T, strict=True):
        error = (r - y) - turn * np.round((r - y) / turn)
        steps = sum(float(grid_steps(column / log.scale).max()) for column in (r, y)) * log.scale
        found.append(
            AxisTracking(
                axis, float(np.sqrt(np.mean(error**2))), float(np.abs(error).max()), 0.5 * steps,
                _lag(np.unwrap(r), error, log, parts), unit,
            )
        )  # fmt: skip
    return tuple(found)


def _lag(commanded: Values, error: Values, log: Log, parts: list[slice]) -> float:
    """Return T of (1), NaN where it is not told."""
    speed = np.zeros_like(commanded)
    for at in parts:
        if at.stop - at.start > 2:
            speed[at] = np.gradient(commanded[at], log.time[at])
    moves = np.abs(speed) > 1e-3 * np.abs(speed).max()
    if moves.sum() < LEAST or not log.timed:
        return float("nan")
    v, e = speed[moves], error[moves]
    columns = [np.ones_like(v), v] + ([np.sign(v)] if np.ptp(np.sign(v)) else [])
    others = np.column_stack([columns[0], *columns[2:]])
    own = v - others @ np.linalg.lstsq(others, v, rcond=None)[0]
    if np.linalg.norm(own) < VARIED * np.linalg.norm(v):
        return float("nan")
    matrix = np.column_stack(columns)
    solution = np.linalg.lstsq(matrix, e, rcond=None)[0]
    left = e - matrix @ solution
    if float(np.sum(left**2)) > (1.0 - TOLD) * float(np.sum((e - e.mean()) ** 2)):
        return float("nan")
    return float(solution[1])
