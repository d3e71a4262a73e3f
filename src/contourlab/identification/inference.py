"""Parameters of one axis and how well they are known.

    z_k (y_k · θ - u_k) summed to zero, with weights w_k:    θ = (Zᵀ W Y)⁻¹ Zᵀ W u              (1)

z are *instruments*: they must move with y and know nothing of the noise. With z = y this is least
squares. Encoder noise is then in both factors, is correlated with itself, and θ is biased however
long the record (errors in variables); and since a loop feeds noise back, what the axis truly does
knows of it too. With z built from the reference, which no noise has touched, θ is consistent in a
closed loop, whatever the colour of the noise.

**Covariance.** The residual e is coloured by the filter and by the loop, and its size changes with
the motion. What counts is the variance of the sum of the scores w z e, which the equal-weighted
cosine estimator finds from their projections on the B slowest cosines over the record:

    Ω = Σ_j p_j p_jᵀ / B,    p_j = √2 Σ_k w_k z_k e_k cos(π j (k + 1/2) / n),   j = 1 ... B      (2)
    C = A Ω Aᵀ,    A = (Zᵀ W Y)⁻¹                                                              (3)

robust against heteroscedasticity and autocorrelation; with B fixed, θ over its standard deviation
follows Student's t with B degrees of freedom. Newey and West's estimator was tried and is not used:
encoder noise is differenced twice, its spectrum at the motion's frequency is a small part of that
above, and Bartlett's window leaks from there: with 1.3 √n lags intervals were nine to thirty times
too wide. B is kept below the number of reversals, so that the cosines are slower than the motion.

A force that is white, or forgets itself sooner than the fastest of the cosines turns (2 n / B
samples), is covered by the interval. An error of the *model* is not: it is a bias.

References
----------
.. [JanotVandanjonGautier2014] instruments against noise in the observations; theirs are simulated,
   here they are the reference.
.. [LazarusLewisStockWatson2018] (2), Student's t with B degrees of freedom.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

__all__ = ["Fit", "fit", "long_run_covariance"]


class Fit(NamedTuple):
    """Parameters of one axis."""

    estimate: NDArray[Any]
    """Shape (p,)."""
    covariance: NDArray[Any]
    """Shape (p, p)."""
    residual: NDArray[Any]
    """u - y · θ, shape (n,)."""


def long_run_covariance(scores: NDArray[Any], cosines: int) -> NDArray[Any]:
    """Return (2): the covariance of the sum of the scores, shape (p, p).

    Parameters
    ----------
    scores
        Shape (n, p).
    cosines
        B >= 1.
    """
    # SciPy's type II has a factor 2
    projected = dct(scores, type=2, axis=0)[1 : cosines + 1] / np.sqrt(2.0)
    return projected.T @ projected / cosines  # type: ignore[no-any-return]  # (2)


def fit(
    regressors: NDArray[Any],
    wanted: NDArray[Any],
    instruments: NDArray[Any],
    weights: NDArray[Any],
    cosines: int,
) -> Fit:
    """Return the parameters of (1) with the covariance of (3).

    Parameters
    ----------
    regressors, instruments
        y and z, shape (n, p) each; ZᵀWY must be regular.
    wanted
        u, shape (n,).
    weights
        w, shape (n,).
    cosines
        B.
    """
    # columns of size one, so that the inverse is as exact as their angles allow
    sizes = [np.sqrt(np.sum(weights[:, None] * x**2, axis=0)) for x in (regressors, instruments)]
    y, z = regressors / sizes[0], instruments / sizes[1] * weights[:, None]
    inverse = np.linalg.inv(z.T @ y)
    scaled = inverse @ (z.T @ wanted)  # (1)
    residual = wanted - y @ scaled
    spread = inverse @ long_run_covariance(z * residual[:, None], cosines) @ inverse.T  # (3)
    return Fit(scaled / sizes[0], spread / np.outer(sizes[0], sizes[0]), residual)
