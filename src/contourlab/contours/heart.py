"""A heart: a circle with the cusp of |cos t|^(2/3) added, made smooth.

References
----------
.. [CaoZhang] the heart contour r1 = cos t, r2 = sin t + (cos t)^(2/3).

Differences from the paper
--------------------------
As printed, the power is complex where cos t < 0, and the curve has cusps at the notch and at the
tip. Here it is (cos² t + δ²)^(1/3), real, even and smooth, with δ the smoothing. The paper smooths
its hardware contour too and does not say how.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from contourlab.configuration import real
from contourlab.contours.base import derivatives_by_jvp
from contourlab.contours.circle import TURN
from contourlab.contours.placed import PlacedContour
from contourlab.typing import Array, AxisVector, Derivatives, Scalar

__all__ = ["Heart"]

_PANELS = 24
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


class Heart(PlacedContour):
    """A heart; the parameter is t [rad], 0 to 2π, and goes round counter-clockwise.

    Before it is turned and shifted, x = R cos t, y = R (sin t + (cos² t + δ²)^(1/3)). The notch is
    at t = π/2, the tip at 3π/2; there, with q = (2/3) δ^(-4/3), the curvature is (1 - q) / R and
    (1 + q) / R.

    Parameters
    ----------
    radius
        R, > 0 [m].
    smoothing
        δ, > 0: the notch and the tip are rounded over about δ of t.
    center
        Of the circle that the heart is made from, shape (2,) [m].
    rotation
        Angle by which the heart leans to its left [rad].

    Raises
    ------
    GeometryError
        A centre that is not of 2 coordinates.
    ConfigurationError
        A radius or smoothing that is not > 0; a number that is not finite.
    """

    radius: Float[Array, " ..."] = real(unit="m", above=0.0, ndim=0)
    smoothing: Float[Array, " ..."] = real(above=0.0, ndim=0, default=0.1)

    @property
    def domain(self) -> tuple[Scalar, Scalar]:
        """0 and 2π [rad]."""
        return 0.0, TURN

    @property
    def closed(self) -> bool:
        """Always."""
        return True

    def own_derivatives(self, parameter: Scalar, order: int) -> Derivatives:
        """Return the point and its derivatives over t, before the curve is turned and shifted.

        Parameters
        ----------
        parameter
            t [rad].
        order
            Highest derivative, >= 0.
        """

        def point(t: Scalar) -> AxisVector:
            cosine, sine = jnp.cos(t), jnp.sin(t)
            bulge = jnp.cbrt(cosine * cosine + self.smoothing**2)
            return self.radius * jnp.stack([cosine, sine + bulge])

        return derivatives_by_jvp(point, parameter, order)

    def arc_length(self, start: Scalar, end: Scalar) -> Scalar:
        """Return the length between two parameters [m], by quadrature that is fine at the cusps.

        Counted from the notch or tip at which cos t = 0, t = δ sinh w makes the speed smooth in w
        however small δ is.

        Parameters
        ----------
        start, end
            t [rad].
        """
        return self._travelled(end) - self._travelled(start)

    def _travelled(self, t: Scalar) -> Scalar:
        """Return the length from the notch at π/2."""
        middle = jnp.round((t - 0.25 * TURN) / (0.5 * TURN))
        middle = jax.lax.stop_gradient(middle)
        own = t - 0.25 * TURN - middle * 0.5 * TURN
        upward = 1.0 - 2.0 * jnp.mod(middle, 2.0)  # sin t at the notch and at the tip
        quarter = self._from_middle(1.0, 0.25 * TURN) + self._from_middle(-1.0, 0.25 * TURN)
        return self._from_middle(upward, own) + middle * quarter

    def _from_middle(self, upward: Scalar, own: Scalar) -> Scalar:
        delta = self.smoothing
        edge = jnp.arcsinh(own / delta)
        panels = (jnp.arange(_PANELS)[:, None] + 0.5 + 0.5 * jnp.asarray(_NODES)) / _PANELS
        w = edge * panels
        tau = delta * jnp.sinh(w)
        # with t = ±π/2 + τ: cos t is -sin τ or sin τ, sin t is cos τ or -cos τ
        sine, cosine = jnp.sin(tau), jnp.cos(tau)
        bulge = 2.0 / 3.0 * cosine / jnp.cbrt(sine * sine + delta**2) ** 2
        speed = self.radius * jnp.hypot(cosine, sine * (bulge - upward))
        return 0.5 * edge / _PANELS * jnp.sum(speed * delta * jnp.cosh(w) * jnp.asarray(_WEIGHTS))
