"""How far a blend and what it replaces are apart, both ways, measured.

Of each place on the one curve the foot on the other is found: the nearest of its samples, then
Newton's method. Any foot gives a distance that is not below the least, so a search that fails
cannot flatter. The largest is looked for among samples of both curves, then twice on a finer grid
around it. Between two places of the last grid the distance can rise above both by less than their
difference and spacing allow; the largest difference between neighbours is added to the result.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.blending.pieces import Pieces, polynomial, polynomial_at

__all__ = ["Cut", "measured_deviation"]

Rows = NDArray[Any]

_AT_ONCE = 2048
"""Blends measured together; bounds the memory."""
_NEWTON = (4, 2)
"""Steps from the nearest sample, and from a foot near by."""
_ZOOM = np.linspace(-1.0, 1.0, 9)
_TURNS_MORE = (1.25, 0.2)
"""A blend may turn by this factor more than what it replaces, and by this angle [rad]."""


@dataclass(frozen=True, eq=False)
class Cut:
    """What blends replace: the ends of pieces and the beginnings of others."""

    before: Rows
    """Piece that ends, shape (n,)."""
    low: Rows
    """Arc length on it from which it is cut away [m]."""
    after: Rows
    """Piece that begins."""
    high: Rows
    """Arc length up to which that is cut away [m]."""

    def __len__(self) -> int:
        return len(self.before)

    def at(self, index: Any) -> Cut:
        """Return some of them.

        Parameters
        ----------
        index
            Slice, mask or indices.
        """
        return Cut(self.before[index], self.low[index], self.after[index], self.high[index])


def measured_deviation(
    pieces: Pieces, cut: Cut, control: Rows, *, samples: int = 33, rounds: int = 2
) -> tuple[Rows, Rows]:
    """Return the deviations of blends and whether they are well shaped.

    Parameters
    ----------
    pieces
        The path.
    cut
        What the blends replace.
    control
        Their Bézier points, shape (n, 6, n_axes) [m].
    samples
        Places on each curve, an odd number.
    rounds
        How often the places around the largest distance are made finer; 0 is for a first look.

    Returns
    -------
    deviation, fair
        Shape (n,): [m], never below the true one; False for a blend that turns much more than the
        pieces do: it has a loop or a cusp.
    """
    deviation, fair = np.zeros(len(cut)), np.ones(len(cut), bool)
    for first in range(0, len(cut), _AT_ONCE):
        at = slice(first, first + _AT_ONCE)
        deviation[at], fair[at] = _Pair(pieces, cut.at(at), polynomial(control[at])).measure(
            samples, rounds
        )
    return deviation, fair


class _Pair:
    """Blends and what they replace; x runs from -1 to 0 on the pieces before, on to 1 after."""

    def __init__(self, pieces: Pieces, cut: Cut, coefficients: Rows) -> None:
        self.pieces, self.cut, self.coefficients = pieces, cut, coefficients
        self.end = pieces.length[cut.before]

    def before(self, x: Rows) -> tuple[Rows, Rows, Rows]:
        low = self.cut.low[:, None]
        return self.pieces.points(
            self.cut.before, low + (1.0 + np.clip(x, -1.0, 0.0)) * (self.end[:, None] - low)
        )

    def after(self, x: Rows) -> tuple[Rows, Rows, Rows]:
        return self.pieces.points(self.cut.after, np.clip(x, 0.0, 1.0) * self.cut.high[:, None])

    def measure(self, samples: int, rounds: int) -> tuple[Rows, Rows]:
        n = len(self.cut)
        u = np.tile(np.linspace(0.0, 1.0, samples), (n, 1))
        half = np.linspace(0.0, 1.0, samples // 2 + 1)
        x_before, x_after = np.tile(half - 1.0, (n, 1)), np.tile(half, (n, 1))
        on_blend, slope, _ = polynomial_at(self.coefficients, u)
        on_before, tangent_before, _ = self.before(x_before)
        on_after, tangent_after, _ = self.after(x_after)
        programmed = np.concatenate([tangent_before, tangent_after], axis=1)
        allowed = _TURNS_MORE[0] * _turning(programmed) + _TURNS_MORE[1]
        fair = _turning(slope) <= allowed
        to_before, to_after = _squared(on_blend, on_before), _squared(on_blend, on_after)
        x = np.concatenate([x_before, x_after], axis=1)
        # from the pieces to the blend
        nearest = np.concatenate([to_before.argmin(axis=1), to_after.argmin(axis=1)], axis=1)
        u_foot = np.take_along_axis(u, nearest, axis=1)
        away = self._peak(x, (u_foot,), self.from_pieces, 1.0 / (samples // 2), -1.0, rounds)
        # from the blend to the pieces
        feet = (
            np.take_along_axis(x_before, to_before.argmin(axis=2), axis=1),
            np.take_along_axis(x_after, to_after.argmin(axis=2), axis=1),
        )
        back = self._peak(u, feet, self.from_blend, 1.0 / (samples - 1), 0.0, rounds)
        return np.maximum(away, back), fair

    def _peak(
        self, at: Rows, feet: tuple[Rows, ...], distance: Any, spacing: float, least: float,
        rounds: int,
    ) -> Rows:  # fmt: skip
        """Return the largest distance over places, made finer, with its error."""
        values, feet = distance(at, feet, _NEWTON[0])
        best = values.max(axis=1)
        step = np.zeros_like(best)
        for _ in range(rounds):
            top = values.argmax(axis=1)[:, None]
            centre = np.take_along_axis(at, top, axis=1)
            feet = tuple(
                np.repeat(np.take_along_axis(foot, top, axis=1), len(_ZOOM), axis=1)
                for foot in feet
            )
            at = np.clip(centre + spacing * _ZOOM, least, 1.0)
            values, feet = distance(at, feet, _NEWTON[1])
            best = np.maximum(best, values.max(axis=1))
            step = np.abs(np.diff(values, axis=1)).max(axis=1)
            spacing /= 0.5 * (len(_ZOOM) - 1)
        return best + step  # type: ignore[no-any-return]

    def from_pieces(
        self, x: Rows, feet: tuple[Rows, ...], steps: int
    ) -> tuple[Rows, tuple[Rows, ...]]:
        """Return the distances of places on the pieces from the blend, and their feet."""
        (u,) = feet
        point = np.where((x < 0.0)[..., None], self.before(x)[0], self.after(x)[0])
        best = np.full(x.shape, np.inf)
        foot = u
        for _ in range(steps + 1):
            value, slope, bend = polynomial_at(self.coefficients, u)
            gap = value - point
            distance = np.linalg.norm(gap, axis=-1)
            foot = np.where(distance < best, u, foot)
            best = np.minimum(best, distance)
            square = np.sum(slope * slope, axis=-1)
            curving = square + np.sum(gap * bend, axis=-1)
            with np.errstate(invalid="ignore"):  # a place without speed stays where it is
                step = np.sum(gap * slope, axis=-1) / np.maximum(curving, 0.3 * square)
            step = np.where(np.isfinite(step), step, 0.0)
            u = np.clip(u - step, 0.0, 1.0)
        return best, (foot,)

    def from_blend(
        self, u: Rows, feet: tuple[Rows, ...], steps: int
    ) -> tuple[Rows, tuple[Rows, ...]]:
        """Return the distances of places on the blend from the pieces, and both feet."""
        point = polynomial_at(self.coefficients, u)[0]
        best = np.full(u.shape, np.inf)
        found = []
        sides = (
            (self.before, self.end - self.cut.low, -1.0),
            (self.after, self.cut.high, 0.0),
        )
        for x, (curve, length, least) in zip(feet, sides, strict=True):
            nearest, foot = np.full(u.shape, np.inf), x
            for _ in range(steps + 1):
                value, tangent, curvature = curve(x)
                gap = value - point
                distance = np.linalg.norm(gap, axis=-1)
                foot = np.where(distance < nearest, x, foot)
                nearest = np.minimum(nearest, distance)
                curving = 1.0 + np.sum(gap * curvature, axis=-1)
                step = np.sum(gap * tangent, axis=-1) / np.maximum(curving, 0.3)
                with np.errstate(invalid="ignore", divide="ignore"):
                    moved = step / length[:, None]
                # a side of which nothing is cut away has no length and one point
                moved = np.where(np.isfinite(moved), moved, 0.0)
                x = np.clip(x - moved, least, least + 1.0)
            found.append(foot)
            best = np.minimum(best, nearest)
        return best, (found[0], found[1])


def _squared(a: Rows, b: Rows) -> Rows:
    """Return squared distances between all pairs of points of each of several pairs of curves."""
    total = np.zeros((*a.shape[:2], b.shape[1]))
    for axis in range(a.shape[2]):
        total += (a[:, :, None, axis] - b[:, None, :, axis]) ** 2
    return total


def _turning(tangents: Rows) -> Rows:
    """Return the total turning of directions along curves [rad], shape (n,)."""
    size = np.linalg.norm(tangents, axis=-1, keepdims=True)
    unit = tangents / np.maximum(size, 1e-300)
    difference = np.linalg.norm(np.diff(unit, axis=1), axis=-1)
    return np.sum(2.0 * np.arcsin(np.minimum(0.5 * difference, 1.0)), axis=1)  # type: ignore[no-any-return]
