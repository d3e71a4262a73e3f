"""The exosystem: the recurrence that a slave's reference obeys, from its samples.

With f the slave's reference and g a second signal along the path, w = [f; g] turns and grows from
sample to sample, w(k+1) = S̄(k) w(k), and both obey one recurrence of second order,

    f(k+2) + α1(k+1) f(k+1) + α2(k) f(k) = 0        (the same for g),                   (R)

which is S(z) f = 0 with S(z) = z² + z α1(k) + α2(k), coefficients standing to the right of the
shift. In polar form (14), (15), l = |w| and η its angle, d(k) = η(k+1) - η(k),

    S̄(k)  = l(k+1)/l(k) Rot(d(k))                                                       (13), (18)
    α1(k) = - l(k+1)/l(k)  sin(d(k-1) + d(k)) / sin d(k-1)                              (A1)
    α2(k) =   l(k+2)/l(k)  sin d(k+1) / sin d(k)                                        (A2)

α1 at the instant k takes the samples k-1, k, k+1, and α2 takes k, k+1, k+2. S̄ is the exponential
of the integral of (18) over the sample without error: the matrices of (18) commute, and the
integrals of l'/l and η' are differences of ln l and η. Written with the angles, (R) holds to
rounding of f even where the quotients are large; written with the products f g⁺ - f⁺ g, which is
the same, it loses the digits that these lose.

**Singular instants.** Where w does not turn, sin d = 0, there is no recurrence: the line from the
origin touches the curve (g, f). With g = s, the position, that is f = s f'(s), s = 4.4934, 7.7253,
... for f = sin s. An offset added to s moves these instants and cannot remove them; it removes l =
0 where f and s start at 0 together. Near a singular instant α is large for a sample or two. Below
:data:`STANDING` the coefficients (-2, 1) of a straight line stand in, as when the path stands
still.

**The second signal** is a matter of choice (:data:`SIGNALS`): nothing but (R) for f is used of it.

``"position"``: s, the paper's.
``"master"``: the master's coordinate less its middle. Its instants are singular where the tangent
of the *contour*, in the plane of master and slave, goes through the point (middle, 0): none if the
contour is star-shaped about that point. For a circle it is cos θ, and α = (-2 cos Δθ, 1) constant.
``"derivative"``: f', singular where f f'' = f'². For f = sin s it is cos s: no such instant.

:func:`turning` measures how well w turns along a path; the law takes the best by it.

References
----------
.. [CaoZhang] Proposition 4.1, (13) to (20).

Differences from the paper
--------------------------
η by the arctangent of both components: (15), an arccosine, is right for s >= 0 only. The choice of
the second signal. The coefficients in closed form, with their time indices.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.typing import Array, Vector

__all__ = ["SIGNALS", "STANDING", "alpha_1", "alpha_2", "polar", "transition", "turning"]

SIGNALS = ("best", "position", "master", "derivative")
"""Names of second signals; the first takes the best of the others."""
STANDING = 1e-13
"""|sin d| below which w counts as standing: what rounding of f and g alone would make."""


def polar(f: Array, g: Array) -> tuple[Array, Array]:
    """Return l and η of (14), (15).

    Parameters
    ----------
    f, g
        The slave's reference and the second signal, any shape.
    """
    squared = f * f + g * g
    zero = squared == 0.0
    length = jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, squared)))
    return length, jnp.arctan2(jnp.where(zero, 0.0, g), jnp.where(zero, 1.0, f))


def transition(f: Array, g: Array) -> Array:
    """Return S̄(k) of (20) from two samples each, shape (2, 2): exact.

    Parameters
    ----------
    f, g
        At k and k+1, shape (2,).
    """
    length, angle = polar(f, g)
    d = angle[1] - angle[0]
    cosine, sine = jnp.cos(d), jnp.sin(d)
    turn = jnp.stack([jnp.stack([cosine, -sine]), jnp.stack([sine, cosine])])
    return length[1] / length[0] * turn


def alpha_1(f: Array, g: Array) -> tuple[Vector, Vector]:
    """Return α1(k), and 1 where it stands on a recurrence, else 0; shape (n,).

    Where w does not turn, f may still lie on a straight line, as that of a slave that rests does:
    (-2, 1) is its recurrence.

    Parameters
    ----------
    f, g
        At k-1, k and k+1, shape (3, n).
    """
    length, angle = polar(f, g)
    before, after = angle[1] - angle[0], angle[2] - angle[1]
    sine = jnp.sin(before)
    well = (jnp.abs(sine) > STANDING) & (length[1] > 0.0)
    ratio = length[2] / jnp.where(well, length[1], 1.0)
    value = -ratio * jnp.sin(before + after) / jnp.where(well, sine, 1.0)  # (A1)
    bend = jnp.abs(f[0] - 2.0 * f[1] + f[2])
    straight = bend <= STANDING * jnp.max(jnp.abs(f), 0)
    return jnp.where(well, value, -2.0), (well | straight).astype(float)


def alpha_2(f: Array, g: Array) -> Vector:
    """Return α2(k), shape (n,).

    Parameters
    ----------
    f, g
        At k, k+1 and k+2, shape (3, n).
    """
    length, angle = polar(f, g)
    first, second = angle[1] - angle[0], angle[2] - angle[1]
    sine = jnp.sin(first)
    well = (jnp.abs(sine) > STANDING) & (length[0] > 0.0)
    ratio = length[2] / jnp.where(well, length[0], 1.0)
    return jnp.where(well, ratio * jnp.sin(second) / jnp.where(well, sine, 1.0), 1.0)  # (A2)


def turning(f: Any, f_slope: Any, g: Any, g_slope: Any) -> NDArray[Any]:
    """Return how well w turns: the least of |f g' - f' g| along a path, made comparable.

    0 is singular somewhere; 1 is the steady turn of [sin p; cos p]. Each signal is measured in its
    own largest size, and the parameter by the larger of the two rates.

    Parameters
    ----------
    f, f_slope, g, g_slope
        The signals and their slopes over the parameter, shape (n_points, n).
    """
    size_f, size_g = np.max(np.abs(f), 0), np.max(np.abs(g), 0)
    rate_f, rate_g = np.max(np.abs(f_slope), 0), np.max(np.abs(g_slope), 0)
    wronskian = f * g_slope - f_slope * g
    size = np.maximum(size_f * rate_g, size_g * rate_f)
    one_sign = np.all(wronskian > 0.0, 0) | np.all(wronskian < 0.0, 0)
    least = np.min(np.abs(wronskian), 0) / np.where(size > 0.0, size, 1.0)
    return np.where(one_sign, least, 0.0)
