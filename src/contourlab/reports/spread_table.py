"""The spread of a comparison under variation: a table, and what programs read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from contourlab.reports.wording import NONE, significant
from contourlab.units import to_um

if TYPE_CHECKING:
    from contourlab.simulation.comparison import Comparison
    from contourlab.simulation.draws import Change, Variation
    from contourlab.simulation.spread import Spread, Statistic

__all__ = ["SPREAD_METRICS", "SpreadRow", "change_words", "spread_json", "spread_rows",
           "spread_sentences", "variation_json"]  # fmt: skip

SPREAD_METRICS = (
    ("contour_error_rms", "contour error, rms"),
    ("contour_error_max", "contour error, max"),
    ("tracking_error_rms", "tracking error, rms"),
)
"""The metrics of the table, all lengths."""


@dataclass(frozen=True)
class SpreadEntry:
    """One metric of one run, as text in µm."""

    median: str
    low: str
    high: str
    worst: str
    best: bool
    """Whether it has the least 95 % value of the controllers on its machine."""

    @property
    def short(self) -> str:
        """Median, and 5 to 95 % in brackets."""
        return f"{self.median} [{self.low} … {self.high}]"


@dataclass(frozen=True)
class SpreadRow:
    """One run."""

    name: str
    entries: tuple[SpreadEntry, ...]
    """In the order of :data:`SPREAD_METRICS`."""
    n_samples: int
    n_diverged: int
    worst: str
    """The values of the sample with the largest contour error, in words."""


def spread_rows(comparison: Comparison) -> list[SpreadRow]:
    """Return the table of the spread, a row per run; empty if nothing varied.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    rows = []
    for name, spread in comparison.spread.items():
        machine = comparison.pair(name)[0]
        rivals = [s for n, s in comparison.spread.items() if comparison.pair(n)[0] == machine]
        entries = []
        for metric, _ in SPREAD_METRICS:
            own = _scalar(spread, metric)
            highs = [_um(_scalar(rival, metric).high) for rival in rivals]
            least = min(_scalar(rival, metric).high for rival in rivals)
            best = len(set(highs)) > 1 and math.isfinite(own.high) and _um(own.high) == _um(least)
            entries.append(
                SpreadEntry(_um(own.median), _um(own.low), _um(own.high), _um(own.worst), best)
            )
        number = _scalar(spread, SPREAD_METRICS[1][0]).worst_sample
        rows.append(
            SpreadRow(
                name, tuple(entries), spread.n_samples, spread.n_diverged, _values(spread, number)
            )
        )
    return rows


def _scalar(spread: Spread, metric: str) -> Statistic:
    statistic = spread.statistic(metric)
    assert not isinstance(statistic, list)  # a length, not one per axis
    return statistic


def _um(metres: float) -> str:
    return to_um(metres) if math.isfinite(metres) else NONE


def _values(spread: Spread, number: int) -> str:
    said = []
    for path, value in spread.sample(number).items():
        numbers = value if isinstance(value, list) else [value]
        said.append(f"{path} = {', '.join(significant(float(n), 4) for n in numbers)}")
    return f"sample {number + 1}: {'; '.join(said)}" if said else f"sample {number + 1}"


def change_words(change: Change) -> str:
    """Return in words how a value varies.

    Parameters
    ----------
    change
        One of a variation.
    """
    from contourlab.simulation.draws import Listed, Uniform

    if isinstance(change, Listed):
        if change.factors is not None:
            return "times " + ", ".join(f"{f:g}" for f in change.factors)
        return f"{len(change)} listed values"
    each = ", one draw for all axes" if change.common else ""
    if isinstance(change, Uniform):
        if change.between is not None:
            return f"uniform, {change.between[0]:g} to {change.between[1]:g}{each}"
        if change.relative is not None:
            return f"uniform, ±{100.0 * change.relative:g} %{each}"
        return f"uniform, ±{change.absolute:g}{each}"
    if change.relative is not None:
        return f"normal, standard deviation {100.0 * change.relative:g} %{each}"
    return f"normal, standard deviation {change.absolute:g}{each}"


def spread_sentences(comparison: Comparison) -> list[str]:
    """Return what varied and who bears it best, in plain words; empty if nothing varied.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    variation = comparison.variation
    if variation is None or not comparison.spread:
        return []
    metric, n = SPREAD_METRICS[0][0], variation.n_samples
    sentences = []
    machines = dict.fromkeys(comparison.pair(name)[0] for name in comparison.spread)
    for machine in machines:
        own = {
            comparison.pair(name)[1]: _scalar(spread, metric)
            for name, spread in comparison.spread.items()
            if comparison.pair(name)[0] == machine
        }
        finite = {name: value.high for name, value in own.items() if math.isfinite(value.high)}
        on = f" on {machine}" if comparison.several else ""
        if not finite:
            sentences.append(f"Of {n} samples{on}, more than 5 % diverged with every controller.")
            continue
        best = min(finite, key=finite.__getitem__)
        who = f"{best} stays" if len(own) == 1 else f"{best} bears variation best: it stays"
        sentences.append(
            f"Over {n} samples{on}, {who} below {_um(finite[best])}\u00a0µm rms in 95 %."
        )
    for name, spread in comparison.spread.items():
        if spread.n_diverged:
            sentences.append(f"{name} diverged in {spread.n_diverged} of {n} samples.")
    return sentences


def spread_json(spread: Spread) -> dict[str, Any]:
    """Return the spread of a run for programs, in SI.

    A quantile that more samples than that diverged beyond is null, as is a worst value that
    diverged.

    Parameters
    ----------
    spread
        Of the run.
    """
    return {
        "samples": spread.n_samples,
        "diverged": spread.n_diverged,
        "metrics": {
            name: _statistic_json(spread, spread.statistic(name)) for name in spread.metrics
        },
    }


def _statistic_json(spread: Spread, statistic: Statistic | list[Statistic]) -> Any:
    if isinstance(statistic, list):
        return [_statistic_json(spread, one) for one in statistic]
    numbers = {
        "median": statistic.median, "p05": statistic.low, "p95": statistic.high,
        "worst": statistic.worst,
    }  # fmt: skip
    return {
        **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
        "worst_sample": statistic.worst_sample,
        "worst_values": spread.sample(statistic.worst_sample),
    }


def variation_json(variation: Variation) -> dict[str, Any]:
    """Return what varied for programs.

    Parameters
    ----------
    variation
        Of the comparison.
    """
    return {
        "samples": variation.n_samples,
        "seed": variation.seed,
        "changes": {path: change_words(change) for path, change in variation.changes.items()},
    }
