"""The parts of the planner, one by one, against what their docstrings promise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.path import Path
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives
from contourlab.feedrate.cells import limit_rise, spread_acceleration, spread_speed, whole
from contourlab.feedrate.ramps import Ramps
from contourlab.feedrate.segments import joint_angles, segments_of
from contourlab.feedrate.smoothing import smooth


def gaps(edges):
    """Distance between any two cells."""
    apart = edges[:-1][None, :] - edges[1:][:, None]
    return np.maximum(np.maximum(apart, apart.T), 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_spread_caps_hold_between_all_cells(seed):
    rng = np.random.default_rng(seed)
    n = 60
    edges = np.concatenate([[0.0], np.cumsum(10 ** rng.uniform(-5, -2, n))])
    stop = rng.random(n + 1) < 0.1
    stop[[0, -1]] = True
    cells = whole(edges, stop)
    speed, window = 10 ** rng.uniform(-3, 0, n), (10 ** rng.uniform(-3, -1, n))[cells.stretch]
    places = rng.choice(edges[1:-1], 5, replace=False)
    place_cap = 10 ** rng.uniform(-3, 0, 5)
    same = cells.stretch[:, None] == cells.stretch[None, :]
    planned = spread_speed(cells, speed, window, places, place_cap)
    gap = gaps(edges)
    promised = np.where(same, np.maximum(speed[None, :], 2 * gap / window[:, None]), np.inf)
    assert (planned <= promised.min(axis=1) * (1 + 1e-12)).all()
    assert (planned > 0).all()
    for place, cap in zip(places, place_cap, strict=True):
        k = np.searchsorted(edges, place, side="right") - 1
        here = cells.stretch == cells.stretch[k]
        away = np.maximum(np.maximum(edges[:-1] - place, place - edges[1:]), 0.0)
        assert (planned <= np.maximum(cap, 2 * away / window) * (1 + 1e-12))[here].all()
    acceleration = 10 ** rng.uniform(-1, 1, n)
    gentle = spread_acceleration(cells, acceleration, speed, window)
    near = same & (gap < (speed * window)[None, :])
    assert (gentle <= np.where(near, acceleration[None, :], np.inf).min(axis=1)).all()
    # and no more than that is taken
    reached = same & (gap <= (speed * window)[None, :] * (1 + 1e-6))
    assert (gentle >= np.where(reached, acceleration[None, :], np.inf).min(axis=1)).all()


def test_limit_rise_is_the_plain_loop():
    rng = np.random.default_rng(0)
    for n in (1, 2, 200):
        value, gain = rng.uniform(size=n), rng.uniform(0, 0.1, n - 1)
        wanted = value.copy()
        for k in range(1, n):
            wanted[k] = min(value[k], wanted[k - 1] + gain[k - 1])
        assert np.array_equal(limit_rise(value, gain), wanted)


@pytest.mark.parametrize("error", [0.0, 1e-13, -1e-13])
def test_instants_that_differ_by_rounding_are_one(error):
    # up for T, level for T, down for T, T = 0.01 s and 1 m/s²
    level = 0.01 * (1 + error)
    duration = np.array([0.01, level, 0.01])
    speed, end = np.array([0.0, 0.01, 0.01]), np.array([0.01, 0.01, 0.0])
    length = 0.5 * (speed + end) * duration
    edges = np.array([0.0, length.sum()])
    start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    ramps = Ramps(start, length, speed, end, np.array([1.0, 0.0, -1.0]), duration, np.zeros(3, int))
    profile, arrives = smooth(ramps, np.array([0.01]), edges, np.zeros(1), 0.0)
    assert_allclose(np.abs(profile.jerk).max(), 100.0, rtol=1e-9)
    assert_allclose(arrives, [0.03 + level], rtol=1e-14)
    assert profile.at(arrives)[0] == edges[1]
    s = np.linspace(0, edges[1], 101)
    assert_allclose(profile.at(profile.time_at(s))[0], s, rtol=0, atol=1e-16)


def curves():
    rng = np.random.default_rng(3)
    bezier = np.cumsum(rng.normal(size=(1, 5, 3)), axis=1) * 0.01
    arc = Path.from_helical([[0, 0, 0]], [[0.6, 0, 0]], [[0, 0.6, 0]], [[0, 0, 0.8]], [40.0], [0.1])
    return {
        "ellipse": Ellipse(semi_axes=(0.03, 0.004)),
        "helix": arc,
        "bezier": Path.from_bezier(bezier),
        "formula_helix": Helix(radius=0.01, pitch=0.002, turns=1.5),
    }


@pytest.mark.parametrize("name", ["ellipse", "helix", "bezier", "formula_helix"])
def test_bounds_hold_and_are_not_far(name):
    contour = curves()[name]
    table = ArcLength(contour)
    segments = segments_of(contour, table)
    s = np.linspace(0, table.length, 4001)[:-1]
    r = np.abs(arc_derivatives(contour_derivatives(contour, table.parameter_at(s))))
    assert_allclose(np.sqrt((r[:, 0] ** 2).sum(axis=1)), 1.0, rtol=1e-12)
    k = np.searchsorted(segments.edges, s, side="right") - 1
    for order, bound in enumerate((segments.tangent, segments.bend, segments.twist)):
        assert (r[:, order] <= bound[k] * (1 + 1e-9) + 1e-12).all()
        assert bound.max() <= 1.1 * r[:, order].max()
    assert_allclose(joint_angles(segments), 0.0, atol=1e-9)


def test_derivatives_over_arc_length_of_an_ellipse():
    a, b = 0.03, 0.01
    theta = np.linspace(0, 2 * np.pi, 50)
    c, s = np.cos(theta), np.sin(theta)
    size = np.hypot(a * s, b * c)
    tangent = np.stack([-a * s, b * c], axis=1) / size[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    k = a * b / size**3
    dk = -3 * a * b * (a * a - b * b) * s * c / size**6
    r = arc_derivatives(contour_derivatives(Ellipse(semi_axes=(a, b)), theta))
    assert_allclose(r[:, 0], tangent, rtol=0, atol=1e-14)
    assert_allclose(r[:, 1], k[:, None] * normal, rtol=0, atol=1e-12 * k.max())
    third = dk[:, None] * normal - (k**2)[:, None] * tangent
    assert_allclose(r[:, 2], third, rtol=0, atol=1e-11 * k.max() ** 2)
    h = 1e-6  # the fourth by central differences of the third over the parameter
    lower, upper = (
        arc_derivatives(contour_derivatives(Ellipse(semi_axes=(a, b)), theta + d))[:, 2]
        for d in (-h, h)
    )
    fourth = (upper - lower) / (2 * h) / size[:, None]
    assert_allclose(r[:, 3], fourth, rtol=0, atol=1e-7 * np.abs(fourth).max())


def test_time_derivatives_of_the_parameter():
    table = ArcLength(Ellipse(semi_axes=(0.03, 0.01)))
    t = np.linspace(0.1, 1.0, 30)
    motion = [0.02 * t**3 + 0.05 * t, 0.06 * t**2 + 0.05, 0.12 * t, np.full_like(t, 0.12)]
    _, rate, second, third = table.time_derivatives(*motion)
    h = 1e-5
    for k, slope in enumerate((rate, second, third)):
        sides = []
        for at in (t - h, t + h):
            speed, acceleration = 0.06 * at**2 + 0.05, 0.12 * at
            moved = (0.02 * at**3 + 0.05 * at, speed, acceleration, np.full_like(t, 0.12))
            sides.append(table.time_derivatives(*moved)[k])
        # central differences are off by h² / 6 of a derivative two orders higher
        assert_allclose(slope, (sides[1] - sides[0]) / (2 * h), rtol=0, atol=1e-6 * slope.max())
