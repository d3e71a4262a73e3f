"""Parabola, figure of eight, Lissajous, sinusoid, heart, spirals and star against closed forms."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from contourlab.configuration import replace
from contourlab.contours.figure_eight import FigureEight
from contourlab.contours.foot_points import foot_point
from contourlab.contours.heart import Heart
from contourlab.contours.lissajous import Lissajous
from contourlab.contours.parabola import Parabola
from contourlab.contours.sinusoid import Sinusoid
from contourlab.contours.spiral import Involute, Spiral
from contourlab.contours.star import Star
from contourlab.errors import ConfigurationError, GeometryError
from contourlab.testing.contours import check_contour

ROUNDING = 1e-14  # coordinates of size 1: some tens of operations at 1.1e-16 each
PLACES = np.linspace(0.05, 5.9, 23)

CURVES = {
    "parabola": Parabola(coefficient=50.0, half_width=0.02, center=(0.1, 0.2), rotation=0.3),
    "figure of eight": FigureEight(half_sizes=(0.03, 0.02), center=(0.03, 0.0), rotation=-0.4),
    "lissajous in space": Lissajous(
        amplitudes=(0.03, 0.02, 0.01), frequencies=(1, 2, 1.5), phases=(0.3, 0.0, 1.0)
    ),
    "sinusoid": Sinusoid(amplitude=0.03, wavelength=0.04, periods=2.3, phase=0.2, rotation=-0.3),
    "heart": Heart(radius=0.03, smoothing=0.1, rotation=0.2, center=(0.1, 0.0)),
    "spiral": Spiral(start_radius=0.01, pitch=-0.002, turns=5.0, center=(0.1, 0.0), rotation=0.2),
    "involute": Involute(base_radius=0.02, start_angle=0.2, end_angle=3.0, rotation=0.5),
    "star": Star(outer_radius=0.03, inner_radius=0.02, points=5, rotation=0.2),
}


SLOW = {
    "parabola",
    "involute",
    "star",
    "sinusoid",
    "lissajous in space",
}  # their derivatives are checked in closed form below


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in CURVES]
)
def test_keeps_the_contract_of_contours(name):
    check_contour(CURVES[name])


def rows(contour, places, order):
    return np.asarray(jax.jit(jax.vmap(lambda p: contour.derivatives(p, order)))(places))


def curvature(contour, at):
    return float(contour.frenet(jnp.asarray(at)).curvature)


# -- the published contours ------------------------------------------------------------------------


def test_the_published_parabola():
    h, a = 50.0, 0.02  # h_r and a_r
    places = np.linspace(-a, a, 7)
    got = rows(Parabola(coefficient=h, half_width=a), places, 3)
    zero, one = 0 * places, 1 + 0 * places
    expected = [[places, h * places**2], [one, 2 * h * places], [zero, 2 * h * one], [zero, zero]]
    assert_allclose(got, np.transpose(expected, (2, 0, 1)), rtol=ROUNDING)
    assert Parabola(coefficient=h, half_width=a).domain == (-a, a)


def test_the_published_figure_of_eight():
    eight = FigureEight(half_sizes=(0.03, 0.03), center=(0.03, 0.0))
    expected = np.stack([0.03 * (1 - np.cos(PLACES)), 0.03 * np.sin(2 * PLACES)], axis=1)
    assert_allclose(rows(eight, PLACES, 0)[:, 0], expected, rtol=0, atol=ROUNDING)
    # the other paper's, in mm: x = 5 sin, y = 5 sin of twice the angle
    other = FigureEight(half_sizes=(5.0, 5.0), rotation=np.pi, start_angle=-np.pi / 2)
    expected = np.stack([5 * np.sin(PLACES), 5 * np.sin(2 * PLACES)], axis=1)
    assert_allclose(rows(other, PLACES, 0)[:, 0], expected, rtol=0, atol=5 * ROUNDING)


def test_the_published_four_axis_contour():
    four = Lissajous(
        amplitudes=(1, 1, 0.1, 0.1), frequencies=(1, 1, 10, 10),
        phases=(np.pi / 2, 0, np.pi / 2, 0),
    )  # fmt: skip
    assert four.closed
    assert_allclose(four.domain, (0.0, 2 * np.pi))
    t = PLACES
    expected = [np.cos(t), np.sin(t), 0.1 * np.cos(10 * t), 0.1 * np.sin(10 * t)]
    assert_allclose(rows(four, t, 0)[:, 0], np.transpose(expected), rtol=0, atol=ROUNDING)
    fifth = [-np.sin(t), np.cos(t), -1e4 * np.sin(10 * t), 1e4 * np.cos(10 * t)]
    assert_allclose(rows(four, t, 5)[:, 5], np.transpose(fifth), rtol=0, atol=1e4 * 5 * ROUNDING)


def test_the_published_sinusoid_is_followed_to_the_sixth_derivative():
    # r1 = t, r2 = sin t
    wave = Sinusoid(amplitude=1.0, wavelength=2 * np.pi, periods=3.0)
    got = rows(wave, PLACES, 6)
    for order in range(7):
        assert_allclose(got[:, order, 1], np.sin(PLACES + order * np.pi / 2), rtol=0, atol=ROUNDING)
    assert_allclose(got[:, 0, 0], PLACES, rtol=ROUNDING)
    assert_allclose(got[:, 1:, 0], np.eye(1, 6).repeat(len(PLACES), 0), rtol=0, atol=0)


def test_the_published_heart_is_met_where_its_smoothing_does_not_reach():
    delta = 1e-3
    heart = Heart(radius=1.0, smoothing=delta)
    t = PLACES[np.abs(np.cos(PLACES)) > 0.2]
    printed = np.stack([np.cos(t), np.sin(t) + (np.cos(t) ** 2) ** (1 / 3)], axis=1)
    # (c² + δ²)^(1/3) - c^(2/3) = δ² c^(-4/3) / 3 to first order
    allowed = 0.4 * delta**2 * 0.2 ** (-4 / 3)
    gap = np.abs(rows(heart, t, 0)[:, 0] - printed).max()
    assert 1e-8 < gap < allowed


# -- curvature at known places ---------------------------------------------------------------------


def test_curvature_at_vertices():
    for h in (50.0, -20.0):
        parabola = Parabola(coefficient=h, half_width=0.02)
        assert_allclose(curvature(parabola, 0.0), 2 * h, rtol=1e-12)
        x = 0.013
        assert_allclose(curvature(parabola, x), 2 * h / (1 + (2 * h * x) ** 2) ** 1.5, rtol=1e-12)
    eight = FigureEight(half_sizes=(0.03, 0.02))
    # at the end of a lobe x'' = a and y' = 2 b: a left turn on the right, a right turn on the left
    assert_allclose(curvature(eight, np.pi), 0.03 / (2 * 0.02) ** 2, rtol=1e-12)
    assert_allclose(curvature(eight, 0.0), -0.03 / (2 * 0.02) ** 2, rtol=1e-12)
    assert_allclose(curvature(eight, np.pi / 2), 0.0, atol=1e-12)
    n, tip, valley = 5, 0.03, 0.02
    star, depth = Star(outer_radius=tip, inner_radius=valley, points=n), 0.5 * (tip - valley)
    assert_allclose(curvature(star, 0.0), (tip + n**2 * depth) / tip**2, rtol=1e-12)
    assert_allclose(curvature(star, np.pi / n), (valley - n**2 * depth) / valley**2, rtol=1e-11)
    wave = Sinusoid(amplitude=0.03, wavelength=0.04)
    crest = 0.03 * (2 * np.pi / 0.04) ** 2
    assert_allclose(curvature(wave, 0.01), -crest, rtol=1e-11)
    assert_allclose(curvature(CURVES["involute"], 1.7), 1 / (0.02 * 1.7), rtol=1e-12)
    for delta in (0.1, 0.004):
        heart, bulge = Heart(radius=0.03, smoothing=delta), 2 / 3 * delta ** (-4 / 3)
        # cos(π/2) is 6e-17 instead of 0, beside δ
        assert_allclose(curvature(heart, np.pi / 2), (1 - bulge) / 0.03, rtol=1e-10)
        assert_allclose(curvature(heart, 3 * np.pi / 2), (1 + bulge) / 0.03, rtol=1e-10)


def test_the_radius_of_a_spiral_and_of_a_star():
    spiral = CURVES["spiral"]
    places = np.linspace(*(float(edge) for edge in spiral.domain), 9)
    radius = np.linalg.norm(rows(spiral, places, 0)[:, 0] - spiral.center, axis=1)
    assert_allclose(radius, 0.01 - 0.002 * places / (2 * np.pi), rtol=0, atol=1e-16)
    star = Star(outer_radius=0.03, inner_radius=0.02, points=4)
    radius = np.linalg.norm(rows(star, PLACES, 0)[:, 0], axis=1)
    assert_allclose(radius, 0.025 + 0.005 * np.cos(4 * PLACES), rtol=ROUNDING)


# -- arc length in closed form ---------------------------------------------------------------------

LENGTHS = {
    "flat parabola": Parabola(coefficient=1e-6, half_width=1.0),
    "sharp parabola": Parabola(coefficient=-1e4, half_width=1.0),
    "steep sinusoid": Sinusoid(amplitude=0.03, wavelength=4e-4),
    "low sinusoid": Sinusoid(amplitude=1e-5, wavelength=0.1, periods=3.3, phase=1.0),
    "sharp heart": Heart(radius=1.0, smoothing=1e-4),
    "soft heart": Heart(radius=1.0, smoothing=2.0),
    "spiral from its centre": Spiral(start_radius=0.0, pitch=0.004, turns=3.2),
    "spiral to its centre": CURVES["spiral"],
    "tight spiral": Spiral(start_radius=0.1, pitch=1e-7, turns=20.0),
    "involute": CURVES["involute"],
}


@pytest.mark.parametrize("name", LENGTHS)
def test_arc_length_is_the_integral_of_the_speed(name):
    contour = LENGTHS[name]
    low, high = (float(edge) for edge in contour.domain)
    sharp = [p for p in (0.0, np.pi / 2, 3 * np.pi / 2) if low < p < high]
    speed = jax.jit(lambda p: jnp.linalg.norm(contour.derivatives(p, 1)[1]))
    length = jax.jit(lambda a, b: contour.arc_length(a, b))
    middle = low + 0.37 * (high - low)
    for a, b in ((low, middle), (middle, high)):
        cuts = [a, *(p + d for p in sharp for d in (-1e-3, 0.0, 1e-3) if a < p + d < b), b]
        judged = sum(
            quad(lambda p: float(speed(p)), x, y, epsabs=0, epsrel=1e-12, limit=200)[0]
            for x, y in pairwise(cuts)
        )
        # quad's own tolerance, and ten roundings
        assert_allclose(length(a, b), judged, rtol=2e-12)


def test_arc_length_goes_round_a_heart():
    heart = Heart(radius=1.0, smoothing=0.02)
    whole = float(heart.length)
    assert_allclose(heart.arc_length(0.3, 0.3 + 4 * np.pi), 2 * whole, rtol=1e-13)
    assert_allclose(heart.arc_length(-0.5, 0.5) + heart.arc_length(0.5, 5.78318530717958648), whole)


# -- closed or open --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frequencies", "period"),
    [((2, 3), 1.0), ((2, 4), 0.5), ((0.5, 1.5), 2.0), ((0.1, 0.25), 20.0), ((1 / 3, 1), 3.0)],
)
def test_rational_frequencies_have_a_period(frequencies, period):
    curve = Lissajous(amplitudes=1.0, frequencies=frequencies, phases=(0.3, 0.0))
    assert curve.closed
    assert_allclose(curve.domain[1], 2 * np.pi * period, rtol=1e-15)
    assert_allclose(curve.position(curve.domain[1]), curve.position(0.0), rtol=0, atol=1e-13)


def test_irrational_frequencies_need_turns():
    with pytest.raises(GeometryError, match="no common period: give turns"):
        Lissajous(amplitudes=1.0, frequencies=(1, np.sqrt(2)), phases=(0.3, 0.0))
    curve = Lissajous(amplitudes=1.0, frequencies=(1, np.sqrt(2)), phases=(0.3, 0.0), turns=1.5)
    assert not curve.closed
    assert_allclose(curve.domain, (0.0, 3 * np.pi))


def test_a_lissajous_that_runs_back_on_itself_is_refused():
    # cos t, cos 2t: a parabola there and back; a quarter of a radian of phase opens it
    with pytest.raises(GeometryError, match="stops at parameter 0 rad and runs back"):
        Lissajous(amplitudes=1.0, frequencies=(1, 2), phases=(np.pi / 2, np.pi / 2))
    Lissajous(amplitudes=1.0, frequencies=(1, 2), phases=(np.pi / 2, np.pi / 2 + 0.25))
    # the stretch before the stop is a sound open curve, past it is not
    stop = {"amplitudes": 1.0, "frequencies": (1, 1), "phases": 0.0}
    Lissajous(**stop, turns=0.2)
    with pytest.raises(GeometryError, match=r"stops at parameter 1\.5708 rad"):
        Lissajous(**stop, turns=0.3)


# -- foot points and fields ------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["heart", "star"])
def test_foot_points_of_points_beside_the_curve(name):
    contour = CURVES[name]
    places = np.linspace(0.1, 6.1, 40)
    frame = jax.jit(jax.vmap(contour.frenet))(places)
    reach = np.minimum(2e-4, 0.5 / np.abs(np.asarray(frame.curvature)))
    points = rows(contour, places, 0)[:, 0] + reach[:, None] * np.asarray(frame.normal)
    foot = foot_point(contour, points, near=places + 0.003)
    assert_allclose(foot.distance, -reach, rtol=0, atol=1e-15)
    assert_allclose(foot.parameter, places, rtol=0, atol=1e-9)


def test_every_field_changes_the_curve():
    changes = {
        "parabola": {"coefficient": 40.0, "center": (0.0, 0.0), "rotation": 0.0},
        "figure of eight": {"half_sizes": (0.02, 0.02), "start_angle": 0.3, "center": (0.0, 0.1)},
        "lissajous in space": {"amplitudes": 0.1, "frequencies": (1, 3, 2), "phases": 0.1},
        "sinusoid": {"amplitude": 0.1, "wavelength": 0.1, "phase": 0.0},
        "heart": {"radius": 0.1, "smoothing": 0.2},
        "spiral": {"start_radius": 0.02, "pitch": -0.001},
        "involute": {"base_radius": 0.1},
        "star": {"outer_radius": 0.1, "inner_radius": 0.01, "points": 6},
    }
    for name, fields in changes.items():
        before = np.asarray(CURVES[name].position(0.01))
        for field, value in fields.items():
            after = np.asarray(replace(CURVES[name], **{field: value}).position(0.01))
            assert np.abs(after - before).max() > 1e-6, f"{name}: {field}"


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Parabola(coefficient=0, half_width=1), GeometryError, "coefficient must not be 0"),
        (lambda: Parabola(coefficient=1, half_width=0), ConfigurationError, "half_width must be >"),
        (
            lambda: Parabola(coefficient=np.nan, half_width=1),
            ConfigurationError,
            "coefficient must be finite",
        ),
        (
            lambda: Parabola(coefficient=1, half_width=1, center=(0, 0, 0)),
            GeometryError,
            "center must have 2",
        ),
        (lambda: FigureEight(half_sizes=0.1), GeometryError, "half_sizes must have 2"),
        (lambda: FigureEight(half_sizes=(1, 0)), ConfigurationError, "half_sizes must be > 0 m"),
        (lambda: Sinusoid(amplitude=0, wavelength=1), ConfigurationError, "amplitude must be > 0"),
        (lambda: Sinusoid(amplitude=1, wavelength=-1), ConfigurationError, "wavelength must be >"),
        (
            lambda: Sinusoid(amplitude=1, wavelength=1, periods=0),
            ConfigurationError,
            "periods must be > 0",
        ),
        (lambda: Heart(radius=1, smoothing=0), ConfigurationError, "smoothing must be > 0"),
        (lambda: Heart(radius=np.inf), ConfigurationError, "radius must be finite"),
        (lambda: Spiral(start_radius=1, pitch=0, turns=1), ConfigurationError, "pitch must not be"),
        (
            lambda: Spiral(start_radius=1, pitch=-1, turns=1.5),
            ConfigurationError,
            "lead through the centre",
        ),
        (lambda: Spiral(start_radius=-1, pitch=1, turns=1), ConfigurationError, "start_radius"),
        (
            lambda: Involute(base_radius=1, start_angle=2, end_angle=1),
            ConfigurationError,
            "end_angle must be > start_angle",
        ),
        (
            lambda: Star(outer_radius=1, inner_radius=2),
            ConfigurationError,
            "inner_radius must be <= outer_radius",
        ),
        (
            lambda: Star(outer_radius=2, inner_radius=1, points=1),
            ConfigurationError,
            "points must be a whole number >= 2, got 1",
        ),
        (lambda: Lissajous(amplitudes=1, frequencies=(1,)), GeometryError, "two or more numbers"),
        (lambda: Lissajous(amplitudes=1, frequencies=(1, -2)), GeometryError, "numbers > 0"),
        (lambda: Lissajous(amplitudes=1, frequencies=(1, np.nan)), GeometryError, "numbers > 0"),
        (lambda: Lissajous(amplitudes=1, frequencies=("1", 2)), GeometryError, "numbers > 0"),
        (lambda: Lissajous(amplitudes=1, frequencies=3), GeometryError, "two or more numbers"),
        (
            lambda: Lissajous(amplitudes=(1, 2, 3), frequencies=(1, 2)),
            GeometryError,
            "amplitudes must be one number or 2",
        ),
        (lambda: CURVES["star"].derivatives(0.0, -1), GeometryError, "order must be >= 0"),
        (
            lambda: CURVES["lissajous in space"].derivatives(0.0, -1),
            GeometryError,
            "order must be >= 0",
        ),
    ],
)
def test_mistakes_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()
