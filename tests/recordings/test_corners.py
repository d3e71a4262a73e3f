"""Corners on constructed motions, whose overshoot, undershoot and time are known in closed form."""

import math

import numpy as np
import pytest
import xarray as xr

from contourlab.contours import Circle, Path
from contourlab.contours.foot_points import foot_point
from contourlab.errors import RecordingError
from contourlab.recordings import Recording, find_corners, measure_corners, summarise_corners

LEG, DT = 10e-3, 1e-4
EXACT = 1e-9
"""Foot points are found to rounding; a nanometre is far below what any of these motions shows."""


def cornered(angle, leg=LEG, line=(7, 8)):
    """Return a path along x that turns left by an angle."""
    end = [leg + leg * math.cos(angle), leg * math.sin(angle)]
    return Path.polyline([[0.0, 0.0], [leg, 0.0], end], list(line))


def along(points, n=4001):
    """Return samples evenly spaced along a polyline."""
    points = np.asarray(points, float)
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    s = np.unique(np.concatenate([np.linspace(0.0, at[-1], n), at]))
    return np.stack([np.interp(s, at, column) for column in points.T], axis=1)


def record(path, tool, near=None, dt=DT, **attrs):
    """Return the recording of a tool that moves through points, one a sample."""
    tool = np.asarray(tool, float)
    if near is None:
        near = np.linspace(0.0, float(path.domain[1]), len(tool))
    feet = foot_point(path, tool, near=near)
    size = np.linalg.norm(feet.vector, axis=1)
    data = {
        "tool": (("time", "coordinate"), tool),
        "contour_error_vector": (("time", "coordinate"), np.asarray(feet.vector)),
        "contour_error": (("time",), size),
        "foot_parameter": (("time",), np.asarray(feet.parameter)),
        "reference_parameter": (("time",), near),
    }
    time = ("time", dt * np.arange(len(tool)))
    return Recording(xr.Dataset(data, coords={"time": time}, attrs=attrs))


def only(path, tool, radius=2e-3, **more):
    passes = measure_corners(record(path, tool, **more), find_corners(path, radius=radius))
    assert len(passes) == 1
    return passes[0]


def test_the_corner_itself():
    (corner,) = find_corners(cornered(math.radians(60)), radius=1e-3)
    assert corner.parameter == pytest.approx(LEG)
    np.testing.assert_allclose(corner.position, [LEG, 0.0], atol=1e-15)
    np.testing.assert_allclose(corner.incoming, [1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(corner.outgoing, [0.5, math.sqrt(0.75)], atol=1e-12)
    assert math.degrees(corner.angle) == pytest.approx(60.0)
    assert (corner.line_before, corner.line_after) == (7, 8)
    assert corner.radius == 1e-3


@pytest.mark.parametrize("degrees", [20, 60, 90, 120, 160])
def test_on_the_path_there_is_neither(degrees):
    path = cornered(math.radians(degrees))
    points = [np.asarray(path.position(s)) for s in (0.0, LEG, 2 * LEG)]
    n = 4001
    found = only(path, along(points, n))
    assert found.overshoot < EXACT
    assert found.undershoot < EXACT
    assert found.error_max < EXACT
    # 4 mm of 20 mm in 4000 steps
    assert found.time == pytest.approx(0.2 * (n - 1) * DT, abs=DT)


@pytest.mark.parametrize("degrees", [45, 90, 135])
def test_a_quarter_circle_cut_at_the_corner(degrees):
    # a fillet of radius ρ tangent to both legs stands ρ (1/cos(θ/2) - 1) from the corner, and
    # its middle, which is farthest from the legs, ρ (1 - cos(θ/2))
    angle, rho = math.radians(degrees), 0.2e-3
    path = cornered(angle)
    cut = rho * math.tan(angle / 2)
    turn = np.linspace(0.0, angle, 801)
    fillet = np.stack([LEG - cut + rho * np.sin(turn), rho - rho * np.cos(turn)], axis=1)
    tool = np.concatenate([
        along([[0.0, 0.0], [LEG - cut, 0.0]], 800), fillet[1:],
        along([fillet[-1], np.asarray(path.position(2 * LEG))], 800)[1:],
    ])  # fmt: skip
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tool, axis=0), axis=1))])
    found = only(path, tool, near=s * 2 * LEG / s[-1])
    assert found.overshoot < EXACT
    # samples 0.2 µm apart on the arc: chords of 2e-11 m
    assert found.undershoot == pytest.approx(rho * (1 / math.cos(angle / 2) - 1), rel=1e-4)
    assert found.error_max == pytest.approx(rho * (1 - math.cos(angle / 2)), rel=1e-4)


@pytest.mark.parametrize(
    ("degrees", "expected"), [(30, 0.5), (90, 1.0), (135, 1.0)], ids=["30", "90", "135"]
)
def test_a_tool_that_runs_past_the_corner(degrees, expected):
    # past the leg by a sin θ where the path turns by less than a right angle, else by a
    past, path = 50e-6, cornered(math.radians(degrees))
    leaving = np.asarray(path.position(LEG + 1e-3))
    tool = along(
        [[0.0, 0.0], [LEG + past, 0.0], leaving, np.asarray(path.position(2 * LEG))], 20001
    )
    found = only(path, tool)
    assert found.overshoot == pytest.approx(past * expected, rel=1e-6)
    assert found.undershoot < EXACT


def test_between_samples_the_tool_turns_smoothly():
    # constant acceleration across the corner's bisector: the path is a parabola whose vertex, 8 µm
    # inside, falls between two samples 1 ms apart; their chord is another 1.25 µm further in
    path, a, vertex, dt = cornered(math.pi / 2), 10.0, 8e-6, 1e-3
    time = (np.arange(-20, 20) + 0.5) * dt
    inwards, across = np.array([-1.0, 1.0]) / math.sqrt(2), np.array([1.0, 1.0]) / math.sqrt(2)
    tool = (
        np.array([LEG, 0.0])
        + np.outer(vertex + 0.5 * a * time**2, inwards)
        + np.outer(0.02 * time, across)
    )
    found = only(path, tool, near=LEG + 0.02 * time, dt=dt)
    assert found.undershoot == pytest.approx(vertex, rel=1e-3)


def test_there_and_back():
    path = Path.polyline([[0.0, 0.0], [LEG, 0.0], [0.0, 0.0]], [1, 2])
    n = 20_000
    near = np.concatenate([np.linspace(0.0, LEG, n), np.linspace(LEG, 2 * LEG, n)])
    for reach, overshoot, undershoot in ((30e-6, 30e-6, 0.0), (-30e-6, 0.0, 30e-6)):
        there = np.linspace(0.0, LEG + reach, n)
        x = np.concatenate([there, there[::-1]])
        found = only(path, np.stack([x, 0 * x], axis=1), near=near)
        assert found.overshoot == pytest.approx(overshoot, abs=EXACT)
        # the cubic goes past a turn as sharp as this by up to 4/27 of a step
        assert found.undershoot == pytest.approx(undershoot, abs=0.15 * LEG / n)


def test_curved_legs_are_no_overshoot():
    # a line into an arc of 5 mm radius at a right angle: within 2 mm the arc leaves its tangent
    # by 0.4 mm, and a tool on the path must still show nothing
    angle, radius = 1.2, 5e-3
    path = Path.from_helical(
        [[0.0, 0.0], [LEG, 0.0]], [[1.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [1.0, 0.0]],
        np.zeros((2, 2)), [0.0, 1 / radius], [LEG, radius * angle], [1, 2],
    )  # fmt: skip
    near = np.union1d(np.linspace(0.0, float(path.domain[1]), 300), LEG)
    tool = np.stack([np.asarray(path.position(s)) for s in near])
    found = only(path, tool, near=near)
    assert max(found.overshoot, found.undershoot, found.error_max) < EXACT


def test_waiting_counts_and_lag_does_not():
    path = cornered(math.pi / 2)
    points = [[0.0, 0.0], [LEG, 0.0], [LEG, LEG]]
    tool = along(points, 4001)
    at = int(np.argmin(np.linalg.norm(tool - [LEG, 0.0], axis=1)))
    waits = np.concatenate([tool[:at], np.repeat(tool[at : at + 1], 500, axis=0), tool[at:]])
    foot = np.linspace(0.0, 2 * LEG, len(tool))
    near = np.concatenate([foot[:at], np.full(500, LEG), foot[at:]])
    assert only(path, waits, near=near).time - only(path, tool).time == pytest.approx(
        500 * DT, abs=2 * DT
    )
    # a tool that lags 1.5 mm: the stretch is where the tool is, not its reference
    late = record(path, tool, near=foot)
    late.dataset["reference_parameter"] = ("time", np.minimum(foot + 1.5e-3, 2 * LEG))
    (found,) = measure_corners(late, find_corners(path, radius=2e-3))
    assert found.time == pytest.approx(only(path, tool).time, abs=DT)
    assert found.overshoot < EXACT


def test_what_happens_beyond_the_radius_is_not_counted():
    path = cornered(math.pi / 2)
    tool = along([[0.0, 0.0], [LEG, 0.0], [LEG, LEG]], 4001)
    tool[(tool[:, 1] > 4e-3) & (tool[:, 1] < 6e-3), 0] += 80e-6  # a bump far down the leg
    assert only(path, tool, radius=2e-3).overshoot < EXACT
    assert only(path, tool, radius=5e-3).overshoot == pytest.approx(80e-6)


@pytest.mark.parametrize("turned", [0.0, 1.0, 2.5], ids=["0", "1", "2.5"])
def test_turning_the_part_changes_nothing(turned):
    c, s = math.cos(turned), math.sin(turned)
    spin = np.array([[c, -s], [s, c]])
    tilt = np.array([[1.0, 0.0], [0.0, 0.6], [0.0, 0.8]]) @ spin  # into space as well
    flat = [[0.0, 0.0], [LEG, 0.0], [LEG, LEG]]
    path = Path.polyline(np.asarray(flat) @ tilt.T)
    tool = along([[0, 0], [LEG - 40e-6, 0.0], [LEG + 30e-6, 60e-6], [LEG, 1e-3], [LEG, LEG]], 8001)
    here, there = only(Path.polyline(flat), tool), only(path, tool @ tilt.T)
    for name in ("overshoot", "undershoot", "time", "error_max"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-6, abs=EXACT), name
    assert here.overshoot > 20e-6
    assert here.undershoot > 20e-6


def test_laps_of_a_closed_path():
    square = np.array([[0.0, 0.0], [LEG, 0.0], [LEG, LEG], [0.0, LEG]])
    path = Path.polyline(square, closed=True)
    near = np.linspace(0.0, 2 * 4 * LEG - 1e-3, 8001)  # nearly two laps
    tool = np.stack([np.asarray(path.position(s)) for s in near[::20]])
    passes = measure_corners(
        record(path, tool, near=near[::20]), find_corners(path), period=4 * LEG
    )
    assert len(passes) == 7  # the seam once between the laps; the ends are no corners
    assert [round(p.corner.parameter / LEG) for p in passes] == [1, 2, 3, 4, 1, 2, 3]
    assert max(p.error_max for p in passes) < EXACT


def test_neighbours_share_the_path_between_them():
    path = Path.polyline([[0.0, 0.0], [LEG, 0.0], [LEG, 1e-3], [3 * LEG, 1e-3]])
    assert [c.radius for c in find_corners(path, radius=1e-3)] == pytest.approx([0.5e-3, 0.5e-3])
    assert find_corners(Circle(radius=LEG)) == ()
    smooth = Path.polyline([[0.0, 0.0], [LEG, 0.0], [2 * LEG, 1e-5]])
    assert find_corners(smooth) == ()


def test_a_summary_says_where_the_worst_is():
    path = Path.polyline(
        [[0.0, 0.0], [LEG, 0.0], [LEG, LEG], [2 * LEG, LEG], [2 * LEG, 2 * LEG]], [3, 4, 5, 6]
    )
    past = (10e-6, 40e-6, 20e-6)
    tool = along([
        [0, 0], [LEG + past[0], 0.0], [LEG, 2e-3], [LEG, LEG + past[1]], [LEG + 2e-3, LEG],
        [2 * LEG + past[2], LEG], [2 * LEG, LEG + 2e-3], [2 * LEG, 2 * LEG],
    ], 20001)  # fmt: skip
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tool, axis=0), axis=1))])
    recording = record(path, tool, near=s * 4 * LEG / s[-1])
    figures = summarise_corners(measure_corners(recording, find_corners(path)))
    assert figures["overshoot"].worst == pytest.approx(40e-6, rel=1e-6)
    assert figures["overshoot"].median == pytest.approx(20e-6, rel=1e-6)
    assert figures["overshoot"].line == 4
    assert summarise_corners(()) == {}


def test_a_diverged_run_has_no_figures_and_a_bad_radius_is_refused():
    path = cornered(1.0)
    tool = along([[0.0, 0.0], [LEG, 0.0]])
    assert measure_corners(record(path, tool, diverged_at=0.1), find_corners(path)) == ()
    for radius in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(RecordingError, match="radius must be"):
            find_corners(path, radius=radius)
    bare = record(path, tool)
    bare = Recording(bare.dataset.drop_vars("tool"))
    with pytest.raises(RecordingError, match="holds no 'tool'"):
        measure_corners(bare, find_corners(path))


def test_an_error_on_the_way_to_the_corner_is_no_overshoot():
    # 60 µm to the right of the leg that arrives, over well before the corner
    path = cornered(math.radians(45))
    tool = along([[0.0, 0.0], [LEG, 0.0], np.asarray(path.position(2 * LEG))], 8001)
    early = (tool[:, 0] > LEG - 1.5e-3) & (tool[:, 0] < LEG - 0.5e-3)
    tool[early, 1] -= 60e-6
    found = only(path, tool)
    assert found.error_max == pytest.approx(60e-6)
    assert found.overshoot < EXACT


def test_a_tool_that_goes_round_the_outside_rounds_nothing_off():
    path, out = cornered(math.pi / 2), 50e-6
    tool = along([[0.0, -out], [LEG + out, -out], [LEG + out, LEG]], 8001)
    found = only(path, tool)
    assert found.undershoot == 0.0
    assert found.overshoot == pytest.approx(out, rel=1e-6)
