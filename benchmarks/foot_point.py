"""Exact contour error of a million points, against shapely and a k-d tree at equal accuracy.

    python benchmarks/foot_point.py [--points N] [--pieces N] [--json]

Three contours: an ellipse of 30 by 10 mm, a spiral of lines of 0.05 to 1 mm (100 000 pieces, 2 mm
from turn to turn), and a cubic NURBS of 12 control points, 60 mm across. Points lie 1 µm to 0.1 mm
(spiral, log-uniform) or 50 µm (ellipse and NURBS, normal) off the contour. The first call, on
70 000 points, compiles and is not timed. Errors are against closed forms in NumPy: on the spiral
the distance to the neighbouring lines, on the ellipse Newton's method run to rounding; on the NURBS
against golden sections between 20 001 samples, for 1000 points.

shapely measures to a polyline: exact on the part; on the ellipse the polyline has as many points as
keep its sagitta at 1 nm. ``distance`` to the whole part looks at every piece, so it is timed on few
points; STRtree finds the nearest piece. The k-d tree samples the same polyline and refines on the
pieces next to the nearest sample, so its accuracy is the polyline's. On the NURBS, splinepy's
``proximities`` start from the nearest of 2000 samples, as does SciPy's bounded minimiser, which
takes one point after the other and so is timed on few.
"""

from __future__ import annotations

import argparse
import json
import resource
import time

import numpy as np
import shapely
import splinepy
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

import contourlab  # noqa: F401  (float64)
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.foot_points import foot_point
from contourlab.contours.path import Path

NANOMETRE = 1e-9


def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def clocked(work, n):
    before, wall, cpu = memory(), time.perf_counter(), time.process_time()
    result = work()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return result, {
        "points_per_s": n / wall,
        "points_per_cpu_s": n / cpu,
        "seconds": wall,
        "memory_added_mib": memory() - before,
    }


def ours(contour, points, near):
    rows = []
    for name, given in (("contourlab local", near), ("contourlab global", None)):
        few = None if given is None else given[:70_000]
        _, first = clocked(lambda few=few: foot_point(contour, points[:70_000], few), 1)
        foot, row = clocked(lambda given=given: foot_point(contour, points, given), len(points))
        row["first_call_s"] = first["seconds"]
        rows.append((name, np.linalg.norm(foot.vector, axis=1), row))
    return rows


def segment_distance(points, a, b):
    along = b - a
    t = np.clip(np.sum((points - a) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    return np.linalg.norm(points - a - t[:, None] * along, axis=1)


def refined_tree(vertices, points, spacing):
    """Sample a polyline, and refine on the pieces next to the nearest sample."""
    a, b = vertices[:-1], vertices[1:]
    many = np.maximum(np.ceil(np.linalg.norm(b - a, axis=1) / spacing), 1).astype(int)
    piece = np.repeat(np.arange(len(a)), many)
    place = (np.arange(len(piece)) - np.repeat(np.cumsum(many) - many, many)) / many[piece]
    tree = cKDTree(a[piece] + place[:, None] * (b - a)[piece])
    _, nearest = tree.query(points, workers=-1)
    best = np.full(len(points), np.inf)
    for shift in (-1, 0, 1):
        at = (piece[nearest] + shift) % len(a)
        best = np.minimum(best, segment_distance(points, a[at], b[at]))
    return best


def others(vertices, points, spacing):
    line = shapely.LineString(vertices)
    shapely.prepare(line)
    few = points[:: max(len(points) // 1000, 1)]
    result, row = clocked(lambda: shapely.distance(line, shapely.points(few)), len(few))
    yield f"shapely distance ({len(few)} points)", result, row, len(few)

    def by_tree():
        pieces = shapely.linestrings(np.stack([vertices[:-1], vertices[1:]], axis=1))
        (_, _), distance = shapely.STRtree(pieces).query_nearest(
            shapely.points(points), return_distance=True, all_matches=False
        )
        return distance

    result, row = clocked(by_tree, len(points))
    yield "shapely STRtree", result, row, len(points)
    result, row = clocked(lambda: refined_tree(vertices, points, spacing), len(points))
    yield "k-d tree, refined", result, row, len(points)


def ellipse_case(n, rng):
    a, b = 0.03, 0.01
    near = np.linspace(0, 2 * np.pi, n)
    points = np.stack([a * np.cos(near), b * np.sin(near)], axis=1)
    points = points + 5e-5 * rng.normal(size=(n, 2))
    angle = near.copy()
    for _ in range(30):  # Newton's method on the eccentric angle, to rounding
        x, y = a * np.cos(angle), b * np.sin(angle)
        dx, dy = x - points[:, 0], y - points[:, 1]
        tx, ty = -a * np.sin(angle), b * np.cos(angle)
        angle = angle - (dx * tx + dy * ty) / (tx**2 + ty**2 - dx * x - dy * y)
    truth = np.hypot(a * np.cos(angle) - points[:, 0], b * np.sin(angle) - points[:, 1])
    # sagitta = radius of curvature * step^2 / 8, at most a: 1 nm
    turn = np.linspace(0, 2 * np.pi, int(2 * np.pi / np.sqrt(8 * NANOMETRE / a)) + 1)
    vertices = np.stack([a * np.cos(turn), b * np.sin(turn)], axis=1)
    return Ellipse(semi_axes=(a, b)), vertices, points, near, truth, 1e-5


def part_case(n, pieces, rng):
    length = rng.uniform(5e-5, 1e-3, pieces)
    along, pitch = np.concatenate([[0.0], np.cumsum(length)]), 2e-3
    radius = np.sqrt(0.02**2 + along * pitch / np.pi)  # a turn adds the pitch
    angle = (radius - 0.02) * 2 * np.pi / pitch
    vertices = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    path = Path.polyline(vertices)
    near = np.linspace(0, float(path.length), n)
    on = np.stack([np.interp(near, path.breaks, vertices[:, k]) for k in (0, 1)], axis=1)
    direction = rng.uniform(0, 2 * np.pi, n)
    error = 10 ** rng.uniform(-6, -4, n)
    points = on + error[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    # pieces are 0.05 mm or longer, errors 0.1 mm at most: 6 neighbours either way hold the foot
    own = np.clip(np.searchsorted(path.breaks, near, side="right") - 1, 0, pieces - 1)
    truth = np.full(n, np.inf)
    for shift in range(-6, 7):
        at = np.clip(own + shift, 0, pieces - 1)
        truth = np.minimum(truth, segment_distance(points, vertices[at], vertices[at + 1]))
    return path, vertices, points, near, truth, 1e-4


def nurbs_case(n, rng):
    degree, count = 3, 12
    control = np.stack([np.linspace(0, 0.06, count), 0.01 * rng.normal(size=count)], axis=1)
    weights = rng.uniform(0.5, 2.0, count)
    inner = np.linspace(0, 1, count - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    homogeneous = np.concatenate([control * weights[:, None], weights[:, None]], axis=1)
    spline = BSpline(knots, homogeneous, degree)

    def curve(t):
        value = spline(t)
        return value[:, :-1] / value[:, -1:]

    rival = splinepy.NURBS([degree], [knots], control, weights[:, None])
    spans = list(rival.extract.beziers())
    path = Path.from_bezier(
        np.array([span.control_points for span in spans]),
        np.array([span.weights[:, 0] for span in spans]),
    )
    t = np.linspace(0, 1, n)
    on = curve(t)
    points = on + 5e-5 * rng.normal(size=(n, 2))
    fine = np.linspace(0, 1, 200_001)
    travelled = np.cumsum(np.linalg.norm(np.diff(curve(fine), axis=0), axis=1))
    near = np.interp(t, fine, np.concatenate([[0.0], travelled]))
    few = points[:: max(n // 1000, 1)]
    return path, (curve, rival), points, near, golden(curve, few), None


def golden(curve, points):
    """Return distances by golden sections about the nearest of many samples."""
    t = np.linspace(0, 1, 20_001)
    nearest = cKDTree(curve(t)).query(points)[1]
    a, b = t[np.maximum(nearest - 1, 0)], t[np.minimum(nearest + 1, len(t) - 1)]
    ratio = (np.sqrt(5) - 1) / 2
    best = np.full(len(points), np.inf)
    for _ in range(70):
        x, y = b - ratio * (b - a), a + ratio * (b - a)
        left, right = (np.linalg.norm(curve(at) - points, axis=1) for at in (x, y))
        best = np.minimum(best, np.minimum(left, right))
        a, b = np.where(left < right, a, x), np.where(left < right, y, b)
    return best


def projections(given, points, spacing):
    del spacing
    curve, rival = given

    def proximities():
        at = rival.proximities(
            points, initial_guess_sample_resolutions=[2000], tolerance=1e-14, nthreads=-1
        )
        return np.linalg.norm(rival.evaluate(at) - points, axis=1)

    result, row = clocked(proximities, len(points))
    yield "splinepy proximities", result, row, len(points)
    few = points[:: max(len(points) // 1000, 1)]
    t = np.linspace(0, 1, 2000)
    tree = cKDTree(curve(t))

    def minimised():
        start = tree.query(few)[1]
        low, high = t[np.maximum(start - 1, 0)], t[np.minimum(start + 1, len(t) - 1)]
        return np.array([
            minimize_scalar(
                lambda u, q=q: float(np.linalg.norm(curve(np.array([u]))[0] - q)),
                bounds=(a, b), method="bounded", options={"xatol": 1e-12},
            ).fun
            for q, a, b in zip(few, low, high, strict=True)
        ])  # fmt: skip

    result, row = clocked(minimised, len(few))
    yield f"scipy minimize_scalar ({len(few)} points)", result, row, len(few)


def measured(case, rivals=others):
    contour, vertices, points, near, truth, spacing = case
    rows = [(*row, len(points)) for row in ours(contour, points, near)]
    rows += list(rivals(vertices, points, spacing))
    local = rows[0][2]["points_per_s"]
    report = []
    for name, distance, row, count in rows:
        every = max(len(points) // 1000, 1)
        distance = distance[::every] if len(truth) < count else distance
        wanted = truth if len(distance) == len(truth) else truth[::every]
        error = float(np.max(np.abs(distance - wanted)))
        report.append(
            {"solver": name, **row, "max_error_m": error, "ratio": local / row["points_per_s"]}
        )
    return report


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--pieces", type=int, default=100_000)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    report = {
        "ellipse": measured(ellipse_case(given.points, rng)),
        "part": measured(part_case(given.points, given.pieces, rng)),
        "nurbs": measured(nurbs_case(given.points, rng), projections),
    }
    if given.json:
        print(json.dumps(report, indent=1))
        return
    print(f"{'':34}{'points/s':>12}{'/cpu s':>12}{'local is':>10}{'max error':>12}{'memory':>9}")
    for case, rows in report.items():
        print(case)
        for row in rows:
            print(
                f"  {row['solver']:32}{row['points_per_s']:12.3g}{row['points_per_cpu_s']:12.3g}"
                f"{row['ratio']:9.1f}x{row['max_error_m']:10.1e} m"
                f"{row['memory_added_mib']:6.0f} MiB"
            )


if __name__ == "__main__":
    main()
