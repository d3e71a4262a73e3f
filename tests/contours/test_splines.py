"""B-splines and NURBS against scipy, the Cox-de Boor recursion and exact conics."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline as ScipySpline
from scipy.interpolate import insert

from contourlab.configuration import replace
from contourlab.contours.bspline import BSpline
from contourlab.contours.nurbs import Nurbs
from contourlab.errors import ConfigurationError, GeometryError
from contourlab.testing.contours import check_contour

HALF = np.sqrt(0.5)
SQUARE = [[1, -1], [1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1]]
CIRCLE = Nurbs(
    control_points=SQUARE, weights=[HALF, 1.0] * 4, knots=[0, 0, 1, 1, 2, 2, 3, 3, 4], degree=2,
    closed=True,
)  # fmt: skip
"""Every knot stands twice, as often as the degree; the seam's at the beginning."""


def points(n, n_axes=2, seed=0):
    return np.random.default_rng(seed).normal(size=(n, n_axes))


def knots(n, degree, seed=1, repeated=0):
    """Random knots, not clamped; the one in the middle of the domain repeated."""
    t = np.sort(np.random.default_rng(seed).uniform(0.0, 3.0, n + degree + 1))
    middle = (n + degree + 1) // 2
    t[middle : middle + repeated] = t[middle]
    return t


def derivatives(spline, order, places):
    return np.asarray(jax.jit(jax.vmap(lambda u: spline.derivatives(u, order)))(places))


def cox_de_boor(t, i, p, u):
    """The basis function by its definition, right-sided."""
    if p == 0:
        return float(t[i] <= u < t[i + 1])
    value = 0.0
    if t[i + p] > t[i]:
        value += (u - t[i]) / (t[i + p] - t[i]) * cox_de_boor(t, i, p - 1, u)
    if t[i + p + 1] > t[i + 1]:
        value += (t[i + p + 1] - u) / (t[i + p + 1] - t[i + 1]) * cox_de_boor(t, i + 1, p - 1, u)
    return value


@pytest.mark.parametrize(
    "spline",
    [
        BSpline(control_points=points(9, 3), knots=knots(9, 3), degree=3),
        Nurbs(control_points=points(6), weights=[1, 2, 0.5, 1, 3, 0.7], degree=3, closed=True),
    ],
    ids=["open in space", "closed and rational"],
)
def test_keeps_the_contract_of_contours(spline):
    check_contour(spline)


@pytest.mark.parametrize(("degree", "repeated"), [(1, 0), (2, 2), (3, 3), (5, 2)])
def test_every_derivative_is_scipys(degree, repeated):
    n = 10
    p, t = points(n, 3), knots(n, degree, repeated=repeated)
    spline, judge = BSpline(control_points=p, knots=t, degree=degree), ScipySpline(t, p, degree)
    low, high = (float(u) for u in spline.domain)
    # at the knots too: scipy's derivatives are right-sided there
    at = np.unique(np.concatenate([np.linspace(low, high, 23)[:-1], t[(t >= low) & (t < high)]]))
    rows = derivatives(spline, degree + 1, at)
    for k in range(degree + 1):
        wanted = judge(at, k)
        # both are sums of some tens of products; the k-th derivative is divided k times by a span
        assert_allclose(rows[:, k], wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    assert_allclose(rows[:, degree + 1], 0.0, atol=0)


def test_rational_derivatives_are_quotients_of_scipys():
    n, p, w = 9, points(9), 1.0 + np.random.default_rng(3).uniform(size=9)
    t = knots(n, 4)
    spline = Nurbs(control_points=p, weights=w, knots=t, degree=4)
    numerator, weight = ScipySpline(t, p * w[:, None], 4), ScipySpline(t, w[:, None], 4)
    at = np.linspace(t[4], t[n], 20)[:-1]
    a0, a1, a2 = (numerator(at, k) for k in range(3))
    w0, w1, w2 = (weight(at, k) for k in range(3))
    first = (a1 - a0 / w0 * w1) / w0
    second = (a2 - 2.0 * w1 * first - w2 * a0 / w0) / w0
    rows = derivatives(spline, 2, at)
    for k, wanted in enumerate((a0 / w0, first, second)):
        assert_allclose(rows[:, k], wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_points_are_the_sum_of_the_basis_functions():
    n, degree = 8, 3
    p, t = points(n, 1), knots(n, degree, repeated=2)
    spline = BSpline(control_points=p, knots=t, degree=degree)
    for u in np.linspace(float(t[degree]), float(t[n]), 7)[:-1]:
        basis = [cox_de_boor(t, i, degree, u) for i in range(n)]
        assert_allclose(spline.position(u), basis @ p, rtol=0, atol=1e-14)


def test_closed_spline_is_scipys_with_its_points_taken_round():
    n, degree = 7, 4
    p = points(n)
    t = np.concatenate([[0.0], np.cumsum(np.random.default_rng(5).uniform(0.5, 1.5, n))])
    spline = BSpline(control_points=p, knots=t, degree=degree, closed=True)
    period = t[-1]
    judge = ScipySpline(
        np.concatenate([t[n - degree : n] - period, t, t[1 : degree + 1] + period]),
        np.concatenate([p, p[:degree]]), degree,
    )  # fmt: skip
    at = np.linspace(0.0, period, 30)[:-1]
    for k in range(3):
        wanted = judge(at, k)
        assert_allclose(derivatives(spline, 2, at)[:, k], wanted, rtol=0, atol=1e-13 * 10**k)
        assert_allclose(derivatives(spline, 2, at - 2 * period)[:, k], wanted, atol=1e-13 * 10**k)


def test_circle_is_exact():
    at = np.linspace(0.0, 4.0, 41)
    rows = derivatives(CIRCLE, 2, at)
    assert_allclose(np.linalg.norm(rows[:, 0], axis=1), 1.0, rtol=1e-15)
    assert_allclose(rows[0, 0], [1.0, 0.0], atol=1e-15)
    cross = rows[:, 1, 0] * rows[:, 2, 1] - rows[:, 1, 1] * rows[:, 2, 0]
    assert_allclose(cross / np.linalg.norm(rows[:, 1], axis=1) ** 3, 1.0, rtol=1e-13)
    assert_allclose(CIRCLE.length, 2.0 * np.pi, rtol=1e-14)
    assert_allclose(CIRCLE.arc_length(0.5, 9.5), 4.5 * np.pi, rtol=1e-14)
    path = CIRCLE.to_path()
    assert path.closed
    assert_allclose(path.length, 2.0 * np.pi, rtol=1e-14)
    s = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    around = np.stack([np.cos(s), np.sin(s)], axis=1)
    assert_allclose(jax.vmap(path.position)(s), around, atol=1e-13)  # u over s is good to 1e-13


def test_knot_insertion_leaves_the_curve():
    n, degree = 7, 3
    p, t = points(n), knots(n, degree)
    spline = BSpline(control_points=p, knots=t, degree=degree)
    middle = 0.4 * t[degree] + 0.6 * t[n]
    finer_t, finer_p, _ = insert(middle, (t, list(p.T), degree), m=2)
    finer = BSpline(control_points=np.array(finer_p).T[: n + 2], knots=finer_t, degree=degree)
    at = np.linspace(t[degree], t[n], 15)[:-1]
    assert finer.n_pieces == spline.n_pieces + 2
    assert_allclose(derivatives(finer, 2, at), derivatives(spline, 2, at), rtol=0, atol=1e-10)
    assert_allclose(finer.length, spline.length, rtol=1e-12)


def test_full_multiplicity_is_a_corner_seen_from_the_right():
    spline = BSpline(
        control_points=[[0, 0], [1, 0], [2, 0], [2, 1], [2, 2]], knots=[0, 0, 0, 1, 1, 2, 2, 2],
        degree=2,
    )  # fmt: skip
    rows = derivatives(spline, 1, np.array([1.0 - 1e-9, 1.0]))
    assert_allclose(rows[0, 1], [2.0, 0.0], atol=1e-8)
    assert_allclose(rows[1], [[2.0, 0.0], [0.0, 2.0]], atol=1e-14)
    assert list(spline.to_path().corners()) == [0]


def test_path_is_the_same_curve():
    n, degree = 9, 4
    spline = Nurbs(
        control_points=points(n, 3), weights=np.linspace(1.0, 2.0, n), knots=knots(n, degree),
        degree=degree,
    )  # fmt: skip
    path = spline.to_path()
    assert_allclose(path.length, spline.length, rtol=1e-11)
    low, high = (float(u) for u in spline.domain)
    at = np.linspace(low, high, 9)
    s = [float(spline.arc_length(low, u)) for u in at]
    rows = derivatives(spline, 1, at)
    along = rows[:, 1] / np.linalg.norm(rows[:, 1], axis=1)[:, None]
    of_path = derivatives(path, 1, np.array(s))
    # arc length to 1e-11 of a length of some metres
    assert_allclose(of_path[:, 0], rows[:, 0], rtol=0, atol=1e-10)
    assert_allclose(of_path[:, 1], along, rtol=0, atol=1e-9)


def test_degree_one_is_a_polyline():
    p = points(5)
    path = BSpline(control_points=p, degree=1).to_path()
    assert path.kinds == "helical"
    assert_allclose(path.length, np.linalg.norm(np.diff(p, axis=0), axis=1).sum(), rtol=1e-15)


def test_any_start_of_the_search_gives_the_same():
    spline = BSpline(control_points=points(12), degree=3)
    at = jnp.asarray(0.37)
    wanted = spline.derivatives(at, 2)
    for start in (0, 3, 8, 100):
        assert_allclose(spline.derivatives(at, 2, jnp.int32(start)), wanted, atol=0)


def test_many_splines_at_once():
    many = np.stack([points(6, seed=k) for k in range(3)])
    spline = BSpline(control_points=many)  # a batch, checked as a whole
    got = jax.vmap(lambda p: replace(BSpline(control_points=p)).position(0.3))(many)
    for k in range(3):
        assert_allclose(got[k], BSpline(control_points=many[k]).position(0.3), rtol=1e-13)
    with pytest.raises(GeometryError, match="are one point"):
        replace(spline, control_points=np.concatenate([many[:2], np.ones((1, 6, 2))]))


P = points(6)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"knots": [0, 0, 0, 0, 1, 1, 1]}, r"must be 10 numbers .* got shape \(7,\)"),
        ({"knots": [0, 0, 0, 0, 2, 1, 3, 3, 3, 3]}, r"knots\[4\] = 2 and knots\[5\] = 1"),
        ({"knots": [0, 0, 0, 0, 0, 1, 2, 2, 2, 2]}, "knot 0 stands 5 times"),
        ({"knots": [0, 1, 2, 3, 3, 4, 5, 6, 7, 8]}, r"up to knots\[3\]"),
        ({"knots": [0, 1, 1, 1, 1, 2, 3, 4, 5, 6]}, "knot 1 stands 4 times"),
        ({"knots": [0, 0, 0, 0, 1, 1 + 1e-15, 2, 2, 2, 2]}, r"knots\[4\] and knots\[5\] differ"),
        ({"knots": [0, 0, 0, 0, np.nan, 1, 2, 2, 2, 2]}, r"knots\[4\] = nan"),
        ({"control_points": P[:3]}, "degree 3 needs 4 control points or more, got 3"),
        ({"control_points": np.ones((6, 2))}, r"control_points\[0\] to control_points\[3\] are"),
        ({"control_points": P[[0, 0, 1, 2, 3, 4]]}, "stands still at its knot 0"),
        ({"control_points": P[[0, 1, 2, 3, 4, 4]]}, "stands still at its knot 1"),
        ({"control_points": [[0, 0], [np.inf, 0], [1, 1], [2, 2]]}, r"control_points\[1\]\[0\]"),
        ({"degree": 26}, "from 1 to 25, got 26"),
        ({"degree": 0}, "degree must be a whole number >= 1"),
        ({"control_points": [1.0, 2.0]}, "must have shape"),
        ({"closed": True, "knots": [0, 1, 2, 3, 4, 5, 5]}, "stands 2 times"),
    ],
)
def test_mistakes_are_named(fields, message):
    with pytest.raises((GeometryError, ConfigurationError), match=message):
        BSpline(**{"control_points": P, "degree": 3, **fields})


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1, 1, -2, 1, 1, 1], r"weights\[2\] = -2"),
        ([1, 1, 1, 0, 1, 1], r"weights must be > 0, got weights\[3\] = 0"),
        ([1, 1, 1, 1, np.nan, 1], r"weights\[4\] = nan"),
        ([1, 1, 1], r"one for each .* got shape \(3,\)"),
    ],
)
def test_wrong_weights_are_named(weights, message):
    with pytest.raises((GeometryError, ConfigurationError), match=message):
        Nurbs(control_points=P, weights=weights)


def test_cusps_within_a_span_are_named():
    spline = BSpline(control_points=[[0, 0], [1, 1], [0, 1], [1, 0]])
    with pytest.raises(GeometryError, match="between the knots 0 and 1 the curve stands still"):
        spline.to_path()


def test_gradients_pass_through_all_numbers():
    def point(p, w, t):
        return Nurbs(control_points=p, weights=w, knots=t).position(0.3)[0]

    t = np.array([0.0, 0, 0, 0, 0.4, 0.6, 1, 1, 1, 1])
    w = np.linspace(1.0, 2.0, 6)
    gradients = jax.grad(point, argnums=(0, 1, 2))(P, w, t)
    for k, (value, gradient) in enumerate(zip((P, w, t), gradients, strict=True)):
        index = (1, 0) if k == 0 else (4,) if k == 2 else (1,)
        h = 1e-6
        moved = [np.array(v) for v in (P, w, t)]
        moved[k][index] += h
        up = float(point(*moved))
        moved[k][index] -= 2 * h
        slope = (up - float(point(*moved))) / (2 * h)
        assert_allclose(gradient[index], slope, rtol=1e-6, atol=1e-9)
        assert abs(slope) > 1e-3, value
