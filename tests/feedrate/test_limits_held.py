"""No limit is ever exceeded, between samples too: random paths and limits, judged independently."""

from __future__ import annotations

import numpy as np
import pytest

from contourlab.contours.ellipse import Ellipse
from contourlab.contours.path import Path
from contourlab.feedrate import AxisLimits, plan_feed
from contourlab.feedrate.arc_length import ArcLength, arc_derivatives, contour_derivatives
from contourlab.feedrate.motion import plan_motion
from contourlab.feedrate.plan import CORNER_ANGLE
from contourlab.feedrate.program import program_of
from contourlab.feedrate.refine import refine
from contourlab.feedrate.segments import segments_of

ROUNDING = 1e-7  # positions of 1 m and windows of 1e-4 s leave 1e-16 / 1e-8 of an acceleration


def helical_rows(path, s):
    """Derivatives 1 to 3 of a helical path over arc length, from the formula of its docstring."""
    breaks = np.asarray(path.breaks)
    k = np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, path.n_pieces - 1)
    rate = np.asarray(path.angle_rate)[k][:, None]
    angle = rate * (s - breaks[k])[:, None]
    u, v, w = (
        np.asarray(x)[k] for x in (path.tangent_vector, path.normal_vector, path.axial_vector)
    )
    c, q = np.cos(angle), np.sin(angle)
    return u * c + v * q + w, rate * (v * c - u * q), -(rate**2) * (u * c + v * q)


def instants(profile, rng, count=4000):
    """Instants everywhere, at every change of jerk, and on both sides of it."""
    nodes = profile.time
    middle = 0.5 * (nodes[1:] + nodes[:-1])
    even = np.linspace(0.0, profile.duration, count)
    near = np.concatenate([nodes * (1 + 1e-12), nodes * (1 - 1e-12)])
    t = np.concatenate([nodes, middle, even, near, rng.uniform(0, profile.duration, count)])
    return np.clip(t, 0.0, profile.duration)


def worst(profile, rows, limits, rng, joints=()):
    """Largest fractions of the limits that are taken; jerk not within 1 pm of joints, where the
    geometry is right-sided and the motion may still be on the left."""
    t = instants(profile, rng)
    s, v, a, j = profile.at(t)
    r1, r2, r3 = rows(s)
    v, a, j = v[:, None], a[:, None], j[:, None]
    velocity = np.abs(r1 * v) / np.asarray(limits.velocity)
    acceleration = np.abs(r1 * a + r2 * v**2) / np.asarray(limits.acceleration)
    jerk = np.abs(r1 * j + 3 * r2 * v * a + r3 * v**3) / np.asarray(limits.jerk)
    gap = np.abs(s[:, None] - np.asarray(joints)[None, :]).min(axis=1, initial=np.inf)
    return velocity.max(), acceleration.max(), jerk[gap > 1e-12].max(initial=0.0)


def direction(rng, n):
    x = rng.normal(size=n)
    return x / np.linalg.norm(x)


def random_path(rng, n_axes, n_pieces):
    """Lines, arcs and helices; three joints in four are tangent."""
    point = rng.normal(size=n_axes) * 0.05
    tangent = direction(rng, n_axes)
    rows = []
    for _ in range(n_pieces):
        kind = rng.integers(4) if n_axes > 1 else 0
        length = 10 ** rng.uniform(-4.5, -1.0)
        if rng.random() < 0.25:
            tangent = direction(rng, n_axes)
        elif rng.random() < 0.2:
            tangent = tangent + rng.normal(size=n_axes) * 10 ** rng.uniform(-6, -2)
            tangent /= np.linalg.norm(tangent)
        zero = np.zeros(n_axes)
        if kind == 0 or n_axes == 1:
            u, v, w, rate = tangent, zero, zero, 0.0
        else:
            side = direction(rng, n_axes)
            side -= tangent * (tangent @ side)
            side /= np.linalg.norm(side)
            rate = rng.uniform(0.05, 2 * np.pi) / length
            w = zero
            u, v = tangent, side
            if kind == 3 and n_axes > 2:
                axis = direction(rng, n_axes)
                axis -= side * (side @ axis)
                axis /= np.linalg.norm(axis)
                w = axis * (tangent @ axis)
                u = tangent - w
                v = side * np.linalg.norm(u)
        rows.append((point, u, v, w, rate, length))
        angle = rate * length
        size = np.sin(angle) / rate if rate else length
        rise = (1 - np.cos(angle)) / rate if rate else 0.0
        point = point + u * size + v * rise + w * length
        tangent = u * np.cos(angle) + v * np.sin(angle) + w
    return Path.from_helical(*(np.array(x) for x in zip(*rows, strict=True)))


def random_limits(rng, n_axes):
    def some(low, high):
        return 10 ** (rng.uniform(low, high) + rng.uniform(-0.4, 0.4, n_axes))

    return AxisLimits(velocity=some(-1.5, 0.5), acceleration=some(-0.5, 1.5), jerk=some(0.5, 4.0))


def check_motion(path, limits, feed, rng, dt=1e-3, corner=CORNER_ANGLE):
    limits = limits.for_axes(path.n_axes)
    table = ArcLength(path)
    program = program_of(path, feed=feed, rapid_feed=None)
    first = plan_motion(segments_of(path, table), program, limits, dt, corner)
    check_profile(first, path, limits, feed, rng)
    motion = refine(first, path, table, limits, dt)
    assert motion.profile.duration <= first.profile.duration * (1 + 1e-12)
    if motion is not first:
        check_profile(motion, path, limits, feed, rng)
    return motion


def check_profile(motion, path, limits, feed, rng):
    profile = motion.profile
    assert np.isfinite(profile.time).all()
    v, a, j = worst(profile, lambda s: helical_rows(path, s), limits, rng, path.breaks)
    assert v <= 1 + ROUNDING, f"velocity at {v}"
    assert a <= 1 + ROUNDING, f"acceleration at {a}"
    assert j <= 1 + ROUNDING, f"jerk at {j}"
    t = np.sort(instants(profile, rng))
    s, speed, *_ = profile.at(t)
    assert (np.diff(s) >= -1e-15).all()
    assert s[0] == 0.0
    assert s[-1] == motion.stops[-1]
    assert speed[0] == 0.0
    assert speed[-1] == 0.0
    k = np.clip(np.searchsorted(np.asarray(path.breaks), s, side="right") - 1, 0, path.n_pieces - 1)
    allowed = np.broadcast_to(feed, (path.n_pieces,))
    at_joint = np.isin(s, np.asarray(path.breaks))
    assert (speed <= allowed[k] * (1 + 1e-9))[~at_joint].all()
    # each corner is stopped at, exactly
    stop_time = motion.arrives
    assert_stops = profile.at(stop_time)
    assert np.array_equal(assert_stops[0], motion.stops[1:])
    assert np.array_equal(assert_stops[1], np.zeros(len(stop_time)))


def run_random(seed):
    rng = np.random.default_rng(seed)
    n_axes = int(rng.choice([1, 2, 2, 3, 3, 7]))
    path = random_path(rng, n_axes, int(rng.integers(1, 12)))
    limits = random_limits(rng, n_axes)
    feed = 10 ** rng.uniform(-2.5, 0.5)
    if rng.random() < 0.5:
        feed = feed * 10 ** rng.uniform(-0.5, 0.5, path.n_pieces)
    return check_motion(path, limits, feed, rng)


@pytest.mark.parametrize("block", range(3))
def test_random_paths(block):
    for seed in range(20 * block, 20 * block + 20):
        run_random(seed)


def test_the_largest_speed_lies_beside_the_end_of_an_interval():
    """A short arc on which the feed alone binds: 6e-6 over it before both sides were watched."""
    run_random(1360)


@pytest.mark.slow
@pytest.mark.parametrize("block", [0, pytest.param(1, marks=pytest.mark.overnight)])
def test_many_random_paths(block):
    for seed in range(1000 + 40 * block, 1040 + 40 * block):
        run_random(seed)


@pytest.mark.slow
@pytest.mark.overnight
@pytest.mark.parametrize("block", range(100))
def test_ten_thousand_random_paths(block):
    for seed in range(10_000 + 100 * block, 10_100 + 100 * block):
        run_random(seed)


@pytest.mark.slow
@pytest.mark.overnight
@pytest.mark.parametrize("block", [*range(3, 6), *range(54, 66)])
def test_more_random_paths(block):
    for seed in range(20 * block, 20 * block + 20):
        run_random(seed)


@pytest.mark.parametrize("feed", [0.01, 0.05, 0.3])
@pytest.mark.parametrize("corner", [0.0, 0.01, 0.1])
def test_polylines_of_tiny_segments(feed, corner):
    rng = np.random.default_rng(int(1e3 * feed))
    angle = np.cumsum(np.abs(rng.normal(size=400)) * 10 ** rng.uniform(-4, -1, 400))
    step = 10 ** rng.uniform(-6, -3.5, 400)
    points = np.cumsum(np.stack([step * np.cos(angle), step * np.sin(angle)], axis=1), axis=0)
    path = Path.polyline(points)
    limits = AxisLimits(velocity=[0.2, 0.3], acceleration=[3.0, 8.0], jerk=[80.0, 300.0])
    motion = check_motion(path, limits, feed, rng, corner=corner)
    turn = np.abs(np.diff(angle[1:]))
    joints = np.asarray(path.breaks)[1:-1]
    wanted = joints[turn > corner * (1 + 1e-9) + 1e-12]
    assert set(wanted) <= set(motion.stops)
    # passed joints: no axis velocity jumps by more than one sample of its acceleration limit
    passed = ~np.isin(joints, motion.stops)
    speed = motion.profile.at(motion.profile.time_at(joints[passed]))[1]
    tangent = np.diff(points, axis=0) / np.linalg.norm(np.diff(points, axis=0), axis=1)[:, None]
    jump = np.abs(np.diff(tangent, axis=0))[passed] * speed[:, None]
    assert (jump <= np.array([3.0, 8.0]) * 1e-3 * (1 + 1e-9)).all()


def spiral(n_arcs=999, first=0.002, growth=2e-5, angle=np.pi / 6):
    """Tangent arcs of growing radius."""
    point, heading, rows = np.zeros(2), 0.0, []
    for k in range(n_arcs):
        radius = first + growth * k
        u = np.array([np.cos(heading), np.sin(heading)])
        v = np.array([-u[1], u[0]])
        rows.append((point, u, v, np.zeros(2), 1 / radius, radius * angle))
        point = point + radius * (u * np.sin(angle) + v * (1 - np.cos(angle)))
        heading += angle
    return Path.from_helical(*(np.array(x) for x in zip(*rows, strict=True)))


@pytest.mark.parametrize("feed", [0.02, 0.3])
def test_spiral_of_tangent_arcs_does_not_stop(feed):
    limits = AxisLimits(velocity=0.5, acceleration=5.0, jerk=100.0)
    motion = check_motion(spiral(), limits, feed, np.random.default_rng(0))
    assert len(motion.arrives) == 1


class _EllipseRows:
    """Derivatives over arc length of an ellipse, by formulas of its own, over a fine table."""

    def __init__(self, a, b):
        self.a, self.b = a, b

    def at(self, theta):
        a, b, c, s = self.a, self.b, np.cos(theta), np.sin(theta)
        g = np.hypot(a * s, b * c)
        k = a * b / g**3
        dk = -3 * a * b / g**5 * (a * a - b * b) * s * c / g
        t = np.stack([-a * s, b * c], axis=1) / g[:, None]
        n = np.stack([-t[:, 1], t[:, 0]], axis=1)
        return t, k[:, None] * n, dk[:, None] * n - (k**2)[:, None] * t


ELLIPSES = [((0.03, 0.01), 0.4), ((0.03, 0.01), 0.05), ((0.002, 0.03), 0.2), ((0.02, 0.02), 0.5)]


@pytest.mark.parametrize(("semi_axes", "feed"), ELLIPSES)
def test_ellipse_as_formula(semi_axes, feed):
    limits = AxisLimits(velocity=[0.3, 0.5], acceleration=[5.0, 3.0], jerk=[100.0, 250.0])
    ellipse = Ellipse(semi_axes=semi_axes)
    plan = plan_feed(ellipse, limits=limits, sample_time=1e-3, feed=feed)
    table, own = ArcLength(ellipse), _EllipseRows(*semi_axes)
    v, a, j = worst(
        plan.profile, lambda s: own.at(table.parameter_at(s)), limits, np.random.default_rng(1)
    )
    assert max(v, a, j) <= 1 + ROUNDING
    assert max(v, a, j) > 0.5
    reference = plan.reference
    assert (np.diff(reference.parameter) >= 0).all()
    assert reference.parameter[-1] == 2 * np.pi
    assert_differences(reference)


def test_splines_in_a_path():
    rng = np.random.default_rng(5)
    points = np.cumsum(rng.normal(size=(13, 2)), axis=0) * 0.01
    curves = np.stack([points[3 * k : 3 * k + 4] for k in range(4)])
    for k in range(1, 4):
        curves[k, 1] = 2 * curves[k, 0] - curves[k - 1, 2]
    path = Path.from_bezier(curves)
    limits = AxisLimits(velocity=0.3, acceleration=4.0, jerk=150.0)
    plan = plan_feed(path, limits=limits, sample_time=1e-3, feed=0.1)
    assert len(plan.stop_times) == 1
    t = np.linspace(0, plan.profile.duration, 20 * plan.reference.n_samples)
    s, v, a, j = plan.profile.at(t)
    r = arc_derivatives(contour_derivatives(path, s))
    v, a, j = v[:, None], a[:, None], j[:, None]
    assert np.abs(r[:, 0] * v).max() <= 0.3 * (1 + ROUNDING)
    assert np.abs(r[:, 0] * a + r[:, 1] * v**2).max() <= 4.0 * (1 + ROUNDING)
    assert np.abs(r[:, 0] * j + 3 * r[:, 1] * v * a + r[:, 2] * v**3).max() <= 150 * (1 + ROUNDING)


def assert_differences(reference):
    """The records are derivatives of one another: central differences, away from nothing here."""
    dt = float(reference.sample_time)
    pairs = [(reference.position, reference.velocity), (reference.velocity, reference.acceleration)]
    for value, slope in pairs:
        central = (value[2:] - value[:-2]) / (2 * dt)
        # a jump of jerk J within two samples moves a central difference by up to J dt / 2 here
        allowed = dt * np.abs(np.diff(slope, axis=0)).max() / dt
        assert np.abs(central - slope[1:-1]).max() <= allowed
