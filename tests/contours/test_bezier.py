"""Rational Bézier pieces: closed forms, derivatives, their parameter over arc length."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.base import derivatives_by_jvp
from contourlab.contours.bezier import (
    bezier_derivatives,
    bezier_parameter,
    rational_point,
    rational_taylor,
)
from contourlab.contours.bezier_rows import bezier_rows, elevated, end_derivatives
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

CONTROL = np.array(
    [[[0.0, 0.0, 1.0], [0.2, 0.1, 0.0], [0.3, -0.2, 0.2], [0.6, 0.1, 0.3], [0.7, 0.3, 0.3]]]
)
WEIGHTS = np.array([[1.0, 1.5, 0.7, 1.2, 2.0]])


def homogeneous():
    return np.concatenate([CONTROL * WEIGHTS[..., None], WEIGHTS[..., None]], axis=2)


def test_quarter_circle_is_a_circle_by_arc_length():
    points, weights = [[[2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]], [[1.0, np.sqrt(0.5), 1.0]]
    path = Path.from_bezier(points, weights)
    assert_allclose(path.length, np.pi, rtol=1e-14)
    s = np.linspace(0.0, np.pi, 40)
    d = jax.jit(jax.vmap(lambda s: path.derivatives(s, 3)))(s)
    t = s / 2.0
    at = np.stack([np.cos(t), np.sin(t)], axis=1)
    along = np.stack([-np.sin(t), np.cos(t)], axis=1)
    # u over s is good to 1e-13, and moves the point along the curve only
    assert_allclose(np.linalg.norm(d[:, 0], axis=1), 2.0, rtol=1e-15)
    for k, expected in enumerate((2.0 * at, along, -at / 2.0, -along / 4.0)):
        assert_allclose(d[:, k], expected, rtol=0, atol=1e-12)


def test_length_of_a_parabola_is_its_closed_form():
    path = Path.from_bezier([[[0.0, 0.0], [0.5, 0.0], [1.0, 1.0]]])  # y = x²
    assert_allclose(path.length, np.sqrt(5) / 2 + np.arcsinh(2) / 4, rtol=1e-14)


def test_taylor_coefficients_are_those_of_the_point():
    row = homogeneous()[0]
    series = np.array(jax.jit(lambda u: rational_taylor(row, u, 4))(0.3)).T
    chained = jax.jit(lambda u: derivatives_by_jvp(lambda v: rational_point(row, v), u, 4))(0.3)
    factorial = np.array([1.0, 1.0, 2.0, 6.0, 24.0])
    assert_allclose(series * factorial[:, None], chained, rtol=1e-11)
    # Bernstein's formula, independent of de Casteljau
    basis = np.array([1, 4, 6, 4, 1]) * 0.3 ** np.arange(5) * 0.7 ** np.arange(4, -1, -1)
    point = basis @ row
    assert_allclose(series[0], point[:-1] / point[-1], rtol=1e-14)


def test_derivatives_over_arc_length_agree_with_chained_differentiation():
    rows, inverse, length, _ = (jnp.asarray(v) for v in bezier_rows(homogeneous()))
    s = 0.4 * length[0]
    got = bezier_derivatives(rows[0], inverse[0], length[0], s, 4)
    chained = derivatives_by_jvp(
        lambda s: rational_point(rows[0], bezier_parameter(rows[0], inverse[0], length[0], s)), s, 4
    )
    assert_allclose(got, chained, rtol=1e-9, atol=1e-9 * np.abs(chained).max())
    assert_allclose(np.linalg.norm(got[1]), 1.0, rtol=1e-14)
    assert_allclose(got[1] @ got[2], 0.0, rtol=0, atol=1e-13 * np.linalg.norm(got[2]))


def test_parameter_follows_the_arc_length():
    path = Path.from_bezier(CONTROL, WEIGHTS)
    s = np.linspace(0.0, float(path.length), 4001)
    points = np.asarray(jax.jit(jax.vmap(lambda s: path.position(s)))(s))
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    # a chord is shorter than its arc by κ² s³ / 24
    curvature = np.linalg.norm(
        np.asarray(jax.jit(jax.vmap(lambda s: path.derivatives(s, 2)))(s))[:, 2], axis=1
    )
    step = s[1]
    assert_allclose(chords, step, rtol=1e-10 + (curvature.max() * step) ** 2 / 20)


def test_outside_a_bezier_path_goes_straight_on():
    path = Path.from_bezier(CONTROL, WEIGHTS)
    end = float(path.length)
    for edge, outside in ((end, end + 0.3), (0.0, -0.2)):
        inside, beyond = path.derivatives(edge, 3), path.derivatives(outside, 3)
        straight = np.asarray(inside[0] + (outside - edge) * inside[1])
        assert_allclose(beyond[0], straight, rtol=1e-14)
        assert_allclose(beyond[1], inside[1], rtol=1e-14)
        assert_allclose(beyond[2:], 0.0)
        assert np.abs(inside[2]).max() > 0.05  # at the edge itself: the curve's own
        slope = jax.jacrev(lambda s: path.position(s))(outside)
        assert_allclose(slope, inside[1], rtol=1e-13)


def test_ends_and_elevation_keep_the_curve():
    rows, inverse, length, _ = bezier_rows(homogeneous())
    for at_end in (False, True):
        s = jnp.asarray(length[0] if at_end else 0.0)
        exact = bezier_derivatives(*(jnp.asarray(v[0]) for v in (rows, inverse, length)), s, 2)
        ends = end_derivatives(rows, at_end=at_end)
        for k in range(3):
            assert_allclose(ends[k][0], exact[k], rtol=1e-9, atol=1e-12)
    raised = elevated(rows, 8)
    assert raised.shape[1] == 8
    for u in (0.0, 0.3, 1.0):
        assert_allclose(
            rational_point(jnp.asarray(raised[0]), u), rational_point(jnp.asarray(rows[0]), u),
            rtol=1e-13, atol=1e-15,
        )  # fmt: skip


def test_far_from_the_origin_a_short_curve_still_enters():
    far = Path.from_bezier(1e-3 * CONTROL + 100.0, WEIGHTS)
    near = Path.from_bezier(1e-3 * CONTROL, WEIGHTS)
    assert_allclose(far.length, near.length, rtol=0, atol=1e-13)  # rounding of 100 m


@pytest.mark.parametrize(
    ("points", "weights", "message"),
    [
        ([[[0, 0], [1, 1], [0, 0.0]]], None, "stands still"),
        ([[[0, 0], [0, 0], [0, 0.0]]], None, "curve 0 has no length"),
        ([[[7, 1], [7, 1], [7, 1 + 1e-16]]], None, "curve 0 has no length"),
        ([[[0, 0], [1, 0], [2, 0.0]]], [[1.0, 0.0, 1.0]], "weights must be > 0"),
        ([[0, 0], [1, 0]], None, "must have shape"),
        ([[[0, 0], [np.nan, 0]]], None, "must be finite"),
        ([[[0, 0], [1, 0]], [[2, 0], [3, 0]]], None, "piece 0 ends 1 m away"),
    ],
)
def test_mistakes_are_named(points, weights, message):
    with pytest.raises(GeometryError, match=message):
        Path.from_bezier(points, weights)
