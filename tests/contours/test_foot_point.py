"""The exact foot point against closed forms and against an independent judge."""

import importlib.util
from pathlib import Path as FilePath

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contourlab.contours.base import Contour
from contourlab.contours.circle import Circle
from contourlab.contours.ellipse import Ellipse
from contourlab.contours.foot_points import cells_of, foot_point, local_foot, tied_parameter
from contourlab.contours.path import Path
from contourlab.errors import GeometryError

jax.config.update("jax_enable_x64", True)

_spec = importlib.util.spec_from_file_location(
    "foot_point_judge", FilePath(__file__).with_name("foot_point_judge.py")
)
judge = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(judge)

TURN = 2 * np.pi
ROUNDING = 1e-12  # of contours of size 1
JUDGED = 3e-9  # what bounded minimisation of a distance near 0 can tell


class Eight(Contour):
    """Smooth, closed, and crossing itself at the origin."""

    @property
    def n_axes(self):
        return 2

    @property
    def domain(self):
        return 0.0, 2 * np.pi

    @property
    def closed(self):
        return True

    def position(self, parameter, piece=None):
        return jnp.stack([jnp.sin(parameter), 0.5 * jnp.sin(2 * parameter)])


def arcs(rng, n, n_axes, turn=3.0, helices=False):
    """Return a chain of lines, arcs and, if asked, helices, with corners between them."""
    length = rng.uniform(0.05, 1, n)
    rate = np.where(rng.uniform(size=n) < 0.3, 0, rng.uniform(-turn, turn, n) / length)
    start, rows = [np.zeros(n_axes)], []
    for k in range(n):
        frame = np.linalg.qr(rng.normal(size=(n_axes, n_axes)))[0]
        rise = rng.uniform(0.3, 0.9) if helices and rate[k] and rng.uniform() < 0.6 else 0.0
        flat = np.sqrt(1 - rise**2)
        u, v = flat * frame[:, 0], flat * frame[:, 1]
        w = rise * frame[:, 2] if n_axes > 2 else np.zeros(n_axes)
        half = 0.5 * rate[k] * length[k]
        chord = length[k] * np.sinc(half / np.pi)
        start.append(start[-1] + chord * (u * np.cos(half) + v * np.sin(half)) + w * length[k])
        rows.append((u, v, w))
    u, v, w = (np.array(x) for x in zip(*rows, strict=True))
    return Path.from_helical(np.array(start[:-1]), u, v, w, rate, length)


def bezier(rng, n, n_axes):
    points = 0.4 * rng.normal(size=(n, 4, n_axes))
    points[1:, 0] = points[:-1, -1]
    return Path.from_bezier(points, rng.uniform(0.5, 2, (n, 4)))


def mixed(rng):
    first = bezier(rng, 1, 2)
    end = np.asarray(first.position(first.length))
    return Path.join([first, Path.polyline(end + np.array([[0, 0], [0.3, 0.4], [0.9, 0.1]]))])


MAKERS = {
    "polyline": lambda rng: Path.polyline(rng.normal(size=(12, 2))),
    "closed polyline in space": lambda rng: Path.polyline(rng.normal(size=(9, 3)), closed=True),
    "four axes": lambda rng: Path.polyline(rng.normal(size=(7, 4))),
    "arcs": lambda rng: arcs(rng, 10, 2, turn=5.5),
    "arcs in space": lambda rng: arcs(rng, 8, 3),
    "helices": lambda rng: arcs(rng, 6, 3, turn=12.0, helices=True),
    "bezier": lambda rng: bezier(rng, 2, 2),
    "mixed": mixed,
    "ellipse": lambda rng: Ellipse(semi_axes=(1.0, 0.3)),
    "eight": lambda rng: Eight(),
}


def norms(foot):
    return np.linalg.norm(foot.vector, axis=1)


@pytest.mark.parametrize("name", MAKERS)
def test_agrees_with_the_judge(name):
    rng = np.random.default_rng(0)
    contour = MAKERS[name](rng)
    other = judge.Judge(contour)
    start, end = map(float, contour.domain)
    laps = (end - start) if contour.closed else 0.0
    near = rng.uniform(start - laps, end + laps, 24)
    reference = np.asarray(jax.jit(jax.vmap(contour.position))(near))
    points = reference + rng.normal(size=reference.shape) * 10 ** rng.uniform(-4, 0.3, (24, 1))
    local = [other.near(*x) for x in zip(points, near, strict=True)]
    everywhere = [other.everywhere(q) for q in points]
    for foot, distance in (
        (foot_point(contour, points, near), local),
        (foot_point(contour, points), everywhere),
    ):
        assert_allclose(norms(foot), distance, rtol=0, atol=JUDGED)
        # the judge minimises from above: nowhere may it be nearer by more than rounding
        assert np.max(norms(foot) - distance) < ROUNDING
        assert_allclose(foot.position, foot.vector + points, rtol=0, atol=ROUNDING)
        at = np.asarray(jax.jit(jax.vmap(contour.position))(foot.parameter))
        assert_allclose(at, foot.position, rtol=0, atol=1e-11)
        assert_allclose(np.abs(foot.distance), norms(foot), rtol=1e-9, atol=ROUNDING)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(1e-3, 10.0))
def test_random_polylines(seed, scale):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(8, 2))
    points = scale * rng.normal(size=(5, 2))
    a, b = corners[:-1], corners[1:]
    t = np.einsum("qkx,kx->qk", points[:, None] - a, b - a) / np.sum((b - a) ** 2, axis=1)
    nearest = a + np.clip(t, 0, 1)[..., None] * (b - a)
    expected = np.linalg.norm(nearest - points[:, None], axis=2).min(axis=1)
    assert_allclose(norms(foot_point(Path.polyline(corners), points)), expected, atol=ROUNDING)


def test_line_and_its_ends():
    foot = foot_point(
        Path.polyline([[0, 0], [2, 0]]),
        [[0.5, 0.25], [0.5, -0.25], [3, 1], [-1, -1]],
        near=[0.6, 0.4, 2.0, 0.0],
    )
    assert_allclose(foot.parameter, [0.5, 0.5, 2, 0], atol=ROUNDING)
    # the foot lies to the right of a point that is left of the line: negative
    assert_allclose(foot.distance, [-0.25, 0.25, -np.sqrt(2), np.sqrt(2)], atol=ROUNDING)
    assert_allclose(foot.vector, [[0, -0.25], [0, 0.25], [-1, -1], [1, 1]], atol=ROUNDING)


def test_corner_inside_and_outside():
    path = Path.polyline([[0, 0], [1, 0], [1, 1]])
    foot = foot_point(path, [[1.3, -0.4], [0.8, 0.1], [0.9, 0.2]], near=[0.9, 0.8, 1.1])
    assert_allclose(foot.parameter, [1.0, 0.8, 1.2], atol=ROUNDING)
    # at the corner: sign by the tangent of the second line, (0, 1) x (-0.3, 0.4) = 0.3
    assert_allclose(foot.distance, [0.5, -0.1, -0.1], atol=ROUNDING)


def test_sign_at_a_sharp_corner_is_that_of_the_second_piece():
    path = Path.polyline([[0, 0], [1, 0], [1 - np.sqrt(0.75), 0.5]])
    foot = foot_point(path, [[1.2, 0.06]], near=[0.9])
    # v = (-0.2, -0.06): to the right of the first tangent, to the left of the second
    assert_allclose(foot.distance, np.hypot(0.2, 0.06), atol=ROUNDING)


def test_both_ways_end_together():
    path = Path.polyline([[-99, 0.5], [-1, 0.5], [-1, 0], [1, 0], [1, 0.5], [99, 0.5]])
    for x in (0.05, -0.05):
        foot = foot_point(path, [[x, 3.0]], near=[98 + 0.5 + 1])
        assert_allclose(norms(foot), np.hypot(0.95, 2.5), rtol=ROUNDING)


def test_circle_and_its_seam():
    circle = Circle(radius=2.0)
    angle = np.array([0.1, -0.1, 2 * np.pi - 0.05, 4 * np.pi + 0.05, 3.0])
    radius = np.array([2.5, 1.5, 2.001, 1.999, 1.0])
    shift = np.array([-0.2, 0.2, 0.1, -0.1, 0.0])
    points = radius[:, None] * np.stack([np.cos(angle + shift), np.sin(angle + shift)], axis=1)
    foot = foot_point(circle, points, near=angle)
    assert_allclose(foot.parameter, angle + shift, atol=ROUNDING)
    # counter-clockwise, left is inwards: outside points have their foot to the left
    assert_allclose(foot.distance, radius - 2, atol=ROUNDING)


def test_closed_path_across_its_seam():
    square = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    foot = foot_point(square, [[0.1, -0.01], [-0.01, 0.1], [0.1, 0.02]], near=[-0.05, 0.05, 3.97])
    assert_allclose(foot.parameter, [0.1, -0.1, 4.1], atol=ROUNDING)


def test_whole_turn_in_one_arc():
    circle = Path.from_helical([[1.0, 0]], [[0, 1.0]], [[-1.0, 0]], [[0, 0]], [1.0], [2 * np.pi])
    angle = np.linspace(0.1, 6.1, 7)
    points = 1.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert_allclose(foot_point(circle, points, near=angle).parameter, angle, atol=ROUNDING)
    # from its start all of it is in the ball, unless the point is near the start
    middle = points[1:-1]
    assert_allclose(norms(foot_point(circle, middle, near=np.zeros(5))), 0.3, atol=ROUNDING)


def test_crossing_keeps_its_branch():
    near = np.array([0.02, np.pi - 0.02])
    points = np.asarray(jax.vmap(Eight().position)(near)) * [[1, -0.9], [1, -0.9]]
    local, everywhere = foot_point(Eight(), points, near), foot_point(Eight(), points)
    # each point lies almost on the other branch
    assert np.all(np.abs(local.parameter - near) < 0.1)
    assert np.all(norms(local) > 10 * norms(everywhere))


def test_a_return_is_not_connected():
    # out, far away, and back within a hair of the first line
    path = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0.01], [0.9, 0.01]])
    local, everywhere = (foot_point(path, [[0.5, 0.009]], near) for near in ([0.5], None))
    assert_allclose([norms(local)[0], norms(everywhere)[0]], [0.009, 0.001], atol=ROUNDING)


def test_an_arc_that_leaves_the_ball_inside_one_piece():
    # almost a full turn: its far end comes back to the reference point, but not along the stretch
    turn = 2 * np.pi * 0.99
    arc = Path.from_helical([[1.0, 0]], [[0, 1.0]], [[-1.0, 0]], [[0, 0]], [1.0], [turn])
    q = [[np.cos(-0.05), np.sin(-0.05)]]
    assert_allclose(foot_point(arc, q, near=[0.0]).parameter, [0.0], atol=ROUNDING)
    assert_allclose(foot_point(arc, q).parameter, [turn], atol=ROUNDING)


def test_two_minima_beyond_the_evolute():
    ellipse = Ellipse(semi_axes=(1.0, 0.5))
    for angle in (np.pi / 2, 3 * np.pi / 2):
        near = np.array([angle - 0.3, angle + 0.3])
        reference = np.asarray(jax.vmap(ellipse.position)(near))
        points = reference * [1.0, -0.9]  # across the axis, nearer to the other side
        foot = foot_point(ellipse, points, near)
        other = judge.Judge(ellipse)
        expected = [other.near(*x) for x in zip(points, near, strict=True)]
        assert_allclose(norms(foot), expected, atol=JUDGED)


def test_on_the_evolute_the_distance_is_right():
    # the centre of curvature of the end of the long axis, and of the short one
    ellipse = Ellipse(semi_axes=(1.0, 0.5))
    foot = foot_point(ellipse, [[0.75, 0.0], [0.0, 0.5 - 2.0]], near=[0.1, np.pi / 2 - 0.1])
    assert_allclose(norms(foot)[0], 0.25, rtol=ROUNDING)
    circle = foot_point(Circle(radius=1.0), [[0.0, 0.0]], near=[1.0])
    assert_allclose(norms(circle), 1.0, rtol=ROUNDING)


def test_zero_error_and_far_away():
    path = Path.polyline([[0, 0], [1, 0], [1, 1]])
    foot = foot_point(path, [[0.25, 0], [3e3, 4e3]], near=[0.25, 0.5])
    assert_allclose(foot.parameter, [0.25, 2.0], atol=ROUNDING)
    assert_allclose(norms(foot), [0, np.hypot(2999, 3999)], rtol=ROUNDING)


def test_far_from_a_long_closed_path():
    # every ball holds the whole path: no walk, and parameters stay with their lap
    angle = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    path = Path.polyline(np.stack([np.cos(angle), np.sin(angle)], axis=1), closed=True)
    near = np.array([0.1, 0.2, 6.2]) + float(path.length)
    foot = foot_point(path, [[3e3, 4e3], [-5e3, 0], [5e3, 0]], near)
    assert_allclose(norms(foot), 5e3 - 1, rtol=1e-11)
    assert np.all(np.abs(foot.parameter - near) <= 0.5 * float(path.length) + 1e-9)


def test_near_is_clipped_to_an_open_domain():
    path = Path.polyline([[0, 0], [1, 0]])
    foot = foot_point(path, [[0.1, 0.1], [0.9, 0.1]], near=[-7.0, 9.0])
    assert_allclose(foot.parameter, [0.1, 0.9], atol=ROUNDING)


@pytest.mark.parametrize("near", [[0.0, np.nan, 0.0, 0.5], None])
def test_nan_in_nan_out(near):
    points = [[np.nan, 0], [0, 0] if near else [np.inf, 0], [np.inf, 0], [0.5, 0.25]]
    for contour in (Path.polyline([[0, 0], [1, 0]]), Ellipse(semi_axes=(0.5, 0.25))):
        foot = foot_point(contour, points, near)
        for values in foot:
            assert np.isnan(values[:3]).all()
            assert np.isfinite(values[3]).all()


def test_empty():
    for near in ([], None):
        foot = foot_point(Path.polyline([[0, 0], [1, 0]]), np.zeros((0, 2)), near)
        assert [x.shape for x in foot] == [(0,), (0, 2), (0, 2), (0,)]


def test_wrong_shapes_are_named():
    path = Path.polyline([[0, 0], [1, 0]])
    with pytest.raises(GeometryError, match=r"\(n, 2\).*got \(4, 3\)"):
        foot_point(path, np.zeros((4, 3)))
    with pytest.raises(GeometryError, match=r"\(4,\), got \(3,\)"):
        foot_point(path, np.zeros((4, 2)), near=np.zeros(3))


def test_what_is_no_number_is_refused():
    path = Path.polyline([[0, 0], [1, 0]])
    with pytest.raises(GeometryError, match="points must be an array of numbers"):
        foot_point(path, [["a", "b"]])
    with pytest.raises(GeometryError, match="near must be an array of numbers"):
        foot_point(path, [[0, 0]], near=["x"])
    with pytest.raises(GeometryError, match=r"got \(2,\)"):
        foot_point(path, [0.0, 0.0])


def test_ties_are_told():
    # the long axis inside the evolute's cusps; the short one; beside them; the ellipse itself
    ellipse, points = Ellipse(semi_axes=(1.0, 0.5)), [[0.3, 0], [0, -0.2], [0.3, 1e-3], [0, 0.5]]
    foot = foot_point(ellipse, points)
    other = tied_parameter(ellipse, points, foot)
    assert_allclose(other[0], TURN - foot.parameter[0], atol=1e-9)
    assert np.isnan(other[1:]).all()
    assert not np.isnan(tied_parameter(ellipse, points, foot, tolerance=5e-3)[2])
    square = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    points = [[0.5, 0.5], [0.2, 0.2], [0.2, 0.21], [1.5, 1.5], [np.nan, 0]]
    other = tied_parameter(square, points, foot_point(square, points))
    assert np.isnan(other).tolist() == [False, False, True, True, True]
    circle = Circle(radius=2.0)
    assert not np.isnan(tied_parameter(circle, [[0, 0.0]], foot_point(circle, [[0, 0.0]])))[0]
    with pytest.raises(GeometryError, match="apart must be > 0 m, got 0"):
        tied_parameter(circle, [[0, 0.0]], foot_point(circle, [[0, 0.0]]), apart=0.0)
    with pytest.raises(GeometryError, match=r"shape of foot.position, \(1, 2\)"):
        tied_parameter(circle, [[0, 0.0]] * 2, foot_point(circle, [[0, 0.0]]))


def test_one_point_is_as_good_as_many():
    for contour in (Ellipse(semi_axes=(1.0, 0.3)), Path.polyline([[0, 0], [1, 0]])):
        foot = foot_point(contour, [[0.5, 0.25]])
        assert [np.shape(x) for x in foot] == [(1,), (1, 2), (1, 2), (1,)]


def test_a_long_stretch_of_many_rows():
    # balls that hold thousands of rows but not the path: passed by blocks, judged by all pieces
    rng = np.random.default_rng(6)
    angle = np.linspace(0, 40 * np.pi, 6_001)
    radius = 1 + angle / 100
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    path = Path.polyline(corners)
    near = rng.uniform(0, float(path.length), 60)
    on = np.stack([np.interp(near, path.breaks, corners[:, k]) for k in (0, 1)], axis=1)
    points = on + rng.uniform(0.5, 1.6, (60, 1)) * rng.normal(size=(60, 2))
    foot = foot_point(path, points, near)
    a, b = corners[:-1], corners[1:]
    for q, p, c, distance in zip(points, near, on, norms(foot), strict=True):
        error = np.linalg.norm(q - c)
        inside = np.linalg.norm(corners - c, axis=1) <= 2 * error
        k = int(np.searchsorted(path.breaks, p, side="right")) - 1
        # joints passed either way until one lies outside, and the row in which that happens
        ahead = np.flatnonzero(~inside[k + 1 :])
        behind = np.flatnonzero(~inside[: k + 1])
        last = k + ahead[0] if len(ahead) else len(a) - 1
        first = behind[-1] if len(behind) else 0
        rows = slice(first, last + 1)
        along = b[rows] - a[rows]
        t = np.sum((q - a[rows]) * along, axis=1) / np.sum(along**2, axis=1)
        nearest = a[rows] + np.clip(t, 0, 1)[:, None] * along
        expected = np.linalg.norm(nearest - q, axis=1).min()
        assert_allclose(distance, expected, rtol=0, atol=ROUNDING)


def blended():
    """Return three lines whose corners are rounded by Bézier rows that bend up to 1/(5 mm)."""
    first = [[0.09, 0.0], [0.096, 0], [0.1, 0], [0.1, 0], [0.1, 0.004], [0.1, 0.01]]
    second = [[0.1, 0.05], [0.1, 0.054], [0.1, 0.06], [0.104, 0.06], [0.11, 0.06]]
    return Path.join([
        Path.polyline([[0, 0], first[0]]),
        Path.from_bezier(np.array([first]), np.ones((1, 6))),
        Path.polyline([first[-1], second[0]]),
        Path.from_bezier(np.array([second]), np.array([[1, 0.8, 0.7, 0.8, 1.0]])),
        Path.polyline([second[-1], [0.2, 0.06]]),
    ])  # fmt: skip


def test_a_blended_path_from_rounding_to_large_errors():
    # small errors take Bézier rows whole, large ones cell by cell; tracing knows only cells
    rng, path = np.random.default_rng(3), blended()
    near = np.concatenate([rng.uniform(0, float(path.length), 200), path.breaks])
    size = np.concatenate([[0.0] * 20, 10 ** rng.uniform(-9, -2, len(near) - 20)])
    points = np.asarray(jax.vmap(path.position)(near))
    points = points + rng.permutation(size)[:, None] * rng.normal(size=points.shape)
    cells = cells_of(path)
    traced = jax.jit(jax.vmap(lambda q, p: local_foot(cells, q, p)))(points, near)
    foot = foot_point(path, points, near)
    assert_allclose(norms(foot), norms(traced), rtol=0, atol=1e-14)
    assert_allclose(foot.position, traced.position, rtol=0, atol=1e-13)
    assert_allclose(foot.parameter, traced.parameter, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", ["arcs", "ellipse"])
def test_traced_agrees_with_the_batch(name):
    rng = np.random.default_rng(1)
    contour = MAKERS[name](rng)
    start, end = map(float, contour.domain)
    near = rng.uniform(start, end, 20)
    points = np.asarray(jax.vmap(contour.position)(near)) + 0.1 * rng.normal(size=(20, 2))
    cells = cells_of(contour)
    traced = jax.jit(jax.vmap(lambda q, p: local_foot(cells, q, p, 0)))(points, near)
    for one, many in zip(traced, foot_point(contour, points, near), strict=True):
        assert_allclose(one, many, rtol=0, atol=1e-10)


def test_in_a_loop_the_branch_and_the_lap_are_kept():
    # a reference that passes the crossing of an eight twice, the corners of a square, their seams
    rng, steps = np.random.default_rng(5), 400
    square = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    for contour, error in ((Eight(), 0.02), (square, 0.05)):
        start, end = map(float, contour.domain)
        near = np.linspace(start - 0.1, end + 0.3, steps)
        centre = np.asarray(jax.vmap(contour.position)(near))
        points = centre + error * rng.uniform(-1, 1, centre.shape)
        cells = cells_of(contour)

        def step(piece, row, contour=contour, cells=cells):
            q, at = row
            piece = contour.locate(at, piece)
            return piece, local_foot(cells, q, at, piece)

        _, foot = jax.jit(lambda q, p, step=step: jax.lax.scan(step, jnp.int32(0), (q, p)))(
            points, near
        )
        # a foot on another branch would be half the domain away, one in another lap all of it
        assert np.max(np.abs(foot.parameter - near)) < 6 * error
        batch = foot_point(contour, points, near)
        assert_allclose(foot.parameter, batch.parameter, rtol=0, atol=1e-9)
        assert_allclose(foot.vector, batch.vector, rtol=0, atol=1e-14)


def test_gradients_against_differences():
    # beside a line, outside a corner, inside an arc
    points, near = np.array([[0.5, 0.1], [1.3, -0.4], [0.3, 0.28]]), np.array([0.4, 0.9, 3.6])
    arc = Path.from_helical([[1.0, 1]], [[-1.0, 0]], [[0, -1.0]], [[0, 0]], [1.0], [3.0])
    path = Path.join([Path.polyline([[0, 0], [1, 0], [1, 1]]), arc])

    def value(q, p):
        foot = local_foot(path, q, p, 0)
        return jnp.concatenate([foot.vector, foot.position, jnp.stack([foot.distance])])

    values, step = jax.jit(jax.vmap(value)), 1e-6
    ways = step * np.eye(2)
    expected = [(values(points + d, near) - values(points - d, near)) / (2 * step) for d in ways]
    expected = np.stack(expected, axis=2)
    for derivative in (jax.jacrev, jax.jacfwd):
        slope = jax.jit(jax.vmap(derivative(value)))(points, near)
        assert_allclose(slope, expected, rtol=0, atol=1e-8)


def test_gradient_over_the_shape_of_an_ellipse():
    @jax.jit
    def distance(size):
        ellipse = Ellipse(semi_axes=size)
        return local_foot(ellipse, jnp.array([0.8, 0.35]), 0.5).distance

    size, step = jnp.array([1.0, 0.5]), 1e-6
    slope = jax.grad(distance)(size)
    ways = step * np.eye(2)
    differences = [(distance(size + d) - distance(size - d)) / (2 * step) for d in ways]
    assert_allclose(slope, differences, rtol=0, atol=1e-8)


def test_many_chunks_are_the_same_as_one():
    rng = np.random.default_rng(2)
    path = arcs(rng, 300, 2)
    near = rng.uniform(0, float(path.length), 70_000)
    points = np.asarray(jax.jit(jax.vmap(path.position))(near)) + 0.05 * rng.normal(
        size=(70_000, 2)
    )
    whole, some = foot_point(path, points, near), foot_point(path, points[-500:], near[-500:])
    assert_allclose(whole.parameter[-500:], some.parameter, atol=ROUNDING)
    everywhere = foot_point(path, points[-500:])
    assert np.all(norms(everywhere) <= norms(some) + ROUNDING)
