"""A motion that tells the parameters of every axis apart.

Three sines per axis whose frequencies have no common multiple nearby: the speed changes from one
reversal to the next, and so does what acceleration goes with it. Mass, viscous and
Coulomb friction are told apart by that, a spring from a mass by the slowest against the fastest
sine, a delay from friction likewise. Every axis has frequencies of its own.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import ConfigurationError
from contourlab.machines.base import per_axis
from contourlab.recordings.files import atomic_file

__all__ = ["ExcitingMotion", "exciting_motion"]

TONES = (0.31, 1.0, 2.37)
"""Frequencies over that at which largest speed and acceleration go together."""
SHARES = (1.0, 0.7, 0.45)
"""Of the speed of each."""
APART = 1.13
"""Ratio of the frequencies of an axis to those of the one before."""
RAMP = 0.1
"""Share of the time over which the motion swells at the start and ebbs at the end."""
USED = 0.95
"""Share of what an axis may do that the motion does."""


class ExcitingMotion(NamedTuple):
    """A motion, sample by sample."""

    axes: tuple[str, ...]
    time: NDArray[Any]
    """[s], shape (n_samples,)."""
    position: NDArray[Any]
    """[m], shape (n_samples, n_axes); begins and ends at rest in the middle."""

    def to_csv(self, file: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write instants and positions as CSV, atomically.

        Parameters
        ----------
        file
            Where.
        force
            Whether an existing file may be replaced.

        Raises
        ------
        OutputError
            The file exists already, or cannot be written.
        """
        heads = ["time [s]", *(f"{axis} [mm]" for axis in self.axes)]
        rows = np.column_stack([self.time, 1e3 * self.position])
        digits = ["%.9g"] + ["%.9f"] * len(self.axes)
        with atomic_file(Path(file), force=force) as temporary:
            np.savetxt(
                temporary, rows, fmt=digits, delimiter=",", header=",".join(heads), comments=""
            )


def exciting_motion(
    axes: Sequence[str], *, stroke: Any, speed: Any, acceleration: Any, middle: Any = 0.0,
    duration: float = 10.0, sample_time: float = 1e-3,
) -> ExcitingMotion:  # fmt: skip
    """Return a motion that keeps within stroke, speed and acceleration.

    Parameters
    ----------
    axes
        Their names.
    stroke
        From one end to the other, > 0, one number or one per axis [m].
    speed, acceleration
        Largest, > 0, likewise [m/s, m/s²].
    middle
        Where the motion begins and ends, likewise [m].
    duration
        > 0 [s].
    sample_time
        > 0 [s].

    Raises
    ------
    ConfigurationError
        A value out of bounds.
    """
    n = len(axes)
    if n == 0:
        raise ConfigurationError("axes must name one axis or more")
    given = {"stroke": stroke, "speed": speed, "acceleration": acceleration}
    rows = {name: np.asarray(per_axis(name, value, n), float) for name, value in given.items()}
    for name, row in rows.items():
        if not (np.isfinite(row).all() and (row > 0.0).all()):
            raise ConfigurationError(f"{name} must be finite and > 0, got {given[name]}")
    for name, value in (("duration", duration), ("sample_time", sample_time)):
        if not (np.isfinite(value) and value > 0.0):
            raise ConfigurationError(f"{name} must be finite and > 0 s, got {value!r}")
    count = round(duration / sample_time)
    if not 64 <= count <= 10_000_000:
        raise ConfigurationError(
            f"duration must be 64 to 10 million sample times, got {count}: {duration:g} s at "
            f"{sample_time:g} s"
        )
    centre = np.asarray(per_axis("middle", middle, n), float)
    time = np.arange(count + 1) * sample_time
    end = time[-1]
    rise = np.clip(np.minimum(time, end - time) / (RAMP * end), 0.0, 1.0)
    swell = rise**3 * (10.0 + rise * (6.0 * rise - 15.0))  # at rest in speed and acceleration
    position = np.empty((len(time), n))
    for k in range(n):
        reach, fast, hard = (rows[name][k] for name in given)
        # a sine of half the stroke and this frequency has the speed; no faster than the hardest
        usual = min(max(fast / (0.5 * reach), 4.0 * np.pi / end), hard / fast) * APART**k
        usual = max(usual, 4.0 * np.pi / end)
        # slower and slower until every limit holds: amplitudes are of speed, over the frequency
        shape = np.zeros_like(time)
        for tone, share in zip(TONES, SHARES, strict=True):
            shape += share / tone * np.sin(usual * tone * time + k)
        shape = swell * (shape - shape[0])
        rate = np.gradient(shape, sample_time)
        change = np.gradient(rate, sample_time)
        size = USED * min(
            0.5 * reach / np.abs(shape).max(), fast / np.abs(rate).max(),
            hard / np.abs(change).max(),
        )  # fmt: skip
        position[:, k] = centre[k] + size * shape
    return ExcitingMotion(tuple(axes), time, position)
