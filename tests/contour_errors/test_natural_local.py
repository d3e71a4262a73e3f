"""The natural local approximation: the paper's coordinates, and its extension by κ'."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import ExtendedNaturalLocalEstimator, NaturalLocalEstimator
from contourlab.contours import Ellipse, curvature_derivatives
from contourlab.testing.estimators import check_estimator

from .off_contour import Curve, beside, estimates, sample

PRINTED, EXTENDED = NaturalLocalEstimator(), ExtendedNaturalLocalEstimator()
PERPENDICULAR = ExtendedNaturalLocalEstimator(perpendicular=True)
CUBIC = Curve(
    function=lambda p: jnp.stack([0.02 * p, 0.03 * p**2, 0.05 * p**3 + 0.01 * p]),
    dimension=3, span=(-1.0, 1.0),
)  # fmt: skip
CURVES = {"ellipse": Ellipse(semi_axes=(0.03, 0.01), rotation=0.4), "cubic": CUBIC}


@pytest.mark.parametrize("estimator", [PRINTED, EXTENDED])
def test_conformance(estimator):
    check_estimator(estimator)


def test_conformance_of_the_perpendicular_form():
    check_estimator(PERPENDICULAR, contours=[CURVES["ellipse"], CUBIC])


@pytest.mark.parametrize("curve", CURVES)
def test_the_vector_is_the_papers_pair_in_the_frenet_frame(curve):
    contour, parameters = CURVES[curve], np.array([-0.7, 0.1, 0.5])
    points, _ = beside(contour, parameters, 1e-3, 2e-5, -3e-5)
    found = {e: estimates(e, contour, parameters, points) for e in (PRINTED, EXTENDED)}
    for k, (parameter, point) in enumerate(zip(parameters, points, strict=True)):
        frame = contour.frenet(parameter)
        change = curvature_derivatives(contour.derivatives(parameter, 3))
        axes = [frame.tangent, frame.normal]
        axes += [frame.binormal] if contour.n_axes == 3 else []
        f = np.stack(axes) @ np.asarray(point - contour.position(parameter))
        t, n = f[0], f[1]
        curvature, slope = change.curvature[0], change.curvature[1]
        expected = [0.0, n - curvature * t**2 / 2.0]  # (15)
        more = [0.0, -slope * t**3 / 6.0]
        if contour.n_axes == 3:
            expected.append(f[2] - curvature * change.torsion[0] * t**3 / 6.0)  # (16)
            more.append(0.0)
            assert abs(curvature * change.torsion[0] * t**3) > 1e-9  # the term matters
        # rounding of coordinates of 30 mm
        assert_allclose(np.stack(axes) @ found[PRINTED][k], -np.array(expected), atol=1e-16)
        expected = np.array(expected) + more
        assert_allclose(np.stack(axes) @ found[EXTENDED][k], -expected, atol=1e-16)


@pytest.mark.parametrize("estimator", [PRINTED, EXTENDED, PERPENDICULAR])
def test_more_coordinates_change_nothing(estimator):
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(5, 5)))
    embed = turn[:, :3]
    geometry = CUBIC.derivatives(0.3, 3)
    point = CUBIC.position(0.25) + np.array([1e-5, 2e-5, -3e-5])
    flat = estimator.estimate(sample(geometry, point))
    lifted = estimator.estimate(sample(geometry @ embed.T, embed @ point + 4e-5 * turn[:, 3]))
    assert_allclose(lifted, embed @ flat - 4e-5 * turn[:, 3], atol=1e-17)


@pytest.mark.parametrize("estimator", [PRINTED, EXTENDED, PERPENDICULAR])
@pytest.mark.parametrize("curvature", [0.0, 1e-300, 1e-160, 1e-30, 1e-8])
def test_a_straight_stretch_in_space_is_no_special_case(estimator, curvature):
    geometry = jnp.zeros((4, 3)).at[1, 0].set(1.0).at[2, 1].set(curvature)
    point = jnp.array([1e-3, -2e-5, 3e-5])
    found = estimator.estimate(sample(geometry, point))
    # perpendicular to the slope κ t of the curve at t
    along = -curvature * 1e-3 * 2e-5 if estimator == PERPENDICULAR else 0.0
    assert_allclose(found, [along, 2e-5 + curvature * 5e-7, -3e-5], rtol=1e-6, atol=1e-19)
    slope = jax.jacrev(lambda g: estimator.estimate(sample(g, point)))(geometry)
    assert np.all(np.isfinite(slope))


def test_through_a_spatial_inflection_the_extended_estimate_has_no_jump():
    """r'' passes zero at p = 0; the principal normal turns by 180° there."""
    curve = Curve(
        function=lambda p: jnp.stack([0.02 * p, 0.03 * p**3, 0.02 * p**4]),
        dimension=3, span=(-1.0, 1.0),
    )  # fmt: skip
    parameters = np.array([-1e-9, 0.0, 1e-9])
    points = np.tile(np.asarray(curve.position(-0.1)), (3, 1))
    found = estimates(EXTENDED, curve, parameters, points)
    # the reference moves 20 pm
    assert_allclose(found[[0, 2]], found[[1, 1]], rtol=0, atol=1e-10)
    # what is left is the fourth derivative: 20 mm * 0.1^4
    assert_allclose(np.linalg.norm(found, axis=1), 2e-6, rtol=0.01)


def test_a_cusp_gives_the_vector_to_the_reference_point():
    geometry = jnp.zeros((4, 2)).at[2, 0].set(1.0)
    for estimator in (PRINTED, EXTENDED, PERPENDICULAR):
        found = estimator.estimate(sample(geometry, jnp.array([1e-3, 2e-3])))
        assert_allclose(found, [-1e-3, -2e-3], atol=0)


def test_perpendicular_is_a_flag_and_no_number():
    assert dataclasses.replace(EXTENDED, perpendicular=True) == PERPENDICULAR
    assert not jax.tree.leaves(PERPENDICULAR)
