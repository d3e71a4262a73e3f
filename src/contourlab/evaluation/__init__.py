"""Measured logs judged: contour error, its uncertainty, its causes, circular tests."""

from contourlab.evaluation.alignment import Alignment
from contourlab.evaluation.causes import SIDES, STATES, Cause
from contourlab.evaluation.circles import CircularTest, Direction
from contourlab.evaluation.resolution import Resolution
from contourlab.evaluation.result import Evaluation, WorstPoint
from contourlab.evaluation.run import PATHS, evaluate

__all__ = [
    "PATHS",
    "SIDES",
    "STATES",
    "Alignment",
    "Cause",
    "CircularTest",
    "Direction",
    "Evaluation",
    "Resolution",
    "WorstPoint",
    "evaluate",
]
