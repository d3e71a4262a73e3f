"""The command ``identify``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import AsJson, Force, optional
from contourlab.cli.printing import print_json, say

__all__ = ["identify"]


def identify(
    logs: Annotated[
        list[Path], typer.Argument(help="Log, or several in order of time.", show_default=False)
    ],
    actual: Annotated[str | None, optional("Columns of measured positions, with commas.")] = None,
    command: Annotated[
        str | None,
        optional("Columns of what the drives were told; the commanded positions if left out."),
    ] = None,
    commanded: Annotated[
        str | None, optional("Columns of commanded positions, with commas.")
    ] = None,
    kind: Annotated[
        str | None, optional("Of the command: voltage, force, velocity or position.")
    ] = None,
    unit: Annotated[str | None, optional("Of the positions, such as mm.")] = None,
    command_unit: Annotated[str | None, optional("Of the command.")] = None,
    time: Annotated[str | None, optional("Column of time.")] = None,
    sample_time: Annotated[str | None, optional('Such as "1 ms".')] = None,
    axes: Annotated[str | None, optional("Names of the axes, such as XY.")] = None,
    known: Annotated[str | None, optional('Known parameters: "viscous=25,delay=1 ms".')] = None,
    spring: Annotated[
        str, typer.Option(help="Whether a spring holds the axes: auto, yes or no.")
    ] = "auto",
    drive_lag: Annotated[
        bool, typer.Option("--drive-lag", help="Look for a lag of the drives too.")
    ] = False,
    sweep: Annotated[
        str, typer.Option(help="Whether the record is a sweep: auto, yes or no.")
    ] = "auto",
    window: Annotated[str | None, optional('Part of the record: "1 s,5 s".')] = None,
    track: Annotated[
        str | None, optional('Parameters over time: window of one long record, such as "10 s".')
    ] = None,
    false_alarms: Annotated[
        float, typer.Option(help="Chance of any false alarm over several records, 0.0005 at least.")
    ] = 0.01,
    baseline: Annotated[
        int | None,
        typer.Option(
            help="Records that the others are compared with: three, or all but the last of fewer.",
            show_default=False,
        ),
    ] = None,
    confidence: Annotated[float, typer.Option(help="Of the intervals.")] = 0.95,
    output: Annotated[Path | None, optional("Machine file to write, for compare.")] = None,
    report: Annotated[Path | None, optional("HTML page to write.")] = None,
    suggest: Annotated[
        Path | None,
        optional("CSV to write: a motion that tells everything, within what the log reached."),
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Find masses, friction, stiffness and delay from a log of positions and commands."""
    from contourlab.cli.identify_inputs import known_values, log_recording, numbers_of_window
    from contourlab.cli.identify_run import Identified, identify_records, refuse_unknown
    from contourlab.recordings.files import refuse_existing
    from contourlab.units import parse_quantity

    for name, value in (("spring", spring), ("sweep", sweep)):
        refuse_unknown(name, value)
    keep_compiled()
    for file in (output, report, suggest):
        if file is not None:
            refuse_existing(file, force=force)
    span = numbers_of_window(window)
    step = None if track is None else parse_quantity(track, "time")
    options: dict[str, Any] = {
        "known": known_values(known), "drive_lag": drive_lag, "confidence": confidence,
        "stiffness": {"auto": None, "yes": True, "no": False}[spring],
    }  # fmt: skip
    read = [
        log_recording(
            file, kind=kind, actual=actual, command=command, commanded=commanded, unit=unit,
            command_unit=command_unit, time=time, sample_time=sample_time, axes=axes,
        )
        for file in logs
    ]  # fmt: skip
    found: Identified = identify_records(
        read, [str(file) for file in logs], options, window=span, track=step, sweep=sweep,
        rate=false_alarms, baseline=baseline,
    )  # fmt: skip
    found.write(output, report, suggest, force=force)
    if as_json:
        print_json(found.json(output, report, suggest))
        return
    found.show()
    say(found.warnings)
    for what, file in (("machine", output), ("report", report), ("motion", suggest)):
        if file is not None:
            typer.echo(f"{what}: {file}")
    if output is None:
        typer.echo("add --output machine.toml for a machine that compare takes")
