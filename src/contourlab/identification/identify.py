"""Mass, friction and disturbance of every axis from a recording, with confidence intervals.

The filtered equation of :mod:`~contourlab.controllers.least_squares`, M q'' + B q' + A S_f(q') - d
= u in units of the command, solved over a whole record. Beside what the on-line estimator does, it

- leaves out reversals (:mod:`~contourlab.identification.rows`),
- takes the reference for an instrument, so that encoder noise does not bias the values, and gives
  intervals that stand coloured noise (:mod:`~contourlab.identification.inference`),
- says which parameters the motion does not tell apart, instead of a number
  (:mod:`~contourlab.identification.separability`),
- says by how much encoder noise biases plain least squares, and whether the command seems to act
  later than was assumed.

**The bias of plain least squares.** White noise of standard deviation σ on the positions adds
σ² diag(g_a², g_v²) to the mean products of s² H q and s H q, and as much times -θ to the mean
products with u. With S the mean square of s² H q and no correlation between the columns,
M̂ / M = S / (S + σ² g_a²).

References
----------
.. [HuYaoWang] (22) to (25): the filtered equation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.configuration import replace
from contourlab.controllers.least_squares import PARAMETERS, FilteredLeastSquares
from contourlab.errors import ConfigurationError, RecordingError, choices
from contourlab.identification.axis import identify_axis
from contourlab.identification.record import read_record
from contourlab.identification.result import Identification
from contourlab.identification.rows import memory
from contourlab.identification.signals import INSTRUMENTS, axis_signals
from contourlab.identification.trend import estimate_trend
from contourlab.machines.base import per_axis
from contourlab.recordings.recording import Recording

__all__ = ["INSTRUMENTS", "identify"]

CUTOFF_SHARE = 0.05
"""Cut-off of the filter relative to the sampling frequency, if nothing else is said."""
SIGN_WIDTH = 1e-4
"""Of the tanh, if nothing else is said [m/s]."""


def identify(
    recording: Recording,
    *,
    instrument: str = "reference",
    law: FilteredLeastSquares | None = None,
    minimum_speed: float | None = None,
    computing_delay: float = 0.0,
    known: Mapping[str, Any] | None = None,
    window: tuple[float, float] | None = None,
    confidence: float = 0.95,
    condition_limit: float = 30.0,
    command_kind: str | None = None,
) -> Identification:
    """Return mass, friction and disturbance of every axis with confidence intervals.

    Parameters
    ----------
    recording
        With ``measured`` positions [m] and ``command``; with the ``reference``, unless another
        instrument is chosen.
    instrument
        One of :data:`INSTRUMENTS`. A reference that itself answers to measured positions (a law
        that plans its own time) is no instrument.
    law
        Filter and smooth sign; by default a cut-off of a twentieth of the sampling frequency and a
        tanh of 0.1 mm/s. The rest of it is not used.
    minimum_speed
        Slower rows do not count, > 0 [m/s]; by default a twentieth of the axis's largest speed, and
        at least five times what encoder noise does to a difference of positions and ten widths of a
        tanh. Choose it above the speeds at which friction falls.
    computing_delay
        From measuring to acting [s]; any fraction of the sample time.
    known
        Parameters that are known, by name, one number or one per axis, in units of the command.
    window
        Start and end [s]; the whole record if None.
    confidence
        Of the intervals, between 0 and 1.
    condition_limit
        Condition of the regressor beyond which parameters are not told apart, > 1.
    command_kind
        ``voltage``, ``force`` or ``velocity``; that of the recording if None.

    Returns
    -------
    Identification
        A parameter that cannot be found has no value; ``warnings`` says why.

    Raises
    ------
    RecordingError
        Signals are missing or unfit, or no axis ever moved fast enough for long enough.
    ConfigurationError
        An option out of bounds.
    """
    if instrument not in INSTRUMENTS:
        raise ConfigurationError(
            f"unknown instrument {instrument!r}; {choices(instrument, INSTRUMENTS)}"
        )
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError(f"confidence must be > 0 and < 1, got {confidence!r}")
    if not condition_limit > 1.0:
        raise ConfigurationError(f"condition_limit must be > 1, got {condition_limit!r}")
    if minimum_speed is not None and not (np.isfinite(minimum_speed) and minimum_speed > 0.0):
        raise ConfigurationError(f"minimum_speed must be > 0 m/s, got {minimum_speed!r}")
    record = read_record(
        recording, computing_delay=computing_delay, window=window, command_kind=command_kind
    )
    if instrument == "reference" and record.reference is None:
        raise RecordingError(
            "the recording has no reference to be an instrument: choose instrument='delayed'"
        )
    if law is None:
        law = FilteredLeastSquares(
            cutoff_hz=CUTOFF_SHARE / record.sample_time, friction_shape="tanh",
            friction_velocity=SIGN_WIDTH,
        )  # fmt: skip
    law = replace(law, initial_covariance=np.ones(4))
    n = len(record.names)
    given = _given(known, n)
    prepared = axis_signals(record, law, instrument, minimum_speed)
    remembers = memory(law, record.sample_time, n)
    if not any(signals.weight.any() for signals in prepared):
        raise RecordingError(
            f"no axis moved faster than {max(s.minimum_speed for s in prepared):.3g} m/s for "
            f"longer than {2 * remembers.max() * record.sample_time:.3g} s, twice what the filter "
            "remembers: record a longer or faster motion, or raise the cut-off of the filter"
        )
    cutoff = 2.0 * np.pi * np.asarray(per_axis("cutoff_hz", law.cutoff_hz, n))
    axes, warnings = [], []
    for k, signals in enumerate(prepared):
        found, said = identify_axis(
            record, k, signals, instrument=instrument, given=given[:, k], confidence=confidence,
            limit=condition_limit, cutoff=cutoff[k],
        )  # fmt: skip
        axes.append(found)
        warnings += [f"axis {record.names[k]}: {sentence}" for sentence in said]
    settle = float(remembers.max() + record.waiting) * record.sample_time
    return Identification(
        axes=tuple(axes), confidence=confidence, instrument=instrument,
        command_kind=record.kind, command_limit=record.limit,  # type: ignore[arg-type]
        sample_time=record.sample_time,
        trend=estimate_trend(
            record.measured, record.acting, record.sample_time, law, time=record.time,
            settle_time=settle,
        ),
        warnings=tuple(warnings),
    )  # fmt: skip


def _given(known: Mapping[str, Any] | None, n: int) -> NDArray[Any]:
    """Return what is known, NaN elsewhere, shape (4, n_axes)."""
    rows = np.full((4, n), np.nan)
    for name, value in (known or {}).items():
        if name not in PARAMETERS:
            raise ConfigurationError(
                f"known has no parameter {name!r}; {choices(name, PARAMETERS)}"
            )
        row = np.asarray(per_axis(f"known {name}", value, n), float)
        if not np.isfinite(row).all():
            raise ConfigurationError(f"known {name} must be finite, got {value!r}")
        rows[PARAMETERS.index(name)] = row
    if not np.isnan(rows).any():
        raise ConfigurationError("known leaves nothing to find")
    return rows
