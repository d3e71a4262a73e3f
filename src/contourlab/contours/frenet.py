"""Derivatives over arc length: of the point, of curvature and of torsion, to any order.

A contour gives derivatives over its own parameter. Laws and estimators speak of arc length s: of
the tangent r_s, the curvature vector r_ss, and of how curvature and torsion change along the path.
The rows of derivatives are taken as a truncated Taylor series; products, quotients and square roots
of such series, and d/ds = (1/σ) d/dp with the series of the speed σ, give every order without a
formula of its own, exact to rounding. All is plain arithmetic on a fixed number of terms.

In the plane the curvature is signed and nothing is singular. In space, with C = r_s x r_ss,

    κ² = r_ss · r_ss                                             (1)
    τ = C · r_sss / κ²                                           (2)

have no derivative where κ = 0: there every derivative of both is given as 0. What passes through
an inflection of a spatial contour without a jump are the rows r_ss, r_sss themselves.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from contourlab.contours.base import only_in_space
from contourlab.errors import GeometryError
from contourlab.typing import Array, Derivatives, Flag, Scalar

__all__ = ["CurvatureDerivatives", "arc_length_derivatives", "curvature_derivatives", "is_straight"]

Terms = list[Any]
"""Taylor coefficients, f = Σ terms[k] x^k; each a number or a vector."""

_STRAIGHT = 1e-12


class CurvatureDerivatives(eqx.Module):
    """Curvature and torsion at one point, with their derivatives over arc length."""

    curvature: Float[Array, " n_curvature"]
    """κ, dκ/ds, d²κ/ds² ... [1/m, 1/m², ...]; signed in the plane."""
    _torsion: Float[Array, " n_torsion"] | None = None

    @property
    def torsion(self) -> Array:
        """τ, dτ/ds ... [1/m, 1/m², ...], one fewer; a GeometryError in the plane."""
        return only_in_space("torsion", self._torsion)  # type: ignore[no-any-return]


def is_straight(derivatives: Derivatives) -> Flag:
    """Return whether a contour does not curve at a point, to rounding.

    That is so where |r' x r''| is no more than 1e-12 of |r'| max(|r''|, sqrt(|r'| |r'''|)), the
    last only with a third derivative.

    Parameters
    ----------
    derivatives
        Over the parameter, to order 2 at least, shape (order + 1, n_axes).
    """
    first, second = derivatives[1], derivatives[2]
    speed2 = first @ first
    bend2 = second @ second
    across2 = _across(first, second, speed2)
    size = bend2
    if len(derivatives) > 3:
        third2 = derivatives[3] @ derivatives[3]
        size = jnp.maximum(size, _root(speed2) * _root(third2))
    return across2 <= _STRAIGHT**2 * speed2 * size


def arc_length_derivatives(derivatives: Derivatives) -> Derivatives:
    """Return the point and its derivatives over arc length.

    Parameters
    ----------
    derivatives
        Over the parameter, shape (order + 1, n_axes).

    Returns
    -------
    Derivatives
        Row k is d^k r / ds^k, same shape [m^(1 - k)]. Where the contour stands still (r' = 0) all
        rows but the first are 0.
    """
    order = len(derivatives) - 1
    if order < 1:
        return derivatives
    speed2 = derivatives[1] @ derivatives[1]
    still = speed2 == 0.0
    terms = _terms(derivatives)
    slope = _derivative(terms)
    # 1/σ, the derivative of the parameter over arc length
    square = _product(slope, slope)
    inverse = _reciprocal(_square_root([jnp.where(still, 1.0, square[0]), *square[1:]]))
    rows, current = [derivatives[0]], terms
    for _ in range(order):
        current = _product(_derivative(current), inverse)  # d/ds = (1/σ) d/dp
        rows.append(jnp.where(still, 0.0, current[0]))
    return jnp.stack(rows)


def curvature_derivatives(derivatives: Derivatives) -> CurvatureDerivatives:
    """Return curvature and torsion and their derivatives over arc length.

    Parameters
    ----------
    derivatives
        Over the parameter, to order n >= 2, in the plane or, with n >= 3, in space.

    Returns
    -------
    CurvatureDerivatives
        n - 1 rows of the curvature; n - 2 of the torsion. Where a spatial contour is straight
        (:func:`is_straight`) all are 0.

    Raises
    ------
    GeometryError
        Too few derivatives, or neither two nor three coordinates.
    """
    rows, n_axes = derivatives.shape
    if n_axes not in (2, 3):
        raise GeometryError(
            f"curvature and torsion need a contour of 2 or 3 axes, this one has {n_axes}"
        )
    if rows < n_axes + 1:
        raise GeometryError(
            f"curvature {'and torsion ' if n_axes == 3 else ''}in {n_axes} coordinates need "
            f"derivatives to order {n_axes} at least, got order {rows - 1}"
        )
    tangent = _derivative(_terms(arc_length_derivatives(derivatives)))
    bend = _derivative(tangent)
    if n_axes == 2:
        turned = [jnp.stack([-t[1], t[0]]) for t in tangent]
        return CurvatureDerivatives(_rows(_product(turned, bend)))
    straight = is_straight(derivatives)
    square = _product(bend, bend)  # (1)
    square = [jnp.where(straight, 1.0, square[0]), *square[1:]]
    curvature = _square_root(square)
    cross = _product(tangent, bend, jnp.cross)
    torsion = _product(_product(cross, _derivative(bend)), _reciprocal(square))  # (2)
    return CurvatureDerivatives(
        jnp.where(straight, 0.0, _rows(curvature)), jnp.where(straight, 0.0, _rows(torsion))
    )


def _across(first: Array, second: Array, speed2: Scalar) -> Scalar:
    """Return |r' x r''|² in any number of coordinates, without cancellation."""
    along = (first @ second) / jnp.where(speed2 == 0.0, 1.0, speed2)
    across = second - first * along
    return speed2 * (across @ across)


def _root(square: Scalar) -> Scalar:
    return jnp.sqrt(jnp.where(square == 0.0, 1.0, square)) * (square != 0.0)


def _terms(derivatives: Derivatives) -> Terms:
    factorial, terms = 1.0, []
    for k, row in enumerate(derivatives):
        factorial *= max(k, 1)
        terms.append(row / factorial)
    return terms


def _rows(terms: Terms) -> Array:
    """Return the derivatives that Taylor coefficients stand for."""
    factorial, rows = 1.0, []
    for k, term in enumerate(terms):
        factorial *= max(k, 1)
        rows.append(term * factorial)
    return jnp.stack(rows)


def _derivative(terms: Terms) -> Terms:
    return [k * term for k, term in enumerate(terms)][1:]


def _times(first: Any, second: Any) -> Any:
    """Multiply numbers, a number and a vector, or two vectors to their inner product."""
    both = jnp.ndim(first) == 1 and jnp.ndim(second) == 1
    return first @ second if both else first * second


def _product(first: Terms, second: Terms, times: Any = _times) -> Terms:
    length = min(len(first), len(second))
    return [sum(times(first[i], second[k - i]) for i in range(k + 1)) for k in range(length)]


def _square_root(terms: Terms) -> Terms:
    root = [jnp.sqrt(terms[0])]
    for k in range(1, len(terms)):
        known = sum(root[i] * root[k - i] for i in range(1, k))
        root.append((terms[k] - known) / (2.0 * root[0]))
    return root


def _reciprocal(terms: Terms) -> Terms:
    inverse = [1.0 / terms[0]]
    for k in range(1, len(terms)):
        inverse.append(-inverse[0] * sum(terms[i] * inverse[k - i] for i in range(1, k + 1)))
    return inverse
