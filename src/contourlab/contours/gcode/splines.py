"""Splines of G5, G5.1 and G5.2 as rational Bézier curves, without approximation.

G5 is a cubic and G5.1 a quadratic Bézier curve as it stands. G5.2 gives the control points and
weights of a NURBS of order k (degree k - 1) over the clamped uniform knots 0 ... 0 1 2 ... m ... m;
its pieces between knots follow from its blossom: the i-th Bézier point of the piece over [a, b] is
the blossom at a, ..., a, b, ..., b with b taken i times.

References
----------
.. [LinuxCNC] the knots and the order of evaluation, read in nurbs_additional_functions.cc and
   confirmed against the points that its interpreter gives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["is_straight", "nurbs_pieces"]

_SAME = 1e-12
"""Points nearer than this are one [m]."""


def nurbs_pieces(control: NDArray[Any], order: int) -> list[NDArray[Any]]:
    """Return the Bézier pieces of a clamped uniform NURBS.

    Parameters
    ----------
    control
        Homogeneous control points, shape (n, n_axes + 1), n >= order.
    order
        Degree plus one, >= 2.

    Returns
    -------
    list
        Homogeneous control points of each piece, shape (order, n_axes + 1).
    """
    n, degree = len(control), order - 1
    last = n - degree
    knots = np.concatenate([np.zeros(degree), np.arange(last + 1.0), np.full(degree, float(last))])
    pieces = []
    for span in range(last):
        local = control[span : span + order]
        piece = [
            _blossom(local, knots[span + 1 : span + 2 * degree + 1],
                     [float(span)] * (degree - i) + [span + 1.0] * i)
            for i in range(order)
        ]  # fmt: skip
        pieces.append(np.stack(piece))
    # the ends are control points, and pieces meet in one point, to the last bit
    pieces[0][0], pieces[-1][-1] = control[0], control[-1]
    for before, after in pairwise(pieces):
        after[0] = before[-1]
    return pieces


def _blossom(points: NDArray[Any], knots: NDArray[Any], at: Sequence[float]) -> NDArray[Any]:
    """Return the blossom of a span: de Boor's algorithm with another parameter in every step."""
    degree = len(points) - 1
    for step, u in enumerate(at):
        left, right = knots[step:degree], knots[degree : 2 * degree - step]
        share = ((u - left) / (right - left))[:, None]
        points = (1.0 - share) * points[:-1] + share * points[1:]
    return points[0]  # type: ignore[no-any-return]


def is_straight(control: NDArray[Any]) -> bool:
    """Return whether a curve runs straight from its first control point to its last.

    Then it is a line, whatever its parameter does: handles of no length are no cusp.

    Parameters
    ----------
    control
        Homogeneous control points, shape (n, n_axes + 1).
    """
    points = control[:, :-1] / control[:, -1:]
    chord = points[-1] - points[0]
    length = float(math.sqrt(chord @ chord))
    if length <= _SAME:
        return False
    along = (points - points[0]) @ chord / length
    beside = points - points[0] - np.outer(along, chord / length)
    return bool(
        np.max(np.abs(beside)) <= _SAME
        and np.min(np.diff(along)) >= -_SAME
        and np.max(along) <= length + _SAME
    )
