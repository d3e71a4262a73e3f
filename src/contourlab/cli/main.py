"""The program ``contourlab``: its commands, its exit statuses, its messages.

Exit status 0 on success; 2 on the user's mistake, with one sentence on standard error and nothing
written; 1 on a failure of ours; 130 when interrupted. Nothing heavy is imported before a command
needs it.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import Annotated, NoReturn

import typer

import contourlab
from contourlab.cli.compare import compare
from contourlab.cli.estimate_accuracy import estimate_accuracy
from contourlab.cli.evaluate import evaluate
from contourlab.cli.export import export
from contourlab.cli.identify import identify
from contourlab.cli.reproduce import reproduce
from contourlab.cli.simulate import simulate
from contourlab.errors import ContourlabError

__all__ = ["app", "main"]

INTERRUPTED = 130
"""Exit status after an interrupt."""

app = typer.Typer(
    name="contourlab",
    help="Contouring control: designed, judged by the exact contour error, shipped to real time.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(value: bool) -> bool:
    if value:
        typer.echo(f"contourlab {contourlab.__version__}")
        raise typer.Exit
    return value


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    del version


app.command()(compare)
app.command()(simulate)
app.command("estimate-accuracy")(estimate_accuracy)
app.command()(evaluate)
app.command()(reproduce)
app.command()(export)
app.command()(identify)


def _fail(message: str, status: int) -> NoReturn:
    typer.secho(f"error: {message}", err=True, fg="red")
    sys.exit(status)


def _interrupted() -> NoReturn:
    """Leave at once: files are closed by now, and JAX may still compute in threads.

    Taking the interpreter down under these can crash it, and take the exit status away.
    """
    typer.secho("error: interrupted; nothing half-written is left", err=True, fg="red")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(INTERRUPTED)


def main() -> None:
    """Run the program and exit with its status."""
    try:
        try:
            app()
        finally:  # leaving: a second interrupt would take the message and the status away
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except ContourlabError as error:
        _fail(str(error), 2)
    except KeyboardInterrupt:
        _interrupted()
    except SystemExit as leaving:
        if leaving.code == INTERRUPTED:
            _interrupted()
        raise
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except Exception:  # noqa: BLE001  (the last line of defence: say that it is our failure)
        import traceback

        traceback.print_exc()
        _fail("this is a defect of contourlab, not of your input; please report the lines above", 1)
