"""A stretch of a recording whose samples are equidistant.

Identification filters and simulates, which takes equidistant samples. Time stamps that rattle about
a grid are put on it; a record with gaps gives its longest stretch without one.
"""

from __future__ import annotations

import numpy as np

from contourlab.errors import RecordingError
from contourlab.recordings.recording import Recording

__all__ = ["even_recording"]

GAP = 1.5
"""Distance of neighbours, in sample times, from which a sample is missing."""
RATTLE = 1e-3
"""Share of the sample time by which an instant may be off without a word."""
FEWEST = 8


def even_recording(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Return the longest stretch of equidistant samples, and what was done for it, in sentences.

    Parameters
    ----------
    recording
        With instants that rise.

    Raises
    ------
    RecordingError
        Time does not rise or is not finite, or no stretch has 8 samples.
    """
    time = np.asarray(recording["time"], float)
    if len(time) < FEWEST:
        raise RecordingError(f"{FEWEST} samples or more are needed, got {len(time)}")
    if not np.isfinite(time).all():
        raise RecordingError("an instant is not a finite number")
    steps = np.diff(time)
    if not np.all(steps > 0.0):
        k = int(np.argmin(steps > 0.0))
        raise RecordingError(
            f"time must rise: {time[k + 1]:.9g} s follows on {time[k]:.9g} s, at sample {k + 1}"
        )
    usual = float(np.median(steps))
    cuts = np.concatenate([[0], np.flatnonzero(steps > GAP * usual) + 1, [len(time)]])
    k = int(np.argmax(np.diff(cuts)))
    begin, end = int(cuts[k]), int(cuts[k + 1])
    if end - begin < FEWEST:
        raise RecordingError(
            f"the longest stretch without a gap has {end - begin} samples; {FEWEST} are needed"
        )
    said = []
    part = recording.dataset
    if end - begin < len(time):
        said.append(
            f"{len(cuts) - 2} gaps: of {len(time)} samples the longest stretch without one was "
            f"used, from {time[begin]:.6g} to {time[end - 1]:.6g} s, {end - begin} samples"
        )
        part = part.isel(time=slice(begin, end))
    kept = time[begin:end]
    grid = np.linspace(kept[0], kept[-1], len(kept))
    off = float(np.abs(kept - grid).max())
    mean = float(grid[1] - grid[0])
    if off > RATTLE * mean:
        if off > 2.0 * mean:
            said.append(
                f"time stamps stray from an even clock by up to {1e3 * off:.3g} ms, which is more "
                "than a sample: delays and masses are no surer than that"
            )
        else:
            said.append(
                f"time stamps rattle by up to {1e3 * off:.3g} ms: the samples were taken for "
                f"equidistant, {1e3 * mean:.6g} ms apart"
            )
        part = part.assign_coords(time=("time", grid, part["time"].attrs))
    return Recording(part), tuple(said)
