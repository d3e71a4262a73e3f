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
from contourlab.identification.inference import fit
from contourlab.identification.record import Record
from contourlab.identification.signals import Signals

__all__ = ["COLUMNS", "Start", "condition", "position_columns", "start_values"]

COLUMNS = ("mass", "viscous", "stiffness", "coulomb", "disturbance", "delay")
LONGEST_DELAY = 0.02
"""Delays up to this are looked at [s]."""
MOST_SAMPLES = 25
SOME = 40_000
"""Rows that a delay of whole samples is looked for in."""
SINGULAR = 1e6
"""Condition beyond which a column is left out instead of solved for."""
Rows = NDArray[Any]


class Start(NamedTuple):
    """Of one axis."""

    values: dict[str, float]
    """By name of :data:`COLUMNS`; those that were looked for."""
    deviations: dict[str, float]
    """Their standard deviations."""
    residual_rms: float
    """[command]."""
    condition: float
    """Of the instruments' columns, brought to one size."""


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
    products = (columns * weight[:, None]).T @ columns
    size = np.sqrt(np.diagonal(products))
    if not size.all():
        return np.inf
    return float(np.sqrt(np.linalg.cond(products / np.outer(size, size))))


def _left(y: Rows, signals: Signals, z: Rows, fixed: Rows, late: int) -> float:
    """Return the squares that a delay of whole samples leaves, over some of the rows."""
    rows = np.flatnonzero(signals.weight)
    rows = rows[:: max(1, len(rows) // SOME)]
    weight = signals.weight[rows]
    wanted = signals.wanted[np.maximum(rows - late, 0) % len(fixed)] - fixed[rows]
    moving = z[rows] * weight[:, None]
    size = np.sqrt(np.sum(y[rows] ** 2, axis=0))
    found = np.linalg.lstsq(moving.T @ (y[rows] / size), moving.T @ wanted, rcond=None)[0]
    return float(np.sum(weight * (wanted - (y[rows] / size) @ found) ** 2))


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
    while len(open_) > 1 and condition(z[:, open_], signals.weight) > SINGULAR:
        # of columns that are one, all but one are left out: it takes what they explain together
        open_.remove(
            min(open_, key=lambda k: condition(z[:, [j for j in open_ if j != k]], signals.weight))
        )
    names = [names[k] for k in open_]
    most = min(MOST_SAMPLES, max(1, round(LONGEST_DELAY / sample_time)))
    tries = range(-1, most + 1) if delay is None else [round(delay / sample_time)]
    late = min(tries, key=lambda n: _left(y[:, open_], signals, z[:, open_], fixed, n))
    wanted = np.roll(signals.wanted, late) - fixed
    found = fit(y[:, open_], wanted, z[:, open_], signals.weight, signals.cosines)
    delayed = late * sample_time if delay is None else delay
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
        condition(z[:, open_], signals.weight),
    )
