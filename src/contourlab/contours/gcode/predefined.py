"""Parameters that LinuxCNC predefines, as far as the program alone decides them.

Positions are in the units of the program and in the coordinate system in force, as the machine
stands when the line is read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from contourlab.contours.gcode.control import Flow
    from contourlab.contours.gcode.modal import ModalState
    from contourlab.contours.gcode.offsets import Offsets

__all__ = ["UNKNOWN", "computed_numbers", "predefined_names"]

UNKNOWN: dict[str, str] = {
    **dict.fromkeys(
        ("_spindle_on", "_spindle_cw", "_rpm", "_spindle_rpm_mode", "_spindle_css_mode"),
        "the spindle",
    ),
    **dict.fromkeys(("_mist", "_flood"), "the coolant"),
    **dict.fromkeys(
        ("_speed_override", "_feed_override", "_adaptive_feed", "_feed_hold"), "the operator"
    ),
    **dict.fromkeys(
        ("_current_tool", "_current_pocket", "_selected_pocket", "_selected_tool"), "the tool"
    ),
    **dict.fromkeys(("_task", "_remap_level"), "the machine"),
}
"""Predefined names that need more than the program, with what they need."""


def computed_numbers(state: ModalState) -> dict[int, Callable[[], float]]:
    """Return the read-only numbered parameters: the position, #5420 to #5428.

    Parameters
    ----------
    state
        Where the machine stands.
    """
    numbers: dict[int, Callable[[], float]] = dict.fromkeys(range(5420, 5429), lambda: 0.0)
    for axis in range(3):
        numbers[5420 + axis] = lambda axis=axis: state.program_units(state.position[axis])  # type: ignore[misc]
    return numbers


def predefined_names(
    state: ModalState, offsets: Offsets, flow: Flow
) -> dict[str, Callable[[], float]]:
    """Return the read-only named parameters.

    Parameters
    ----------
    state, offsets, flow
        What they are worked out from.
    """

    def motion() -> float:
        return 800.0 if state.motion is None else float(state.motion)

    def system() -> float:
        return float((540, 550, 560, 570, 580, 590, 591, 592, 593)[offsets.system - 1])

    names: dict[str, Callable[[], float]] = {
        "_vmajor": lambda: 2.9,
        "_vminor": lambda: 0.0,
        "_line": lambda: float(flow.line),
        "_motion_mode": motion,
        "_plane": lambda: float(state.plane.code),
        "_ccomp": lambda: 400.0,
        "_metric": lambda: float(not state.inch),
        "_imperial": lambda: float(state.inch),
        "_absolute": lambda: float(state.absolute),
        "_incremental": lambda: float(not state.absolute),
        "_inverse_time": lambda: float(state.inverse_time),
        "_units_per_minute": lambda: float(not state.inverse_time),
        "_units_per_rev": lambda: 0.0,
        "_coord_system": system,
        "_tool_offset": lambda: 0.0,
        "_retract_r_plane": lambda: float(state.retract_to_r),
        "_retract_old_z": lambda: float(not state.retract_to_r),
        "_ijk_absolute_mode": lambda: float(state.absolute_center),
        "_lathe_diameter_mode": lambda: 0.0,
        "_lathe_radius_mode": lambda: 1.0,
        "_feed": lambda: state.feed_word,
        "_value": lambda: flow.value,
        "_value_returned": lambda: float(flow.value_returned),
        "_call_level": lambda: float(len(flow.frames)),
    }
    for axis, letter in enumerate("xyz"):
        names[f"_{letter}"] = lambda axis=axis: state.program_units(state.position[axis])  # type: ignore[misc]
    names.update(dict.fromkeys((f"_{letter}" for letter in "abcuvw"), lambda: 0.0))
    return names
