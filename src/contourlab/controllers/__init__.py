"""Discrete control laws, one file each."""

from contourlab.controllers.axis_controller import AxisController, BoundAxisController
from contourlab.controllers.axis_pid import AxisPid
from contourlab.controllers.base import BoundController, Controller, Needs, in_tool_space
from contourlab.controllers.cascade import Cascade
from contourlab.controllers.cross_coupled import CrossCoupled
from contourlab.controllers.first_order_task_frame import FirstOrderTaskFrame
from contourlab.controllers.frames import (
    BoundTaskFrame,
    FrameMotion,
    GlobalTaskFrame,
    LocalTaskFrame,
    ReferenceFrame,
    TaskCoordinates,
    TaskFrame,
)
from contourlab.controllers.integral_sliding_mode import IntegralSlidingMode
from contourlab.controllers.least_squares import BoundLeastSquares, FilteredLeastSquares
from contourlab.controllers.natural_local_task_frame import NaturalLocalTaskFrame
from contourlab.controllers.newton_cross_coupled import NewtonCrossCoupled
from contourlab.controllers.task_frame import BoundTaskFrameController, TaskFrameController
from contourlab.controllers.variable_gain_cross_coupled import VariableGainCrossCoupled

__all__ = [
    "AxisController",
    "AxisPid",
    "BoundAxisController",
    "BoundController",
    "BoundLeastSquares",
    "BoundTaskFrame",
    "BoundTaskFrameController",
    "Cascade",
    "Controller",
    "CrossCoupled",
    "FilteredLeastSquares",
    "FirstOrderTaskFrame",
    "FrameMotion",
    "GlobalTaskFrame",
    "IntegralSlidingMode",
    "LocalTaskFrame",
    "NaturalLocalTaskFrame",
    "Needs",
    "NewtonCrossCoupled",
    "ReferenceFrame",
    "TaskCoordinates",
    "TaskFrame",
    "TaskFrameController",
    "VariableGainCrossCoupled",
    "in_tool_space",
]
