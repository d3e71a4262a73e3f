"""What would remove a cause, in a sentence with its numbers."""

from __future__ import annotations

import numpy as np

from contourlab.evaluation.causes.cause import Cause
from contourlab.units import to_um

__all__ = ["advice"]

ALIKE = 0.03
"""Lags that differ by less than this share are the same."""


def advice(cause: Cause, timed: bool) -> str:
    """Return what would remove a cause.

    Parameters
    ----------
    cause
        With its parameters.
    timed
        Whether times are in seconds.
    """
    value = {name: number for name, (number, _) in cause.parameters.items()}
    axis = " and ".join(cause.axes)
    if cause.kind == "lag":
        return _lag(cause, timed)
    if cause.kind == "friction":
        return (
            f"compensate the friction of {axis} where it reverses (peaks of "
            f"{to_um(value['peak'])} um that last some {_time(value['decay time'], timed)}), or "
            "let its velocity loop be stiffer"
        )
    if cause.kind == "backlash":
        width = value["width"]
        if width < 0.0:
            return (
                f"reduce the backlash compensation of {axis} by {to_um(-width)} um: it overdoes it"
            )
        return (
            f"take {to_um(width)} um of lost motion out of {axis}: preload, or backlash "
            "compensation; if the controller has no integral action, steady friction looks the same"
        )
    if cause.kind == "scale":
        return (
            f"correct the scale of {axis} by {-1e6 * value['scale']:.3g} um/m, or its temperature"
        )
    if cause.kind == "squareness":
        off = 1e6 * value["angle"]
        return f"align {axis}, which are {off:+.3g} urad from square, or compensate it"
    if cause.kind == "cyclic":
        return (
            f"put {to_um(value['amplitude'])} um over {1e3 * value['period']:.4g} mm into the "
            f"pitch error table of {axis}, or measure on a scale"
        )
    if cause.kind == "vibration":
        hz = f"{value['frequency']:.3g} {'Hz' if timed else 'per sample'}"
        return f"find what excites {axis} at {hz}: a notch filter, less jerk, or balancing"
    if cause.kind == "alignment":
        return "none needed if only the shape counts: an offset and a rotation of the whole path"
    if cause.kind == "commanded path":
        return (
            "tighten the path tolerance (G64 P) or the interpolation: the commands leave the part"
        )
    return ""


def _time(value: float, timed: bool) -> str:
    return f"{1e3 * value:.3g} ms" if timed else f"{value:.3g} samples"


def _lag(cause: Cause, timed: bool) -> str:
    lags = {name.removeprefix("lag "): value for name, (value, _) in cause.parameters.items()}
    sizes = np.array(list(lags.values()))
    shown = ", ".join(f"{axis} {_time(value, timed)}" for axis, value in lags.items())
    if np.ptp(sizes) > ALIKE * np.abs(sizes).max() and (sizes > 0.0).all() and timed:
        gains = ", ".join(f"{axis} {1.0 / value:.4g} 1/s" for axis, value in lags.items())
        return (
            f"make the lags equal (now {shown}: velocity gains {gains}), best by setting all to "
            "the lower gain, or by velocity feed-forward"
        )
    return (
        f"the lags are {shown}: what they leave on curves goes with feed-forward, a higher "
        "gain, or less feed"
    )
