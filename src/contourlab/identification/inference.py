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

**What fitting takes out.** The parameters are fitted to the residual that the scores are made of,
and take out of every p_j what they explain of it. With v = Z aᵀ, a the row of A of one parameter,

    θ̂ - θ = v · e,    p_j = g_j · e,    g_j = Mᵀ (√2 c_j v),    M = 1 - Y A Zᵀ                   (4)

with e the residual of the true parameters and c_j the cosine (weights are in Z). Were Zᵀ Y gathered
evenly over the record, M would leave √2 c_j v as it is, whose length is that of v: that is (3). But
of five parameters and a dozen reversals, with one direction in every other stretch, cosines turn
nearly as often as what the parameters act on. The g_j then keep little more than half of their
squares, and (3) is as much too small. Where the residual is white or was made so, take instead

    s² = |v|² Σ_j (q_j · e)² / B                                                             (5)

with q_j an orthonormal basis of the g_j, which the residual of the fit tells as e does: M is
a projection. For a white e, s² has the mean |v|² σ² of (θ̂ - θ)², whatever the motion. With z = y, v
is orthogonal to every g_j, and for a normal e (θ̂ - θ) / s is Student's t with B degrees of freedom
*exactly*; nearly so with instruments that are y but for noise. On a long record of a motion that
repeats (5) is (3), and stands what (3) stands. Of filtered signals, whose noise grows steeply with
frequency, (5) would be too wide (half as wide again, or three times): :func:`fit` keeps (3).

A force that is white, or forgets itself sooner than the fastest of the cosines turns (2 n / B
samples), is covered by the interval. An error of the *model* is not: it is a bias.

References
----------
.. [JanotVandanjonGautier2014] instruments against noise in the observations; theirs are simulated,
   here they are the reference.
.. [LazarusLewisStockWatson2018] (2), Student's t with B degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

__all__ = ["Fit", "corrected_covariance", "fit", "long_run_covariance"]

NOTHING = 1e-10
"""Share of its square below which a g_j counts as nothing: what is left then is rounding."""


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


def corrected_covariance(
    covariance: NDArray[Any], inverse: NDArray[Any], regressors: NDArray[Any],
    instruments: NDArray[Any], residual: NDArray[Any], instants: NDArray[Any], samples: int,
    cosines: int, project: Callable[[NDArray[Any]], NDArray[Any]] | None = None,
) -> tuple[NDArray[Any], int]:  # fmt: skip
    """Return (3) with the variances of (5), and their degrees of freedom.

    Parameters
    ----------
    covariance
        (3), whose correlations stay.
    inverse
        A, shape (p, p).
    regressors, instruments
        Y and Z, weights and projections included, shape (n_rows, p) each.
    residual
        e, shape (n_rows,).
    instants
        Which sample of the record each row is, shape (n_rows,).
    samples
        Of the record.
    cosines
        B.
    project
        The symmetric projection that Y, Z and e went through, for rows of shape (n_rows, k); none
        if None.

    Returns
    -------
    tuple
        Shape (p, p), and B or, if of the g_j of some parameter fewer are independent, as many.
    """
    turns = np.pi / samples * (np.asarray(instants, float) + 0.5)
    turn = np.sqrt(2.0) * np.cos(turns[:, None] * np.arange(1, cosines + 1))
    products, along = [], []
    for v in (instruments @ inverse.T).T:
        g = v[:, None] * turn
        g -= instruments @ (inverse.T @ (regressors.T @ g))  # (4)
        if project is not None:
            g = project(g)
        products.append((g.T @ g) / (v @ v))
        along.append(residual @ g)
    values, vectors = np.linalg.eigh(products)
    degrees = max(1, int(np.sum(values > NOTHING, axis=1).min()))
    values, vectors = values[:, -degrees:], vectors[:, :, -degrees:]
    inner = np.einsum("pjk,pj->pk", vectors, along)
    variance = np.mean(inner**2 / values, axis=1)  # (5)
    had = np.diagonal(covariance)
    share = np.sqrt(variance / np.where(had > 0.0, had, np.inf))  # of a perfect fit nothing is left
    return covariance * np.outer(share, share), degrees


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
