"""Lines, circles, arcs, helices and ellipses against closed forms and scipy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ellipeinc

from contourlab.configuration import replace
from contourlab.contours.circle import Arc, Circle, plane_axes
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.errors import ConfigurationError, GeometryError
from contourlab.testing.contours import check_contour

ROUNDING = 1e-14  # coordinates of size 1: some tens of operations at 1.1e-16 each

CURVES = {
    "line": Line(start=(0.3, -1.0), end=(3.0, 4.0)),
    "line on one axis": Line(start=(0.1,), end=(-0.4,)),
    "circle": Circle(radius=0.02, center=(0.1, 0.2), clockwise=True, start_angle=0.4),
    "circle in space": Circle(radius=2.0, center=(1.0, 2.0, 3.0), normal=(0.2, 1.0, 0.3)),
    "arc": Arc(center=(0.0, 0.0), start=(1.0, 0.5), angle=-2.5),
    "arc in space": Arc(center=(0, 0, 1), start=(1, 0, 1), angle=8.0, normal=(0, 2, 0)),
    "helix": Helix(radius=0.5, pitch=-0.1, turns=1.3, axis=(1.0, 2.0, 3.0)),
    "ellipse": Ellipse(semi_axes=(0.03, 0.01), center=(0.1, 0.0), rotation=0.4),
}


@pytest.mark.parametrize("name", CURVES)
def test_keeps_the_contract_of_contours(name):
    check_contour(CURVES[name])


def test_line_is_its_own_closed_form():
    line = Line(start=(1.0, 2.0), end=(4.0, 6.0))
    assert_allclose(line.length, 5.0, rtol=ROUNDING)
    # beyond its end the line goes on
    expected = [[1.0 + 0.6 * 7.0, 2.0 + 0.8 * 7.0], [0.6, 0.8], [0.0, 0.0]]
    assert_allclose(line.derivatives(7.0, 2), expected, rtol=ROUNDING)


def test_circle_turns_the_stated_way():
    quarter = 0.5 * np.pi
    circle = Circle(radius=2.0, center=(1.0, 0.0))
    assert_allclose(circle.position(quarter), [1.0, 2.0], rtol=0, atol=ROUNDING)
    assert_allclose(
        replace(circle, clockwise=True).position(quarter), [1.0, -2.0], rtol=0, atol=ROUNDING
    )
    turned = replace(circle, start_angle=quarter)
    assert_allclose(turned.position(0.0), [1.0, 2.0], rtol=0, atol=ROUNDING)
    assert_allclose(turned.position(quarter), [-1.0, 0.0], rtol=0, atol=ROUNDING)
    assert_allclose(circle.length, 4.0 * np.pi, rtol=ROUNDING)


@pytest.mark.parametrize(
    ("normal", "first", "second"),
    [((0, 0, 3), "x", "y"), ((0, 2, 0), "z", "x"), ((1, 0, 0), "y", "z")],
)
def test_planes_of_gcode_come_out_as_they_are_used(normal, first, second):
    unit = dict(zip("xyz", np.eye(3), strict=True))
    a, b = plane_axes(np.array(normal, float))
    assert_allclose(a, unit[first], rtol=0, atol=ROUNDING)
    assert_allclose(b, unit[second], rtol=0, atol=ROUNDING)


def test_arc_sweeps_its_signed_angle():
    for angle in (1.0, -1.0):
        arc = Arc(center=(1.0, 1.0), start=(3.0, 1.0), angle=angle)
        assert arc.domain == (0.0, 1.0)
        end = [1.0 + 2.0 * np.cos(angle), 1.0 + 2.0 * np.sin(angle)]
        assert_allclose(arc.position(1.0), end, rtol=0, atol=ROUNDING)
        assert_allclose(arc.length, 2.0, rtol=ROUNDING)
    above = Arc(center=(0, 0, 1), start=(2, 0, 1), angle=1.0, normal=(0, 0, 5))
    assert_allclose(above.position(1.0), [2 * np.cos(1), 2 * np.sin(1), 1.0], rtol=0, atol=ROUNDING)


def test_helix_is_right_handed_for_a_positive_pitch():
    helix = Helix(radius=2.0, pitch=0.5, turns=3.0)
    at = 1.2
    expected = [2.0 * np.cos(at), 2.0 * np.sin(at), 0.5 * at / (2 * np.pi)]
    assert_allclose(helix.position(at), expected, rtol=ROUNDING)
    assert_allclose(helix.length, 6 * np.pi * np.hypot(2.0, 0.5 / (2 * np.pi)), rtol=ROUNDING)


@pytest.mark.parametrize(
    "semi_axes", [(3.0, 1.0), (1.0, 3.0), (1.0, 1.0), (1.0, 1e-3), (1e-3, 1.0), (1.0, 1e-6)]
)
def test_arc_length_of_an_ellipse_is_the_elliptic_integral(semi_axes):
    a, b = semi_axes
    ellipse = Ellipse(semi_axes=semi_axes, rotation=0.3)
    start, end = np.random.default_rng(1).uniform(-10.0, 10.0, (2, 300))
    start[:2], end[:2] = (0.0, 0.5 * np.pi), (2.0 * np.pi, np.pi)

    def judge(angle):  # scipy's integral, from the end of the longer semi-axis
        if a >= b:
            return a * ellipeinc(angle - 0.5 * np.pi, 1.0 - (b / a) ** 2)
        return b * ellipeinc(angle, 1.0 - (a / b) ** 2)

    got = jax.jit(jax.vmap(lambda p, q: ellipse.arc_length(p, q)))(start, end)
    # up to 12 half turns of length 2 each, at rounding
    assert_allclose(got, judge(end) - judge(start), rtol=0, atol=1e-14 * max(a, b))


@pytest.mark.parametrize("at", [0.0, 0.7, 0.5 * np.pi, np.pi])
def test_the_derivative_of_an_ellipse_s_length_is_its_speed(at):
    ellipse = Ellipse(semi_axes=(1.0, 0.02))
    rate = jax.grad(lambda p: ellipse.arc_length(0.0, p))(at)
    speed = np.linalg.norm(ellipse.derivatives(at, 1)[1])
    assert_allclose(rate, speed, rtol=1e-11)  # the speed itself is 0.02 of the larger semi-axis


def test_gradients_pass_through_the_fields():
    def x(a):
        return Ellipse(semi_axes=jnp.stack([a, 1.0]), rotation=0.0).position(0.3)[0]

    assert_allclose(jax.grad(x)(2.0), np.cos(0.3), rtol=ROUNDING)
    step = 1e-6
    for curve, field in ((CURVES["helix"], "pitch"), (CURVES["circle in space"], "radius")):
        value = float(getattr(curve, field))

        def total(v, curve=curve, field=field):
            return jnp.sum(replace(curve, **{field: v}).derivatives(0.8, 2))

        slope = (total(value + step) - total(value - step)) / (2 * step)
        assert_allclose(jax.grad(total)(value), slope, rtol=1e-8)  # linear: only rounding / step


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Line(start=(0, 0), end=(0, 0)), GeometryError, "a length > 0 m"),
        (lambda: Line(start=(0, 0), end=(1, 1, 1)), GeometryError, "same number of axes"),
        (lambda: Line(start=0.0, end=1.0), GeometryError, "must be points"),
        (lambda: Line(start=(0, np.inf), end=(1, 1)), ConfigurationError, "start must be finite"),
        (lambda: Circle(radius=0.0), ConfigurationError, "radius must be > 0 m, got 0"),
        (lambda: Circle(radius=1.0, center=(0, 0, 0)), GeometryError, "needs normal="),
        (lambda: Circle(radius=1.0, normal=(0, 0, 1)), GeometryError, "center has 2 coord"),
        (lambda: Circle(radius=1.0, center=(0,)), GeometryError, "2 or 3 coordinates"),
        (
            lambda: Circle(radius=1.0, center=(0, 0, 0), normal=(0, 0, 0)),
            GeometryError,
            "normal must not be the zero vector",
        ),
        (lambda: Arc(center=(0, 0), start=(1, 0), angle=0), GeometryError, "must not be 0 rad"),
        (lambda: Arc(center=(1, 0), start=(1, 0), angle=1), GeometryError, "a radius > 0 m"),
        (lambda: Arc(center=(1, 0), start=(1, 0, 0), angle=1), GeometryError, "same number"),
        (
            lambda: Arc(center=(0, 0, 0), start=(1, 0, 0.01), angle=1, normal=(0, 0, 1)),
            GeometryError,
            "0.01 m out of the plane",
        ),
        (lambda: Ellipse(semi_axes=(1, 2, 3)), GeometryError, "semi_axes must have 2"),
        (lambda: Ellipse(semi_axes=(1, -2)), ConfigurationError, "semi_axes must be > 0 m"),
        (lambda: Helix(radius=1, pitch=1, turns=0), ConfigurationError, "turns must be > 0"),
        (lambda: Helix(radius=1, pitch=1, turns=1, axis=(0, 0, 0)), GeometryError, "axis must"),
        (lambda: Helix(radius=1, pitch=1, turns=1, center=(0, 0)), GeometryError, "center must"),
        (lambda: CURVES["line"].derivatives(0.0, -1), GeometryError, "order must be >= 0"),
        (lambda: CURVES["circle"].derivatives(0.0, -1), GeometryError, "order must be >= 0"),
    ],
)
def test_mistakes_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()
