"""Contour error from the canonical form of the contour to third order, curvature changes included.

As the natural local approximation (:mod:`contourlab.contour_errors.natural_local`), but with every
term of third order across the tangent that the paper's (9) has: with t the coordinate along the
tangent,

    ε_n = n - κ t² / 2 - κ' t³ / 6                                (1)
    ε_b = b - κ τ t³ / 6                                          (2)
    error = -(ε_n N + ε_b B)                                      (3)

where κ' is the derivative of the curvature over arc length. Without a frame, with d the actual
point as seen from the reference point, T the tangent, t = T·d and r_ss, r_sss derivatives over arc
length,

    c(t) = t T + r_ss t² / 2 + (r_sss - T (T·r_sss)) t³ / 6       (4)
    error = w = c(t) - d                                          (5)

(4) has arc length s replaced by t = s - κ² s³ / 6: of fourth order in c. There is no division by
the curvature, nothing jumps where it passes zero, in the plane, in space and beyond.

Exact on straight lines. With t the lag and δ the true error:

* Without offset the estimate is off by |c₄| t⁴ / 24 to leading order, with c₄ the part across the
  tangent of the fourth derivative of the contour *over t*, r_ssss + 4 κ² r_ss: fourth order.
* With an offset it is off by δ (κ t)² / 2 beside, as the natural local approximation is, and its
  direction by the angle κ t.

``perpendicular`` removes the second: w runs to the contour at equal t and meets it at a slant. Its
part across the tangent c'(t) of the contour there is the distance from that tangent line,

    error = w - c' (c'·w) / (c'·c'),   c' = T + r_ss t + (r_sss - T (T·r_sss)) t² / 2     (6)

The foot point lies h = κ t δ from there, where the contour has left the line by κ h² / 2: what is
left is κ (κ t δ)² / 2, of second order in the *error*, and the direction is off by κ h = κ² t δ
only, instead of κ t.

It fails when κ t is no longer small or the curvature changes much over the lag, and at corners.

References
----------
.. [MengLouZhou] the canonical form, its equation (9), of which the paper drops κ'; (1) to (6) are
   derived here.

Differences from the paper
--------------------------
The term κ' t³ / 6 is kept; any number of coordinates; ``perpendicular`` is not in the paper.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.configuration import static
from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contours.frenet import arc_length_derivatives
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector

__all__ = ["ExtendedNaturalLocalEstimator"]


class ExtendedNaturalLocalEstimator(Estimator):
    """Contour error vector to the contour's canonical form to third order; see the module.

    Parameters
    ----------
    perpendicular
        Whether the offset at equal t is turned into a distance by (6).
    """

    perpendicular: bool = static(flag=True, default=False)

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
            From the actual point to the cubic, shape (n_coordinates,) [m].
        """
        rows = arc_length_derivatives(sample.geometry)
        point, tangent, bend, third = rows[0], rows[1], rows[2], rows[3]
        third = third - tangent * (tangent @ third)
        d = sample.position - point
        t = tangent @ d
        # d - t T first: the lag is larger than what is left of it
        w = -(d - tangent * t - bend * (t**2 / 2.0) - third * (t**3 / 6.0))  # (4), (5)
        if not self.perpendicular:
            return w
        slope = tangent + bend * t + third * (t**2 / 2.0)
        square = slope @ slope
        return w - slope * ((slope @ w) / jnp.where(square == 0.0, 1.0, square))  # (6)
