"""The figures of an identification, as data for its page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.reports.decimation import kept_rows
from contourlab.reports.html import packed
from contourlab.reports.palette import look

if TYPE_CHECKING:
    from contourlab.identification import (
        AxisModel,
        FrequencyModel,
        FrequencyResponse,
        Health,
        MachineIdentification,
    )

__all__ = ["bode_figure", "correlation_figure", "health_figures", "residual_figure"]

POINTS = 4000
"""Of a curve."""
LAGS = 60
"""Of a correlation."""


def _curve(
    x: Any, y: NDArray[Any], number: int, *, name: str = "", mode: str = "lines",
    dash: str = "solid", error: NDArray[Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    colour = look(number)
    curve: dict[str, Any] = {
        "x": x if isinstance(x, list) else packed(x), "y": packed(y), "name": name, "mode": mode,
        "dash": dash, "light": colour.light, "dark": colour.dark,
    }  # fmt: skip
    if error is not None:
        curve["error"] = packed(error)
    return curve


def residual_figure(found: MachineIdentification) -> dict[str, Any] | None:
    """Return measured less simulated position of every axis over time; None if none was simulated.

    Parameters
    ----------
    found
        What was identified.
    """
    panels = []
    for k, axis in enumerate(found.axes):
        if axis.method != "simulation error":
            continue
        rows = kept_rows(len(axis.time), POINTS, [axis.residual])
        curves = [_curve(axis.time[rows], axis.residual[rows] * 1e6, k)]
        noise = 1e6 * 2.0 * axis.encoder_noise
        panels.append(
            {"y": f"{axis.axis} residual [µm]", "curves": curves, "levels": [-noise, noise]}
        )
    if not panels:
        return None
    return {
        "id": "residual", "title": "Measured less simulated position", "x": "time [s]",
        "panels": panels,
        "note": "Each stretch one way begins anew, from the state that fits it best; reversals are "
        "left out. Dotted: twice the noise of the encoder, as found from the record.",
    }  # fmt: skip


def correlation_figure(found: MachineIdentification) -> dict[str, Any] | None:
    """Return the correlation of every residual with its own past; None if none was simulated.

    Parameters
    ----------
    found
        What was identified.
    """
    curves, least = [], 0.0
    for k, axis in enumerate(found.axes):
        x = axis.residual[np.isfinite(axis.residual)]
        if len(x) < 4 * LAGS or not np.any(x):
            continue
        x = x - x.mean()
        square = float(x @ x)
        lags = np.arange(1, LAGS + 1)
        rho = np.array([float(x[lag:] @ x[:-lag]) / square for lag in lags])
        curves.append(_curve(lags * found.sample_time * 1e3, rho, k, name=axis.axis))
        least = max(least, 2.0 / np.sqrt(len(x)))
    if not curves:
        return None
    return {
        "id": "correlation", "title": "Correlation of the residual with its past",
        "x": "time between [ms]",
        "panels": [{"y": "correlation", "curves": curves, "levels": [-least, least]}],
        "note": "White noise of an encoder stays within the dotted lines in 95 of 100 places. What "
        "is correlated longer is a force or a motion that the model does not know.",
    }  # fmt: skip


def bode_figure(
    responses: tuple[FrequencyResponse, ...], models: tuple[FrequencyModel, ...]
) -> dict[str, Any]:
    """Return size, phase and coherence over frequency, measured and fitted.

    Parameters
    ----------
    responses
        Of the axes.
    models
        What was fitted to them; may be fewer.
    """
    fitted = {model.axis: model for model in models}
    size, phase, sure = [], [], []
    for k, one in enumerate(responses):
        use = one.usable
        f, h = one.frequency[use], one.response[use]
        size.append(_curve(f, np.abs(h), k, name=f"{one.axis} measured", mode="markers"))
        phase.append(_curve(f, _degrees(h), k, mode="markers"))
        kept = one.frequency <= (f[-1] * 1.5 if len(f) else np.inf)
        sure.append(_curve(one.frequency[kept], one.coherence[kept], k))
        if one.axis in fitted:
            model = fitted[one.axis]
            title = f"{one.axis} {model.model.replace('_', ' ')}"
            size.append(_curve(model.frequency, np.abs(model.response), k, name=title))
            phase.append(_curve(model.frequency, _degrees(model.response), k))
    return {
        "id": "bode", "title": "Frequency response from command to position",
        "x": "frequency [Hz]", "log": True,
        "panels": [
            {"y": f"size [{responses[0].unit}]", "log": True, "curves": size},
            {"y": "phase [°]", "curves": phase},
            {"y": "coherence", "curves": sure},
        ],
        "note": "Points are where the signal was excited and coherent; lines are the fitted model.",
    }  # fmt: skip


def _degrees(h: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(np.degrees(np.unwrap(np.angle(h)))) if len(h) else np.zeros(0)


def health_figures(health: Health) -> list[dict[str, Any]]:
    """Return a figure for each axis: its parameters over the records, with intervals.

    Parameters
    ----------
    health
        What was tracked.
    """
    figures = []
    labels = list(health.labels)
    for number, axis in enumerate(dict.fromkeys(one.axis for one in health.series)):
        panels = []
        for k, one in enumerate(o for o in health.series if o.axis == axis):
            half = 0.5 * (one.high - one.low)
            panels.append(
                {
                    "y": f"{one.parameter} [{one.unit}]",
                    "curves": [
                        _curve(labels, one.value, k, mode="markers+lines", error=half),
                    ],
                    "levels": [one.baseline] if np.isfinite(one.baseline) else [],
                }
            )
        figures.append(
            {
                "id": f"health{number}", "title": f"Axis {axis} over the records", "x": "record",
                "category": True, "panels": panels,
                "note": "Bars are intervals; dotted is the mean of the first records. A record "
                "that does not tell a parameter has no point.",
            }
        )  # fmt: skip
    return figures


def thinned(axis: AxisModel) -> bool:
    """Return whether curves of an axis are drawn with fewer points than there are.

    Parameters
    ----------
    axis
        One axis.
    """
    return len(axis.time) > POINTS
