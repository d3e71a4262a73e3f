"""Discrete control laws, one file each."""

from contourlab.controllers.axis_controller import AxisController, BoundAxisController
from contourlab.controllers.axis_pid import AxisPid
from contourlab.controllers.base import BoundController, Controller, Needs, in_tool_space
from contourlab.controllers.cascade import Cascade
from contourlab.controllers.cross_coupled import CrossCoupled
from contourlab.controllers.first_order_task_frame import FirstOrderTaskFrame
from contourlab.controllers.frames import FrameMotion, LocalTaskFrame
from contourlab.controllers.natural_local_task_frame import NaturalLocalTaskFrame
from contourlab.controllers.task_frame import BoundTaskFrameController, TaskFrameController

__all__ = [
    "AxisController",
    "AxisPid",
    "BoundAxisController",
    "BoundController",
    "BoundTaskFrameController",
    "Cascade",
    "Controller",
    "CrossCoupled",
    "FirstOrderTaskFrame",
    "FrameMotion",
    "LocalTaskFrame",
    "NaturalLocalTaskFrame",
    "Needs",
    "TaskFrameController",
    "in_tool_space",
]
