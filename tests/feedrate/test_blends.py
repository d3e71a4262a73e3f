"""Corners under G64: never slower than stops, within the tolerance, within the limits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import foot_point, read_gcode_text
from contourlab.feedrate import AxisLimits, plan_feed
from contourlab.feedrate.arc_length import arc_derivatives, contour_derivatives

LIMITS = AxisLimits(velocity=[0.5, 0.5], acceleration=[5.0, 5.0], jerk=[200.0, 200.0])
MOVES = "F6000\nG1 X50\nY30\nX20\nG3 X10 Y20 I0 J-10\nG1 Y5\nX0 Y0\nM2\n"


def plan(mode, limits=LIMITS, moves=MOVES, **options):
    part = read_gcode_text(f"G21 G90 {mode}\n{moves}", axes=("X", "Y"))
    return plan_feed(part, limits=limits, sample_time=1e-3, **options), part


def test_a_wider_tolerance_is_never_slower():
    times = [plan(mode)[0].cycle_time for mode in ("G64 P0.01", "G64 P0.1", "G64 P0.5", "G64")]
    assert (np.diff(times) < 1e-2).all()
    # smoothing the two jumps of curvature keeps the jerk limit there, which costs milliseconds
    assert times[0] < plan("G61")[0].cycle_time + 0.02
    assert times[-1] < 0.93 * times[0]


@pytest.mark.parametrize("tolerance", [0.1, 0.5])
def test_the_tolerance_is_kept_and_reported(tolerance):
    planned, part = plan(f"G64 P{tolerance}")
    points = np.asarray(planned.reference.position)
    distance = np.linalg.norm(foot_point(part.path, points).position - points, axis=1)
    assert distance.max() <= 1e-3 * tolerance
    assert planned.blends.largest_deviation <= 1e-3 * tolerance
    said = [text for text in planned.reference.warnings if text.startswith("G64")]
    assert any(f"{1e6 * planned.blends.largest_deviation:.3g} um" in text for text in said)


def test_limits_hold_on_blends_jerk_too():
    planned, _ = plan("G64 P0.5")
    path = planned.part.path
    assert len(planned.stop_times) == 1
    assert planned.curvature_jumps == ()

    t = np.linspace(0.0, planned.cycle_time, 60_000)
    s, v, a, j = (x[:, None] for x in planned.profile.at(t))
    r = arc_derivatives(contour_derivatives(path, s[:, 0]))
    velocity = np.abs(r[:, 0] * v) / 0.5
    acceleration = np.abs(r[:, 1] * v**2 + r[:, 0] * a) / 5.0
    jerk = np.abs(r[:, 2] * v**3 + 3 * r[:, 1] * v * a + r[:, 0] * j) / 200.0
    for taken in (velocity, acceleration, jerk):
        assert taken.max() <= 1 + 1e-7
    assert jerk.max() > 0.9


def test_a_corner_whose_blend_does_not_pay_is_a_stop_and_said():
    planned, _ = plan("G64 P0.01")
    assert len(planned.stop_times) == 4
    assert any("3 corners are stopped at" in text for text in planned.warnings)
    stops = planned.profile.at(planned.stop_times)[1]
    assert (stops == 0.0).all()


def test_feed_overrides_and_rapids():
    moves = "G0 X5\nY5\nF3000\nG1 X20\nY20\nG0 X0\nY0\nM2\n"
    planned, part = plan("G64 P0.3", moves=moves)
    slow, _ = plan("G64 P0.3", moves=moves, feed="600 mm/min")
    assert slow.cycle_time > planned.cycle_time
    speed = np.linalg.norm(np.asarray(slow.reference.velocity), axis=1)
    piece = np.asarray(slow.part.rapid)[
        np.clip(
            np.searchsorted(np.asarray(slow.part.path.breaks), slow.reference.parameter, "right")
            - 1,
            0,
            slow.part.n_pieces - 1,
        )
    ]
    assert speed[~piece].max() <= 0.01 * (1 + 1e-9)
    assert speed[piece].max() > 0.05
    assert part.path.n_pieces < planned.part.path.n_pieces
    # between a rapid and a feed the tool stops
    path = planned.part.path
    stops = np.array([path.position(parameter) for parameter in planned.stop_parameters])
    for place in ([0.005, 0.005], [0.02, 0.02]):
        assert np.abs(stops - place).max(axis=1).min() < 1e-12
    assert_allclose(planned.reference.position[-1], [0.0, 0.0], atol=1e-12)


def test_a_program_that_merges_to_one_line():
    planned, _ = plan("G64 P0.1 Q0.05", moves="F600\nG1 X10\nX20\nM2\n")
    assert planned.part.path.n_pieces == 1
    assert_allclose(planned.reference.position[-1], [0.02, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    "seed",
    [
        *range(3),
        *(pytest.param(k, marks=[pytest.mark.slow, pytest.mark.overnight]) for k in range(3, 8)),
    ],
)
def test_limits_hold_on_random_programs_with_blends_and_splines(seed):
    rng = np.random.default_rng(seed)
    lines, place = ["F3000"], np.zeros(2)
    for _ in range(12):
        step = rng.uniform(-20, 20, 2)
        kind = rng.integers(4)
        x, y = place + step
        if kind == 0:
            lines.append(f"G0 X{x:.3f} Y{y:.3f}")
        elif kind == 1:
            i, j, p, q = rng.uniform(-8, 8, 4)
            lines.append(f"G5 X{x:.3f} Y{y:.3f} I{i:.3f} J{j:.3f} P{p:.3f} Q{q:.3f}")
        elif kind == 2:
            r = 0.6 * np.linalg.norm(step)
            lines.append(f"G{rng.integers(2, 4)} X{x:.3f} Y{y:.3f} R{r:.3f}")
        else:
            lines.append(f"G1 X{x:.3f} Y{y:.3f} F{rng.uniform(500, 9000):.0f}")
        if rng.random() < 0.2:
            lines.append("G4 P0.1")
        place = place + step
    limits = AxisLimits(velocity=[0.3, 0.4], acceleration=[4.0, 6.0], jerk=[150.0, 90.0])
    planned, _ = plan(f"G64 P{rng.choice([0.02, 0.3])}", limits, "\n".join([*lines, "M2", ""]))
    path = planned.part.path
    t = np.sort(np.append(rng.uniform(0, planned.cycle_time, 40_000), planned.profile.time))
    s, v, a, j = (x[:, None] for x in planned.profile.at(t))
    r = arc_derivatives(contour_derivatives(path, s[:, 0]))
    gap = np.abs(s - np.asarray(path.breaks)[None, :]).min(axis=1) > 1e-12
    assert (np.abs(r[:, 0] * v) / [0.3, 0.4])[gap].max() <= 1 + 1e-7
    assert (np.abs(r[:, 1] * v**2 + r[:, 0] * a) / [4.0, 6.0])[gap].max() <= 1 + 1e-7
    jerk = r[:, 2] * v**3 + 3 * r[:, 1] * v * a + r[:, 0] * j
    assert (np.abs(jerk) / [150.0, 90.0])[gap].max() <= 1 + 1e-6
