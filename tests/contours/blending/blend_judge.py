"""Paths to blend, and an independent judge of blends: dense sampling, never the library's own."""

import equinox as eqx
import jax
import numpy as np
from scipy.spatial import cKDTree

from contourlab.contours.joints import piece_ends
from contourlab.contours.path import Path


def random_path(rng, n, n_axes, kinds="lahb", size=1e-2, smooth=0.3):
    """Return lines, arcs, helices and Béziers end to end; some go on along the tangent."""
    start, tangent, parts = np.zeros(n_axes), None, []
    for _ in range(n):
        along = unit(rng.normal(size=n_axes))
        if tangent is not None and rng.random() < smooth:
            along = tangent
        part = one_piece(rng, rng.choice(list(kinds)), start, along, size)
        parts.append(part)
        point, tangent, _ = piece_ends(part, at_end=True)
        start, tangent = point[-1], tangent[-1]
    return Path.join(parts)


def one_piece(rng, kind, start, along, size):
    length = size * rng.uniform(0.2, 1.0)
    n_axes = len(along)
    zero = np.zeros(n_axes)
    if kind == "l":
        return Path.polyline([start, start + length * along])
    if kind == "b":
        bend = rng.normal(size=(2, n_axes)) * 0.3 * length
        points = [start, start + 0.4 * length * along, start + 0.6 * length * along + bend[0],
                  start + length * along + bend[1]]  # fmt: skip
        return Path.from_bezier([points], rng.uniform(0.5, 2.0, size=(1, 4)))
    side = rng.normal(size=n_axes)
    side = unit(side - along * (along @ side))
    radius = size * rng.uniform(0.1, 1.0)
    u, w = along, zero
    if kind == "h" and n_axes > 2:
        third = unit(np.cross(along[:3], side[:3])) if n_axes == 3 else zero
        cosine, sine = np.cos(0.4), np.sin(0.4)
        u, w = cosine * (cosine * along - sine * third), sine * (sine * along + cosine * third)
    v = side * np.linalg.norm(u)
    return Path.from_helical([start], [u], [v], [w], [1.0 / radius], [min(length, 5.0 * radius)])


def unit(vector):
    return vector / np.linalg.norm(vector)


def helical_moved(path, change):
    """Return a path of helical pieces with a linear change of points and directions."""
    factor = np.linalg.norm(change(np.eye(path.n_axes)[:1]))
    vectors = [
        change(np.asarray(part)) / factor
        for part in (path.tangent_vector, path.normal_vector, path.axial_vector)
    ]
    return Path.from_helical(
        change(np.asarray(path.origin)), *vectors, np.asarray(path.angle_rate) / factor,
        np.diff(path.breaks) * factor,
    )  # fmt: skip


def helical_reversed(path):
    """Return a path of helical pieces run the other way."""
    length, rate = np.diff(path.breaks), np.asarray(path.angle_rate)
    u, v, w = (
        np.asarray(part) for part in (path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    cosine, sine = np.cos(rate * length)[:, None], np.sin(rate * length)[:, None]
    end = piece_ends(path, at_end=True)[0]
    parts = (end, -(u * cosine + v * sine), v * cosine - u * sine, -w, rate, length)
    return Path.from_helical(*(part[::-1] for part in parts))


@jax.jit
def _many(path, parameters, pieces):
    return jax.vmap(lambda s, k: path.derivatives(s, 2, k))(parameters, pieces)


def derivatives(path, parameters, pieces):
    """Return points and two derivatives at parameters, each on a given piece."""
    chunk, found = 1 << 14, []  # one shape, so that each path compiles once
    for first in range(0, len(parameters), chunk):
        at = np.asarray(parameters)[first : first + chunk]
        piece = np.asarray(pieces, np.int32)[first : first + chunk]
        both = _many(padded(path), np.resize(at, chunk), np.resize(piece, chunk))
        found.append(np.asarray(both)[: len(at)])
    return np.concatenate(found)


def padded(path):
    """Return the path with spare rows, so that paths of similar size share compiled code."""
    rows = max(256, 1 << int(np.ceil(np.log2(path.n_pieces + 1))))
    curves = max(256, 1 << int(np.ceil(np.log2(len(path.control_points) + 1))))

    def stretched(values, count):
        values = np.asarray(values)
        pad = np.repeat(values[-1:], count - len(values), axis=0)
        return np.concatenate([values, pad]) if len(values) else values

    control, inverse = path.control_points, path.inverse_length
    spare = {
        name: stretched(getattr(path, name), rows)
        for name in ("origin", "tangent_vector", "normal_vector", "axial_vector", "angle_rate",
                     "bezier_row", "source_line")
    }  # fmt: skip
    spare["breaks"] = stretched(path.breaks, rows + 1)
    spare["control_points"] = stretched(control, curves)
    spare["inverse_length"] = stretched(inverse, curves)
    names = list(spare)
    return eqx.tree_at(
        lambda p: [getattr(p, name) for name in names], path, [spare[name] for name in names]
    )


def stretches(path, first, last, count):
    """Return points of several stretches of a path, shape (n, count, n_axes)."""
    at = first[:, None] + (last - first)[:, None] * np.linspace(0.0, 1.0, count)
    at = at.reshape(-1)
    breaks = np.asarray(path.breaks)
    piece = np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, path.n_pieces - 1)
    return derivatives(path, at, piece)[:, 0].reshape(len(first), count, -1)


def one_way(points, curve):
    """Return the greatest distance of points from a polyline."""
    _, nearest = cKDTree(curve).query(points)
    best = np.full(len(points), np.inf)
    for shift in (-1, 0):
        k = np.clip(nearest + shift, 0, len(curve) - 2)
        step = curve[k + 1] - curve[k]
        offset = points - curve[k]
        along = np.sum(offset * step, 1) / np.maximum(np.sum(step * step, 1), 1e-300)
        gap = offset - np.clip(along, 0, 1)[:, None] * step
        best = np.minimum(best, np.linalg.norm(gap, axis=1))
    return best.max()


def judged_deviations(path, blended, count=601):
    """Return the Hausdorff distance of each blend from what it replaces, by sampling."""
    breaks = np.asarray(path.breaks)
    corner = breaks[blended.joint + 1]
    before = stretches(path, corner - blended.trim[:, 0], corner, count)
    after = stretches(path, corner, corner + blended.trim[:, 1], count)
    new = np.asarray(blended.path.breaks)
    rows = [np.flatnonzero(blended.blend == k) for k in range(len(blended.joint))]
    first, last = new[[r[0] for r in rows]], new[[r[-1] + 1 for r in rows]]
    curve = stretches(blended.path, first, last, 2 * count)
    old = np.concatenate([before, after[:, 1:]], axis=1)
    both = [max(one_way(a, b), one_way(b, a)) for a, b in zip(curve, old, strict=True)]
    return np.array(both)


def two_sided(path, joints):
    """Return derivatives up to the second on both sides of joints, shape (n, 3, n_axes) each."""
    at = np.asarray(path.breaks)[joints + 1]
    return derivatives(path, at, joints), derivatives(path, at, joints + 1)


def peak_curvatures(path, first, last, count=201):
    """Return the greatest curvature on each of several stretches."""
    at = first[:, None] + (last - first)[:, None] * np.linspace(0.0, 1.0, count)
    at = at.reshape(-1)
    breaks = np.asarray(path.breaks)
    piece = np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, path.n_pieces - 1)
    bend = np.linalg.norm(derivatives(path, at, piece)[:, 2], axis=1)
    return bend.reshape(len(first), count).max(axis=1)
