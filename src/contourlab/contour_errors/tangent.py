"""Contour error from the tangent line at the reference point.

The contour is replaced by its tangent at the reference point, so the estimate is the tracking error
with its tangential part removed. Exact on straight lines. On a contour of curvature κ the magnitude
is off by κ e_t² / 2 to leading order, with e_t the tangential tracking error: second order in the
lag, whatever the offset. The vector is perpendicular to the tangent at the reference point, not at
the foot point: its direction is off by the angle κ e_t.

It fails where the lag is no longer small against the radius of curvature, and at corners, where the
tangent that holds is the one of the reference point.

References
----------
.. [ChiuTomizuka2001] task coordinate frame; the paper was not at hand, equation numbers not
   checked.

Differences from the paper
--------------------------
Written with vectors, for any number of coordinates. The tangent is the contour's own, over its
parameter, so that a standing reference point is no special case.
"""

from __future__ import annotations

from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contours.base import unit
from contourlab.recordings.sample import Sample
from contourlab.typing import AxisVector

__all__ = ["TangentEstimator"]


class TangentEstimator(Estimator):
    """Contour error vector to the tangent line at the reference point; see the module."""

    @property
    def needs(self) -> EstimatorNeeds:
        """The contour's first derivative at the reference parameter."""
        return EstimatorNeeds(derivatives=1)

    def estimate(self, sample: Sample) -> AxisVector:
        """Return the estimated contour error vector.

        Parameters
        ----------
        sample
            One instant, in tool space; ``geometry`` to order 1.

        Returns
        -------
        AxisVector
            From the actual point to the tangent line, shape (n_coordinates,) [m].
        """
        error = sample.geometry[0] - sample.position
        tangent = unit(sample.geometry[1])
        return error - tangent * (tangent @ error)
