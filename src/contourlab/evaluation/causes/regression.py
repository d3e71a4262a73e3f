"""The tracking error of one axis as a sum of what its causes leave in it.

Least squares in groups of columns. A group is *not separable* if what it contributes can be made up
by the others: on a circle run in one direction at one speed, a lag of X looks like a squareness
error, since the velocity of X is then the position of Y. It is left out, and named beside the one
that took its place. A group that reduces the residual by no more than chance would is left out too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contourlab.evaluation.causes.basis import Stage, lags_of, peaks_of, sides_of
from contourlab.evaluation.causes.reversals import turning_points

__all__ = ["AxisFit", "fit_axis", "independent_samples"]

SEPARABLE = 0.08
"""Share of a contribution that the others must leave unexplained."""
CHANCE = 12.0
"""F above which a group is kept."""
FIT_ROWS = 120_000
SCAN_ROWS = 6_000
WINDOW_ROWS = 80_000
"""Rows of a long record on which time constants are looked for."""
CONSTANTS = 11
"""Time constants that are tried."""
SLOWEST = 0.25
"""Largest time constant that is tried [s]."""
STICKS = (0.0, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4)
"""Distances of sticking that are tried [m]."""
_DROP_ORDER = ("cyclic", "cross", "scale", "sides", "peaks")

Values = NDArray[Any]
Groups = dict[str, Values]


class Shape(NamedTuple):
    """What is not linear in the fit of an axis, found by scanning."""

    lag_constant: float
    """T of the lag [s]."""
    peak_constant: float
    """T of the friction peaks [s]."""
    stick: float
    """Distance over which friction changes its side [m]."""
    before: float
    """Friction's side before the first motion, see :func:`peaks_of`."""
    play: float
    """Width of the play that ``sides`` crosses [m]."""
    moved: Values
    """The commanded position without its lag [m]."""


@dataclass(eq=False)
class AxisFit:
    """What the causes contribute to the tracking error of one axis."""

    contributions: Groups
    """By group, shape (n,) [m]: ``offset``, ``lag``, ``peaks``, ``sides``, ``scale``, ``cross J``,
    ``cyclic``."""
    coefficients: Groups
    shape: Shape
    residual: Values
    """What is left, shape (n,) [m]."""
    n_independent: float
    """Independent samples in the residual."""
    inseparable: dict[str, str] = field(default_factory=dict)
    """Groups that were left out, and the one that takes their place."""
    by_chance: tuple[str, ...] = ()
    """Groups that were left out because chance would do as much."""


def independent_samples(residual: Values) -> float:
    """Return how many independent samples a residual amounts to.

    Parameters
    ----------
    residual
        Shape (n,).
    """
    x = residual - residual.mean()
    n = len(x)
    size = 1 << int(np.ceil(np.log2(2 * n)))
    correlation = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: n // 2]
    if len(correlation) < 2 or correlation[0] <= 0.0:
        return float(n)
    correlation = correlation / correlation[0]
    ends = np.flatnonzero(correlation < 0.05)
    stop = int(ends[0]) if len(ends) else len(correlation)
    return float(max(n / (1.0 + 2.0 * correlation[1:stop].sum()), 20.0))


def _solve(groups: Groups, target: Values, rows: Values) -> tuple[Groups, float]:
    """Return coefficients by group and the sum of squares that is left."""
    matrix = np.column_stack([columns[rows] for columns in groups.values()])
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    scaled = matrix / size
    wanted = target[rows]
    gram = scaled.T @ scaled
    solution = np.linalg.lstsq(gram, scaled.T @ wanted, rcond=1e-12)[0]
    left = wanted - scaled @ solution
    found: Groups = {}
    at = 0
    for name, columns in groups.items():
        width = columns.shape[1]
        found[name] = (solution / size)[at : at + width]
        at += width
    return found, float(left @ left)


def fit_axis(
    stage: Stage, rows: Values, extra: Groups, *, correction: Values | None = None,
    known: AxisFit | None = None,
) -> AxisFit:  # fmt: skip
    """Return the fit of one axis.

    Parameters
    ----------
    stage
        The axis.
    rows
        Which rows are fitted.
    extra
        Groups beside lag, peaks and sides: scale, other axes, waves; each of shape (n, columns).
    correction
        What is taken from the error before, such as a vibration; shape (n,) [m].
    known
        A fit whose time constants, sticking and play are taken over; found if None.
    """
    target = stage.error if correction is None else stage.error - correction
    offset = {"offset": np.ones((len(target), 1))}
    shape = _scanned(stage, rows, extra, target) if known is None else known.shape
    lag_constant, peak_constant, stick, before, play, moved = shape
    groups: Groups = {
        **offset,
        "lag": lags_of(stage, lag_constant),
        "peaks": peaks_of(stage, moved, peak_constant, stick, before),
        "sides": sides_of(stage, moved, play)[:, None],
        **extra,
    }
    fitted = _thinned(rows, FIT_ROWS)
    groups, inseparable = _separated(groups, target, fitted)
    groups, by_chance = _significant(groups, target, fitted)
    found, _ = _solve(groups, target, fitted)
    contributions = {name: groups[name] @ found[name] for name in groups}
    residual = target - sum(contributions.values())
    return AxisFit(
        contributions, found, shape, residual, independent_samples(residual[rows]), inseparable,
        by_chance,
    )  # fmt: skip


def _scanned(stage: Stage, rows: Values, extra: Groups, target: Values) -> Shape:
    whole = stage
    stage, inside = _window(stage)
    target = target[inside]
    extra = {name: columns[inside] for name, columns in extra.items()}
    scan = rows[(rows >= inside.start) & (rows < inside.stop)] - inside.start
    scan = _thinned(scan if len(scan) > 50 else np.arange(len(target)), SCAN_ROWS)
    constants = _constants(stage)
    offset = {"offset": np.ones((len(target), 1))}

    def left(**groups: Values) -> float:
        return _solve({**offset, **groups, **extra}, target, scan)[1]

    # the lag alone first: it tells where the axis reverses
    lag_constant = min(constants, key=lambda t: left(lag=lags_of(stage, t)))
    lags = lags_of(stage, lag_constant)
    first, _ = _solve({**offset, "lag": lags, **extra}, target, scan)
    moved = stage.commanded - lags @ first["lag"]
    peak_constant, stick, before, play = lag_constant, 0.0, 0.0, 0.0
    for _ in range(2):
        sides = sides_of(stage, moved, play)[:, None]

        def with_peaks(t: float, distance: float, first: float, lags: Values = lags,
                       sides: Values = sides, moved: Values = moved) -> float:  # fmt: skip
            return left(lag=lags, sides=sides, peaks=peaks_of(stage, moved, t, distance, first))

        peak_constant = min(constants, key=lambda t: with_peaks(t, stick, before))
        before = min((0.0, 1.0, -1.0), key=lambda b: with_peaks(peak_constant, stick, b))
        stick = min(STICKS, key=lambda d: with_peaks(peak_constant, d, before))
        peaks = peaks_of(stage, moved, peak_constant, stick, before)
        lag_constant = min(
            constants, key=lambda t: left(lag=lags_of(stage, t), sides=sides, peaks=peaks)
        )
        lags = lags_of(stage, lag_constant)
        found, _ = _solve(
            {**offset, "lag": lags, "sides": sides, "peaks": peaks, **extra}, target, scan
        )
        moved = stage.commanded - lags @ found["lag"]
        play = 2.0 * abs(float(found["sides"][0]))
    if whole is not stage:
        moved = whole.commanded - lags_of(whole, lag_constant) @ found["lag"]
    return Shape(lag_constant, peak_constant, stick, before, play, moved)


def _window(stage: Stage) -> tuple[Stage, slice]:
    """Return the stretch of a long record that tells most: the one with the most reversals."""
    n = len(stage.commanded)
    if n <= WINDOW_ROWS:
        return stage, slice(0, n)
    count = np.zeros(n)
    for at in stage.parts:
        count[at.start + turning_points(stage.commanded[at], stage.least)[0]] += 1.0
    moves = np.concatenate([[0.0], np.abs(np.diff(stage.commanded))])
    told = np.cumsum(count + 1e-3 * moves / max(float(moves.mean()), 1e-300))
    gain = told[WINDOW_ROWS:] - told[:-WINDOW_ROWS]
    start = int(gain.argmax())
    inside = slice(start, start + WINDOW_ROWS)
    parts = tuple(
        slice(max(at.start, start) - start, min(at.stop, inside.stop) - start)
        for at in stage.parts
        if at.stop > start and at.start < inside.stop
    )
    return stage._replace(
        commanded=stage.commanded[inside], error=stage.error[inside], parts=parts
    ), inside


def _thinned(rows: Values, most: int) -> Values:
    return rows[:: max(1, -(-len(rows) // most))]


def _constants(stage: Stage) -> list[float]:
    longest = max((at.stop - at.start for at in stage.parts), default=1) * stage.sample_time
    slowest = max(min(SLOWEST, longest / 8.0), 3.0 * stage.sample_time)
    if stage.sample_time >= SLOWEST / 4.0:  # in samples, or sampled very slowly
        slowest = max(longest / 20.0, 3.0 * stage.sample_time)
    return [float(t) for t in np.geomspace(1.2 * stage.sample_time, slowest, CONSTANTS)]


def _separated(groups: Groups, target: Values, rows: Values) -> tuple[Groups, dict[str, str]]:
    """Return the groups that can be told apart, and for the others what takes their place."""
    kept = dict(groups)
    inseparable: dict[str, str] = {}
    order = [name for kind in _DROP_ORDER for name in groups if name.split()[0] == kind]
    for name in order:
        found, _ = _solve(kept, target, rows)
        contribution = kept[name] @ found[name]
        others = {one: columns for one, columns in kept.items() if one != name}
        if _unexplained(others, contribution, rows) >= SEPARABLE:
            continue
        partners = [one for one in others if one != "offset"]
        place = max(
            partners,
            key=lambda one: _unexplained(
                {key: c for key, c in others.items() if key != one}, contribution, rows
            ),
        )
        inseparable[name] = place
        kept = others
    return kept, inseparable


def _unexplained(others: Groups, contribution: Values, rows: Values) -> float:
    """Return the share of a contribution that the other groups cannot make up."""
    spread = contribution[rows] - contribution[rows].mean()
    size = float(spread @ spread)
    if size <= 0.0:
        return 1.0
    return float(np.sqrt(max(_solve(others, contribution, rows)[1], 0.0) / size))


def _significant(groups: Groups, target: Values, rows: Values) -> tuple[Groups, tuple[str, ...]]:
    """Return the groups that do more than chance."""
    kept = dict(groups)
    dropped: list[str] = []
    while True:
        found, left = _solve(kept, target, rows)
        residual = target[rows] - sum((kept[k] @ found[k])[rows] for k in kept)
        independent = independent_samples(residual)
        weakest, least = "", np.inf
        for name in kept:
            if name in ("offset", "lag"):
                continue
            others = {one: columns for one, columns in kept.items() if one != name}
            gain = (_solve(others, target, rows)[1] - left) / kept[name].shape[1]
            strength = gain * independent / max(left, 1e-300)  # F, of as many as are independent
            if strength < least:
                weakest, least = name, strength
        if not weakest or least >= CHANCE:
            return kept, tuple(dropped)
        dropped.append(weakest)
        del kept[weakest]
