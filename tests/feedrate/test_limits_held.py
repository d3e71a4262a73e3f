"""No limit is ever exceeded, between samples too: random paths and limits, judged independently."""

from __future__ import annotations

import jax
import numpy as np
import pytest

jax.config.update("jax_enable_x64", True)

from contourlab.contours.ellipse import Ellipse  # noqa: E402
from contourlab.contours.path import Path  # noqa: E402
from contourlab.feedrate import AxisLimits, plan_feed  # noqa: E402
from contourlab.feedrate.arc_length import ArcLength  # noqa: E402
from contourlab.feedrate.motion import plan_motion  # noqa: E402
from contourlab.feedrate.plan import CORNER_ANGLE  # noqa: E402
from contourlab.feedrate.program import program_of  # noqa: E402
from contourlab.feedrate.segments import segments_of  # noqa: E402

ROUNDING = 1e-7  # positions of 1 m and windows of 1e-4 s leave 1e-16 / 1e-8 of an acceleration


def helical_rows(path, s):
    """Derivatives 1 to 3 of a helical path over arc length, from the formula of its docstring."""
    breaks = np.asarray(path.breaks)
    k = np.clip(np.searchsorted(breaks, s, side="right") - 1, 0, path.n_pieces - 1)
    rate = np.asarray(path.angle_rate)[k][:, None]
    angle = rate * (s - breaks[k])[:, None]
    u, v, w = (np.asarray(x)[k] for x in (path.tangent_vector, path.normal_vector, path.axial_vector))
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
    segments = segments_of(path, ArcLength(path))
    program = program_of(path, feed=feed, rapid_feed=None)
    motion = plan_motion(segments, program, limits, dt, corner)
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
    return motion


def run_random(seed):
    rng = np.random.default_rng(seed)
    n_axes = int(rng.choice([1, 2, 2, 3, 3, 7]))
    path = random_path(rng, n_axes, int(rng.integers(1, 12)))
    limits = random_limits(rng, n_axes)
    feed = 10 ** rng.uniform(-2.5, 0.5)
    if rng.random() < 0.5:
        feed = feed * 10 ** rng.uniform(-0.5, 0.5, path.n_pieces)
    return check_motion(path, limits, feed, rng)


@pytest.mark.parametrize("block", range(10))
def test_random_paths(block):
    for seed in range(30 * block, 30 * block + 30):
        run_random(seed)
