"""Contour error from the natural local approximation: Meng, Lou and Zhou's cubic.

The contour is replaced by the leading terms of its canonical form at the reference point, and the
estimate is the offset from that cubic at equal coordinate t along the tangent:

    t, n, b = coordinates of the actual point in the frame at the reference point     (3)
    ε_n = n - κ t² / 2                                                                (15)
    ε_b = b - κ τ t³ / 6                                                              (16)
    error = -(ε_n N + ε_b B),   |error| = sqrt(ε_n² + ε_b²)                           (17)

Exact on straight lines; on other curves when lag or curvature vanishes. With t the lag and δ the
true error:

* Without offset (δ = 0) the estimate is off by κ' t³ / 6 to leading order, with κ' the derivative
  of the curvature over arc length: third order, as with the circle of curvature. (On a circle and
  a helix, where κ' = 0, fourth.) The cubic keeps the term κ τ t³ / 6 in b but drops the equally
  large κ' t³ / 6 in n; :class:`ExtendedNaturalLocalEstimator` keeps both.
* With an offset it is off by δ (κ t)² / 2 beside: an offset at equal t is not the distance, which
  is nearer to ε / sqrt(1 + (κ t)²). Second order in the lag, in proportion to the error itself.
* The vector is perpendicular to the tangent at the reference point, not at the foot point: its
  direction is off by the angle κ t.

It fails when κ t is no longer small, and at corners, where the curve that holds is the one of the
reference point.

The coordinates are formed without a frame, in any number of coordinates: with d the actual point as
seen from the reference point, T the tangent, r_ss and r_sss the derivatives over arc length,

    t = T·d,   κ N = r_ss,   κ τ B = the part of r_sss normal to T and N              (7)

so that in the plane nothing is singular where the curvature passes zero. In space N has no limit
there and κ τ B goes to zero; where the contour is straight (``contours.frenet.is_straight``) it is
set to zero. Near such a point N turns quickly, and the estimate with it.

References
----------
.. [MengLouZhou] section II; equation numbers are the paper's.

Differences from the paper
--------------------------
The paper's estimate is the pair (ε_n, ε_b); here the same as a vector, from the actual point to the
contour, hence the sign. Curves with κ τ = 0, which the paper leaves out, are taken. In the plane
the normal is the left one and the curvature signed, whichever way the contour turns.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contours.frenet import arc_length_derivatives, is_straight
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector

__all__ = ["NaturalLocalEstimator"]

_LEAST = 1e-100
"""Square of the curvature below which its direction is not formed: squares of it underflow."""


class NaturalLocalEstimator(Estimator):
    """Contour error vector to the natural local approximation of the contour; see the module."""

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour's first three derivatives at the reference parameter."""
        return EstimatorNeeds(derivatives=3)

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the estimated contour error vector.

        Parameters
        ----------
        sample
            One instant, in tool space; ``geometry`` to order 3.

        Returns
        -------
        AxisVector
            From the actual point to the cubic at equal t, shape (n_coordinates,) [m].
        """
        rows = arc_length_derivatives(sample.geometry)
        point, tangent, bend, third = rows[0], rows[1], rows[2], rows[3]
        d = sample.position - point
        t = tangent @ d  # (3)
        square = bend @ bend
        straight = is_straight(sample.geometry) | (square < _LEAST)
        along = (bend @ third) / jnp.where(straight, 1.0, square)
        across = third - tangent * (tangent @ third) - bend * along  # κ τ B of (7)
        across = jnp.where(straight, 0.0, across)
        # (15), (16): d - t T holds n N + b B
        return -(d - tangent * t - bend * (t**2 / 2.0) - across * (t**3 / 6.0))
