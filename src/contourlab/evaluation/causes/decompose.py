"""Where a contour error comes from: every axis fitted, every cause projected on the contour.

With foot f, unit normal n, commanded r and actual y, the contour error is exactly

    ε = n·(f - y) = n·(r - y) + n·(f - r).

The first term is linear in the tracking error, so each cause of that has its own part of ε. The
second is there because the foot lies behind the reference: what a lag does on a curve, even one
that is the same on all axes. It is counted with the lag; against a part file, what the commanded
path itself leaves of the part is taken from it first.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.evaluation.causes.basis import Stage, stage_of
from contourlab.evaluation.causes.cause import Cause
from contourlab.evaluation.causes.periodic import Band, find_bands, find_pitch, waves
from contourlab.evaluation.causes.regression import AxisFit, fit_axis
from contourlab.evaluation.causes.sensors import sees

__all__ = ["Decomposition", "decompose"]

LEAST_ROWS = 60
SETTLING = 0.2
"""Time after a break in motion that is not fitted [s]; at most a fifth of the stretch."""

Values = NDArray[Any]


class Record(NamedTuple):
    """What is decomposed."""

    axes: tuple[str, ...]
    commanded: Values
    actual: Values
    normal: Values
    """Unit vectors on which ε is measured, shape (n, n_axes); NaN where none is."""
    error: Values
    """ε [m]; NaN where it is not judged."""
    own: Values
    """What the commanded path leaves of the contour, along the normal [m]; zero without a part."""
    parts: list[slice]
    """Rows between breaks."""
    sample_time: float
    timed: bool
    step: Values
    """Coarsest grid of each axis [m]."""


class Decomposition(NamedTuple):
    """All causes, and how they were found."""

    causes: tuple[Cause, ...]
    fits: tuple[AxisFit, ...]
    bands: tuple[tuple[Band, ...], ...]
    """Vibrations of each axis."""
    warnings: tuple[str, ...]


def decompose(
    record: Record, *, measured: str | None, pitch: tuple[float, ...] | None
) -> Decomposition:
    """Return the causes of a contour error.

    Parameters
    ----------
    record
        The judged log.
    measured
        Where the actual position was measured: ``motor``, ``scale``, ``tool``, or None.
    pitch
        Period of the cyclic error of each axis, if it is known [m].
    """
    fits, bands, pitches = [], [], []
    for k in range(len(record.axes)):
        fit, found, period = _axis(record, k, measured, pitch)
        fits.append(fit)
        bands.append(tuple(found))
        pitches.append(period)
    from contourlab.evaluation.causes.listed import list_causes

    return list_causes(record, tuple(fits), tuple(bands), tuple(pitches), measured)


def usable_rows(record: Record) -> Values:
    """Return the rows that a fit may use: judged, and not just after a break in motion.

    Parameters
    ----------
    record
        The judged log.
    """
    good = np.isfinite(record.error)
    for at in record.parts:
        n = at.stop - at.start
        if n < LEAST_ROWS:
            good[at] = False
            continue
        speed = np.linalg.norm(np.diff(record.commanded[at], axis=0), axis=1)
        if speed[0] > 0.2 * np.median(speed):
            good[at.start : at.start + int(min(n / 5, SETTLING / record.sample_time))] = False
    return np.flatnonzero(good)


def _axis(
    record: Record, k: int, measured: str | None, pitch: tuple[float, ...] | None
) -> tuple[AxisFit, list[Band], float | None]:
    commanded = record.commanded[:, k]
    stage = stage_of(
        commanded, record.actual[:, k], record.parts, record.sample_time, 2.0 * record.step[k]
    )
    rows = usable_rows(record)
    extra: dict[str, Values] = {}
    middle = float(np.mean(commanded[rows]))
    if np.ptp(commanded[rows]) > 0.0 and sees("scale", measured):
        extra["scale"] = (commanded - middle)[:, None]
    if sees("squareness", measured):
        for j, other in enumerate(record.axes):
            column = record.commanded[:, j]
            if j != k and np.ptp(column[rows]) > 0.0:
                extra[f"cross {other}"] = (column - float(np.mean(column[rows])))[:, None]
    play = sees("backlash", measured)
    fit = fit_axis(stage, rows, extra, play=play)
    period = None
    if sees("cyclic", measured) and np.ptp(commanded[rows]) > 0.0:
        period = pitch[k] if pitch is not None else _pitch(stage, fit, rows)
        if period is not None:
            extra["cyclic"] = waves(fit.shape.moved, period)
            waved = fit_axis(stage, rows, extra, play=play, known=fit)
            if "cyclic" in waved.contributions:
                fit = waved
            else:
                period = None
                del extra["cyclic"]
    bands = _bands(stage, fit, rows) if record.timed else []
    if bands:
        correction = np.sum([band.signal for band in bands], axis=0)
        fit = fit_axis(stage, rows, extra, play=play, correction=correction, known=fit)
    return fit, bands, period


def _pitch(stage: Stage, fit: AxisFit, rows: Values) -> float | None:
    """Return the period of a cyclic error; None where it is as well a vibration at one speed."""
    residual = fit.residual[rows]
    found = find_pitch(fit.shape.moved[rows], residual, fit.n_independent)
    if found is None:
        return None
    columns = np.column_stack([waves(fit.shape.moved[rows], found), np.ones(len(rows))])
    left = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    speed = np.abs(np.diff(fit.shape.moved)) / stage.sample_time
    usual = float(np.median(speed[speed > 0.1 * speed.max()]))
    for band in find_bands(fit.residual, stage.parts, stage.sample_time):
        other = (fit.residual - band.signal)[rows]
        alike = abs(band.frequency * found / usual - 1.0) < 0.1
        if alike and float(other @ other) < 1.5 * float(left @ left):
            return None
    return found


def _bands(stage: Stage, fit: AxisFit, rows: Values) -> list[Band]:
    bands = find_bands(fit.residual, stage.parts, stage.sample_time)
    size = float(np.std(fit.residual[rows])) if len(rows) else 0.0
    return [band for band in bands if float(np.std(band.signal[rows])) > 0.2 * size]
