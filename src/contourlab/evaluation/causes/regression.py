"""The tracking error of one axis as a sum of what its causes leave in it.

Least squares in groups of columns. A group is *not separable* if what it contributes can be made up
by the others: on a circle run in one direction at one speed, a lag of X looks like a squareness
error, since the velocity of X is then the position of Y. It is left out, and named beside the one
that took its place. A group that reduces the residual by no more than chance would is left out too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.evaluation.causes.basis import Stage
from contourlab.evaluation.causes.linear import Groups, independent_samples, solve, thinned
from contourlab.evaluation.causes.response import PEAKS, lags_of, peaks_of
from contourlab.evaluation.causes.shape import Shape, search

__all__ = ["AxisFit", "fit_axis"]

SEPARABLE = 0.08
"""Share of a contribution that the others must leave unexplained."""
CHANCE = 12.0
"""F above which a group is kept."""
FIT_ROWS = 120_000
_DROP_ORDER = ("cyclic", "cross", "scale", "sides", "peaks")

Values = NDArray[Any]


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


def fit_axis(
    stage: Stage, rows: Values, extra: Groups, *, play: bool = True,
    correction: Values | None = None, known: AxisFit | None = None,
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
    play
        Whether the sensor sees lost motion, so that there are ``sides``.
    correction
        What is taken from the error before, such as a vibration; shape (n,) [m].
    known
        A fit whose poles, sticking and play are a start; found from nothing if None.
    """
    target = stage.error if correction is None else stage.error - correction
    start = None if known is None else known.shape
    shape = search(stage, rows, extra, target, play=play, start=start)
    groups: Groups = {
        "offset": np.ones((len(target), 1)),
        "lag": lags_of(stage, shape.denominator),
        "peaks": peaks_of(stage, shape.side, shape.denominator),
        **({} if shape.steady else {"sides": shape.lost[:, None]}),
        **extra,
    }
    fitted = thinned(rows, FIT_ROWS)
    if not (shape.steady and _stays(groups, target, fitted)):
        groups["peaks"] = groups["peaks"][:, :PEAKS]
    groups, inseparable = _separated(groups, target, fitted)
    groups, by_chance = _significant(groups, target, fitted)
    found, _ = solve(groups, target, fitted)
    contributions = {name: groups[name] @ found[name] for name in groups}
    residual = target - sum(contributions.values())
    return AxisFit(
        contributions, found, shape, residual, independent_samples(residual[rows]), inseparable,
        by_chance,
    )  # fmt: skip


def _stays(groups: Groups, target: Values, rows: Values) -> bool:
    """Return whether friction leaves an offset that chance would not make."""
    found, less = solve(groups, target, rows)
    left = solve({**groups, "peaks": groups["peaks"][:, :PEAKS]}, target, rows)[1]
    residual = target[rows] - sum((groups[k] @ found[k])[rows] for k in groups)
    return (left - less) * independent_samples(residual) / max(less, 1e-300) >= CHANCE


def _separated(groups: Groups, target: Values, rows: Values) -> tuple[Groups, dict[str, str]]:
    """Return the groups that can be told apart, and for the others what takes their place."""
    kept = dict(groups)
    inseparable: dict[str, str] = {}
    order = [name for kind in _DROP_ORDER for name in groups if name.split()[0] == kind]
    for name in order:
        found, _ = solve(kept, target, rows)
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
    return float(np.sqrt(max(solve(others, contribution, rows)[1], 0.0) / size))


def _significant(groups: Groups, target: Values, rows: Values) -> tuple[Groups, tuple[str, ...]]:
    """Return the groups that do more than chance."""
    kept = dict(groups)
    dropped: list[str] = []
    while True:
        found, left = solve(kept, target, rows)
        residual = target[rows] - sum((kept[k] @ found[k])[rows] for k in kept)
        independent = independent_samples(residual)
        weakest, least = "", np.inf
        for name in kept:
            if name in ("offset", "lag"):
                continue
            others = {one: columns for one, columns in kept.items() if one != name}
            gain = (solve(others, target, rows)[1] - left) / kept[name].shape[1]
            strength = gain * independent / max(left, 1e-300)  # F, of as many as are independent
            if strength < least:
                weakest, least = name, strength
        if not weakest or least >= CHANCE:
            return kept, tuple(dropped)
        dropped.append(weakest)
        del kept[weakest]
