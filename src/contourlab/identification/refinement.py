"""Parameters refined on the error of the simulated response.

What filtered least squares find (:mod:`~contourlab.identification.start`) is where this starts. The
residual is that of positions, measured less simulated, and the simulation is exact at the samples:
neither differencing noise nor the mean over an interval biases it.

**First** the sum of squares of L (q - q̂(θ)) is brought down by Levenberg and Marquardt's method,
the states that the pieces begin with eliminated in every step (variable projection).

**Then** the equations

    Zᵀ P L (q - q̂(θ)) = 0                                                              (1)

are solved by Newton's method. P takes out the states that the pieces begin with. L is a high pass
of second order,

    L = (1 - z⁻¹)² / ((1 - p z⁻¹) (1 - p* z⁻¹)),                                       (2)

with the poles of Butterworth's filter: below its corner the residual is taken for what an unknown
white force makes of a mass, above it for the white noise of an encoder. The corner is the one that
leaves the least of the residual, L being the error of predicting it from its past.

Z are derivatives of a simulation driven by a command that no noise has touched: the one that the
model would need to follow the measured motion as a regression on the reference gives it. So (1) is
consistent in a closed loop too, whatever the colour of noise and force, and the covariance is that
of :mod:`~contourlab.identification.inference`. Without a reference Z are the derivatives of the
response itself: consistent for white noise of the encoder, biased by forces that a loop feeds back.

References
----------
.. [JanotVandanjonGautier2014] instruments from a simulation of the model.
.. [LazarusLewisStockWatson2018] intervals.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from contourlab.identification.inference import corrected_covariance, long_run_covariance
from contourlab.identification.pieces import Pieces
from contourlab.identification.simulated_response import MODEL_PARAMETERS, respond

__all__ = ["Drive", "Refined", "gram", "misfit", "refine"]

CORNERS = 25
"""Corners of (2) that are tried, from 0 to nearly half the sampling frequency."""
LEAST_SHARE = 0.1
"""A mass and a drive lag do not fall below this share of what they were in one step."""
MOST_STEPS = 25
ROUNDS = 3
"""Of finding the corner anew."""
SMALL = 0.02
"""Step, in standard deviations, at which (1) counts as solved."""
Rows = NDArray[Any]


class Drive(NamedTuple):
    """What drives the model, over the whole record of one axis."""

    command: Rows
    """Row k acts from instant k + delay to the next, shape (n_samples,)."""
    ahead: Rows
    """s_f, mean over the interval that begins at each instant."""
    back: Rows
    position: Rows
    """What tells the states that pieces begin with [m]."""


class Refined(NamedTuple):
    """Of one axis."""

    theta: Rows
    """In the order of ``MODEL_PARAMETERS``."""
    covariance: Rows
    """Of the free parameters, shape (p, p)."""
    residual: Rows
    """Measured less simulated, NaN outside the pieces, shape (n_samples,) [m]."""
    simulated: Rows
    """Likewise [m]."""
    whitened: Rows
    """L of the residual, likewise."""
    corner: float
    """Of L, as a share of half the sampling frequency."""
    gram: Rows
    """Mean products of the derivatives in (1), shape (p, p)."""
    converged: bool
    degrees: int
    """Of freedom of the covariance."""


def refine(
    theta: Rows, free: tuple[str, ...], measured: Drive, instrument: Drive | None, pieces: Pieces,
    sample_time: float, cosines: int, rough: bool = False,
) -> Refined:  # fmt: skip
    """Return the parameters that (1) gives.

    Parameters
    ----------
    theta
        Where to start, in the order of ``MODEL_PARAMETERS``.
    free
        Parameters to find; the others stay.
    measured
        What acted and what was measured.
    instrument
        The same without noise; the response itself is the instrument if None.
    pieces
        Rows to look at.
    sample_time
        [s].
    cosines
        Of the covariance.
    rough
        Whether unknown forces are reckoned with from the start, which is blunter: L as the residual
        of the start wants it, in place of 1.
    """
    at = np.array([MODEL_PARAMETERS.index(name) for name in free])
    theta = np.asarray(theta, float).copy()
    converged = False
    response, wanted = _driven(theta, measured, pieces, sample_time)
    corner = _corner(wanted - response.position, response.by_start, pieces) if rough else 0.0
    theta = _least_squares(theta, at, measured, pieces, sample_time, corner)
    found = _linearised(theta, at, measured, instrument, pieces, sample_time, corner, cosines)
    for _ in range(ROUNDS):
        corner = _corner(found.error, found.by_start, pieces)
        theta, found, converged = _solve(
            theta, at, measured, instrument, pieces, sample_time, corner, cosines
        )
    n = len(measured.command)
    series = [np.full(n, np.nan) for _ in range(3)]
    there = pieces.counts > 0.0
    for row, values in zip(series, (found.error, found.position, found.whitened), strict=True):
        row[pieces.rows[there]] = values[there]
    covariance, degrees = _corrected(found, pieces, n, cosines)
    return Refined(
        theta, covariance, series[0], series[1], series[2], corner, found.gram, converged, degrees
    )


def gram(theta: Rows, drive: Drive, pieces: Pieces, sample_time: float, corner: float) -> Rows:
    """Return the products of what each parameter does to the filtered response, shape (7, 7).

    Parameters
    ----------
    theta
        In the order of ``MODEL_PARAMETERS``.
    drive
        What drives the model.
    pieces
        Rows to look at.
    sample_time
        [s].
    corner
        Of the filter, as a share of half the sampling frequency: forces count up to there.
    """
    response, _ = _driven(theta, drive, pieces, sample_time)
    y = _projection(response.by_start, pieces, corner)(response.by_parameters)
    return np.asarray(np.einsum("nlp,nlq->pq", y, y))


def misfit(theta: Rows, drive: Drive, pieces: Pieces, sample_time: float) -> float:
    """Return how far the simulated response is from what was measured, rms [m].

    Parameters
    ----------
    theta
        In the order of ``MODEL_PARAMETERS``.
    drive
        What drives the model.
    pieces
        Rows to look at.
    sample_time
        [s].
    """
    try:
        response, wanted = _driven(theta, drive, pieces, sample_time)
    except np.linalg.LinAlgError:
        return np.inf
    left = (wanted - response.position)[pieces.counts > 0.0]
    size = float(np.sqrt(np.mean(left**2)))
    return size if np.isfinite(size) else np.inf


class _Linearised(NamedTuple):
    step: Rows
    covariance: Rows
    error: Rows
    position: Rows
    whitened: Rows
    gram: Rows
    by_start: Rows
    y: Rows
    z: Rows
    inverse: Rows
    """Of what z and y make together; columns of size 1, as y and z."""
    sizes: Rows
    """Of the columns of y."""
    startless: Any
    """P."""

    @property
    def size(self) -> float:
        """Of the step, in standard deviations."""
        spread = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return float(np.max(np.abs(self.step) / np.where(spread > 0.0, spread, 1.0)))


def _driven(
    theta: Rows, drive: Drive, pieces: Pieces, sample_time: float
) -> tuple[Any, Rows]:  # fmt: skip
    n = len(drive.command)
    if not abs(theta[5]) < n * sample_time:  # a delay longer than the record, or none at all
        raise np.linalg.LinAlgError("the delay went beyond the record")
    whole = int(np.floor(theta[5] / sample_time))
    newer, older = (drive.command[np.clip(pieces.rows - whole - late, 0, n - 1)] for late in (0, 1))
    wanted = pieces.of(drive.position)
    response = respond(
        theta, wanted, older, newer, pieces.of(drive.ahead), pieces.of(drive.back), pieces.counts,
        sample_time,
    )  # fmt: skip
    return response, wanted


@functools.cache
def _high_pass(corner: float) -> tuple[Rows, Rows]:
    """Numerator and denominator of (2); to design it takes longer than to use it."""
    top, bottom = butter(2, corner, "highpass")
    return top / top[0], bottom


def _filtered(rows: Rows, corner: float) -> Rows:
    """L along the second dimension, from rest."""
    return rows if corner == 0.0 else np.asarray(lfilter(*_high_pass(corner), rows, axis=1))


def _startless(by_start: Rows, pieces: Pieces, corner: float) -> Any:
    """Return P as a function of filtered rows of the pieces."""
    counts = pieces.counts
    columns = _filtered(by_start[None], corner)
    size = np.linalg.norm(columns, axis=(0, 1))
    q, _ = np.linalg.qr(columns / np.where(size > 0.0, size, 1.0) * counts[:, :, None])

    def project(rows: Rows) -> Rows:
        extra = (slice(None),) * 2 + (None,) * (rows.ndim - 2)
        x = rows * counts[extra]
        inner = np.einsum("nls,nl...->ns...", q, x)
        return np.asarray((x - np.einsum("nls,ns...->nl...", q, inner)) * counts[extra])

    return project


def _projection(by_start: Rows, pieces: Pieces, corner: float) -> Any:
    """Return P L as a function of rows of the pieces."""
    startless = _startless(by_start, pieces, corner)
    return lambda rows: startless(_filtered(rows, corner))


def _corner(error: Rows, by_start: Rows, pieces: Pieces) -> float:
    """Return the corner of (2) that leaves the least of the error."""
    tried = [0.0, *np.geomspace(1e-3, 0.97, CORNERS - 1)]
    left = [float(np.sum(_projection(by_start, pieces, one)(error) ** 2)) for one in tried]
    return float(tried[int(np.argmin(left))])


def _linearised(
    theta: Rows, at: Rows, measured: Drive, instrument: Drive | None, pieces: Pieces,
    sample_time: float, corner: float, cosines: int,
) -> _Linearised:  # fmt: skip
    response, wanted = _driven(theta, measured, pieces, sample_time)
    startless = _startless(response.by_start, pieces, corner)

    def project(rows: Rows) -> Rows:
        return np.asarray(startless(_filtered(rows, corner)))

    error = wanted - response.position
    left = project(error)
    y = project(response.by_parameters[:, :, at])
    z = y
    if instrument is not None:
        z = project(_driven(theta, instrument, pieces, sample_time)[0].by_parameters[:, :, at])
    sizes = [np.sqrt(np.sum(x**2, axis=(0, 1))) for x in (y, z)]
    y, z = y / sizes[0], z / sizes[1]
    products = np.einsum("nlp,nlq->pq", z, y)
    step = np.linalg.solve(products, np.einsum("nlp,nl->p", z, left))
    inverse = np.linalg.inv(products)
    residual = left - y @ step
    scores = np.zeros((len(measured.command), len(at)))
    there = pieces.counts > 0.0
    scores[pieces.rows[there]] = (z * residual[:, :, None])[there]
    spread = inverse @ long_run_covariance(scores, cosines) @ inverse.T
    gram = np.einsum("nlp,nlq->pq", z, z) * np.outer(sizes[1], sizes[1]) / pieces.counts.sum()
    scale = np.outer(sizes[0], sizes[0])
    return _Linearised(
        step / sizes[0], spread / scale, error, response.position, left, gram, response.by_start,
        y, z, inverse, sizes[0], startless,
    )  # fmt: skip


def _corrected(found: _Linearised, pieces: Pieces, samples: int, cosines: int) -> tuple[Rows, int]:
    """Return the covariance with what fitting takes out of the scores, starts included."""
    shape = found.y.shape[:2]
    residual = found.whitened - found.y @ (found.step * found.sizes)
    scale = np.outer(found.sizes, found.sizes)
    covariance, degrees = corrected_covariance(
        found.covariance * scale, found.inverse, found.y.reshape(-1, found.y.shape[2]),
        found.z.reshape(-1, found.z.shape[2]), residual.ravel(), pieces.rows.ravel(), samples,
        cosines, lambda rows: found.startless(rows.reshape(*shape, -1)).reshape(len(rows), -1),
    )  # fmt: skip
    return covariance / scale, degrees


def _moved(theta: Rows, at: Rows, step: Rows) -> Rows:
    """Return θ after a step that leaves mass and drive lag above 0."""
    share = 1.0
    for row, change in zip(at, step, strict=True):
        if row in (0, 6) and change < 0.0:
            share = min(share, (1.0 - LEAST_SHARE) * theta[row] / -change)
    moved = theta.copy()
    moved[at] += share * step
    return moved


def _least_squares(
    theta: Rows, at: Rows, measured: Drive, pieces: Pieces, sample_time: float, corner: float
) -> Rows:
    """Levenberg and Marquardt on the sum of squares of the whitened simulated error."""

    def look(theta: Rows) -> tuple[float, Rows, Rows]:
        response, wanted = _driven(theta, measured, pieces, sample_time)
        project = _projection(response.by_start, pieces, corner)
        y = project(response.by_parameters[:, :, at])
        left = project(wanted - response.position)
        return (
            float(np.sum(left**2)),
            np.einsum("nlp,nlq->pq", y, y),
            np.einsum("nlp,nl->p", y, left),
        )

    cost, gram, slope = look(theta)
    damping = 1e-3
    for _ in range(MOST_STEPS):
        scale = np.sqrt(np.diagonal(gram))
        scaled = gram / np.outer(scale, scale)
        step = np.linalg.solve(scaled + damping * np.eye(len(at)), slope / scale) / scale
        tried = _moved(theta, at, step)
        new = look(tried)
        if new[0] < cost:
            gain = (cost - new[0]) / cost
            theta, (cost, gram, slope) = tried, new
            damping = max(damping / 5.0, 1e-12)
            if gain < 1e-8:
                break
        else:
            damping *= 8.0
            if damping > 1e8:
                break
    return theta


def _solve(
    theta: Rows, at: Rows, measured: Drive, instrument: Drive | None, pieces: Pieces,
    sample_time: float, corner: float, cosines: int,
) -> tuple[Rows, _Linearised, bool]:  # fmt: skip
    """Newton's method on (1), each step halved until the next one is shorter."""

    def look(theta: Rows) -> _Linearised:
        return _linearised(theta, at, measured, instrument, pieces, sample_time, corner, cosines)

    found = look(theta)
    for _ in range(MOST_STEPS):
        if found.size < SMALL:
            return theta, found, True
        share = 1.0
        while True:
            tried = _moved(theta, at, share * found.step)
            new = look(tried)
            if new.size < found.size or share < 0.1:
                break
            share *= 0.5
        if not new.size < found.size:
            return theta, found, found.size < 0.5
        theta, found = tried, new
    return theta, found, found.size < 0.5
