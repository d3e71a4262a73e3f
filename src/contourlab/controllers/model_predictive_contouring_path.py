"""The contour over arc length, for a law that has its progress along the path as a state.

The parameter of a path is arc length. That of a formula curve is not: a table holds the parameter
at equal arc lengths, by fourth-order integration of dp/ds = 1 / |r'(p)|, and between them a cubic
with these slopes. Whatever the table's error, a point is exactly on the contour and its tangent is
exactly the contour's; the error is only in how long the way there is (below 1e-8 of the length on a
figure of eight).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from contourlab.configuration import is_concrete
from contourlab.contours.base import Contour, unit
from contourlab.contours.path import Path
from contourlab.errors import RefusedError
from contourlab.typing import Array, AxisVector, Count, Scalar

__all__ = ["PathPoint", "ProgressPath", "progress_path"]

NODES = 1024
"""Intervals of the table."""
CLOSURE = 1e-4
"""Share of the parameter range by which the table may miss the end."""


class PathPoint(NamedTuple):
    """The contour at one arc length, or, with a leading dimension, at several."""

    position: Array
    """(n_axes,) [m]."""
    tangent: Array
    """Unit vector."""
    bend: Array
    """κ N, the derivative of the tangent over arc length [1/m]; right-sided at joints."""
    piece: Count
    """Of the contour."""


class ProgressPath(eqx.Module):
    """A contour over arc length s from its start, 0 to ``length``; closed ones go round."""

    contour: Contour
    length: Array
    """[m]"""
    parameters: Array | None
    """The contour's parameter at equal arc lengths, (NODES + 1,); None if it is arc length."""
    slopes: Array | None
    """dp/ds there."""

    def parameter(self, progress: Scalar) -> Scalar:
        """Return the contour's own parameter.

        Parameters
        ----------
        progress
            s, within 0 .. length, for a closed contour any [m].
        """
        start, end = self.contour.domain
        if self.parameters is None:
            return start + progress
        turns = jnp.floor(progress / self.length) if self.contour.closed else 0.0
        share = (progress / self.length - turns) * NODES
        cell = jnp.clip(jnp.floor(jax.lax.stop_gradient(share)), 0, NODES - 1)
        at = cell.astype(jnp.int32)
        x, width = share - cell, self.length / NODES
        p, q = jnp.asarray(self.parameters)[at], jnp.asarray(self.parameters)[at + 1]
        assert self.slopes is not None
        m, n = width * jnp.asarray(self.slopes)[at], width * jnp.asarray(self.slopes)[at + 1]
        cubic = p + x * (m + x * (3.0 * (q - p) - 2.0 * m - n + x * (2.0 * (p - q) + m + n)))
        return cubic + turns * (end - start)

    def progress(self, parameter: Scalar) -> Scalar:
        """Return the arc length from the start of the contour to a parameter [m].

        Parameters
        ----------
        parameter
            The contour's own.
        """
        return self.contour.arc_length(self.contour.domain[0], parameter)

    def points(self, progress: Array, piece: Count) -> PathPoint:
        """Return the contour at several places in order.

        Parameters
        ----------
        progress
            Shape (n,), rising; beyond the ends of an open contour its end is taken [m].
        piece
            Where to start the search.
        """
        if not self.contour.closed:
            progress = jnp.clip(progress, 0.0, self.length)
        parameters = jax.vmap(self.parameter)(progress)

        def locate(piece: Any, parameter: Any) -> tuple[Any, Any]:
            found = self.contour.locate(parameter, piece)
            return found, found

        _, pieces = jax.lax.scan(locate, jnp.asarray(piece, jnp.int32), parameters)

        def point(parameter: Any, piece: Any) -> PathPoint:
            d = self.contour.derivatives(parameter, 2, piece)
            tangent = unit(d[1])
            square = d[1] @ d[1]
            bend = (d[2] - tangent * (tangent @ d[2])) / jnp.where(square == 0.0, 1.0, square)
            return PathPoint(d[0], tangent, bend, piece)

        return jax.vmap(point)(parameters, pieces)

    def end_point(self, progress: Scalar) -> AxisVector:
        """Return the point at one arc length, shape (n_axes,) [m].

        Parameters
        ----------
        progress
            s [m].
        """
        return self.contour.position(self.parameter(progress))


def progress_path(contour: Contour) -> ProgressPath:
    """Return a contour over arc length; traceable.

    Parameters
    ----------
    contour
        Any whose speed does not vanish.

    Raises
    ------
    RefusedError
        A contour whose speed varies so sharply that the table over arc length misses its end; not
        looked at while it is traced.
    """
    length = jnp.asarray(contour.length)
    if isinstance(contour, Path):
        return ProgressPath(contour, length, None, None)
    width = length / NODES

    def slope(parameter: Scalar) -> Array:
        d = contour.derivatives(parameter, 1)[1]
        return 1.0 / jnp.sqrt(jnp.maximum(d @ d, 1e-24 * length**2))

    def interval(p: Any, _: None) -> tuple[Any, Any]:
        k1 = slope(p)
        k2 = slope(p + 0.5 * width * k1)
        k3 = slope(p + 0.5 * width * k2)
        k4 = slope(p + width * k3)
        after = p + width / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return after, (p, k1)

    start = jnp.asarray(contour.domain[0], float)
    last, (parameters, slopes) = jax.lax.scan(interval, start, None, length=NODES)
    end = jnp.asarray(contour.domain[1], float)
    if is_concrete(last) and is_concrete(end):
        off = abs(float(last) - float(end))
        if not off <= CLOSURE * abs(float(end) - float(start)):
            raise RefusedError(
                f"the speed of {type(contour).__name__} over its parameter varies too sharply for "
                f"ModelPredictiveContouring: {NODES} equal steps of arc length miss its end by "
                f"{off:.3g} of a parameter range of {abs(float(end) - float(start)):.6g}; give it "
                "as a Path (Path.join)"
            )
    # the end is where the contour ends; what the steps missed is spread over the way
    stretch = (end - start) / (last - start)
    parameters = start + stretch * (jnp.append(parameters, last) - start)
    return ProgressPath(
        contour, length, parameters.at[-1].set(end), stretch * jnp.append(slopes, slope(last))
    )


def tangent_normals(tangent: AxisVector) -> Array:
    """Return unit vectors across a direction, shape (n_axes - 1, n_axes); in the plane the left.

    Parameters
    ----------
    tangent
        Unit vector of 2 or 3 coordinates.
    """
    if tangent.shape[0] == 2:
        return jnp.stack([-tangent[1], tangent[0]])[None]
    axis = jnp.asarray(np.eye(3))[jnp.argmin(jnp.abs(tangent))]
    first = unit(axis - tangent * (tangent @ axis))
    return jnp.stack([first, jnp.cross(tangent, first)])
