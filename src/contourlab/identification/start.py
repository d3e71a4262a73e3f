"""Where the refinement starts: filtered least squares with a spring and a delay.

    y · θ = u_f(t - δ),    y = (s² H q, s H q, H q, H S_f, -H 1)

as in :mod:`~contourlab.identification.identify`, with a column for a spring, and solved for each
delay of a whole number of samples; the one that leaves the least is taken, and what is left of the
delay comes from the derivative of the command as one more column. All is of the filtered signals
and their instruments, so that noise does not bias where the search begins.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.excitation import filtered_regressors
from contourlab.controllers.least_squares import FilteredLeastSquares
from contourlab.identification.inference import Fit, fit
from contourlab.identification.record import Record
from contourlab.identification.signals import Signals

__all__ = ["COLUMNS", "Start", "condition", "position_columns", "start_values"]

COLUMNS = ("mass", "viscous", "stiffness", "coulomb", "disturbance", "delay")
LONGEST_DELAY = 0.02
"""Delays up to this are looked at [s]."""
MOST_SAMPLES = 25
Rows = NDArray[Any]


class Start(NamedTuple):
    """Of one axis."""

    values: dict[str, float]
    """By name of :data:`COLUMNS`; those that were looked for."""
    deviations: dict[str, float]
    """Their standard deviations."""
    residual_rms: float
    """[command]."""


def position_columns(record: Record, law: FilteredLeastSquares, positions: Rows) -> Rows:
    """Return H q of every axis, as it goes with the other columns; shape (n_samples, n_axes).

    Parameters
    ----------
    record
        As it was read.
    law
        Filter.
    positions
        Shape (n_samples, n_axes) [m].
    """
    n = len(record.names)
    free = np.full((4, n), np.inf)
    bound = law.bind(-free, free, record.sample_time)
    mean = 0.5 * (positions + np.concatenate([positions[1:], positions[-1:]]))
    return filtered_regressors(bound, positions, mean)[1]


def condition(columns: Rows, weight: Rows) -> float:
    """Return the condition of columns brought to one size; infinite if one is nothing.

    Parameters
    ----------
    columns
        Shape (n_samples, p).
    weight
        How much each row counts, shape (n_samples,).
    """
    x = columns * np.sqrt(weight)[:, None]
    size = np.linalg.norm(x, axis=0)
    return float(np.linalg.cond(x / size)) if size.all() else np.inf


def start_values(
    signals: Signals, spring: tuple[Rows, Rows] | None, sample_time: float,
    delay: float | None, given: dict[str, float], limit: float, assumed: float = 0.0,
) -> Start:  # fmt: skip
    """Return where to start.

    Parameters
    ----------
    signals
        Filtered, of one axis.
    spring
        H q measured and of the instrument, each shape (n_samples,); None for no spring.
    sample_time
        [s].
    delay
        [s] if it is known or cannot be found; looked for if None.
    given
        Parameters that are known.
    limit
        Condition beyond which the delay is not told apart from the rest.
    assumed
        What it is then taken for [s].
    """
    y, z = signals.regressor, signals.instrument
    if spring is not None:
        y = np.column_stack([y[:, :2], spring[0], y[:, 2:]])
        z = np.column_stack([z[:, :2], spring[1], z[:, 2:]])
        names = [name for name in COLUMNS if name != "delay"]
    else:
        names = [name for name in COLUMNS if name not in ("delay", "stiffness")]
    open_ = [k for k, name in enumerate(names) if name not in given]
    fixed = y @ np.array([given.get(name, 0.0) for name in names])
    names = [names[k] for k in open_]
    most = min(MOST_SAMPLES, max(1, round(LONGEST_DELAY / sample_time)))
    tries = range(-1, most + 1) if delay is None else [round(delay / sample_time)]
    best: tuple[float, int, Fit] | None = None
    for late in tries:
        wanted = np.roll(signals.wanted, late) - fixed
        found = fit(y[:, open_], wanted, z[:, open_], signals.weight, signals.cosines)
        left = float(np.sum(signals.weight * found.residual**2))
        if best is None or left < best[0]:
            best = (left, late, found)
    assert best is not None
    late, found = best[1], best[2]
    wanted = np.roll(signals.wanted, late) - fixed
    delayed = late * sample_time
    if delay is None:
        rates = [np.gradient(x, sample_time) for x in (wanted, z[:, open_] @ found.estimate)]
        columns = [np.column_stack([x[:, open_], r]) for x, r in zip((y, z), rates, strict=True)]
        if condition(columns[1], signals.weight) > limit:
            return start_values(signals, spring, sample_time, assumed, given, limit, assumed)
        found = fit(columns[0], wanted, columns[1], signals.weight, signals.cosines)
        rest = float(found.estimate[-1])
        delayed += rest if abs(rest) < sample_time else 0.0
        names = [*names, "delay"]
    values = dict(zip(names, (float(x) for x in found.estimate), strict=True))
    values["delay"] = delayed
    deviations = np.sqrt(np.diagonal(found.covariance))
    left = float(np.sum(signals.weight * found.residual**2))
    return Start(
        values,
        dict(zip(names, (float(x) for x in deviations), strict=True)),
        float(np.sqrt(left / max(float(signals.weight.sum()), 1.0))),
    )
