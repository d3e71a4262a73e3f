"""The report of an identification as one HTML page."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from contourlab.reports.html import page_text, write_page
from contourlab.reports.identification_figures import (
    bode_figure,
    correlation_figure,
    health_figures,
    residual_figure,
)
from contourlab.reports.identification_table import (
    change_rows,
    health_sentence,
    model_rows,
    parameter_rows,
    result_sentences,
)

if TYPE_CHECKING:
    from contourlab.identification import (
        FrequencyModel,
        FrequencyResponse,
        Health,
        MachineIdentification,
    )

__all__ = ["write_identification_report"]


def write_identification_report(
    found: MachineIdentification | None, file: str | FilePath, *,
    responses: tuple[FrequencyResponse, ...] = (), models: tuple[FrequencyModel, ...] = (),
    health: Health | None = None, machine: str = "", notes: tuple[str, ...] = (),
    warnings: tuple[str, ...] = (), force: bool = False,
) -> FilePath:  # fmt: skip
    """Write what was identified as one self-contained HTML page; opens without a network.

    Parameters
    ----------
    found
        Parameters of the machine, if they were looked for.
    file
        Where, usually ``.html``.
    responses, models
        Frequency responses and what was fitted to them.
    health
        Parameters over several records.
    machine
        Text of the machine file.
    notes
        How the log was read, and the like.
    warnings
        Beside those of what was found.
    force
        Whether an existing file may be replaced.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    OutputError
        The file exists already, or cannot be written.
    """
    return write_page(
        lambda: _page(found, responses, models, health, machine, notes, warnings), file, force=force
    )


def _page(
    found: MachineIdentification | None, responses: tuple[FrequencyResponse, ...],
    models: tuple[FrequencyModel, ...], health: Health | None, machine: str,
    notes: tuple[str, ...], warnings: tuple[str, ...],
) -> str:  # fmt: skip
    import contourlab

    sentences, tables, figures = [], [], []
    said = list(warnings)
    facts: list[tuple[str, str]] = [("contourlab", contourlab.__version__)]
    remarks = list(notes)
    if health is not None:
        sentences.append(health_sentence(health))
        if health.changes:
            tables.append(
                {
                    "title": "Changes",
                    "heads": ["axis", "parameter", "before", "after", "change", "first seen in"],
                    "rows": change_rows(health),
                    "note": f"Found with a chance of {100 * health.rate:g} % for any false alarm "
                    f"over all records; changes below {100 * health.least_change:g} % are not "
                    "reported.",
                }
            )
        figures += health_figures(health)
        remarks += health.notes
    if found is not None:
        sentences += result_sentences(found)
        tables.append(
            {
                "title": "Parameters",
                "heads": ["axis", "parameter", "value", f"{100 * found.confidence:g} % interval",
                          "unit", "least squares"],
                "rows": [
                    [cell.replace(" +- ", " ± ") for cell in row] for row in parameter_rows(found)
                ],
                "note": "Of the simulated response; least squares are where it began.",
            }
        )  # fmt: skip
        said += found.warnings
        figures += [f for f in (residual_figure(found), correlation_figure(found)) if f]
        facts += [
            ("record", found.source or "a recording"), ("command", found.command_kind),
            ("sample time", f"{1e3 * found.sample_time:.6g} ms"), ("instrument", found.instrument),
        ]  # fmt: skip
        remarks += found.notes
    if responses:
        figures.insert(0, bode_figure(responses, models))
        if models:
            tables.append(
                {
                    "title": "Fitted to the frequency response",
                    "heads": ["axis", "parameter", "value", "interval", "unit"],
                    "rows": model_rows(models),
                    "note": "Misfit 1: as far off as the coherence lets expect.",
                }
            )
            sentences += [_model_sentence(model) for model in models]
    return page_text(
        "identify.html", styles=(), scripts=("identify.js",), data=_payload(figures),
        title="What the machine is, from its log",
        sentences=[text.replace(" +- ", " ± ") for text in sentences or ["Nothing was found."]],
        warnings=list(dict.fromkeys(said)), tables=tables, figures=figures, facts=facts,
        notes=list(dict.fromkeys(remarks)), machine=machine,
    )  # fmt: skip


def _payload(figures: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "figures": [{k: v for k, v in f.items() if k not in ("title", "note")} for f in figures]
    }


def _model_sentence(model: FrequencyModel) -> str:
    if model.model != "two_mass":
        return f"Axis {model.axis} answers like one mass up to {model.frequency[-1]:.3g} Hz."
    return (
        f"Axis {model.axis} resonates at {model.resonance_hz:.3g} Hz, two masses measured on the "
        f"{model.side}."
    )
