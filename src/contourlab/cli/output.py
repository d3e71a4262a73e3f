"""Which files a command writes; all are refused before any work is done."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from contourlab.controllers.base import Controller
from contourlab.errors import OutputError, ScenarioError, choices
from contourlab.recordings import Recording
from contourlab.recordings.files import refuse_existing
from contourlab.reports import write_figures, write_report
from contourlab.simulation import Comparison

__all__ = [
    "choose_controller",
    "comparison_files",
    "recording_file",
    "refuse_files",
    "refuse_recording",
    "write_comparison",
    "write_recording",
]

REPORT = "report.html"
FIGURES = ("path.png", "contour_error.png", "commands.png", "summary.png")


def recording_file(name: str) -> str:
    """Return the file name of a controller's recording.

    Parameters
    ----------
    name
        Of the controller, as the user wrote it.
    """
    return f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', name).lstrip('.') or 'controller'}.nc"


def comparison_files(controllers: Iterable[str]) -> list[str]:
    """Return the names of the files that a comparison writes.

    Parameters
    ----------
    controllers
        Names.
    """
    files = [recording_file(name) for name in controllers]
    for k, name in enumerate(files):
        if name in files[:k]:
            raise OutputError(f"two controllers would both be written to {name}; rename one")
    return [REPORT, *FIGURES, *files]


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


def choose_controller(controllers: Mapping[str, Controller], name: str | None) -> str:
    """Return the name of the controller to run.

    Parameters
    ----------
    controllers
        Of the scenario.
    name
        As asked for; may be left out if there is one.

    Raises
    ------
    ScenarioError
        There are several and none was named, or the name is unknown.
    """
    if name is None:
        if len(controllers) == 1:
            return next(iter(controllers))
        raise ScenarioError(
            f"the scenario has {len(controllers)} controllers; choose one with --controller: "
            + ", ".join(controllers)
        )
    if name not in controllers:
        raise ScenarioError(
            f"--controller {name}: no such controller; {choices(name, controllers)}"
        )
    return name


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
