"""How the error of each estimate grows with lag and offset, by slope and by coefficient."""

import importlib.util
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contour_errors import (
    ExtendedNaturalLocalEstimator,
    NaturalLocalEstimator,
    OsculatingCircleEstimator,
    TangentEstimator,
    VariableGainEstimator,
)
from contourlab.contours import Circle, Ellipse, arc_length_derivatives, curvature_derivatives

spec = importlib.util.spec_from_file_location(
    "off_contour", Path(__file__).parents[1] / "contour_errors" / "off_contour.py"
)
off_contour = importlib.util.module_from_spec(spec)
spec.loader.exec_module(off_contour)

EXTENDED = ExtendedNaturalLocalEstimator()
PERPENDICULAR = ExtendedNaturalLocalEstimator(perpendicular=True)
CUBIC = off_contour.Curve(
    function=lambda p: jnp.stack([0.02 * p, 0.03 * p**2, 0.05 * p**3]),
    dimension=3, span=(-1.0, 1.0),
)  # fmt: skip
CURVES = {"ellipse": (Ellipse(semi_axes=(0.03, 0.01)), 0.8), "twisted cubic": (CUBIC, 0.3)}
LAGS = np.array([1.6e-3, 8e-4, 4e-4, 2e-4])
STATIC = [
    (TangentEstimator(), 2),
    (OsculatingCircleEstimator(), 3),
    (NaturalLocalEstimator(), 3),
    (EXTENDED, 4),
    (PERPENDICULAR, 4),
    (VariableGainEstimator(), 3),
]
IDS = ["tangent", "circle", "natural local", "extended", "perpendicular", "variable gain"]


@jax.jit
def geometry(contour, at):
    rows = contour.derivatives(at, 4)
    return curvature_derivatives(rows), arc_length_derivatives(rows)


@jax.jit
def length_behind(contour, at, lag):
    """Return the arc length that a lag over the speed at the reference leaves."""
    speed = jnp.linalg.norm(contour.derivatives(at, 1)[1])
    return contour.arc_length(at - lag / speed, at)


def leading(name, contour, at):
    """Return the coefficient of the leading power of the lag without an offset, derived."""
    change, rows = geometry(contour, at)
    k, k1 = float(change.curvature[0]), float(change.curvature[1])
    torsion = float(change.torsion[0]) if contour.n_axes == 3 else 0.0
    rows = np.asarray(rows)
    fourth = rows[4] - rows[1] * (rows[1] @ rows[4]) + 4.0 * k**2 * rows[2]
    return {
        "tangent": abs(k) / 2.0,
        "circle": np.hypot(k1, k * torsion) / 6.0,
        "natural local": abs(k1) / 6.0,
        "extended": np.linalg.norm(fourth) / 24.0,
        "perpendicular": np.linalg.norm(fourth) / 24.0,
        "variable gain": abs(k1) / 6.0,
    }[name]


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize(("estimator", "order"), STATIC, ids=IDS)
def test_on_the_contour_the_error_has_its_order_and_coefficient_in_the_lag(estimator, order, curve):
    contour, at = CURVES[curve]
    if contour.n_axes not in (estimator.needs.coordinates or (contour.n_axes,)):
        return  # refused there, which its own tests look at
    name = IDS[[e for e, _ in STATIC].index(estimator)]
    found, lags = [], []
    for lag in LAGS:
        points, _ = off_contour.beside(contour, [at], lag)
        found.append(off_contour.estimates(estimator, contour, [at], points)[0])
        lags.append(float(length_behind(contour, at, lag)))
    found, lags = np.linalg.norm(found, axis=1), np.array(lags)
    slopes = np.diff(np.log(found)) / np.diff(np.log(lags))
    # the next order is relatively of the size lag / radius, 1 in 30 here
    assert_allclose(slopes[-1], order, atol=0.1)
    assert_allclose(found[-1] / lags[-1] ** order, leading(name, contour, at), rtol=0.1)


CIRCLE = Circle(radius=0.02)
OFFSET = 1e-5


def off_the_circle(estimator, lag, offset):
    """Return by how much length and vector are off, without the fourth order on the contour."""
    points, vectors = off_contour.beside(CIRCLE, [0.5], lag, offset)
    found = off_contour.estimates(estimator, CIRCLE, [0.5], points)[0]
    # on the circle itself the cubic is off by κ³ t⁴ / 8
    size = np.linalg.norm(found) - offset - (lag / 0.02) ** 3 * lag / 8.0
    return size, np.linalg.norm(found - vectors[0])


@pytest.mark.parametrize("estimator", [NaturalLocalEstimator(), EXTENDED], ids=IDS[2:4])
@pytest.mark.parametrize("lag", [4e-4, 2e-4])
def test_with_an_offset_the_order_falls_to_two(estimator, lag):
    """By δ (κ t)² / 2: the offset at equal t is not the distance. The direction is off by κ t."""
    size, vector = off_the_circle(estimator, lag, 1e-5)
    angle = lag / 0.02
    assert_allclose(size, 1e-5 * angle**2 / 2.0, rtol=0.01)
    assert_allclose(vector, 1e-5 * angle, rtol=0.01)


@pytest.mark.parametrize("offset", [4e-4, 2e-4])
@pytest.mark.parametrize("lag", [4e-4, 2e-4])
def test_the_perpendicular_form_is_of_second_order_in_the_offset(offset, lag):
    """By κ (κ t δ)² / 2 in size, and by the angle κ² t δ in direction."""
    size, vector = off_the_circle(PERPENDICULAR, lag, offset)
    assert_allclose(size, (offset * lag) ** 2 / 0.02**3 / 2.0, rtol=0.08)  # relatively 3 δ/ρ
    assert_allclose(vector, offset * (offset * lag / 0.02**2), rtol=0.03)


@pytest.mark.parametrize(("estimator", "order"), STATIC, ids=IDS)
def test_the_parameter_does_not_matter(estimator, order):
    """The same ellipse with a parameter that runs unevenly: what is used is geometry alone."""
    ellipse, at = CURVES["ellipse"]
    uneven = off_contour.Curve(function=lambda u: ellipse.position(u + 0.3 * jnp.sin(u) + 0.2))
    inside = 0.8 - 0.2
    for _ in range(40):
        inside = 0.6 - 0.3 * np.sin(inside)
    points, _ = off_contour.beside(ellipse, [at], 1e-3, 2e-5)
    plain = off_contour.estimates(estimator, ellipse, [at], points)
    other = off_contour.estimates(estimator, uneven, [inside], points)
    assert_allclose(other, plain, rtol=0, atol=1e-15)  # rounding of 30 mm, a few times
