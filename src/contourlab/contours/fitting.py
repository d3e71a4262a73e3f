"""Formula contours as paths: exactly where a path can hold them, else within a stated tolerance."""

from __future__ import annotations

from functools import partial
from math import comb
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from contourlab.contours.base import Contour
from contourlab.contours.circle import TURN, Arc, Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.parabola import Parabola
from contourlab.contours.path import Path
from contourlab.contours.spline import Spline
from contourlab.contours.transformed_path import similar_path
from contourlab.contours.wrapped import Reversed, Transformed
from contourlab.errors import GeometryError
from contourlab.typing import Array

__all__ = ["enters_exactly", "fitted_path", "path_from_contour"]

_FIRST = 16
"""Stretches to begin with."""
_DEEPEST = 24
"""Halvings of a first stretch."""
_MEASURED = (np.arange(32) + 0.5) / 32.0
"""Where on a stretch the distance is measured."""

Rows = NDArray[Any]


def path_from_contour(contour: Contour, tolerance: float) -> Path:
    """Return a contour as a path; see :meth:`Path.from_contour`.

    Parameters
    ----------
    contour
        What to follow.
    tolerance
        Greatest distance between the path and the contour, > 0 [m].

    Raises
    ------
    GeometryError
        A tolerance that is not > 0 or that cannot be met; a contour that stands still.
    """
    return fitted_path(contour, tolerance)[0]


def enters_exactly(contour: Contour) -> bool:
    """Return whether a path can hold a contour to rounding.

    Parameters
    ----------
    contour
        Any.
    """
    if isinstance(contour, Reversed) or (isinstance(contour, Transformed) and contour.similarity):
        return enters_exactly(contour.inner)
    return isinstance(contour, Path | Line | Arc | Circle | Helix | Ellipse | Parabola | Spline)


def fitted_path(contour: Contour, tolerance: float) -> tuple[Path, float]:
    """Return a contour as a path, and how far the path leaves it [m].

    Parameters
    ----------
    contour
        What to follow.
    tolerance
        Greatest distance between the path and the contour, > 0 [m].

    Returns
    -------
    path, reached
        The path, and the greatest distance that was measured; 0 where it is exact.

    Raises
    ------
    GeometryError
        A tolerance that is not > 0 or that cannot be met; a contour that stands still.
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise GeometryError(f"tolerance must be > 0 m, got {tolerance}")
    if isinstance(contour, Path):
        return contour, 0.0
    if isinstance(contour, Line):
        return Path.polyline(np.stack([contour.start, contour.end])), 0.0
    if isinstance(contour, Arc | Circle | Helix):
        return _round(contour), 0.0
    if isinstance(contour, Ellipse):
        return _quarters(contour), 0.0
    if isinstance(contour, Parabola):
        return _one_quadratic(contour), 0.0
    if isinstance(contour, Spline):
        return contour.to_path(), 0.0
    if isinstance(contour, Reversed):
        path, reached = fitted_path(contour.inner, tolerance)
        return cast(Path, path.reversed()), reached
    if isinstance(contour, Transformed) and contour.similarity:
        matrix = np.asarray(contour.matrix)
        factor = float(np.linalg.norm(matrix, 2))
        inner, reached = fitted_path(contour.inner, tolerance / factor)
        return similar_path(inner, matrix, np.asarray(contour.offset), factor), factor * reached
    return _hermite(contour, tolerance)


def _round(contour: Arc | Circle | Helix) -> Path:
    """Return a curve of constant curvature and torsion as helical rows, one for each turn."""
    start, slope, bend, third = _sampled(contour, np.zeros(1), 3)[0]
    swept = float(contour.domain[1])
    speed = float(np.linalg.norm(slope))
    turning = -third  # over the angle, what turns of the first derivative is minus the third
    climb = slope - turning if isinstance(contour, Helix) else 0.0 * slope
    # a turn each, so that the angle within a piece keeps its digits
    count = max(1, int(np.ceil(swept / TURN - 1e-9)))
    angle = np.full(count, TURN)
    angle[-1] = swept - TURN * (count - 1)
    across, axial = (slope - climb) / speed, climb / speed
    inward = bend / np.linalg.norm(bend) * np.linalg.norm(across)
    return Path.from_helical(
        start + np.arange(count)[:, None] * TURN * climb,
        np.tile(across, (count, 1)),
        np.tile(inward, (count, 1)),
        np.tile(axial, (count, 1)),
        np.full(count, 1.0 / speed),
        speed * angle,
        closed=contour.closed,
    )


def _quarters(ellipse: Ellipse) -> Path:
    """Return an ellipse as four rational quadratic Bézier curves."""
    derivatives = _sampled(ellipse, 0.25 * TURN * np.arange(5), 1)
    points, slopes = derivatives[:, 0], derivatives[:, 1]
    points[-1] = points[0]
    middle = points[:-1] + slopes[:-1]  # where the tangents at the ends of a quarter meet
    control = np.stack([points[:-1], middle, points[1:]], axis=1)
    weights = np.tile([1.0, np.sqrt(0.5), 1.0], (4, 1))
    return Path.from_bezier(control, weights, closed=True)


def _one_quadratic(parabola: Parabola) -> Path:
    """Return a parabola as one quadratic Bézier curve."""
    half = float(parabola.half_width)
    first, last = _sampled(parabola, np.array([-half, half]), 1)
    middle = first[0] + half * first[1]  # where the tangents at the two ends meet
    return Path.from_bezier(np.stack([first[0], middle, last[0]])[None])


def _hermite(contour: Contour, tolerance: float) -> tuple[Path, float]:
    start, end = (float(value) for value in contour.domain)
    if not (np.isfinite([start, end]).all() and end > start):
        raise GeometryError(f"the contour's domain must be finite, got {start:g} to {end:g}")
    edges = np.linspace(start, end, _FIRST + 1)
    low, high = edges[:-1], edges[1:]
    kept: list[tuple[Rows, Rows]] = []
    reached = 0.0
    for _ in range(_DEEPEST + 1):
        control = _quintic(
            _sampled(contour, low, 2), _sampled(contour, high, 2), (high - low)[:, None]
        )
        places = low[:, None] + (high - low)[:, None] * _MEASURED
        exact = _sampled(contour, places.reshape(-1), 0)[:, 0].reshape(*places.shape, -1)
        if not np.isfinite(exact).all():
            at = places.reshape(-1)[np.argmin(np.isfinite(exact).all(axis=2).reshape(-1))]
            raise GeometryError(f"the contour is not finite at parameter {at:g}")
        distance = np.linalg.norm(_bernstein(_MEASURED, 5) @ control - exact, axis=2).max(axis=1)
        good = distance <= tolerance
        reached = max(reached, float(distance[good].max(initial=0.0)))
        kept.append((low[good], control[good]))
        low, high = low[~good], high[~good]
        if len(low) == 0:
            break
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    else:
        raise GeometryError(
            f"the contour cannot be followed within {tolerance:g} m near parameter {low.min():g} "
            f"(the distance stays {distance.max():.3g} m): it is not smooth there, or the "
            "tolerance is below rounding"
        )
    low, control = (np.concatenate(part) for part in zip(*kept, strict=True))
    control = control[np.argsort(low)]
    control[1:, 0] = control[:-1, -1]
    if contour.closed:
        control[-1, -1] = control[0, 0]
    return Path.from_bezier(control, closed=contour.closed), reached


def _sampled(contour: Contour, parameters: Rows, order: int) -> Rows:
    """Return derivatives at any number of parameters, compiled for few lengths."""
    size = 1 << int(np.ceil(np.log2(len(parameters))))
    padded = np.full(size, parameters[0])
    padded[: len(parameters)] = parameters
    return np.array(_derivatives(contour, jnp.asarray(padded), order))[: len(parameters)]


@partial(jax.jit, static_argnums=2)
def _derivatives(contour: Contour, parameters: Array, order: int) -> Array:
    return jax.vmap(lambda at: contour.derivatives(at, order))(parameters)


def _quintic(first: Rows, last: Rows, step: Rows) -> Rows:
    """Return Bézier points that have the given point and two derivatives at both ends."""
    p0, v0, a0 = first[:, 0], first[:, 1] * step / 5.0, first[:, 2] * step**2 / 20.0
    p1, v1, a1 = last[:, 0], last[:, 1] * step / 5.0, last[:, 2] * step**2 / 20.0
    rows = [p0, p0 + v0, p0 + 2.0 * v0 + a0, p1 - 2.0 * v1 + a1, p1 - v1, p1]
    return np.stack(rows, axis=1)


def _bernstein(u: Rows, degree: int) -> Rows:
    """Return the values of the Bernstein polynomials, shape (n_u, degree + 1)."""
    k = np.arange(degree + 1)
    binomial = np.array([comb(degree, i) for i in k], float)
    return binomial * u[:, None] ** k * (1.0 - u[:, None]) ** (degree - k)
