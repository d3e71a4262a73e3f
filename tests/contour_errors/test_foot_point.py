"""The exact foot point as an estimator: right whatever the lag, and on the right branch."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contour_errors import FootPointEstimator
from contourlab.contours import Circle, Ellipse, Helix, Line, read_gcode_text
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.testing.estimators import check_estimator
from contourlab.testing.protocol import outputs
from contourlab.testing.samples import make_samples, rest_to_rest

from .off_contour import Curve, sample

EIGHT = Curve(
    function=lambda p: jnp.stack([0.03 * jnp.sin(p), 0.03 * jnp.sin(2.0 * p)]), goes_round=True
)


def test_conformance():
    check_estimator(FootPointEstimator(), contours=[Circle(radius=0.02)])


@pytest.mark.overnight  # compiles the search for every form of the curve
@pytest.mark.slow
def test_conformance_from_the_last_foot_in_space():
    helix = Helix(radius=0.02, pitch=0.01, turns=1.3, axis=[0.3, 0.1, 1.0])
    check_estimator(FootPointEstimator(near="last_foot"), contours=[helix])


@pytest.mark.parametrize("lag", [-2.5, 1e-3, 1.0, 3.0])
@pytest.mark.parametrize("radial", [-0.015, 1e-6, 0.05])
def test_a_circle_is_exact_whatever_the_lag(lag, radial):
    circle = Circle(radius=0.02)
    out = np.array([np.cos(1.0 - lag), np.sin(1.0 - lag)])
    bound = FootPointEstimator().bind(circle, 1e-3)
    found = bound.estimate(sample(circle.derivatives(1.0, 0), (0.02 + radial) * out, 1.0))
    assert_allclose(found, -radial * out, atol=1e-16)


def test_it_is_the_contour_error_by_which_recordings_are_judged():
    ellipse = Ellipse(semi_axes=(0.03, 0.01))
    estimator, reference = FootPointEstimator(), rest_to_rest(ellipse, 40)
    errors = 5e-3 * np.stack([np.sin(np.arange(40)), np.cos(2.0 * np.arange(40))], axis=1)
    samples = make_samples(ellipse, 40, needs=estimator.needs, error=errors, reference=reference)
    found = np.asarray(outputs(estimator.bind(ellipse, 1e-3), samples))
    judged = cl.contours.foot_point(ellipse, samples.position, near=reference.parameter)
    assert_allclose(found, judged.vector, atol=1e-15)


def test_at_the_end_of_a_line_it_goes_to_the_end():
    line = Line(start=(0.0, 0.0), end=(0.03, 0.04))
    bound = FootPointEstimator().bind(line, 1e-3)
    found = bound.estimate(sample(line.derivatives(0.04, 0), [0.036, 0.048], 0.04))
    assert_allclose(found, [-0.006, -0.008], atol=1e-16)


def test_outside_a_corner_it_goes_to_the_corner():
    path = read_gcode_text("G21 G90 G1 F1000 X10 Y0\nY10\nM2\n", axes=("X", "Y")).path
    bound = FootPointEstimator().bind(path, 1e-3)
    for near in (0.009, 0.0101):
        found = bound.estimate(sample(path.derivatives(near, 0), [0.0103, -0.0004], near))
        assert_allclose(found, [-0.0003, 0.0004], atol=1e-16)


def test_at_a_crossing_the_reference_or_the_last_foot_chooses_the_branch():
    """The tool is on one branch, the reference 10 mm ahead, beyond the crossing."""
    foot = -0.05
    frame = EIGHT.frenet(foot)
    point = EIGHT.position(foot) + 1e-5 * frame.normal
    for near in ("reference", "last_foot"):
        bound = FootPointEstimator(near=near).bind(EIGHT, 1e-3)
        state = bound.init(sample(jnp.zeros((1, 2)), point, foot))
        for parameter in (foot, 0.05, np.pi):
            found, state = bound.step(state, sample(jnp.zeros((1, 2)), point, parameter))
            if near == "last_foot" or parameter != np.pi:
                assert_allclose(found, -1e-5 * frame.normal, atol=1e-15)
            else:  # the other branch, through the same crossing
                assert np.linalg.norm(found) > 1e-4


def test_mistakes_are_named():
    with pytest.raises(ConfigurationError, match="near must be one of the allowed values"):
        FootPointEstimator(near="tool")
    with pytest.raises(RefusedError, match="call bind"):
        FootPointEstimator().estimate(sample(jnp.zeros((1, 2)), jnp.zeros(2)))
