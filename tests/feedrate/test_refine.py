"""The plan of least time: optimal where an optimum is known, and never slower than the first."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab.feedrate.refine as refining
from contourlab.contours import Circle, Ellipse, Path
from contourlab.errors import FeedError
from contourlab.feedrate import AxisLimits, binding_limits, plan_feed

EASY = AxisLimits(velocity=[1.0, 1.0], acceleration=[5.0, 5.0], jerk=[1e7, 1e7])


def turn(radius, angle, lead):
    """A line, a tangent arc and a line."""
    zero = [0.0, 0.0]
    end = np.array([lead + radius * np.sin(angle), radius * (1 - np.cos(angle))])
    out = np.array([np.cos(angle), np.sin(angle)])
    return Path.from_helical(
        [[0, 0], [lead, 0], end], [[1, 0], [1, 0], out], [zero, [0, 1], zero], [zero] * 3,
        [0, 1 / radius, 0], [lead, radius * angle, lead],
    )  # fmt: skip


def line_in_pieces(length, pieces):
    x = np.linspace(0.0, length, pieces + 1)
    return Path.polyline(np.stack([x, np.zeros_like(x)], axis=1))


def least_time_on_a_line(length, velocity, acceleration, jerk):
    """Rest to rest with limited jerk, when the acceleration and the velocity limit are reached."""
    assert velocity >= acceleration**2 / jerk
    assert length >= velocity * (velocity / acceleration + acceleration / jerk)
    return length / velocity + velocity / acceleration + acceleration / jerk


def test_a_line_in_pieces_takes_the_least_time(monkeypatch):
    limits = AxisLimits(velocity=[0.4, 0.4], acceleration=[5.0, 5.0], jerk=[100.0, 100.0])
    path = line_in_pieces(0.3, 3)
    least = least_time_on_a_line(0.3, 0.4, 5.0, 100.0)
    assert_allclose(
        plan_feed(path, limits=limits, sample_time=1e-3, feed=1.0).cycle_time, least, rtol=1e-5
    )
    # solved all the same, the interior point method comes to the same end
    monkeypatch.setattr(refining, "_worth", lambda motion, limits: np.ones(1, bool))
    tried = []
    original = refining._fastest
    monkeypatch.setattr(refining, "_fastest", lambda *a: tried.append(original(*a)) or tried[-1])
    plan_feed(path, limits=limits, sample_time=1e-3, feed=1.0)
    solved = tried[-1][1][0].duration.sum()
    assert least * (1 - 1e-9) <= solved <= 1.012 * least


def test_a_circle_without_jerk_limits_by_quadrature():
    """With A on both axes, rest to rest: a lower bound, and what a fine TOPP solution reaches."""
    radius, acceleration = 0.03, 5.0
    plan = plan_feed(Circle(radius=radius), limits=EASY, sample_time=1e-3, feed=5.0)
    # a discrete optimum by dynamic programming on a grid of squared speeds
    n = 4000
    angle = np.linspace(0.0, 2 * np.pi, n + 1)
    ds = 2 * np.pi * radius / n

    def most_gain(b, theta, sign):
        # |r'' b + r' a| <= A in x and y, with r' = (-sin, cos) and r'' = -(cos, sin)/R
        c, s = np.cos(theta), np.sin(theta)
        low, high = -np.inf, np.inf
        for first, second in ((-s, -c / radius), (c, -s / radius)):
            if abs(first) < 1e-12:
                continue
            ends = sorted(
                ((-acceleration - second * b) / first, (acceleration - second * b) / first)
            )
            low, high = max(low, ends[0]), min(high, ends[1])
        return high if sign > 0 else low

    cap = np.array([acceleration * radius / max(abs(np.cos(t)), abs(np.sin(t))) for t in angle])
    b = np.minimum(cap, 1.0)
    b[0] = b[-1] = 0.0
    for k in range(n):
        b[k + 1] = min(b[k + 1], b[k] + 2 * ds * max(most_gain(b[k], angle[k], 1), 0.0))
    for k in range(n, 0, -1):
        b[k - 1] = min(b[k - 1], b[k] - 2 * ds * min(most_gain(b[k], angle[k], -1), 0.0))
    least = np.sum(2 * ds / (np.sqrt(b[1:]) + np.sqrt(b[:-1])))
    assert 0.995 * least <= plan.cycle_time <= 1.03 * least


@pytest.mark.parametrize("jerk", [60.0, 300.0, 3000.0])
@pytest.mark.parametrize(
    "contour",
    [Ellipse(semi_axes=(0.03, 0.01)), turn(0.004, np.pi / 2, 0.05), turn(0.03, 3.0, 0.01)],
    ids=["ellipse", "tight turn", "wide turn"],
)
def test_never_slower_and_mostly_faster(contour, jerk):
    limits = AxisLimits(velocity=[0.5, 0.6], acceleration=[5.0, 4.0], jerk=[jerk, 1.5 * jerk])
    plan = partial(plan_feed, contour, limits=limits, sample_time=1e-3, feed=0.4)
    first, best = plan(fastest=False), plan()
    assert best.cycle_time < 0.99 * first.cycle_time
    assert_allclose(best.reference.position[-1], first.reference.position[-1], atol=1e-15)
    shares = binding_limits(best).shares()
    assert shares.get("none", 0.0) < 0.55  # the switching of the jerk takes an interval
    assert_allclose(sum(shares.values()), 1.0)


def test_more_jerk_is_never_slower():
    times = [
        plan_feed(
            Ellipse(semi_axes=(0.03, 0.01)), sample_time=1e-3, feed=1.0,
            limits=AxisLimits(velocity=[1.0, 1.0], acceleration=[5.0, 5.0], jerk=[jerk, jerk]),
        ).cycle_time
        for jerk in (30.0, 100.0, 300.0, 1000.0, 1e4, 1e6)
    ]  # fmt: skip
    # each is within about one percent of the least time
    assert (np.diff(times) < 1e-2 * np.array(times[1:])).all()


def test_a_program_that_is_too_long_keeps_its_first_plan_and_says_so(monkeypatch):
    monkeypatch.setattr(refining, "MOST_INTERVALS", 50)
    limits = AxisLimits(velocity=[0.5, 0.6], acceleration=[5.0, 4.0], jerk=[100.0, 100.0])
    path = turn(0.004, np.pi / 2, 0.05)
    plan = partial(plan_feed, path, limits=limits, sample_time=1e-3, feed=0.4)
    kept = plan()
    assert kept.cycle_time == plan(fastest=False).cycle_time
    assert any("keep their first, slower plan" in warning for warning in kept.warnings)


def test_rests_and_stops_are_kept():
    """Stretches that are planned anew between one that is not, with dwells."""
    from contourlab.contours import read_gcode_text

    part = read_gcode_text(
        "G21 G90 G61 F20000\nG4 P0.25\nG1 X50\nG3 X54 Y4 J4\nG1 Y54\nG4 P0.5\nG1 X0\n"
        "G2 X-10 Y54 I-5 J0\nG1 X-10 Y0\nM2\n",
        axes=("X", "Y"),
    )
    limits = AxisLimits(velocity=[0.5, 0.6], acceleration=[5.0, 4.0], jerk=[100.0, 100.0])
    plan = plan_feed(part, limits=limits, sample_time=1e-3)
    first = plan_feed(part, limits=limits, sample_time=1e-3, fastest=False)
    assert plan.cycle_time < first.cycle_time
    profile = plan.profile
    arc, speed, *_ = profile.at(plan.stop_times)
    assert_allclose(arc, first.profile.at(first.stop_times)[0], atol=1e-15)
    assert (speed == 0.0).all()
    assert_allclose(profile.at(np.array([0.0, 0.2, 0.25]))[0], 0.0)
    rest = plan.stop_times[0] + np.array([0.0, 0.2, 0.4999])
    assert len(set(profile.at(rest)[0].tolist())) == 1
    # between the samples one thing is the derivative of the other
    t = np.linspace(0.3, plan.cycle_time - 0.01, 4001)
    h = 1e-6
    s, v, a, j = profile.at(t)
    ahead, behind = profile.at(t + h), profile.at(t - h)
    away = np.abs(t[:, None] - profile.time[None, :]).min(axis=1) > 2 * h
    for k, slope in enumerate((v, a)):
        central = (ahead[k] - behind[k]) / (2 * h)
        assert_allclose(central[away], slope[away], atol=3e-5 * np.abs(slope).max())
    assert np.isfinite(j).all()
    assert (np.diff(s) >= -1e-16).all()
    # and instants are found again
    places = np.linspace(1e-4, s.max(), 50)
    assert_allclose(profile.at(profile.time_at(places))[0], places, atol=1e-12)


@pytest.mark.parametrize("fastest", [False, True])
def test_another_unit_of_time_gives_the_same_plan(fastest):
    """Ten times the speed is a hundred times the acceleration and a thousand times the jerk."""
    ellipse = Ellipse(semi_axes=(0.03, 0.01))
    slow = AxisLimits(velocity=[0.5] * 2, acceleration=[5.0] * 2, jerk=[1e-3] * 2)
    fast = AxisLimits(velocity=[5.0] * 2, acceleration=[500.0] * 2, jerk=[1.0] * 2)
    plan = partial(plan_feed, ellipse, fastest=fastest)
    long = plan(limits=slow, feed=0.2, sample_time=1e-3).cycle_time
    short = plan(limits=fast, feed=2.0, sample_time=1e-4).cycle_time
    assert_allclose(long, 10.0 * short, rtol=1e-6)
    if fastest:
        assert long < 0.5 * plan(limits=slow, feed=0.2, sample_time=1e-3, fastest=False).cycle_time


def test_a_motion_that_takes_for_ever_is_refused_in_words():
    limits = AxisLimits(velocity=[0.5] * 2, acceleration=[5.0] * 2, jerk=[100.0] * 2)
    flat = Ellipse(semi_axes=(3e-2, 1e-7))
    with pytest.raises(FeedError, match="samples"):
        plan_feed(flat, limits=limits, sample_time=1e-3, feed=0.2)


def test_stretches_that_cannot_be_solved_are_said(monkeypatch):
    monkeypatch.setattr(refining.Stretch, "moves_on", lambda self: False)
    limits = AxisLimits(velocity=[0.5, 0.6], acceleration=[5.0, 4.0], jerk=[100.0, 100.0])
    plan = plan_feed(turn(0.004, np.pi / 2, 0.05), limits=limits, sample_time=1e-3, feed=0.4)
    assert any(text.startswith("1 stretches between stops keep") for text in plan.warnings)
