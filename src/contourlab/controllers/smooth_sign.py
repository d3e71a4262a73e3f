"""The smooth sign by which laws and estimators write Coulomb friction.

    S_f(v) = (2/π) arctan(v / v_0)    or    tanh(v / v_0)

The first comes near ±1 only as v_0 / v: 0.6 % of the friction are missing at 100 v_0. The second is
there at 3 v_0.

References
----------
.. [HuYaoWang] section IV.B: the first, v_0 = 1/9000 m/s.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from contourlab.typing import Array

__all__ = ["SHAPES", "smooth_sign"]

SHAPES = ("arctan", "tanh")


def smooth_sign(velocity: Array, width: Array, shape: str) -> Array:
    """Return S_f(v), between -1 and 1.

    Parameters
    ----------
    velocity
        v [m/s].
    width
        v_0, > 0 [m/s].
    shape
        ``"arctan"`` or ``"tanh"``.
    """
    x = velocity / width
    return 2.0 / np.pi * jnp.arctan(x) if shape == "arctan" else jnp.tanh(x)
