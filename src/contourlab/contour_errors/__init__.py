"""Real-time contour error estimators, one file each."""

from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contour_errors.osculating_circle import OsculatingCircleEstimator
from contourlab.contour_errors.tangent import TangentEstimator

__all__ = ["Estimator", "EstimatorNeeds", "OsculatingCircleEstimator", "TangentEstimator"]
