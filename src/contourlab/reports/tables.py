"""A comparison for the terminal and for programs."""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from contourlab.reports.corner_table import corner_json
from contourlab.reports.spread_table import (
    SPREAD_METRICS,
    spread_json,
    spread_rows,
    variation_json,
)
from contourlab.reports.wording import NONE, Cell, Column, table_columns

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from contourlab.recordings.metrics import MetricValue
    from contourlab.recordings.recording import Recording
    from contourlab.simulation.comparison import Comparison

WHOLE_NAME = 30
"""Names up to this length are not broken over lines of the spread, which is narrow."""
LEAST_NAME = 6
"""Columns to which names and statuses may shrink before a table gets wider than the terminal."""
TERMINAL_SPREADS = 2
"""So many metrics of the spread have room in 80 columns."""

__all__ = [
    "ascii_text",
    "comparison_json",
    "comparison_table",
    "print_table",
    "run_json",
    "spread_table",
]


def comparison_table(comparison: Comparison, *, width: int = 80) -> Table:
    """Return the errors as a table for the terminal, in µm; the report has the other figures.

    A law that was refused or failed has no figures; why is for :func:`print_table` to say. The best
    value of a column is bold and carries a star. Its words are ASCII, and its lines where
    the terminal asks for it: a log file or an old terminal can hold it. Times stand in it where
    they tell the controllers apart.

    Parameters
    ----------
    comparison
        With one recording or more.
    width
        Columns of the terminal: where they are few statuses break over lines, then names, and
        numbers never; the table may then be wider.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    title = Text(ascii_text(comparison.title), style="bold") if comparison.title else None
    star = "* best of its column; " if len(comparison.recordings) > 1 else ""
    caption = f"{star}every figure is in the report and in --json"
    table = Table(title=title, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD,
                  caption=Text(caption),
                  pad_edge=False, collapse_padding=True)  # fmt: skip
    columns = [column for column in table_columns(comparison) if _in_terminal(column)]
    statuses = {name: _short_status(comparison, name) for name in comparison.rows}
    pairs = [comparison.pair(name) for name in statuses]
    short = all(len(status) <= len("normal") for status in statuses.values())
    told = not (comparison.several and short)  # names of machines take the room
    table.add_column("controller", overflow="fold")
    for column in columns:
        words = (*column.group.split(), column.name, f"[{column.unit}]")
        head = Text("\n".join(ascii_text(word) for word in words))
        widest = max(*map(len, words), *(len(_cell(cell)) for cell in column.cells))
        table.add_column(head, justify="right", no_wrap=True, min_width=widest)
    if told:
        table.add_column("status", overflow="fold")
    room = width - 1 - 2 * len(table.columns) - sum(c.min_width or 0 for c in table.columns)
    longest = max(len(ascii_text(name)) for _, name in pairs)
    if told:
        needed = max(len(status) for status in statuses.values())
        left = max(min(needed, room - longest), LEAST_NAME)
        table.columns[-1].width = left
        room -= left
    table.columns[0].width = min(max(longest, len("controller")), max(room, LEAST_NAME))
    places = {name: place for place, name in enumerate(comparison.recordings)}
    for row, (run, status) in enumerate(statuses.items()):
        machine, name = pairs[row]
        if comparison.several and (row == 0 or machine != pairs[row - 1][0]):
            if row:
                table.add_section()
            table.add_row(Text(f"on {ascii_text(machine)}", style="italic"))
        none = Text("-") if run in comparison.refusals else None
        cells = [none or _cell(column.cells[places[run]]) for column in columns]
        lost = none or comparison.recordings[run].diverged
        last = Text(status, style="bold red" if lost else "")
        table.add_row(Text(ascii_text(name)), *cells, *([last] if told else []))
    return table


def _short_status(comparison: Comparison, name: str) -> str:
    """Return a status without the reason of a refusal, which has no room in a table."""
    status = comparison.status(name)
    return ascii_text(status.partition(":")[0] if name in comparison.refusals else status)


def print_table(console: Console, comparison: Comparison) -> None:
    """Print a comparison, wider than the terminal rather than with numbers cut.

    Below it stands why laws were refused, or failed.

    Parameters
    ----------
    console
        Where.
    comparison
        With one recording or more.
    """
    from rich.text import Text

    terminal = console.width
    table = comparison_table(comparison, width=terminal)
    taken = sum((column.width or column.min_width or 0) + 2 for column in table.columns)
    console.width = max(terminal, taken + 1)
    console.print(table)
    console.width = terminal
    for name, refusal in comparison.refusals.items():
        console.print(Text(ascii_text(f"{name} {refusal.status}")), soft_wrap=True)


def spread_table(comparison: Comparison) -> Table | None:
    """Return the spread under variation as a table for the terminal, in µm; None if none varied.

    Parameters
    ----------
    comparison
        With one recording or more.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    rows = spread_rows(comparison)
    if not rows:
        return None
    title = Text(f"{rows[0].n_samples} samples: median [5 % .. 95 %] in um", style="bold")
    shown = [entry for row in rows for entry in row.entries[:TERMINAL_SPREADS]]
    star = "* least 95 % value; " if any(entry.best for entry in shown) else ""
    table = Table(title=title, title_justify="left", caption_justify="left", box=box.SIMPLE_HEAD,
                  caption=Text(f"{star}a sample that diverged counts as infinitely bad"),
                  pad_edge=False, collapse_padding=True)  # fmt: skip
    longest = max(len(ascii_text(comparison.pair(row.name)[1])) for row in rows)
    table.add_column("controller", overflow="fold", no_wrap=longest <= WHOLE_NAME)
    for _, head in SPREAD_METRICS[:TERMINAL_SPREADS]:
        table.add_column("\n".join(head.split(", ")), justify="right", no_wrap=True)
    table.add_column("diverged", justify="right", no_wrap=True)
    before = None
    for row in rows:
        machine, controller = comparison.pair(row.name)
        if comparison.several and machine != before:
            if before is not None:
                table.add_section()
            table.add_row(Text(f"on {ascii_text(machine)}", style="italic"))
        before = machine
        cells = [
            Text(("* " if entry.best else "") + ascii_text(entry.short.replace("…", "..")
                 .replace(NONE, "-")), style="bold" if entry.best else "")
            for entry in row.entries[:TERMINAL_SPREADS]
        ]  # fmt: skip
        table.add_row(Text(ascii_text(controller)), *cells, Text(str(row.n_diverged)))
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


def ascii_text(text: str, *, keep: str = "") -> str:
    """Return text as printable ASCII, so that names from a file cannot steer the terminal.

    Parameters
    ----------
    text
        Any.
    keep
        Characters that are left as they are.
    """
    for sign, word in (("µ", "u"), ("±", "+-"), ("°", " deg")):
        text = text.replace(sign, word)
    plain = text.encode("ascii", "backslashreplace").decode("ascii")
    return "".join(c if c.isprintable() or c in keep else "?" for c in plain)


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
        ``schema``, ``runs`` (see :func:`run_json`; each with its ``machine``, and where there are
        such, ``spread`` and ``corners``), ``report``; ``vary`` if something varied. The run of a
        law that was refused or failed has the metrics of the others, all null, and says why in its
        ``status``.
    """
    runs: list[dict[str, Any]] = []
    names = dict.fromkeys(n for one in comparison.recordings.values() for n in one.metrics)
    for name in comparison.rows:
        machine, controller = comparison.pair(name)
        if name in comparison.refusals:
            runs.append({
                "machine": machine, "controller": controller, "metrics": dict.fromkeys(names),
                "status": comparison.status(name), "warnings": [],
            })  # fmt: skip
            continue
        run = {"machine": machine, **_run(controller, comparison.recordings[name])}
        if name in comparison.spread:
            run["spread"] = spread_json(comparison.spread[name])
        corners = corner_json(comparison, name)
        if corners is not None:
            run["corners"] = corners
        runs.append(run)
    result: dict[str, Any] = {
        "schema": "contourlab.compare/1",
        "runs": runs,
        "report": None if report is None else str(report),
    }
    if comparison.variation is not None:
        result["vary"] = variation_json(comparison.variation)
    return result


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
