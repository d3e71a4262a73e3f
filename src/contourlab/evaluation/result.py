"""What an evaluation found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from contourlab.evaluation.alignment import Alignment
from contourlab.evaluation.causes import Cause
from contourlab.evaluation.circles import CircularTest
from contourlab.evaluation.resolution import Resolution
from contourlab.evaluation.tracking import AxisTracking
from contourlab.logs.log import Log
from contourlab.recordings.metrics import MetricValue
from contourlab.recordings.recording import Recording

if TYPE_CHECKING:
    from contourlab.contours.part import Part

__all__ = ["Evaluation", "WorstPoint"]


@dataclass(frozen=True)
class WorstPoint:
    """A place where the contour error is large."""

    row: int
    """Sample of the log as it was judged."""
    time: float
    """[s]"""
    error: float
    """Contour error, with its sign in the plane [m]."""
    half_width: float
    """How far it may be off by the log's resolution [m]."""
    position: tuple[float, ...]
    """Of the machine [m]."""
    where: str
    """The part's line and text, or the place along the path."""
    cause: str
    """Name of the cause that does the most there; empty if causes were not found."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation:
    """A log judged: figures, what they are worth, where the error comes from."""

    log: Log
    recording: Recording
    """With ``contour_error``, ``contour_error_vector``, ``foot_parameter``, ``lag_error``."""
    metrics: dict[str, MetricValue]
    """By name, SI."""
    warnings: tuple[str, ...]
    causes: tuple[Cause, ...]
    """The largest first, the rest last; empty if the log holds no commanded position."""
    worst: tuple[WorstPoint, ...]
    resolution: Resolution
    circular: CircularTest | None = None
    """ISO 230-4, if the log holds a circle."""
    part: Part | None = None
    alignment: Alignment | None = None
    judged: Bool[np.ndarray, " n_samples"] = field(repr=False)
    piece: Int[np.ndarray, " n_samples"] = field(repr=False)
    foot: Float[np.ndarray, "n_samples n_axes"] = field(repr=False)
    """Nearest point of the path, in the machine's coordinates [m]."""
    rotary: tuple[AxisTracking, ...] = ()
    """How rotary axes follow, which are in no contour error."""
    options: dict[str, Any] = field(default_factory=dict)
    """How it was evaluated, by name."""

    @property
    def title(self) -> str:
        """What was evaluated."""
        against = "its commands" if self.part is None else self.part.source
        return f"{self.log.source} against {against}"
