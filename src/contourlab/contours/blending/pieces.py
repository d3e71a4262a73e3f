"""The pieces of a path at many arc lengths at once, and cut at them, on the host."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from contourlab.contours.bezier_rows import end_derivatives
from contourlab.contours.helical import helical_ends
from contourlab.contours.path import Path

__all__ = ["Pieces", "polynomial", "polynomial_at", "split"]

Rows = NDArray[Any]


class Pieces:
    """A path's arrays in NumPy.

    Parameters
    ----------
    path
        Any path.
    """

    def __init__(self, path: Path) -> None:
        self.origin, self.u, self.v, self.w, self.rate = (
            np.asarray(values, float)
            for values in (
                path.origin, path.tangent_vector, path.normal_vector, path.axial_vector,
                path.angle_rate,
            )
        )  # fmt: skip
        self.length = np.diff(np.asarray(path.breaks))
        self.row = np.asarray(path.bezier_row)
        self.control = np.asarray(path.control_points, float)
        self.inverse = np.asarray(path.inverse_length, float)

    @property
    def straight(self) -> Rows:
        """Which pieces are lines, shape (n_pieces,)."""
        return (self.row < 0) & (self.rate == 0.0)  # type: ignore[no-any-return]

    def bezier_u(self, piece: Rows, s: Rows) -> Rows:
        """Return the parameters of Bézier pieces at arc lengths from their starts.

        Parameters
        ----------
        piece
            Bézier pieces, shape (n,).
        s
            Shape (n, m) [m].
        """
        series = self.inverse[self.row[piece]]
        length = self.length[piece][:, None]
        x = 2.0 * s / length - 1.0
        first = second = np.zeros_like(x)
        for k in range(series.shape[1] - 1, 0, -1):
            first, second = series[:, k : k + 1] + 2.0 * x * first - second, first
        value = np.clip(series[:, :1] + x * first - second, 0.0, 1.0)
        return np.where(s <= 0.0, 0.0, np.where(s >= length, 1.0, value))

    def ends_at(self, piece: Rows, s: Rows) -> tuple[Rows, Rows, Rows]:
        """Return the point, unit tangent and curvature vector of each of several pieces.

        Parameters
        ----------
        piece
            Shape (n,).
        s
            Arc length from its start, shape (n,) [m].

        Returns
        -------
        point, tangent, curvature
            Shape (n, n_axes): [m], none, [1/m].
        """
        values = helical_ends(
            self.origin[piece], self.u[piece], self.v[piece], self.w[piece], self.rate[piece], s
        )
        curved = np.flatnonzero(self.row[piece] >= 0)
        if len(curved):
            chosen = piece[curved]
            at = self.bezier_u(chosen, s[curved][:, None])[:, 0]
            left, right = split(self.control[self.row[chosen]], at)
            ahead = at < 0.5  # the longer part has more digits
            for into, a, b in zip(
                values,
                end_derivatives(np.where(ahead[:, None, None], right, left), at_end=False),
                end_derivatives(np.where(ahead[:, None, None], right, left), at_end=True),
                strict=True,
            ):
                into[curved] = np.where(ahead[:, None], a, b)
        return values

    def points(self, piece: Rows, s: Rows) -> tuple[Rows, Rows, Rows]:
        """Return points, tangents and curvature vectors at many places of each of several pieces.

        Parameters
        ----------
        piece
            Shape (n,).
        s
            Arc lengths from their starts, shape (n, m) [m].

        Returns
        -------
        point, tangent, curvature
            Shape (n, m, n_axes).
        """
        n, m = s.shape
        flat = self.ends_at(np.repeat(piece, m), s.reshape(-1))
        return tuple(values.reshape(n, m, -1) for values in flat)  # type: ignore[return-value]

    def helical_from(self, piece: Rows, s: Rows) -> tuple[Rows, Rows, Rows, Rows]:
        """Return origin, U, V, W of helical pieces begun later.

        Parameters
        ----------
        piece
            Helical pieces, shape (n,).
        s
            Arc length at which each begins, shape (n,) [m].
        """
        u, v, w, rate = self.u[piece], self.v[piece], self.w[piece], self.rate[piece]
        point, _, _ = helical_ends(self.origin[piece], u, v, w, rate, s)
        cosine, sine = np.cos(rate * s)[:, None], np.sin(rate * s)[:, None]
        turned = (rate != 0.0)[:, None]
        return (
            point,
            np.where(turned, u * cosine + v * sine, u),
            np.where(turned, v * cosine - u * sine, v),
            w,
        )

    def bezier_between(self, piece: Rows, low: Rows, high: Rows) -> Rows:
        """Return the control points of Bézier pieces cut at both ends.

        Parameters
        ----------
        piece
            Bézier pieces, shape (n,).
        low, high
            Arc lengths kept, shape (n,) [m].
        """
        u = self.bezier_u(piece, np.stack([low, high], axis=1))
        left, _ = split(self.control[self.row[piece]], u[:, 1])
        return split(left, np.clip(u[:, 0] / u[:, 1], 0.0, 1.0))[1]


def split(rows: Rows, u: Rows) -> tuple[Rows, Rows]:
    """Return the two parts of Bézier curves cut at a parameter, by de Casteljau's algorithm.

    Parameters
    ----------
    rows
        Control points, shape (n, degree + 1, width).
    u
        Where, shape (n,).
    """
    at = u[:, None, None]
    left, right, points = [rows[:, 0]], [rows[:, -1]], rows
    while points.shape[1] > 1:
        points = (1.0 - at) * points[:, :-1] + at * points[:, 1:]
        left.append(points[:, 0])
        right.append(points[:, -1])
    return np.stack(left, axis=1), np.stack(right[::-1], axis=1)


_MONOMIAL = np.array([
    [1, 0, 0, 0, 0, 0],
    [-5, 5, 0, 0, 0, 0],
    [10, -20, 10, 0, 0, 0],
    [-10, 30, -30, 10, 0, 0],
    [5, -20, 30, -20, 5, 0],
    [-1, 5, -10, 10, -5, 1],
], float)  # fmt: skip


def polynomial(control: Rows) -> Rows:
    """Return the powers-of-u coefficients of Bézier quintics, shape (n, 6, n_axes).

    Parameters
    ----------
    control
        Shape (n, 6, n_axes).
    """
    start = control[:, :1]
    coefficients = np.einsum("ij,njk->nik", _MONOMIAL, control - start)
    coefficients[:, 0] = start[:, 0]
    return coefficients  # type: ignore[no-any-return]


def polynomial_at(coefficients: Rows, u: Rows) -> tuple[Rows, Rows, Rows]:
    """Return quintics and their first two derivatives over u, each of shape (n, m, n_axes).

    Parameters
    ----------
    coefficients
        From :func:`polynomial`.
    u
        Shape (n, m).
    """
    at = u[..., None]
    value = coefficients[:, None, 5] + 0.0 * at
    slope = np.zeros_like(value)
    bend = np.zeros_like(value)
    for k in range(4, -1, -1):
        bend = bend * at + slope
        slope = slope * at + value
        value = value * at + coefficients[:, None, k]
    return value, slope, 2.0 * bend
