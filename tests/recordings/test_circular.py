"""Circular tests of ISO 230-4 on circles whose deviations are known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import RecordingError
from contourlab.recordings import (
    bidirectional_deviation,
    circular,
    circular_deviation,
    least_squares_circle,
    radial_deviations,
)

ANGLE = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]


def circle(radius, centre=(0.0, 0.0)):
    return np.column_stack([np.cos(ANGLE), np.sin(ANGLE)]) * np.broadcast_to(radius, ANGLE.shape)[
        :, None
    ] + np.asarray(centre)


def test_a_true_circle_has_no_deviation():
    points = circle(0.05, (0.1, -0.2))
    centre, radius = least_squares_circle(points)
    assert_allclose(centre, (0.1, -0.2), atol=1e-15)
    assert_allclose(radius, 0.05, rtol=1e-14)
    assert circular_deviation(points).deviation < 1e-14


def test_three_lobes():
    # r = R + a cos 3θ: the minimum zone is concentric, 2a wide (three highs and lows interlock)
    points = circle(0.05 + 4e-6 * np.cos(3 * ANGLE))
    assert_allclose(circular_deviation(points).deviation, 8e-6, rtol=1e-6)


def test_an_ellipse_has_half_the_difference_of_its_axes():
    # concentric circles through the ends of the axes: 50 and 50.02 mm in radius
    points = np.column_stack([0.05002 * np.cos(ANGLE), 0.05 * np.sin(ANGLE)])
    assert_allclose(circular_deviation(points).deviation, 2e-5, rtol=1e-9)


def test_the_minimum_zone_is_not_the_least_squares_zone():
    # one bump pulls the least squares centre; the minimum zone can only be narrower
    points = circle(0.05 + 1e-5 * np.exp(-((ANGLE - 1.0) ** 2) / 0.02))
    centre, _ = least_squares_circle(points)
    around = np.linalg.norm(points - centre, axis=1)
    zone = circular_deviation(points).deviation
    assert zone < np.ptp(around)
    # and by brute force, no centre nearby does better
    shifts = np.random.default_rng(1).normal(scale=5e-6, size=(4000, 2))
    best = min(np.ptp(np.linalg.norm(points - c, axis=1)) for c in np.asarray(centre) + shifts)
    assert zone <= best * (1 + 1e-9)


def test_two_directions_and_radial_deviations():
    inside, outside = circle(0.05 - 3e-6), circle(0.05 + 2e-6)
    assert_allclose(bidirectional_deviation(inside, outside).deviation, 5e-6, rtol=1e-9)
    assert_allclose(radial_deviations(outside, 0.05), (2e-6, 2e-6), rtol=1e-8)
    high, low = radial_deviations(circle(0.05, (1e-6, 0.0)), 0.05, centre=(0.0, 0.0))
    assert_allclose((high, low), (1e-6, -1e-6), rtol=1e-5)


def test_what_is_no_circle():
    with pytest.raises(RecordingError, match=r"shape \(n >= 3, 2\)"):
        circular_deviation(np.zeros((2, 2)))
    with pytest.raises(RecordingError, match="finite"):
        circular_deviation([[0, 0], [1, np.nan], [1, 1]])
    with pytest.raises(RecordingError, match="radius must be > 0"):
        radial_deviations(circle(1.0), -1.0)


@pytest.mark.parametrize("fit", [least_squares_circle, circular_deviation])
@pytest.mark.parametrize(
    "points",
    [
        [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]],
        np.column_stack([ANGLE, 0.3 * ANGLE]) * 1e-3 + [1.0, 7.0],
        np.full((5, 2), 0.1),
    ],
    ids=["three", "far from the origin", "one point"],
)
def test_points_on_a_line_are_refused(fit, points):
    with pytest.raises(RecordingError, match="the points lie on a line"):
        fit(points)


def test_a_shallow_arc_is_no_line():
    # 1 mm on a radius of 10 m: 12.5 nm high
    angle = np.linspace(-5e-5, 5e-5, 101)
    centre, radius = least_squares_circle(10.0 * np.column_stack([np.cos(angle), np.sin(angle)]))
    assert_allclose(radius, 10.0, rtol=1e-5)  # rounding of 1e-15 m on 1e-8 m
    assert_allclose(centre, (0.0, 0.0), atol=1e-4)


@pytest.mark.filterwarnings("error")
def test_a_point_on_the_centre():
    # a circle and its centre: one point of 721 moves the fit by a few parts in 721
    points = np.concatenate([circle(1.0), [[0.0, 0.0]]])
    centre, radius = least_squares_circle(points)
    assert np.hypot(*centre) < 5 / 721
    assert_allclose(radius, 1.0, rtol=5 / 721)
    assert 0.5 < circular_deviation(points).deviation <= 1.0
    assert_allclose(radial_deviations(points, 1.0, centre=(0.0, 0.0)), (0.0, -1.0))


def test_a_linear_programme_that_fails_is_said(monkeypatch):
    class Failed:
        success, message = False, "out of iterations"

    monkeypatch.setattr(circular, "linprog", lambda *args, **keywords: Failed)
    with pytest.raises(RecordingError, match="minimum zone was not found: out of iterations"):
        circular_deviation(circle(0.05))
