"""Real-time contour error estimators, one file each; how accurate they are."""

from contourlab.contour_errors.accuracy import (
    AccuracyRow,
    AccuracyStudy,
    StudiedContour,
    estimate_accuracy,
)
from contourlab.contour_errors.accuracy_names import study_contours, study_estimators
from contourlab.contour_errors.base import Estimator, EstimatorNeeds
from contourlab.contour_errors.extended_natural_local import ExtendedNaturalLocalEstimator
from contourlab.contour_errors.foot_point import FootPointEstimator
from contourlab.contour_errors.global_task_frame import GlobalTaskFrameEstimator
from contourlab.contour_errors.natural_local import NaturalLocalEstimator
from contourlab.contour_errors.newton import NewtonEstimator
from contourlab.contour_errors.osculating_circle import OsculatingCircleEstimator
from contourlab.contour_errors.tangent import TangentEstimator
from contourlab.contour_errors.variable_gain import VariableGainEstimator

__all__ = [
    "AccuracyRow",
    "AccuracyStudy",
    "Estimator",
    "EstimatorNeeds",
    "ExtendedNaturalLocalEstimator",
    "FootPointEstimator",
    "GlobalTaskFrameEstimator",
    "NaturalLocalEstimator",
    "NewtonEstimator",
    "OsculatingCircleEstimator",
    "StudiedContour",
    "TangentEstimator",
    "VariableGainEstimator",
    "estimate_accuracy",
    "study_contours",
    "study_estimators",
]
