"""How fast along the curve: from a contour to a reference."""

from contourlab.feedrate.constant import constant_feed, constant_rate
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.plan import Plan, plan_feed, programmed_feed
from contourlab.feedrate.smoothing import Profile

__all__ = [
    "AxisLimits",
    "Plan",
    "Profile",
    "constant_feed",
    "constant_rate",
    "plan_feed",
    "programmed_feed",
]
