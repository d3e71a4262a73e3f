"""Corners that the plan has blended are still corners of the program."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import read_gcode_text
from contourlab.feedrate import AxisLimits, plan_feed
from contourlab.simulation.blended_corners import blended_corners

PROGRAM = "G21 G90 G64 P{}\nG1 F2000 X10\nY10\nX0\nG61\nY5\nX5\nM2\n"
LIMITS = AxisLimits(velocity=[0.5] * 2, acceleration=[5.0] * 2, jerk=[5000.0] * 2)


def planned(tolerance):
    part = read_gcode_text(PROGRAM.format(tolerance), axes=("X", "Y"))
    return plan_feed(part, limits=LIMITS, sample_time=5e-4), part


def test_places_lines_and_directions_are_the_programs():
    plan, part = planned(0.1)
    corners = blended_corners(plan, part, 1e-3)
    assert [(c.line_before, c.line_after) for c in corners] == [(2, 3), (3, 4)] or [
        (c.line_before, c.line_after) for c in corners
    ] == [(2, 3), (3, 4), (4, 6)]
    assert_allclose(corners[0].position, [0.01, 0.0], atol=1e-15)
    assert_allclose(corners[0].incoming, [1.0, 0.0], atol=1e-12)
    assert_allclose(corners[0].outgoing, [0.0, 1.0], atol=1e-12)
    assert_allclose(corners[0].angle, np.pi / 2)


@pytest.mark.parametrize("tolerance", [0.05, 0.2])
def test_a_run_counts_them_and_undershoot_holds_the_blend(tolerance):
    plan, part = planned(tolerance)
    machine = cl.machines.examples.linear_motor_stage()
    pid = cl.controllers.AxisPid.by_pole_placement(machine.nominal, bandwidth_hz=30.0)
    passes = cl.compare(machine, {"pid": pid}, plan, part=part).corners["pid"]
    lines = [one.corner.line_before for one in passes]
    assert lines == sorted(lines)
    assert len(passes) == 4  # two or three blended, the others stopped at
    assert all(one.undershoot < 1.5e-3 * tolerance for one in passes)


def test_none_without_blends():
    _, part = planned(0.1)
    assert blended_corners(None, part, 1e-3) == ()
    stops = plan_feed(
        read_gcode_text("G21 G90\nG1 F2000 X10\nY10\nM2\n", axes=("X", "Y")),
        limits=LIMITS, sample_time=1e-3,
    )  # fmt: skip
    assert blended_corners(stops, part, 1e-3) == ()
