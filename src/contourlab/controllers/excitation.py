"""How much a motion says about the parameters of each axis: the windowed excitation.

    ∫_t^{t+T} y yᵀ dτ ≥ κ_p I                                                            (26)

with y the filtered regressor of :mod:`~contourlab.controllers.least_squares`: least squares find
all parameters if the least eigenvalue of the left side stays above some κ_p > 0. The eigenvalue of
what the motion never moves is zero, and its eigenvector says which combination that is (mass and
stiffness apart: in one round of an ellipse, viscous and Coulomb friction are told apart only by how
the speed varies).

For use outside a loop: eigenvalues are found with NumPy.

References
----------
.. [HuYaoWang] (26).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.least_squares import BoundLeastSquares, FilterState
from contourlab.errors import ConfigurationError

__all__ = ["Excitation", "filtered_regressors", "windowed_excitation"]


class Excitation(NamedTuple):
    """The windowed excitation of each axis over time."""

    time: NDArray[Any]
    """Start of each window [s], shape (n_windows,)."""
    smallest: NDArray[Any]
    """Least eigenvalue of the left side of (26), shape (n_windows, n_axes)."""
    largest: NDArray[Any]
    """Largest eigenvalue."""
    weakest: NDArray[Any]
    """Eigenvector of the least, shape (n_windows, 4, n_axes): what is least known."""


@jax.jit
def _filtered(law: BoundLeastSquares, position: Any, before: Any) -> Any:
    n = position.shape[1]
    state = FilterState(position[0], jnp.zeros((2, 4, n)), jnp.zeros(()))

    def step(state: FilterState, row: Any) -> Any:
        regressor, wanted, state = law.filtered(state, *row)
        return state, (regressor, wanted)

    return jax.lax.scan(step, state, (position, before))[1]


def filtered_regressors(
    law: BoundLeastSquares, position: Any, command: Any
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return y and u_f over a record that begins at rest.

    Parameters
    ----------
    law
        Of ``FilteredLeastSquares.bind``; its filters are used, nothing is learned.
    position
        Measured, shape (n_samples, n_axes) [m].
    command
        Row k acts from row k of the positions to the next, shape (n_samples, n_axes).

    Returns
    -------
    tuple
        y, shape (n_samples, 4, n_axes), and u_f, shape (n_samples, n_axes) [command].

    Raises
    ------
    ConfigurationError
        Records of different shapes.
    """
    position, command = np.asarray(position, float), np.asarray(command, float)
    if position.ndim != 2 or position.shape != command.shape:
        raise ConfigurationError(
            f"position and command must have one shape (n_samples, n_axes), got {position.shape} "
            f"and {command.shape}"
        )
    before = np.concatenate([np.zeros_like(command[:1]), command[:-1]])
    regressor, wanted = _filtered(law, position, before)
    return np.asarray(regressor), np.asarray(wanted)


def windowed_excitation(
    regressor: Any, sample_time: float, window: float, *, scale: Any = 1.0, stride: int = 1
) -> Excitation:
    """Return the eigenvalues of (26) over windows of a record.

    Parameters
    ----------
    regressor
        y, shape (n_samples, 4, n_axes).
    sample_time
        [s].
    window
        T > 0 [s]; at most the record.
    scale
        What one unit of each parameter is, shape (4,) or (4, n_axes): y is multiplied by it, so
        that the eigenvalues of parameters of different units can be compared; 1 as in the paper.
    stride
        Samples from one window to the next, >= 1.

    Raises
    ------
    ConfigurationError
        A regressor or scale of the wrong shape, a sample time or stride out of bounds, a window of
        less than one sample or longer than the record.
    """
    y = np.asarray(regressor, float)
    if y.ndim != 3 or y.shape[1] != 4:
        raise ConfigurationError(f"regressor must have shape (n_samples, 4, n_axes), got {y.shape}")
    if not 0.0 < sample_time < np.inf:
        raise ConfigurationError(f"sample_time must be > 0 s and finite, got {sample_time!r}")
    if isinstance(stride, bool) or not isinstance(stride, (int, np.integer)) or stride < 1:
        raise ConfigurationError(f"stride must be a whole number >= 1, got {stride!r}")
    count = round(window / sample_time) if np.isfinite(window) else 0
    if not 1 <= count <= len(y):
        raise ConfigurationError(
            f"window must be >= {sample_time:g} s and <= {len(y) * sample_time:g} s, the record's "
            f"length, got {window:g} s"
        )
    factor = np.asarray(scale, float)
    if factor.shape not in ((), (4,), y.shape[1:]):
        raise ConfigurationError(
            f"scale must be a number or have shape (4,) or {y.shape[1:]}, got {factor.shape}"
        )
    y = y * (factor[:, None] if factor.ndim == 1 else factor)
    starts = np.arange(0, len(y) - count + 1, stride)
    products = y[:, :, None] * y[:, None]
    total = np.concatenate([np.zeros_like(products[:1]), np.cumsum(products, axis=0)])
    matrices = (total[starts + count] - total[starts]) * sample_time
    values, vectors = np.linalg.eigh(np.moveaxis(matrices, 3, 1))
    return Excitation(
        starts * sample_time, values[..., 0], values[..., -1],
        np.moveaxis(vectors[..., 0], 2, 1),
    )  # fmt: skip
