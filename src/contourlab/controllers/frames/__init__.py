"""The moving coordinate frames that task-frame laws share."""

from contourlab.controllers.frames.coordinates import BoundTaskFrame, TaskCoordinates, TaskFrame
from contourlab.controllers.frames.global_task_frame import GlobalTaskFrame
from contourlab.controllers.frames.local_task_frame import LocalTaskFrame
from contourlab.controllers.frames.reference_frame import FrameMotion, ReferenceFrame

__all__ = [
    "BoundTaskFrame",
    "FrameMotion",
    "GlobalTaskFrame",
    "LocalTaskFrame",
    "ReferenceFrame",
    "TaskCoordinates",
    "TaskFrame",
]
