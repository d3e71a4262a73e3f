"""How far the metrics of one controller on one machine spread when values vary."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace_at, resolve
from contourlab.controllers.base import Controller
from contourlab.errors import ConfigurationError, RecordingError, SimulationError, choices
from contourlab.machines import Disturbance, Machine
from contourlab.recordings.metrics import METRICS
from contourlab.recordings.reference import Reference
from contourlab.simulation.many import simulate_many
from contourlab.simulation.variation import varied

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Spread",
    "Statistic",
    "check_lanes",
    "check_variable",
    "full_path",
    "refuse_ambiguous",
    "run_spread",
]

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


def full_path(loop: Mapping[str, Any], path: str) -> str:
    """Return the full path of a value that varies.

    Parameters
    ----------
    loop
        ``machine``, ``controller`` and ``disturbances``.
    path
        Without the name of a machine or controller; may leave levels out.

    Raises
    ------
    SimulationError
        It names a limit of the axes, or a disturbance that there is not.
    ConfigurationError
        It names nothing, or several things.
    """
    head, _, rest = path.partition(".")
    first = rest.partition(".")[0]
    if head == "disturbances":
        count = len(loop["disturbances"])
        if count == 0:
            raise SimulationError("there is no disturbance here")
        if first.isdigit() and int(first) >= count:
            only = "disturbance is 0" if count == 1 else f"disturbances are 0 to {count - 1}"
            raise SimulationError(f"there is no disturbance {first}; the only {only}")
    full = path if (head, first) == ("machine", "limits") else resolve(loop, path)
    if f"{full}.".startswith("machine.limits."):
        raise SimulationError("the motion is planned once for all samples; limits cannot vary")
    return full


def refuse_ambiguous(loop: Mapping[str, Any], path: str) -> None:
    """Refuse a path that begins with a label, if it names a field of every loop just as well.

    Parameters
    ----------
    loop
        ``machine``, ``controller`` and ``disturbances``.
    path
        As a user wrote it, with the label.

    Raises
    ------
    SimulationError
        It has two readings; says both.
    """
    try:
        full = resolve(loop, path)
    except ConfigurationError:
        return
    head, _, rest = path.partition(".")
    raise SimulationError(
        f"vary: {path} may mean a value of the {head} labelled like its field "
        f"{rest.partition('.')[0]!r}, or {full} of every {head}; rename that {head}"
    )


def check_lanes(loop: Mapping[str, Any], lanes: Mapping[str, NDArray[Any]]) -> None:
    """Raise an error for the first sample that is out of bounds, with its values.

    Parameters
    ----------
    loop
        ``machine``, ``controller`` and ``disturbances``.
    lanes
        Values by path, the first dimension being the sample; ``seed`` is passed over.

    Raises
    ------
    ConfigurationError
        A sample is out of bounds; names its number, from 0, and those values that make it so.
    SimulationError
        Values that do not have the shape of the field.
    """
    values = {path: np.asarray(value) for path, value in lanes.items() if path != "seed"}

    def refused(until: int) -> ConfigurationError | None:
        try:
            varied(dict(loop), {path: value[:until] for path, value in values.items()})
        except ConfigurationError as error:
            return error
        return None

    n = min((len(value) for value in values.values()), default=0)
    whole = refused(n)
    if whole is None:
        return
    good, bad = 0, n  # so many samples pass; so many do not
    while bad - good > 1:
        middle = (good + bad) // 2
        good, bad = (good, middle) if refused(middle) is not None else (middle, bad)
    number = bad - 1
    sample = {path: np.asarray(value[number]) for path, value in values.items()}
    error = _refused_sample(loop, sample)
    for path in values:  # leave those that matter
        fewer = {name: value for name, value in sample.items() if name != path}
        without = _refused_sample(loop, fewer)
        if without is not None:
            sample, error = fewer, without
    message = " ".join(str(error or whole).split())  # arrays are printed over several lines
    shown = ", ".join(f"{path} = {_short(value)}" for path, value in sample.items())
    raise ConfigurationError(f"{message} (sample {number} of 0 to {n - 1}: {shown})") from whole


def _refused_sample(
    loop: Mapping[str, Any], sample: Mapping[str, NDArray[Any]]
) -> ConfigurationError | None:
    """Return why one sample is out of bounds, None if it is not; without a batch dimension."""
    single: Any = dict(loop)
    for path, value in sample.items():
        full = resolve(loop, path)
        field: Any = loop
        for name in full.split("."):
            if isinstance(field, Mapping):
                field = field[name]
            else:
                field = field[int(name)] if isinstance(field, tuple) else getattr(field, name)
        aligned = value.astype(float).reshape(*value.shape, *[1] * (np.ndim(field) - value.ndim))
        try:
            shaped = np.broadcast_to(aligned, np.shape(field)) if np.ndim(field) else aligned
            single = replace_at(single, full, np.array(shaped))
        except ConfigurationError as error:
            return error
    return None


def _short(value: NDArray[Any]) -> str:
    numbers = [f"{number:.6g}" for number in value.flat]
    if value.ndim == 0:
        return numbers[0]
    return f"[{', '.join(numbers[:8])}{', ...' if len(numbers) > 8 else ''}]"


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
