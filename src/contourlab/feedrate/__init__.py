"""How fast along the curve: from a contour to a reference."""

from contourlab.feedrate.binding import Binding, binding_limits
from contourlab.feedrate.constant import constant_feed, constant_rate
from contourlab.feedrate.limits import AxisLimits
from contourlab.feedrate.plan import Plan, plan_feed, programmed_feed
from contourlab.feedrate.profile import Profile
from contourlab.feedrate.remarks import CurvatureJump

__all__ = [
    "AxisLimits",
    "Binding",
    "CurvatureJump",
    "Plan",
    "Profile",
    "binding_limits",
    "constant_feed",
    "constant_rate",
    "plan_feed",
    "programmed_feed",
]
