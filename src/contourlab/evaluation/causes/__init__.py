"""Where a contour error comes from."""

from contourlab.evaluation.causes.cause import STATES, Cause
from contourlab.evaluation.causes.decompose import Decomposition, decompose
from contourlab.evaluation.causes.sensors import SIDES

__all__ = ["SIDES", "STATES", "Cause", "Decomposition", "decompose"]
