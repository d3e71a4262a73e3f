"""What identification needs of a recording: positions, what acted, instants, units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.recordings.recording import Recording

__all__ = ["COMMAND_UNITS", "Record", "read_record"]

COMMAND_UNITS = {"voltage": "V", "force": "N", "velocity": "m/s"}
"""Kinds of command that the model speaks of, and their units."""
JITTER = 1e-3
"""Share of the sample time by which an instant may be off, for rounded time stamps."""


class Record(NamedTuple):
    """The signals of a recording, over the window that was asked for."""

    names: tuple[str, ...]
    time: NDArray[Any]
    """[s], shape (n_samples,)."""
    sample_time: float
    """[s]."""
    measured: NDArray[Any]
    """[m], shape (n_samples, n_axes)."""
    acting: NDArray[Any]
    """Mean command that acted from each instant to the next, within its limits [command]."""
    reference: NDArray[Any] | None
    """[m]; None if the recording has none."""
    kind: str
    """Kind of the command."""
    limit: NDArray[Any]
    """Of the command, shape (n_axes,); infinite where none is recorded."""
    waiting: int
    """Samples at the start whose acting command is not in the record."""


def read_record(
    recording: Recording,
    *,
    computing_delay: float = 0.0,
    window: tuple[float, float] | None = None,
    command_kind: str | None = None,
    kinds: Mapping[str, str] = COMMAND_UNITS,
) -> Record:
    """Return the signals of a recording.

    Parameters
    ----------
    recording
        With ``measured`` and ``command``, and ``reference`` where there is one.
    computing_delay
        From measuring to acting, >= 0 [s], any fraction of the sample time.
    window
        Start and end [s]; the whole record if None.
    command_kind
        A key of :data:`COMMAND_UNITS`; that of the recording if None.
    kinds
        Kinds of command that may be.

    Raises
    ------
    RecordingError
        A signal is missing or not finite, the run diverged, samples are not equidistant, the window
        holds too few of them, or the kind of the command is not known.
    ConfigurationError
        A delay that is not >= 0.
    """
    if not (np.isfinite(computing_delay) and computing_delay >= 0.0):
        raise ConfigurationError(f"computing_delay must be >= 0 s, got {computing_delay!r}")
    if recording.diverged:
        raise RecordingError(f"the run {recording.status}: it says nothing about the machine")
    time = np.asarray(recording["time"], float)
    measured = np.asarray(recording["measured"], float)
    command = np.asarray(recording["command"], float)
    held = recording.dataset.variables
    reference = np.asarray(recording["reference"], float) if "reference" in held else None
    if measured.ndim != 2 or command.shape != measured.shape:
        raise RecordingError(
            "measured and command must have one value per sample and axis, got shapes "
            f"{measured.shape} and {command.shape}"
        )
    limit = np.full(measured.shape[1], np.inf)
    if "command_limit" in held:
        limit = np.broadcast_to(np.asarray(recording["command_limit"], float), limit.shape).copy()
    acting, waiting = _acting(np.clip(command, -limit, limit), time, computing_delay)
    if window is not None:
        inside = (time >= window[0]) & (time <= window[1])
        time, measured, acting = time[inside], measured[inside], acting[inside]
        reference = None if reference is None else reference[inside]
        waiting = max(0, waiting - int(np.argmax(inside)))
    if len(time) < 8:
        raise RecordingError(f"8 samples or more are needed, got {len(time)}")
    for name, rows in (("measured", measured), ("command", acting), ("reference", reference)):
        if rows is not None and not np.isfinite(rows).all():
            at = time[int(np.argmax(~np.isfinite(rows).all(axis=1)))]
            raise RecordingError(f"{name} is not finite at {at:.6g} s: choose a window without it")
    labels = recording["axis"] if "axis" in held else range(measured.shape[1])
    return Record(
        tuple(str(label) for label in np.asarray(labels)), time, _sample_time(time), measured,
        acting, reference, _kind(recording, command_kind, kinds), limit, waiting,
    )  # fmt: skip


def _sample_time(time: NDArray[Any]) -> float:
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    off = np.abs(time - time[0] - mean * np.arange(len(time)))
    if not mean > 0.0 or off.max() > JITTER * mean:
        at = time[int(np.argmax(off))]
        raise RecordingError(
            f"samples must be equidistant: with {mean:.6g} s between them, that at {at:.9g} s is "
            f"off by {off.max():.3g} s"
        )
    return mean


def _acting(command: NDArray[Any], time: NDArray[Any], delay: float) -> tuple[NDArray[Any], int]:
    """Return the mean of what acts from each instant to the next, and what is missing of it."""
    if delay == 0.0 or len(time) < 2:
        return command, 0
    periods = delay / _sample_time(time)
    whole = int(np.floor(periods + 1e-9))
    share = max(periods - whole, 0.0)
    later = np.concatenate([np.repeat(command[:1], whole + 1, axis=0), command])
    n = len(command)
    return share * later[:n] + (1.0 - share) * later[1 : n + 1], whole + 1


def _kind(recording: Recording, given: str | None, kinds: Mapping[str, str]) -> str:
    kind = given if given is not None else recording["command"].attrs.get("kind")
    if kind is None:
        raise RecordingError(
            "the recording does not say what its command is: give command_kind; "
            + choices("", kinds)
        )
    if kind not in kinds:
        raise RecordingError(
            f"no mass and friction can be found from a {kind} command; " + choices(kind, kinds)
        )
    return str(kind)
