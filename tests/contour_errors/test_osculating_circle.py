"""The circle of curvature: exact on circles, third order elsewhere, safe at zero curvature."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import OsculatingCircleEstimator, TangentEstimator
from contourlab.contours import Circle, Ellipse, Helix
from contourlab.testing.estimators import check_estimator
from contourlab.testing.samples import make_samples, sample_at

ESTIMATOR = OsculatingCircleEstimator()


def at(contour, parameter, position, geometry=None):
    """One sample with its reference point at a parameter."""
    sample = sample_at(make_samples(contour, 3, needs=ESTIMATOR.needs), 0)
    geometry = contour.derivatives(parameter, 2) if geometry is None else geometry
    position = jnp.asarray(position)
    return dataclasses.replace(
        sample, geometry=geometry, position=position, velocity=jnp.zeros_like(position)
    )


def exact_circle(center, normal, radius, point):
    """From a point to the nearest point of a circle, in NumPy."""
    normal = normal / np.linalg.norm(normal)
    from_center = np.asarray(point) - center
    in_plane = from_center - normal * (normal @ from_center)
    return center + radius * in_plane / np.linalg.norm(in_plane) - point


def test_conformance():
    check_estimator(ESTIMATOR)


@pytest.mark.parametrize("lag", [-2.5, -0.3, 0.0, 1e-3, 1.0, 3.0])
@pytest.mark.parametrize("radial", [-0.02, 1e-6, 0.05])
def test_exact_on_a_circle_in_the_plane_whatever_the_lag(lag, radial):
    circle = Circle(radius=0.03, center=(0.01, 0.02))
    out = np.array([np.cos(1.0 - lag), np.sin(1.0 - lag)])
    point = np.array([0.01, 0.02]) + (0.03 + radial) * out
    estimate = ESTIMATOR.estimate(at(circle, 1.0, point))
    assert_allclose(estimate, -radial * out, atol=1e-16 / 0.03 * 0.1)  # rounding of coordinates


@pytest.mark.parametrize("lag", [-1.0, 1e-3, 2.0])
@pytest.mark.parametrize("height", [-0.03, 0.0, 1e-5])
def test_exact_on_a_circle_in_space(lag, height):
    center, normal, radius = np.array([0.0, 0.01, 0.02]), np.array([0.3, -0.2, 1.0]), 0.025
    circle = Circle(radius=radius, center=center, normal=normal)
    on_circle = np.asarray(circle.position(1.2 - lag))
    point = center + 1.2 * (on_circle - center) + height * normal / np.linalg.norm(normal)
    estimate = ESTIMATOR.estimate(at(circle, 1.2, point))
    assert_allclose(estimate, exact_circle(center, normal, radius, point), atol=1e-15)


def test_exact_on_a_circle_in_four_coordinates():
    rng = np.random.default_rng(0)
    q, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    radius, s = 0.02, 0.7
    # parameter with a speed that varies, so that r'' has a tangential part
    first, second = radius * (-np.sin(s) * q[0] + np.cos(s) * q[1]), None
    second = -radius * (np.cos(s) * q[0] + np.sin(s) * q[1])
    geometry = np.stack(
        [radius * (np.cos(s) * q[0] + np.sin(s) * q[1]), 2.0 * first, 4.0 * second + 3.0 * first]
    )
    point = 1.1 * radius * (np.cos(0.2) * q[0] + np.sin(0.2) * q[1]) + 0.004 * q[2] - 0.003 * q[3]
    sample = at(Circle(radius=1.0), 0.0, point, geometry)
    exact = -0.1 * radius * (np.cos(0.2) * q[0] + np.sin(0.2) * q[1]) - 0.004 * q[2] + 0.003 * q[3]
    assert_allclose(ESTIMATOR.estimate(sample), exact, atol=1e-16)


@pytest.mark.parametrize("curvature", [0.0, 1e-300, 1e-160, 1e-30, 1e-12, 1e-8])
@pytest.mark.parametrize("n", [2, 3])
def test_small_curvature_goes_over_into_the_tangent_line(curvature, n):
    axes = np.eye(n)
    geometry = np.stack([0.0 * axes[0], axes[0], curvature * axes[1]])
    point = np.array([1e-3, -2e-5, 3e-5])[:n]
    sample = at(Circle(radius=1.0), 0.0, point, geometry)
    line = TangentEstimator().estimate(sample)
    # what a circle adds: κ x² / 2 across, and κ x y along the tangent
    more = curvature * (5e-7 * axes[1] - 2e-8 * axes[0])
    assert_allclose(ESTIMATOR.estimate(sample), line + more, rtol=0.0, atol=1e-19)
    slope = jax.jacrev(lambda g: ESTIMATOR.estimate(dataclasses.replace(sample, geometry=g)))(
        jnp.asarray(geometry)
    )
    assert np.all(np.isfinite(slope))
    assert_allclose(slope[1, 2, 1], 0.5e-6, rtol=1e-6)  # of the y error in κ: x² / 2


def test_at_the_centre_it_goes_to_the_reference_point():
    circle = Circle(radius=0.25, center=(0.5, 0.0))  # dyadic, so that the centre is hit exactly
    sample = at(circle, 0.0, (0.5, 0.0))
    assert_allclose(ESTIMATOR.estimate(sample), [0.25, 0.0], atol=1e-16)
    slope = jax.jacrev(lambda p: ESTIMATOR.estimate(dataclasses.replace(sample, position=p)))(
        sample.position
    )
    assert np.all(np.isfinite(slope))


@pytest.mark.parametrize(
    "contour", [Ellipse(semi_axes=(0.03, 0.01)), Helix(radius=0.03, pitch=0.05, turns=2.0)]
)
def test_the_order_of_the_error_in_the_lag_is_three(contour):
    parameter = 0.8
    lags = np.array([0.04, 0.02, 0.01])
    found = [
        np.linalg.norm(ESTIMATOR.estimate(at(contour, parameter, contour.position(parameter - s))))
        for s in lags
    ]
    assert_allclose(np.diff(np.log(found)) / np.diff(np.log(lags)), 3.0, atol=0.1)


def test_the_error_on_a_helix_is_curvature_times_torsion_times_lag_cubed_over_six():
    helix = Helix(radius=0.03, pitch=0.05, turns=2.0)
    frenet, speed = helix.frenet(1.0), np.linalg.norm(helix.derivatives(1.0, 1)[1])
    lag = 1e-2
    error = np.linalg.norm(ESTIMATOR.estimate(at(helix, 1.0, helix.position(1.0 - lag))))
    expected = frenet.curvature * abs(frenet.torsion) * (lag * speed) ** 3 / 6.0
    assert_allclose(error, expected, rtol=1e-3)  # next order, relatively lag²
