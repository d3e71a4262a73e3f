"""The command ``reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import AsJson, Force, optional
from contourlab.cli.printing import print_json

__all__ = ["reproduce"]


def reproduce(
    paper: Annotated[
        str | None, typer.Argument(help="Which paper; all there are if left out.")
    ] = None,
    figures: Annotated[Path | None, optional("Folder for figures like the paper's.")] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Run the experiments of a paper: published, reproduced, verdict and why."""
    from contourlab.cli.output import refuse_files
    from contourlab.cli.progress import RunProgress
    from contourlab.papers import paper_named, papers
    from contourlab.reports import (
        reproduction_json,
        reproduction_notes,
        reproduction_table,
        write_paper_figures,
    )

    keep_compiled()
    chosen = list(papers().values()) if paper is None else [paper_named(paper)]
    if figures is not None:
        names = [f"{name}.png" for one in chosen for name in one.figures]
        refuse_files(figures, names, force=force)
    with RunProgress(quiet=as_json) as progress:
        found = [one.run(progress.update) for one in chosen]
    files = []
    if figures is not None:
        every = [figure for one in found for figure in one.figures]
        files = write_paper_figures(every, figures, force=force)
    if as_json:
        bodies = [reproduction_json(one) for one in found]
        body = {"papers": bodies} if paper is None else bodies[0]
        print_json({"schema": "contourlab.reproduce/1", **body})
        return
    from rich.console import Console

    console = Console()
    for one in found:
        console.print(reproduction_table(one))
        for number, note in enumerate(reproduction_notes(one), 1):
            typer.echo(f"[{number}] {note}")
        for sentence in one.assumed:
            typer.echo(f"assumed: {sentence}")
    for file in files:
        typer.echo(f"figure: {file}")
