"""The frequency response of an axis from a record, with coherence.

The whole record is transformed at once, and cross spectra are summed over bands of neighbouring
frequencies. With a signal x that no noise has touched (the reference of a sweep, or an excitation
that was added to the command),

    H = S_xq / S_xu                                                                      (1)

is consistent in a closed loop too; without one, x is the command, and noise that the loop feeds
back biases H where the coherence is low. Positions are differenced twice before and that divided
out again: an axis that integrates has its power at low frequency, which would leak over all others,
and a mass has a response that hardly changes within a band. Frequencies outside the sweep are not
used, nor those that it passes as the record begins or ends: what is there comes from how a record
begins and ends.

**How sure.** γ_u² and γ_q² are the coherences of x with command and position. The standard
deviation of H over its size is √((1/γ_u² + 1/γ_q² - 2) / 2 n), with n the lines in the band.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import tukey

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification.axis_model import KINDS
from contourlab.identification.record import Record, read_record
from contourlab.recordings.recording import Recording

__all__ = ["FrequencyResponse", "frequency_response", "is_sweep"]

LINES = 6
"""Lines of the transform in a band, at least..."""
WIDTH = 0.01
"""...and width of a band over its frequency."""
TAPER = 0.02
"""Share of the record at either end over which signals fade in and out."""
LEAST_POWER = 0.4
"""Power, as a share of that of the excited frequencies, below which one counts as not excited."""
SURE = 0.6
"""Coherence from which a frequency is usable."""
Rows = NDArray[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class FrequencyResponse:
    """From the command of an axis, held between samples, to its measured position."""

    axis: str
    command_kind: str
    frequency: Rows = field(repr=False)
    """[Hz], shape (n,)."""
    response: Rows = field(repr=False)
    """Complex, shape (n,)."""
    coherence: Rows = field(repr=False)
    """The smaller of γ_u² and γ_q², shape (n,)."""
    deviation: Rows = field(repr=False)
    """Standard deviation over size, shape (n,)."""
    usable: Rows = field(repr=False)
    """Whether a frequency was excited and its coherence is high enough, shape (n,)."""
    sample_time: float
    """[s]."""
    resolution: float
    """Width of the narrowest band [Hz]."""
    against: str
    """What x is: ``excitation``, ``reference`` or ``command``; ``nothing`` where the axis was not
    swept."""

    @property
    def unit(self) -> str:
        """Of the response."""
        return {"force": "m/N", "voltage": "m/V", "velocity": "s", "position": "1"}[
            self.command_kind
        ]

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest usable frequency [Hz]; NaN if none is."""
        good = self.frequency[self.usable]
        return (float(good[0]), float(good[-1])) if len(good) else (np.nan, np.nan)


def is_sweep(signal: Any, sample_time: float) -> bool:
    """Return whether a signal is a sweep: one frequency that rises or falls over a range of five.

    Parameters
    ----------
    signal
        Shape (n_samples,).
    sample_time
        [s].
    """
    x = np.asarray(signal, float)
    frames = 24
    length = len(x) // frames
    if length < 32 or not np.any(x != x[0]):
        return False
    parts = x[: frames * length].reshape(frames, length)
    parts = parts - parts.mean(axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(parts * np.hanning(length), n=4 * length, axis=1)) ** 2
    where = np.argmax(power[:, 1:], axis=1) + 1
    share = np.array(
        [row[max(k - 12, 0) : k + 13].sum() / max(row.sum(), 1e-300)
         for row, k in zip(power, where, strict=True)]
    )  # fmt: skip
    peak = where / (4 * length * sample_time)
    narrow = share > 0.5
    if narrow.sum() < frames // 2 or peak[narrow].max() < 5.0 * peak[narrow].min():
        return False
    rank = np.argsort(np.argsort(peak[narrow])).astype(float)
    along = np.arange(narrow.sum(), dtype=float)
    return bool(abs(np.corrcoef(rank, along)[0, 1]) > 0.9)


def frequency_response(
    recording: Recording,
    *,
    against: str = "auto",
    window: tuple[float, float] | None = None,
    resolution: float | None = None,
    command_kind: str | None = None,
) -> tuple[FrequencyResponse, ...]:
    """Return the frequency response of every axis.

    Parameters
    ----------
    recording
        With ``measured`` and ``command``; with ``excitation`` or ``reference`` where there is one.
    against
        ``excitation``, ``reference`` or ``command``; ``auto``: the first of these that is a sweep,
        and else the first that moves. Where the reference rests and the command is no sweep, the
        command is what a loop makes of noise, and tells of the loop and not of the axis: then
        nothing is usable, unless ``command`` is asked for.
    window
        Start and end [s]; the whole record if None.
    resolution
        Width of the narrowest band, > 0 [Hz]; six lines of the record's transform if None.
    command_kind
        That of the recording if None.

    Raises
    ------
    RecordingError
        Signals are missing or unfit, or the record is too short.
    ConfigurationError
        An option out of bounds.
    """
    record = read_record(recording, window=window, command_kind=command_kind, kinds=KINDS)
    n = len(record.time)
    if n < 256:
        raise RecordingError(f"256 samples or more are needed for a frequency response, got {n}")
    if resolution is not None and not (np.isfinite(resolution) and resolution > 0.0):
        raise ConfigurationError(f"resolution must be > 0 Hz, got {resolution!r}")
    names, signals = _against(recording, record, against, window)
    found = []
    for k, name in enumerate(record.names):
        found.append(_of_axis(signals[:, k], record, k, name, names[k], resolution))
    return tuple(found)


def _against(
    recording: Recording, record: Record, against: str, window: tuple[float, float] | None
) -> tuple[list[str], Rows]:
    allowed = ("auto", "excitation", "reference", "command")
    if against not in allowed:
        raise ConfigurationError(f"against must be one of {', '.join(allowed)}, got {against!r}")
    there: dict[str, Rows] = {}
    if "excitation" in recording.dataset.variables:
        rows = np.asarray(recording["excitation"], float)
        time = np.asarray(recording["time"], float)
        if window is not None:
            rows = rows[(time >= window[0]) & (time <= window[1])]
        there["excitation"] = rows
    if record.reference is not None:
        there["reference"] = record.reference
    there["command"] = record.acting
    if against != "auto":
        if against not in there:
            raise RecordingError(f"the recording has no {against}")
        return [against] * len(record.names), there[against]
    names, columns = [], []
    for k in range(len(record.names)):
        moving = [n for n, rows in there.items() if np.ptp(rows[:, k]) > 0.0]
        swept = [n for n in moving if is_sweep(there[n][:, k], record.sample_time)]
        name = next(iter([*swept, *moving, "command"]))
        columns.append(there[name][:, k])
        rests = name == "command" and len(there) > 1
        names.append("nothing" if rests and not swept else name)
    return names, np.stack(columns, axis=1)


def _of_axis(
    x: Rows, record: Record, k: int, axis: str, against: str, resolution: float | None
) -> FrequencyResponse:
    n = len(x) - 2
    step = record.sample_time
    window = tukey(n, 2.0 * TAPER)
    # the second difference of positions, centred on the row of the command
    signals = (x[1:-1], record.acting[1:-1, k], np.diff(record.measured[:, k], 2))
    fx, fu, fq = (np.fft.rfft((s - s.mean()) * window)[1:-1] for s in signals)
    lines = np.fft.rfftfreq(n, step)[1:-1]
    line = 1.0 / (n * step)
    least = max(LINES, 1 if resolution is None else round(resolution / line))
    edges = [0]
    while True:
        width = max(least, int(WIDTH * lines[edges[-1]] / line))
        if edges[-1] + width >= len(lines):
            break
        edges.append(edges[-1] + width)
    starts = np.array(edges[:-1])
    counted = np.diff(edges)

    def band(values: Rows) -> Rows:
        return np.asarray(np.add.reduceat(values[: edges[-1]], starts))

    tiny = 1e-300
    power = band(np.abs(fx) ** 2)
    # of the power, so that a line without any does not pull the band's frequency its way
    frequency = band(lines * np.abs(fx) ** 2) / np.maximum(power, tiny)
    sxx, suu, sqq = (band(np.abs(a) ** 2) for a in (fx, fu, fq))
    sxu, sxq = band(np.conj(fx) * fu), band(np.conj(fx) * fq)
    of_u = np.abs(sxu) ** 2 / np.maximum(sxx * suu, tiny)
    of_q = np.abs(sxq) ** 2 / np.maximum(sxx * sqq, tiny)
    difference = -4.0 * np.sin(np.pi * frequency * step) ** 2
    with np.errstate(all="ignore"):
        response = sxq / sxu / difference
        left = np.maximum(1.0 / of_u + 1.0 / of_q - 2.0, 0.0)
        spread = np.sqrt(left / (2.0 * counted))
    coherence = np.minimum(of_u, of_q)
    usable = (coherence > SURE) & np.isfinite(response) & (frequency > 0.0)
    usable &= against != "nothing"
    # of a linear sweep the power is even, of a logarithmic one power times frequency
    dense = power / counted
    usable &= (dense > LEAST_POWER * _usual(dense)) | (
        frequency * dense > LEAST_POWER * _usual(frequency * dense)
    )
    if is_sweep(x, step):
        usable &= _whole(fx, starts, edges[-1], frequency, n * step)
    return FrequencyResponse(
        axis=axis, command_kind=record.kind, frequency=frequency, response=response,
        coherence=coherence, deviation=spread, usable=usable, sample_time=step,
        resolution=least * line, against=against,
    )  # fmt: skip


def _whole(fx: Rows, starts: Rows, last: int, frequency: Rows, duration: float) -> Rows:
    """Return which bands a sweep passes while signals do not fade in or out, nor within a period of
    that: there the response is cut off before it is over."""
    # the time at which a frequency is passed is how fast the phase falls over the lines
    turns = np.append(fx[1:] * np.conj(fx[:-1]), 0.0)[:last]
    passed = -np.angle(np.add.reduceat(turns, starts)) / (2.0 * np.pi) % 1.0 * duration
    margin = TAPER * duration + 1.0 / np.maximum(frequency, 1e-300)
    return np.asarray((passed > margin) & (passed < duration - margin))


def _usual(power: Rows) -> float:
    """Return what the strongest twentieth of the bands has at least."""
    return float(np.quantile(power, 0.95)) if len(power) else 0.0
