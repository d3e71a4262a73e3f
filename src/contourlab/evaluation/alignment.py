"""A log laid on a part: the rigid motion between them, and how well they match.

The commanded positions differ from the part by the work offset and by how the part was clamped, so
it is they that are laid on it, by rotation and shift, with as little distance as possible: iterated
closest points, at first whole distances, then only across the path, so that points may slide along
it. The quarter that lies farthest, such as an approach, does not pull. What the machine
does wrong is not touched by that. Only a log without commands is aligned by its actual positions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.ndimage import median_filter

from contourlab.contours import Path, foot_point
from contourlab.errors import LogError
from contourlab.evaluation.judge import tangents

__all__ = ["Alignment", "align", "follow"]

SCREENED, REFINED = 240, 2000
"""Points by which placements are compared, and the best one refined."""
KEPT = 0.75
"""Share of the points that pull."""
NOT_FAST = 4.0
"""Times the usual step: what moves faster counts as a rapid, and does not pull."""
MATCHING = 0.01
"""Share of the extent by which middles must differ to be tried both."""
SLIDES = 12
"""Steps of the refinement, at most."""
WINDOW = 101
"""Samples over which the place on the part is taken to move with the commands."""

Values = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Alignment:
    """From machine to part: part = rotation · machine + shift."""

    rotation: Values
    shift: Values
    """[m]"""
    fitted: bool
    """Whether it was fitted; else the log was taken as it stands."""
    median: float
    """Median distance of the commanded positions from the part [m]."""
    rms: float
    """Root mean square of those that are on the part [m]."""
    largest: float
    """Largest distance of all [m]."""
    on_part: float = 1.0
    """Share of the moving samples that are on the part."""
    covered: float = 1.0
    """Share of the part's length that the log runs along."""

    @property
    def angle(self) -> float:
        """Angle of the rotation, in the plane with its sign [rad]."""
        if len(self.shift) == 2:
            return float(np.arctan2(self.rotation[1, 0], self.rotation[0, 0]))
        return float(np.arccos(np.clip((np.trace(self.rotation) - 1.0) / 2.0, -1.0, 1.0)))

    def to_part(self, points: Values) -> Values:
        """Return points in the part's coordinates.

        Parameters
        ----------
        points
            In the machine's, shape (n, n_axes) [m].
        """
        return points @ self.rotation.T + self.shift

    def to_machine(self, vectors: Values) -> Values:
        """Return vectors in the machine's directions.

        Parameters
        ----------
        vectors
            In the part's, shape (n, n_axes).
        """
        return vectors @ self.rotation


def align(path: Path, points: Values, *, fit: bool, cuts: Values | None = None) -> Alignment:
    """Return how a log lies on a part.

    Parameters
    ----------
    path
        The part.
    points
        Commanded positions that move, in order, shape (n, n_axes) [m].
    fit
        Whether a rotation and a shift are fitted.
    cuts
        Which pieces of the part are no rapids; all of them if None.

    Raises
    ------
    LogError
        The log has another number of axes than the part.
    """
    n_axes = points.shape[1]
    if path.n_axes != n_axes:
        raise LogError(f"the part has {path.n_axes} coordinates and the log {n_axes} axes")
    best = (np.eye(n_axes), np.zeros(n_axes))
    if fit:
        slow = _slow(points)
        few = _spread(slow, SCREENED)
        starts = _starts(path, points, cuts)
        tried = [_closest(path, few, *start, turns=6) for start in starts]
        costs = [_cost(path, few, *place) for place in tried]
        best = tried[int(np.argmin(costs))]
        many = _spread(slow, REFINED)
        best = _slid(path, many, *_closest(path, many, *best, turns=4))
    placed = points @ best[0].T + best[1]
    away = np.abs(np.asarray(foot_point(path, _spread(placed, 5 * REFINED)).distance))
    inside = away <= np.quantile(away, KEPT)
    return Alignment(
        best[0], best[1], fit, float(np.median(away)),
        float(np.sqrt(np.mean(away[inside] ** 2))), float(away.max()),
    )  # fmt: skip


def _spread(points: Values, count: int) -> Values:
    """Return points spread evenly over the length of a motion."""
    if len(points) <= count:
        return points
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    rows = np.searchsorted(at, np.linspace(0.0, at[-1], count))
    spread: Values = points[np.unique(np.minimum(rows, len(points) - 1))]
    return spread


def _starts(path: Path, points: Values, cuts: Values | None) -> list[tuple[Values, Values]]:
    """Return placements to begin with: as it stands, and middle on middle in four turns.

    An approach is in the part, in the log, in both or in neither: so the middles are those of all,
    and those of what is cut, or is not fast.
    """
    n_axes = points.shape[1]
    shape, piece = _samples(path)
    cut = shape if cuts is None else shape[cuts[np.minimum(piece, len(cuts) - 1)]]
    slow = _slow(points)
    extent = float(np.ptp(shape, axis=0).max())
    starts = [(np.eye(n_axes), np.zeros(n_axes))]
    for own in _middles((points, slow), extent):
        for middle in _middles((shape, cut), extent):
            for quarter in range(4):
                turn = np.eye(n_axes)
                c, s = round(np.cos(quarter * np.pi / 2)), round(np.sin(quarter * np.pi / 2))
                turn[:2, :2] = [[c, -s], [s, c]]
                starts.append((turn, middle - turn @ own))
    return starts


def _slow(points: Values) -> Values:
    """Return the points of a motion without its rapids, more likely than not."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    step = np.concatenate([step[:1], step])
    return np.asarray(points[step <= NOT_FAST * np.median(step)])


def _middles(sets: tuple[Values, ...], extent: float) -> list[Values]:
    """Return the middles of sets of points, those once that are nearly the same."""
    found: list[Values] = []
    for points in sets:
        if not len(points):
            continue
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        if all(np.linalg.norm(middle - one) > MATCHING * extent for one in found):
            found.append(middle)
    return found


def _samples(path: Path) -> tuple[Values, Values]:
    """Return points of a path, and the piece of each."""
    import jax
    import jax.numpy as jnp

    s = jnp.linspace(0.0, float(path.length), 512)
    piece = np.searchsorted(np.asarray(path.breaks), np.asarray(s), side="right") - 1
    points = np.asarray(jax.jit(jax.vmap(path.position))(s))
    return points, np.clip(piece, 0, len(path.breaks) - 2)


def _closest(
    path: Path, points: Values, rotation: Values, shift: Values, *, turns: int
) -> tuple[Values, Values]:
    for _ in range(turns):
        placed = points @ rotation.T + shift
        feet = foot_point(path, placed)
        away = np.abs(np.asarray(feet.distance))
        near = away <= np.quantile(away, KEPT)
        rotation, shift = _rigid(points[near], np.asarray(feet.position)[near])
    return rotation, shift


def _slid(path: Path, points: Values, rotation: Values, shift: Values) -> tuple[Values, Values]:
    """Refine a placement by Gauss and Newton's method on the distances across the path."""
    n_axes = points.shape[1]
    turns = [(0, 1)] if n_axes == 2 else [(0, 1), (0, 2), (1, 2)]
    for _ in range(SLIDES):
        placed = points @ rotation.T + shift
        feet = foot_point(path, placed)
        away = np.abs(np.asarray(feet.distance))
        near = away <= np.quantile(away, KEPT)
        p, vector = placed[near], np.asarray(feet.vector)[near]
        tangent = tangents(path, np.asarray(feet.parameter)[near])[1]
        middle = p.mean(axis=0)
        columns = [np.broadcast_to(np.eye(n_axes)[k], p.shape) for k in range(n_axes)]
        for i, j in turns:
            column = np.zeros_like(p)
            column[:, i], column[:, j] = -(p - middle)[:, j], (p - middle)[:, i]
            columns.append(column)

        def across(v: Values, tangent: Values = tangent) -> Values:
            along = np.einsum("ij,ij->i", v, tangent)
            rest: Values = v - along[:, None] * tangent
            return rest.ravel()

        matrix = np.column_stack([across(column) for column in columns])
        # what cannot be told, such as a shift along a line, stays
        step = np.linalg.lstsq(matrix, across(vector), rcond=1e-6)[0]
        small = np.zeros((n_axes, n_axes))
        for (i, j), angle in zip(turns, step[n_axes:], strict=True):
            small[j, i], small[i, j] = angle, -angle
        turn = expm(small)
        shift = turn @ (shift - middle) + middle + step[:n_axes]
        rotation = turn @ rotation
        if np.abs(step).max() < 1e-13:
            break
    return rotation, shift


def _rigid(points: Values, wanted: Values) -> tuple[Values, Values]:
    """Return the rotation and shift that lay points on others with the least squares."""
    a, b = points.mean(axis=0), wanted.mean(axis=0)
    u, _, v = np.linalg.svd((wanted - b).T @ (points - a))
    sign = np.ones(len(a))
    sign[-1] = np.sign(np.linalg.det(u @ v))
    rotation = (u * sign) @ v
    return rotation, b - rotation @ a


def _cost(path: Path, points: Values, rotation: Values, shift: Values) -> float:
    away = np.abs(np.asarray(foot_point(path, points @ rotation.T + shift).distance))
    return float(np.quantile(away, KEPT))


def follow(path: Path, points: Values) -> tuple[Values, Values]:
    """Return where on a part each sample of a motion is, and how far from it.

    The nearest point of the whole part may lie on another stretch, where the part crosses itself or
    runs beside itself. So the place is taken to move as far as the motion does, and the difference
    between the two is smoothed by a median.

    Parameters
    ----------
    path
        The part.
    points
        In the part's coordinates, in order, shape (n, n_axes) [m].
    """
    length = float(path.length)
    feet = foot_point(path, points)
    place, away = np.asarray(feet.parameter), np.abs(np.asarray(feet.distance))
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    forward = float(np.median(np.abs(np.diff(_wrapped(place - run, path, length)))))
    backward = float(np.median(np.abs(np.diff(_wrapped(place + run, path, length)))))
    sign = 1.0 if forward <= backward else -1.0
    drift = place - sign * run
    if path.closed:
        drift = np.unwrap(drift, period=length)
    size = min(WINDOW, 2 * (len(drift) // 2) - 1)
    if size >= 3:
        drift = median_filter(drift, size=size, mode="nearest")
    near = sign * run + drift
    if not path.closed:
        near = np.clip(near, 0.0, length)
    local = foot_point(path, points, near=near)
    own = np.abs(np.asarray(local.distance))
    # where the motion left the part and came back elsewhere, the nearest point counts
    lost = own > 2.0 * away + 1e-9
    place = np.where(lost, place, np.asarray(local.parameter))
    return place, np.where(lost, away, own)


def _wrapped(values: Values, path: Path, length: float) -> Values:
    return np.unwrap(values, period=length) if path.closed else values
