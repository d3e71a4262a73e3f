"""ISO 230-4 on circles whose deviations are known, found in logs that hold more than them."""

import numpy as np
import pytest

import contourlab as cl
from contourlab.logs import read_log

R = 0.05
CENTRE = np.array([0.2, -0.1])
DT = 2e-3


def motion(*pieces):
    """Return commanded angles of circles run after each other, with a straight way before."""
    way = (
        np.linspace(0.0, 1.0, 200)[:, None] * np.array([0.05, 0.03])
        + CENTRE
        + [R, 0]
        - [0.05, 0.03]
    )
    circles = [CENTRE + R * np.column_stack([np.cos(a), np.sin(a)]) for a in pieces]
    rest = [np.repeat(circle[-1:], 20, axis=0) for circle in circles]
    return np.concatenate([way, *(x for pair in zip(circles, rest, strict=True) for x in pair)])


def ramp(turns, sign=1.0, n=3000):
    return sign * np.linspace(0.0, 2.0 * np.pi * turns, n)


def log_of(tmp_path, commanded, actual):
    file = tmp_path / "log.csv"
    rows = np.column_stack([np.arange(len(commanded)) * DT, commanded, actual])
    np.savetxt(file, rows, delimiter=",", header="t_s,xs_m,ys_m,xa_m,ya_m", comments="")
    return read_log(file, commanded="xs_m,ys_m", actual="xa_m,ya_m")


def test_of(tmp_path, commanded, actual, **options):
    return cl.evaluate(log_of(tmp_path, commanded, actual), **options).circular


test_of.__test__ = False


def polar(commanded):
    away = commanded - CENTRE
    return np.arctan2(away[:, 1], away[:, 0]), away / np.linalg.norm(away, axis=1)[:, None]


def test_both_directions_with_known_deviations(tmp_path):
    commanded = motion(ramp(1.2), ramp(1.2, -1.0))
    angle, outward = polar(commanded)
    first = np.arange(len(commanded)) < 3215
    # counter-clockwise: 8 um larger, with three lobes of 3 um; clockwise: 4 um smaller, and round
    radial = np.where(first, 8e-6 + 3e-6 * np.cos(3.0 * angle), -4e-6)
    shift = np.array([5e-6, -7e-6])
    test = test_of(tmp_path, commanded, commanded + radial[:, None] * outward + shift)
    assert test.axes == ("X", "Y")
    np.testing.assert_allclose(test.radius, R, rtol=1e-9)
    np.testing.assert_allclose(test.centre, CENTRE, atol=1e-9)
    ccw, cw = test.directions
    assert (ccw.name, cw.name) == ("counter-clockwise", "clockwise")
    np.testing.assert_allclose(ccw.deviation, 6e-6, rtol=1e-3)
    np.testing.assert_allclose(cw.deviation, 0.0, atol=1e-9)
    np.testing.assert_allclose([ccw.radial_max, ccw.radial_min], [11e-6, 5e-6], rtol=2e-3)
    np.testing.assert_allclose([cw.radial_max, cw.radial_min], [-4e-6, -4e-6], rtol=1e-3)
    np.testing.assert_allclose(ccw.centre_offset, shift, atol=2e-8)
    np.testing.assert_allclose(cw.centre_offset, shift, atol=2e-9)
    # concentric circles about both: from -4 to 11 um
    np.testing.assert_allclose(test.bidirectional, 15e-6, rtol=1e-2)
    np.testing.assert_allclose(test.mean_radial, 2e-6, rtol=1e-2)
    np.testing.assert_allclose(ccw.feed, R * 2.4 * np.pi / (2999 * DT), rtol=1e-3)


def test_a_coarse_grid_stands_beside_the_figures(tmp_path):
    """Each radius is off by at most half a diagonal of the grid, and G by two of them."""
    commanded = motion(ramp(1.2), ramp(1.2, -1.0))
    angle, outward = polar(commanded)
    actual = commanded + 3e-6 * np.cos(3.0 * angle)[:, None] * outward
    test = test_of(tmp_path, commanded, np.round(actual, 6))
    np.testing.assert_allclose(test.half_width, np.sqrt(0.5) * 1e-6, rtol=1e-6)
    assert test.json()["radial_half_width"] == test.half_width
    for one in test.directions:
        off = abs(one.deviation - 6e-6)
        assert 0.1 * test.half_width < off < 2.0 * test.half_width


def test_one_direction_has_no_bidirectional_figure(tmp_path):
    commanded = motion(ramp(1.1))
    test = test_of(tmp_path, commanded, commanded + 1e-6, measured="tool")
    assert len(test.directions) == 1
    assert test.bidirectional is None
    assert test.mean_radial is None
    assert any("direction only" in warning for warning in test.warnings)
    assert not any("feedback" in warning for warning in test.warnings)


def test_feedback_signals_are_named(tmp_path):
    commanded = motion(ramp(1.1))
    motor = test_of(tmp_path, commanded, commanded + 1e-6, measured="motor")
    assert any("backlash, pitch and squareness, is not in it" in text for text in motor.warnings)


@pytest.mark.parametrize(
    "commanded",
    [
        motion(ramp(0.9)),  # no full turn
        motion(np.linspace(0.0, 0.5, 1000)),
        np.column_stack([np.linspace(0, 0.1, 500), 0.01 * np.sin(np.linspace(0, 30, 500))]),
        CENTRE + R * np.column_stack([np.cos(ramp(1.2)), 0.7 * np.sin(ramp(1.2))]),  # an ellipse
    ],
)
def test_what_is_no_circle_gives_no_test(tmp_path, commanded):
    assert test_of(tmp_path, commanded, commanded + 1e-6) is None


def test_the_test_can_be_left_out(tmp_path):
    commanded = motion(ramp(1.1))
    assert test_of(tmp_path, commanded, commanded + 1e-6, circular=False) is None


def test_the_polar_plot_prints_its_magnification(tmp_path):
    from contourlab.reports.polar_plot import polar_plot

    commanded = motion(ramp(1.2), ramp(1.2, -1.0))
    _, outward = polar(commanded)
    test = test_of(tmp_path, commanded, commanded + 7.9e-6 * outward)
    picture = polar_plot(test)
    # four divisions of 2 um are 70 long, and 50 mm are 200: (70 / 8 um) / (200 / 50 mm) = 2188
    assert "division 2 µm" in picture
    assert "magnification 2190 : 1" in picture
    assert "clockwise: G = 0.00 µm" in picture
