"""Contour error from the circle of curvature at the reference point.

The contour is replaced by its osculating circle at the reference point and the estimate runs to the
nearest point of that circle: radially in the circle's plane, and straight back to the plane. Exact
on circles and lines. Elsewhere the circle leaves the contour in the third order of the lag: the
magnitude is off by at most hypot(κ', κ τ) |e_t|³ / 6 to leading order, with e_t the tangential
tracking error, κ' the derivative of the curvature over arc length and τ the torsion.

It fails when the lag reaches the radius of curvature or the curvature changes over the lag. At the
centre of the circle every point of it is as near as any other; the reference point is taken. At
corners the circle that holds is the one of the reference point.

With d the actual point as seen from the reference point, T the unit tangent, k the curvature vector
(the normal part of r'' over |r'|²; κ = |k|), x = T·d, g = k·d and m the distance from the centre of
the circle in units of its radius,

    m² = (1 - g)² + κ² x²                                        (1)
    m - 1 = (κ² x² + g² - 2 g) / (m + 1)                         (2)
    a = (x² (m + 1 + g) + y² (m - 1 + g)) / (m (m + 1)²)         (3)
    error = -(d - x T) + k a - T x (m - 1)/m                     (4)

where y = g/κ. (2) is m - 1 without the subtraction. Nothing is divided by the curvature but y²,
which is bounded by |d|² and multiplied by k (m - 1 + g), third order in the curvature: at κ → 0 the
formula goes over into the tangent line without cancellation. The normal is never formed, so any
number of coordinates will do.

References
----------
.. [KorenLo1991] the circular approximation of the contour in variable-gain cross-coupling; the
   paper was not at hand, equation numbers not checked. Formulas (1) to (4) are derived here.

Differences from the paper
--------------------------
The distance to the circle itself, not its expansion for small errors; in space and beyond.
"""

from __future__ import annotations

import jax.numpy as jnp

from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contours.base import unit
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector

__all__ = ["OsculatingCircleEstimator"]


class OsculatingCircleEstimator(Estimator):
    """Contour error vector to the circle of curvature at the reference point; see the module."""

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour's first two derivatives at the reference parameter."""
        return EstimatorNeeds(derivatives=2)

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the estimated contour error vector.

        Parameters
        ----------
        sample
            One instant, in tool space; ``geometry`` to order 2.

        Returns
        -------
        AxisVector
            From the actual point to the circle, shape (n_coordinates,) [m].
        """
        point, first, second = sample.geometry[0], sample.geometry[1], sample.geometry[2]
        tangent = unit(first)
        speed2 = first @ first
        bend = second - tangent * (tangent @ second)
        k = bend / jnp.where(speed2 == 0.0, 1.0, speed2)
        d = sample.position - point
        x, g, curvature2 = tangent @ d, k @ d, k @ k
        m2 = (1.0 - g) ** 2 + curvature2 * x**2  # (1)
        centre = m2 == 0.0
        m = jnp.sqrt(jnp.where(centre, 1.0, m2))
        excess = (curvature2 * x**2 + g**2 - 2.0 * g) / (m + 1.0)  # (2)
        y2 = g**2 / jnp.where(curvature2 == 0.0, 1.0, curvature2)
        inward = (x**2 * (m + 1.0 + g) + y2 * (excess + g)) / (m * (m + 1.0) ** 2)  # (3)
        along = x * excess / m
        inward, along = jnp.where(centre, 0.0, inward), jnp.where(centre, 0.0, along)
        return -(d - tangent * x) + k * inward - tangent * along  # (4)
