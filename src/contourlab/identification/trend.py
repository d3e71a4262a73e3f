"""What the on-line estimator would have found over a record.

:class:`~contourlab.controllers.FilteredLeastSquares` runs along the record as it would run in a
controller: from nothing, without bounds, forgetting. A parameter that changes while the record
lasts (warming up, a load taken on) shows as a trend; one that settles slowly says how long a record
has to be. It has the bias that encoder noise gives to least squares, and counts every row, those at
reversals too.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace
from contourlab.controllers.excitation import filtered_regressors
from contourlab.controllers.least_squares import BoundLeastSquares, FilteredLeastSquares
from contourlab.errors import ConfigurationError

__all__ = ["Trend", "estimate_trend"]

PRIOR_SHARE = 1e-6
"""What the start from nothing weighs, relative to the record's own information."""
SPANS = 5.0
"""Times that the estimator forgets over a record, if nothing else is said."""


class Trend(NamedTuple):
    """Parameters over time, as the on-line estimator found them."""

    time: NDArray[Any]
    """[s], shape (n_times,)."""
    estimate: NDArray[Any]
    """θ̂, shape (n_times, 4, n_axes), rows as ``PARAMETERS``, in units of the command."""
    forgetting: float
    """κ [1/s]."""


@jax.jit
def _run(law: BoundLeastSquares, position: Any, before: Any) -> Any:
    start = law.init(position[0], jnp.zeros((4, position.shape[1])))

    def step(state: Any, row: Any) -> Any:
        state = law.step(state, *row)
        return state, state.estimate

    return jax.lax.scan(step, start, (position, before))[1]


def estimate_trend(
    measured: Any,
    acting: Any,
    sample_time: float,
    law: FilteredLeastSquares,
    *,
    time: Any = None,
    forgetting: float | None = None,
    settle_time: float = 0.0,
    n_times: int = 200,
) -> Trend:
    """Return the estimates of the on-line estimator over a record.

    Parameters
    ----------
    measured
        Positions [m], shape (n_samples, n_axes).
    acting
        Command that acts from each instant to the next, shape (n_samples, n_axes).
    sample_time
        [s].
    law
        Filter and smooth sign; its normalisation, covariance and limit are not used.
    time
        Instants [s]; from 0 if None.
    forgetting
        κ >= 0 [1/s]; so that it forgets five times over the record if None.
    settle_time
        Nothing is learned before [s]; for records that begin in motion.
    n_times
        Number of instants to give, >= 2; the last is the end of the record.

    Raises
    ------
    ConfigurationError
        Records of different shapes, or an option out of bounds.
    """
    measured, acting = np.asarray(measured, float), np.asarray(acting, float)
    count = len(measured)
    if type(n_times) is not int or n_times < 2:
        raise ConfigurationError(f"n_times must be a whole number >= 2, got {n_times!r}")
    kappa = SPANS / (count * sample_time) if forgetting is None else float(forgetting)
    n_axes = measured.shape[-1]
    free = np.full((4, n_axes), np.inf)
    law = replace(
        law, forgetting=kappa, normalisation=0.0, covariance_limit=np.inf, settle_time=settle_time,
        initial_covariance=np.ones(4),
    )  # fmt: skip
    bound = law.bind(-free, free, sample_time)
    regressor, _ = filtered_regressors(bound, measured, acting)
    information = np.sum(regressor**2, axis=0) * sample_time
    # a parameter that is never excited stays at nothing
    prior = PRIOR_SHARE * np.where(information > 0.0, information, 1.0)
    bound = replace(bound, initial=1.0 / prior)
    before = np.concatenate([np.zeros_like(acting[:1]), acting[:-1]])
    estimate = np.asarray(_run(bound, measured, before))
    shown = np.unique(np.linspace(0, count - 1, min(n_times, count)).round().astype(int))
    instants = sample_time * np.arange(count) if time is None else np.asarray(time, float)
    return Trend(instants[shown], estimate[shown], kappa)
