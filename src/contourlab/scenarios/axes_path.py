"""A part that is given in the space of the axes, for machines with more axes than coordinates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from contourlab.configuration import replace
from contourlab.contours import combined
from contourlab.contours.base import Contour
from contourlab.contours.combined import CombinedAxes
from contourlab.machines import LinearTool, Machine
from contourlab.recordings.reference import Reference
from contourlab.scenarios.schema import PartSection
from contourlab.scenarios.values import KeyedError

__all__ = ["in_axes", "reference_of_axes"]


def in_axes(section: PartSection, contour: Contour, machines: Mapping[str, Machine]) -> Contour:
    """Return the contour of the tool, where the formula is a path of the machine's axes.

    Parameters
    ----------
    section
        ``[part]``.
    contour
        As :func:`build_contour` returned it.
    machines
        By name.

    Raises
    ------
    KeyedError
        ``space = "axes"`` on machines without a tool map or with several, or with another number of
        coordinates than axes.
    """
    if section.space == "tool":
        return contour
    key = ("part", "space")
    first, *others = machines.values()
    tool = first.tool
    if not isinstance(tool, LinearTool):
        raise KeyedError(
            key,
            "'axes' is for machines whose tool is a combination of the axes, such as "
            "cao_zhang_stage_and_scanner; here the path of the axes is that of the tool",
        )
    for other in others:
        matrix = getattr(other.tool, "matrix", None)
        if matrix is None or not np.array_equal(np.asarray(matrix), np.asarray(tool.matrix)):
            raise KeyedError(key, "the machines combine their axes in different ways")
    if contour.n_axes != first.n_axes:
        raise KeyedError(
            key,
            f"the formula has {contour.n_axes} coordinates, and the machine "
            f"{first.n_axes} axes, {', '.join(first.names)}",
        )
    return combined(contour, np.asarray(tool.matrix))


def reference_of_axes(contour: CombinedAxes, tool: Reference) -> Reference:
    """Return the reference of the axes for one of the tool point, over the same parameter.

    Parameters
    ----------
    contour
        Of the tool, with the path of the axes.
    tool
        Reference on it.
    """
    rate, acceleration = np.asarray(tool.parameter_rate), np.asarray(tool.parameter_acceleration)
    jerk = np.gradient(acceleration, float(np.asarray(tool.sample_time)))
    axes = Reference.along(
        contour.axes, sample_time=float(np.asarray(tool.sample_time)), parameter=tool.parameter,
        parameter_rate=rate, parameter_acceleration=acceleration, parameter_jerk=jerk,
        warnings=tool.warnings, motion_warnings=tool.motion_warnings,
    )  # fmt: skip
    return replace(axes, contour=contour)
