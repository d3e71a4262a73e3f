"""Which files a command writes; all are refused before any work is done."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from contourlab.contour_errors.accuracy_names import study_named
from contourlab.contours import read_dxf, read_gcode, read_points, read_svg
from contourlab.errors import ConfigurationError, OutputError, ScenarioError, choices
from contourlab.evaluation import Evaluation
from contourlab.recordings import Recording
from contourlab.recordings.files import refuse_existing
from contourlab.reports import write_evaluation, write_figures, write_report
from contourlab.scenarios import Setup
from contourlab.scenarios.part_files import file_kind
from contourlab.simulation import Comparison

__all__ = [
    "EVALUATION_FILES",
    "accuracy_contours",
    "choose_controller",
    "choose_machine",
    "comparison_files",
    "recording_file",
    "refuse_files",
    "refuse_recording",
    "write_comparison",
    "write_evaluated",
    "write_recording",
]

REPORT = "report.html"
FIGURES = ("path.png", "contour_error.png", "tracking_error.png", "commands.png", "summary.png")
SPREAD_FIGURE, FEED_FIGURE = "spread.png", "feed.png"
EVALUATION_FILES = (REPORT, "evaluated.nc")


def recording_file(name: str) -> str:
    """Return the file name of a run's recording.

    Parameters
    ----------
    name
        Of the run: the controller's as the user wrote it, and the machine's if there are several.
    """
    return f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', name).lstrip('.') or 'controller'}.nc"


def comparison_files(
    runs: Iterable[str], *, vary: bool = False, planned: bool = False
) -> list[str]:
    """Return the names of the files that a comparison writes.

    Parameters
    ----------
    runs
        Their names.
    vary
        Whether values vary, which gives a figure more.
    planned
        Whether the feed is planned, likewise.

    Raises
    ------
    OutputError
        Two runs would be written to the same file, also where capitals do not count.
    """
    files = [recording_file(name) for name in runs]
    folded = [name.casefold() for name in files]
    for k, name in enumerate(files):
        if folded[k] in folded[:k]:
            raise OutputError(f"two controllers would both be written to {name}; rename one")
    more = [name for name, made in ((SPREAD_FIGURE, vary), (FEED_FIGURE, planned)) if made]
    return [REPORT, *FIGURES, *more, *files]


def refuse_files(folder: Path, names: Iterable[str], *, force: bool) -> None:
    """Raise OutputError if a folder is a file, or holds one of the files already.

    Parameters
    ----------
    folder
        Where the files will go.
    names
        Of the files.
    force
        Whether they may be replaced.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder} is a file, not a folder")
    for name in names:
        refuse_existing(folder / name, force=force)


def write_comparison(
    comparison: Comparison, folder: Path, magnification: float | None, *, force: bool
) -> Path:
    """Write report, figures and recordings; return the report's path.

    Parameters
    ----------
    comparison
        What was run.
    folder
        Made if it does not exist.
    magnification
        Of the deviation in the figures; chosen from the data if None.
    force
        Whether existing files may be replaced.
    """
    for name, recording in comparison.recordings.items():
        recording.save(folder / recording_file(name), force=force)
    write_figures(comparison, folder, magnification=magnification, force=force)
    return write_report(comparison, folder / REPORT, magnification=magnification, force=force)


def accuracy_contours(names: str | None, part: Path | None, axes: str | None) -> Any:
    """Return the contours of an accuracy study, by name; None for the usual ones.

    Parameters
    ----------
    names
        With commas.
    part
        Part program, points or drawing, judged under its file's name.
    axes
        Coordinates of the part; None for the usual ones of its kind.

    Raises
    ------
    ConfigurationError
        An unknown name, the part's among them, or one that is given twice; axes without a part.
    PartError
        The part cannot be read.
    """
    if part is None:
        if axes is not None:
            raise ConfigurationError(f"axes go with a part, got {axes!r} and no part")
        return None if names is None else names.split(",")
    contours = {} if names is None else study_named(names.split(","))
    if part.stem in contours:
        raise ConfigurationError(f"the part and a contour are both called {part.stem!r}")
    read: Any = {"program": read_gcode, "points": read_points, "dxf": read_dxf, "svg": read_svg}
    chosen: Any = {} if axes is None else {"axes": tuple(axes.upper())}
    return {**contours, part.stem: read[file_kind(part.name)](part, **chosen).path}


def choose_machine(machines: Iterable[str], name: str | None) -> str:
    """Return the name of the machine to run on.

    Parameters
    ----------
    machines
        Names of those of the scenario.
    name
        As asked for; may be left out if there is one.

    Raises
    ------
    ScenarioError
        There are several and none was named, or the name is unknown.
    """
    known = list(machines)
    if name is None:
        if len(known) == 1:
            return known[0]
        raise ScenarioError(
            f"the scenario has {len(known)} machines; choose one with --machine: "
            + ", ".join(known)
        )
    if name not in known:
        raise ScenarioError(f"--machine {name}: no such machine; {choices(name, known)}")
    return name


def choose_controller(setup: Setup, name: str | None) -> str:
    """Return the name of the controller to run.

    Parameters
    ----------
    setup
        What the scenario has for the machine.
    name
        As asked for; may be left out if there is one.

    Raises
    ------
    ScenarioError
        There are several and none was named, or the name is unknown, or the machine does not take
        that controller; says why.
    """
    known = [*setup.controllers, *setup.refused]
    if name is None and len(known) > 1:
        raise ScenarioError(
            f"the scenario has {len(known)} controllers; choose one with --controller: "
            + ", ".join(known)
        )
    chosen = known[0] if name is None else name
    if chosen in setup.refused:
        raise setup.refused[chosen]
    if chosen not in known:
        raise ScenarioError(f"--controller {chosen}: no such controller; {choices(chosen, known)}")
    return chosen


def refuse_recording(file: Path, *, force: bool) -> None:
    """Raise OutputError unless a recording can be written to a file.

    Parameters
    ----------
    file
        Ends in ``.nc`` or ``.csv``.
    force
        Whether it may be replaced.
    """
    if file.suffix not in (".nc", ".csv"):
        raise OutputError(f"{file}: a recording is written as .nc (netCDF) or .csv")
    refuse_existing(file, force=force)


def write_evaluated(evaluation: Evaluation, folder: Path, *, force: bool) -> Path:
    """Write report and judged recording of a log, and return the report.

    Parameters
    ----------
    evaluation
        What was found.
    folder
        Where.
    force
        Whether files may be replaced.
    """
    report = write_evaluation(evaluation, folder / REPORT, force=force)
    evaluation.recording.save(folder / EVALUATION_FILES[1], force=force)
    return report


def write_recording(recording: Recording, file: Path, *, force: bool) -> None:
    """Write a recording in the format of its file's ending.

    Parameters
    ----------
    recording
        What was run.
    file
        Ends in ``.nc`` or ``.csv``.
    force
        Whether it may be replaced.
    """
    if file.suffix == ".csv":
        recording.to_csv(file, force=force)
    else:
        recording.save(file, force=force)
