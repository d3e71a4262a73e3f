"""Which parameters a motion tells apart.

The columns of the regressor are brought to one size, and decomposed. A direction whose singular
value is below the largest by more than the *condition limit* is weak: along it parameters may be
exchanged for each other with hardly a difference to what is seen, and the smallest error of the
model decides what is found. A parameter of whose variance more than half comes from weak directions
is not told apart. A column that is (nearly) nothing is not excited at all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Separability", "reason", "separate"]

SHARE = 0.5
"""Share of a parameter's variance from weak directions above which it is not told apart."""


class Separability(NamedTuple):
    """What the columns of one axis tell apart."""

    condition: float
    """Largest over smallest singular value of columns of one size; of those that are excited."""
    unexcited: tuple[str, ...]
    """Parameters whose column is nothing."""
    inseparable: tuple[str, ...]
    """Parameters that are not told apart."""


def separate(
    gram: NDArray[Any], names: tuple[str, ...], least: NDArray[Any], limit: float
) -> Separability:
    """Return which parameters are told apart.

    Parameters
    ----------
    gram
        Mean products of the columns, without noise, shape (p, p).
    names
        Of the parameters.
    least
        Mean squares below which a column counts as nothing, shape (p,).
    limit
        Of the condition, > 1.
    """
    size = np.diagonal(gram)
    there = size > least
    unexcited = tuple(name for name, good in zip(names, there, strict=True) if not good)
    left = np.flatnonzero(there)
    if not len(left):
        return Separability(np.inf, unexcited, ())
    scale = np.sqrt(size[left])
    values, vectors = np.linalg.eigh(gram[np.ix_(left, left)] / np.outer(scale, scale))
    # squares: rounding leaves some 1e-16, and taking out noise may leave less than nothing
    values = np.maximum(values, 1e-16 * values[-1])
    parts = vectors**2 / values
    weak = values * limit**2 < values[-1]
    shares = parts[:, weak].sum(axis=1) / parts.sum(axis=1)
    inseparable = tuple(names[k] for k, share in zip(left, shares, strict=True) if share > SHARE)
    return Separability(float(np.sqrt(values[-1] / values[0])), unexcited, inseparable)


REASONS = {
    frozenset({"viscous", "coulomb_forward", "coulomb_backward"}): "it moved at (nearly) one speed",
    frozenset({"viscous", "coulomb_forward"}): "it moved at (nearly) one velocity",
    frozenset({"viscous", "coulomb_backward"}): "it moved at (nearly) one velocity",
    frozenset({"mass", "stiffness"}): "it moved at (nearly) one frequency",
    frozenset({"viscous", "coulomb"}): "it moved at (nearly) one speed",
    frozenset({"coulomb", "disturbance"}): "it moved in one direction",
    frozenset({"viscous", "disturbance"}): "it moved in one direction",
    frozenset({"viscous", "coulomb", "disturbance"}): "it moved at (nearly) one velocity",
}


def reason(names: tuple[str, ...]) -> str:
    """Return why parameters are not told apart, as a clause about the axis.

    Parameters
    ----------
    names
        The parameters.
    """
    return REASONS.get(frozenset(names), "its motion moves them together")
