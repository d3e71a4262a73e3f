"""Newton's method for the foot point: its rate, its miss on a moving path, its safeguards."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import (
    NewtonEstimator,
    OsculatingCircleEstimator,
    TangentEstimator,
    VariableGainEstimator,
)
from contourlab.contours import Circle, Ellipse, Helix, Line, Path, foot_point, read_gcode_text
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.recordings import Reference
from contourlab.testing.estimators import check_estimator
from contourlab.testing.protocol import run
from contourlab.testing.samples import make_samples

from .off_contour import Curve, estimates, sample

ELLIPSE = Ellipse(semi_axes=(0.03, 0.01), rotation=0.3)


def parabola(h):
    """[GhaffariUlsoy]'s contour, in metres, open far beyond where it is run."""
    return Curve(function=lambda x: jnp.stack([x, h * x**2]), span=(-0.1, 0.1))


def constant_rate(contour, start, rate, n, sample_time):
    zero = np.zeros(n)
    return Reference.along(
        contour, sample_time=sample_time, parameter=start + rate * sample_time * np.arange(n),
        parameter_rate=rate + zero, parameter_acceleration=zero, parameter_jerk=zero,
    )  # fmt: skip


def test_conformance_converged():
    helix = Helix(radius=0.02, pitch=0.01, turns=1.3, axis=[0.3, 0.1, 1.0])
    # the checks move the foot by half the least radius a sample, hence more iterations
    check_estimator(NewtonEstimator(iterations=6), contours=[ELLIPSE, helix])


def test_conformance_in_time():
    # the checks run round in 60 samples: what converges in time misses by a good part of the curve
    for form in ("projected", "filtered"):
        check_estimator(
            NewtonEstimator(form=form, hessian="approximate"), contours=[ELLIPSE], tolerance=0.04
        )


# L²/2ρ and so on, in µm: h_r [1/m], T_r [s], L [mm], then the largest error after 50 ms of the raw
# norm, of the projected one, of tangent, Koren-Lo and circle; an independent prototype's figures
TABLE = [
    (50, 2, 0.05, "71.33 0.0798 0.1252 0.0200 0.0002"),
    (50, 2, 0.5, "70.04 0.0798 12.525 0.2563 0.2448"),
    (50, 2, 2.0, "75.30 0.0798 200.39 16.540 16.502"),
    (50, 1, 0.5, "155.87 0.3194 12.525 0.2563 0.2448"),
    (100, 2, 0.5, "142.58 0.1594 25.099 1.0213 0.9964"),
    (100, 1, 2.0, "311.64 0.6377 401.43 70.883 70.393"),
]


@pytest.mark.parametrize(("h", "duration", "lag", "row"), TABLE)
def test_the_papers_parabola(h, duration, lag, row):
    contour, dt, a = parabola(float(h)), 1e-4, 0.02
    n = round(duration / dt) + 1
    rate = 2.0 * a / duration
    s = -a + rate * dt * np.arange(n)
    foot = s - 1e-3 * lag
    slope = np.stack([np.ones(n), 2.0 * h * foot], axis=1)
    left = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / np.linalg.norm(slope, axis=1)[:, None]
    points = np.stack([foot, h * foot**2], axis=1) - 2e-5 * left
    found = []
    for form in ("filtered", "projected"):
        estimator = NewtonEstimator(form=form, hessian="approximate").bind(contour, dt)
        found.append(over(estimator, jnp.asarray(s), jnp.asarray(points)))
    for estimator in (TangentEstimator(), VariableGainEstimator(), OsculatingCircleEstimator()):
        found.append(estimates(estimator, contour, s, points, 2))
    after = np.arange(n) * dt > 0.05
    for vectors, text in zip(found, row.split(), strict=True):
        side = np.sign(np.sum(vectors * left, axis=1))
        size = np.linalg.norm(vectors, axis=1)
        size = size if vectors is found[0] else side * size
        worst = 1e6 * np.max(np.abs(size - 2e-5)[after])
        # half the last digit; the raw norm still holds 2 mm exp(-c'/2 50 ms) of the start, 0.01 µm
        # integrated otherwise there
        digit = 0.03 if vectors is found[0] else 0.51 * 10.0 ** -len(text.partition(".")[2])
        assert_allclose(worst, float(text), rtol=0, atol=digit)


@jax.jit
def over(estimator, parameters, points):
    zero = jnp.zeros((1, 2))

    def step(state, now):
        vector, state = estimator.step(state, sample(zero, now[1], now[0]))
        return state, vector

    state = estimator.init(sample(zero, points[0], parameters[0]))
    return jax.lax.scan(step, state, (parameters, points))[1]


@pytest.mark.parametrize("form", ["filtered", "projected"])
@pytest.mark.parametrize("filter_rate", [np.inf, 500.0])
def test_on_a_moving_path_the_miss_is_speed_over_rate(form, filter_rate):
    """Type 1: a ramp is followed V/k' behind, whatever the filter; on a line nothing else is."""
    line = Line(start=(0.0, 0.0), end=(0.3, 0.4))
    speed, dt, n = 0.05, 1e-3, 120
    newton = NewtonEstimator(form=form, convergence_rate=400.0, filter_rate=filter_rate)
    bound = newton.bind(line, dt)
    aside = np.array([-0.8, 0.6]) * 2e-5
    samples = make_samples(
        line, n, dt, newton.needs, error=aside,
        reference=constant_rate(line, 0.1, speed, n, dt),
    )  # fmt: skip
    vectors, _ = run(bound, samples)
    along = np.array([0.6, 0.8])
    expected = -speed / 400.0 if form == "filtered" else 0.0
    # the start has died out as exp(-c'/2 t), e^-30, or 0.6^120
    assert_allclose(vectors[-1] @ along, expected, rtol=1e-9, atol=1e-15)
    assert_allclose(vectors[-1] @ aside, aside @ aside, rtol=1e-9)


def rate_near_the_foot(hessian, at, offset):
    """Decay per second of the error of θ̂ on a standing foot, over five samples; no filter."""
    dt, k = 1e-4, 1000.0
    newton = NewtonEstimator(
        form="projected", hessian=hessian, convergence_rate=k, filter_rate=np.inf
    ).bind(ELLIPSE, dt)
    frame = ELLIPSE.frenet(at)
    point = ELLIPSE.position(at) + offset * frame.normal
    now = sample(jnp.zeros((1, 2)), point, at + 1e-5)
    state, away = newton.init(now), []
    for _ in range(6):
        away.append(float(state.parameter) - at)
        _, state = newton.step(state, now)
    per_sample = (away[-1] / away[0]) ** 0.2
    return (1.0 - per_sample) / dt, 1.0 - float(offset * frame.curvature)


@pytest.mark.parametrize("offset", [2e-3, -2e-3, 0.0])
def test_newtons_rate_is_the_gain_whatever_the_shape_and_gradient_descents_is_not(offset):
    """(13). The ellipse's curvature runs from 11 to 300 per metre, its speed from 10 to 30 mm."""
    for at in (0.05, 0.8, 1.5):
        slope = np.linalg.norm(ELLIPSE.derivatives(at, 1)[1])
        full, share = rate_near_the_foot("full", at, offset)
        approximate, _ = rate_near_the_foot("approximate", at, offset)
        gradient, _ = rate_near_the_foot("gradient", at, offset)
        # 1e-5 from the foot in the parameter: the next order is relatively as small, times a few
        assert_allclose(full, 1000.0, rtol=1e-3)
        assert_allclose(approximate, 1000.0 * share, rtol=1e-3)  # 1 - δ κ
        assert_allclose(gradient, 1000.0 * share * (slope / 0.03) ** 2, rtol=1e-3)


@pytest.mark.parametrize("start", [5e-4, 0.0])
def test_the_distances_local_maximum_does_not_hold_the_estimate(start):
    """P on the axis, beyond the centre of curvature: two feet, and at 0 a maximum of J."""
    contour = parabola(50.0)
    point = jnp.array([0.0, 0.012])
    # with (11) the rate at the feet is 1 - 1/1.4 of k': 0.71 a step
    for form, count in (("converged", 1), ("projected", 400)):
        for hessian, steps in (("full", 20), ("approximate", 80)):
            fixed = {"iterations": steps} if form == "converged" else {}
            bound = NewtonEstimator(form=form, hessian=hessian, **fixed).bind(contour, 1e-3)
            near = jnp.full(count, start)
            vectors = over(bound, near, jnp.tile(point, (count, 1)))
            # θ* = sqrt((2 h y - 1) / 2) / h, |E|² = θ*² + (h θ*² - y)², by hand
            assert_allclose(np.linalg.norm(vectors[-1]), 11.8321596e-3, atol=1e-9)


def test_an_open_contour_ends():
    line = Line(start=(0.0, 0.0), end=(0.03, 0.04))
    for form in ("converged", "filtered"):
        bound = NewtonEstimator(form=form).bind(line, 1e-3)
        beyond = jnp.tile(jnp.array([0.036, 0.048]), (100, 1))
        vectors = over(bound, jnp.full(100, 0.9 * line.domain[1]), beyond)
        assert_allclose(vectors[-1], [-0.006, -0.008], atol=1e-15)


def test_a_closed_contour_goes_round():
    circle = Circle(radius=0.02)
    bound = NewtonEstimator().bind(circle, 1e-3)
    angles = jnp.linspace(6.0, 19.0, 200)
    points = 0.021 * jnp.stack([jnp.cos(angles), jnp.sin(angles)], axis=1)
    vectors = over(bound, angles + 0.1, points)
    assert_allclose(vectors, -points / 21.0, atol=1e-15)


def test_converged_is_exact_where_the_foot_moves_a_tenth_of_the_radius_a_sample():
    """10 % of 3.3 mm at the tips, the reference 3 times as far; points 20 µm inside."""
    bound = NewtonEstimator().bind(ELLIPSE, 1e-3)
    angles = jnp.arange(0.0, 2.0 * np.pi, 0.033)
    frames = jax.vmap(ELLIPSE.frenet)(angles)
    vectors = over(bound, angles + 0.1, jax.vmap(ELLIPSE.position)(angles) + 2e-5 * frames.normal)
    # rounding of 30 mm, and of the distance: the parameter is no better than that
    assert_allclose(vectors, -2e-5 * frames.normal, atol=1e-15)
    once = NewtonEstimator(iterations=1).bind(ELLIPSE, 1e-3)
    rough = over(once, angles + 0.1, jax.vmap(ELLIPSE.position)(angles) + 2e-5 * frames.normal)
    assert np.max(np.abs(rough + 2e-5 * frames.normal)) > 1e-8  # so that the test can fail


def test_a_path_is_followed_from_piece_to_piece():
    program = "G21 G90 G17 G1 F1000 X10 Y0\nG3 X20 Y10 J10\nG1 Y30\nM2\n"
    path = read_gcode_text(program, axes=("X", "Y")).path
    where = jnp.linspace(0.001, float(path.length) - 0.001, 300)
    tangents = jax.vmap(lambda s: path.derivatives(s, 1)[1])(where)
    aside = jnp.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    vectors = over(
        NewtonEstimator().bind(path, 1e-3),
        where + 5e-4,
        jax.vmap(path.position)(where) + 1e-5 * aside,
    )
    assert_allclose(vectors, -1e-5 * aside, atol=1e-15)


@pytest.mark.parametrize("side", [1e-5, -1e-5])
def test_a_corner_holds_the_estimate_no_longer_than_the_reference_is_away(side):
    path = Path.polyline([(0.0, 0.0), (0.02, 0.0), (0.02, 0.02), (0.05, 0.03)])
    lag = 5e-4
    where = jnp.linspace(2e-3, float(path.length) - 1e-3, 400)
    tangents = jax.vmap(lambda s: path.derivatives(s, 1)[1])(where - lag)
    points = jax.vmap(path.position)(where - lag)
    points = points + side * jnp.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    found = np.linalg.norm(over(NewtonEstimator().bind(path, 1e-3), where, points), axis=1)
    exact = foot_point(path, np.asarray(points), near=np.asarray(where)).distance
    exact = np.abs(exact)  # signed in the plane
    assert np.max(np.abs(found - exact)) < lag  # 20 mm before it began anew
    beyond = np.abs(np.asarray(where - lag)[:, None] - np.asarray(path.breaks)).min(axis=1) > 2e-3
    assert_allclose(found[beyond], exact[beyond], atol=1e-15)


def test_what_has_no_effect_or_no_stability_is_refused():
    with pytest.raises(ConfigurationError, match="iterations has no effect in the form 'filtered'"):
        NewtonEstimator(form="filtered", iterations=3)
    with pytest.raises(ConfigurationError, match="filter_rate has no effect in the form 'conv"):
        NewtonEstimator(filter_rate=100.0)
    with pytest.raises(ConfigurationError, match="gradient descent does not converge"):
        NewtonEstimator(hessian="gradient")
    with pytest.raises(ConfigurationError, match="convergence_rate must be > 0 1/s, got -1"):
        NewtonEstimator(form="filtered", convergence_rate=-1.0)
    with pytest.raises(ConfigurationError, match="iterations must be a whole number >= 1"):
        NewtonEstimator(iterations=0)
    with pytest.raises(RefusedError, match="call bind"):
        NewtonEstimator().estimate(sample(jnp.zeros((1, 2)), jnp.zeros(2)))


def test_the_limit_of_stability_is_two_samples_and_lower_with_a_slow_filter():
    line = Line(start=(0.0, 0.0), end=(1.0, 0.0))
    for k, c, stable in (
        (1990.0, np.inf, True), (2010.0, np.inf, False), (500.0, 500.0, True),
        (5000.0, 100.0, False), (1500.0, 100.0, True),
    ):  # fmt: skip
        newton = NewtonEstimator(form="projected", convergence_rate=k, filter_rate=c)
        if stable:
            newton.bind(line, 1e-3)
        else:
            with pytest.raises(RefusedError, match=r"is not stable at a sample time of 0\.001 s"):
                newton.bind(line, 1e-3)
