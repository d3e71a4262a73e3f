"""A comparison for the terminal and for programs."""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from contourlab.reports.wording import NONE, Cell, Column, table_columns

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from contourlab.recordings.metrics import MetricValue
    from contourlab.recordings.recording import Recording
    from contourlab.simulation.comparison import Comparison

WHOLE_NAME = 30
"""Names up to this length are not broken over lines."""

__all__ = ["comparison_json", "comparison_table", "run_json"]


def comparison_table(comparison: Comparison) -> Table:
    """Return the errors as a table for the terminal, in µm; the report has the other figures.

    The best value of a column is bold and carries a star. Its words are ASCII, and its lines where
    the terminal asks for it: a log file or an old terminal can hold it. Times stand in it where
    they tell the controllers apart.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    title = Text(_ascii(comparison.title), style="bold") if comparison.title else None
    star = "* best of its column; " if len(comparison.recordings) > 1 else ""
    caption = f"{star}every figure is in the report and in --json"
    table = Table(title=title, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD,
                  caption=Text(caption),
                  pad_edge=False, collapse_padding=True)  # fmt: skip
    columns = [column for column in table_columns(comparison) if _in_terminal(column)]
    longest = max(len(_ascii(name)) for name in comparison.recordings)
    table.add_column("controller", overflow="fold", no_wrap=longest <= WHOLE_NAME)
    for column in columns:
        words = (*column.group.split(), column.name, f"[{column.unit}]")
        head = Text("\n".join(_ascii(word) for word in words))
        table.add_column(head, justify="right", no_wrap=True)
    short = all(len(r.status) <= len("normal") for r in comparison.recordings.values())
    table.add_column("status", overflow="fold", no_wrap=short)
    for row, (name, recording) in enumerate(comparison.recordings.items()):
        cells = [_cell(column.cells[row]) for column in columns]
        status = Text(_ascii(recording.status), style="bold red" if recording.diverged else "")
        table.add_row(Text(_ascii(name)), *cells, status)
    return table


def _in_terminal(column: Column) -> bool:
    """Return whether a column is worth its place in 80: errors, and times that tell apart."""
    if column.group in ("contour error", "tracking error"):
        return True
    texts = {cell.text for cell in column.cells} - {NONE}
    if column.name == "at limit":
        return bool(texts - {"0"})
    return column.name == "cycle" and len(texts) > 1


def _cell(cell: Cell) -> Text:
    from rich.text import Text

    text = cell.text.replace(NONE, "-")
    return Text(f"* {text}", style="bold") if cell.best else Text(text)


def _ascii(text: str) -> str:
    """Return text as printable ASCII, so that names from a file cannot steer the terminal."""
    plain = text.replace("µ", "u").encode("ascii", "backslashreplace").decode("ascii")
    return "".join(c if c.isprintable() else "?" for c in plain)


def run_json(recording: Recording) -> dict[str, Any]:
    """Return one run as ``contourlab simulate --json`` prints it.

    Parameters
    ----------
    recording
        Of one controller.

    Returns
    -------
    dict
        ``schema``, ``controller``, ``metrics`` in SI (null where there is no finite value, a list
        per axis for vector metrics), ``status``, ``warnings``.
    """
    name = str(recording.dataset.attrs.get("controller", "log"))
    return {"schema": "contourlab.simulate/1", **_run(name, recording)}


def comparison_json(comparison: Comparison, report: str | FilePath | None = None) -> dict[str, Any]:
    """Return a comparison as ``contourlab compare --json`` prints it.

    Parameters
    ----------
    comparison
        With one recording or more.
    report
        Where the report was written, None if there is none.

    Returns
    -------
    dict
        ``schema``, ``runs`` (see :func:`run_json`), ``report``.
    """
    return {
        "schema": "contourlab.compare/1",
        "runs": [_run(name, recording) for name, recording in comparison.recordings.items()],
        "report": None if report is None else str(report),
    }


def _run(name: str, recording: Recording) -> dict[str, Any]:
    return {
        "controller": name,
        "metrics": {key: _plain(value) for key, value in recording.metrics.items()},
        "status": recording.status,
        "warnings": list(recording.warnings),
    }


def _plain(value: MetricValue) -> Any:
    if isinstance(value, list):
        return [_plain(single) for single in value]
    return float(value) if math.isfinite(value) else None
