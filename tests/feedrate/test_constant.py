"""References of constant rate and of constant feed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ellipeinc

from contourlab.contours.circle import Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.path import Path
from contourlab.errors import ConfigurationError, FeedError, UnitError
from contourlab.feedrate import constant_feed, constant_rate
from contourlab.feedrate.arc_length import ArcLength

LINE = Path.polyline([[0.0, 0.0], [0.03, 0.04]])


def test_the_readme_call():
    ellipse = Ellipse(semi_axes=(0.03, 0.01))
    reference = constant_rate(ellipse, rate=1.8 * np.pi, duration=2.2, sample_time=1e-3)
    assert reference.n_samples == 2201
    assert_allclose(reference.time[-1], 2.2, rtol=1e-15)
    t = 1.8 * np.pi * np.arange(2201) * 1e-3
    assert_allclose(reference.position[:, 0], 0.03 * np.cos(t), rtol=0, atol=1e-16)
    assert_allclose(reference.velocity[:, 1], 0.01 * np.cos(t) * 1.8 * np.pi, rtol=0, atol=1e-15)
    assert_allclose(
        reference.acceleration[:, 0], -0.03 * np.cos(t) * (1.8 * np.pi) ** 2, rtol=0, atol=1e-13
    )
    assert reference.parameter[-1] > 2 * np.pi  # goes round
    assert any("velocity step" in warning for warning in reference.warnings)
    assert reference.motion_warnings == reference.warnings


COUNTS = [(2.2, 1e-3, 2201), (0.3, 0.1, 4), (1.05, 0.1, 11), (1e-3, 1e-3, 2), (3600.0, 0.5, 7201)]


@pytest.mark.parametrize(("duration", "dt", "rows"), COUNTS)
def test_count_of_samples(duration, dt, rows):
    circle = Circle(radius=0.01)
    assert constant_rate(circle, rate=1.0, duration=duration, sample_time=dt).n_samples == rows


@pytest.mark.parametrize(
    ("rate", "start", "end"), [(0.1, None, 0.05), (-0.1, None, 0.0), (0.1, 0.02, 0.05)]
)
def test_an_open_contour_ends_at_rest(rate, start, end):
    reference = constant_rate(LINE, rate=rate, duration=1.0, sample_time=0.01, start=start)
    assert reference.parameter[0] == (start if start is not None else (0.0 if rate > 0 else 0.05))
    assert reference.parameter[-1] == end
    assert_allclose(reference.velocity[-1], 0.0, atol=0)
    assert_allclose(np.linalg.norm(reference.velocity[0]), 0.1, rtol=1e-15)
    assert any("ends" in warning for warning in reference.warnings)


@pytest.mark.parametrize("semi_axes", [(0.03, 0.01), (0.001, 0.05), (0.02, 0.02)])
def test_constant_feed_against_elliptic_integrals(semi_axes):
    a, b = semi_axes
    reference = constant_feed(
        Ellipse(semi_axes=semi_axes), feed=0.05, sample_time=2e-3, duration=8.0
    )
    m = 1 - (a / b) ** 2  # E(φ|m) with φ from the end of semi-axis a: speed b sqrt(1 - m sin² φ)
    arc = b * ellipeinc(reference.parameter, m)
    assert_allclose(arc, 0.05 * reference.time, rtol=0, atol=2e-12 * arc[-1])
    assert_allclose(np.linalg.norm(reference.velocity, axis=1), 0.05, rtol=1e-12)
    along = np.sum(reference.velocity * reference.acceleration, axis=1)
    assert_allclose(along / np.abs(reference.acceleration).max(), 0.0, atol=1e-12)
    if a == b:
        assert_allclose(np.linalg.norm(reference.jerk, axis=1), 0.05**3 / a**2, rtol=1e-9)


def test_constant_feed_units_and_once_round():
    circle = Circle(radius=0.01)
    length = 2 * np.pi * 0.01
    by_number = constant_feed(circle, feed=0.05, sample_time=1e-3)
    by_text = constant_feed(circle, feed="3000 mm/min", sample_time=1e-3)
    assert_allclose(by_text.parameter, by_number.parameter, rtol=1e-15)
    assert by_number.n_samples == int(np.ceil(length / 0.05 / 1e-3)) + 1
    assert_allclose(by_number.position[-1], by_number.position[0], atol=1e-16)
    assert_allclose(by_number.velocity[-1], 0.0, atol=0)


def test_constant_feed_on_a_path_is_arc_length():
    reference = constant_feed(LINE, feed=0.02, sample_time=0.1, duration=4.0)
    assert_allclose(reference.parameter, np.minimum(0.02 * reference.time, 0.05), rtol=1e-15)


def test_inversion_of_arc_length_goes_round():
    table = ArcLength(Ellipse(semi_axes=(0.03, 0.01)))
    p = table.parameter_at(np.array([0.0, table.length, 2.5 * table.length]))
    assert_allclose(p, [0.0, 2 * np.pi, 5 * np.pi], rtol=1e-13)


@pytest.mark.parametrize(("keywords", "error", "says"), [
    ({"rate": 0.0}, FeedError, "rate must be finite and not 0"),
    ({"rate": np.nan}, FeedError, "rate must be"),
    ({"duration": -1.0}, FeedError, "duration must be > 0 s"),
    ({"duration": 1e-4}, FeedError, "duration must be >= sample_time"),
    ({"sample_time": 0.0}, FeedError, "sample_time must be > 0 s"),
    ({"start": 7.0}, FeedError, "start must be within the domain 0 to 0.05"),
])  # fmt: skip
def test_constant_rate_refuses(keywords, error, says):
    good = {"rate": 1.0, "duration": 1.0, "sample_time": 1e-3}
    with pytest.raises(error, match=says):
        constant_rate(LINE, **{**good, **keywords})


@pytest.mark.parametrize(("feed", "error"), [
    (0.0, FeedError), (-0.1, FeedError), (np.inf, FeedError), (np.nan, FeedError),
    ("3000", UnitError), ("3000 mm", UnitError), ("0 mm/min", FeedError),
])  # fmt: skip
def test_constant_feed_refuses(feed, error):
    with pytest.raises(error, match="feed"):
        constant_feed(LINE, feed=feed, sample_time=1e-3)


def test_limits_are_checked():
    from contourlab.feedrate import AxisLimits

    good = {"velocity": 1.0, "acceleration": [1.0, 2.0], "jerk": 3.0}
    assert_allclose(AxisLimits(**good).for_axes(2).velocity, [1.0, 1.0])
    assert_allclose(AxisLimits(**good).for_axes(2).acceleration, [1.0, 2.0])
    with pytest.raises(FeedError, match="acceleration is given for 2 axes, the contour has 3"):
        AxisLimits(**good).for_axes(3)
    for name in good:
        for wrong in (0.0, -1.0, np.nan, np.inf, [1.0, 0.0]):
            with pytest.raises(ConfigurationError, match=name):
                AxisLimits(**{**good, name: wrong})
    with pytest.raises(ConfigurationError, match=r"are for \[2, 3\] axes"):
        AxisLimits(**{**good, "jerk": [1.0, 2.0, 3.0]})
    with pytest.raises(ConfigurationError, match="must be numbers or one per axis"):
        AxisLimits(**{**good, "jerk": [[1.0, 2.0]]})


def test_a_record_that_memory_cannot_hold_is_refused():
    circle = Circle(radius=0.01)
    with pytest.raises(FeedError, match=r"takes 1e\+09 samples of 1e-09 s, more than 20000000"):
        constant_rate(circle, rate=1.0, duration=1.0, sample_time=1e-9)
    with pytest.raises(FeedError, match="more than 20000000"):
        constant_feed(circle, feed="1 nm/s", sample_time=1e-3)


SQUARE = [[0.0, 0.0], [0.01, 0.0], [0.01, 0.01], [0.0, 0.01]]


@pytest.mark.parametrize(
    ("closed", "duration", "corners"),
    [(False, None, "2 corners"), (False, 0.15, "a corner"), (False, 0.09, ""),
     (True, None, "3 corners"), (True, 0.45, "4 corners")],
)  # fmt: skip
def test_corners_that_are_passed_are_warned_of(closed, duration, corners):
    path = Path.polyline(SQUARE, closed=closed)
    reference = constant_feed(path, feed=0.1, sample_time=0.01, duration=duration)
    said = [w for w in reference.warnings if "turns at" in w]
    assert bool(said) == bool(corners)
    if corners:
        assert said == [f"the path turns at {corners}: the velocity of the reference jumps there"]
        rate = constant_rate(path, rate=0.1, duration=duration or 0.4, sample_time=0.01)
        assert any("turns at" in w for w in rate.warnings)
