"""The moving coordinate frames that task-frame laws share."""

from contourlab.controllers.frames.local_task_frame import FrameMotion, LocalTaskFrame

__all__ = ["FrameMotion", "LocalTaskFrame"]
