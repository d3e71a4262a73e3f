"""An identification as a table for people, rows for the page, and JSON."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

    from contourlab.identification import (
        FrequencyModel,
        FrequencyResponse,
        Health,
        MachineIdentification,
        Parameter,
    )

__all__ = [
    "change_rows",
    "health_sentence",
    "identification_json",
    "identification_table",
    "model_rows",
    "parameter_rows",
    "result_sentences",
]


def identification_table(found: MachineIdentification) -> Table:
    """Return the parameters of every axis as a table for the terminal.

    Parameters
    ----------
    found
        What was identified.
    """
    from rich.table import Table

    loops = any("velocity_lag" in axis.parameters for axis in found.axes)
    title = "Position loops" if loops else "Identified, in units of the command"
    table = Table(title=title, title_justify="left")
    table.add_column("axis")
    table.add_column("parameter")
    table.add_column(f"value and half of the {100 * found.confidence:g} % interval")
    if not loops:
        table.add_column("least squares", justify="right")
    for axis in found.axes:
        for name, one in axis.parameters.items():
            start = axis.least_squares[name]
            began = f"{start.value:.6g}" if start.identified else "–"
            table.add_row(axis.axis, name, str(one), *([] if loops else [began]))
    return table


def parameter_rows(found: MachineIdentification) -> list[list[str]]:
    """Return the rows of the page's table.

    Parameters
    ----------
    found
        What was identified.
    """
    rows = []
    for axis in found.axes:
        for name, one in axis.parameters.items():
            start = axis.least_squares[name]
            rows.append(
                [
                    axis.axis, name, str(one).removesuffix(f" {one.unit}"), _ends(one), one.unit,
                    f"{start.value:.6g}" if start.identified else "–",
                ]
            )  # fmt: skip
    return rows


def _ends(one: Parameter) -> str:
    if one.known or not one.identified:
        return "–"
    return f"{one.low:.7g} to {one.high:.7g}"


def model_rows(models: tuple[FrequencyModel, ...]) -> list[list[str]]:
    """Return the rows of the page's table of fitted frequency responses.

    Parameters
    ----------
    models
        What was fitted.
    """
    rows = []
    for model in models:
        for name, one in (model.parameters | model.derived).items():
            value = f"{one.value:.6g}" if one.identified else "not told"
            rows.append([model.axis, name.replace("_", " "), value, _ends(one), one.unit])
        rows.append([model.axis, "misfit", f"{model.misfit:.3g}", "–", ""])
    return rows


def change_rows(health: Health) -> list[list[str]]:
    """Return the rows of the page's table of changes.

    Parameters
    ----------
    health
        What was tracked.
    """
    return [
        [
            one.axis, one.parameter, f"{one.before:.4g} {one.unit}", f"{one.after:.4g} {one.unit}",
            f"{100 * one.share:+.3g} %" if math.isfinite(one.share) else "–",
            f"{one.label} ({one.kind})",
        ]
        for one in health.changes
    ]  # fmt: skip


def health_sentence(health: Health) -> str:
    """Return what became of the machine over the records, in a sentence.

    Parameters
    ----------
    health
        What was tracked.
    """
    n = len(health.labels)
    if not health.changes:
        return f"No parameter changed over {n} records."
    names = ", ".join(dict.fromkeys(f"{c.axis} {c.parameter}" for c in health.changes))
    return f"Over {n} records these changed: {names}."


def result_sentences(found: MachineIdentification) -> list[str]:
    """Return what was found about each axis, a sentence each.

    Parameters
    ----------
    found
        What was identified.
    """
    said = []
    for axis in found.axes:
        named = (
            ("velocity_lag", "velocity_gain", "feed_forward")
            if "velocity_lag" in axis.parameters
            else ("mass", "viscous", "stiffness")
        )
        parts = [f"{name} {axis[name]}" for name in named if axis[name].identified]
        if "coulomb_forward" in axis.parameters and math.isfinite(axis.coulomb):
            parts.append(f"dry friction {axis.coulomb:.4g} {axis['coulomb_forward'].unit}")
        if axis["delay"].identified and not axis["delay"].known:
            parts.append(f"delay {1e3 * axis['delay'].value:.3g} ms")
        said.append(f"Axis {axis.axis}: {', '.join(parts) or 'nothing was found'}.")
    return said


def _number(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def identification_json(
    found: MachineIdentification | None, *, responses: tuple[FrequencyResponse, ...] = (),
    models: tuple[FrequencyModel, ...] = (), health: Health | None = None,
    machine: Path | None = None, report: Path | None = None, suggestion: Path | None = None,
    warnings: tuple[str, ...] = (),
) -> dict[str, Any]:  # fmt: skip
    """Return the body of ``identify --json``.

    Parameters
    ----------
    found
        Parameters of the machine, if they were looked for.
    responses, models
        Frequency responses and what was fitted to them.
    health
        Parameters over several records.
    machine, report, suggestion
        Files that were written.
    warnings
        All of them.
    """
    body: dict[str, Any] = {"schema": "contourlab.identify/1"}
    body["axes"] = [] if found is None else found.to_dict()["axes"]
    fitted = {model.axis: model for model in models}
    if responses:
        body["frequency_response"] = [
            {
                "axis": one.axis, "unit": one.unit,
                "frequency_hz": [float(f) for f in one.frequency[one.usable]],
                "magnitude": [float(abs(h)) for h in one.response[one.usable]],
                "real": [float(h.real) for h in one.response[one.usable]],
                "imaginary": [float(h.imag) for h in one.response[one.usable]],
                "coherence": [float(c) for c in one.coherence[one.usable]],
                "model": None if one.axis not in fitted else _model(fitted[one.axis]),
            }
            for one in responses
        ]  # fmt: skip
    if health is not None:
        body["health"] = health.to_dict()
    for name, file in (("machine", machine), ("report", report), ("suggestion", suggestion)):
        body[name] = None if file is None else str(file)
    body["warnings"] = list(warnings)
    return body


def _model(model: FrequencyModel) -> dict[str, Any]:
    return {
        "model": model.model, "side": model.side, "misfit": _number(model.misfit),
        "resonance_hz": _number(model.resonance_hz),
        "anti_resonance_hz": _number(model.anti_resonance_hz),
        "parameters": {
            name: {
                "value": _number(one.value), "low": _number(one.low), "high": _number(one.high),
                "unit": one.unit,
            }
            for name, one in (model.parameters | model.derived).items()
        },
    }  # fmt: skip
