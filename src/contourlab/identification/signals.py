"""The filtered signals of each axis: regressor, instrument, command, and which rows count."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.excitation import filtered_regressors
from contourlab.controllers.least_squares import BoundLeastSquares, FilteredLeastSquares
from contourlab.identification.record import Record
from contourlab.identification.rows import (
    filter_rate,
    memory,
    position_noise,
    regressor_noise,
    row_weights,
)
from contourlab.machines.base import per_axis

__all__ = ["INSTRUMENTS", "Signals", "axis_signals"]

INSTRUMENTS = ("reference", "delayed", "none")
"""``reference``: the regressor of the reference, free of noise in any loop. ``delayed``: the
measured regressor of a while ago, which does not know of today's noise, if that is white.
``none``: plain least squares, biased by encoder noise."""
DELAY_TIMES = 4.0
"""Delay of a delayed instrument, in times of the filter: e⁻⁸ of the noise's power is left."""
NOISE_SPEEDS = 5.0
"""Least speed, in standard deviations of the differenced encoder noise."""
SIGN_SPEEDS = 10.0
"""Least speed, in widths of a tanh sign: it is there to 1e-8."""
PEAK_SHARE = 0.05
"""Least speed, as a share of the largest: there friction falls on most machines."""
FEWEST, MOST = 4, 12
"""Cosines of the covariance."""


class Signals(NamedTuple):
    """Of one axis."""

    regressor: NDArray[Any]
    """y, shape (n_samples, 4)."""
    instrument: NDArray[Any]
    """z, likewise."""
    wanted: NDArray[Any]
    """u_f [command], shape (n_samples,)."""
    weight: NDArray[Any]
    """How much each row counts, shape (n_samples,)."""
    noise: NDArray[Any]
    """Mean products that encoder noise adds to those of y, shape (4, 4)."""
    position_noise: float
    """Standard deviation of the encoder's noise and rounding [m]."""
    minimum_speed: float
    """[m/s]."""
    cosines: int
    """Of the covariance: as many as reversals, within bounds."""


def axis_signals(
    record: Record, law: FilteredLeastSquares, instrument: str, minimum_speed: float | None
) -> list[Signals]:
    """Return the filtered signals of each axis.

    Parameters
    ----------
    record
        As it was read.
    law
        Filter and smooth sign.
    instrument
        One of :data:`INSTRUMENTS`.
    minimum_speed
        Slower rows do not count [m/s]; found for each axis if None.
    """
    n = len(record.names)
    free = np.full((4, n), np.inf)
    bound = law.bind(-free, free, record.sample_time)
    y, wanted = filtered_regressors(bound, record.measured, record.acting)
    z = _instruments(record, law, bound, y, instrument)
    remembers = memory(law, record.sample_time, n)
    noise = regressor_noise(bound, int(remembers.max()), n)
    width = np.asarray(per_axis("friction_velocity", law.friction_velocity, n))
    narrow = SIGN_SPEEDS * width if law.friction_shape == "tanh" else np.zeros(n)
    found = []
    for k in range(n):
        measured, velocity = record.measured[:, k], y[:, 1, k]
        speed = minimum_speed
        if speed is None:
            differenced = np.sqrt(2.0) * position_noise(measured) / record.sample_time
            peak = float(np.abs(velocity[record.waiting + remembers[k] :]).max(initial=0.0))
            speed = max(NOISE_SPEEDS * differenced, narrow[k], PEAK_SHARE * peak)
        weight = row_weights(velocity, speed, int(remembers[k]), record.waiting)
        sigma = position_noise(measured, weight)
        added = np.zeros((4, 4))
        added[:2, :2] = sigma**2 * noise[k]
        way = np.sign(velocity[np.abs(velocity) >= speed])
        reversals = int(np.sum(way[1:] != way[:-1]))
        found.append(
            Signals(
                y[:, :, k], z[:, :, k], wanted[:, k], weight, added, sigma, float(speed),
                int(np.clip(reversals, FEWEST, MOST)),
            )
        )  # fmt: skip
    return found


def _instruments(
    record: Record, law: FilteredLeastSquares, bound: BoundLeastSquares, y: NDArray[Any], kind: str
) -> NDArray[Any]:
    if kind == "reference":
        return filtered_regressors(bound, record.reference, record.acting)[0]
    if kind == "none":
        return y
    delayed = np.zeros_like(y)
    for k, rate in enumerate(filter_rate(law, len(record.names))):
        late = int(np.ceil(DELAY_TIMES / (rate * record.sample_time)))
        delayed[late:, :, k] = y[:-late, :, k]
    return delayed
