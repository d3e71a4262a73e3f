"""What was found about a machine: values, intervals, residuals, what the record does not say."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from contourlab.errors import RecordingError, choices
from contourlab.identification.result import Parameter
from contourlab.machines.base import CommandKind

__all__ = ["AxisModel", "MachineIdentification"]


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisModel:
    """One axis; all in units of the command."""

    axis: str
    method: str
    """``simulation error``, ``least squares`` where nothing could be simulated, or ``none``."""
    parameters: dict[str, Parameter]
    """mass, viscous, coulomb_forward, coulomb_backward, stiffness, delay, and drive_lag if it was
    looked for."""
    least_squares: dict[str, Parameter]
    """Where the refinement began, with intervals of its own."""
    covariance: NDArray[Any]
    """Of the parameters that were refined, in the order of ``free``."""
    free: tuple[str, ...]
    """Parameters that were refined."""
    unexcited: tuple[str, ...]
    """Parameters that the motion never called for."""
    inseparable: tuple[str, ...]
    """Parameters that the motion does not tell apart."""
    astray: bool
    """Whether the refinement did not hold on to the start, so that least squares stand."""
    degrees: int
    """Degrees of freedom of Student's t behind the intervals."""
    minimum_speed: float
    """Slower rows did not count [m/s]."""
    speed: float
    """Largest speed of the motion [m/s]."""
    acceleration: float
    """Largest acceleration that the motion was asked for, or showed [m/s²]."""
    counted: float
    """Time that counted [s]."""
    encoder_noise: float
    """Standard deviation of noise and rounding of the encoder, from the record [m]."""
    noise_ratio: float
    """By this factor noise makes plain least squares find the mass too small."""
    residual_rms: float
    """Measured less simulated, over the pieces [m]."""
    corner_hz: float
    """Below it the residual counts as what an unknown force does, above it as noise of the
    encoder [Hz]."""
    correlation: float
    """Largest correlation of the whitened residual with its own past, over 50 samples."""
    time: NDArray[Any] = field(repr=False)
    """[s], shape (n_samples,)."""
    measured: NDArray[Any] = field(repr=False)
    """[m]."""
    simulated: NDArray[Any] = field(repr=False)
    """[m]; NaN where the axis does not count."""
    residual: NDArray[Any] = field(repr=False)
    """Measured less simulated [m]; NaN likewise."""

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[name]

    @property
    def coulomb(self) -> float:
        """Mean of both directions [command]; NaN if one of them is not known."""
        ahead, back = (self.parameters[f"coulomb_{way}"].value for way in ("forward", "backward"))
        return 0.5 * (ahead + back)

    @property
    def constant_force(self) -> float:
        """Half of what one direction takes more than the other: a constant force, positive if it
        pushes forwards, or friction that differs; a motion does not tell which [command]."""
        ahead, back = (self.parameters[f"coulomb_{way}"].value for way in ("forward", "backward"))
        return 0.5 * (back - ahead)


@dataclass(frozen=True, eq=False, kw_only=True)
class MachineIdentification:
    """What ``identify_machine`` found; printed, it is a table."""

    axes: tuple[AxisModel, ...]
    confidence: float
    instrument: str
    """``reference`` or ``none``: the response itself."""
    command_kind: CommandKind
    command_limit: NDArray[Any]
    """Of the recording, infinite where it has none; shape (n_axes,)."""
    sample_time: float
    """[s]."""
    travel: NDArray[Any]
    """Least and largest measured position of every axis, shape (n_axes, 2) [m]."""
    jerk: NDArray[Any]
    """Largest jerk of the motion that was asked for, NaN without a reference; shape (n_axes,)."""
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    """What holds for every such identification."""
    source: str = ""
    """Where the record comes from."""

    def __getitem__(self, name: str) -> AxisModel:
        for axis in self.axes:
            if axis.axis == name:
                return axis
        raise RecordingError(f"no axis {name!r}; {choices(name, [a.axis for a in self.axes])}")

    def to_dict(self) -> dict[str, Any]:
        """Return axes and parameters as plain lists and numbers; None where there is no value."""
        return {
            "axes": [
                {
                    "axis": axis.axis,
                    "method": axis.method,
                    "parameters": {n: _plain(p) for n, p in axis.parameters.items()},
                    "least_squares": {n: _plain(p) for n, p in axis.least_squares.items()},
                    "unexcited": list(axis.unexcited),
                    "inseparable": list(axis.inseparable),
                    "residual_rms": _number(axis.residual_rms),
                    "encoder_noise": _number(axis.encoder_noise),
                }
                for axis in self.axes
            ]
        }

    def __str__(self) -> str:
        lines = [
            f"axis  parameter         value and half of the {100 * self.confidence:g} % interval"
        ]
        for axis in self.axes:
            for name, one in axis.parameters.items():
                lines.append(f"{axis.axis:<5} {name:<17} {one}")
        return "\n".join([*lines, *self.warnings])


def _number(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def _plain(one: Parameter) -> dict[str, Any]:
    return {
        "value": _number(one.value), "low": _number(one.low), "high": _number(one.high),
        "unit": one.unit,
    }  # fmt: skip
