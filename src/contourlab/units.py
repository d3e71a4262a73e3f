"""Units at the edges: quantities with a written unit in, SI inside, µm and mm/min out.

A length, speed or time that a person writes carries its unit (``"3000 mm/min"``); a bare number is
refused where more than one unit is customary, so that no unit is ever assumed in silence.
"""

from __future__ import annotations

import math
import re

from contourlab.errors import UnitError

__all__ = ["DIMENSIONS", "parse_quantity", "to_um"]

_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9,
           "in": 0.0254, "inch": 0.0254}  # fmt: skip
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0}
_DEGREE = math.pi / 180.0
_ANGLE = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6, "μrad": 1e-6, "deg": _DEGREE,
          "arcmin": _DEGREE / 60.0, "arcsec": _DEGREE / 3600.0}  # fmt: skip
_MASS = {"kg": 1.0, "g": 1e-3}
_FORCE = {"N": 1.0, "kN": 1e3}
_RATE = {"Hz": 1.0, "kHz": 1e3}


def _per_time(length: dict[str, float], power: int) -> dict[str, float]:
    units = {}
    for time, seconds in _TIME.items():
        suffixes = [time] if power == 1 else [f"{time}^{power}", f"{time}{power}"]
        superscript = {2: "²", 3: "³"}.get(power)
        if superscript:
            suffixes.append(time + superscript)
        for name, metres in length.items():
            for suffix in suffixes:
                units[f"{name}/{suffix}"] = metres / seconds**power
    return units


DIMENSIONS: dict[str, dict[str, float]] = {
    "length": _LENGTH,
    "time": _TIME,
    "angle": _ANGLE,
    "mass": _MASS,
    "force": _FORCE,
    "frequency": _RATE,
    "velocity": _per_time(_LENGTH, 1),
    "acceleration": _per_time(_LENGTH, 2),
    "jerk": _per_time(_LENGTH, 3),
    "angular_velocity": _per_time(_ANGLE, 1),
}
"""Unit names and their size in SI, by kind of quantity."""

_SHOWN = {
    "length": "m, mm, um, in",
    "time": "s, ms, us, min",
    "angle": "rad, mrad, urad, deg, arcmin, arcsec",
    "mass": "kg, g",
    "force": "N, kN",
    "frequency": "Hz, kHz",
    "velocity": "m/s, mm/s, mm/min, in/min",
    "acceleration": "m/s^2, mm/s^2",
    "jerk": "m/s^3, mm/s^3",
    "angular_velocity": "rad/s, deg/s",
}

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(\S*)\s*\Z")


def parse_quantity(text: object, dimension: str, name: str = "value") -> float:
    """Return a written quantity in SI.

    Parameters
    ----------
    text
        A number and its unit, such as ``"3000 mm/min"``.
    dimension
        Kind of quantity, a key of :data:`DIMENSIONS`.
    name
        What is being read, for the message.

    Returns
    -------
    float
        The value in SI units.

    Raises
    ------
    UnitError
        No unit, an unknown unit, or a unit of another kind; the message lists the allowed ones.
    """
    units = DIMENSIONS[dimension]
    allowed = f"write a number and a unit of {dimension.replace('_', ' ')}: {_SHOWN[dimension]}"
    match = _QUANTITY.match(text) if isinstance(text, str) else None
    if match is None:
        shown = f"{text!r} has no unit" if isinstance(text, int | float) else f"{text!r}"
        raise UnitError(f"{name} must be a {dimension}, got {shown}; {allowed}")
    number, unit = match.groups()
    if unit not in units:
        problem = f"unit {unit!r} is not one of {dimension}" if unit else "the unit is missing"
        raise UnitError(f"{name} = {text!r}: {problem}; {allowed}")
    value = float(number) * units[unit]
    if not math.isfinite(value):
        raise UnitError(f"{name} = {text!r} is not finite")
    return value


def to_um(metres: float) -> str:
    """Return a length as text in µm with three significant digits, without its unit.

    Parameters
    ----------
    metres
        The length [m].

    Examples
    --------
    >>> to_um(1.23456e-5)
    '12.3'
    """
    value = metres * 1e6
    if not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 6)}f}"
