"""Formula contours as paths: exactly where a path can hold them, else within a stated tolerance."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from contourlab.contours.base import Contour
from contourlab.contours.circle import TURN, Arc, Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

__all__ = ["path_from_contour"]

_FIRST = 16
"""Stretches to begin with."""
_DEEPEST = 24
"""Halvings of a first stretch."""
_MEASURED = (np.arange(32) + 0.5) / 32.0
"""Where on a stretch the distance is measured."""

Rows = np.ndarray[Any, Any]


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
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise GeometryError(f"tolerance must be > 0 m, got {tolerance}")
    if isinstance(contour, Path):
        return contour
    if isinstance(contour, Line):
        return Path.polyline(np.stack([contour.start, contour.end]))
    if isinstance(contour, Arc | Circle | Helix):
        return _round(contour)
    if isinstance(contour, Ellipse):
        return _quarters(contour)
    return _hermite(contour, tolerance)


def _round(contour: Arc | Circle | Helix) -> Path:
    """Return a curve of constant curvature and torsion as helical rows, one for each turn."""
    swept = float(contour.domain[1])
    start, slope, bend = np.asarray(contour.derivatives(0.0, 2))
    # a turn each, so that the angle within a piece keeps its digits and every piece is one turn
    count = max(1, int(np.ceil(swept / TURN - 1e-9)))
    climb = slope - _turned(contour, slope)
    origin = start + np.arange(count)[:, None] * TURN * climb
    angle = np.full(count, TURN)
    angle[-1] = swept - TURN * (count - 1)
    speed = float(np.linalg.norm(slope))
    across = (slope - climb) / speed
    inward = bend / np.linalg.norm(bend) * np.linalg.norm(across)
    return Path.from_helical(
        origin, *(np.tile(v, (count, 1)) for v in (across, inward, climb / speed)),
        np.full(count, 1.0 / speed), speed * angle, closed=contour.closed,
    )  # fmt: skip


def _turned(contour: Arc | Circle | Helix, slope: Rows) -> Rows:
    """Return the part of the first derivative that turns: all of it unless the curve climbs."""
    if not isinstance(contour, Helix):
        return slope
    return -np.asarray(contour.derivatives(0.0, 3))[3]


def _quarters(ellipse: Ellipse) -> Path:
    """Return an ellipse as four rational quadratic Bézier curves."""
    angles = 0.25 * TURN * np.arange(5)
    derivatives = np.asarray(jax.vmap(lambda angle: ellipse.derivatives(angle, 1))(angles))
    points, slopes = derivatives[:, 0], derivatives[:, 1]
    points[-1] = points[0]
    middle = points[:-1] + slopes[:-1]  # where the tangents at the ends of a quarter meet
    control = np.stack([points[:-1], middle, points[1:]], axis=1)
    weights = np.tile([1.0, np.sqrt(0.5), 1.0], (4, 1))
    return Path.from_bezier(control, weights, closed=True)


def _hermite(contour: Contour, tolerance: float) -> Path:
    start, end = (float(value) for value in contour.domain)
    if not (np.isfinite([start, end]).all() and end > start):
        raise GeometryError(f"the contour's domain must be finite, got {start:g} to {end:g}")
    sample = jax.jit(jax.vmap(lambda at: contour.derivatives(at, 2)))
    edges = np.linspace(start, end, _FIRST + 1)
    low, high = edges[:-1], edges[1:]
    kept: list[tuple[Rows, Rows]] = []
    for _ in range(_DEEPEST + 1):
        control = _quintic(_padded(sample, low), _padded(sample, high), (high - low)[:, None])
        places = low[:, None] + (high - low)[:, None] * _MEASURED
        exact = _padded(sample, places.reshape(-1))[:, 0].reshape(*places.shape, -1)
        if not np.isfinite(exact).all():
            at = places.reshape(-1)[np.argmin(np.isfinite(exact).all(axis=2).reshape(-1))]
            raise GeometryError(f"the contour is not finite at parameter {at:g}")
        distance = np.linalg.norm(_bernstein(_MEASURED, 5) @ control - exact, axis=2).max(axis=1)
        good = distance <= tolerance
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
    return Path.from_bezier(control, closed=contour.closed)


def _padded(sample: Any, parameters: Rows) -> Rows:
    """Return samples at any number of parameters, compiled for few lengths."""
    size = 1 << max(6, int(np.ceil(np.log2(len(parameters)))))
    padded = np.full(size, parameters[0])
    padded[: len(parameters)] = parameters
    return np.array(sample(jnp.asarray(padded)))[: len(parameters)]


def _quintic(first: Rows, last: Rows, step: Rows) -> Rows:
    """Return Bézier points that have the given point and two derivatives at both ends."""
    p0, v0, a0 = first[:, 0], first[:, 1] * step / 5.0, first[:, 2] * step**2 / 20.0
    p1, v1, a1 = last[:, 0], last[:, 1] * step / 5.0, last[:, 2] * step**2 / 20.0
    rows = [p0, p0 + v0, p0 + 2.0 * v0 + a0, p1 - 2.0 * v1 + a1, p1 - v1, p1]
    return np.stack(rows, axis=1)


def _bernstein(u: Rows, degree: int) -> Rows:
    """Return the values of the Bernstein polynomials, shape (n_u, degree + 1)."""
    from math import comb

    k = np.arange(degree + 1)
    binomial = np.array([comb(degree, i) for i in k], float)
    return binomial * u[:, None] ** k * (1.0 - u[:, None]) ** (degree - k)  # type: ignore[no-any-return]
