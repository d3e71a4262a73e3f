"""Knot vectors, and splines cut at their knots into Bézier curves; on the host, all spans at once.

An open spline of degree p with n control points has n + p + 1 knots t_0 … t_{n+p}, and its domain
is t_p to t_n. A closed one has n + 1 knots t_0 … t_n, one period, and its control points go round:
with t_{i+n} = t_i + (t_n - t_0) it is the spline over t_{-p} … t_{n+p} with the control points
P_0 … P_{n-1}, P_0 … P_{p-1}.

Span k is between the k-th and the next knot of the domain and depends on the control points
k … k + p. The i-th point of its Bézier form over [a, b] is the blossom at a, ..., a, b, ..., b with
b taken i times.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.errors import GeometryError

__all__ = ["MOST_DEGREE", "bezier_pieces", "check_knots", "domain_knots", "uniform_knots"]

MOST_DEGREE = 25
"""What is compiled grows with the square of the degree; CAD kernels stop at the same."""

_SHORTEST = 1e-13
"""A span between different knots is at least this fraction of the domain."""

Rows = NDArray[Any]


def uniform_knots(n_control: int, degree: int, closed: bool) -> Rows:
    """Return equidistant knots with the domain 0 to 1, of full multiplicity at open ends.

    Parameters
    ----------
    n_control, degree
        Count of control points and degree.
    closed
        Whether the spline is closed.
    """
    if closed:
        return np.linspace(0.0, 1.0, n_control + 1)
    inner = np.linspace(0.0, 1.0, max(n_control - degree, 1) + 1)
    return np.concatenate([np.zeros(degree), inner, np.ones(degree)])


def domain_knots(knots: Any, degree: int, closed: bool) -> Any:
    """Return the knots at which spans begin and end.

    Parameters
    ----------
    knots
        As the spline holds them.
    degree, closed
        Of the spline.
    """
    return knots if closed else knots[degree : len(knots) - degree]


def check_knots(knots: Rows, n_control: int, degree: int, closed: bool) -> None:
    """Raise GeometryError unless knots and control points make a spline.

    Parameters
    ----------
    knots
        One vector.
    n_control, degree, closed
        Of the spline.

    Raises
    ------
    GeometryError
        Too few control points, a wrong count of knots, knots that are not finite or decrease, one
        that is repeated too often, a span below rounding; says which and what is allowed.
    """
    if n_control < degree + 1:
        raise GeometryError(
            f"degree {degree} needs {degree + 1} control points or more, got {n_control}"
        )
    wanted = n_control + 1 if closed else n_control + degree + 1
    how = "the count of control points + 1, closed" if closed else "control points + degree + 1"
    if knots.shape != (wanted,):
        raise GeometryError(f"knots must be {wanted} numbers ({how}), got shape {knots.shape}")
    if not np.isfinite(knots).all():
        at = int(np.argmin(np.isfinite(knots)))
        raise GeometryError(f"knots must be finite, got knots[{at}] = {knots[at]}")
    steps = np.diff(knots)
    if (steps < 0.0).any():
        at = int(np.argmax(steps < 0.0))
        raise GeometryError(
            f"knots must not decrease, got knots[{at}] = {knots[at]:g} and "
            f"knots[{at + 1}] = {knots[at + 1]:g}"
        )
    _check_repetitions(knots, degree, closed)
    first, last = (0, n_control) if closed else (degree, n_control)
    steps, whole = np.diff(knots[first : last + 1]), knots[last] - knots[first]
    short = (steps > 0.0) & (steps < _SHORTEST * whole)
    if short.any() or not np.isfinite(whole):
        at = first + int(np.argmax(short))
        raise GeometryError(
            f"knots[{at}] and knots[{at + 1}] differ by {knots[at + 1] - knots[at]:.3g}, below "
            f"rounding of the domain, {whole:g}: make them equal"
        )


def _check_repetitions(knots: Rows, degree: int, closed: bool) -> None:
    """Raise GeometryError where a knot stands more often than a curve without gaps allows."""
    last = len(knots) - 1
    starts = np.flatnonzero(np.concatenate([[True], np.diff(knots) > 0.0]))
    ends = np.append(starts[1:], last + 1)
    low, high = (0, last) if closed else (degree, last - degree)
    for start, end in zip(starts, ends, strict=True):
        count, limit = int(end - start), degree
        if not closed and (start == 0 or end == last + 1):
            limit = degree + 1
        # the first and the last knot of the domain are its ends: repeated outwards only
        outside = start <= low < end - 1 or start < high <= end - 1
        if closed:
            outside = start < last == end - 1
        if count > limit or outside:
            where = f"knots[{start}] to knots[{end - 1}]"
            raise GeometryError(
                f"knot {knots[start]:g} stands {count} times ({where}); allowed are {degree} "
                f"within the curve"
                + (
                    " and at the start of a closed one, and 1 at its end"
                    if closed
                    else f" and {degree + 1} at its ends, up to knots[{low}] and from knots[{high}]"
                )
            )


def bezier_pieces(
    control: Rows, knots: Rows, degree: int, closed: bool = False
) -> tuple[Rows, Rows]:
    """Return the Bézier curves of a spline, by its blossom.

    Parameters
    ----------
    control
        Control points, homogeneous if it is rational, shape (n_control, width).
    knots, degree, closed
        As in :func:`check_knots`, and checked.

    Returns
    -------
    rows, span
        Control points of each curve, shape (n_curves, degree + 1, width); the span, counted with
        the empty ones, that each is.
    """
    n = len(control)
    if closed:
        period = knots[-1] - knots[0]
        before = knots[n - degree : n] - period
        knots = np.concatenate([before, knots, knots[1 : degree + 1] + period])
        control = np.concatenate([control, control[:degree]])
    span = np.flatnonzero(np.diff(knots[degree : len(knots) - degree]) > 0.0)
    points = control[span[:, None] + np.arange(degree + 1)]
    local = knots[span[:, None] + np.arange(1, 2 * degree + 1)]
    a, b = local[:, degree - 1, None], local[:, degree, None]
    rows = np.empty_like(points)
    for i in range(degree + 1):
        rest = points
        for step in range(degree):
            left, right = local[:, step:degree], local[:, degree : 2 * degree - step]
            share = (((a if step < degree - i else b) - left) / (right - left))[..., None]
            rest = (1.0 - share) * rest[:, :-1] + share * rest[:, 1:]
        rows[:, i] = rest[:, 0]
    for before_, after in pairwise(rows):  # pieces meet in one point, to the last bit
        after[0] = before_[-1]
    if closed:
        rows[-1, -1] = rows[0, 0]
    return rows, span
