"""References, samples and recordings, and every figure of merit, defined once."""

from contourlab.recordings.circular import (
    CircularDeviation,
    bidirectional_deviation,
    circular_deviation,
    least_squares_circle,
    radial_deviations,
)
from contourlab.recordings.corners import (
    Corner,
    CornerFigure,
    CornerPass,
    find_corners,
    measure_corners,
    summarise_corners,
)
from contourlab.recordings.metrics import METRICS, Metric
from contourlab.recordings.recording import Metrics, Recording
from contourlab.recordings.reference import Reference, ReferencePoint
from contourlab.recordings.sample import Sample

__all__ = [
    "METRICS",
    "CircularDeviation",
    "Corner",
    "CornerFigure",
    "CornerPass",
    "Metric",
    "Metrics",
    "Recording",
    "Reference",
    "ReferencePoint",
    "Sample",
    "bidirectional_deviation",
    "circular_deviation",
    "find_corners",
    "least_squares_circle",
    "measure_corners",
    "radial_deviations",
    "summarise_corners",
]
