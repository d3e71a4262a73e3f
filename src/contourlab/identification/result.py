"""What identification found: values, intervals, and what could not be found."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.controllers.least_squares import PARAMETERS
from contourlab.errors import RecordingError, choices
from contourlab.identification.trend import Trend
from contourlab.machines.base import CommandKind, NominalModel, per_axis

__all__ = ["AxisIdentification", "Identification", "Parameter"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter with its confidence interval; NaN if it could not be found."""

    value: float
    low: float
    high: float
    unit: str
    known: bool = False
    """Whether it was given, and not found."""

    @property
    def identified(self) -> bool:
        """Whether there is a value."""
        return bool(np.isfinite(self.value))

    def __str__(self) -> str:
        """Value and half of its interval, to two digits of that."""
        if not self.identified:
            return "not found"
        if self.known:
            return f"{self.value:g} {self.unit}, given"
        half = 0.5 * (self.high - self.low)
        if not (math.isfinite(half) and half > 0.0):
            return f"{self.value:.6g} {self.unit}"
        power = max(math.floor(math.log10(max(abs(self.value), half))), -300)
        if -4 < power < 6:
            places = max(0, 1 - math.floor(math.log10(half)))
            return f"{self.value:.{places}f} +- {half:.{places}f} {self.unit}"
        digits = max(0, power - math.floor(math.log10(half)) + 1)
        scaled, width = self.value / 10.0**power, half / 10.0**power
        return f"({scaled:.{digits}f} +- {width:.{digits}f})e{power} {self.unit}"


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisIdentification:
    """What was found about one axis; all in units of the command."""

    axis: str
    parameters: dict[str, Parameter]
    """mass, viscous, coulomb, disturbance: M q'' + B q' + A sign(q') - d = u."""
    unexcited: tuple[str, ...]
    """Parameters that the motion never called for."""
    inseparable: tuple[str, ...]
    """Parameters that the motion does not tell apart."""
    condition: float
    """Of the regressor's columns, brought to one size; those that are excited."""
    covariance: NDArray[Any]
    """Of the parameters, shape (4, 4); NaN where there is no value."""
    degrees: int
    """Degrees of freedom of Student's t behind the intervals."""
    minimum_speed: float
    """Slower rows did not count [m/s]."""
    counted: float
    """Time that counted [s]."""
    command_rms: float
    """Of the filtered command [command]."""
    residual_rms: float
    """What the model leaves unexplained, filtered [command]."""
    encoder_noise: float
    """Standard deviation of noise and rounding of the encoder, from the record [m]."""
    noise_ratio: float
    """S / (S + σ²): by this factor noise makes plain least squares find the mass too small."""
    least_squares: NDArray[Any]
    """What plain filtered least squares find, shape (4,); has that bias."""
    encoder_bias: NDArray[Any]
    """Predicted bias of ``least_squares`` by encoder noise, shape (4,); the noise that the loop
    feeds back is left out."""
    lag: Parameter
    """How much later the command seems to act than was assumed [s]."""
    low_speed_friction: Parameter
    """By how much friction seems to differ at the lowest speeds that count [command]."""
    negative: tuple[str, ...]
    """Kinds of friction that came out negative, beyond their intervals and not negligibly."""

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[name]


@dataclass(frozen=True, eq=False, kw_only=True)
class Identification:
    """What ``identify`` found; printed, it is a table."""

    axes: tuple[AxisIdentification, ...]
    confidence: float
    """Of the intervals."""
    instrument: str
    """See ``INSTRUMENTS``."""
    command_kind: CommandKind
    command_limit: NDArray[Any]
    """Of the recording, infinite where it has none; shape (n_axes,)."""
    sample_time: float
    """[s]."""
    trend: Trend
    """What the on-line estimator would have found over the record."""
    warnings: tuple[str, ...]
    """What could not be found and why, and what speaks against the model."""

    def __getitem__(self, name: str) -> AxisIdentification:
        for axis in self.axes:
            if axis.axis == name:
                return axis
        raise RecordingError(f"no axis {name!r}; {choices(name, [a.axis for a in self.axes])}")

    @property
    def values(self) -> NDArray[Any]:
        """θ, shape (4, n_axes), rows as ``PARAMETERS``; for ``initial_parameters`` of a law."""
        return self._rows("value")

    def bounds(self, margin: float = 0.0) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the intervals, as lower and upper bounds of an adaptive law.

        The bounds of friction are not below 0. An interval is about the values during the record:
        ``margin`` adds what may change between recordings.

        Parameters
        ----------
        margin
            Share of each value, >= 0, by which the interval is widened on either side.

        Returns
        -------
        tuple
            Shape (4, n_axes) each, rows as ``PARAMETERS``.

        Raises
        ------
        RecordingError
            A parameter has no value, or the interval of a mass reaches 0; or a negative margin.
        """
        self._refuse_unknown(PARAMETERS)
        if not margin >= 0.0:
            raise RecordingError(f"margin must be >= 0, got {margin:g}")
        wider = margin * np.abs(self.values)
        lower, upper = self._rows("low") - wider, self._rows("high") + wider
        for axis, low in zip(self.axes, lower[0], strict=True):
            if not low > 0.0:
                raise RecordingError(f"axis {axis.axis}: the interval of the mass reaches 0")
        lower[1:3], upper[1:3] = np.maximum(lower[1:3], 0.0), np.maximum(upper[1:3], 0.0)
        return lower, upper

    def model(self, gain: Any = 1.0, command_limit: Any = None) -> NominalModel:
        """Return a nominal model for laws: the values, and 0 for friction hardly below it.

        Parameters
        ----------
        gain
            Effort per command, one number or one per axis: the parameters are in units of the
            command, and the model's are in units of effort.
        command_limit
            That of the recording if None.

        Raises
        ------
        RecordingError
            A mass or friction has no value, the interval of a mass reaches 0, or friction came out
            ``negative``.
        """
        self._refuse_unknown(PARAMETERS[:3])
        for axis in self.axes:
            if not axis["mass"].low > 0.0:
                raise RecordingError(f"axis {axis.axis}: the interval of the mass reaches 0")
            if axis.negative:
                raise RecordingError(
                    f"axis {axis.axis}: {' and '.join(axis.negative)} friction came out negative: "
                    "the model does not fit this record"
                )
        n = len(self.axes)
        k = np.asarray(per_axis("gain", gain, n))
        rows = np.maximum(self.values[:3], 0.0) * k
        limit = self.command_limit if command_limit is None else command_limit
        return NominalModel(
            mass=rows[0], viscous=rows[1], coulomb=rows[2], gain=k,
            command_limit=per_axis("command_limit", limit, n), command=self.command_kind,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return axes and parameters as plain lists and numbers; None where there is no value."""

        def number(x: float) -> float | None:
            return float(x) if np.isfinite(x) else None

        return {
            "axes": [
                {
                    "axis": axis.axis,
                    "parameters": {
                        name: {
                            "value": number(one.value), "low": number(one.low),
                            "high": number(one.high), "unit": one.unit,
                        }
                        for name, one in axis.parameters.items()
                    },
                }
                for axis in self.axes
            ]
        }  # fmt: skip

    def __str__(self) -> str:
        lines = [f"axis  parameter    value and half of the {100 * self.confidence:g} % interval"]
        for axis in self.axes:
            for name, one in axis.parameters.items():
                lines.append(f"{axis.axis:<5} {name:<12} {one}")
        return "\n".join([*lines, *self.warnings])

    def _rows(self, what: str) -> NDArray[Any]:
        return np.array([[getattr(a[name], what) for a in self.axes] for name in PARAMETERS])

    def _refuse_unknown(self, names: tuple[str, ...]) -> None:
        for axis in self.axes:
            missing = [name for name in names if not axis[name].identified]
            if missing:
                raise RecordingError(
                    f"axis {axis.axis}: {', '.join(missing)} could not be found from this record; "
                    "give what is known of it to identify(known=...), or record another motion"
                )
