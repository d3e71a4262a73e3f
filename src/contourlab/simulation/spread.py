"""How far the metrics of one controller on one machine spread when values vary."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.base import Controller
from contourlab.errors import RecordingError, SimulationError, choices
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.metrics import METRICS
from contourlab.recordings.reference import Reference
from contourlab.simulation.many import simulate_many

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Spread", "Statistic", "check_variable", "run_spread"]

LANES = 512
"""Samples that run side by side; more run one batch after the other, so that memory is bounded."""


@dataclass(frozen=True)
class Statistic:
    """One metric over all samples; a sample that diverged counts as infinitely bad."""

    median: float
    low: float
    """A share of 5 % of the samples is below it."""
    high: float
    """A share of 5 % of the samples is above it."""
    worst: float
    worst_sample: int
    """Which sample, from 0; the first of them if several diverged."""


@dataclass(frozen=True, eq=False)
class Spread:
    """The metrics of every sample of a variation, of one controller on one machine."""

    dataset: xr.Dataset
    """As ``simulate_many`` returns it, on the dimension ``lane``: metrics, varied values, seeds."""
    varied: tuple[str, ...]
    """Which of its variables are the varied values."""

    @property
    def n_samples(self) -> int:
        """How many samples were run."""
        return int(self.dataset.sizes["lane"])

    @property
    def n_diverged(self) -> int:
        """How many of them diverged."""
        return int(np.isfinite(self.dataset["diverged_at"]).sum())

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics that it holds."""
        return tuple(str(name) for name in self.dataset.data_vars if name in METRICS)

    def values(self, metric: str) -> NDArray[Any]:
        """Return a metric of every sample, (n_samples,) or (n_samples, n_axes); NaN if it diverged.

        Parameters
        ----------
        metric
            One of ``metrics``.

        Raises
        ------
        RecordingError
            There is no such metric.
        """
        if metric not in self.metrics:
            raise RecordingError(f"no metric {metric!r}; {choices(metric, self.metrics)}")
        return np.asarray(self.dataset[metric], float)

    def statistic(self, metric: str) -> Statistic | list[Statistic]:
        """Return median, 5 % and 95 % quantile and worst value of a metric; per axis for some.

        Quantiles are interpolated between samples, as NumPy's are by default.

        Parameters
        ----------
        metric
            One of ``metrics``.
        """
        values = self.values(metric)
        if values.ndim == 1:
            return _statistic(values)
        return [_statistic(column) for column in values.T]

    def sample(self, number: int) -> dict[str, Any]:
        """Return the varied values of one sample: a number, or a list with one per axis.

        Parameters
        ----------
        number
            Which, from 0.
        """
        if not 0 <= number < self.n_samples:
            raise RecordingError(f"sample must be within 0 to {self.n_samples - 1}, got {number}")
        return {path: np.asarray(self.dataset[path])[number].tolist() for path in self.varied}


def _statistic(values: NDArray[Any]) -> Statistic:
    ranked = np.where(np.isnan(values), np.inf, values)
    worst = int(np.argmax(ranked))
    ordered = np.sort(ranked)
    low, median, high = (_quantile(ordered, share) for share in (0.05, 0.5, 0.95))
    return Statistic(median, low, high, float(ranked[worst]), worst)


def _quantile(ordered: NDArray[Any], share: float) -> float:
    place = share * (len(ordered) - 1)
    below = math.floor(place)
    a, b = ordered[below], ordered[min(below + 1, len(ordered) - 1)]
    if place == below or a == b:  # inf - inf is no number
        return float(a)
    return float(a + (place - below) * (b - a))


def check_variable(controller: Controller, lanes: Mapping[str, NDArray[Any]]) -> None:
    """Raise SimulationError if a law's own values vary and it cannot be made anew in a batch.

    Parameters
    ----------
    controller
        The law.
    lanes
        As ``Variation.lanes`` returned them.
    """
    own = [path for path in lanes if path.startswith("controller")]
    if own and controller.needs.host_synthesis:
        raise SimulationError(
            f"vary: {own[0]}: {type(controller).__name__} is synthesised on the host and cannot "
            "be varied in a batch"
        )


def run_spread(
    machine: Machine,
    controller: Controller,
    reference: Reference,
    lanes: Mapping[str, NDArray[Any]],
    *,
    disturbances: Sequence[Disturbance] = (),
    progress: Callable[[float], None] | None = None,
) -> Spread:
    """Run every sample of a variation.

    Parameters
    ----------
    machine, controller, reference, disturbances
        As for ``simulate_many``.
    lanes
        As ``Variation.lanes`` returned them.
    progress
        Called with the fraction done.
    """
    import xarray as xr

    n = len(lanes["seed"])
    n_batches = -(-n // LANES)
    bounds = np.linspace(0, n, n_batches + 1).astype(int)
    parts = []
    for number, (a, b) in enumerate(pairwise(bounds)):

        def told(done: float, number: int = number) -> None:
            if progress is not None:
                progress((number + done) / n_batches)

        parts.append(
            simulate_many(
                machine, controller, reference, vary={k: v[a:b] for k, v in lanes.items()},
                disturbances=disturbances, progress=told,
            )
        )  # fmt: skip
    if progress is not None:
        progress(1.0)  # one that all samples left early too
    dataset = parts[0] if len(parts) == 1 else xr.concat(parts, dim="lane", data_vars="minimal")
    return Spread(dataset, tuple(path for path in lanes if path != "seed"))
