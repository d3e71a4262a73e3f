"""f/|∇f|: zero on the contour, off by the square of the error beside it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import GlobalTaskFrameEstimator
from contourlab.contours import Circle, Ellipse, Heart, Helix
from contourlab.errors import RefusedError
from contourlab.testing.estimators import check_estimator

from .off_contour import sample

ESTIMATOR = GlobalTaskFrameEstimator()
ELLIPSE = Ellipse(semi_axes=(0.2, 0.1), center=(0.0, 0.1))  # of [HuYaoWang]
BOUND = ESTIMATOR.bind(ELLIPSE, 1e-3)


def outwards(angle):
    """Point and outward normal of the ellipse."""
    normal = np.array([np.cos(angle) / 0.2, np.sin(angle) / 0.1])
    return np.asarray(ELLIPSE.position(angle)), normal / np.linalg.norm(normal)


def test_conformance():
    # beside the contour it is off by δ² n·Hn / 2|∇f|: 1e-10/2/0.0033 m at the ellipse's tip
    curves = [
        Circle(radius=0.02, center=(0.01, 0.0)),
        Ellipse(semi_axes=(0.03, 0.01), rotation=0.3),
    ]
    check_estimator(ESTIMATOR, tolerance=1.6e-8, contours=curves)


# r_c - δ in µm at the bottom, at 45° of the eccentric angle, at the side: an independent prototype
TABLE = {
    36e-6: ("-0.006478", "-0.006965", "-0.003239"),
    100e-6: ("-0.04995", "-0.05371", "-0.02499"),
    1e-3: ("-4.9505", "-5.3257", "-2.4876"),
    5e-3: ("-119.05", "-128.33", "-60.976"),
    -1e-3: ("-5.0505", "-5.4269", "-2.5126"),
    -5e-3: ("-131.58", "-141.00", "-64.103"),
}


@pytest.mark.parametrize("delta", TABLE)
def test_the_coordinate_is_off_the_distance_by_the_published_ellipses_figures(delta):
    for angle, text in zip((-np.pi / 2, -np.pi / 4, 0.0), TABLE[delta], strict=True):
        point, normal = outwards(angle)
        error = BOUND.estimate(sample(ELLIPSE.derivatives(1.0, 0), point + delta * normal))
        coordinate = np.linalg.norm(error) * np.sign(delta)
        digit = 10.0 ** -len(text.partition(".")[2])
        assert_allclose(1e6 * (coordinate - delta), float(text), rtol=0, atol=0.51 * digit)


def test_the_second_order_is_that_of_the_hessian():
    for angle in (0.3, 1.2, -2.0):
        point, normal = outwards(angle)
        gradient = jax.grad(ELLIPSE.level)(jnp.asarray(point))
        hessian = jax.hessian(ELLIPSE.level)(jnp.asarray(point))
        expected = normal @ hessian @ normal / np.linalg.norm(gradient) / 2.0
        for delta in (1e-4, -1e-4):
            error = BOUND.estimate(sample(ELLIPSE.derivatives(0.0, 0), point + delta * normal))
            coordinate = np.linalg.norm(error) * np.sign(delta)
            # the next order, δ³, relatively δ / 0.1 m and some
            assert_allclose((delta - coordinate) / delta**2, expected, rtol=5e-3)


def test_the_reference_point_does_not_matter():
    point, normal = outwards(0.6)
    found = [
        BOUND.estimate(sample(ELLIPSE.derivatives(p, 0), point + 1e-3 * normal)) for p in (0.0, 3.0)
    ]
    assert_allclose(found[0], found[1], rtol=0, atol=0)


def test_at_the_centre_it_goes_to_the_reference_point():
    at = sample(ELLIPSE.derivatives(0.0, 0), jnp.array([0.0, 0.1]))
    assert_allclose(BOUND.estimate(at), [0.2, 0.0], atol=1e-17)
    slope = jax.jacrev(lambda p: BOUND.estimate(sample(at.geometry, p)))(at.position)
    assert np.all(np.isfinite(slope))


def test_what_has_no_implicit_form_is_refused_with_a_way_out():
    heart = Heart(radius=0.02)
    with pytest.raises(RefusedError, match=r"implicit form.*Heart has none.*use FootPoint"):
        ESTIMATOR.bind(heart, 1e-3)
    for spatial in (
        Helix(radius=0.02, pitch=0.01, turns=1.0),
        Circle(radius=0.02, center=(0, 0, 0), normal=(0, 0, 1)),
    ):
        with pytest.raises(RefusedError, match="contours with 2 coordinates, this one has 3"):
            ESTIMATOR.bind(spatial, 1e-3)
    with pytest.raises(RefusedError, match="call bind"):
        ESTIMATOR.estimate(sample(jnp.zeros((1, 2)), jnp.zeros(2)))
