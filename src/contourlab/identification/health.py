"""Parameters of a machine over time: over one long record, or over many dated ones.

Every record, or every window of a long one, is identified by itself. What it does not tell is *not
excited* there, and not a change. What changed against the first records is found by
:mod:`~contourlab.identification.false_alarms`, with a rate of false alarms that is chosen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification.false_alarms import (
    Thresholds,
    refuse_rate,
    statistics,
    thresholds,
)
from contourlab.identification.machine import identify_machine
from contourlab.identification.machine_result import AxisModel, MachineIdentification
from contourlab.identification.position_loop import LOOP_PARAMETERS, identify_position_loops
from contourlab.recordings.recording import Recording

__all__ = ["Change", "Health", "HealthSeries", "track_health"]

TRACKED = (
    "mass", "viscous", "stiffness", "coulomb_forward", "coulomb_backward", "delay",
    *(name for name in LOOP_PARAMETERS if name != "delay"),
)  # fmt: skip
BY_DELAY = ("mass", "viscous")
"""What a delay that is taken for 0 s is mistaken for."""
EXPECTED = ("mass", "viscous", "coulomb_forward", "coulomb_backward")
"""What every exciting motion tells."""
LOOP_OPTIONS = ("known", "window", "confidence", "source")
"""Of ``identify_position_loops``."""
_OTHER = "{} has a command of {}, the records before of {}: their parameters are in other units"
USUAL_BASELINE = 3
"""Records that make the baseline, where there is one more."""


@dataclass(frozen=True, eq=False, kw_only=True)
class HealthSeries:
    """One parameter of one axis over time."""

    axis: str
    parameter: str
    unit: str
    value: NDArray[Any] = field(repr=False)
    """NaN where it is not excited, shape (n_records,)."""
    low: NDArray[Any] = field(repr=False)
    high: NDArray[Any] = field(repr=False)
    baseline: float
    """Mean of the first records; NaN if there are none."""
    baseline_deviation: float
    """Its standard deviation."""
    jump: NDArray[Any] = field(repr=False)
    """Difference from the baseline over its standard deviation."""
    drift: NDArray[Any] = field(repr=False)
    """Cumulative sum."""

    @property
    def excited(self) -> NDArray[Any]:
        """Whether a record tells the parameter, shape (n_records,)."""
        return np.asarray(np.isfinite(self.value))


@dataclass(frozen=True, kw_only=True)
class Change:
    """A parameter that changed."""

    axis: str
    parameter: str
    unit: str
    record: int
    """The first record that shows it."""
    label: str
    """Of that record."""
    before: float
    """Baseline."""
    after: float
    """Mean from that record on."""
    kind: str
    """``jump`` or ``drift``."""

    @property
    def share(self) -> float:
        """Of the baseline."""
        return (self.after - self.before) / abs(self.before) if self.before else float("inf")

    def __str__(self) -> str:
        return (
            f"axis {self.axis}: {self.parameter} changed from {self.before:.4g} to "
            f"{self.after:.4g} {self.unit} ({100 * self.share:+.3g} %), first seen in {self.label} "
            f"({self.kind})"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Health:
    """What ``track_health`` found; printed, it is a list of changes."""

    labels: tuple[str, ...]
    """Of the records."""
    records: tuple[MachineIdentification | None, ...]
    """None where nothing could be found."""
    series: tuple[HealthSeries, ...]
    changes: tuple[Change, ...]
    thresholds: Thresholds
    rate: float
    """Share of all such series without a change in which there is any alarm."""
    n_baseline: int
    least_change: float
    """Share of the baseline below which a change is not reported."""
    notes: tuple[str, ...]

    def __str__(self) -> str:
        if not self.changes:
            return f"no change in {len(self.labels)} records"
        return "\n".join(str(change) for change in self.changes)

    def to_dict(self) -> dict[str, Any]:
        """Return series and changes as plain lists and numbers; None where there is no value."""

        def plain(row: NDArray[Any]) -> list[float | None]:
            return [float(x) if np.isfinite(x) else None for x in row]

        return {
            "records": list(self.labels),
            "false_alarm_rate": self.rate,
            "baseline_records": self.n_baseline,
            "notes": list(self.notes),
            "series": [
                {
                    "axis": one.axis, "parameter": one.parameter, "unit": one.unit,
                    "value": plain(one.value), "low": plain(one.low), "high": plain(one.high),
                    "excited": [bool(x) for x in one.excited],
                }
                for one in self.series
            ],
            "changes": [
                {
                    "axis": one.axis, "parameter": one.parameter, "unit": one.unit,
                    "record": one.label, "before": one.before, "after": one.after,
                    "kind": one.kind,
                }
                for one in self.changes
            ],
        }  # fmt: skip


def track_health(
    recordings: Sequence[Recording] | Recording,
    *,
    labels: Sequence[str] | None = None,
    window: float | None = None,
    n_baseline: int | None = None,
    rate: float = 0.01,
    least_change: float = 0.01,
    seed: int = 0,
    options: Mapping[str, Any] | None = None,
) -> Health:
    """Return the parameters over time and what changed.

    Parameters
    ----------
    recordings
        Several, in the order of time; or one, which is cut into windows.
    labels
        What to call them; their numbers, or the windows' times, if None.
    window
        Length of a window of one recording, > 0 [s]; a tenth of it if None.
    n_baseline
        Records that make the baseline, >= 1; if None, three, or all but the last of fewer.
    rate
        Chance of any false alarm over all of it, from 0.0005 to below 1.
    least_change
        Share of the baseline below which a change is not reported, >= 0: intervals hold noise and
        not what a model leaves out, which is another motion's own.
    seed
        Of the Monte Carlo behind the thresholds.
    options
        Of ``identify_machine``; of ``identify_position_loops`` if all that was commanded are
        positions.

    Raises
    ------
    ConfigurationError
        An option out of bounds or one that logs of positions do not have, or too few records for a
        baseline and one more.
    RecordingError
        Records of different axes or commands, or none of which anything can be found.
    """
    if n_baseline is not None and not (isinstance(n_baseline, int) and n_baseline >= 1):
        raise ConfigurationError(f"n_baseline must be a whole number >= 1, got {n_baseline!r}")
    refuse_rate(rate)
    if not least_change >= 0.0:
        raise ConfigurationError(f"least_change must be >= 0, got {least_change!r}")
    parts, names = _parts(recordings, labels, window)
    if n_baseline is None:
        n_baseline = max(1, min(USUAL_BASELINE, len(parts) - 1))
    if len(parts) <= n_baseline:
        raise ConfigurationError(
            f"{n_baseline} record{'s make' if n_baseline > 1 else ' makes'} the baseline, and one "
            f"more is needed; got {len(parts)}"
        )
    found, notes, axes = _identified(parts, names, dict(options or {}))
    rows = [
        (axis, parameter)
        for axis in axes
        for parameter in TRACKED
        if any(r is not None and _told(r[axis], parameter) for r in found)
    ]
    late = {
        axis for axis in axes
        if any(r is not None and _told(r[axis], "delay") and r[axis]["delay"].low > 0.0
               for r in found)
    }  # fmt: skip
    value, low, high, degrees = (np.full((len(rows), len(parts)), np.nan) for _ in range(4))
    units, deviations = {}, np.full((len(rows), len(parts)), np.nan)
    for i, record in enumerate(found):
        if record is None:
            continue
        quantile = {
            a.axis: student.ppf(0.5 + 0.5 * record.confidence, a.degrees) for a in record.axes
        }
        for k, (axis, parameter) in enumerate(rows):
            if not _told(record[axis], parameter):
                continue
            one = record[axis][parameter]
            units[axis, parameter] = one.unit
            if axis in late and parameter in BY_DELAY and not record[axis]["delay"].identified:
                notes.append(
                    f"{names[i]}, axis {axis}: {parameter} is not compared: other records show a "
                    "delay, which this one does not tell from it; give it as known"
                )
            else:
                value[k, i], low[k, i], high[k, i] = one.value, one.low, one.high
                deviations[k, i] = 0.5 * (one.high - one.low) / quantile[axis]
                degrees[k, i] = record[axis].degrees
    there = np.isfinite(value)
    limits = thresholds(there, np.where(there, degrees, 1.0), n_baseline, rate=rate, seed=seed)
    t, sums, mean, spread = statistics(value, deviations, n_baseline)
    series = tuple(
        HealthSeries(
            axis=axis, parameter=parameter, unit=units.get((axis, parameter), ""), value=value[k],
            low=low[k], high=high[k], baseline=float(mean[k]), baseline_deviation=float(spread[k]),
            jump=t[k], drift=sums[k],
        )
        for k, (axis, parameter) in enumerate(rows)
    )  # fmt: skip
    changes = [c for c in (_change(one, limits, least_change, names) for one in series) if c]
    return Health(
        labels=names, records=tuple(found), series=series,
        changes=tuple(sorted(changes, key=lambda c: c.record)), thresholds=limits, rate=rate,
        n_baseline=n_baseline, least_change=least_change, notes=tuple(notes),
    )  # fmt: skip


def _told(axis: AxisModel, parameter: str) -> bool:
    """Return whether a record tells a parameter, and was not told it."""
    one = axis.parameters.get(parameter)
    return one is not None and one.identified and not one.known


def _parts(
    recordings: Sequence[Recording] | Recording, labels: Sequence[str] | None,
    window: float | None,
) -> tuple[list[Recording], tuple[str, ...]]:  # fmt: skip
    if not isinstance(recordings, Recording):
        if window is not None:
            raise ConfigurationError("window goes with one recording, which it cuts")
        parts = list(recordings)
        names = (
            tuple(labels)
            if labels is not None
            else tuple(f"record {k}" for k in range(1, len(parts) + 1))
        )
    else:
        time = np.asarray(recordings["time"], float)
        length = float(time[-1] - time[0])
        step = length / 10.0 if window is None else float(window)
        if not (np.isfinite(step) and 0.0 < step <= length):
            raise ConfigurationError(
                f"window must be > 0 s and within the record, {length:g} s, got {step:g}"
            )
        count = int(length / step + 1e-9)
        edges = time[0] + step * np.arange(count + 1)
        at = np.searchsorted(time, edges)
        parts = [
            Recording(recordings.dataset.isel(time=slice(int(a), int(b)))) for a, b in pairwise(at)
        ]
        names = tuple(f"{a:.6g} to {b:.6g} s" for a, b in pairwise(edges))
        if labels is not None:
            names = tuple(labels)
    if len(names) != len(parts):
        raise ConfigurationError(f"labels must be one per record, {len(parts)}, got {len(names)}")
    return parts, names


def _identified(
    parts: list[Recording], names: tuple[str, ...], options: dict[str, Any]
) -> tuple[list[MachineIdentification | None], list[str], tuple[str, ...]]:
    found: list[MachineIdentification | None] = []
    notes, axes, kind, last = [], None, "", ""
    _refuse_mixed(parts, names, options)
    for part, name in zip(parts, names, strict=True):
        try:
            positions = part["command"].attrs.get("kind") == "position"
            one = (identify_position_loops if positions else identify_machine)(part, **options)
        except RecordingError as error:
            found.append(None)
            notes.append(f"{name}: nothing was found: {error}")
            last = str(error)
            continue
        own = tuple(axis.axis for axis in one.axes)
        if axes is not None and own != axes:
            raise RecordingError(
                f"{name} has the axes {', '.join(own)}, the records before {', '.join(axes)}"
            )
        if kind not in ("", one.command_kind):
            raise RecordingError(_OTHER.format(name, one.command_kind, kind))
        axes, kind = own, one.command_kind
        found.append(one)
        expected = ("velocity_lag",) if kind == "position" else EXPECTED
        for axis in one.axes:
            gone = [p for p in expected if not axis[p].identified]
            if gone:
                notes.append(f"{name}, axis {axis.axis}: {', '.join(gone)} not excited")
    if axes is None:
        raise RecordingError(f"nothing was found in any record: {last}")
    return found, notes, axes


def _refuse_mixed(parts: list[Recording], names: tuple[str, ...], options: dict[str, Any]) -> None:
    """Refuse positions among other commands, and options that logs of positions do not have."""
    kinds = [p["command"].attrs.get("kind") if "command" in p.dataset else None for p in parts]
    told = [(name, kind) for name, kind in zip(names, kinds, strict=True) if kind is not None]
    if "position" not in (kind for _, kind in told):
        return
    for name, kind in told:
        if (kind == "position") != (told[0][1] == "position"):
            raise RecordingError(_OTHER.format(name, kind, told[0][1]))
    for option in options:
        if option not in LOOP_OPTIONS:
            raise ConfigurationError(
                f"logs of positions have no option {option!r}; {choices(option, LOOP_OPTIONS)}"
            )


def _change(
    one: HealthSeries, limits: Thresholds, least: float, names: tuple[str, ...]
) -> Change | None:
    seen = np.where(np.abs(np.nan_to_num(one.jump)) > limits.jump, 1, 0)
    seen |= np.where(np.nan_to_num(one.drift) > limits.drift, 2, 0)
    for k in np.flatnonzero(seen):
        after = np.nanmean(one.value[k:])
        if abs(after - one.baseline) > least * abs(one.baseline):
            return Change(
                axis=one.axis, parameter=one.parameter, unit=one.unit, record=int(k),
                label=names[k], before=one.baseline, after=float(after),
                kind="jump" if seen[k] & 1 else "drift",
            )  # fmt: skip
    return None
