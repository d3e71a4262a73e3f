"""Public conformance checks: run them on your own contour, estimator, machine or control law.

Each raises ``AssertionError`` with a message that says what does not hold.
"""

from contourlab.testing.contours import check_contour
from contourlab.testing.controllers import check_controller
from contourlab.testing.estimators import check_estimator
from contourlab.testing.machines import check_machine
from contourlab.testing.samples import make_samples

__all__ = ["check_contour", "check_controller", "check_estimator", "check_machine", "make_samples"]
