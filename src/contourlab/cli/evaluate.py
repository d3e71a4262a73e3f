"""The command ``evaluate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import AsJson, Force, optional
from contourlab.cli.printing import print_json, say

__all__ = ["evaluate"]


def evaluate(
    log: Annotated[
        Path,
        typer.Argument(
            help="Measured log: CSV, halsampler, halscope, MAT, HDF5, MDF or a recording.",
            show_default=False,
        ),
    ],
    commanded: Annotated[
        str | None, optional("Columns of the commanded positions, with commas.")
    ] = None,
    actual: Annotated[str | None, optional("Columns of the actual positions, with commas.")] = None,
    command: Annotated[str | None, optional("Columns of what the drives were told.")] = None,
    time: Annotated[str | None, optional("Column of time.")] = None,
    axes: Annotated[str | None, optional("Names of the axes, such as XY.")] = None,
    unit: Annotated[
        str | None, optional("Of the positions: mm, m, um, or 0.1 um for counts.")
    ] = None,
    time_unit: Annotated[str | None, optional("Of the column of time.")] = None,
    sample_time: Annotated[str | None, optional("Between samples, such as 1 ms.")] = None,
    contour: Annotated[
        Path | None, optional("Part file to judge against; else the path through the commands.")
    ] = None,
    align: Annotated[
        bool, typer.Option("--align/--no-align", help="Lay the log on the part.")
    ] = True,
    path: Annotated[
        str, typer.Option(help="Between commanded positions: polyline or spline.")
    ] = "polyline",
    tolerance: Annotated[
        str | None, optional("Of the spline from the commanded positions.")
    ] = None,
    measured: Annotated[
        str | None, optional("Where the actual position was measured: motor, scale or tool.")
    ] = None,
    pitch: Annotated[str | None, optional("Of the screws; looked for if not given.")] = None,
    circular: Annotated[
        bool, typer.Option("--circular/--no-circular", help="Look for a circular test.")
    ] = True,
    delimiter: Annotated[str | None, optional("Between columns of a text.")] = None,
    decimal: Annotated[str | None, optional("Decimal sign of a text.")] = None,
    header: Annotated[
        bool | None, optional("Whether a text names its columns.", "--header/--no-header")
    ] = None,
    comment: Annotated[str | None, optional("With what comments of a text begin.")] = None,
    output: Annotated[Path | None, optional("Folder for report and judged recording.")] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Judge a measured log by its contour error, and tell where that comes from."""
    from contourlab.cli.output import EVALUATION_FILES, refuse_files, write_evaluated
    from contourlab.evaluation import evaluate as judge
    from contourlab.reports import evaluation_json, evaluation_tables

    if output is not None:
        refuse_files(output, EVALUATION_FILES, force=force)
    keep_compiled()
    result = judge(
        log, contour=contour, align_part=align, path=path, tolerance=tolerance, measured=measured,
        pitch=pitch, circular=circular, commanded=commanded, actual=actual, command=command,
        time=time, axes=axes, unit=unit, time_unit=time_unit, sample_time=sample_time,
        delimiter=delimiter, decimal=decimal, header=header, comment=comment,
    )  # fmt: skip
    report = None if output is None else write_evaluated(result, output, force=force)
    if as_json:
        print_json(evaluation_json(result, report))
        return
    from rich.console import Console

    console = Console()
    for table in evaluation_tables(result):
        console.print(table)
    for cause in result.causes:
        if cause.remedy and cause.state == "found":
            typer.echo(f"{cause.name}: {cause.remedy}")
    say(result.warnings)
    if report is not None:
        typer.echo(f"report: {report}")
    else:
        typer.echo("add --output FOLDER for the report and the judged recording")
