"""Contours turned, shifted, scaled, reversed and cut: exact, and paths stay paths."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.base import Contour
from contourlab.contours.circle import Arc, Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.figure_eight import FigureEight
from contourlab.contours.foot_points import foot_point
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.parabola import Parabola
from contourlab.contours.path import Path
from contourlab.contours.spiral import Spiral
from contourlab.contours.wrapped import Reversed, Stretch, Transformed
from contourlab.errors import GeometryError
from contourlab.testing.contours import check_contour

ROUNDING = 1e-14
EIGHT = FigureEight(half_sizes=(0.03, 0.02))
PLACES = np.linspace(0.2, 6.0, 9)


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def rows(contour, places, order=3):
    return np.asarray(jax.jit(jax.vmap(lambda p: contour.derivatives(p, order)))(places))


@pytest.fixture(scope="module")
def mixed():
    """A path of a line, an arc and a rational Bézier curve that all bend differently."""
    first = Path.polyline([(0.0, 0.0), (0.1, 0.0)], source_line=[1])
    arc = Path.from_contour(Arc(center=(0.1, 0.05), start=(0.1, 0.0), angle=2.0), 1e-9)
    end = np.asarray(arc.position(arc.length))
    control = end + np.array([[0.0, 0.0], [0.02, 0.03], [0.05, 0.0], [0.06, 0.05]])
    last = Path.from_bezier(control[None], np.array([[1.0, 2.0, 0.7, 1.0]]), source_line=[7])
    return Path.join([first, arc, last])


@pytest.mark.parametrize(
    "contour",
    [
        pytest.param(
            EIGHT.scaled((1.0, 2.0)).rotated(0.4).translated((0.1, 0.0)), marks=pytest.mark.slow
        ),
        Helix(radius=0.1, pitch=0.02, turns=1.5).rotated(0.4, axis=(1, 2, 3)).reversed(),
        pytest.param(EIGHT.between(5.0, 8.0), marks=pytest.mark.slow),
    ],
    ids=["affine", "turned and reversed", "stretch over the seam"],
)
def test_keeps_the_contract_of_contours(contour):
    check_contour(contour)


def test_a_similarity_moves_points_and_derivatives():
    moved = EIGHT.rotated(0.3, center=(0.1, 0.2)).scaled(2.0).translated((0.5, 0.0))
    matrix, center = 2.0 * turn(0.3), np.array([0.1, 0.2])
    before, after = rows(EIGHT, PLACES), rows(moved, PLACES)
    expected = before @ matrix.T
    expected[:, 0] += 2.0 * (center - turn(0.3) @ center) + [0.5, 0.0]
    assert_allclose(after, expected, rtol=0, atol=ROUNDING)
    assert isinstance(moved, Transformed)
    assert moved.inner is EIGHT  # merged, not nested
    assert_allclose(moved.arc_length(0.3, 2.0), 2.0 * EIGHT.arc_length(0.3, 2.0), rtol=ROUNDING)


def test_a_rotation_in_space_is_about_its_axis():
    line = Line(start=(1.0, 0.0, 0.0), end=(2.0, 0.0, 0.0))
    turned = line.rotated(np.pi / 2, axis=(0, 0, 3.0))
    assert_allclose(turned.position(0.5), [0.0, 1.5, 0.0], rtol=0, atol=ROUNDING)
    about = line.rotated(np.pi, axis=(0, 1, 0), center=(1.0, 0.0, 1.0))
    assert_allclose(about.position(0.5), [0.5, 0.0, 2.0], rtol=0, atol=ROUNDING)


def test_curvature_under_similarity_reflection_and_reversal():
    def signed(contour, p):
        return float(contour.frenet(jnp.asarray(p)).curvature)

    for p in (0.4, 2.0):
        own = signed(EIGHT, p)
        assert_allclose(signed(EIGHT.rotated(1.0).scaled(4.0), p), own / 4.0, rtol=1e-12)
        assert_allclose(signed(EIGHT.scaled((1.0, -1.0)), p), -own, rtol=1e-12)
        assert_allclose(signed(EIGHT.reversed(), 2 * np.pi - p), -own, rtol=1e-12)


@pytest.mark.parametrize("contour", [EIGHT, Spiral(start_radius=0.01, pitch=0.004, turns=1.0)])
def test_reversal_turns_tangents_and_keeps_points(contour):
    back = contour.reversed()
    start, end = (float(edge) for edge in contour.domain)
    there, again = rows(contour, PLACES), rows(back, start + end - PLACES)
    assert_allclose(again, there * np.array([1.0, -1.0, 1.0, -1.0])[:, None], rtol=0, atol=1e-13)
    assert_allclose(back.arc_length(0.5, 2.0), contour.arc_length(end - 2.0, end - 0.5))
    assert back.reversed() is contour


def test_a_helix_reversed_keeps_its_torsion():
    helix = Helix(radius=0.5, pitch=0.3, turns=2.0)
    there, back = helix.frenet(1.0), helix.reversed().frenet(helix.domain[1] - 1.0)
    assert_allclose(back.torsion, there.torsion, rtol=1e-12)
    assert_allclose(back.curvature, there.curvature, rtol=1e-12)
    assert_allclose(back.binormal, -there.binormal, rtol=0, atol=1e-12)
    # a reflection makes it left-handed
    mirrored = helix.scaled((1.0, 1.0, -1.0)).frenet(1.0)
    assert_allclose(mirrored.torsion, -there.torsion, rtol=1e-12)


def test_scaling_the_axes_of_a_circle_makes_an_ellipse():
    ellipse = Ellipse(semi_axes=(0.06, 0.02))
    squeezed = Circle(radius=0.02).scaled((3.0, 1.0))
    assert_allclose(rows(squeezed, PLACES), rows(ellipse, PLACES), rtol=0, atol=1e-16)
    # by quadrature, against elliptic integrals
    assert_allclose(squeezed.length, ellipse.length, rtol=1e-12)


def beside(contour, offset):
    frame = jax.jit(jax.vmap(contour.frenet))(PLACES)
    return rows(contour, PLACES, 0)[:, 0] + offset * np.asarray(frame.normal)


def test_local_foot_points_of_a_transformed_contour():
    moved = EIGHT.scaled((1.0, 2.0)).rotated(0.4)
    foot = foot_point(moved, beside(moved, 3e-4), PLACES + 0.01)
    assert_allclose(foot.distance, -3e-4, rtol=0, atol=1e-15)
    assert_allclose(foot.parameter, PLACES, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_foot_points_of_wrapped_contours_are_those_of_the_formula():
    moved = EIGHT.scaled((1.0, 2.0)).rotated(0.4)
    direct = FigureEight(half_sizes=(0.03, 0.04), rotation=0.4)
    points = rows(direct, PLACES, 0)[:, 0] + np.random.default_rng(0).normal(0, 3e-4, (9, 2))
    everywhere, near = foot_point(direct, points), foot_point(direct, points, PLACES)
    assert_allclose(foot_point(moved, points).distance, everywhere.distance, rtol=0, atol=1e-15)
    back = foot_point(moved.reversed(), points, 2 * np.pi - PLACES)
    assert_allclose(back.distance, -near.distance, rtol=0, atol=1e-15)
    assert_allclose(back.parameter, 2 * np.pi - near.parameter, rtol=0, atol=1e-10)
    # the foot of a point beside the rest of the eight is the end of the stretch
    cut = EIGHT.between(5.0, 8.0)
    foot = foot_point(cut, np.asarray(EIGHT.position(4.9))[None], near=[5.1])
    assert_allclose(foot.parameter, 5.0)


# -- paths -----------------------------------------------------------------------------------------


def test_a_path_under_a_similarity_is_a_path_with_the_same_pieces(mixed):
    for moved, matrix in (
        (mixed.rotated(0.3), turn(0.3)),
        (mixed.scaled(2.0), 2.0 * np.eye(2)),
        (mixed.scaled((1.0, -1.0)), np.diag([1.0, -1.0])),
    ):
        assert isinstance(moved, Path)
        factor = np.sqrt(abs(np.linalg.det(matrix)))
        assert_allclose(moved.length, factor * mixed.length, rtol=ROUNDING)
        assert_allclose(moved.source_line, mixed.source_line)
        s = np.linspace(0.001, 0.999, 40) * float(mixed.length)
        before, after = rows(mixed, s), rows(moved, factor * s)
        scale = factor ** -np.arange(4.0)[:, None]
        size = np.abs(before).max(axis=(0, 2))[:, None]
        assert np.all(np.abs(after - before @ matrix.T * scale) <= 1e-12 * size)


def test_a_path_reversed_is_a_path(mixed):
    back = mixed.reversed()
    assert isinstance(back, Path)
    assert_allclose(back.source_line, np.asarray(mixed.source_line)[::-1])
    s = np.linspace(0.001, 0.999, 40) * float(mixed.length)
    there, again = rows(mixed, s), rows(back, float(mixed.length) - s)
    size = np.abs(there).max(axis=(0, 2))[:, None]
    signs = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    # the third derivative comes from a series of 16 terms
    assert np.all(np.abs(again - there * signs) <= 1e-12 * size)
    # at a joint the derivative is that of the piece which follows in the new direction
    joint = float(mixed.breaks[1])
    assert_allclose(
        rows(back, np.array([float(back.breaks[-2])]), 1)[0, 1],
        -rows(mixed, np.array([joint - 1e-12]), 1)[0, 1], rtol=0, atol=1e-12,
    )  # fmt: skip
    check = back.reversed()
    assert_allclose(check.origin, mixed.origin, rtol=0, atol=1e-15)


@pytest.mark.slow
def test_a_path_with_its_axes_scaled_is_a_path_on_the_same_points(mixed):
    squeezed = mixed.scaled((2.0, 0.5), center=(0.1, 0.0))
    assert isinstance(squeezed, Path)
    s = np.linspace(0.0, float(mixed.length), 100)
    points = (rows(mixed, s, 0)[:, 0] - [0.1, 0.0]) * [2.0, 0.5] + [0.1, 0.0]
    # both ways: every point lies on it, and it has the length of the wrapped formula
    assert np.abs(foot_point(squeezed, points).distance).max() < 1e-15
    wrapped = Transformed(
        inner=mixed, matrix=np.diag([2.0, 0.5]), offset=np.zeros(2), similarity=False
    )
    edges = np.asarray(mixed.breaks)
    total = sum(float(wrapped.arc_length(a, b)) for a, b in pairwise(edges))
    assert_allclose(squeezed.length, total, rtol=1e-12)
    assert list(np.unique(squeezed.source_line)) == list(np.unique(mixed.source_line))


def test_an_arc_on_scaled_axes_is_an_arc_of_an_ellipse():
    circle = Path.from_contour(Circle(radius=0.02), 1e-9)
    squeezed = circle.scaled((3.0, 1.0))
    assert squeezed.closed
    ellipse = Ellipse(semi_axes=(0.06, 0.02))
    assert_allclose(squeezed.length, ellipse.length, rtol=1e-13)
    level = jax.vmap(lambda s: ellipse.level(squeezed.position(s)))(np.linspace(0, 0.2, 50))
    assert np.abs(level).max() < 1e-13


@pytest.mark.slow
def test_wrapped_conics_and_parabolas_enter_a_path_exactly():
    moved = Ellipse(semi_axes=(0.06, 0.02)).rotated(0.3).scaled(2.0).reversed()
    path = Path.from_contour(moved, 1e-3)  # a loose tolerance: what is exact does not use it
    assert path.n_pieces == Path.from_contour(Ellipse(semi_axes=(0.06, 0.02)), 1e-3).n_pieces
    s = np.linspace(0.0, float(path.length), 50)
    level = jax.vmap(moved.level)(rows(path, s, 0)[:, 0])
    assert np.abs(level).max() < 1e-13
    assert_allclose(path.length, moved.length, rtol=1e-13)
    before, after = rows(moved, np.array([0.0]), 1)[0], rows(path, np.array([0.0]), 1)[0]
    assert_allclose(after[0], before[0], rtol=0, atol=1e-15)
    assert_allclose(after[1], before[1] / np.linalg.norm(before[1]), rtol=0, atol=1e-12)
    parabola = Parabola(coefficient=50.0, half_width=0.02, rotation=0.3)
    path = Path.from_contour(parabola, 1e-3)
    s = np.linspace(0.0, float(path.length), 50)
    assert np.abs(jax.vmap(parabola.level)(rows(path, s, 0)[:, 0])).max() < 1e-16
    assert_allclose(path.length, parabola.length, rtol=1e-13)


def test_helices_are_not_squeezed():
    helix = Path.from_contour(Helix(radius=0.1, pitch=0.02, turns=1.5), 1e-9)
    with pytest.raises(GeometryError, match="piece 0 is a helix"):
        helix.scaled((1.0, 2.0, 1.0))
    moved = helix.rotated(1.0, axis=(1, 0, 0)).scaled(3.0)
    assert isinstance(moved, Path)
    assert_allclose(moved.length, 3.0 * helix.length, rtol=ROUNDING)


@pytest.mark.slow
def test_a_path_can_be_turned_by_a_traced_angle(mixed):
    x = jax.jit(lambda angle: mixed.rotated(angle).position(0.2)[0])
    step = 1e-6
    slope = (x(0.3 + step) - x(0.3 - step)) / (2 * step)
    assert_allclose(jax.grad(x)(0.3), slope, rtol=1e-8)


@pytest.mark.slow
def test_a_stretch_of_a_path_begins_at_zero(mixed):
    for low, high in ((0.02, 0.27), (0.12, 0.13), (0.1, float(mixed.length))):
        cut = mixed.between(low, high)
        assert_allclose(cut.length, high - low, rtol=1e-13)
        s = np.linspace(1e-6, high - low - 1e-6, 40)
        expected, got = rows(mixed, s + low), rows(cut, s)
        size = np.abs(expected).max(axis=(0, 2))[:, None] + 1.0
        # a Bézier piece cut anew has a new series
        assert np.all(np.abs(got - expected) <= 1e-9 * size)
        assert_allclose(got[:, 0], expected[:, 0], rtol=0, atol=1e-15)
    ring = Path.from_contour(Circle(radius=0.1), 1e-9)
    over = ring.between(-0.1, 0.2)
    assert not over.closed
    assert_allclose(over.position(0.1), [0.1, 0.0], rtol=0, atol=1e-15)
    assert_allclose(over.length, 0.3, rtol=ROUNDING)


def test_a_stretch_of_a_formula_keeps_its_parameter():
    cut = EIGHT.between(5.0, 8.0)
    assert isinstance(cut, Stretch)
    assert (float(cut.domain[0]), float(cut.domain[1])) == (5.0, 8.0)
    assert not cut.closed
    assert_allclose(cut.length, EIGHT.arc_length(5.0, 8.0), rtol=1e-14)
    assert cut.between(6.0, 7.0).inner is EIGHT


class Kinked(Contour):
    """A contour of two pieces, to see that hints are handed on."""

    n_axes = property(lambda self: 2)
    domain = property(lambda self: (0.0, 2.0))
    closed = property(lambda self: False)

    def locate(self, parameter, piece):
        return jnp.asarray(parameter >= 1.0, jnp.int32)

    def position(self, parameter, piece=None):
        k = self.locate(parameter, 0) if piece is None else piece
        return jnp.stack([parameter, jnp.where(k == 1, parameter - 1.0, 0.0)])


def test_hints_are_handed_on():
    kinked = Kinked()
    back, moved, cut = kinked.reversed(), kinked.rotated(0.1), kinked.between(0.2, 1.8)
    assert int(back.locate(0.5, jnp.int32(0))) == 1
    assert int(moved.locate(1.5, jnp.int32(0))) == 1
    assert int(cut.locate(1.5, jnp.int32(0))) == 1
    assert isinstance(back, Reversed)
    # the hint counts, even where it is wrong
    assert_allclose(back.position(1.5, jnp.int32(1)), [0.5, -0.5])
    assert_allclose(cut.position(0.5, jnp.int32(1)), [0.5, -0.5])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: EIGHT.translated((1, 2, 3)), "offset must have 2 coordinates"),
        (lambda: EIGHT.translated((1, np.nan)), "offset must be finite"),
        (lambda: EIGHT.rotated(np.inf), "angle must be finite"),
        (lambda: EIGHT.rotated((0.1, 0.2)), "angle must be one number"),
        (lambda: EIGHT.rotated(0.1, axis=(0, 0, 1)), "axis is for contours in space"),
        (lambda: EIGHT.rotated(0.1, center=(0, 0, 0)), "center must have 2"),
        (lambda: EIGHT.scaled(0.0), "factor must not be 0"),
        (lambda: EIGHT.scaled((1, 2, 3)), "factor must be one number or 2"),
        (lambda: EIGHT.scaled((1, np.nan)), "factor must be finite"),
        (
            lambda: Helix(radius=1, pitch=1, turns=1).rotated(0.1),
            "a contour in space needs axis=",
        ),
        (
            lambda: Helix(radius=1, pitch=1, turns=1).rotated(0.1, axis=(0, 0, 0)),
            "axis must not be the zero vector",
        ),
        (lambda: Line(start=(0,), end=(1,)).rotated(0.1), "2 or 3 axes can be turned"),
        (lambda: EIGHT.between(2.0, 1.0), "start must be < end"),
        (lambda: EIGHT.between(0.0, 7.0), "at most one round"),
        (lambda: EIGHT.between(0.0, np.nan), "end must be finite"),
        (
            lambda: Line(start=(0, 0), end=(1, 0)).between(0.5, 1.5),
            "must lie in the domain, 0 to 1, got 0.5 and 1.5",
        ),
    ],
)
def test_mistakes_are_named(make, message):
    with pytest.raises(GeometryError, match=message):
        make()
