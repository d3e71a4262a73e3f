"""The motion on which estimators are judged: a point that lags behind, beside the contour.

At the arc length s of the reference the actual point is

    P = r(s - lag) + offset (N + B)

with N and B the frame's normal and binormal at s - lag; in the plane N is the left normal, and
there is no B. As long as the offset is less than the radius of curvature, r(s - lag) is the local
foot point, and the contour error is the offset (in space √2 times it); the judge does not rely on
that. Lag and feed are constant, along the contour itself and not along its parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.errors import GeometryError
from contourlab.feedrate.arc_length import (
    ArcLength,
    arc_derivatives,
    contour_derivatives,
    parameter_derivatives,
)
from contourlab.recordings.reference import ReferencePoint
from contourlab.typing import Array

__all__ = ["Motion", "Track", "lagging_motion", "padded_rows", "places", "stream"]

Values = NDArray[Any]

_CHUNKS = (256, 2048, 16384)
_TABLED_ORDER = 4
"""Of ``contour_derivatives``."""


class Track(NamedTuple):
    """Where the reference is, and which of its rows are judged."""

    arc: Values
    """Arc length from the start of the contour, shape (n,) [m]."""
    judged: NDArray[np.intp]
    """Numbers of rows."""


class Motion(NamedTuple):
    """Reference and actual points, one row per sample; one lane per offset."""

    reference: ReferencePoint
    """Rows in front."""
    geometry: Values
    """Contour derivatives at the reference, shape (n, order + 1, n_axes)."""
    time: Values
    """Shape (n,) [s]."""
    position: Values
    """Actual points, shape (n_offsets, n, n_axes) [m]."""
    velocity: Values
    """Their velocities, likewise [m/s]."""

    @property
    def n_rows(self) -> int:
        """Count of samples."""
        return len(self.time)

    def measured(self, resolution: Values) -> tuple[Values, Values]:
        """Return measured positions and velocities, shape (n_lanes, n, n_axes) each.

        One lane per offset and resolution, the latter in turn within the former. A coordinate is
        rounded to multiples of the resolution, 0 being exact; the velocity is the true one.

        Parameters
        ----------
        resolution
            Shape (n_resolutions,) [m].
        """
        step = resolution[None, :, None, None]
        true = np.repeat(self.position[:, None], len(resolution), axis=1)
        size = np.where(step > 0.0, step, 1.0)
        position = np.where(step > 0.0, np.round(true / size) * size, true)
        velocity = np.repeat(self.velocity[:, None], len(resolution), axis=1)
        lanes = (-1, *self.position.shape[1:])
        return position.reshape(lanes), velocity.reshape(lanes)


def places(table: ArcLength, lag: float, points: int) -> Track:
    """Return places that are evenly spread over a contour, all of them judged.

    On an open contour the first is ``lag`` behind the start, so that the actual point is on the
    contour, and the last is the end.

    Parameters
    ----------
    table
        Of the contour.
    lag
        [m], less than its length.
    points
        How many.
    """
    if table.contour.closed:
        arc = np.arange(points) * (table.length / points)
    else:
        arc = np.linspace(lag, table.length, points)
    return Track(arc, np.arange(points))


def stream(table: ArcLength, lag: float, points: int, step: float, n_before: int) -> Track | None:
    """Return every sample of a motion along a contour; those nearest to the places are judged.

    Parameters
    ----------
    table
        Of the contour.
    lag
        [m], less than its length.
    points
        How many places.
    step
        Arc length from sample to sample [m].
    n_before
        Samples that are not judged: they come before the lap on a closed contour, and are the first
        ones on an open contour.

    Returns
    -------
    Track or None
        None if an open contour ends before the first judged sample.
    """
    if table.contour.closed:
        n = max(1, int(np.ceil(table.length / step * (1.0 - 1e-12))))
        arc = step * np.arange(-n_before, n)
        wanted = np.arange(points) * (table.length / points)
    else:
        n = int(np.floor((table.length - lag) / step * (1.0 + 1e-12))) + 1 - n_before
        if n < 1:
            return None
        arc = np.minimum(lag + step * np.arange(n_before + n), table.length)
        wanted = np.linspace(0.0, step * (n - 1), points)
    rows = np.clip(np.round(wanted / step).astype(np.intp), 0, n - 1)
    return Track(arc, n_before + np.unique(rows))


def lagging_motion(
    table: ArcLength,
    arc: Values,
    lag: float,
    offsets: Values,
    feed: float,
    sample_time: float,
    order: int,
) -> Motion:
    """Return the motion of a reference and of a point that lags behind it.

    Parameters
    ----------
    table
        Of the contour.
    arc
        Of the reference, one per sample, shape (n,) [m].
    lag
        [m].
    offsets
        Shape (n_offsets,) [m].
    feed
        Of both [m/s].
    sample_time
        [s].
    order
        Highest derivative in ``geometry``.

    Raises
    ------
    GeometryError
        An offset from a contour that has no normal: of neither 2 nor 3 coordinates.
    """
    contour = table.contour
    parameter = table.parameter_at(arc)
    rows = contour_derivatives(contour, parameter)
    p1, p2, _, _ = parameter_derivatives(rows).T
    d1, d2, d3, _ = np.moveaxis(arc_derivatives(rows), 1, 0)
    reference = ReferencePoint(
        parameter, p1 * feed, p2 * feed**2, rows[:, 0], d1 * feed, d2 * feed**2, d3 * feed**3
    )
    geometry = rows[:, : order + 1]
    if order > _TABLED_ORDER:
        geometry = padded_rows(lambda p: _derivatives(contour, p, order), parameter)
    behind = table.parameter_at(arc - lag)
    foot = contour_derivatives(contour, behind)
    position = np.repeat(foot[None, :, 0], len(offsets), axis=0)
    velocity = feed * np.repeat(arc_derivatives(foot)[None, :, 0], len(offsets), axis=0)
    if np.any(offsets != 0.0):
        if contour.n_axes not in (2, 3):
            raise GeometryError(
                f"an offset needs a contour of 2 or 3 coordinates, this one has {contour.n_axes}: "
                "set the offset to 0"
            )
        aside, drift = padded_rows(lambda p: _beside(contour, p), behind)
        position = position + offsets[:, None, None] * aside
        velocity = velocity + feed * offsets[:, None, None] * drift
    return Motion(reference, geometry, sample_time * np.arange(len(arc)), position, velocity)


def padded_rows(function: Callable[[Array], Any], column: Values) -> Any:
    """Evaluate rows in blocks of few different sizes, so that little is compiled.

    Parameters
    ----------
    function
        From one column to arrays with a row for each of its entries.
    column
        Shape (n,).
    """
    n = len(column)
    size = next((size for size in _CHUNKS if n <= size), _CHUNKS[-1])
    blocks = []
    for start in range(0, n, size):
        block = column[start : start + size]
        count = len(block)
        found = function(np.pad(block, (0, size - count), mode="edge"))
        blocks.append(jax.tree.map(lambda x, k=count: np.asarray(x)[:k], found))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *blocks)


@partial(jax.jit, static_argnums=2)
def _derivatives(contour: Contour, parameter: Array, order: int) -> Array:
    return jax.vmap(lambda p: contour.derivatives(p, order))(parameter)


@jax.jit
def _beside(contour: Contour, parameter: Array) -> tuple[Array, Array]:
    """Return N + B and its derivative over arc length: -κ T, and in space τ (B - N) beside."""

    def one(p: Array) -> tuple[Array, Array]:
        frame = contour.frenet(p)
        aside, drift = frame.normal, -frame.curvature * frame.tangent
        if contour.n_axes == 3:
            aside = aside + frame.binormal
            drift = drift + frame.torsion * (frame.binormal - frame.normal)
        return aside, drift

    return jax.vmap(one)(jnp.asarray(parameter))
