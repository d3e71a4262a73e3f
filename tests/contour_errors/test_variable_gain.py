"""Koren and Lo's variable gains: the circle's distance expanded for small errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import VariableGainEstimator
from contourlab.contours import Circle, Ellipse, Helix, Line
from contourlab.errors import RefusedError
from contourlab.testing.estimators import check_estimator

from .off_contour import sample

ESTIMATOR = VariableGainEstimator()


def test_conformance():
    # beside the contour it is off by ε²/2ρ: 1e-10/2/0.0033 m at the ellipse's tip
    check_estimator(ESTIMATOR, tolerance=1.6e-8)


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_gains_are_koren_and_los(clockwise):
    """With the signed radius, so that a contour that turns right has ρ < 0."""
    circle = Circle(radius=0.02, center=(0.01, 0.0), clockwise=clockwise)
    parameter, point = 0.7, np.array([0.024, 0.016])
    geometry = np.asarray(circle.derivatives(parameter, 2))
    phi = np.arctan2(geometry[1, 1], geometry[1, 0])
    rho = -0.02 if clockwise else 0.02
    e = geometry[0] - point
    cx, cy = np.sin(phi) - e[0] / (2 * rho), np.cos(phi) + e[1] / (2 * rho)
    error, gains = ESTIMATOR.gains(sample(geometry, point))
    assert_allclose(gains, [-cx, cy], atol=1e-15)
    assert_allclose(error, -cx * e[0] + cy * e[1], atol=1e-17)
    vector = ESTIMATOR.estimate(sample(geometry, point))
    assert_allclose(vector, error * np.array([-cx, cy]) / np.hypot(cx, cy), atol=1e-17)


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("lag", [-1.0, 1e-3, 2.0])
@pytest.mark.parametrize("radial", [-2e-3, 1e-5])
def test_on_a_circle_the_lag_does_not_matter(clockwise, lag, radial):
    circle = Circle(radius=0.02, clockwise=clockwise)
    foot = np.asarray(circle.position(0.4 - lag))
    point = (1.0 + radial / 0.02) * foot
    found = ESTIMATOR.estimate(sample(circle.derivatives(0.4, 2), point))
    # |P - C|² = ρ² + 2 ρ ε; so |ε| = |δ + δ²/2ρ|, with δ > 0 outside
    assert_allclose(np.linalg.norm(found), abs(radial + radial**2 / 0.04), atol=1e-16)
    # towards the circle, half a lag off the radius, or a little more for the offset
    assert np.sign(found @ (foot - point)) == 1.0
    if lag == 1e-3:
        u, v = foot - point, found
        turned = (u[0] * v[1] - u[1] * v[0]) / abs(radial) / np.linalg.norm(found)
        way = -1.0 if clockwise else 1.0
        assert_allclose(turned, way * lag / 2.0, atol=0.07 * lag)


def test_a_line_is_exact():
    line = Line(start=(0.0, 0.0), end=(0.03, 0.04))
    point = np.array([0.01, -0.02])
    found = ESTIMATOR.estimate(sample(line.derivatives(0.2, 2), point))
    assert_allclose(
        found, -0.02 * np.array([0.8, -0.6]) * np.sign(0.8 * 0.01 + 0.6 * 0.02), atol=1e-17
    )


def test_where_both_gains_vanish_the_vector_does():
    geometry = jnp.array([[0.0, 0.0], [1.0, 0.0], [0.0, 4.0]])  # ρ = 0.25, exactly
    point = jnp.array([0.0, 0.5])
    assert_allclose(ESTIMATOR.estimate(sample(geometry, point)), 0.0, atol=0)
    slope = jax.jacrev(lambda p: ESTIMATOR.estimate(sample(geometry, p)))(point)
    assert np.all(np.isfinite(slope))


def test_the_order_in_the_lag_is_three_and_the_coefficient_that_of_the_curvature_change():
    ellipse = Ellipse(semi_axes=(0.03, 0.01))
    geometry = ellipse.derivatives(0.8, 2)
    lags = np.array([2e-2, 1e-2, 5e-3])
    found = [
        np.linalg.norm(ESTIMATOR.estimate(sample(geometry, ellipse.position(0.8 - h))))
        for h in lags
    ]
    assert_allclose(np.diff(np.log(found)) / np.diff(np.log(lags)), 3.0, atol=0.05)


def test_a_contour_in_space_is_refused():
    with pytest.raises(RefusedError, match="VariableGainEstimator is defined on contours with 2"):
        ESTIMATOR.bind(Helix(radius=0.02, pitch=0.01, turns=1.0), 1e-3)
