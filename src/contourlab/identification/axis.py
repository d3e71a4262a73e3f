"""What the signals of one axis say: values, intervals, and what speaks against them.

Two suspicions are looked into, each by one more column in the equation.

**The command acts later** than was assumed, by δ: the column is -s u_f, its instrument the
derivative of the fitted u_f. A motion of a single frequency does not tell δ from viscous friction;
then δ has no value.

**Friction differs at low speed** (Stribeck, presliding): the column is the sign of the velocity
where it is below ``LOW_SPEEDS`` times the least speed that counts, and 0 above.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from contourlab.controllers.least_squares import PARAMETERS
from contourlab.identification.inference import Fit, fit
from contourlab.identification.record import COMMAND_UNITS, Record
from contourlab.identification.result import AxisIdentification, Parameter
from contourlab.identification.separability import Separability, reason, separate
from contourlab.identification.signals import Signals

__all__ = ["identify_axis"]

STILL = 1e-6
"""Acceleration of a reference, relative to speed times cut-off, below which it is none."""
SINGULAR = 1e6
"""Condition beyond which a column is left out instead of solved for."""
LAG_SHARE = 0.05
"""Share of a sample from which a lag is worth a warning."""
LOW_SPEEDS = 3.0
"""Speed up to which friction at low speed is looked at, in least speeds."""
LOW_SHARE = 0.02
"""Share of the Coulomb friction from which another friction at low speed is worth a warning."""
NEGLIGIBLE = 2e-3
"""Share of the command below which a wrong effort is not worth a word."""
ONE_WAY = 0.9
"""Share of the mean speed from which the mean velocity counts as one direction."""
BIAS_SHARE = 0.01
"""Share of the mass from which the bias of plain least squares is worth a warning."""
Rows = NDArray[Any]


def identify_axis(
    record: Record, k: int, signals: Signals, *, instrument: str, given: Rows, confidence: float,
    limit: float, cutoff: float,
) -> tuple[AxisIdentification, list[str]]:  # fmt: skip
    """Return what was found about one axis, and what to say of it.

    Parameters
    ----------
    record
        As it was read.
    k
        Which axis.
    signals
        Its filtered signals.
    instrument
        One of ``INSTRUMENTS``.
    given
        Known parameters, NaN for those to be found, shape (4,).
    confidence
        Of the intervals.
    limit
        Condition beyond which parameters are not told apart.
    cutoff
        Of the filter [rad/s].
    """
    open_rows = np.flatnonzero(np.isnan(given))
    names = tuple(PARAMETERS[row] for row in open_rows)
    counted = float(signals.weight.sum())
    judged = Separability(np.inf, names, ())
    if counted:
        judged = _judge(signals, open_rows, names, instrument, limit, cutoff)
    used = _columns(signals, open_rows, judged, instrument)
    reliable = np.array([PARAMETERS[row] not in judged.inseparable for row in used], bool)
    values, covariance = given.copy(), np.zeros((4, 4))
    covariance[open_rows], covariance[:, open_rows] = np.nan, np.nan
    plain, bias = np.full(4, np.nan), np.full(4, np.nan)
    lag = low = np.full(3, np.nan)
    residual, together = np.nan, None
    quantile = float(student.ppf(0.5 + 0.5 * confidence, signals.cosines))
    if len(used):
        y, z, weight = signals.regressor[:, used], signals.instrument[:, used], signals.weight
        wanted = signals.wanted - signals.regressor @ np.nan_to_num(given)
        found = fit(y, wanted, z, weight, signals.cosines)
        sure = used[reliable]
        values[sure] = found.estimate[reliable]
        covariance[np.ix_(sure, sure)] = found.covariance[np.ix_(reliable, reliable)]
        residual = float(np.sqrt(np.sum(weight * found.residual**2) / counted))
        plain[sure] = fit(y, wanted, y, weight, signals.cosines).estimate[reliable]
        products = (y * weight[:, None]).T @ y / counted
        added = signals.noise[np.ix_(used, used)] @ found.estimate
        bias[sure] = -np.linalg.solve(products, added)[reliable]
        together = _together(signals, used, found.estimate, ~reliable)
        if instrument != "none":  # its bias is larger than the lag that is looked for
            lag = _lag(record, signals, y, z, wanted, found, limit, quantile, cutoff)
        low = _low_speed(signals, y, z, wanted, limit, quantile)
    half = quantile * np.sqrt(np.diagonal(covariance))
    units = _units(record.kind)
    parameters = {
        name: _parameter(values[row] + half[row] * np.array([0, -1, 1]), units[name])
        for row, name in enumerate(PARAMETERS)
    }
    for name in set(PARAMETERS) - set(names):
        one = parameters[name]
        parameters[name] = Parameter(
            value=one.value, low=one.low, high=one.high, unit=one.unit, known=True
        )
    command, speed = (
        float(np.sqrt(np.sum(signals.weight * x**2) / (counted or 1.0)))
        for x in (signals.wanted, signals.regressor[:, 1])
    )
    negative = tuple(
        name
        for name, effort in (("viscous", speed), ("coulomb", 1.0))
        if parameters[name].high < 0.0
        and abs(parameters[name].value) * effort > NEGLIGIBLE * command
    )
    square = float(np.sum(signals.weight * signals.regressor[:, 0] ** 2)) / (counted or 1.0)
    ratio = 1.0 - signals.noise[0, 0] / square if square > 0.0 else np.nan
    axis = AxisIdentification(
        axis=record.names[k], parameters=parameters, unexcited=judged.unexcited,
        inseparable=judged.inseparable, condition=judged.condition, covariance=covariance,
        degrees=signals.cosines, minimum_speed=signals.minimum_speed,
        counted=counted * record.sample_time, residual_rms=residual,
        encoder_noise=signals.position_noise, noise_ratio=float(max(ratio, 0.0)),
        least_squares=plain, encoder_bias=bias, lag=_parameter(lag, "s"),
        low_speed_friction=_parameter(low, units["coulomb"]), negative=negative,
        command_rms=command,
    )  # fmt: skip
    return axis, _sentences(axis, record, instrument, together)


def _parameter(value_and_ends: Rows, unit: str) -> Parameter:
    value, low, high = (float(x) for x in value_and_ends)
    return Parameter(value=value, low=low, high=high, unit=unit)


def _units(kind: str) -> dict[str, str]:
    unit = COMMAND_UNITS[kind]
    mass, viscous = {
        "force": ("kg", "N s/m"),
        "velocity": ("s", "1"),
        "voltage": ("V/(m/s^2)", "V/(m/s)"),
    }[kind]
    return {"mass": mass, "viscous": viscous, "coulomb": unit, "disturbance": unit}


def _motion(signals: Signals, instrument: str) -> Rows:
    """The motion that parameters are told apart by: of the reference, or as it was measured."""
    return signals.instrument if instrument == "reference" else signals.regressor


def _judge(
    signals: Signals, rows: Rows, names: tuple[str, ...], instrument: str, limit: float,
    cutoff: float,
) -> Separability:  # fmt: skip
    moving = _motion(signals, instrument)
    products = (moving * signals.weight[:, None]).T @ moving / signals.weight.sum()
    least = np.zeros(4)
    least[0] = (STILL * cutoff) ** 2 * products[1, 1]
    if instrument != "reference":  # the measured motion without what noise adds to it
        products = products - signals.noise
        least = np.maximum(least, np.diagonal(signals.noise))
    return separate(products[np.ix_(rows, rows)], names, least[rows], limit)


def _condition(columns: Rows, weight: Rows) -> float:
    x = columns * np.sqrt(weight)[:, None]
    size = np.linalg.norm(x, axis=0)
    return float(np.linalg.cond(x / size)) if size.all() else np.inf


def _columns(signals: Signals, rows: Rows, judged: Separability, instrument: str) -> Rows:
    """Return the columns to solve for.

    Of columns that are truly one, all but one are left out: the one takes what they explain
    together, and the others' values do not change.
    """
    used = [int(row) for row in rows if PARAMETERS[row] not in judged.unexcited]
    moving = _motion(signals, instrument)

    def condition(columns: list[int]) -> float:
        return _condition(moving[:, columns], signals.weight)

    while len(used) > 1 and condition(used) > SINGULAR:
        doubtful = [row for row in used if PARAMETERS[row] in judged.inseparable] or used
        used.remove(min(doubtful, key=lambda row: condition([r for r in used if r != row])))
    return np.array(used, int)


def _with_column(
    signals: Signals, y: Rows, z: Rows, wanted: Rows, columns: tuple[Rows, Rows], limit: float,
    quantile: float,
) -> Rows:  # fmt: skip
    """Return the coefficient of one more column and its interval, NaN if it is not told apart."""
    y, z = (np.column_stack([x, column]) for x, column in zip((y, z), columns, strict=True))
    if _condition(z, signals.weight) > limit:
        return np.full(3, np.nan)
    found = fit(y, wanted, z, signals.weight, signals.cosines)
    half = quantile * np.sqrt(found.covariance[-1, -1])
    return found.estimate[-1] + half * np.array([0.0, -1.0, 1.0])  # type: ignore[no-any-return]


def _lag(
    record: Record, signals: Signals, y: Rows, z: Rows, wanted: Rows, found: Fit, limit: float,
    quantile: float, cutoff: float,
) -> Rows:  # fmt: skip
    fitted = z @ found.estimate
    rates = np.gradient(wanted, record.sample_time), np.gradient(fitted, record.sample_time)
    sizes = [np.sum(signals.weight * signal**2) for signal in (rates[1], fitted)]
    if sizes[0] <= (STILL * cutoff) ** 2 * sizes[1]:  # a constant command has no lag
        return np.full(3, np.nan)
    return _with_column(signals, y, z, wanted, rates, limit, quantile)


def _low_speed(
    signals: Signals, y: Rows, z: Rows, wanted: Rows, limit: float, quantile: float
) -> Rows:
    below = LOW_SPEEDS * signals.minimum_speed
    velocity = signals.regressor[:, 1], signals.instrument[:, 1]
    columns = tuple(np.where(np.abs(v) < below, np.sign(v), 0.0) for v in velocity)
    return _with_column(signals, y, z, wanted, (columns[0], columns[1]), limit, quantile)


def _together(
    signals: Signals, used: Rows, estimate: Rows, unsure: Rows
) -> tuple[float, float] | None:
    """Return what parameters that are not told apart take together, and at which velocity."""
    if not unsure.any() or 0 in used[unsure]:
        return None
    velocity, weight = signals.regressor[:, 1], signals.weight
    mean, speed = (float(np.average(v, weights=weight)) for v in (velocity, np.abs(velocity)))
    way = np.sign(mean) if abs(mean) > ONE_WAY * speed else 1.0
    columns = np.array([0.0, way * speed, way, -1.0])[used]
    return float(columns[unsure] @ estimate[unsure]), float(way * speed)


def _sentences(
    axis: AxisIdentification, record: Record, instrument: str, together: tuple[float, float] | None
) -> list[str]:
    if not axis.counted:
        return [
            f"it never moved faster than {axis.minimum_speed:.3g} m/s for long enough: nothing was "
            "found"
        ]
    said = []
    mass, coulomb = axis["mass"], axis["coulomb"]
    if "mass" in axis.unexcited:
        said.append("mass was not found: the axis hardly accelerated")
    if axis.inseparable:
        *first, last = axis.inseparable
        which = f"{', '.join(first)} and {last}" if first else last
        said.append(
            f"{which} cannot be told apart: {reason(axis.inseparable)} (condition "
            f"{axis.condition:.3g})"
        )
        if together is not None:
            effort, velocity = together
            said[-1] += f"; together they take {effort:.4g} {coulomb.unit} at {velocity:.3g} m/s"
    if mass.identified and not mass.known and mass.low <= 0.0:
        said.append("0 is within the interval of the mass: the record says next to nothing of it")
    said += [f"{name} friction came out negative: the model does not fit" for name in axis.negative]
    if instrument == "none" and mass.identified and 1.0 - axis.noise_ratio > BIAS_SHARE:
        said.append(
            f"encoder noise makes least squares find {100 * (1 - axis.noise_ratio):.2g} % too "
            "little mass: take the reference for an instrument, or lower the cut-off of the filter"
        )
    lag, low = axis.lag, axis.low_speed_friction
    if (lag.low > 0.0 or lag.high < 0.0) and abs(lag.value) > LAG_SHARE * record.sample_time:
        way = "later" if lag.value > 0.0 else "earlier"
        said.append(
            f"the command seems to act {1e3 * abs(lag.value):.3g} ms {way} than was assumed: check "
            "computing_delay"
        )
    least = max(LOW_SHARE * abs(coulomb.value), NEGLIGIBLE * axis.command_rms)
    if (low.low > 0.0 or low.high < 0.0) and abs(low.value) > least:
        said.append(
            f"below {LOW_SPEEDS * axis.minimum_speed:.3g} m/s friction differs by {low.value:.3g} "
            f"{low.unit}: raise minimum_speed"
        )
    return said
