"""Implicit forms: signs, gradients and Hessians; the signed distance against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.circle import Arc, Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.figure_eight import FigureEight
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.parabola import Parabola
from contourlab.contours.path import Path
from contourlab.contours.signed_distance import SignedDistance, implicit_form
from contourlab.errors import GeometryError

ELLIPSE = Ellipse(semi_axes=(0.2, 0.1), center=(0.02, 0.1), rotation=0.3)

FORMS = {
    "line": Line(start=(0.3, -1.0), end=(1.0, 0.4)),
    "circle": Circle(radius=0.2, center=(0.1, 0.0)),
    "clockwise circle": Circle(radius=0.2, center=(0.1, 0.0), clockwise=True),
    "ellipse": ELLIPSE,
    "parabola": Parabola(coefficient=5.0, half_width=0.2, center=(0.1, 0.0), rotation=0.4),
    "parabola to the right": Parabola(coefficient=-5.0, half_width=0.2),
    "ellipse reversed": ELLIPSE.reversed(),
    "ellipse reflected": ELLIPSE.scaled((1.0, -1.0)),
    "ellipse squeezed": ELLIPSE.scaled((2.0, 0.5)).rotated(1.0).translated((0.3, 0.0)),
    "half an ellipse": ELLIPSE.between(0.0, 3.0),
}
REACH = 1e-3


def beside(contour, share, offset):
    """Return a point at a signed offset to the right of the contour [m]."""
    start, end = (float(edge) for edge in contour.domain)
    at = jnp.asarray(start + share * (end - start))
    frame = contour.frenet(at)
    return np.asarray(contour.position(at) - offset * frame.normal)


def differences(function, position, step):
    """Return central differences of a function of the position, last axis the coordinate."""
    columns = [
        (np.asarray(function(position + step * e)) - np.asarray(function(position - step * e)))
        / (2 * step)
        for e in np.eye(2)
    ]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("name", FORMS)
def test_a_form_is_zero_on_the_contour_and_positive_on_its_right(name):
    contour = FORMS[name]
    assert contour.has_level
    for share in (0.1, 0.45, 0.8):
        on, right, left = (beside(contour, share, d) for d in (0.0, REACH, -REACH))
        size = float(contour.level(right))
        assert size > 0.0
        assert float(contour.level(left)) < 0.0
        assert abs(float(contour.level(on))) <= 1e-10 * size
        # the frame of a global task frame: (-f_y, f_x) runs along the travel
        level = contour.level_derivatives(on)
        along = np.array([-level.gradient[1], level.gradient[0]])
        start, end = contour.domain
        tangent = contour.frenet(jnp.asarray(start + share * (end - start))).tangent
        assert_allclose(along / np.linalg.norm(along), tangent, rtol=0, atol=1e-9)
        # f / |∇f| is the contour error to first order
        level = contour.level_derivatives(right)
        first_order = level.value / np.linalg.norm(level.gradient)
        assert_allclose(first_order, REACH, rtol=0.03)


@pytest.mark.parametrize("name", FORMS)
def test_gradient_and_hessian_are_derivatives(name):
    contour = FORMS[name]
    for position in (beside(contour, 0.3, 0.02), np.array([0.4, -0.3])):
        level = contour.level_derivatives(position)
        step = 1e-5
        # quadratic functions: only rounding over the step
        assert_allclose(
            level.gradient, differences(contour.level, position, step), rtol=1e-7, atol=1e-9
        )
        hessian = differences(lambda p: contour.level_derivatives(p).gradient, position, step)
        assert_allclose(level.hessian, hessian, rtol=1e-7, atol=1e-7)
        assert_allclose(level.hessian, np.asarray(level.hessian).T)


def test_the_values_of_the_closed_forms():
    ellipse = Ellipse(semi_axes=(0.2, 0.1), center=(0.0, 0.1))
    x, y = 0.11, 0.031
    assert_allclose(
        ellipse.level(np.array([x, y])), (x / 0.2) ** 2 + ((y - 0.1) / 0.1) ** 2 - 1, rtol=1e-13
    )
    assert_allclose(Circle(radius=2.0).level(np.array([3.0, 0.0])), 1.25)
    assert_allclose(Circle(radius=2.0, clockwise=True).level(np.array([3.0, 0.0])), -1.25)
    assert_allclose(Line(start=(0, 0), end=(5, 0)).level(np.array([7.0, -0.3])), 0.3)
    assert_allclose(
        Parabola(coefficient=50.0, half_width=1.0).level(np.array([0.01, 0.002])), 0.003
    )


def test_the_exact_distance_follows_from_value_gradient_and_hessian():
    # r_c = f / |∇f| = δ - δ² nᵀ H n / (2 |∇f|) + ..., n the gradient's direction on the contour
    ellipse = Ellipse(semi_axes=(0.2, 0.1))
    for delta in (1e-3, -1e-3):
        level = ellipse.level_derivatives(beside(ellipse, 0.17, delta))
        on = ellipse.level_derivatives(beside(ellipse, 0.17, 0.0))
        slope = np.linalg.norm(on.gradient)
        n = np.asarray(on.gradient) / slope
        bend = n @ np.asarray(on.hessian) @ n
        got = float(level.value) / np.linalg.norm(level.gradient)
        # what is left is of third order, (δ / 0.1)² beside the second
        assert_allclose(got - delta, -(delta**2) * bend / (2 * slope), rtol=0.03)


# -- signed distance -------------------------------------------------------------------------------


def compiled(contour):
    form = SignedDistance(contour)
    return jax.jit(lambda position, near: form.level_derivatives(position, near))


def test_the_signed_distance_of_a_circle_is_its_closed_form():
    for clockwise in (False, True):
        circle = Circle(radius=0.2, clockwise=clockwise)
        form, sign = compiled(circle), -1.0 if clockwise else 1.0
        for radius in (0.05, 0.19, 0.3, 0.9):
            angle = 0.7
            position = radius * np.array([np.cos(angle), np.sin(angle)])
            level = form(position, sign * angle + 0.05)
            out = position / radius
            assert_allclose(level.value, sign * (radius - 0.2), rtol=0, atol=1e-15)
            assert_allclose(level.gradient, sign * out, rtol=0, atol=1e-12)
            across = np.eye(2) - np.outer(out, out)
            assert_allclose(level.hessian, sign * across / radius, rtol=1e-10, atol=1e-10)


def test_the_signed_distance_of_an_ellipse_and_its_own_form_have_one_frame():
    form = compiled(ELLIPSE)
    for share, offset in ((0.2, 2e-3), (0.5, -5e-3), (0.9, 1e-5)):
        position = beside(ELLIPSE, share, offset)
        near = 2 * np.pi * share + 0.02
        level = form(position, near)
        assert_allclose(level.value, offset, rtol=0, atol=1e-15)
        # on the contour itself both have the same direction and the same curvature
        on = beside(ELLIPSE, share, 0.0)
        own, signed = ELLIPSE.level_derivatives(on), form(on, near)
        slope = np.linalg.norm(own.gradient)
        assert_allclose(signed.gradient, np.asarray(own.gradient) / slope, rtol=0, atol=1e-9)
        t = np.array([-signed.gradient[1], signed.gradient[0]])
        curvature = t @ np.asarray(own.hessian) @ t / slope
        assert_allclose(t @ np.asarray(signed.hessian) @ t, curvature, rtol=1e-8)
        assert_allclose(curvature, ELLIPSE.frenet(jnp.asarray(2 * np.pi * share)).curvature)


def test_the_signed_distance_of_a_figure_of_eight_near_its_crossing():
    eight = FigureEight(half_sizes=(0.03, 0.03))
    form = compiled(eight)
    for near in (np.pi / 2 + 0.03, 3 * np.pi / 2 - 0.02, 0.3):
        position = np.asarray(eight.position(jnp.asarray(near))) + np.array([4e-4, -3e-4])
        level = form(position, near)
        gradient = differences(lambda p, n=near: form(p, n).value, position, 1e-6)
        hessian = differences(lambda p, n=near: form(p, n).gradient, position, 1e-6)
        # central differences: (1e-6)² times third derivatives of 1e6, rounding 1e-16 / 1e-6
        assert_allclose(level.gradient, gradient, rtol=0, atol=2e-6)
        assert_allclose(level.hessian, hessian, rtol=1e-5, atol=1e-4)
        assert_allclose(np.linalg.norm(level.gradient), 1.0, rtol=1e-14)


def test_the_signed_distance_of_a_path_past_a_corner_and_at_its_ends():
    path = Path.polyline([(0.0, 0.0), (0.1, 0.0), (0.1, 0.1)])
    form = compiled(path)
    beside_line = form(np.array([0.04, 0.01]), 0.05)
    assert_allclose(beside_line.value, -0.01, rtol=1e-13)  # left of the travel
    assert_allclose(beside_line.gradient, [0.0, -1.0], rtol=0, atol=1e-13)
    assert_allclose(beside_line.hessian, 0.0, atol=1e-12)
    for corner, position, near, side in (
        ((0.1, 0.0), (0.13, -0.04), 0.1, 1.0),
        ((0.0, 0.0), (-0.03, -0.04), 0.0, 1.0),
        ((0.1, 0.1), (0.07, 0.14), 0.2, -1.0),
    ):
        level = form(np.array(position), near)
        out = np.array(position) - corner
        assert_allclose(level.value, side * 0.05, rtol=1e-12)
        assert_allclose(level.gradient, side * out / 0.05, rtol=0, atol=1e-12)
        across = np.eye(2) - np.outer(out, out) / 0.05**2
        assert_allclose(level.hessian, side * across / 0.05, rtol=0, atol=1e-10)


def test_a_loop_asks_every_form_in_the_same_way():
    # a scan along a circle: its own form and the signed distance differ as they should
    circle = Circle(radius=0.2)
    places = np.linspace(0.0, 6.0, 9)
    points = 0.201 * np.stack([np.cos(places), np.sin(places)], axis=1)
    for form, value in ((implicit_form(circle), 1.005**2 - 1), (SignedDistance(circle), 1e-3)):

        @jax.jit
        def run(form):
            def step(_, x):
                return None, form.level_derivatives(x[1:], x[0])

            return jax.lax.scan(step, None, np.column_stack([places + 0.01, points]))[1]

        level = run(form)
        assert_allclose(level.value, value, rtol=1e-11)
        assert_allclose(level.value, form.level(points[0], 0.01), rtol=1e-11)
    assert isinstance(implicit_form(FigureEight(half_sizes=(1, 1))), SignedDistance)


def test_at_the_centre_of_curvature_the_hessian_is_held():
    level = compiled(Circle(radius=0.2))(np.array([0.0, 0.0]), 0.3)
    assert np.isfinite(level.hessian).all()
    assert_allclose(level.value, -0.2, rtol=1e-14)


def test_who_has_no_form_says_so():
    for contour in (FigureEight(half_sizes=(1, 1)), Arc(center=(0, 0), start=(1, 0), angle=1.0)):
        assert not contour.has_level
        assert not contour.reversed().has_level
        with pytest.raises(GeometryError, match=r"no implicit form of its own; contours.Signed"):
            contour.level(np.array([0.0, 0.0]))
    spatial = (Circle(radius=1, center=(0, 0, 0), normal=(0, 0, 1)), Line(start=(0,), end=(1,)))
    for contour in spatial:
        assert not contour.has_level
        with pytest.raises(GeometryError, match="only a planar"):
            contour.level_derivatives(np.zeros(contour.n_axes))
    with pytest.raises(GeometryError, match="only a planar contour has a signed distance"):
        SignedDistance(Helix(radius=1, pitch=1, turns=1))
