"""A measured log, in SI, with all that is known about how it was understood."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from contourlab.recordings.recording import Recording

__all__ = ["ColumnUse", "Log"]


@dataclass(frozen=True)
class ColumnUse:
    """What a column of the file was taken for."""

    role: str
    """``time``, ``commanded``, ``actual`` or ``command``."""
    axis: str
    """Empty for time."""
    column: str
    unit: str
    column_stated: bool
    """By the user or the format; else guessed from its name."""
    unit_stated: bool
    """By the user or the file; else guessed from the size of the numbers."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Log:
    """Positions over time, as a controller or an instrument recorded them."""

    source: str
    """Name of the file."""
    format: str
    axes: tuple[str, ...]
    time: Float[np.ndarray, " n_samples"] = field(repr=False)
    """[s], rising; the number of the sample if the log has no time."""
    sample_time: float
    """Median distance of neighbours [s]; 1 if the log has no time."""
    timed: bool
    """Whether time is known."""
    commanded: Float[np.ndarray, "n_samples n_axes"] | None = field(repr=False)
    """[m], or [rad] if ``dimension`` is angle; None if it was not recorded."""
    actual: Float[np.ndarray, "n_samples n_axes"] = field(repr=False)
    """[m] or [rad]."""
    command: Float[np.ndarray, "n_samples n_axes"] | None = field(default=None, repr=False)
    """What the drives were told, in ``command_unit``; None if it was not recorded."""
    command_unit: str = ""
    dimension: str = "length"
    """Of the positions: ``length`` or ``angle``."""
    scale: float
    """Size of the file's unit of position [m or rad]."""
    row: Int[np.ndarray, " n_samples"] = field(repr=False)
    """Number of the sample in the file, from 0; what was left out makes it jump."""
    columns: tuple[ColumnUse, ...] = ()
    n_missing: int = 0
    """Samples that were left out because a position was missing."""
    n_repeated: int = 0
    """Samples that were left out because their instant was there already."""
    lost_after: Int[np.ndarray, " n_lost"] = field(
        default_factory=lambda: np.zeros(0, int), repr=False
    )
    """Samples after which the log says that some were lost."""
    rotary: Log | None = None
    """Rotary axes of a log that has linear ones too: what is above is then of the linear ones."""
    warnings: tuple[str, ...] = ()
    """What was guessed or left out, in sentences."""
    notes: tuple[str, ...] = ()
    """How the file was understood."""

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return len(self.axes)

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])

    def recording(self) -> Recording:
        """Return the log as a recording: ``reference``, ``measured``, ``actual``, ``command``.

        ``actual`` is what was measured: a log knows no other truth.
        """
        import xarray as xr

        unit = {"units": "m" if self.dimension == "length" else "rad"}
        rows = ("time", "axis")
        variables: dict[str, Any] = {
            "actual": (rows, self.actual, unit),
            "measured": (rows, self.actual, unit),
        }
        if self.commanded is not None:
            variables["reference"] = (rows, self.commanded, unit)
            variables["tracking_error"] = (rows, self.commanded - self.actual, unit)
        if self.command is not None:
            kind = {"V": "voltage", "N": "force", "m/s": "velocity"}.get(self.command_unit)
            attributes = {"units": self.command_unit} | ({"kind": kind} if kind else {})
            variables["command"] = (rows, self.command, attributes)
        import contourlab

        return Recording(
            xr.Dataset(
                variables,
                coords={
                    "time": ("time", self.time, {"units": "s"}),
                    "axis": np.asarray(self.axes, dtype=str),
                },
                attrs={
                    "contourlab": contourlab.__version__,
                    "controller": self.source,
                    "sample_time": self.sample_time,
                    "warnings": json.dumps(list(self.warnings), ensure_ascii=False),
                },
            )
        )
