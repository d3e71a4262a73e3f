"""The fits of all axes as a list of causes, with figures, shares and what would help."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.evaluation.causes.cause import Cause
from contourlab.evaluation.causes.periodic import Band
from contourlab.evaluation.causes.regression import AxisFit
from contourlab.evaluation.causes.response import PEAKS, decay_time, lag_time
from contourlab.evaluation.causes.sensors import refusal, sees
from contourlab.evaluation.causes.words import advice

if TYPE_CHECKING:
    from contourlab.evaluation.causes.decompose import Decomposition, Record

__all__ = ["list_causes"]

Values = NDArray[Any]
CHANCE = "not told from chance in this log"
STEADY = (
    "what is lost at a reversal builds up as the loop answers a force: it is friction that no "
    "integral action takes away"
)
SMALL = 0.005
"""A cause is small if the contour error that it makes is this share of the whole's rms, or less."""
_GROUP_NAMES = {"lag": "lag mismatch", "peaks": "friction", "sides": "backlash", "scale": "scale",
                "cyclic": "cyclic error"}  # fmt: skip


def list_causes(
    record: Record, fits: tuple[AxisFit, ...], bands: tuple[tuple[Band, ...], ...],
    pitches: tuple[float | None, ...], measured: str | None,
) -> Decomposition:  # fmt: skip
    """Return the causes of a contour error from the fits of its axes.

    Parameters
    ----------
    record
        The judged log.
    fits
        Of each axis.
    bands
        Vibrations of each axis.
    pitches
        Period of each axis' cyclic error [m]; None where there is none.
    measured
        Where the position was measured.
    """
    from contourlab.evaluation.causes.decompose import Decomposition

    listing = _Listing(record)
    n = len(record.error)
    tracking = record.commanded - record.actual
    normal = record.normal

    def along(vectors: Values) -> Values:
        return np.einsum("ij,ij->i", normal, vectors)  # type: ignore[no-any-return]

    def of_axis(k: int, values: Values) -> Values:
        return normal[:, k] * values

    # lag, with what it does on curves: n·(f - r) without the commanded path's own part
    lags = np.column_stack([fit.contributions["lag"] for fit in fits])
    curved = record.error - along(tracking) - record.own
    times = [
        lag_time(fit.coefficients["lag"], fit.shape.denominator, record.sample_time) for fit in fits
    ]
    unit = "s" if record.timed else "samples"
    parameters = {f"lag {a}": (t, unit) for a, t in zip(record.axes, times, strict=True)}
    mistaken = _mistaken(fits, record.axes, "lag")
    listing.add("lag mismatch", "lag", record.axes, along(lags) + curved, parameters, mistaken)
    for k, (axis, fit) in enumerate(zip(record.axes, fits, strict=True)):
        _friction(listing, fit, axis, k, of_axis, measured)
    for k, (axis, fit) in enumerate(zip(record.axes, fits, strict=True)):
        _backlash(listing, fit, axis, k, of_axis, measured)
    for k, (axis, fit) in enumerate(zip(record.axes, fits, strict=True)):
        value = fit.coefficients.get("scale", np.zeros(1))[0]
        # e = r - y: a table that goes too far has a negative slope
        listing.one(fit, "scale", f"scale {axis}", "scale", axis, of_axis(k, _of(fit, "scale", n)),
                    {"scale": (-float(value), "m/m")}, measured)  # fmt: skip
    _squareness(listing, record, fits, along, measured)
    for k, (axis, fit) in enumerate(zip(record.axes, fits, strict=True)):
        period = pitches[k]
        wave = fit.coefficients.get("cyclic")
        parameters = {}
        if period is not None and wave is not None:
            parameters = {"amplitude": (float(np.hypot(*wave)), "m"), "period": (period, "m")}
        listing.one(fit, "cyclic", f"cyclic error {axis}", "cyclic", axis,
                    of_axis(k, _of(fit, "cyclic", n)), parameters, measured)  # fmt: skip
    _vibrations(listing, record, bands, of_axis)
    if record.own.any():
        listing.add("commanded path", "commanded path", (), record.own, {}, "")
    warnings = _warnings(record, fits, measured)
    return Decomposition(listing.finished(), fits, bands, warnings)


class _Listing:
    """Causes as they are found, and what is left of the contour error."""

    def __init__(self, record: Record) -> None:
        self.record = record
        self.judged = np.isfinite(record.error)
        self.error = record.error
        self.square = float(np.mean(record.error[self.judged] ** 2))
        self.left = record.error.copy()
        self.causes: list[Cause] = []

    def add(
        self, name: str, kind: str, axes: tuple[str, ...], signal: Values,
        parameters: dict[str, tuple[float, str]], note: str, state: str = "found",
    ) -> None:  # fmt: skip
        self.left = self.left - signal
        self.causes.append(self._made(name, kind, axes, signal, parameters, note, state))

    def _made(
        self, name: str, kind: str, axes: tuple[str, ...], signal: Values,
        parameters: dict[str, tuple[float, str]], note: str, state: str,
    ) -> Cause:  # fmt: skip
        own = signal[self.judged]
        rms = float(np.sqrt(np.mean(own**2)))
        if rms < SMALL * np.sqrt(self.square) and kind not in ("rest", "lag"):
            state = "small"
        share = float(np.mean(own * self.error[self.judged])) / self.square if self.square else 0.0
        cause = Cause(
            name=name, kind=kind, axes=axes, state=state, rms=rms,
            max=float(np.abs(own).max()), share=share, parameters=parameters, note=note,
            signal=np.where(self.judged, signal, np.nan),
        )  # fmt: skip
        return replace(cause, remedy=advice(cause, self.record.timed))

    def without(self, name: str, kind: str, axes: tuple[str, ...], state: str, note: str) -> None:
        self.causes.append(Cause(name=name, kind=kind, axes=axes, state=state, note=note))

    def one(
        self, fit: AxisFit, group: str, name: str, kind: str, axis: str, signal: Values,
        parameters: dict[str, tuple[float, str]], measured: str | None,
    ) -> None:  # fmt: skip
        if measured is not None and not sees(kind, measured):
            self.without(name, kind, (axis,), "unobservable", refusal(kind, measured))
        elif group in fit.inseparable:
            partner = _GROUP_NAMES.get(fit.inseparable[group].split()[0], fit.inseparable[group])
            self.without(name, kind, (axis,), "not separable", _tell_apart(partner))
        elif group in fit.contributions:
            self.add(name, kind, (axis,), signal, parameters, _mistaken([fit], (axis,), group))
        else:
            self.without(name, kind, (axis,), "small", CHANCE)

    def finished(self) -> tuple[Cause, ...]:
        found = sorted(self.causes, key=lambda c: -(c.rms if np.isfinite(c.rms) else -1.0))
        rest = self._made("rest", "rest", (), self.left, {}, "", "found")
        return (*found, rest)


def _of(fit: AxisFit, group: str, n: int) -> Values:
    return fit.contributions.get(group, np.zeros(n))


def _tell_apart(partner: str) -> str:
    return (
        f"on this motion it looks like {partner}: a motion in both directions and at two feeds "
        "tells them apart"
    )


def _mistaken(fits: Any, axes: tuple[str, ...], group: str) -> str:
    found = []
    for axis, fit in zip(axes, fits, strict=True):
        for other, place in fit.inseparable.items():
            if place == group:
                kind = other.split()[0]
                name = "squareness" if kind == "cross" else _GROUP_NAMES.get(kind, kind)
                found.append(f"{name} of {axis}")
    if not found:
        return ""
    return (
        f"may be {' or '.join(dict.fromkeys(found))} instead, which this motion does not tell apart"
    )


def _friction(
    listing: _Listing, fit: AxisFit, axis: str, k: int, of_axis: Any, measured: str | None
) -> None:
    values = _of(fit, "peaks", len(fit.residual))
    if "peaks" not in fit.contributions:
        listing.one(fit, "peaks", f"friction {axis}", "friction", axis, values, {}, measured)
        return
    coefficients = fit.coefficients["peaks"]
    record = listing.record
    lasting = decay_time(coefficients[:PEAKS], fit.shape.denominator, record.sample_time)
    parameters = {
        "peak": (float(np.abs(values[listing.judged]).max()), "m"),
        "decay time": (lasting, "s" if record.timed else "samples"),
    }
    if len(coefficients) > PEAKS:
        parameters["steady"] = (float(abs(coefficients[PEAKS])), "m")
    listing.add(f"friction {axis}", "friction", (axis,), of_axis(k, values), parameters,
                _mistaken([fit], (axis,), "peaks"))  # fmt: skip


def _backlash(
    listing: _Listing, fit: AxisFit, axis: str, k: int, of_axis: Any, measured: str | None
) -> None:
    n = len(fit.residual)
    width = 2.0 * float(fit.coefficients.get("sides", np.zeros(1))[0])
    signal = of_axis(k, _of(fit, "sides", n))
    name, parameters = f"backlash {axis}", {"width": (width, "m")}
    if fit.shape.steady and sees("backlash", measured):
        listing.without(name, "backlash", (axis,), "small", STEADY)
        return
    listing.one(fit, "sides", name, "backlash", axis, signal, parameters, measured)


def _squareness(
    listing: _Listing, record: Record, fits: tuple[AxisFit, ...], along: Any, measured: str | None
) -> None:
    """Split what each axis takes from the others into squareness, rotation and a fixed offset."""
    n, n_axes = record.commanded.shape
    rigid = np.column_stack([np.broadcast_to(_of(fit, "offset", n), n) for fit in fits])
    parameters = {f"offset {a}": (-float(fit.coefficients["offset"][0]), "m")
                  for a, fit in zip(record.axes, fits, strict=True)}  # fmt: skip
    for i in range(n_axes):
        for j in range(i + 1, n_axes):
            first, second = record.axes[i], record.axes[j]
            pair, name = (first, second), f"squareness {first}-{second}"
            if measured is not None and not sees("squareness", measured):
                listing.without(
                    name, "squareness", pair, "unobservable", refusal("squareness", measured)
                )
                continue
            upper, lower = f"cross {second}", f"cross {first}"
            place = fits[i].inseparable.get(upper) or fits[j].inseparable.get(lower)
            values = np.zeros((n, n_axes))
            one, two = _of(fits[i], upper, n), _of(fits[j], lower, n)
            if place is not None:
                partner = _GROUP_NAMES.get(place.split()[0], place)
                listing.without(name, "squareness", pair, "not separable", _tell_apart(partner))
                # what of the two is left is a part of a rotation and of a squareness: with the rest
                rigid[:, i] += one
                rigid[:, j] += two
                continue
            if upper not in fits[i].contributions and lower not in fits[j].contributions:
                listing.without(name, "squareness", pair, "small", CHANCE)
                continue
            a_upper = float(fits[i].coefficients.get(upper, np.zeros(1))[0])
            a_lower = float(fits[j].coefficients.get(lower, np.zeros(1))[0])
            # tool x = x - (α + ρ) y, tool y = y + ρ x, so e_x = (α + ρ) y, e_y = -ρ x
            turned = -a_lower
            angle = a_upper - turned
            other = record.commanded[:, j] - float(np.nanmean(record.commanded[listing.judged, j]))
            values[:, i] = angle * other
            rigid[:, i] += one - values[:, i]
            rigid[:, j] += two
            parameters[f"rotation {first}-{second}"] = (turned, "rad")
            listing.add(name, "squareness", pair, along(values), {"angle": (angle, "rad")}, "")
    listing.add("alignment", "alignment", record.axes, along(rigid), parameters, "")


def _vibrations(
    listing: _Listing, record: Record, bands: tuple[tuple[Band, ...], ...], of_axis: Any
) -> None:
    for k, (axis, own) in enumerate(zip(record.axes, bands, strict=True)):
        for band in own:
            hz = f"{band.frequency:.3g} Hz" if record.timed else f"{band.frequency:.3g} per sample"
            parameters = {
                "frequency": (band.frequency, "Hz" if record.timed else "1/sample"),
                "amplitude": (float(np.sqrt(2.0) * np.std(band.signal)), "m"),
            }
            nyquist = 0.5 / record.sample_time
            note = (
                f"frequencies above {nyquist:.4g} Hz appear below it: this may be one of them"
                if record.timed and band.frequency > 0.2 * nyquist
                else ""
            )
            listing.add(f"vibration {axis} at {hz}", "vibration", (axis,),
                        of_axis(k, band.signal), parameters, note)  # fmt: skip


def _warnings(record: Record, fits: tuple[AxisFit, ...], measured: str | None) -> tuple[str, ...]:
    said = []
    if measured is None:
        said.append(
            "it is not stated where the actual position was measured: if on the motor, backlash, "
            "pitch, scale and squareness are not in it, and finding none does not mean that there "
            "are none; state measured (motor, scale or tool)"
        )
    for axis, fit in zip(record.axes, fits, strict=True):
        for group, place in fit.inseparable.items():
            kind = group.split()[0]
            name = "squareness" if kind == "cross" else _GROUP_NAMES.get(kind, kind)
            other = _GROUP_NAMES.get(place.split()[0], "squareness")
            said.append(f"{axis}: {name} and {other} cannot be told apart on this motion")
    return tuple(dict.fromkeys(said))
