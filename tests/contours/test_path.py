"""Paths: pieces end to end over arc length."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import real
from contourlab.contours.base import Contour
from contourlab.contours.circle import Arc, Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.helix import Helix
from contourlab.contours.line import Line
from contourlab.contours.path import Path
from contourlab.errors import GeometryError
from contourlab.testing.contours import check_contour


class FigureOfEight(Contour):
    """Not one of the curves that a path holds exactly."""

    size: jax.Array = real(default=0.03)

    n_axes = property(lambda self: 2)
    domain = property(lambda self: (0.0, 2.0 * np.pi))
    closed = property(lambda self: True)

    def position(self, parameter, piece=None):
        return self.size * jnp.stack([jnp.sin(parameter), 0.5 * jnp.sin(2.0 * parameter)])


class Kinked(FigureOfEight):
    """Jumps, so that nothing smooth can follow it."""

    def position(self, parameter, piece=None):
        return jnp.stack([parameter, jnp.where(parameter < 1.1, 0.0, 1.0)])


def mixed():
    """Line, Bézier, arc: 1 m along x, a bend, a left half turn; lines 3, 5, 7."""
    line = Path.polyline([[0.0, 0.0], [1.0, 0.0]], [3])
    bend = Path.from_bezier([[[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]]], source_line=[5])
    arc = Path.from_contour(Arc(center=(1.0, 1.0), start=(2.0, 1.0), angle=np.pi), 1e-9)
    return Path.join([line, bend, arc])


SQUARE = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1.0]], [1, 2, 3, 4], closed=True)


@pytest.mark.parametrize("name", ["square", "mixed"])
def test_keeps_the_contract_of_contours(name):
    check_contour(SQUARE if name == "square" else mixed())


def test_polyline_is_piecewise_linear_and_right_sided():
    assert_allclose(SQUARE.position(1.25), [1.0, 0.25], rtol=1e-15)
    assert_allclose(SQUARE.derivatives(1.0, 2), [[1, 0], [0, 1], [0, 0]], rtol=0, atol=1e-16)
    assert_allclose(
        SQUARE.derivatives(4.0, 1), [[0, 0], [1, 0]], rtol=0, atol=1e-16
    )  # round the seam
    assert_allclose(SQUARE.position(-0.5), [0.0, 0.5], rtol=0, atol=1e-15)


def test_bezier_rows_are_right_sided_at_joints():
    path = mixed()
    at = float(path.breaks[1])
    before, after = path.derivatives(at - 1e-9, 2), path.derivatives(at, 2)
    assert_allclose(before[2], 0.0)
    assert_allclose(after[2], [0.0, 0.5], rtol=1e-9)  # of the parabola at its first point
    last = float(path.breaks[-2])
    assert_allclose(path.derivatives(last, 2)[2], [-1.0, 0.0], rtol=0, atol=1e-12)


def test_open_helical_ends_continue_their_formula():
    path = Path.from_contour(Arc(center=(0, 0), start=(2, 0), angle=1.0), 1e-9)
    for s in (-1.0, 3.0):
        assert_allclose(
            path.position(s), [2 * np.cos(s / 2), 2 * np.sin(s / 2)], rtol=0, atol=1e-15
        )


@pytest.mark.parametrize("radius", [1e-7, 1.0, 1e6, 1e12])
def test_arcs_from_tiny_to_nearly_straight_keep_their_digits(radius):
    length = min(1.0, radius)
    arc = Path.from_helical([[0, 0]], [[1, 0]], [[0, 1]], [[0, 0]], [1 / radius], [length])
    x, y = np.asarray(arc.position(length))
    turned = length / radius
    assert_allclose(x, radius * np.sin(turned), rtol=1e-15)
    assert_allclose(y, 2.0 * radius * np.sin(0.5 * turned) ** 2, rtol=1e-15)
    assert_allclose(arc.derivatives(length, 2)[2, 1], np.cos(turned) / radius, rtol=1e-14)


def test_a_long_path_far_away_stays_on_its_points():
    rng = np.random.default_rng(3)
    points = 1e3 + np.cumsum(rng.uniform(1e-6, 1e-2, (20_000, 3)), axis=0)
    path = Path.polyline(points)
    got = jax.jit(jax.vmap(lambda s: path.position(s)))(np.asarray(path.breaks))
    # coordinates of 1.1 km and an arc length of 170 m: two roundings of each
    assert_allclose(got, points, rtol=0, atol=6e-13)


def test_locate_finds_what_bisection_finds_from_anywhere():
    rng = np.random.default_rng(0)
    places = np.concatenate([rng.uniform(-2, 6, 200), np.arange(5.0)])
    for path in (SQUARE, Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1.0]])):
        hints = rng.integers(-3, 9, len(places)).astype(np.int32)
        found = jax.jit(jax.vmap(lambda s, path=path: path.find(s)))(places)
        located = jax.jit(jax.vmap(lambda s, k, path=path: path.locate(s, k)))(places, hints)
        assert np.array_equal(found, located)
        at = np.mod(places, 4.0) if path.closed else places
        expected = np.clip(np.searchsorted(np.asarray(path.breaks), at, "right") - 1, 0, None)
        assert np.array_equal(found, np.minimum(expected, path.n_pieces - 1))


def test_same_numbers_as_argument_closed_over_and_without_jit():
    path = mixed()
    places = np.linspace(-0.2, float(path.length) + 0.2, 12)

    def along(path, places):
        def step(piece, s):
            piece = path.locate(s, piece)
            return piece, path.derivatives(s, 2, piece)

        return jax.lax.scan(step, jnp.int32(0), places)[1]

    closed_over = jax.jit(lambda places: along(path, places))(places)
    argument = jax.jit(along)(path, places)
    batched = jax.jit(jax.vmap(lambda s: path.derivatives(s, 2)))(places)
    with jax.disable_jit():
        plain = np.stack([path.derivatives(s, 2) for s in places[::4]])
    assert_allclose(argument, closed_over, rtol=1e-13, atol=1e-13)
    assert_allclose(batched, closed_over, rtol=1e-13, atol=1e-13)
    assert_allclose(plain, closed_over[::4], rtol=1e-13, atol=1e-13)


def test_gradients_cross_the_look_up_both_ways():
    path = mixed()

    def located(s):
        return path.position(s, path.locate(s, jnp.int32(0)))

    @jax.jit
    def everything(s):
        firsts = [way(curve)(s) for curve in (path.position, located)
                  for way in (jax.jacrev, jax.jacfwd)]  # fmt: skip
        return path.derivatives(s, 2), firsts, jax.jacfwd(jax.jacrev(located))(s)

    for at in (0.5, 1.7, 3.4):  # one in each piece
        rows, firsts, bend = everything(at)
        for first in firsts:
            assert_allclose(first, rows[1], rtol=1e-12, atol=1e-14)
        assert_allclose(bend, rows[2], rtol=1e-10, atol=1e-12)


def test_joints_say_how_far_the_path_turns_and_bends():
    path = mixed()
    joints = path.joints()
    assert len(joints.parameter) == path.n_pieces - 1
    assert_allclose(joints.turning_angle, 0.0, rtol=0, atol=1e-12)
    first, last = np.abs(joints.curvature_jump[[0, -1]])
    assert_allclose(first, 0.5, rtol=1e-9)  # the parabola begins with curvature 1/2
    assert_allclose(last, 0.5, rtol=1e-9)  # and ends with it, where the arc has 1
    assert (joints.line_before[0], joints.line_after[0]) == (3, 5)
    assert len(path.corners()) == 0
    seam = SQUARE.joints()
    assert_allclose(seam.turning_angle, np.pi / 2, rtol=1e-15)
    assert_allclose(seam.parameter, [1, 2, 3, 4])
    assert (seam.line_before[-1], seam.line_after[-1]) == (4, 1)


def test_corners_are_joints_beyond_a_tolerance():
    angles = np.array([0.0, 0.0, 2e-4, 2e-4 + 5e-5, np.pi])
    steps = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    path = Path.polyline(np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]))
    assert path.corners().tolist() == [1, 3]
    assert path.corners(tolerance=1e-5).tolist() == [1, 2, 3]
    assert_allclose(path.joints().turning_angle, np.abs(np.diff(angles)), rtol=1e-11)


def test_source_lines_and_curvature_of_pieces():
    path = mixed()
    lines = jax.jit(jax.vmap(lambda s: path.source_line_at(s)))(np.array([0.5, 1.0, 1.5, 3.5]))
    assert lines.tolist() == [3, 5, 5, 0]
    assert path.curvature[0] == 0.0
    assert np.isnan(path.curvature[1])
    assert_allclose(path.curvature[-1], 1.0)
    clockwise = Path.from_contour(Circle(radius=0.5, clockwise=True), 1e-9)
    assert_allclose(clockwise.curvature, [-2.0])
    helix = Path.from_contour(Helix(radius=0.5, pitch=np.pi, turns=1.0), 1e-9)
    assert_allclose(helix.curvature, [1.0], rtol=1e-15)  # r / (r² + c²), c = 1/2


@pytest.mark.parametrize(
    "contour",
    [
        Line(start=(0.0, 1.0, 2.0), end=(1.0, 1.0, 0.0)),
        Circle(radius=2.0, center=(0, 0, 0), normal=(0, 1, 0.3), clockwise=True, start_angle=1),
        Arc(center=(0.5, 0.0), start=(1.0, 0.0), angle=-8.0),
        Helix(radius=1.0, pitch=-0.1, turns=2.5, axis=(1, 2, 3)),
        Ellipse(semi_axes=(3.0, 1.0), rotation=0.4),
        Ellipse(semi_axes=(1.0, 1e-3)),
    ],
    ids=["line", "circle", "arc", "helix", "ellipse", "thin ellipse"],
)
def test_exact_contours_enter_a_path_exactly(contour):
    path = Path.from_contour(contour, 1.0)
    assert path.closed == contour.closed
    assert_allclose(path.length, contour.length, rtol=1e-14)
    places = np.linspace(0.0, float(contour.domain[1]), 60)

    def both(p):
        return path.position(contour.arc_length(0.0, p)), contour.position(p)

    got, wanted = jax.jit(jax.vmap(both))(places)
    # 1e-13 along the curve from the series, sizes up to 3
    assert_allclose(got, wanted, rtol=0, atol=1e-12)
    assert len(path.corners(tolerance=1e-9)) == 0


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
def test_a_formula_enters_within_the_tolerance(tolerance):
    contour = FigureOfEight()
    path = Path.from_contour(contour, tolerance)
    assert path.closed
    assert len(path.corners()) == 0
    s = np.linspace(0.0, float(path.length), 3001)
    x, y = np.asarray(jax.jit(jax.vmap(lambda s: path.position(s)))(s)).T / 0.03
    # implicit form y² = x² (1 - x²), divided by its gradient: a distance, to first order
    level, slope = y**2 - x**2 * (1 - x**2), np.hypot(2 * y, 2 * x - 4 * x**3)
    clear = slope > 0.1  # away from the crossing, where the gradient vanishes
    assert clear.sum() > 2000
    assert np.max(np.abs(level / np.where(clear, slope, 1.0))[clear]) * 0.03 < tolerance


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Path.polyline([[0, 0]]), GeometryError, "two points or more"),
        (lambda: Path.polyline([[0, 0], [0, 0]]), GeometryError, "piece 0 must have a length"),
        (lambda: Path.polyline([[0, 0], [np.nan, 0]]), GeometryError, "piece 0 is not finite"),
        (lambda: Path.join([]), GeometryError, "one contour or more"),
        (
            lambda: Path.join([SQUARE, Path.polyline([[0, 0, 0], [1, 0, 0]])]),
            GeometryError,
            "has 3 axes, but contour 0",
        ),
        (
            lambda: Path.join([SQUARE, SQUARE.piece(1)]),
            GeometryError,
            "1 m away from the start of contour 1",
        ),
        (lambda: SQUARE.piece(4), GeometryError, "0 .. 3, got 4"),
        (lambda: SQUARE.derivatives(0.0, -1), GeometryError, "order must be >= 0"),
        (
            lambda: Path.from_helical([[0, 0]], [[2, 0]], [[0, 2]], [[0, 0]], [1], [1]),
            GeometryError,
            "must be a unit vector",
        ),
        (
            lambda: Path.from_helical([[0, 0]], [[1, 0]], [[1, 0]], [[0, 0]], [1], [1]),
            GeometryError,
            "turned by 90°",
        ),
        (
            lambda: Path.from_helical([[0, 0]], [[1, 0]], [[0, 1]], [[0, 0]], [1, 2], [1]),
            GeometryError,
            r"angle_rate must have shape \(1,\), got \(2,\)",
        ),
        (
            lambda: Path.polyline([[0, 0], [1e3, 0], [1e3, 1e-15]]),
            GeometryError,
            "piece 1 is too short for the path",
        ),
        (lambda: Path.from_contour(Ellipse(semi_axes=(1, 2)), 0.0), GeometryError, "tolerance"),
        (lambda: Path.from_contour(Kinked(), 1e-6), GeometryError, "near parameter 1.1"),
    ],
)
def test_mistakes_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_construction_raises_no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mixed()
