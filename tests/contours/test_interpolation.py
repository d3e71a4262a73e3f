"""Splines through points: they go through them, or stay within the tolerance that was asked."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from contourlab.contours.interpolation import interpolating_spline, smoothing_spline
from contourlab.errors import ConfigurationError, GeometryError


def ring(n, noise=0.0, seed=0):
    turn = 2.0 * np.pi * np.arange(n) / n
    radius = 0.02 + noise * np.random.default_rng(seed).normal(size=n)
    return radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def sampled(spline, n):
    from scipy.interpolate import BSpline as ScipySpline

    p, t, k = (np.asarray(v) for v in (spline.control_points, spline.knots, spline.degree))
    k = int(k)
    if spline.closed:
        count, period = len(p), t[-1] - t[0]
        t = np.concatenate([t[count - k : count] - period, t, t[1 : k + 1] + period])
        p = np.concatenate([p, p[:k]])
    return ScipySpline(t, p, k)(np.linspace(0.0, 1.0, n))


@pytest.mark.parametrize("parametrisation", ["chord", "centripetal", "uniform"])
@pytest.mark.parametrize(("degree", "closed"), [(3, False), (5, False), (3, True), (4, True)])
def test_goes_through_every_point(degree, closed, parametrisation):
    p = np.random.default_rng(1).normal(size=(11, 3))
    fit = interpolating_spline(p, degree=degree, closed=closed, parametrisation=parametrisation)
    assert fit.spline.closed is closed
    assert fit.max_error < 1e-13
    through = np.concatenate([p, p[:1]]) if closed else p
    dense = cKDTree(sampled(fit.spline, 200_001))
    # places 1e-5 of the parameter apart, at speeds of some 100 m per parameter
    assert dense.query(through)[0].max() < 1e-3
    growth = np.diff(fit.parameters)
    distance = np.linalg.norm(np.diff(through, axis=0), axis=1)
    power = {"chord": 1.0, "centripetal": 0.5, "uniform": 0.0}[parametrisation]
    assert_allclose(growth / growth[0], (distance / distance[0]) ** power, rtol=1e-9)


def test_cubic_is_scipys_other_spline():
    p = np.random.default_rng(2).normal(size=(9, 2))
    fit = interpolating_spline(p, parametrisation="chord")
    judge = CubicSpline(fit.parameters, p)  # not-a-knot, by another construction
    at = np.linspace(0.0, 1.0, 33)
    assert_allclose(sampled(fit.spline, 33), judge(at), rtol=0, atol=1e-12)


def test_ring_is_smooth_at_its_seam_and_nearly_a_circle():
    fit = interpolating_spline(ring(40), closed=True)
    first, last = (np.asarray(fit.spline.derivatives(u, 2)) for u in (0.0, 1.0 - 1e-12))
    assert_allclose(first, last, rtol=1e-6, atol=1e-9)
    # the error of a cubic spline is about (2π/40)⁴ / 384 of the radius
    assert_allclose(np.linalg.norm(sampled(fit.spline, 500), axis=1), 0.02, rtol=1e-5)


@pytest.mark.parametrize("closed", [False, True])
def test_smoothing_stays_within_its_tolerance_and_removes_noise(closed):
    points, tolerance = ring(400, noise=2e-6), 1e-5
    points = points if closed else points[:300]
    fit = smoothing_spline(points, tolerance=tolerance, closed=closed)
    dense = cKDTree(sampled(fit.spline, 100_001))
    through = np.concatenate([points, points[:1]]) if closed else points
    distance = dense.query(through)[0]
    assert distance.max() <= tolerance * 1.001
    if not closed:
        assert_allclose(sampled(fit.spline, 2), points[[0, -1]], rtol=0, atol=1e-17)
    assert_allclose(fit.max_error, distance.max(), rtol=1e-2)  # places are 1 um apart
    assert_allclose(fit.rms_error, np.sqrt(np.mean(distance**2)), rtol=1e-2)
    assert fit.spline.n_pieces < 40
    radius = np.linalg.norm(sampled(fit.spline, 2000), axis=1)
    assert np.abs(radius - 0.02).max() < tolerance


def test_tight_tolerance_ends_in_interpolation():
    points = ring(60, noise=1e-5)
    fit = smoothing_spline(points, tolerance=1e-13, closed=True)
    assert fit.max_error <= 1e-13


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        ([[0, 0], [1, 1], [1, 1], [2, 0], [3, 0]], {}, r"points\[1\] and the next are the same"),
        ([[0, 0], [1, np.nan], [2, 2], [3, 0]], {}, r"points\[1\] = \[ 1. nan\]"),
        ([[0, 0], [1, 1], [2, 2]], {}, "needs more than 3 points, got 3"),
        ([[0, 0], [1, 1], [2, 3], [0, 0]], {"closed": True}, "needs more than 3 points, got 3"),
        ([0, 1, 2], {}, "must have shape"),
        ([["a", "b"]], {}, "must be numbers"),
        (ring(9), {"parametrisation": "cord"}, "did you mean chord"),
        (ring(9), {"degree": 0}, "degree must be a whole number >= 1"),
        ([[0, 0], [1, 0], [1, 1e-18], [2, 0], [3, 1]], {"parametrisation": "chord"},
         r"points\[1\] and the next are 1e-18 m apart"),
    ],
)  # fmt: skip
def test_mistakes_are_named(points, options, message):
    with pytest.raises((GeometryError, ConfigurationError), match=message):
        interpolating_spline(points, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.0}, "tolerance must be > 0 m"),
        ({"tolerance": 1e-3, "degree": 6}, "must be 1 to 5"),
    ],
)
def test_mistakes_of_smoothing_are_named(options, message):
    with pytest.raises(ConfigurationError, match=message):
        smoothing_spline(ring(20), **options)
