"""Estimates on the curves of [MengLouZhou], against figures of an independent prototype.

Mean and maximum over 200 parameters of | |estimate| - exact | in µm; the actual point lies a lag
behind, measured as lag over speed at the reference parameter, with an offset of 10 µm along the
normal (in space another 10 µm along the binormal).
"""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import (
    ExtendedNaturalLocalEstimator,
    NaturalLocalEstimator,
    OsculatingCircleEstimator,
    TangentEstimator,
)

from .off_contour import Curve, beside, estimates

TURN = 2.0 * np.pi
CURVES = {
    "helix": Curve(
        function=lambda p: jnp.stack([0.03 * jnp.cos(p), 0.01 * jnp.sin(p), 0.1 * p / TURN]),
        dimension=3,
    ),
    "ellipse": Curve(
        function=lambda p: jnp.stack([0.03 * (1.0 - jnp.cos(p)), 0.01 * jnp.sin(p)]),
        goes_round=True,
    ),
    "figure of eight": Curve(
        function=lambda p: jnp.stack([0.03 * (1.0 - jnp.cos(p)), 0.03 * jnp.sin(2.0 * p)]),
        goes_round=True,
    ),
}
ESTIMATORS = [
    TangentEstimator(), OsculatingCircleEstimator(), NaturalLocalEstimator(),
    ExtendedNaturalLocalEstimator(),
]  # fmt: skip
TABLE = [
    ("helix", 0.5, "3.299 8.784 0.032 0.098 0.031 0.085 0.002 0.006"),
    ("helix", 1.0, "14.72 39.29 0.262 0.793 0.252 0.681 0.015 0.043"),
    ("helix", 2.0, "63.63 165.9 2.123 5.549 1.967 5.965 0.165 0.533"),
    ("ellipse", 0.5, "4.604 17.60 0.296 1.450 0.295 1.424 0.012 0.089"),
    ("ellipse", 1.0, "25.91 130.3 2.377 12.33 2.332 11.12 0.243 1.428"),
    ("ellipse", 2.0, "121.7 579.5 16.54 111.8 15.49 87.42 1.897 9.774"),
    ("figure of eight", 1.0, "26.15 139.4 2.133 11.48 2.130 10.22 0.237 1.457"),
]


@pytest.mark.parametrize(("curve", "lag", "row"), TABLE, ids=[f"{c} {x} mm" for c, x, _ in TABLE])
def test_the_estimates_are_as_good_as_an_independent_prototype_found(curve, lag, row):
    contour, parameters = CURVES[curve], np.arange(200) * TURN / 200
    points, vectors = beside(contour, parameters, 1e-3 * lag, 1e-5, 1e-5)
    exact = np.linalg.norm(vectors, axis=1)
    printed = row.split()
    for k, estimator in enumerate(ESTIMATORS):
        found = np.linalg.norm(estimates(estimator, contour, parameters, points), axis=1)
        off = 1e6 * np.abs(found - exact)
        for value, text in ((off.mean(), printed[2 * k]), (off.max(), printed[2 * k + 1])):
            digit = 10.0 ** -len(text.partition(".")[2])
            # half of the last printed digit
            assert_allclose(value, float(text), rtol=0, atol=0.51 * digit, err_msg=f"{estimator}")
