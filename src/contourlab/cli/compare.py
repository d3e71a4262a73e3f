"""The command ``compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import AsJson, EngineName, Force, PartFile, ScenarioFile, optional
from contourlab.cli.printing import print_json, say

__all__ = ["compare"]


def compare(
    scenario: ScenarioFile,
    output: Annotated[Path | None, optional("Folder for report, figures and recordings.")] = None,
    part: PartFile = None,
    engine: EngineName = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Run every controller of a scenario on the same part, on every machine of it."""
    from contourlab.cli.output import comparison_files, refuse_files, write_comparison
    from contourlab.cli.progress import RunProgress
    from contourlab.reports import (
        comparison_json,
        print_table,
        spread_table,
    )
    from contourlab.scenarios import read_scenario

    keep_compiled()
    ready = read_scenario(scenario, part=part)
    if output is not None:
        names = comparison_files(
            ready.runs, vary=ready.variation is not None, planned=ready.planned
        )
        refuse_files(output, names, force=force)
    with RunProgress(quiet=as_json) as progress:
        result = ready.compare(progress.update, engine=engine)
    report = None
    if output is not None:
        report = write_comparison(result, output, ready.magnification, force=force)
    if as_json:
        print_json(comparison_json(result, report))
        return
    from rich.console import Console

    console = Console()
    print_table(console, result)
    spread = spread_table(result)
    if spread is not None:
        console.print(spread)
    common = dict.fromkeys(w for said in result.reference_warnings.values() for w in said)
    say(common)
    for name, recording in result.recordings.items():
        own = [w for w in recording.warnings if w not in common]
        say([f"{name}: {warning}" for warning in own])
    if report is not None:
        typer.echo(f"report: {report}")
    else:
        typer.echo("add --output FOLDER for the report, figures and recordings")
