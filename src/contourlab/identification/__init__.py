"""Machine parameters from recordings, with their uncertainty."""

from contourlab.identification.identify import INSTRUMENTS, identify
from contourlab.identification.result import (
    AxisIdentification,
    Identification,
    Parameter,
)
from contourlab.identification.trend import Trend, estimate_trend

__all__ = [
    "INSTRUMENTS",
    "AxisIdentification",
    "Identification",
    "Parameter",
    "Trend",
    "estimate_trend",
    "identify",
]
