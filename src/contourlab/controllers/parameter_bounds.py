"""Between what values an adaptive law looks for the parameters of its axes.

θ = (M, B, A, d) for each axis, in units of the command: rows as ``least_squares.PARAMETERS``, shape
(4, n_axes). The bounds come from the nominal model and how uncertain it is said to be, a share of
each of its values; d lies within plus and minus a limit.

A parameter that the model has at 0 stays at 0: what it would explain goes to d. Bounds are a
promise: a law that is robust within them is not robust beyond.

References
----------
.. [HuYaoWang] (7), Assumption 1; the paper's own bounds are chosen and not derived.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.errors import ConfigurationError
from contourlab.machines.base import NominalModel
from contourlab.typing import Array

__all__ = ["nominal_parameters", "parameter_bounds"]

LEAST_MASS = 0.05
"""Share of the nominal mass that is left at an uncertainty of 1 and more."""
COMMAND_SHARE = 0.25
"""Share of the command limit within which d lies if nothing is said."""


def nominal_parameters(model: NominalModel) -> Array:
    """Return θ of a nominal model, shape (4, n_axes), d = 0.

    Parameters
    ----------
    model
        Nominal model.
    """
    gain = jnp.asarray(model.gain)
    rows = [jnp.asarray(x) / gain for x in (model.mass, model.viscous, model.coulomb)]
    return jnp.stack([*rows, jnp.zeros_like(gain)])


def parameter_bounds(
    model: NominalModel, uncertainty: Any, disturbance_limit: Any = None
) -> tuple[Array, Array]:
    """Return the lower and upper bounds of θ, shape (4, n_axes) each.

    Parameters
    ----------
    model
        Nominal model.
    uncertainty
        Share of the model's value by which the truth may differ, >= 0: one number, or three for
        mass, viscous and Coulomb friction. 1 and more: from (nearly) nothing.
    disturbance_limit
        Largest d, > 0 [command], one number or one per axis; a quarter of the command limit if
        None.

    Raises
    ------
    ConfigurationError
        A value out of bounds, of the wrong shape, or no limit where the command has none.
    """
    n = model.n_axes
    share = jnp.asarray(uncertainty, float)
    if np.shape(share) not in ((), (3,)):
        raise ConfigurationError(
            "uncertainty must be one number or three, for mass, viscous and coulomb, got shape "
            f"{np.shape(share)}"
        )
    if is_concrete(share) and not np.all(np.asarray(share) >= 0.0):
        raise ConfigurationError(f"uncertainty must be >= 0, got {np.min(np.asarray(share)):g}")
    if disturbance_limit is None:
        limit = COMMAND_SHARE * jnp.asarray(model.command_limit)
        if is_concrete(limit) and not np.all(np.isfinite(limit)):
            raise ConfigurationError(
                "disturbance_limit must be given: the model's command has no limit to take a share "
                "of"
            )
    else:
        limit = jnp.asarray(disturbance_limit, float)
        if np.shape(limit) not in ((), (1,), (n,)):
            raise ConfigurationError(
                f"disturbance_limit must be one number or one for each of the {n} axes, got shape "
                f"{np.shape(limit)}"
            )
    limit = jnp.broadcast_to(limit, (n,))
    nominal = nominal_parameters(model)
    share = jnp.broadcast_to(share, (3,))[:, None]
    least = jnp.array([LEAST_MASS, 0.0, 0.0])[:, None]
    lower = nominal[:3] * jnp.maximum(1.0 - share, least)
    upper = nominal[:3] * (1.0 + share)
    return (
        jnp.concatenate([lower, -limit[None]]),
        jnp.concatenate([upper, limit[None]]),
    )
