"""Discrete control laws, one file each."""

from contourlab.controllers.axis_controller import AxisController, BoundAxisController
from contourlab.controllers.axis_pid import AxisPid
from contourlab.controllers.axis_predictive import AxisPredictive
from contourlab.controllers.base import BoundController, Controller, Needs, in_tool_space
from contourlab.controllers.cascade import Cascade
from contourlab.controllers.cross_coupled import CrossCoupled
from contourlab.controllers.direct_adaptive_robust import DirectAdaptiveRobust
from contourlab.controllers.excitation import (
    Excitation,
    filtered_regressors,
    windowed_excitation,
)
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
from contourlab.controllers.integrated_adaptive_robust import IntegratedAdaptiveRobust
from contourlab.controllers.internal_model_contouring import InternalModelContouring
from contourlab.controllers.least_squares import BoundLeastSquares, FilteredLeastSquares
from contourlab.controllers.model_predictive_contouring import ModelPredictiveContouring
from contourlab.controllers.model_predictive_contouring_law import (
    BoundModelPredictiveContouring,
)
from contourlab.controllers.natural_local_task_frame import NaturalLocalTaskFrame
from contourlab.controllers.newton_cross_coupled import NewtonCrossCoupled
from contourlab.controllers.parameter_bounds import parameter_bounds
from contourlab.controllers.position_domain_pid import PositionDomainPid
from contourlab.controllers.predictive_contouring import PredictiveContouring
from contourlab.controllers.task_frame import BoundTaskFrameController, TaskFrameController
from contourlab.controllers.variable_gain_cross_coupled import VariableGainCrossCoupled

__all__ = [
    "AxisController",
    "AxisPid",
    "AxisPredictive",
    "BoundAxisController",
    "BoundController",
    "BoundLeastSquares",
    "BoundModelPredictiveContouring",
    "BoundTaskFrame",
    "BoundTaskFrameController",
    "Cascade",
    "Controller",
    "CrossCoupled",
    "DirectAdaptiveRobust",
    "Excitation",
    "FilteredLeastSquares",
    "FirstOrderTaskFrame",
    "FrameMotion",
    "GlobalTaskFrame",
    "IntegralSlidingMode",
    "IntegratedAdaptiveRobust",
    "InternalModelContouring",
    "LocalTaskFrame",
    "ModelPredictiveContouring",
    "NaturalLocalTaskFrame",
    "Needs",
    "NewtonCrossCoupled",
    "PositionDomainPid",
    "PredictiveContouring",
    "ReferenceFrame",
    "TaskCoordinates",
    "TaskFrame",
    "TaskFrameController",
    "VariableGainCrossCoupled",
    "filtered_regressors",
    "in_tool_space",
    "parameter_bounds",
    "windowed_excitation",
]
