"""The program ``contourlab``: its commands, its exit statuses, its messages.

Exit status 0 on success; 2 on the user's mistake, with one sentence on standard error and nothing
written; 1 on a failure of ours; 130 when interrupted. Nothing heavy is imported before a command
needs it.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

import contourlab
from contourlab.cli.identify import identify
from contourlab.errors import ConfigurationError, ContourlabError

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

ScenarioFile = Annotated[Path, typer.Argument(help="Scenario, a TOML file.", show_default=False)]
PartFile = Annotated[
    Path | None,
    typer.Option("--part", help="Part program in place of the scenario's own.", show_default=False),
]
EngineName = Annotated[
    str | None,
    typer.Option(
        "--engine", help="What computes the loop: jax, or c (compiled here).", show_default=False
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that exist.")]


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


@app.command()
def compare(
    scenario: ScenarioFile,
    output: Annotated[
        Path | None,
        typer.Option(help="Folder for report, figures and recordings.", show_default=False),
    ] = None,
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

    _prepare()
    ready = read_scenario(scenario, part=part)
    if output is not None:
        names = comparison_files(ready.runs, vary=ready.variation is not None)
        refuse_files(output, names, force=force)
    with RunProgress(quiet=as_json) as progress:
        result = ready.compare(progress.update, engine=engine)
    report = None
    if output is not None:
        report = write_comparison(result, output, ready.magnification, force=force)
    if as_json:
        _print_json(comparison_json(result, report))
        return
    from rich.console import Console

    console = Console()
    print_table(console, result)
    spread = spread_table(result)
    if spread is not None:
        console.print(spread)
    references = (result.reference, *result.references.values())
    common = dict.fromkeys(w for reference in references for w in reference.warnings)
    _say(common)
    for name, recording in result.recordings.items():
        own = [w for w in recording.warnings if w not in common]
        _say([f"{name}: {warning}" for warning in own])
    if report is not None:
        typer.echo(f"report: {report}")
    else:
        typer.echo("add --output FOLDER for the report, figures and recordings")


@app.command()
def simulate(
    scenario: ScenarioFile,
    controller: Annotated[
        str | None,
        typer.Option(help="Which controller, if there are several.", show_default=False),
    ] = None,
    machine: Annotated[
        str | None,
        typer.Option(help="On which machine, if there are several.", show_default=False),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Recording to write, .nc or .csv.", show_default=False)
    ] = None,
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

    _prepare()
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
        _print_json({**result, "warnings": [*ignored, *result["warnings"]]})
        return
    from rich.console import Console

    alone = Comparison({name: recording}, setup.reference, setup.machine)
    print_table(Console(), alone)
    _say([*ignored, *recording.warnings])
    if output is not None:
        typer.echo(f"recording: {output}")


@app.command("estimate-accuracy")
def estimate_accuracy(
    contours: Annotated[
        str | None,
        typer.Option(
            help="Names, with commas; four of the papers' by default.", show_default=False
        ),
    ] = None,
    part: Annotated[
        Path | None,
        typer.Option(
            help="Part program, points or drawing to judge on, in place of or beside named "
            "contours.",
            show_default=False,
        ),
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option(
            help="Coordinates of the part, such as XY; XYZ of a program by default.",
            show_default=False,
        ),
    ] = None,
    estimators: Annotated[
        str | None, typer.Option(help="Names, with commas; all by default.", show_default=False)
    ] = None,
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
    output: Annotated[
        Path | None, typer.Option(help="Folder for JSON, CSV and figure.", show_default=False)
    ] = None,
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

    _prepare()
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
        _print_json(accuracy_json(study, files))
        return
    from rich.console import Console

    console = Console()
    for table in accuracy_tables(study):
        console.print(table)
    _say(accuracy_notes(study), "note")
    for file in files or ():
        typer.echo(f"written: {file}")


@app.command()
def evaluate(
    log: Annotated[
        Path,
        typer.Argument(
            help="Measured log: CSV, halsampler, halscope, MAT, HDF5, MDF or a recording.",
            show_default=False,
        ),
    ],
    commanded: Annotated[
        str | None,
        typer.Option(help="Columns of the commanded positions, with commas.", show_default=False),
    ] = None,
    actual: Annotated[
        str | None,
        typer.Option(help="Columns of the actual positions, with commas.", show_default=False),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(help="Columns of what the drives were told.", show_default=False),
    ] = None,
    time: Annotated[str | None, typer.Option(help="Column of time.", show_default=False)] = None,
    axes: Annotated[
        str | None, typer.Option(help="Names of the axes, such as XY.", show_default=False)
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(help="Of the positions: mm, m, um, or 0.1 um for counts.", show_default=False),
    ] = None,
    time_unit: Annotated[
        str | None, typer.Option(help="Of the column of time.", show_default=False)
    ] = None,
    sample_time: Annotated[
        str | None, typer.Option(help="Between samples, such as 1 ms.", show_default=False)
    ] = None,
    contour: Annotated[
        Path | None,
        typer.Option(
            help="Part file to judge against; else the path through the commands.",
            show_default=False,
        ),
    ] = None,
    align: Annotated[
        bool, typer.Option("--align/--no-align", help="Lay the log on the part.")
    ] = True,
    path: Annotated[
        str, typer.Option(help="Between commanded positions: polyline or spline.")
    ] = "polyline",
    tolerance: Annotated[
        str | None,
        typer.Option(help="Of the spline from the commanded positions.", show_default=False),
    ] = None,
    measured: Annotated[
        str | None,
        typer.Option(
            help="Where the actual position was measured: motor, scale or tool.",
            show_default=False,
        ),
    ] = None,
    pitch: Annotated[
        str | None,
        typer.Option(help="Of the screws; looked for if not given.", show_default=False),
    ] = None,
    circular: Annotated[
        bool, typer.Option("--circular/--no-circular", help="Look for a circular test.")
    ] = True,
    delimiter: Annotated[
        str | None, typer.Option(help="Between columns of a text.", show_default=False)
    ] = None,
    decimal: Annotated[
        str | None, typer.Option(help="Decimal sign of a text.", show_default=False)
    ] = None,
    header: Annotated[
        bool | None,
        typer.Option(
            "--header/--no-header", help="Whether a text names its columns.", show_default=False
        ),
    ] = None,
    comment: Annotated[
        str | None, typer.Option(help="With what comments of a text begin.", show_default=False)
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(help="Folder for report and judged recording.", show_default=False),
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Judge a measured log by its contour error, and tell where that comes from."""
    from contourlab.cli.output import EVALUATION_FILES, refuse_files, write_evaluated
    from contourlab.evaluation import evaluate as judge
    from contourlab.reports import evaluation_json, evaluation_tables

    if output is not None:
        refuse_files(output, EVALUATION_FILES, force=force)
    _prepare()
    result = judge(
        log, contour=contour, align_part=align, path=path, tolerance=tolerance, measured=measured,
        pitch=pitch, circular=circular, commanded=commanded, actual=actual, command=command,
        time=time, axes=axes, unit=unit, time_unit=time_unit, sample_time=sample_time,
        delimiter=delimiter, decimal=decimal, header=header, comment=comment,
    )  # fmt: skip
    report = None if output is None else write_evaluated(result, output, force=force)
    if as_json:
        _print_json(evaluation_json(result, report))
        return
    from rich.console import Console

    console = Console()
    for table in evaluation_tables(result):
        console.print(table)
    for cause in result.causes:
        if cause.remedy and cause.state == "found":
            typer.echo(f"{cause.name}: {cause.remedy}")
    _say(result.warnings)
    if report is not None:
        typer.echo(f"report: {report}")
    else:
        typer.echo("add --output FOLDER for the report and the judged recording")


@app.command()
def reproduce(
    paper: Annotated[
        str | None, typer.Argument(help="Which paper; all there are if left out.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for figures like the paper's.", show_default=False)
    ] = None,
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

    _prepare()
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
        _print_json({"schema": "contourlab.reproduce/1", **body})
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


@app.command()
def export(
    scenario: ScenarioFile,
    output: Annotated[Path, typer.Option(help="Folder or file to write, as the target has it.")],
    controller: Annotated[
        str | None,
        typer.Option(help="Which controller, if there are several.", show_default=False),
    ] = None,
    machine: Annotated[
        str | None,
        typer.Option(help="On which machine, if there are several.", show_default=False),
    ] = None,
    target: Annotated[
        str,
        typer.Option(
            help="c: C99 with golden data and a Makefile; linuxcnc: a HAL component; fmu: a "
            "functional mock-up unit."
        ),
    ] = "c",
    precision: Annotated[str, typer.Option(help="Of reals: double or single.")] = "double",
    prefix: Annotated[
        str | None,
        typer.Option(help="Of every name in C; from the controller's name.", show_default=False),
    ] = None,
    steps: Annotated[
        int, typer.Option(min=1, help="Of the loop that are kept as golden data, at most.")
    ] = 2000,
    license_line: Annotated[
        str | None,
        typer.Option(
            "--license",
            help="linuxcnc: licence of the component, such as GPL.",
            show_default=False,
        ),
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(help="linuxcnc: joint of each axis, such as 0,1.", show_default=False),
    ] = None,
    length_unit: Annotated[
        str | None, typer.Option(help="linuxcnc: LINEAR_UNITS, mm or inch.", show_default=False)
    ] = None,
    command_limit: Annotated[
        str | None,
        typer.Option(
            help="linuxcnc: limit of the commands, one number or one per axis, in SI.",
            show_default=False,
        ),
    ] = None,
    following_error_limit: Annotated[
        str | None,
        typer.Option(
            help='linuxcnc: following error that trips, such as "1 mm".', show_default=False
        ),
    ] = None,
    fmi: Annotated[
        int | None, typer.Option(help="fmu: version of the standard, 2 or 3.", show_default=False)
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Write a controller of a scenario for real time, and compare it with what was simulated."""
    from contourlab.export import export as write
    from contourlab.export.c_target import parity_json
    from contourlab.scenarios import read_scenario
    from contourlab.units import parse_quantity

    _prepare()
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
        _print_json({
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
    _say(result.warnings)


app.command()(identify)


def _numbers(option: str, text: str, kind: Any) -> Any:
    """Return numbers with commas; one alone as a number."""
    try:
        found = [kind(word) for word in text.split(",")]
    except ValueError:
        raise ConfigurationError(f"{option} must be numbers with commas, got {text!r}") from None
    return found[0] if len(found) == 1 and kind is float else found


def _prepare() -> None:
    """Let JAX keep what it compiled in the user's cache folder, between runs."""
    import jax

    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = Path(home) / "contourlab" / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # a home that cannot be written to costs compile time, nothing else
    update: Any = jax.config.update
    update("jax_compilation_cache_dir", str(folder))
    update("jax_persistent_cache_min_compile_time_secs", 0.05)
    update("jax_persistent_cache_min_entry_size_bytes", -1)


def _print_json(value: dict[str, Any]) -> None:
    typer.echo(json.dumps(value, allow_nan=False, ensure_ascii=False))


def _say(warnings: Any, what: str = "warning") -> None:
    for warning in warnings:
        typer.secho(f"{what}: {warning}", err=True, fg="yellow")


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
