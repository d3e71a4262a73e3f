"""Which rows of a record count, and what the encoder adds to them.

Near a reversal friction is not what the model says (stiction, presliding, Stribeck), and the sign
of a noisy velocity is a coin. Rows slower than a least speed are left out, and with them all rows
that the filter still connects with one: its memory, until what it remembers has fallen to
``FORGOTTEN``. Where rows begin and end to count their weight rises as a squared sine over another
memory: encoder noise is differenced twice on its way into the equation, sums over it telescope, and
hard ends would be most of what is left of it.

The noise of the encoder is found from fourth differences of the position, which a motion hardly
has: those of white noise have 1 + 16 + 36 + 16 + 1 = 70 times its variance. Shaking that is really
there at a quarter of the sampling frequency and above counts as noise too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.excitation import filtered_regressors
from contourlab.controllers.least_squares import BoundLeastSquares, FilteredLeastSquares
from contourlab.machines.base import per_axis

__all__ = ["FORGOTTEN", "filter_rate", "memory", "position_noise", "regressor_noise", "row_weights"]

FORGOTTEN = 1e-4
"""What is left of a value in the filter once it counts as forgotten."""
FOURTH = 70.0
"""Variance of fourth differences of white noise, relative to its own."""


def filter_rate(law: FilteredLeastSquares, n_axes: int) -> NDArray[Any]:
    """Return the rate at which the filter forgets, shape (n_axes,) [1/s].

    Parameters
    ----------
    law
        Whose filter it is.
    n_axes
        Number of axes.
    """
    omega = 2.0 * np.pi * np.asarray(per_axis("cutoff_hz", law.cutoff_hz, n_axes))
    damping = float(np.asarray(law.filter_damping))
    return np.asarray(omega * (damping - np.sqrt(max(damping**2 - 1.0, 0.0))))


def memory(law: FilteredLeastSquares, sample_time: float, n_axes: int) -> NDArray[Any]:
    """Return for how many samples the filter remembers, shape (n_axes,).

    Parameters
    ----------
    law
        Whose filter it is.
    sample_time
        [s].
    n_axes
        Number of axes.
    """
    rate = filter_rate(law, n_axes)
    return np.asarray(np.ceil(-np.log(FORGOTTEN) / (rate * sample_time)), int)


def row_weights(
    velocity: NDArray[Any], minimum_speed: float, remembers: int, waiting: int = 0
) -> NDArray[Any]:
    """Return how much each row of one axis counts, 0 to 1, shape (n_samples,).

    Parameters
    ----------
    velocity
        Filtered [m/s], shape (n_samples,).
    minimum_speed
        [m/s].
    remembers
        Samples that the filter remembers.
    waiting
        Rows at the start that are not known.
    """
    n = len(velocity)
    bad = np.abs(velocity) < minimum_speed
    bad[: waiting + 1] = True  # before the record the filter was not fed
    at = np.arange(n)
    last = np.maximum.accumulate(np.where(bad, at, -n))
    following = np.minimum.accumulate(np.where(bad, at, 2 * n)[::-1])[::-1]
    following = np.minimum(following, n + remembers)  # what comes later is in no row
    free = np.minimum(at - last, following - at) - remembers
    rise = np.clip(free / remembers, 0.0, 1.0)
    return np.asarray(np.sin(0.5 * np.pi * rise) ** 2)


def position_noise(measured: NDArray[Any], counts: NDArray[Any] | None = None) -> float:
    """Return the standard deviation of the encoder's noise and rounding [m].

    Parameters
    ----------
    measured
        Of one axis [m], shape (n_samples,).
    counts
        Which rows count; all if None, or if none does.
    """
    fourth = np.diff(measured, 4)
    if counts is not None and np.any(counts[2:-2] > 0.0):
        fourth = fourth[counts[2:-2] > 0.0]
    return float(np.sqrt(np.mean(fourth**2) / FOURTH))


def regressor_noise(law: BoundLeastSquares, samples: int, n_axes: int) -> NDArray[Any]:
    """Return the covariance of what white noise of 1 m² makes of s² H q and s H q.

    Parameters
    ----------
    law
        The filters.
    samples
        How long they remember.
    n_axes
        Number of axes.

    Returns
    -------
    NDArray
        Shape (n_axes, 2, 2): the sum of products of their impulse responses.
    """
    impulse = np.zeros((samples + 4, n_axes))
    impulse[2] = 1.0
    response = filtered_regressors(law, impulse, np.zeros_like(impulse))[0][:, :2]
    return np.asarray(np.einsum("kpa,kqa->apq", response, response))
