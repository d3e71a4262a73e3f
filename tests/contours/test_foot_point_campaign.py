"""Foot points against an independent search, where they are hardest: evolutes, cusps, corners."""

import importlib.util
from itertools import pairwise
from math import comb
from pathlib import Path as FilePath

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from contourlab.contours.base import Contour
from contourlab.contours.foot_points import cells_of, foot_point, local_foot
from contourlab.contours.path import Path

jax.config.update("jax_enable_x64", True)

_spec = importlib.util.spec_from_file_location(
    "foot_point_search", FilePath(__file__).with_name("foot_point_search.py")
)
search = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(search)

TOLERANCE = 1e-12  # of the contour's size, as a distance; the judge is right to some 1e-15
TURN = 2 * np.pi


class Formula(Contour):
    """A curve given by a function of (module, parameter), so that the judge can use NumPy."""

    curve: object = eqx.field(static=True, kw_only=True)
    axes: int = eqx.field(static=True, kw_only=True, default=2)
    edges: tuple = eqx.field(static=True, kw_only=True, default=(0.0, TURN))
    loop: bool = eqx.field(static=True, kw_only=True, default=True)
    breaks: tuple = eqx.field(static=True, kw_only=True, default=())

    @property
    def n_axes(self):
        return self.axes

    @property
    def domain(self):
        return self.edges

    @property
    def closed(self):
        return self.loop

    def position(self, parameter, piece=None):
        return jnp.stack(self.curve(jnp, parameter))


FORMULAS = {
    "ellipse": {"curve": lambda x, t: [x.cos(t), 0.3 * x.sin(t)]},
    "circle": {"curve": lambda x, t: [x.cos(t), x.sin(t)]},
    "tiny ellipse": {"curve": lambda x, t: [1e-6 * x.cos(t), 0.6e-6 * x.sin(t)]},
    "huge eight": {"curve": lambda x, t: [1e3 * x.sin(t), 5e2 * x.sin(2 * t)]},
    "cardioid": {"curve": lambda x, t: [(1 - x.cos(t)) * x.cos(t), (1 - x.cos(t)) * x.sin(t)]},
    "astroid": {"curve": lambda x, t: [x.cos(t) ** 3, x.sin(t) ** 3]},
    "lissajous": {"curve": lambda x, t: [x.sin(3 * t + 0.4), x.sin(4 * t)]},
    "trefoil": {
        "curve": lambda x, t: [
            (2 + x.cos(3 * t)) * x.cos(2 * t), (2 + x.cos(3 * t)) * x.sin(2 * t), x.sin(3 * t)
        ],
        "axes": 3,
    },
    "cusp": {"curve": lambda x, t: [t * t, t * t * t], "edges": (-1.0, 1.2), "loop": False},
    "corner": {
        "curve": lambda x, t: [t, abs(t - 0.3)],
        "edges": (-1.0, 1.0), "loop": False, "breaks": (0.3,),
    },
    "jump of curvature": {
        "curve": lambda x, t: [t, x.maximum(t - 0.25, 0.0) ** 2],
        "edges": (-1.0, 1.0), "loop": False, "breaks": (0.25,),
    },
    "step": {
        "curve": lambda x, t: [t, x.tanh(80 * t) / 4], "edges": (-1.0, 1.0), "loop": False,
    },
}  # fmt: skip
QUICK = ("ellipse", "circle", "tiny ellipse", "cardioid", "trefoil", "corner", "jump of curvature")


def formula(name):
    contour = Formula(**FORMULAS[name])

    def curve(t):
        columns = [np.broadcast_to(x, np.shape(t)) for x in contour.curve(np, t)]
        return np.stack(columns, axis=1)

    start, end = contour.edges
    return contour, curve, np.array([start, *contour.breaks, end])


def nurbs(rng, axes, degree, scale):
    """Return a clamped random NURBS as a path, its points by SciPy's B-splines, and its knots."""
    count = 9
    points, weights = scale * rng.normal(size=(count, axes)), 10 ** rng.uniform(-0.5, 0.5, count)
    inner = np.sort(rng.uniform(size=count - degree - 1))
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    homogeneous = np.concatenate([points * weights[:, None], weights[:, None]], axis=1)
    spline, breaks = BSpline(knots, homogeneous, degree), np.unique(knots)
    # the Bézier points of each span, from values at degree + 1 places
    u = np.linspace(0, 1, degree + 1)[:, None]
    j = np.arange(degree + 1)
    basis = np.array([comb(degree, k) for k in j]) * u**j * (1 - u) ** (degree - j)
    rows = []
    for a, b in pairwise(breaks):
        span = BSpline.construct_fast(knots, homogeneous, degree)
        rows.append(np.linalg.solve(basis, span(np.clip(a + (b - a) * u[:, 0], a, b))))
    rows = np.array(rows)
    rows[1:, 0] = rows[:-1, -1]
    path = Path.from_bezier(rows[..., :-1] / rows[..., -1:], rows[..., -1])

    def curve(t):
        value = spline(t)
        return value[:, :-1] / value[:, -1:]

    return path, curve, breaks


def evolute(curve, t):
    """Return centres of curvature, by differences: near is as good as exact for a hard point."""
    h = 1e-4
    before, at, after = curve(t - h), curve(t), curve(t + h)
    slope, bend = (after - before) / (2 * h), (after - 2 * at + before) / h**2
    speed2 = np.sum(slope**2, axis=1, keepdims=True)
    across = bend - slope * np.sum(slope * bend, axis=1, keepdims=True) / speed2
    size2 = np.sum(across**2, axis=1, keepdims=True)
    return at + across * speed2 / np.maximum(size2, 1e-300)


def hard_points(rng, curve, breaks, n):
    """Return points off the curve by any amount, on and beside its evolute, on it, and far away."""
    start, end = breaks[0], breaks[-1]
    whole = curve(np.linspace(start, end, 801))
    size = np.max(np.ptp(whole, axis=0))
    t = rng.uniform(start + 1e-3, end - 1e-3, n)
    r = curve(t)

    def scattered(centre, spread):
        return centre + size * spread * rng.normal(size=centre.shape)

    centres = evolute(curve, t[: n // 2])
    centres = centres[np.linalg.norm(centres - r[: n // 2], axis=1) < 20 * size]
    points = [
        scattered(r, 10 ** rng.uniform(-6, 0.3, (n, 1))), centres, scattered(centres, 1e-3),
        scattered(centres, 1e-7), r[:4], curve(breaks), whole.mean(axis=0, keepdims=True),
        np.zeros((1, r.shape[1])), scattered(r[:3], 1e3),
    ]  # fmt: skip
    return np.concatenate(points), size


def check_global(contour, curve, breaks, rng, n):
    points, size = hard_points(rng, curve, breaks, n)
    distance = np.linalg.norm(foot_point(contour, points).vector, axis=1)
    expected = search.least(curve, breaks, points)
    rounding = 1e-15 * np.max(np.abs(points), axis=1)  # of far points
    assert np.max(np.abs(distance - expected) - rounding) < TOLERANCE * size


def check_local(contour, curve, breaks, rng, n, traced=True):
    """The stretch is judged from samples: balls that almost touch the curve are left out."""
    start, end = breaks[0], breaks[-1]
    near = rng.uniform(start, end, n)
    centre = curve(near)
    size = np.max(np.ptp(curve(np.linspace(start, end, 801)), axis=0))
    points = centre + size * 10 ** rng.uniform(-2, 0.0, (n, 1)) * rng.normal(size=centre.shape)
    error = np.linalg.norm(points - centre, axis=1)

    def place(k, t):
        return int(np.searchsorted(t, near[k])), centre[k]

    by_reach = [
        search.least(
            curve, breaks, points,
            inside=search.connected(place, reach * error, contour.closed),
        )
        for reach in (2.0 - 1e-3, 2.0 + 1e-3)
    ]  # fmt: skip
    # a sample away from the reference point nothing may be left: then the error itself
    expected = np.minimum(by_reach[0], error)
    clear = np.abs(by_reach[0] - by_reach[1]) < 1e-14 * size
    clear &= error > 2e-3 * size  # some samples lie in the ball
    assert np.mean(clear) > 0.8
    foot = foot_point(contour, points, near)
    distance = np.linalg.norm(foot.vector, axis=1)
    assert_allclose(distance[clear], expected[clear], rtol=0, atol=TOLERANCE * size)
    assert np.all(distance <= error * (1 + 1e-14))
    if not traced:
        return
    # the traced search is another program
    cells = cells_of(contour)
    traced = jax.jit(jax.vmap(lambda q, p: local_foot(cells, q, p)))(points, near)
    distance = np.linalg.norm(traced.vector, axis=1)
    assert_allclose(distance[clear], expected[clear], rtol=0, atol=TOLERANCE * size)


@pytest.mark.parametrize("name", QUICK)
def test_formulas_everywhere(name):
    check_global(*formula(name), np.random.default_rng(0), 16)


@pytest.mark.parametrize("name", ["ellipse", "huge eight", "corner"])
def test_formulas_nearby(name):
    check_local(*formula(name), np.random.default_rng(0), 24, traced=name == "huge eight")


@pytest.mark.parametrize(("axes", "degree", "scale"), [(2, 3, 1.0), (3, 4, 1e-6), (2, 2, 1e3)])
def test_random_nurbs(axes, degree, scale):
    rng = np.random.default_rng(degree)
    check_global(*nurbs(rng, axes, degree, scale), rng, 12)


def test_random_nurbs_nearby():
    rng = np.random.default_rng(7)
    path, curve, breaks = nurbs(rng, 2, 3, 1.0)
    # the judge's parameter is the knots', the path's is arc length
    knots = np.linspace(0.0, 1.0, 20_001)
    lengths = np.linalg.norm(np.diff(curve(knots), axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    travelled *= float(path.length) / travelled[-1]
    near = rng.uniform(0.0, float(path.length), 24)
    t = np.interp(near, travelled, knots)
    centre = np.asarray(jax.jit(jax.vmap(path.position))(near))
    points = centre + 10 ** rng.uniform(-1.5, 0.0, (24, 1)) * rng.normal(size=centre.shape)
    error = np.linalg.norm(points - centre, axis=1)

    def place(k, samples):
        return int(np.searchsorted(samples, t[k])), centre[k]

    low, high = (
        search.least(curve, breaks, points, inside=search.connected(place, r * error, False))
        for r in (1.998, 2.002)
    )
    clear = (np.abs(low - high) < 1e-14) & (error > 5e-3)  # some samples lie in the ball
    assert np.mean(clear) > 0.8
    distance = np.linalg.norm(foot_point(path, points, near).vector, axis=1)
    assert_allclose(distance[clear], np.minimum(low, error)[clear], rtol=0, atol=TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["corner", "jump of curvature"])
def test_many_on_formulas(name):
    rng = np.random.default_rng(0)
    check_global(*formula(name), rng, 400)
    check_local(*formula(name), rng, 100)


@pytest.mark.slow
@pytest.mark.overnight
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", FORMULAS)
def test_more_on_formulas(name, seed):
    rng = np.random.default_rng(seed)
    check_global(*formula(name), rng, 400)
    check_local(*formula(name), rng, 100)


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [k if k < 4 else pytest.param(k, marks=pytest.mark.overnight) for k in range(20)]
)
def test_many_on_nurbs(seed):
    rng = np.random.default_rng(seed)
    check_global(*nurbs(rng, 2 + seed % 2, 2 + seed % 4, 10.0 ** rng.integers(-6, 4)), rng, 200)
