"""What ``identify`` is given: logs as recordings, known parameters, windows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification import even_recording
from contourlab.logs import open_log, read_log
from contourlab.logs.columns import choose_columns, guess_command, listed
from contourlab.logs.source import Source
from contourlab.recordings import Recording
from contourlab.units import parse_quantity

__all__ = ["known_values", "log_recording", "numbers_of_window"]

KINDS = ("voltage", "force", "velocity", "position")
HDF5 = b"\x89HDF\r\n\x1a\n"


def log_recording(
    file: Path, *, kind: str | None, **options: Any
) -> tuple[Recording, tuple[str, ...], tuple[str, ...]]:
    """Return a log as a recording of equidistant samples, warnings, and how it was read.

    Columns of force or voltage are taken for the command where none is stated. A log without any is
    that of position loops: the commanded position is the command.

    Parameters
    ----------
    file
        The log.
    kind
        Of the command; what the file says if None.
    **options
        Of ``read_log``.

    Raises
    ------
    LogError
        The file cannot be read, or a column is not there.
    RecordingError
        There is neither a command nor a commanded position, or no time.
    """
    if kind is not None and kind not in KINDS:
        raise ConfigurationError(f"unknown kind {kind!r}; {choices(kind, KINDS)}")
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    if _is_ours(file) and not any(options.values()):
        recording = Recording.load(file)
    else:
        source = open_log(file)
        told = _command_of(source, options) if kind != "position" else None
        if told is not None:
            options["command"] = told
        log = read_log(source, **options)
        if not log.timed:
            raise RecordingError(f"{file}: the log has no time: give --sample-time or --time")
        recording = log.recording()
        warnings = log.warnings
        if log.rotary is not None:
            beside = " and ".join(log.rotary.axes)
            warnings = (*warnings, f"{beside}: rotary, not identified here: name its columns alone")
        if told is not None:
            what = f"the command is taken from {', '.join(told)}, by names and units"
            warnings = (what, *warnings)
        used = [
            f"{use.role} {use.axis}".strip()
            + f": column {use.column}"
            + (f" [{use.unit}]" if use.unit and f"[{use.unit}]" not in use.column else "")
            + ("" if use.column_stated and use.unit_stated else ", guessed")
            + (", guessed" if use.role == "command" and told is not None else "")
            for use in log.columns
            if use.axis in ("", *log.axes)
        ]
        notes = (*log.notes, *used)
        if log.dimension == "angle":
            warnings = (*warnings, "positions are angles: read rad for m, and inertia for mass")
    dataset = recording.dataset
    if "command" not in dataset.variables:
        if "reference" not in dataset.variables:
            raise RecordingError(
                f"{file}: neither a command nor a commanded position is known: give --command or "
                "--commanded"
            )
        if kind not in (None, "position"):
            raise RecordingError(f"{file}: no {kind} command is known: give --command")
        dataset = dataset.assign(
            command=(("time", "axis"), np.asarray(dataset["reference"]), {"kind": "position"})
        )
        notes = (*notes, "the commanded position is taken for the command of a position loop")
    elif kind is not None:
        command = dataset["command"]
        dataset = dataset.assign(command=(command.dims, command.values, {"kind": kind}))
    elif "kind" not in dataset["command"].attrs:
        raise RecordingError(
            f"{file}: it is not known what the command is: give --kind; " + choices("", KINDS)
        )
    even, said = even_recording(Recording(dataset))
    return even, (*warnings, *said), notes


def _command_of(source: Source, options: dict[str, Any]) -> tuple[str, ...] | None:
    """Return the columns of the command, if the user names none and the file leaves no doubt."""
    if options.get("command") is not None or source.roles:
        return None
    _, axes = choose_columns(
        source, command=None, axes=listed(options.get("axes"), "axes"),
        commanded=listed(options.get("commanded"), "commanded"),
        actual=listed(options.get("actual"), "actual"),
    )  # fmt: skip
    return guess_command(source, axes)


def _is_ours(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            head = stream.read(len(HDF5))
    except OSError:
        return False  # read_log says why
    if head != HDF5:
        return False
    from contourlab.logs.netcdf import is_recording

    return is_recording(str(file))


def known_values(text: str | None) -> dict[str, float]:
    """Return parameters that are known, by name.

    Parameters
    ----------
    text
        Such as ``viscous=25,delay=1 ms``.

    Raises
    ------
    ConfigurationError
        Not names and numbers.
    """
    found: dict[str, float] = {}
    for part in (text or "").split(","):
        if not part.strip():
            continue
        name, mark, value = (piece.strip() for piece in part.partition("="))
        if not mark:
            raise ConfigurationError(f"known must be name=value, with commas, got {part!r}")
        if name in ("delay", "drive_lag"):
            found[name] = parse_quantity(value, "time")
            continue
        try:
            found[name] = float(value)
        except ValueError:
            raise ConfigurationError(f"known {name} must be a number, got {value!r}") from None
    return found


def numbers_of_window(text: str | None) -> tuple[float, float] | None:
    """Return start and end [s] of a window.

    Parameters
    ----------
    text
        Such as ``1 s,5 s``.

    Raises
    ------
    ConfigurationError
        Not two times of which the first comes first.
    """
    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 2:
        raise ConfigurationError(
            f"window must be a start and an end, such as 1 s,5 s, got {text!r}"
        )
    start, end = (parse_quantity(part.strip(), "time") for part in parts)
    if not start < end:
        raise ConfigurationError(f"window must start before it ends, got {text!r}")
    return start, end
