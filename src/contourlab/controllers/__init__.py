"""Discrete control laws, one file each."""

from contourlab.controllers.axis_controller import AxisController, BoundAxisController
from contourlab.controllers.axis_pid import AxisPid
from contourlab.controllers.base import BoundController, Controller, Needs, in_tool_space
from contourlab.controllers.cascade import Cascade
from contourlab.controllers.cross_coupled import CrossCoupled

__all__ = [
    "AxisController",
    "AxisPid",
    "BoundAxisController",
    "BoundController",
    "Cascade",
    "Controller",
    "CrossCoupled",
    "Needs",
    "in_tool_space",
]
