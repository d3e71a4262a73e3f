"""The Frenet frame: closed forms, and what must not change it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import part, real
from contourlab.contours.base import Contour
from contourlab.contours.circle import Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.errors import GeometryError

PLACES = np.linspace(0.1, 5.0, 9)


class Moved(Contour):
    """Another contour turned, shifted, and run with another parameter."""

    inner: Contour = part()
    rotation: jax.Array = real(ndim=2)
    backwards: jax.Array = real(default=1.0)

    n_axes = property(lambda self: self.inner.n_axes)
    domain = property(lambda self: (0.0, 1.0))
    closed = property(lambda self: False)

    def parameter(self, p):  # a smooth, increasing change
        return self.backwards * (p + 0.2 * jnp.sin(p))

    def position(self, parameter, piece=None):
        return self.rotation @ self.inner.position(self.parameter(parameter))


class Formula(Contour):
    """A curve of one formula, by its name."""

    power: jax.Array = real(default=3.0)
    spatial: jax.Array = real(default=0.0)

    n_axes = property(lambda self: 2 if self.spatial == 0.0 else 3)
    domain = property(lambda self: (-1.0, 1.0))
    closed = property(lambda self: False)

    def position(self, parameter, piece=None):
        p = jnp.asarray(parameter)
        return jnp.stack([p, p * p * p] + ([] if self.n_axes == 2 else [2.0 * p]))


class Cusp(Formula):
    """Stands still at 0."""

    def position(self, parameter, piece=None):
        p = jnp.asarray(parameter)
        return jnp.stack([p * p, p * p * p])


def frames(contour, places=PLACES):
    return jax.jit(jax.vmap(lambda p: contour.frenet(p)))(places)


def rotation(n_axes, seed=0):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(n_axes, n_axes)))
    return q * np.sign(np.linalg.det(q)) if n_axes == 3 else q * [1.0, np.linalg.det(q)]


@pytest.mark.parametrize("pitch", [0.7, -0.7])
def test_helix_has_constant_curvature_and_torsion(pitch):
    r, c = 0.5, pitch / (2.0 * np.pi)
    frame = frames(Helix(radius=r, pitch=pitch, turns=1.0))
    assert_allclose(frame.curvature, r / (r * r + c * c), rtol=1e-13)
    assert_allclose(frame.torsion, c / (r * r + c * c), rtol=1e-13)  # right-handed is positive
    inward = np.stack([-np.cos(PLACES), -np.sin(PLACES), 0 * PLACES], axis=1)
    assert_allclose(frame.normal, inward, rtol=0, atol=1e-14)


@pytest.mark.parametrize("clockwise", [False, True])
def test_planar_curvature_is_positive_for_a_left_turn(clockwise):
    frame = frames(Circle(radius=0.5, clockwise=clockwise))
    assert_allclose(frame.curvature, -2.0 if clockwise else 2.0, rtol=1e-13)
    inward = -np.stack([np.cos(PLACES), np.sin(PLACES)], axis=1)
    if clockwise:  # the left normal then points outwards
        inward = np.stack([np.cos(PLACES), -np.sin(PLACES)], axis=1)
    assert_allclose(frame.normal, inward, rtol=0, atol=1e-14)


def test_ellipse_has_its_closed_form_curvature():
    a, b = 0.03, 0.01
    frame = frames(Ellipse(semi_axes=(a, b)))
    expected = a * b / (a**2 * np.sin(PLACES) ** 2 + b**2 * np.cos(PLACES) ** 2) ** 1.5
    assert_allclose(frame.curvature, expected, rtol=1e-12)


@pytest.mark.parametrize(
    "contour",
    [Ellipse(semi_axes=(0.03, 0.01)), Helix(radius=0.5, pitch=0.3, turns=2.0)],
    ids=["plane", "space"],
)
def test_rotation_and_change_of_parameter_only_rotate_the_frame(contour):
    turn = rotation(contour.n_axes)
    moved = Moved(inner=contour, rotation=turn)
    frame, seen = frames(contour, PLACES + 0.2 * np.sin(PLACES)), frames(moved)
    # third derivatives of the change magnify rounding by some tens
    assert_allclose(seen.curvature, frame.curvature, rtol=1e-11)
    for name in ("tangent", "normal") + (("binormal",) if contour.n_axes == 3 else ()):
        assert_allclose(getattr(seen, name), getattr(frame, name) @ turn.T, rtol=0, atol=1e-11)
    if contour.n_axes == 3:
        assert_allclose(seen.torsion, frame.torsion, rtol=1e-10)


def test_running_backwards_flips_what_it_should():
    for contour in (Ellipse(semi_axes=(0.03, 0.01)), Helix(radius=0.5, pitch=0.3, turns=2.0)):
        same = np.eye(contour.n_axes)
        there = frames(Moved(inner=contour, rotation=same))
        back = frames(Moved(inner=contour, rotation=same, backwards=-1.0), -PLACES)
        assert_allclose(back.tangent, -there.tangent, rtol=0, atol=1e-13)
        if contour.n_axes == 2:
            assert_allclose(back.normal, -there.normal, rtol=0, atol=1e-13)
            assert_allclose(back.curvature, -there.curvature, rtol=1e-12)
        else:
            assert_allclose(back.normal, there.normal, rtol=0, atol=1e-12)
            assert_allclose(back.binormal, -there.binormal, rtol=0, atol=1e-12)
            assert_allclose(back.curvature, there.curvature, rtol=1e-12)
            assert_allclose(back.torsion, there.torsion, rtol=1e-11)


def test_nothing_is_singular_at_a_planar_inflection():
    places = np.array([-1e-9, 0.0, 1e-9])
    frame = frames(Formula(), places)
    # y = x³: curvature 6 x, the normal stays up; tangent turns by 3 x² only
    assert_allclose(frame.curvature, 6.0 * places, rtol=0, atol=1e-20)
    assert_allclose(frame.normal, [[0.0, 1.0]] * 3, rtol=0, atol=1e-15)
    slope = jax.grad(lambda p: Formula().frenet(p).curvature)(0.0)
    assert_allclose(slope, 6.0)


def test_a_straight_spatial_contour_has_the_stated_frame():
    frame = Line(start=(0, 0, 0), end=(1.0, 2.0, 2.0)).frenet(0.3)
    tangent = np.array([1.0, 2.0, 2.0]) / 3.0
    normal = np.array([1.0, 0.0, 0.0]) - tangent / 3.0  # x is least aligned with the tangent
    assert_allclose(frame.normal, normal / np.linalg.norm(normal), rtol=0, atol=1e-15)
    assert_allclose(frame.binormal, np.cross(tangent, frame.normal), rtol=0, atol=1e-15)
    assert float(frame.curvature) == 0.0
    assert float(frame.torsion) == 0.0


def test_a_spatial_inflection_takes_the_fall_back_and_has_finite_gradients():
    curve = Formula(spatial=1.0)
    frame = curve.frenet(0.0)
    assert float(frame.curvature) == 0.0
    assert float(frame.torsion) == 0.0
    assert np.isfinite(frame.normal).all()
    for name in ("curvature", "torsion"):
        assert np.isfinite(jax.grad(lambda p, n=name: getattr(curve.frenet(p), n))(0.0))


def test_a_slight_curvature_is_not_taken_for_none():
    # a circle of 1e9 m: its curvature is far above rounding of its own derivatives
    circle = Circle(radius=1e9, center=(0, 0, 0), normal=(0.1, 0.2, 1.0))
    assert_allclose(circle.frenet(0.3).curvature, 1e-9, rtol=1e-12)


def test_a_cusp_gives_zeros_and_no_nan():
    frame = Cusp().frenet(0.0)
    assert_allclose(frame.tangent, 0.0)
    assert float(frame.curvature) == 0.0


def test_one_axis_has_no_frame():
    with pytest.raises(GeometryError, match="2 or 3 axes, this one has 1"):
        Line(start=(0.0,), end=(1.0,)).frenet(0.0)


def test_torsion_and_binormal_asked_of_a_planar_contour():
    frame = Circle(radius=0.02).frenet(0.3)
    for name in ("torsion", "binormal"):
        with pytest.raises(GeometryError, match=f"a planar contour has no {name}"):
            getattr(frame, name)
        with pytest.raises(GeometryError, match=name):  # traced too
            jax.jit(lambda p, name=name: getattr(Circle(radius=0.02).frenet(p), name))(0.3)
