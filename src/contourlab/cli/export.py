"""The command ``export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from contourlab.cli.compile_cache import keep_compiled
from contourlab.cli.options import (
    AsJson,
    ControllerName,
    Force,
    MachineName,
    ScenarioFile,
    optional,
)
from contourlab.cli.printing import print_json, say
from contourlab.errors import ConfigurationError

__all__ = ["export"]


def export(
    scenario: ScenarioFile,
    output: Annotated[Path, typer.Option(help="Folder or file to write, as the target has it.")],
    controller: ControllerName = None,
    machine: MachineName = None,
    target: Annotated[
        str,
        typer.Option(
            help="c: C99 with golden data and a Makefile; linuxcnc: a HAL component; fmu: a "
            "functional mock-up unit."
        ),
    ] = "c",
    precision: Annotated[str, typer.Option(help="Of reals: double or single.")] = "double",
    prefix: Annotated[
        str | None, optional("Of every name in C; from the controller's name.")
    ] = None,
    steps: Annotated[
        int, typer.Option(min=1, help="Of the loop that are kept as golden data, at most.")
    ] = 2000,
    license_line: Annotated[
        str | None, optional("linuxcnc: licence of the component, such as GPL.", "--license")
    ] = None,
    joints: Annotated[str | None, optional("linuxcnc: joint of each axis, such as 0,1.")] = None,
    length_unit: Annotated[str | None, optional("linuxcnc: LINEAR_UNITS, mm or inch.")] = None,
    command_limit: Annotated[
        str | None, optional("linuxcnc: limit of the commands, one number or one per axis, in SI.")
    ] = None,
    following_error_limit: Annotated[
        str | None, optional('linuxcnc: following error that trips, such as "1 mm".')
    ] = None,
    fmi: Annotated[int | None, optional("fmu: version of the standard, 2 or 3.")] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Write a controller of a scenario for real time, and compare it with what was simulated."""
    from contourlab.export import export as write
    from contourlab.export.c_target import parity_json
    from contourlab.scenarios import read_scenario
    from contourlab.units import parse_quantity

    keep_compiled()
    given: dict[str, Any] = {
        "license": license_line,
        "joints": None if joints is None else _numbers("--joints", joints, int),
        "length_unit": length_unit,
        "command_limit": None if command_limit is None else _numbers(
            "--command-limit", command_limit, float
        ),
        "following_error_limit": None if following_error_limit is None else parse_quantity(
            following_error_limit, "length", "--following-error-limit"
        ),
        "fmi": fmi,
    }  # fmt: skip
    result = write(
        read_scenario(scenario), controller=controller, machine=machine, output=output,
        target=target, precision=precision, prefix=prefix, force=force, steps=steps,
        **{name: value for name, value in given.items() if value is not None},
    )  # fmt: skip
    if as_json:
        parity = None if result.parity is None else parity_json(result.parity)
        print_json({
            "schema": "contourlab.export/1", "target": result.target, "output": str(result.output),
            "files": list(result.files), "parity": parity, "warnings": list(result.warnings),
        })  # fmt: skip
        return
    whole = not result.output.is_dir()
    for file in [result.output] if whole else [result.output / name for name in result.files]:
        typer.echo(f"written: {file}")
    if result.parity is not None:
        typer.echo(
            f"{result.parity.steps} steps replayed: {result.parity.relative:.3g} of the peak "
            f"command at the most (bound {result.parity.bound.relative:.3g})"
        )
    say(result.warnings)


def _numbers(option: str, text: str, kind: Any) -> Any:
    """Return numbers with commas; one alone as a number."""
    try:
        found = [kind(word) for word in text.split(",")]
    except ValueError:
        raise ConfigurationError(f"{option} must be numbers with commas, got {text!r}") from None
    return found[0] if len(found) == 1 and kind is float else found
