"""The immersion: an input that makes an axis follow its exosystem, from the axis's own copy.

Unit 1 is a copy of the axis, A(z) u_r = B(z) u. Unit 2 feeds it back so that what goes round obeys
the exosystem, S(z) u_r = 0, whatever it started from. In the paper unit 2 is u = -Q(z)⁻¹ P(z) u_r
with the Sylvester equation

    A(z) Q(z) + B(z) P(z) = S(z) Q(z),    Q = z^(n-1) + ... + q_(n-1),                  (29)

coefficients standing to the right of the shift, which does not commute with them:
z c(k) = c(k+1) z. For n = 2, Q = z + q(k) and P = z p1(k) + p2(k), this is three equations,

    [a1; a2; 0] + [1; a1; a2] q + [b1 0; b2 b1; 0 b2] [p1; p2]
        = [α1(k-1); α2(k-1); 0] + [1; α1(k); α2(k)] q                                   (29')

at q(k), p1(k), p2(k), with the closed form, δ = α - a and β = b2/b1, ν(k) = δ2(k)/β - δ1(k),

    q(k) = β ν(k-1)/ν(k),   p1(k) = δ1(k-1)/b1,   p2(k) = δ2(k) q(k)/b2                 (C)

and the matrices of unit 2, Φ2(k) = -q(k), Γ2(k) = p2(k) - p1(k+1) q(k), D2(k) = p1(k+1). The
paper's (30), which has its columns at α(k), α(k+1), gives q and p of one sample later: to be used
as Φ2(k+1), but D2(k). Taking all of it at k, as it reads, follows nothing exactly
(:func:`unit_2_as_printed`; a test keeps it).

**Without division.** q divides by ν, which vanishes now and then. It need not be formed: u_r = f
obeys A f = B u and S f = 0, hence

    B(z) u = -Δ(z) u_r,    Δ = S - A,                                                   (D)
    b1 u(k) = -Σ_{i≥2} b_i u(k-i+1) - Σ_{i≥1} δ_i(k-i+1) u_r(k-i+1).

It is the same u: the state ξ2 of unit 2 is χ/ν with χ(k+1) = -β χ(k) - ν(k) u_r(k) (a test).
(D) is an inverse of the axis's numerator, so its zeros must be inside the unit circle. It holds for
every order n: S is brought to it by the filter z^(n-2), α = (α1, α2, 0, ..., 0), which is what the
zero block of (34) says. The state η is that of the transposed direct form,

    u(k) = (η_1(k) - δ_1(k) u_r(k)) / b1                                                (D1)
    η_i(k+1) = η_(i+1)(k) - b_(i+1) u(k) - δ_(i+1)(k) u_r(k),   i = 1 ... n-1.          (D2)

u(k) takes α1(k), thus one sample ahead; (D2) takes α2(k), and is not needed before the next sample,
where that is again one ahead.

References
----------
.. [CaoZhang] (25) to (32), Lemma 5.1.

Differences from the paper
--------------------------
(29) to (31) with right time indices; p has n components, not n - 1; Γ2 is p2 - D2 q, not p;
the lower right of (28) is G - H D2 C; the division-free form.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.pulse_model import PulseModel
from contourlab.typing import Array, AxisVector, Vector

__all__ = [
    "InternalUnit",
    "Unit2",
    "solve_closed_form",
    "solve_general",
    "unit_2",
    "unit_2_as_printed",
]


class Unit2(NamedTuple):
    """Matrices of (27) at one instant, for n = 2; numbers."""

    phi: float
    psi: float
    gamma: float
    direct: float


def solve_general(
    a: Any, b: Any, alpha_before: Any, alpha: Any
) -> tuple[float, NDArray[Any]]:  # fmt: skip
    """Return q(k) and p(k) by solving the 3 x 3 system (29').

    Parameters
    ----------
    a, b
        Of the axis, shape (2,).
    alpha_before, alpha
        (α1, α2) at k-1 and k, shape (2,).
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    matrix = np.array([
        [0.0, b[0], 0.0],
        [a[0] - alpha[0], b[1], b[0]],
        [a[1] - alpha[1], 0.0, b[1]],
    ])  # fmt: skip
    right = np.array([alpha_before[0] - a[0], alpha_before[1] - a[1], 0.0])
    found = np.linalg.solve(matrix, right)
    return float(found[0]), found[1:]


def solve_closed_form(a: Any, b: Any, alpha_before: Any, alpha: Any) -> tuple[float, NDArray[Any]]:
    """Return q(k) and p(k) by (C).

    Parameters
    ----------
    a, b
        Of the axis, shape (2,).
    alpha_before, alpha
        (α1, α2) at k-1 and k, shape (2,).
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    before, now, beta = np.asarray(alpha_before) - a, np.asarray(alpha) - a, b[1] / b[0]
    q = beta * (before[1] / beta - before[0]) / (now[1] / beta - now[0])  # (C)
    return float(q), np.array([before[0] / b[0], now[1] * q / b[1]])


def unit_2(a: Any, b: Any, alpha_before: Any, alpha: Any) -> Unit2:
    """Return unit 2 at k, with right time indices.

    Parameters
    ----------
    a, b
        Of the axis, shape (2,).
    alpha_before, alpha
        (α1, α2) at k-1 and k, shape (2,).
    """
    q, p = solve_general(a, b, alpha_before, alpha)
    direct = float((np.asarray(alpha)[0] - np.asarray(a)[0]) / np.asarray(b)[0])  # p1(k+1)
    return Unit2(-q, 1.0, float(p[1] - direct * q), direct)


def unit_2_as_printed(a: Any, b: Any, alpha: Any, alpha_after: Any) -> Unit2:
    """Return unit 2 at k as (29) to (31) read: the solution for k+1, all of it used at k.

    Parameters
    ----------
    a, b
        Of the axis, shape (2,).
    alpha, alpha_after
        (α1, α2) at k and k+1, shape (2,).
    """
    q, p = solve_general(a, b, alpha, alpha_after)
    return Unit2(-q, 1.0, float(p[1] - p[0] * q), float(p[0]))


class InternalUnit(NamedTuple):
    """State of (D) for several axes: shape (n_axes, n - 1) [m]."""

    memory: Array

    def output(self, model: PulseModel, delta_1: Vector, copy: AxisVector) -> AxisVector:
        """Return u of (D1), shape (n_axes,).

        Parameters
        ----------
        model
            Of the axes.
        delta_1
            α1(k) - a1, shape (n_axes,).
        copy
            u_r, the output of the axes' copy, shape (n_axes,) [m].
        """
        return (self.memory[:, 0] - delta_1 * copy) / model.numerator[:, 0]  # (D1)

    def advance(
        self, model: PulseModel, delta: Array, copy: AxisVector, command: AxisVector
    ) -> InternalUnit:
        """Return the state one sample later.

        Parameters
        ----------
        model
            Of the axes.
        delta
            α(k) - a, shape (n_axes, n).
        copy
            u_r(k), shape (n_axes,) [m].
        command
            u(k) of (D1), shape (n_axes,).
        """
        zero = jnp.zeros_like(self.memory[:, :1])
        ahead = jnp.concatenate([self.memory[:, 1:], zero], -1)
        driven = model.numerator[:, 1:] * command[:, None] + delta[:, 1:] * copy[:, None]
        return InternalUnit(ahead - driven)  # (D2)
