"""The global foot point: the nearest point of the whole contour.

The rows are cut into *fragments*, each inside a ball about its middle. A k-d tree of the middles
gives every point its nearest fragments; those whose ball could hold a nearer point are solved
exactly. A point is done when the nearest fragment that was not asked for is too far to matter,
whatever its size: |q - middle| - largest radius >= distance found. Until then more are asked for.
A fragment's radius is half its width times the bound of |r'|: half its arc length on lines, arcs
and helices.

On a formula most points are done by a few steps from the middle of the nearest fragment. Where that
is certain, it is so for a stretch around it, and fragments inside that are passed over.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contourlab.contours.foot_points.certified import Curve, HeadStart, Places, keep_nearer
from contourlab.contours.foot_points.path_table import PathTable

__all__ = ["Fragments", "fragments_of", "global_feet"]

_EXTRA = 4096
"""Fragments beside the rows."""
_ASKED = 6
"""Fragments that a point asks for at first."""
_MOST = 1 << 18
"""Answers of the tree held at a time."""

Values = NDArray[Any]


class Fragments(NamedTuple):
    """Short stretches that cover the contour, in its order."""

    row: Values
    low: Values
    high: Values
    middle: Values
    """Shape (n_axes, n)."""
    radius: Values
    tree: Any


def fragments_of(curve: Curve) -> Fragments:
    """Return the fragments of a contour.

    Parameters
    ----------
    curve
        The contour.
    """
    if isinstance(curve, PathTable):
        longest = curve.total / (curve.n_rows + _EXTRA)
        count = np.maximum(np.ceil(curve.length / longest), 1.0).astype(int)
        extent = curve.extent
    else:
        count, extent = np.array([_EXTRA]), np.array([curve.total])
    row = np.repeat(np.arange(len(count)), count)
    at, many = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count), count[row]
    low, high = extent[row] * (at / many), extent[row] * ((at + 1) / many)
    middle = curve.look(row, 0.5 * (low + high), np.zeros((curve.n_axes, len(row))), 0)[0]
    radius = 0.5 * (high - low) * curve.rates(row, low, high)[0] + curve.rounding
    return Fragments(row, low, high, middle, radius, cKDTree(middle.T, balanced_tree=False))


def global_feet(curve: Curve, fragments: Fragments, points: Values) -> Places:
    """Return the nearest places of the whole contour to a chunk of points.

    Parameters
    ----------
    curve
        The contour.
    fragments
        Of it.
    points
        Shape (n_axes, n) [m].
    """
    n = points.shape[1]
    finite = np.isfinite(points).all(axis=0)
    best = Places(
        np.where(finite, np.inf, np.nan), np.zeros(n, int), np.zeros(n), np.zeros(n)
    )  # fmt: skip
    open_, asked, total = np.flatnonzero(finite), 0, len(fragments.row)
    known: HeadStart | None = None
    largest = float(fragments.radius.max())
    while len(open_):
        before, asked = asked, min(max(_ASKED, 4 * asked), total)
        pending, step = [], max(_MOST // asked, 1)
        for at in range(0, len(open_), step):
            some = open_[at : at + step]
            query = np.ascontiguousarray(points[:, some].T)
            distance, index = fragments.tree.query(query, k=[*range(1, asked + 1)], workers=1)
            if not before:
                nearest = index[:, 0]
                middle = 0.5 * (fragments.low[nearest] + fragments.high[nearest])
                known = curve.head_start(points[:, some], middle)
                if known is not None:
                    _begin(best, some, known)
            for new in (slice(before, before + 1), slice(before + 1, asked)):
                # the nearest first: it leaves little to do for the others
                bound = distance[:, new] - fragments.radius[index[:, new]]
                hopeful = bound < np.sqrt(best.squared[some])[:, None]
                if not before and known is not None:
                    hopeful &= ~_inside(curve, fragments, index[:, new], known)
                lane, _ = hopeful = np.nonzero(hopeful)
                own, which = some[lane], index[:, new][hopeful]
                if len(own):
                    _solve(curve, fragments, points, own, which, best)
            sure = distance[:, -1] - largest >= np.sqrt(best.squared[some])
            pending.append(some[~sure])
        open_ = np.concatenate(pending) if asked < total else open_[:0]
    return best


def _begin(best: Places, some: Values, known: HeadStart) -> None:
    sure = np.flatnonzero(known.sure)
    best.squared[some[sure]], best.s[some[sure]] = known.squared[sure], known.s[sure]


def _inside(curve: Curve, fragments: Fragments, which: Values, known: HeadStart) -> Values:
    """Return which fragments lie in the stretch of which no nearer point is to be had."""
    low, high = (edge[:, None] for edge in (known.low, known.high))
    within = np.zeros(which.shape, bool)
    for lap in (-curve.total, 0.0, curve.total):
        within |= (fragments.low[which] + lap >= low) & (fragments.high[which] + lap <= high)
    return within & known.sure[:, None]


def _solve(
    curve: Curve,
    fragments: Fragments,
    points: Values,
    own: Values,
    which: Values,
    best: Places,
) -> None:
    """Solve fragments exactly, and write what is nearer."""
    row, low, high = fragments.row[which], fragments.low[which], fragments.high[which]
    s, squared = curve.nearest(points[:, own], row, low, high, best.squared[own])
    keep_nearer(best, own, (squared, row, s, np.zeros(len(own))))
