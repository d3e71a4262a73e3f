"""A machine's parameters from a recording of position and command, refined by simulation.

For each axis

    M q'' + B q' + S q + (A_f forwards, -A_b backwards) = u(t - δ)

in units of the command: **mass and input gain cannot be told apart** from position and command,
so that M is mass over gain, and so on. Filtered least squares begin
(:mod:`~contourlab.identification.start`), the error of the simulated response decides
(:mod:`~contourlab.identification.refinement`).
What the motion does not tell apart gets no value, and a sentence.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace
from contourlab.controllers.least_squares import FilteredLeastSquares
from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification.axis_fit import fit_axis
from contourlab.identification.axis_model import KINDS, Options
from contourlab.identification.machine_result import MachineIdentification
from contourlab.identification.machine_words import NOTES
from contourlab.identification.record import read_record
from contourlab.identification.rows import memory
from contourlab.identification.signals import axis_signals
from contourlab.identification.simulated_response import MODEL_PARAMETERS
from contourlab.identification.start import position_columns
from contourlab.machines.base import per_axis
from contourlab.recordings.recording import Recording

__all__ = ["PIECE_TIME", "identify_machine"]

CUTOFF_SHARE = 0.05
"""Cut-off of the filter relative to the sampling frequency, if nothing else is said."""
SIGN_WIDTH = 1e-4
"""Of the tanh, if nothing else is said [m/s]."""
PIECE_TIME = 0.5
"""A motion one way is cut into pieces no longer than this [s]."""
Rows = NDArray[Any]


def identify_machine(
    recording: Recording,
    *,
    instrument: str = "auto",
    law: FilteredLeastSquares | None = None,
    minimum_speed: float | None = None,
    known: Mapping[str, Any] | None = None,
    stiffness: bool | None = None,
    drive_lag: bool = False,
    window: tuple[float, float] | None = None,
    confidence: float = 0.95,
    condition_limit: float = 30.0,
    piece_time: float = PIECE_TIME,
    simulate: bool = True,
    command_kind: str | None = None,
    source: str = "",
) -> MachineIdentification:
    """Return mass, friction of each direction, stiffness and delay of every axis.

    Parameters
    ----------
    recording
        With ``measured`` positions [m] and ``command``; with the ``reference`` where there is one.
    instrument
        ``reference``; ``none``: the response itself, biased where a loop feeds forces back;
        ``auto``: the reference if there is one.
    law
        Filter of the start, and smooth sign of the friction; by default a cut-off of a twentieth of
        the sampling frequency and a tanh of 0.1 mm/s. The rest of it is not used.
    minimum_speed
        Slower rows do not count, > 0 [m/s]; see :func:`~contourlab.identification.identify`.
    known
        Parameters that are known, by name, one number or one per axis, in units of the command;
        ``delay`` in s. A motion that does not tell the delay takes 0 s for it if it is not given.
    stiffness
        Whether a spring holds the axes; found out if None.
    drive_lag
        Whether the drive lags by a time constant that is looked for too.
    window
        Start and end [s]; the whole record if None.
    confidence
        Of the intervals, between 0 and 1.
    condition_limit
        Condition beyond which parameters are not told apart, > 1.
    piece_time
        Longest stretch that is simulated without beginning anew, > 0 [s].
    simulate
        Whether the simulated response refines what least squares find.
    command_kind
        ``voltage``, ``force``, ``velocity`` or ``position``; that of the recording if None.
    source
        Where the record comes from, for people.

    Returns
    -------
    MachineIdentification
        A parameter that cannot be found has no value; ``warnings`` says why.

    Raises
    ------
    RecordingError
        Signals are missing or unfit, or no axis ever moved fast enough for long enough.
    ConfigurationError
        An option out of bounds.
    """
    _check(instrument, confidence, condition_limit, minimum_speed, piece_time)
    record = read_record(recording, window=window, command_kind=command_kind, kinds=KINDS)
    if record.reference is None and record.kind == "position":
        record = record._replace(reference=record.acting)  # what is asked for is the command
    if instrument == "auto":
        instrument = "none" if record.reference is None else "reference"
    if instrument == "reference" and record.reference is None:
        raise RecordingError(
            "the recording has no reference to be an instrument: choose instrument='none'"
        )
    n = len(record.names)
    if law is None:
        law = FilteredLeastSquares(
            cutoff_hz=CUTOFF_SHARE / record.sample_time, friction_shape="tanh",
            friction_velocity=SIGN_WIDTH,
        )  # fmt: skip
    law = replace(law, initial_covariance=np.ones(4))
    options = Options(
        _given(known, n), True if record.kind == "position" else stiffness, drive_lag, confidence,
        condition_limit, piece_time, simulate,
    )  # fmt: skip
    prepared = axis_signals(record, law, instrument, minimum_speed)
    if not any(signals.weight.any() for signals in prepared):
        remembers = memory(law, record.sample_time, n)
        raise RecordingError(
            f"no axis moved faster than {max(s.minimum_speed for s in prepared):.3g} m/s for "
            f"longer than {2 * remembers.max() * record.sample_time:.3g} s, twice what the filter "
            "remembers: record a longer or faster motion, or raise the cut-off of the filter"
        )
    springs = [position_columns(record, law, record.measured)] * 2
    if instrument == "reference" and record.reference is not None:
        springs[1] = position_columns(record, law, record.reference)
    axes, warnings = [], []
    for k, signals in enumerate(prepared):
        spring = (springs[0][:, k], springs[1][:, k])
        found, said = fit_axis(record, k, signals, spring, law, instrument, options)
        axes.append(found)
        warnings += [f"axis {record.names[k]}: {sentence}" for sentence in said]
    reference = record.reference
    jerk = np.full(n, np.nan)
    if reference is not None and len(reference) > 5:
        jerk = np.abs(np.diff(reference, 3, axis=0)).max(axis=0) / record.sample_time**3
    return MachineIdentification(
        axes=tuple(axes), confidence=confidence, instrument=instrument,
        command_kind=record.kind, command_limit=record.limit,  # type: ignore[arg-type]
        sample_time=record.sample_time,
        travel=np.stack([record.measured.min(axis=0), record.measured.max(axis=0)], axis=1),
        jerk=jerk, warnings=tuple(warnings), notes=NOTES, source=source,
    )  # fmt: skip


def _check(
    instrument: str, confidence: float, limit: float, speed: float | None, piece_time: float
) -> None:
    allowed = ("auto", "reference", "none")
    if instrument not in allowed:
        raise ConfigurationError(
            f"unknown instrument {instrument!r}; {choices(instrument, allowed)}"
        )
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError(f"confidence must be > 0 and < 1, got {confidence!r}")
    if not limit > 1.0:
        raise ConfigurationError(f"condition_limit must be > 1, got {limit!r}")
    if speed is not None and not (np.isfinite(speed) and speed > 0.0):
        raise ConfigurationError(f"minimum_speed must be > 0 m/s, got {speed!r}")
    if not (np.isfinite(piece_time) and piece_time > 0.0):
        raise ConfigurationError(f"piece_time must be > 0 s, got {piece_time!r}")


def _given(known: Mapping[str, Any] | None, n: int) -> dict[str, Rows]:
    rows = {}
    for name, value in (known or {}).items():
        if name not in MODEL_PARAMETERS:
            raise ConfigurationError(
                f"known has no parameter {name!r}; {choices(name, MODEL_PARAMETERS)}"
            )
        row = np.asarray(per_axis(f"known {name}", value, n), float)
        if not np.isfinite(row).all():
            raise ConfigurationError(f"known {name} must be finite, got {value!r}")
        rows[name] = row
    if set(rows) >= set(MODEL_PARAMETERS) - {"drive_lag"}:
        raise ConfigurationError("known leaves nothing to find")
    return rows
