"""What commands print: JSON on standard output, warnings on standard error."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import typer

__all__ = ["print_json", "say"]


def print_json(value: dict[str, Any]) -> None:
    """Print one JSON object on one line.

    Parameters
    ----------
    value
        Of finite numbers, texts, lists, dicts and None.
    """
    typer.echo(json.dumps(value, allow_nan=False, ensure_ascii=False))


def say(sentences: Iterable[str], what: str = "warning") -> None:
    """Print sentences on standard error, each on a line of its own.

    Parameters
    ----------
    sentences
        Of any number.
    what
        What stands before each.
    """
    for sentence in sentences:
        typer.secho(f"{what}: {sentence}", err=True, fg="yellow")
