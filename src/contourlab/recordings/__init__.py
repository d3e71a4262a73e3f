"""References, samples and recordings, and every figure of merit, defined once."""

from contourlab.recordings.circular import (
    CircularDeviation,
    bidirectional_deviation,
    circular_deviation,
    least_squares_circle,
    radial_deviations,
)
from contourlab.recordings.metrics import METRICS, Metric
from contourlab.recordings.recording import Metrics, Recording
from contourlab.recordings.reference import Reference, ReferencePoint
from contourlab.recordings.sample import Sample

__all__ = [
    "METRICS",
    "CircularDeviation",
    "Metric",
    "Metrics",
    "Recording",
    "Reference",
    "ReferencePoint",
    "Sample",
    "bidirectional_deviation",
    "circular_deviation",
    "least_squares_circle",
    "radial_deviations",
]
