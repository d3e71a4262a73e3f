"""Bounds of a contour's geometry, axis by axis, on stretches of arc length.

A planner needs to know, on each stretch, the largest |r'|, |r''| and |r'''| of every axis, r being
the point over arc length. Lines, arcs and helices give them exactly, one segment per piece. Other
curves are cut into short segments, sampled, and bounded by their samples and a Lipschitz constant:
between samples h apart no derivative exceeds its samples by more than h/2 times the bound of the
next one. The chain ends with the fourth derivative, whose samples are enlarged by ``MARGIN``: that
one number is a safety margin, not a bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.path import Path
from contourlab.errors import FeedError
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives

__all__ = ["Segments", "joint_angles", "segments_of"]

Values = NDArray[Any]

MARGIN = 1.25
"""Sampled fourth derivatives are enlarged by this."""
_SAMPLES = 5
_BEZIER_SEGMENTS = 8
_FIRST_SEGMENTS = 256
_MOST_SEGMENTS = 1 << 15
_LOOSE = 0.03


@dataclass(frozen=True, eq=False)
class Segments:
    """Bounds on consecutive stretches of arc length; row k is from edge k to edge k + 1."""

    edges: Values
    """Arc lengths, shape (n + 1,) [m]."""
    tangent: Values
    """Largest |r'| of each axis, shape (n, n_axes)."""
    bend: Values
    """Largest |r''| of each axis [1/m]."""
    twist: Values
    """Largest |r'''| of each axis [1/m²]."""
    turning: Values
    """Amplitude of the turning part of each axis' tangent, inf where the piece is no helix."""
    axial: Values
    """|W| of each axis; see :mod:`contourlab.contours.path`."""
    rate: Values
    """Angle per arc length, shape (n,) [rad/m]; 0 where the piece is no helix."""
    piece: Values
    """Piece of the path, shape (n,); 0 on a formula contour."""
    joint: Values
    """Whether an edge is a joint of the path, shape (n + 1,)."""
    before: Values
    """r' and r'' at each edge from the left, shape (n + 1, 2, n_axes)."""
    after: Values
    """The same from the right."""


def segments_of(contour: Contour, table: ArcLength) -> Segments:
    """Return the bounds of a contour.

    Parameters
    ----------
    contour
        A path or a formula contour.
    table
        Its arc length.

    Raises
    ------
    FeedError
        Derivatives that are not finite.
    """
    if isinstance(contour, Path):
        return _of_path(contour)
    return _of_formula(contour, table)


def joint_angles(segments: Segments) -> Values:
    """Return the angle by which the tangent turns at each edge [rad], 0 at both ends.

    Parameters
    ----------
    segments
        As from ``segments_of``.
    """
    a, b = segments.before[:, 0], segments.after[:, 0]
    angle = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    angle[0] = angle[-1] = 0.0
    return np.where(segments.joint, angle, 0.0)


def _of_path(path: Path) -> Segments:
    breaks = np.asarray(path.breaks, float) - float(np.asarray(path.breaks)[0])
    helical = np.asarray(path.bezier_row) < 0
    cuts = np.where(helical, 1, _BEZIER_SEGMENTS)
    piece = np.repeat(np.arange(path.n_pieces), cuts)
    within = np.arange(len(piece)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    length = np.diff(breaks)
    start = breaks[piece] + length[piece] * (within / cuts[piece])
    edges = np.append(start, breaks[-1])
    joint = np.append(within == 0, True)
    n, n_axes = len(piece), path.n_axes
    rows = _Rows.empty(n, n_axes)
    curved = ~helical[piece]
    if curved.any():
        _bound_sampled(rows, path, curved, edges, piece)
    if not curved.all():
        _bound_helical(rows, path, np.flatnonzero(~curved), piece[~curved])
    return rows.finish(edges, piece, joint)


def _of_formula(contour: Contour, table: ArcLength) -> Segments:
    n = _FIRST_SEGMENTS
    while True:
        edges = np.linspace(0.0, table.length, n + 1)
        rows = _Rows.empty(n, contour.n_axes)
        looseness = _bound_sampled(
            rows, contour, np.ones(n, bool), edges, np.zeros(n, np.int32), table
        )
        if looseness < _LOOSE or n >= _MOST_SEGMENTS:
            break
        n *= 2
    joint = np.zeros(n + 1, bool)
    joint[[0, -1]] = True
    return rows.finish(edges, np.zeros(n, np.int32), joint)


@dataclass(eq=False)
class _Rows:
    tangent: Values
    bend: Values
    twist: Values
    turning: Values
    axial: Values
    rate: Values
    first: Values
    last: Values

    @staticmethod
    def empty(n: int, n_axes: int) -> _Rows:
        def each() -> Values:
            return np.zeros((n, n_axes))

        def ends() -> Values:
            return np.zeros((n, 2, n_axes))

        return _Rows(each(), each(), each(), each(), each(), np.zeros(n), ends(), ends())

    def finish(self, edges: Values, piece: Values, joint: Values) -> Segments:
        before = np.concatenate([self.first[:1], self.last])
        after = np.concatenate([self.first, self.last[-1:]])
        for name in ("tangent", "bend", "twist"):
            value = getattr(self, name)
            if not np.isfinite(value).all():
                at = edges[int(np.argmin(np.isfinite(value).all(axis=1)))]
                raise FeedError(f"the contour's derivatives are not finite near {at:.6g} m")
        return Segments(
            edges, self.tangent, self.bend, self.twist, self.turning, self.axial, self.rate,
            piece, joint, before, after,
        )  # fmt: skip


def _bound_helical(rows: _Rows, path: Path, at: Values, piece: Values) -> None:
    u, v, w = (
        np.asarray(x, float)[piece]
        for x in (path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    rate = np.asarray(path.angle_rate, float)[piece]
    angle = rate * np.diff(np.asarray(path.breaks, float))[piece]
    size, phase = np.hypot(u, v), np.arctan2(v, u)
    ends = np.stack([-phase, angle[:, None] - phase])
    low, high = ends.min(axis=0), ends.max(axis=0)

    def reaches(target: float, period: float) -> Values:
        # 1e-9: an extremum that is missed by rounding only counts as reached
        return np.ceil((low - target - 1e-9) / period) * period + target <= high + 1e-9  # type: ignore[no-any-return]

    cosine, sine = np.cos(ends), np.abs(np.sin(ends)).max(axis=0)
    most = np.where(reaches(0.0, 2 * np.pi), 1.0, cosine.max(axis=0))
    least = np.where(reaches(np.pi, 2 * np.pi), -1.0, cosine.min(axis=0))
    sine = np.where(reaches(0.5 * np.pi, np.pi), 1.0, sine)
    rows.tangent[at] = np.maximum(np.abs(size * most + w), np.abs(size * least + w))
    rows.bend[at] = np.abs(rate)[:, None] * size * sine
    rows.twist[at] = rate[:, None] ** 2 * size * np.maximum(np.abs(most), np.abs(least))
    rows.turning[at], rows.axial[at], rows.rate[at] = size, np.abs(w), np.abs(rate)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    rows.first[at] = np.stack([u + w, rate[:, None] * v], axis=1)
    rows.last[at] = np.stack([u * cos + v * sin + w, rate[:, None] * (v * cos - u * sin)], axis=1)


def _bound_sampled(
    rows: _Rows, contour: Contour, mask: Values, edges: Values, piece: Values,
    table: ArcLength | None = None,
) -> float:  # fmt: skip
    """Fill in sampled rows; return how loose the bound of |r''| is, as a fraction of it."""
    at = np.flatnonzero(mask)
    begin, length = edges[:-1][at], np.diff(edges)[at]
    fraction = np.linspace(0.0, 1.0, _SAMPLES)
    where = (begin[:, None] + length[:, None] * fraction).reshape(-1)
    if table is None:
        offset = float(np.asarray(contour.domain[0]))
        d = contour_derivatives(contour, where + offset, np.repeat(piece[at], _SAMPLES))
    else:
        d = contour_derivatives(contour, table.parameter_at(where))
    over_arc = arc_derivatives(d).reshape(len(at), _SAMPLES, 4, -1)
    highest = np.abs(over_arc).max(axis=1)
    half = 0.5 * (length / (_SAMPLES - 1))[:, None]
    fourth = MARGIN * highest[:, 3]
    # a peak may hide beside the sample: neighbours in the same piece count too
    beside = ((np.diff(at) == 1) & (np.diff(piece[at]) == 0))[:, None]
    after = np.where(beside, fourth[1:], 0.0)
    before = np.where(beside, fourth[:-1], 0.0)
    fourth[:-1] = np.maximum(fourth[:-1], after)
    fourth[1:] = np.maximum(fourth[1:], before)
    twist = highest[:, 2] + half * fourth
    bend = highest[:, 1] + half * twist
    rows.tangent[at] = np.minimum(1.0, highest[:, 0] + half * bend)
    rows.bend[at], rows.twist[at] = bend, twist
    rows.turning[at] = np.inf
    rows.first[at], rows.last[at] = over_arc[:, 0, :2], over_arc[:, -1, :2]
    curvature = float(highest[:, 1].max())
    return float((bend - highest[:, 1]).max() / curvature) if curvature > 0 else 0.0
