"""The programmed feed: closed forms, stops, dwells, parts, warnings and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.circle import Circle
from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.errors import FeedError
from contourlab.feedrate import AxisLimits, plan_feed, programmed_feed

LIMITS = AxisLimits(velocity=0.5, acceleration=5.0, jerk=100.0)


TRACKS = [(0.1, 0.005, 0.2), (0.02, 0.002, 0.1), (0.01, 0.001, 0.05), (0.1, 0.02, 0.2)]


def optimum(length, feed, acceleration, jerk):
    """Time of the fastest rest-to-rest motion on a line with limited jerk: seven phases."""

    def rising(v):
        return (
            v / acceleration + acceleration / jerk
            if v >= acceleration**2 / jerk
            else 2 * np.sqrt(v / jerk)
        )

    low, high = 0.0, feed
    if high * rising(high) > length:
        for _ in range(200):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if middle * rising(middle) <= length else (low, middle)
    else:
        low = feed
    return 2 * rising(low) + (length - low * rising(low)) / low


@pytest.mark.parametrize("length", [1e-6, 1e-3, 0.01, 0.05, 0.1, 0.3, 2.0])
@pytest.mark.parametrize("feed", [0.01, 0.1, 0.4])
def test_a_line_takes_the_optimal_time(length, feed):
    plan = plan_feed(
        Path.polyline([[0.0, 0.0], [length, 0.0]]), limits=LIMITS, sample_time=1e-3, feed=feed
    )
    assert_allclose(plan.cycle_time, optimum(length, feed, 5.0, 100.0), rtol=1e-6)
    assert plan.warnings == ()
    assert plan.reference.parameter[-1] == length


def test_a_long_line_in_numbers():
    # 0.4 m/s within 0.4/5 + 5/100 = 0.13 s, over 0.026 m each; 0.248 m at speed: 0.88 s
    reference = programmed_feed(
        Path.polyline([[0.0], [0.3]]), limits=LIMITS, sample_time=1e-3, feed=0.4
    )
    assert reference.n_samples == 881
    assert_allclose(np.abs(reference.velocity).max(), 0.4, rtol=1e-12)
    assert_allclose(np.abs(reference.acceleration).max(), 5.0, rtol=1e-6)
    assert_allclose(np.abs(reference.jerk).max(), 100.0, rtol=1e-6)
    assert_allclose(reference.position[130, 0], 0.026, rtol=1e-6)
    assert_allclose(reference.position[50, 0], 100.0 * 0.05**3 / 6, rtol=1e-6)
    assert_allclose(reference.acceleration[50, 0], 5.0, rtol=1e-6)


def test_a_diagonal_uses_both_axes():
    line = Path.polyline([[0.0, 0.0], [0.3, 0.4]])
    limits = AxisLimits(velocity=[0.06, 1.0], acceleration=[5.0, 4.0], jerk=[1e4, 80.0])
    plan = plan_feed(line, limits=limits, sample_time=1e-3, feed=1.0)
    # along the line: x allows 0.1 m/s, y 5 m/s² and 100 m/s³
    assert_allclose(plan.cycle_time, optimum(0.5, 0.1, 5.0, 100.0), rtol=1e-6)
    assert "below the programmed one on 500 mm (100 %)" in plan.warnings[0]


def test_many_turns_keep_one_speed():
    radius, turns = 0.002, 20
    path = Path.from_helical(
        [[0, 0]], [[1, 0]], [[0, 1]], [[0, 0]], [1 / radius], [turns * 2 * np.pi * radius]
    )
    reference = programmed_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.3, fastest=False)
    speed = np.linalg.norm(reference.velocity, axis=1)
    # v² / R <= A and v³ / R² <= J, of which stated shares are taken
    bound = min(np.sqrt(0.95 * 5.0 * radius), (0.8 * 100.0 * radius**2) ** (1 / 3))
    assert_allclose(speed.max(), bound, rtol=1e-9)
    assert np.median(speed) > 0.999999 * speed.max()
    assert any("(100 %) of the path" in warning for warning in reference.warnings)


def test_circle_once_round():
    plan = plan_feed(Circle(radius=0.02), limits=LIMITS, sample_time=1e-3, feed=0.1)
    assert plan.stop_parameters == 2 * np.pi
    acceleration = np.linalg.norm(plan.reference.acceleration, axis=1)
    assert_allclose(np.median(acceleration), 0.1**2 / 0.02, rtol=1e-6)
    assert_allclose(plan.cycle_time, optimum(2 * np.pi * 0.02, 0.1, 5.0, 100.0), rtol=0.01)


def test_every_corner_is_stopped_at():
    square = Path.polyline([[0, 0], [0.01, 0], [0.01, 0.01], [0, 0.01]], closed=True)
    plan = plan_feed(square, limits=LIMITS, sample_time=1e-3, feed=0.1)
    each = optimum(0.01, 0.1, 5.0, 100.0)
    assert_allclose(plan.stop_times, each * np.arange(1, 5), rtol=1e-6)
    assert_allclose(plan.stop_parameters, 0.01 * np.arange(1, 5), rtol=1e-15)
    assert_allclose(plan.cycle_time, 4 * each, rtol=1e-6)
    for v in plan.profile.at(plan.stop_times)[1]:
        assert v == 0.0
    assert plan.reference.n_samples == int(np.ceil(plan.cycle_time / 1e-3)) + 1
    assert_allclose(plan.reference.position[-1], [0.0, 0.0], atol=1e-16)
    assert_allclose(plan.reference.velocity[-1], 0.0, atol=0)


@pytest.mark.parametrize(
    ("corner_angle", "stops"), [(0.0, 2), (0.0199, 2), (0.0201, 1), (np.pi, 1)]
)
def test_corner_angle(corner_angle, stops):
    path = Path.polyline([[0, 0], [0.1, 0], [0.1 + 0.1 * np.cos(0.02), 0.1 * np.sin(0.02)]])
    plan = plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.1, corner_angle=corner_angle)
    assert len(plan.stop_times) == stops
    assert any("turn by up to 0.02 rad" in warning for warning in plan.warnings) == (stops == 1)


def test_tangent_arc_is_passed_and_the_jump_is_said():
    # a line into a quarter of a circle of 20 mm at 0.1 m/s: a jump of 0.5 m/s²
    path = Path.from_helical(
        [[0, 0], [0.1, 0]], [[1, 0], [1, 0]], [[0, 0], [0, 1]], np.zeros((2, 2)), [0, 50.0],
        [0.1, 0.02 * np.pi / 2],
    )  # fmt: skip
    plan = plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.1)
    assert len(plan.stop_times) == 1
    (said,) = plan.warnings
    assert said.startswith("the curvature jumps at 1 joints")
    assert "up to 0.5 m/s^2 there (axis 1, at 100 mm)" in said
    before = plan.profile.time_at(np.array([0.1]))
    assert_allclose(plan.profile.at(before)[0], 0.1, rtol=1e-14)
    assert_allclose(plan.profile.at(before)[1], 0.1, rtol=1e-12)


def test_a_corner_into_an_arc_is_a_stop_and_no_jump():
    path = Path.from_helical(
        [[0, 0], [0.1, 0]], [[1, 0], [0, 1]], [[0, 0], [-1, 0]], np.zeros((2, 2)), [0, 50.0],
        [0.1, 0.02],
    )  # fmt: skip
    plan = plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.1)
    assert_allclose(plan.stop_parameters, [0.1, 0.12])
    assert plan.warnings == ()


def part(feed, rapid, dwell, before=0.0, warnings=()):
    path = Path.polyline([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.3, 0.0]])
    n = path.n_pieces
    return Part(
        path=path, axes=("X", "Y"), source="made.ngc", lines=("G0 X100", "G1 X200", "G1 X300"),
        source_line=np.arange(1, n + 1), feed=np.array(feed, float), rapid=np.array(rapid, bool),
        blend=np.full(n, np.nan), dwell=np.array(dwell, float), dwell_before=before,
        warnings=warnings,
    )  # fmt: skip


def test_a_part_with_rapids_feeds_and_dwells():
    made = part([np.nan, 0.05, 0.2], [True, False, False], [0.0, 0.25, 0.1], 0.5, ("as read",))
    plan = plan_feed(made, limits=LIMITS, sample_time=1e-3)
    profile = plan.profile
    assert_allclose(plan.stop_parameters, [0.2, 0.3])
    # at rest before, between and after
    assert_allclose(profile.at(np.array([0.0, 0.25, 0.5]))[0], 0.0, atol=0)
    assert profile.at(np.array([0.51]))[0] > 0
    during = plan.stop_times[0] + np.linspace(0.0, 0.25, 50, endpoint=False)
    assert_allclose(profile.at(during)[0], 0.2, rtol=0, atol=0)
    assert_allclose(profile.at(during)[1:], 0.0, atol=0)
    assert profile.at(during[-1:] + 0.02)[0] > 0.2
    assert_allclose(plan.cycle_time - plan.stop_times[1], 0.1, rtol=1e-12)
    t = np.linspace(0, plan.cycle_time, 5000)
    s, v, *_ = profile.at(t)
    assert 0.3 < v[s < 0.1].max() <= 0.5  # the rapid goes by the limits
    assert v[(s > 0.1) & (s < 0.2)].max() <= 0.05 * (1 + 1e-9)
    assert_allclose(v[s > 0.2].max(), 0.2, rtol=1e-9)
    assert plan.reference.warnings[0] == "as read"
    assert plan.reference.duration >= plan.cycle_time - 1e-12


def test_rapid_feed_and_replaced_feed():
    made = part([np.nan, 0.05, 0.2], [True, False, False], [0.0, 0.0, 0.0])
    plan = plan_feed(made, limits=LIMITS, sample_time=1e-3, rapid_feed="6000 mm/min", feed=0.02)
    s, v, *_ = plan.profile.at(np.linspace(0, plan.cycle_time, 5000))
    assert_allclose(v[s < 0.1].max(), 0.1, rtol=1e-9)
    assert_allclose(v[s > 0.1001].max(), 0.02, rtol=1e-9)
    assert plan.warnings == ()


def test_feed_per_piece():
    path = Path.polyline([[0.0], [0.1], [0.2]])
    plan = plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=[0.05, 0.1])
    s, v, *_ = plan.profile.at(np.linspace(0, plan.cycle_time, 5000))
    assert_allclose(v[s <= 0.1].max(), 0.05, rtol=1e-9)
    assert_allclose(v.max(), 0.1, rtol=1e-9)


@pytest.mark.parametrize(("length", "radius", "feed"), TRACKS)
def test_the_price_of_curves_stays_small(length, radius, feed):
    # line, half circle, line, against S-curves on the lines and all the limits on the arc
    path = Path.from_helical(
        [[0, 0], [length, 0], [length, 2 * radius]], [[1, 0], [1, 0], [-1, 0]],
        [[0, 0], [0, 1], [0, 0]], np.zeros((3, 2)), [0, 1 / radius, 0],
        [length, np.pi * radius, length],
    )  # fmt: skip
    plan = plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=feed)
    slow = min(feed, np.sqrt(5.0 * radius), (100.0 * radius**2) ** (1 / 3))

    def change(dv):
        return dv / 5.0 + 5.0 / 100.0 if dv >= 5.0**2 / 100.0 else 2 * np.sqrt(dv / 100.0)

    def way(top):
        return 0.5 * top * change(top) + 0.5 * (top + slow) * change(top - slow)

    tops = np.linspace(slow, feed, 2001)
    top = max(t for t in tops if way(t) <= length)
    line = change(top) + change(top - slow) + (length - way(top)) / top
    best = 2 * line + np.pi * radius / slow
    assert plan.cycle_time < 1.05 * best


@pytest.mark.parametrize("n_axes", [1, 7])
def test_any_number_of_axes(n_axes):
    rng = np.random.default_rng(n_axes)
    path = Path.polyline(np.cumsum(rng.normal(size=(5, n_axes)), axis=0) * 0.01)
    plan = plan_feed(path, limits=LIMITS, sample_time=1e-3, feed=0.1)
    assert plan.reference.position.shape[1] == n_axes
    for value, limit in (("velocity", 0.5), ("acceleration", 5.0), ("jerk", 100.0)):
        assert np.abs(getattr(plan.reference, value)).max() <= limit * (1 + 1e-9)


LINE = Path.polyline([[0.0, 0.0], [0.1, 0.0]])
PART = part([np.nan, 0.05, 0.2], [True, False, False], [0.0, 0.0, 0.0])


@pytest.mark.parametrize(("contour", "keywords", "says"), [
    (LINE, {}, "feed is missing"),
    (LINE, {"feed": 0.0}, "feed must be > 0 m/s"),
    (LINE, {"feed": -0.1}, "feed must be > 0 m/s and finite, got -0.1"),
    (LINE, {"feed": np.nan}, "feed must be > 0"),
    (LINE, {"feed": [0.1, 0.2]}, "one for each of 1 pieces, got shape"),
    (LINE, {"feed": [-0.1]}, "feed of piece 0 must be > 0"),
    (LINE, {"feed": 0.1, "rapid_feed": 0.2}, "rapid_feed is for parts"),
    (LINE, {"feed": 0.1, "corner_angle": -1.0}, "corner_angle must be within 0 to pi"),
    (LINE, {"feed": 0.1, "corner_angle": np.nan}, "corner_angle must be within 0 to pi"),
    (LINE, {"feed": 0.1, "sample_time": 0.0}, "sample_time must be > 0 s"),
    (LINE, {"feed": 0.1, "limits": AxisLimits(velocity=[1, 1, 1], acceleration=1, jerk=1)},
     "velocity is given for 3 axes, the contour has 2"),
    (part([np.nan, 0.0, 0.2], [True, False, False], [0, 0, 0]), {}, "made.ngc:2: G1 X200: the"),
    (part([np.nan, np.nan, 0.2], [True, False, False], [0, 0, 0]), {}, "made.ngc:2"),
    (part([0.1, 0.1, 0.2], [False] * 3, [0, -1, 0]), {}, "the dwell after it must be >= 0 s"),
    (part([0.1, 0.1, 0.2], [False] * 3, [0, 0, 0], np.nan), {}, "the dwell before the first"),
    (PART, {"rapid_feed": 0.0}, "rapid_feed must be > 0"),
])  # fmt: skip
def test_refuses_with_the_reason(contour, keywords, says):
    with pytest.raises(FeedError, match=says):
        programmed_feed(contour, **{"limits": LIMITS, "sample_time": 1e-3, **keywords})


def test_many_stops_and_rounding_of_long_times():
    n = 3000
    zigzag = np.stack([np.arange(n) * 1e-4, (np.arange(n) % 2) * 1e-4], axis=1)
    plan = plan_feed(Path.polyline(zigzag), limits=LIMITS, sample_time=1e-3, feed=0.05)
    assert len(plan.stop_times) == n - 1
    each = optimum(np.sqrt(2) * 1e-4, 0.05, 5.0 * np.sqrt(2), 100.0 * np.sqrt(2))
    assert_allclose(np.diff(plan.stop_times), each, rtol=1e-6)
    assert_allclose(plan.reference.position[-1], zigzag[-1], atol=1e-12)


def test_no_limits_are_refused():
    with pytest.raises(FeedError, match="limits is missing: the machine has no axis limits"):
        plan_feed(Circle(radius=0.01), limits=None, sample_time=1e-3, feed=0.1)


def test_remarks_name_axes_and_lines(tmp_path):
    from contourlab.contours.gcode import read_gcode

    program = "G21 G90 F12000\nM3 S5\nN10 M8\nM8\nG1 X100\nG3 X110 Y10 I0 J10\nG1 Y50\nM2\n"
    (tmp_path / "p.ngc").write_text(program)
    limits = AxisLimits(velocity=np.ones(2), acceleration=np.full(2, 2.0), jerk=np.full(2, 50.0))
    read = read_gcode(tmp_path / "p.ngc", axes=("X", "Y"))
    plan = plan_feed(read, limits=limits, sample_time=1e-3, fastest=False)
    warnings = plan.reference.warnings
    assert warnings[0] == (
        "words that do not move the tool were ignored: M3 (line 2), S (line 2), "
        "M8 (line 3, 2 times)"
    )
    assert any("of the path, at 100 mm, line 6, to " in w for w in warnings)
    assert any("(axis Y, at 100 mm, line 6), within its limit" in w for w in warnings)
