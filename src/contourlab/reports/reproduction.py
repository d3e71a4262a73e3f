"""A paper's published figures beside what was found: as a table, JSON and PNG figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import OutputError

if TYPE_CHECKING:
    from rich.table import Table

__all__ = [
    "VERDICTS",
    "PaperFigure",
    "PaperRow",
    "Reproduction",
    "reproduction_json",
    "reproduction_notes",
    "reproduction_table",
    "write_paper_figures",
]

VERDICTS = ("matched", "relation", "differs")


@dataclass(frozen=True, kw_only=True)
class PaperRow:
    """One published figure, or one claim, and what became of it."""

    experiment: str
    case: str
    controller: str
    """In snake case; "" for a claim about several."""
    quantity: str
    unit: str
    published: float | None
    """None where the paper prints no number."""
    reproduced: float
    verdict: str
    """``matched`` within the tolerance that the note states; ``relation``: an order or a ratio
    that holds; ``differs``, with the reason in the note."""
    note: str

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise ValueError(f"verdict must be one of {', '.join(VERDICTS)}, got {self.verdict!r}")


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperFigure:
    """Curves over time or a length, as in one of the paper's figures."""

    name: str
    """Of the file, without its ending."""
    title: str
    y_label: str
    time: NDArray[Any]
    """[s]."""
    curves: tuple[tuple[str, NDArray[Any]], ...]
    """Name and values of each."""
    x_label: str = "time [s]"
    """What ``time`` really is, where it is something else."""
    log_y: bool = False
    """Whether sizes are drawn on a logarithmic scale, for curves that differ by powers of ten."""
    log_x: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Reproduction:
    """What a paper says and what was found."""

    paper: str
    """Its slug."""
    title: str
    rows: tuple[PaperRow, ...]
    figures: tuple[PaperFigure, ...] = ()
    assumed: tuple[str, ...] = ()
    """What the experiments rest on that the paper does not say, in sentences."""


def reproduction_json(reproduction: Reproduction) -> dict[str, Any]:
    """Return a reproduction as a JSON object, without ``schema``.

    Parameters
    ----------
    reproduction
        Of one paper.
    """
    return {
        "paper": reproduction.paper,
        "rows": [
            {
                name: getattr(row, name)
                for name in (
                    "experiment", "case", "controller", "quantity", "unit", "published",
                    "reproduced", "verdict", "note",
                )
            }
            for row in reproduction.rows
        ],
        "assumed": list(reproduction.assumed),
    }  # fmt: skip


def reproduction_table(reproduction: Reproduction) -> Table:
    """Return the rows as a table for the terminal, with the numbers of their notes.

    Parameters
    ----------
    reproduction
        Of one paper.
    """
    from rich import box
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(reproduction.title, style="bold"), title_justify="left",
                  box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)  # fmt: skip
    table.add_column("", ratio=1, overflow="fold")
    for head in ("published", "reproduced", "unit"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    table.add_column("why", justify="right", no_wrap=True)
    rows, notes = reproduction.rows, reproduction_notes(reproduction)
    for k, row in enumerate(rows):
        before = rows[k - 1] if k else None
        if before is None or before.experiment != row.experiment:
            table.add_section()
            table.add_row(Text(row.experiment, style="bold"))
        if before is None or (before.experiment, before.case) != (row.experiment, row.case):
            table.add_row(Text(row.case, style="italic"))
        published = "-" if row.published is None else f"{row.published:.4g}"
        style = {"matched": "green", "relation": "", "differs": "red"}[row.verdict]
        table.add_row(
            Padding(Text(_what(row)), (0, 0, 0, 2)), published, f"{row.reproduced:.4g}", row.unit,
            Text(row.verdict, style=style),
            Text(f"[{notes.index(row.note) + 1}]"),  # Text: in a str, brackets are markup
        )  # fmt: skip
    return table


def _what(row: PaperRow) -> str:
    """Return controller and quantity in few words."""
    words = row.quantity.replace("contour_error_", "error ").replace("_", " ")
    who = row.controller.removesuffix("_task_frame").removesuffix("_contouring").replace("_", " ")
    return f"{who}: {words}" if who else words


def reproduction_notes(reproduction: Reproduction) -> list[str]:
    """Return the notes of the rows, each once, in the order in which rows need them.

    Parameters
    ----------
    reproduction
        Of one paper.
    """
    return list(dict.fromkeys(row.note for row in reproduction.rows))


def write_paper_figures(
    figures: Sequence[PaperFigure], folder: str | FilePath, *, force: bool = False
) -> list[FilePath]:
    """Write a paper's figures as PNG and return the files.

    Parameters
    ----------
    figures
        Of a reproduction.
    folder
        Where; made if it is missing.
    force
        Whether existing files may be replaced.

    Raises
    ------
    OutputError
        One of the files exists already (then none is written), or the folder cannot be used.
    """
    from contourlab.recordings.files import refuse_existing
    from contourlab.reports.canvas import INK, MUTED, bare, literal, new_figure, write_png
    from contourlab.reports.palette import look

    place = FilePath(folder)
    if place.exists() and not place.is_dir():
        raise OutputError(f"{place} is a file, not a folder")
    files = [place / f"{figure.name}.png" for figure in figures]
    for file in files:
        refuse_existing(file, force=force)
    for file, figure in zip(files, figures, strict=True):
        canvas = new_figure(9.0, 4.2)
        axes = canvas.add_subplot()
        bare(axes)
        # the largest first, so that the smaller stay in sight
        order = np.argsort([-float(np.max(np.abs(y))) for _, y in figure.curves])
        for k in order:
            name, values = figure.curves[int(k)]
            style = look(int(k))
            axes.plot(figure.time, values, color=style.light, ls=style.line_style, lw=1.2,
                      label=literal(name))  # fmt: skip
        axes.margins(x=0.0)
        if figure.log_y:
            axes.set_yscale("log")
        if figure.log_x:
            axes.set_xscale("log")
        axes.set_xlabel(literal(figure.x_label), color=MUTED)
        axes.set_ylabel(literal(figure.y_label), color=MUTED)
        axes.set_title(literal(figure.title), loc="left", fontsize=11, color=INK)
        canvas.legend(loc="outside lower left", frameon=False, ncols=2, labelcolor=INK)
        write_png(canvas, file, force=force)
    return files
