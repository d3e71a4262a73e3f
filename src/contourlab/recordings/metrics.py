"""Every figure of merit, defined once.

All are of absolute values, in SI, over the whole record or a window of time. ``contour_error`` is
the exact one. A mean is over time; samples are equidistant, so it is the mean over samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import RecordingError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["METRICS", "Metric", "MetricValue", "evaluate_metric"]

MetricValue: TypeAlias = float | list[float]
Values: TypeAlias = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Metric:
    """One figure of merit: what it is, its unit, what it is computed from."""

    meaning: str
    unit: str
    requires: frozenset[str]
    compute: Callable[[Values], MetricValue]


def _rms(x: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _norm(x: NDArray[Any]) -> NDArray[Any]:
    return np.linalg.norm(x, axis=1)  # type: ignore[no-any-return]


def _estimate_error(v: Values) -> NDArray[Any]:
    # how far the estimated vector is from the exact one
    return _norm(v["contour_error_estimate"] - v["contour_error_vector"])


def _saturated(v: Values) -> NDArray[Any]:
    return np.any(np.abs(v["command"]) >= v["command_limit"] * (1.0 - 1e-12), axis=1)  # type: ignore[no-any-return]


def _metric(
    meaning: str, unit: str, requires: str, compute: Callable[[Values], MetricValue]
) -> Metric:
    return Metric(meaning, unit, frozenset(requires.split()), compute)


METRICS: dict[str, Metric] = {
    "contour_error_rms": _metric(
        "root mean square of the contour error", "m", "contour_error",
        lambda v: _rms(v["contour_error"]),
    ),
    "contour_error_max": _metric(
        "largest contour error", "m", "contour_error",
        lambda v: float(np.max(np.abs(v["contour_error"]))),
    ),
    "contour_error_mean": _metric(
        "time-averaged contour error", "m", "contour_error",
        lambda v: float(np.mean(np.abs(v["contour_error"]))),
    ),
    "tracking_error_rms": _metric(
        "root mean square of the tracking error's length", "m", "tracking_error",
        lambda v: _rms(_norm(v["tracking_error"])),
    ),
    "tracking_error_max": _metric(
        "largest length of the tracking error", "m", "tracking_error",
        lambda v: float(np.max(_norm(v["tracking_error"]))),
    ),
    "command_rms": _metric(
        "root mean square of the command, per axis", "command", "command",
        lambda v: [_rms(column) for column in v["command"].T],
    ),
    "command_max": _metric(
        "largest command, per axis", "command", "command",
        lambda v: [float(np.max(np.abs(column))) for column in v["command"].T],
    ),
    "saturation_time": _metric(
        "time with a command at its limit on any axis", "s", "command command_limit time",
        lambda v: float(np.mean(_saturated(v))) * len(v["time"]) * _step(v["time"]),
    ),
    "cycle_time": _metric(
        "time from first sample to last", "s", "time",
        lambda v: float(v["time"][-1] - v["time"][0]),
    ),
    "estimate_error_rms": _metric(
        "root mean square of the estimated minus the exact contour error vector", "m",
        "contour_error_estimate contour_error_vector", lambda v: _rms(_estimate_error(v)),
    ),
    "estimate_error_max": _metric(
        "largest difference of the estimated and the exact contour error vector", "m",
        "contour_error_estimate contour_error_vector",
        lambda v: float(np.max(_estimate_error(v))),
    ),
}  # fmt: skip
"""Metrics by name."""


def _step(time: NDArray[Any]) -> float:
    return float(time[1] - time[0]) if len(time) > 1 else 0.0


def evaluate_metric(
    dataset: xr.Dataset, name: str, window: tuple[float, float] | None = None
) -> MetricValue:
    """Return one figure of merit of a recording's dataset.

    A run that diverged has no figures: NaN.

    Parameters
    ----------
    dataset
        As in a ``Recording``.
    name
        A key of :data:`METRICS`.
    window
        First and last time [s]; the whole record if None.

    Raises
    ------
    RecordingError
        The dataset lacks what the metric is computed from.
    """
    metric = METRICS[name]
    missing = sorted(metric.requires - set(map(str, dataset.variables)))
    if missing:
        raise RecordingError(f"{name} needs {', '.join(missing)}, which the recording lacks")
    keep = slice(None)
    if window is not None:
        time = np.asarray(dataset["time"])
        keep = slice(
            int(np.searchsorted(time, window[0])), int(np.searchsorted(time, window[1], "right"))
        )
    values = {}
    for key in metric.requires:
        variable = dataset[key]
        values[key] = (
            np.asarray(variable)[keep] if "time" in variable.dims else np.asarray(variable)
        )
    result = metric.compute(values)
    if "diverged_at" in dataset.attrs:
        return [float("nan")] * len(result) if isinstance(result, list) else float("nan")
    return result
