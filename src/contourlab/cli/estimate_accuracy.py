"""The command ``estimate-accuracy``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import AsJson, Force, optional
from contourlab.cli.printing import print_json, say

__all__ = ["estimate_accuracy"]


def estimate_accuracy(
    contours: Annotated[
        str | None, optional("Names, with commas; four of the papers' by default.")
    ] = None,
    part: Annotated[
        Path | None,
        optional(
            "Part program, points or drawing to judge on, in place of or beside named contours."
        ),
    ] = None,
    axes: Annotated[
        str | None, optional("Coordinates of the part, such as XY; XYZ of a program by default.")
    ] = None,
    estimators: Annotated[str | None, optional("Names, with commas; all by default.")] = None,
    lag: Annotated[
        str, typer.Option(help="Of the actual point behind the reference.")
    ] = "0.1 mm,0.2 mm,0.5 mm,1 mm,2 mm",
    offset: Annotated[str, typer.Option(help="Of the actual point beside the contour.")] = "10 um",
    feed: Annotated[str, typer.Option(help="Along the contour.")] = "3000 mm/min",
    resolution: Annotated[str, typer.Option(help="Of the encoders; 0 um is exact.")] = "0 um",
    sample_time: Annotated[str, typer.Option(help="Of estimators with a state.")] = "1 ms",
    start_up: Annotated[
        str, typer.Option(help="How long one with a state runs before it is judged.")
    ] = "0.1 s",
    points: Annotated[int, typer.Option(help="Places on each contour.")] = 200,
    output: Annotated[Path | None, optional("Folder for JSON, CSV and figure.")] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Judge contour error estimators by the exact foot point, over lag and curvature."""
    from contourlab.cli.output import accuracy_contours, refuse_files
    from contourlab.cli.progress import RunProgress
    from contourlab.contour_errors import estimate_accuracy as study_accuracy
    from contourlab.reports import (
        ACCURACY_FILES,
        accuracy_json,
        accuracy_notes,
        accuracy_tables,
        write_accuracy,
    )

    keep_compiled()
    if output is not None:
        refuse_files(output, ACCURACY_FILES, force=force)
    with RunProgress(quiet=as_json) as progress:
        study = study_accuracy(
            accuracy_contours(contours, part, axes),
            None if estimators is None else estimators.split(","),
            lag=lag, offset=offset, feed=feed, resolution=resolution, sample_time=sample_time,
            start_up=start_up, points=points, progress=progress.update,
        )  # fmt: skip
    files = None if output is None else write_accuracy(study, output, force=force)
    if as_json:
        print_json(accuracy_json(study, files))
        return
    from rich.console import Console

    console = Console()
    for table in accuracy_tables(study):
        console.print(table)
    say(accuracy_notes(study), "note")
    for file in files or ():
        typer.echo(f"written: {file}")
