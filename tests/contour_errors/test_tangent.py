"""The tangent line: exact on lines, off by κ t² / 2 elsewhere."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import TangentEstimator
from contourlab.contours import Circle, Helix
from contourlab.testing.estimators import check_estimator
from contourlab.testing.samples import make_samples, sample_at


def test_conformance():
    check_estimator(TangentEstimator())


@pytest.mark.parametrize("lag", [1e-4, 1e-3])
def test_the_error_on_a_circle_is_curvature_times_lag_squared_over_two(lag):
    circle = Circle(radius=0.03)
    needs = TangentEstimator().needs
    samples = make_samples(circle, 5, needs=needs)
    sample = sample_at(samples, 2)
    angle = circle.wrap(sample.reference.parameter) - lag / 0.03  # a point of the circle behind
    sample = _at(sample, circle.position(angle))
    estimate = TangentEstimator().estimate(sample)
    # 1 - cos = x²/2 up to x⁴/24, relatively x²/12
    assert_allclose(np.linalg.norm(estimate), lag**2 / 0.03 / 2, rtol=(lag / 0.03) ** 2)


def test_the_order_of_the_error_in_the_lag_is_two():
    helix = Helix(radius=0.03, pitch=0.02, turns=2.0)
    sample = sample_at(make_samples(helix, 5, needs=TangentEstimator().needs), 2)
    lags = np.array([4e-3, 2e-3, 1e-3]) / 0.03
    found = [
        np.linalg.norm(
            TangentEstimator().estimate(
                _at(sample, helix.position(sample.reference.parameter - lag))
            )
        )
        for lag in lags
    ]
    assert_allclose(np.diff(np.log(found)) / np.diff(np.log(lags)), 2.0, atol=0.02)


def _at(sample, position):
    return jax.tree.map(lambda x: x, sample).__class__(
        time=sample.time, reference=sample.reference, geometry=sample.geometry,
        preview=sample.preview, position=position, velocity=sample.velocity,
    )  # fmt: skip
