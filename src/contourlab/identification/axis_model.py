"""What one axis gave, put together as its model."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from contourlab.identification.machine_result import AxisModel
from contourlab.identification.pieces import Pieces, smooth_velocity
from contourlab.identification.record import COMMAND_UNITS, Record
from contourlab.identification.refinement import Refined
from contourlab.identification.result import AxisIdentification, Parameter
from contourlab.identification.rows import position_noise
from contourlab.identification.separability import Separability
from contourlab.identification.signals import Signals
from contourlab.identification.simulated_response import MODEL_PARAMETERS
from contourlab.identification.start import Start

__all__ = ["KINDS", "Found", "Options", "units_of"]

KINDS = {**COMMAND_UNITS, "position": "m"}
"""Kinds of command, and their units."""


class Options(NamedTuple):
    """Of ``identify_machine``, checked."""

    given: dict[str, NDArray[Any]]
    """Parameters that are known, by name, shape (n_axes,) each."""
    stiffness: bool | None
    drive_lag: bool
    confidence: float
    limit: float
    """Of the condition."""
    piece_time: float
    simulate: bool


def units_of(kind: str) -> dict[str, str]:
    """Return the units of the parameters, by name.

    Parameters
    ----------
    kind
        Of the command, a key of :data:`KINDS`.
    """
    mass, viscous, stiffness = {
        "force": ("kg", "N s/m", "N/m"),
        "velocity": ("s", "1", "1/s"),
        "voltage": ("V/(m/s^2)", "V/(m/s)", "V/m"),
        "position": ("s^2", "s", "1"),
    }[kind]
    return {
        "mass": mass, "viscous": viscous, "stiffness": stiffness, "coulomb_forward": KINDS[kind],
        "coulomb_backward": KINDS[kind], "delay": "s", "drive_lag": "s",
    }  # fmt: skip


class Found(NamedTuple):
    """What one axis gave, on the way to its model."""

    record: Record
    k: int
    signals: Signals
    units: dict[str, str]
    options: Options
    start: Start | None = None
    held: dict[str, float] | None = None
    judged: Separability | None = None
    refined: Refined | None = None
    names: tuple[str, ...] = ()
    pieces: Pieces | None = None
    given: dict[str, float] | None = None
    plain: AxisIdentification | None = None
    """Of filtered least squares alone, where nothing could be simulated."""
    astray: bool = False
    speed: float | None = None
    """Below which rows do not count in the simulated response [m/s]; as in ``signals`` if None."""

    def model(self) -> AxisModel:
        """Return the model of the axis."""
        record, k, signals = self.record, self.k, self.signals
        n = len(record.time)
        none = np.full(n, np.nan)
        refined, judged = self.refined, self.judged
        names = [name for name in MODEL_PARAMETERS if name != "drive_lag" or self.options.drive_lag]
        degrees = signals.cosines if refined is None else refined.degrees
        of_start, quantile = (
            float(student.ppf(0.5 + 0.5 * self.options.confidence, count))
            for count in (signals.cosines, degrees)
        )
        from_start = self._of_start(names, of_start)
        parameters = {name: self._parameter(name, np.nan, np.nan) for name in names}
        if refined is not None and judged is not None:
            spread = np.sqrt(np.diagonal(refined.covariance))
            for name, deviation in zip(self.names, spread, strict=True):
                if name not in judged.inseparable:
                    value = float(refined.theta[MODEL_PARAMETERS.index(name)])
                    parameters[name] = self._parameter(name, value, quantile * float(deviation))
        elif self.plain is not None:
            parameters |= self._of_plain(self.plain)
        elif self.start is not None:
            parameters |= from_start
        for name, value in (self.given or {}).items():
            if name in parameters:
                parameters[name] = Parameter(
                    value=value, low=value, high=value, unit=self.units[name], known=True
                )
        unexcited = judged.unexcited if judged is not None else ()
        inseparable = judged.inseparable if judged is not None else ()
        if refined is None and self.plain is not None:
            unexcited, inseparable = self.plain.unexcited, self.plain.inseparable
        method = "none" if self.start is None else "least squares"
        if refined is not None:
            method = "simulation error"
        square = float(np.sum(signals.weight * signals.regressor[:, 0] ** 2))
        square /= max(float(signals.weight.sum()), 1.0)
        ratio = 1.0 - signals.noise[0, 0] / square if square > 0.0 else np.nan
        moved = record.measured if record.reference is None else record.reference
        velocity = smooth_velocity(moved[:, k], record.sample_time)
        rate = smooth_velocity(velocity, record.sample_time)
        counted = float(signals.weight.sum()) * record.sample_time
        if self.pieces is not None:
            counted = float(self.pieces.counts.sum()) * record.sample_time
        residual = none if refined is None else refined.residual
        there = np.isfinite(residual)
        return AxisModel(
            axis=record.names[k], method=method, parameters=parameters, least_squares=from_start,
            astray=self.astray,
            covariance=np.zeros((0, 0)) if refined is None else refined.covariance,
            free=self.names, unexcited=unexcited,
            inseparable=inseparable, degrees=degrees,
            minimum_speed=signals.minimum_speed if self.speed is None else self.speed,
            speed=float(np.abs(velocity).max()),
            acceleration=float(np.abs(rate).max()), counted=counted,
            encoder_noise=self._noise(), noise_ratio=float(max(ratio, 0.0)),
            residual_rms=float(np.sqrt(np.mean(residual[there] ** 2))) if there.any() else np.nan,
            corner_hz=np.nan if refined is None else 0.5 * refined.corner / record.sample_time,
            correlation=np.nan if refined is None else _correlation(refined.whitened),
            time=record.time, measured=record.measured[:, k],
            simulated=none if refined is None else refined.simulated, residual=residual,
        )  # fmt: skip

    def _noise(self) -> float:
        """Return the noise of the encoder over the rows that counted [m]."""
        measured = self.record.measured[:, self.k]
        if self.pieces is None:
            return self.signals.position_noise
        counts = np.zeros(len(measured))
        counts[self.pieces.rows[self.pieces.counts > 0.0]] = 1.0
        return position_noise(measured, counts)

    def _parameter(self, name: str, value: float, half: float) -> Parameter:
        return Parameter(value=value, low=value - half, high=value + half, unit=self.units[name])

    def _of_plain(self, plain: AxisIdentification) -> dict[str, Parameter]:
        """Return what filtered least squares alone tell."""
        found = {
            name: self._parameter(name, plain[name].value, plain[name].high - plain[name].value)
            for name in ("mass", "viscous")
            if plain[name].identified
        }
        if plain["coulomb"].identified and plain["disturbance"].identified:
            quantile = float(student.ppf(0.5 + 0.5 * self.options.confidence, plain.degrees))
            for way, sign in (("forward", -1.0), ("backward", 1.0)):
                value = plain["coulomb"].value + sign * plain["disturbance"].value
                one = np.array([0.0, 0.0, 1.0, sign])
                half = quantile * float(np.sqrt(max(one @ plain.covariance @ one, 0.0)))
                found[f"coulomb_{way}"] = self._parameter(f"coulomb_{way}", value, half)
        return found

    def _of_start(self, names: list[str], quantile: float) -> dict[str, Parameter]:
        found = {name: self._parameter(name, np.nan, np.nan) for name in names}
        if self.start is None:
            return found
        values, spread = self.start.values, self.start.deviations
        for name in ("mass", "viscous", "stiffness", "delay"):
            if name in spread:
                found[name] = self._parameter(name, values[name], quantile * spread[name])
        if "coulomb" in spread and "disturbance" in spread:
            # the sum of two that are hardly correlated where a motion goes both ways
            half = quantile * float(np.hypot(spread["coulomb"], spread["disturbance"]))
            for way, sign in (("forward", -1.0), ("backward", 1.0)):
                value = values["coulomb"] + sign * values["disturbance"]
                found[f"coulomb_{way}"] = self._parameter(f"coulomb_{way}", value, half)
        return found


def _correlation(whitened: NDArray[Any]) -> float:
    x = whitened[np.isfinite(whitened)]
    if len(x) < 200 or not np.any(x):
        return float("nan")
    x = x - x.mean()
    square = float(x @ x)
    return max(abs(float(x[late:] @ x[:-late])) / square for late in range(1, 51))
