"""The nominal model as a difference equation: what it does to a command that is held.

    y(k) = B(q⁻¹) / A(q⁻¹) u(k-1),   A = 1 + a_1 q⁻¹ + a_2 q⁻²,   B = b_0 + b_1 q⁻¹

is M y'' + B y' + S y = K u with u held over each sample time T (zero-order hold), exactly; Coulomb
friction is left out. Without stiffness, with z = -T B / M and e = e^z,

    A = 1 - (1 + e) q⁻¹ + e q⁻²,   B = (K T² / M) (φ₂(z) + (φ₁(z)² - e φ₂(z)) q⁻¹).        (1)
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.errors import ConfigurationError
from contourlab.machines.base import NominalModel
from contourlab.machines.exponential import LARGEST_NORM, exponential, phi
from contourlab.typing import Scalar

__all__ = ["held_polynomials"]


def held_polynomials(model: NominalModel, sample_time: Scalar) -> tuple[jax.Array, jax.Array]:
    """Return numerator and denominator of the sampled model, axis by axis.

    Parameters
    ----------
    model
        Nominal model.
    sample_time
        T [s].

    Returns
    -------
    numerator
        b_0, b_1, shape (n_axes, 2) [m per unit of command].
    denominator
        1, a_1, a_2, shape (n_axes, 3).

    Raises
    ------
    ConfigurationError
        An axis with a stiffness whose modes are too fast for the sample time.
    """
    mass, viscous, gain = (jnp.asarray(x) for x in (model.mass, model.viscous, model.gain))
    if model.stiffness is not None:
        return _sprung(mass, viscous, jnp.asarray(model.stiffness), gain, sample_time)
    e, first, second = phi(-sample_time * viscous / mass)
    size = gain * sample_time**2 / mass
    numerator = jnp.stack([size * second, size * (first**2 - e * second)], -1)  # (1)
    return numerator, jnp.stack([jnp.ones_like(e), -(1.0 + e), e], -1)


def _sprung(
    mass: Any, viscous: Any, stiffness: Any, gain: Any, sample_time: Scalar
) -> tuple[jax.Array, jax.Array]:
    zero = jnp.zeros_like(mass)
    rows = [
        [zero, zero + 1.0, zero],
        [-stiffness / mass, -viscous / mass, gain / mass],
        [zero, zero, zero],
    ]
    block = sample_time * jnp.stack([jnp.stack(row, -1) for row in rows], -2)
    size = jnp.max(jnp.sum(jnp.abs(block), -1))
    if is_concrete(size) and not size <= LARGEST_NORM:
        raise ConfigurationError(
            f"an axis is too fast for the sample time: a mode times sample time must be <= "
            f"{LARGEST_NORM:g}, got {float(np.asarray(size)):g}"
        )
    held = exponential(block)
    f, g = held[..., :2, :2], held[..., :2, 2]
    trace = f[..., 0, 0] + f[..., 1, 1]
    determinant = f[..., 0, 0] * f[..., 1, 1] - f[..., 0, 1] * f[..., 1, 0]
    later = jnp.sum(f[..., 0, :] * g, -1) - trace * g[..., 0]
    numerator = jnp.stack([g[..., 0], later], -1)
    return numerator, jnp.stack([jnp.ones_like(trace), -trace, determinant], -1)
