"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

__all__ = [
    "AsJson",
    "ControllerName",
    "EngineName",
    "Force",
    "MachineName",
    "PartFile",
    "ScenarioFile",
    "optional",
]


def optional(text: str, *names: str) -> Any:
    """Return an option that may be left out, whose help does not say so.

    Parameters
    ----------
    text
        Its help.
    *names
        Such as ``--part``; from the parameter's name if left out.
    """
    return typer.Option(*names, help=text, show_default=False)


ScenarioFile = Annotated[Path, typer.Argument(help="Scenario, a TOML file.", show_default=False)]
PartFile = Annotated[
    Path | None, optional("Part program in place of the scenario's own.", "--part")
]
EngineName = Annotated[
    str | None, optional("What computes the loop: jax, or c (compiled here).", "--engine")
]
ControllerName = Annotated[str | None, optional("Which controller, if there are several.")]
MachineName = Annotated[str | None, optional("On which machine, if there are several.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that exist.")]
