"""Which limit holds a plan back: on motions whose answer is known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Path, read_gcode_text
from contourlab.feedrate import AxisLimits, binding_limits, plan_feed

LIMITS = AxisLimits(velocity=[0.5, 0.4], acceleration=[5.0, 4.0], jerk=[100.0, 100.0])


def test_a_line_meets_jerk_acceleration_and_feed_in_turn():
    plan = plan_feed(
        Path.polyline([[0.0, 0.0], [0.6, 0.0]]), limits=LIMITS, sample_time=1e-3, feed=0.4
    )
    binding = binding_limits(plan)
    assert binding.names[:4] == ("feed", "velocity 0", "velocity 1", "acceleration 0")
    seen = [name for _, _, name in binding.stretches() if name != "none"]
    assert seen == ["jerk 0", "acceleration 0", "jerk 0", "feed", "jerk 0", "acceleration 0",
                    "jerk 0"]  # fmt: skip
    shares = binding.shares()
    # jerk needs A/J four times; steady 0.6 m / 0.4 m/s - V/A - A/J; all of V/A + A/J + L/V
    total = 0.6 / 0.4 + 0.4 / 5 + 5 / 100
    assert_allclose(plan.cycle_time, total, rtol=1e-6)
    assert_allclose(shares["feed"], (0.6 / 0.4 - 0.4 / 5 - 5 / 100) / total, atol=0.05)


def test_the_slower_axis_is_named():
    line = Path.polyline([[0.0, 0.0], [0.1, 0.8]])
    binding = binding_limits(plan_feed(line, limits=LIMITS, sample_time=1e-3, feed=9.0))
    assert next(iter(binding.shares())) == "velocity 1"


def test_rests_and_axes_of_a_part():
    part = read_gcode_text("G21 G90 F6000\nG1 X50\nG4 P0.5\nG1 Y20\nM2\n", axes=("X", "Y"))
    binding = binding_limits(plan_feed(part, limits=LIMITS, sample_time=1e-3))
    total = binding.time[-1] + 0.5 * (binding.time[1] - binding.time[0])
    assert_allclose(binding.shares()["rest"] * total, 0.5, atol=0.01)
    assert {"jerk X", "jerk Y"} <= set(binding.shares())
    edges = np.array([[a, b] for a, b, _ in binding.stretches()])
    assert edges[0, 0] == 0.0
    assert_allclose(edges[1:, 0], edges[:-1, 1])
    assert "rest" not in [name for *_, name in binding.stretches()]


@pytest.mark.parametrize("points", [50, 1000])
def test_the_number_of_cells_can_be_chosen(points):
    plan = plan_feed(
        Path.polyline([[0.0, 0.0], [0.6, 0.0]]), limits=LIMITS, sample_time=1e-3, feed=0.4
    )
    assert len(binding_limits(plan, points=points).time) == points


def test_jumps_of_curvature_are_listed_with_line_and_size():
    program = "G21 G90 G61 F1200\nG1 X100\nG3 X110 Y10 I0 J10\nG1 Y50\nM2\n"
    part = read_gcode_text(program, axes=("X", "Y"))
    plan = plan_feed(part, limits=LIMITS, sample_time=1e-3)
    first, second = plan.curvature_jumps
    assert (first.line, second.line) == (3, 4)
    assert_allclose(first.parameter, 0.1)
    # at the programmed feed v²/R towards the centre: Y where the arc begins, X where it ends
    assert_allclose(first.acceleration, [0.0, 0.02**2 / 0.01], atol=1e-6)
    assert_allclose(second.acceleration, [0.02**2 / 0.01, 0.0], atol=1e-6)
    smooth = plan_feed(
        read_gcode_text(program.replace("G61", "G64 P0.05"), axes=("X", "Y")),
        limits=LIMITS, sample_time=1e-3,
    )  # fmt: skip
    assert smooth.curvature_jumps == ()
