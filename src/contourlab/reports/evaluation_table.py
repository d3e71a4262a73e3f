"""An evaluated log for the terminal and for programs."""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from contourlab.reports.tables import ascii_text
from contourlab.units import to_um

if TYPE_CHECKING:
    from rich.table import Table

    from contourlab.evaluation import Cause, Evaluation

__all__ = [
    "cause_figures",
    "column_rows",
    "evaluation_json",
    "evaluation_tables",
    "figure_rows",
    "headline",
    "with_half_width",
]

_UNITS = {"m": (1e6, "um"), "s": (1e3, "ms"), "rad": (1e6, "urad"), "m/m": (1e6, "um/m")}


def with_half_width(value: float, half: float) -> str:
    """Return a length in µm, with no more digits than its half width allows.

    Parameters
    ----------
    value, half
        [m]
    """
    if not math.isfinite(value):
        return "-"
    if half <= 0.0 or half < 1e-3 * abs(value):
        return to_um(value)
    digits = max(0, -math.floor(math.log10(half * 1e6)))
    if half >= abs(value):
        return f"below {to_um(abs(value) + half)}"
    return f"{value * 1e6:.{digits}f} ± {to_um(half)}"


def headline(evaluation: Evaluation) -> list[str]:
    """Return what was found, in sentences, the answer first.

    Parameters
    ----------
    evaluation
        The evaluation.
    """
    m = evaluation.metrics
    largest, half = _number(m["contour_error_max"]), _number(m["contour_error_max_uncertainty"])
    rms = _number(m["contour_error_rms"])
    if half >= largest:
        said = [
            f"The contour error is at most {to_um(largest + half)} um, and the log is too coarse "
            "to say more."
        ]
    else:
        shown = with_half_width(largest, half)
        said = [f"The contour error reaches {shown} um, {to_um(rms)} um rms."]
    if evaluation.worst:
        worst = evaluation.worst[0]
        at = f" at {worst.time:.5g} s" if evaluation.log.timed else ""
        said.append(f"The worst place is {worst.where}{at}.")
    found = [c for c in evaluation.causes if c.kind != "rest" and c.share > 0.05]
    if found:
        parts = [f"{c.name} ({100 * c.share:.0f} %)" for c in found[:3]]
        said.append(f"Most of it comes from {', '.join(parts)}.")
    return said


def _number(value: Any) -> float:
    return float(value)


def figure_rows(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the figures by name, as text with units.

    Parameters
    ----------
    evaluation
        The evaluation.
    """
    m = evaluation.metrics
    floor = _number(m["contour_error_floor_rms"])
    rows = [
        (
            "contour error, largest",
            with_half_width(
                _number(m["contour_error_max"]), _number(m["contour_error_max_uncertainty"])
            )
            + " um",
        ),
        (
            "contour error, rms",
            with_half_width(_number(m["contour_error_rms"]), _number(m["contour_error_floor_rms"]))
            + " um",
        ),
        ("contour error, mean", with_half_width(_number(m["contour_error_mean"]), floor) + " um"),
        (
            "rms of a perfect machine on this grid",
            f"{to_um(floor)} um",
        ),
    ]
    for name, title, half in (
        ("tracking_error_max", "tracking error, largest", "tracking_error_max_uncertainty"),
        ("tracking_error_rms", "tracking error, rms", "tracking_error_floor_rms"),
        ("lag_error_max", "lag along the path, largest", "tracking_error_max_uncertainty"),
        ("lag_error_rms", "lag along the path, rms", "tracking_error_floor_rms"),
    ):
        if name in m:
            # a lag is a part of the tracking error, and known no worse
            rows.append((title, with_half_width(_number(m[name]), _number(m[half])) + " um"))
    if "cycle_time" in m:
        rows.append(("duration", f"{_number(m['cycle_time']):.5g} s"))
    rows += [(f"tracking error of {one.axis}", one.in_words()) for one in evaluation.rotary]
    judged = int(_number(m["judged_samples"]))
    rows.append(("samples judged", f"{judged} of {evaluation.log.n_samples}"))
    found = evaluation.alignment
    if found is not None:
        shift = ", ".join(f"{1e3 * v:.4f}" for v in found.shift)
        angle = math.degrees(found.angle)
        how = (
            f"shift {shift} mm, rotation {angle:.5g}°"
            if found.fitted
            else "not aligned, as it stands"
        )
        rows.append(("log laid on the part", how))
        rows.append(("commands from the part, median", f"{to_um(found.median)} um"))
    return rows


def column_rows(evaluation: Evaluation) -> list[tuple[str, str, str, str]]:
    """Return what each column of the log was taken for: role, column, unit, how it is known.

    Parameters
    ----------
    evaluation
        The evaluation.
    """
    rows = []
    for use in evaluation.log.columns:
        column = "stated" if use.column_stated else "guessed by its name"
        unit = "stated" if use.unit_stated else "guessed"
        if not use.unit:
            unit = "not known"
        rows.append(
            (
                f"{use.role} {use.axis}".strip(),
                use.column,
                use.unit or "-",
                f"{column}; unit {unit}",
            )
        )
    if not evaluation.log.timed:
        rows.append(("time", "-", "samples", "not in the log"))
    elif not any(use.role == "time" for use in evaluation.log.columns):
        rows.append(
            ("time", "-", "s", f"sample time {1e3 * evaluation.log.sample_time:.6g} ms, stated")
        )
    return rows


def cause_figures(cause: Cause) -> str:
    """Return the parameters of a cause as text.

    Parameters
    ----------
    cause
        The cause.
    """
    shown = []
    for name, (value, unit) in cause.parameters.items():
        scale, said = _UNITS.get(unit, (1.0, unit))
        if name == "period":
            scale, said = 1e3, "mm"
        shown.append(f"{name} {value * scale:.4g} {said}")
    return ", ".join(shown)


def evaluation_tables(evaluation: Evaluation) -> list[Table]:
    """Return the tables for the terminal: columns, figures, causes, worst places, circle.

    Parameters
    ----------
    evaluation
        The evaluation.
    """
    tables = [
        _table("Columns", ("what", "column", "unit", "known"), column_rows(evaluation)),
        _table("Figures", ("figure", "value"), figure_rows(evaluation)),
    ]
    if evaluation.causes:
        rows = []
        for c in evaluation.causes:
            figures = math.isfinite(c.rms)
            rows.append((
                c.name, to_um(c.rms) if figures else "-", to_um(c.max) if figures else "-",
                f"{100 * c.share:.1f}" if figures else "-",
                c.state if c.state != "found" else cause_figures(c),
            ))  # fmt: skip
        tables.append(
            _table("Where the contour error comes from",
                   ("cause", "rms [um]", "max [um]", "share [%]", "figures"), rows)
        )  # fmt: skip
    worst = [
        (with_half_width(abs(w.error), w.half_width), f"{w.time:.5g}", w.where, w.cause)
        for w in evaluation.worst[:5]
    ]
    unit = "s" if evaluation.log.timed else "sample"
    tables.append(
        _table("Worst places", ("error [um]", f"time [{unit}]", "where", "mostly"), worst)
    )
    if evaluation.circular is not None:
        tables.append(
            _table("Circular test, ISO 230-4", ("figure", "value"), circle_rows(evaluation))
        )
    return tables


def circle_rows(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the figures of the circular test as text with units; empty without one.

    Parameters
    ----------
    evaluation
        The evaluation.
    """
    test = evaluation.circular
    if test is None:
        return []
    one_of, two_of = test.half_width, 2.0 * test.half_width
    rows = [
        ("nominal radius" if test.nominal_known else "fitted radius", f"{1e3 * test.radius:.5g} mm")
    ]
    for one in test.directions:
        feed = f" at {6e4 * one.feed:.4g} mm/min" if math.isfinite(one.feed) else ""
        offset = ", ".join(to_um(v) for v in one.centre_offset)
        rows += [
            (
                f"circular deviation G, {one.name}{feed}",
                f"{with_half_width(one.deviation, two_of)} um",
            ),
            (
                f"radial deviation F, {one.name}",
                f"{to_um(one.radial_min)} to {to_um(one.radial_max)} um"
                + (f", each ± {to_um(one_of)} um" if one_of > 0.0 else ""),
            ),
            (f"centre offset, {one.name}", f"{offset} um"),
        ]
    if test.bidirectional is not None:
        both = with_half_width(test.bidirectional, two_of)
        rows.append(("bidirectional circular deviation G(b)", f"{both} um"))
    if test.mean_radial is not None:
        rows.append(("mean bidirectional radial deviation D", f"{to_um(test.mean_radial)} um"))
    return rows


def _table(title: str, heads: tuple[str, ...], rows: Any) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD,
                  pad_edge=False, collapse_padding=True)  # fmt: skip
    for k, head in enumerate(heads):
        table.add_column(
            Text(head), overflow="fold", justify="right" if "[" in head and k else "left"
        )
    for row in rows:
        table.add_row(*(Text(ascii_text(cell)) for cell in row))
    return table


def evaluation_json(evaluation: Evaluation, report: str | FilePath | None) -> dict[str, Any]:
    """Return an evaluation for JSON, SI.

    Parameters
    ----------
    evaluation
        The evaluation.
    report
        The report that was written, if one was.
    """
    log, found, test = evaluation.log, evaluation.alignment, evaluation.circular
    return {
        "schema": "contourlab.evaluate/1",
        "log": log.source,
        "format": log.format,
        "metrics": {
            name: value if isinstance(value, list) else (value if math.isfinite(value) else None)
            for name, value in evaluation.metrics.items()
        },
        "warnings": list(evaluation.warnings),
        "causes": [cause.json() for cause in evaluation.causes],
        "worst": [
            {
                "time": w.time, "error": w.error, "half_width": w.half_width,
                "position": list(w.position), "where": w.where, "cause": w.cause,
            }
            for w in evaluation.worst
        ],
        "columns": [
            {
                "role": use.role, "axis": use.axis, "column": use.column, "unit": use.unit,
                "column_stated": use.column_stated, "unit_stated": use.unit_stated,
            }
            for use in log.columns
        ],
        "alignment": None if found is None else {
            "fitted": found.fitted, "shift": found.shift.tolist(),
            "rotation": found.rotation.tolist(), "angle": found.angle,
            "distance_median": found.median, "distance_rms": found.rms,
            "distance_max": found.largest, "on_part": found.on_part, "covered": found.covered,
        },
        "rotary": [one.json() for one in evaluation.rotary],
        "circular_test": None if test is None else test.json(),
        "report": None if report is None else str(report),
    }  # fmt: skip
