"""The command ``simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import (
    AsJson,
    ControllerName,
    EngineName,
    Force,
    MachineName,
    PartFile,
    ScenarioFile,
    optional,
)
from contourlab.cli.printing import print_json, say

__all__ = ["simulate"]


def simulate(
    scenario: ScenarioFile,
    controller: ControllerName = None,
    machine: MachineName = None,
    output: Annotated[Path | None, optional("Recording to write, .nc or .csv.")] = None,
    part: PartFile = None,
    engine: EngineName = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Run one controller of a scenario and give its recording and metrics."""
    from contourlab.cli.output import (
        choose_controller,
        choose_machine,
        refuse_recording,
        write_recording,
    )
    from contourlab.cli.progress import RunProgress
    from contourlab.reports import print_table, run_json
    from contourlab.scenarios import read_scenario
    from contourlab.simulation import Comparison
    from contourlab.simulation import simulate as run

    keep_compiled()
    ready = read_scenario(scenario, part=part)
    where = choose_machine(ready.setups, machine)
    setup = ready.setups[where]
    name = choose_controller(setup, controller)
    if output is not None:
        refuse_recording(output, force=force)
    with RunProgress(quiet=as_json) as progress:
        recording = run(
            setup.machine,
            setup.controllers[name],
            setup.reference,
            disturbances=ready.disturbances,
            seed=ready.seed,
            name=name,
            progress=lambda done: progress.update(name, done),
            engine=engine or ready.engine,
        )
    if output is not None:
        write_recording(recording, output, force=force)
    ignored = []
    if ready.variation is not None:
        ignored = ["[vary] is for compare; this run has the nominal values"]
    if as_json:
        result = run_json(recording)
        print_json({**result, "warnings": [*ignored, *result["warnings"]]})
        return
    from rich.console import Console

    alone = Comparison({name: recording}, setup.reference, setup.machine)
    print_table(Console(), alone)
    say([*ignored, *recording.warnings])
    if output is not None:
        typer.echo(f"recording: {output}")
