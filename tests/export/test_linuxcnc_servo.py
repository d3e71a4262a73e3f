"""The servo layer: geometry from the planner's motion, units, limits, and every way to stop."""

import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contourlab.export.linuxcnc import LinuxcncOptions
from contourlab.export.linuxcnc_servo import FAULTS, ServoLayer

from .probe_law import KD, KP, START, T, facts, probe

pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("gcc", "clang", "cc"))), reason="needs a C compiler"
)
GPL = LinuxcncOptions(license="GPL", following_error_limit=5e-3)


def layer(folder, *, preview=0, command="force", **settings):
    made = ServoLayer.made(
        probe(preview=preview), facts(command=command, preview=preview), GPL, folder
    )
    for name, value in settings.items():
        made.settings[name] = value
    return made


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return layer(tmp_path_factory.mktemp("plain"))


@pytest.fixture
def servo(plain):
    """One compiled layer for all, as new."""
    before = plain.settings.copy()
    plain.restart()
    yield plain
    plain.settings[...] = before


def circle(servo, n=400, *, radius=20.0, speed=50.0, pull=0.0):
    """Enabled from the second cycle, on a circle [mm] at a speed that rises steadily."""
    t = np.arange(n) * T
    s = speed * t + 0.5 * pull * t**2
    angle, rate = s / radius, (speed + pull * t) / radius
    radial = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    rows = servo.inputs(n, T)
    rows["reference_position"] = radius * radial
    rows["reference_velocity"] = radius * rate[:, None] * along
    rows["reference_acceleration"] = pull * along - radius * rate[:, None] ** 2 * radial
    rows["position"] = rows["reference_position"] + 0.1
    rows["enable"][1:] = 1
    return rows, angle, rate


def test_geometry_of_a_circle_is_exact(servo):
    rows, angle, _ = circle(servo, pull=300.0)
    given = servo.run(rows)["law_inputs"][1:]
    # derivatives over arc length of a circle of 20 mm, in metres
    for order in range(5):
        turned = angle[1:] + order * np.pi / 2.0
        expected = 0.02 ** (1 - order) * np.stack([np.cos(turned), np.sin(turned)], axis=1)
        geometry = given["geometry"].reshape(-1, 5, 2)[:, order]
        # tangent and curvature come out of differences of rounded millimetres
        assert_allclose(geometry, expected, rtol=0, atol=1e-13 * 0.02 ** (1 - order))


def test_motion_along_the_path_is_that_of_the_planner(servo):
    rows, _, _ = circle(servo, pull=300.0)
    given = servo.run(rows)["law_inputs"][1:]
    speed = 0.05 + 0.3 * np.arange(1, len(rows)) * T
    assert_allclose(given["reference_parameter_rate"], speed, rtol=1e-12)
    assert_allclose(given["reference_parameter_acceleration"], 0.3, rtol=1e-10)
    travelled = np.concatenate([[0.0], np.cumsum(speed[1:] * T)])
    assert_allclose(given["reference_parameter"], travelled, rtol=1e-12)
    assert_allclose(given["time"], np.arange(len(given)) * T, rtol=1e-15)


def test_jerk_is_the_derivative_of_the_acceleration(servo):
    """Of lines and arcs at constant tangential acceleration, which is what a planner runs."""
    rows, _, _ = circle(servo, pull=300.0)
    given = servo.run(rows)["law_inputs"][1:]
    acceleration, jerk = given["reference_acceleration"], given["reference_jerk"]
    slope = (acceleration[2:] - acceleration[:-2]) / (2.0 * T)
    # central differences are off by (T ω)²/6, 1.2e-5 at the end
    assert_allclose(jerk[1:-1], slope, rtol=0, atol=2e-5 * np.abs(jerk).max())


def test_a_standing_reference_keeps_the_direction(servo):
    rows, angle, _ = circle(servo, n=100)
    rows["reference_velocity"][50:] = 0.0
    rows["reference_acceleration"][50:] = 0.0
    rows["reference_position"][50:] = rows["reference_position"][49]
    geometry = servo.run(rows)["law_inputs"]["geometry"].reshape(-1, 5, 2)
    assert_array_equal(geometry[50:, 1:], np.broadcast_to(geometry[49, 1:], (50, 4, 2)))
    assert_allclose(geometry[49, 1], [-np.sin(angle[49]), np.cos(angle[49])], atol=1e-12)


def test_before_any_motion_there_is_a_direction(servo):
    rows = servo.inputs(5, T)
    rows["enable"] = 1
    geometry = servo.run(rows)["law_inputs"]["geometry"].reshape(-1, 5, 2)
    assert_array_equal(geometry[:, 1], np.tile([1.0, 0.0], (5, 1)))
    assert_array_equal(geometry[:, 2:], 0.0)


def test_curvature_is_cut_at_the_smallest_radius(servo):
    rows, _, _ = circle(servo, radius=0.2)
    geometry = servo.run(rows)["law_inputs"]["geometry"].reshape(-1, 5, 2)[1:]
    assert_allclose(np.linalg.norm(geometry[:, 2], axis=1), 1000.0, rtol=1e-12)
    servo.settings["minimum_radius"] = 1e-5
    servo.restart()
    geometry = servo.run(rows)["law_inputs"]["geometry"].reshape(-1, 5, 2)[1:]
    assert_allclose(np.linalg.norm(geometry[:, 2], axis=1), 5000.0, rtol=1e-9)


def test_velocity_is_the_difference_of_positions_or_that_of_the_pins(servo):
    rows, _, _ = circle(servo)
    rows["velocity"] = 7.0
    given = servo.run(rows)["law_inputs"]
    moved = np.diff(rows["position"] * 1e-3, axis=0) / T
    assert_array_equal(given["velocity"][1:], moved)
    servo.settings["measured_velocity"] = 1
    servo.restart()
    assert_array_equal(servo.run(rows)["law_inputs"]["velocity"][1:], 7.0 * 1e-3)


def test_the_command_is_the_laws(servo):
    rows, _, _ = circle(servo)
    out = servo.run(rows)
    given = out["law_inputs"]
    expected = KP * (given["reference_position"] - given["position"]) + KD * (
        given["reference_velocity"] - given["velocity"]
    )
    assert_array_equal(out["command"][1:], expected[1:])
    assert_array_equal(out["command"][0], 0.0)
    assert_array_equal(out["running"], [0, *[1] * 399])
    assert_array_equal(out["following_error"], rows["reference_position"] - rows["position"])


def test_the_command_is_cut_at_its_limit(servo):
    rows, _, _ = circle(servo)
    rows["position"][:, 0] -= 1.0
    free = servo.run(rows)["command"]
    servo.settings["command_limit"] = (0.5 * np.abs(free[:, 0]).max(), 90.0)
    servo.restart()
    out = servo.run(rows)
    limit = servo.settings["command_limit"]
    assert_array_equal(out["command"], np.clip(free, -limit, limit))
    assert_array_equal(out["saturated"], np.any(np.abs(free) > limit, axis=1))
    assert out["saturated"].any()


def test_enabling_again_starts_anew(servo):
    rows, _, _ = circle(servo, n=30)
    rows["enable"][10:20] = 0
    out = servo.run(rows)
    assert_array_equal(out["law"]["steps"][1:10], START + np.arange(1, 10))
    assert_array_equal(out["law"]["steps"][20:], START + np.arange(1, 11))
    assert_array_equal(out["law_inputs"]["time"][20:], np.arange(10) * T)
    assert_array_equal(out["command"][10:20], 0.0)


@pytest.mark.parametrize("field", ["reference_position", "reference_velocity",
                                   "reference_acceleration", "position"])  # fmt: skip
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_input_that_is_not_finite_stops_it(servo, field, value):
    rows, _, _ = circle(servo, n=40)
    rows[field][20, 1] = value
    rows["enable"][30] = 0
    out = servo.run(rows)
    assert_array_equal(out["command"][20:31], 0.0)
    assert_array_equal(out["running"][20:31], 0)
    assert_array_equal(out["fault"][20:31], FAULTS.index("input not finite"))
    # the next enabling clears it, and nothing is left of the bad value
    assert_array_equal(out["fault"][31:], 0)
    assert np.isfinite(out["command"]).all()
    assert_array_equal(out["running"][31:], 1)


def test_a_velocity_that_is_not_read_may_be_nan(servo):
    rows, _, _ = circle(servo, n=40)
    rows["velocity"] = np.nan
    assert not servo.run(rows)["fault"].any()
    servo.settings["measured_velocity"] = 1
    servo.restart()
    assert (servo.run(rows)["fault"][1:] == FAULTS.index("input not finite")).all()


def test_nan_while_disabled_is_no_fault(servo):
    rows, _, _ = circle(servo, n=20)
    rows["position"][:10] = np.nan  # to the last cycle before enabling
    rows["enable"][:10] = 0
    out = servo.run(rows)
    assert not out["fault"].any()
    assert np.isfinite(out["command"]).all()
    assert out["running"][10:].all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_following_error_trips(servo, side):
    rows, _, _ = circle(servo, n=40)
    rows["position"] = rows["reference_position"]
    rows["position"][20, 0] += 4.9 * side
    rows["position"][25, 0] += 5.1 * side
    out = servo.run(rows)
    assert_array_equal(out["fault"][:25], 0)
    assert_array_equal(out["fault"][25:], FAULTS.index("following error"))
    assert_array_equal(out["command"][25:], 0.0)


def test_a_command_that_is_not_finite_is_not_let_out(servo):
    rows, _, _ = circle(servo, n=40)
    servo.run(rows[:20])
    servo.settings["law"]["offset"] = np.nan
    out = servo.run(rows[20:])
    assert_array_equal(out["fault"], FAULTS.index("command not finite"))
    assert_array_equal(out["command"], 0.0)


@pytest.mark.parametrize("period", [0.98e-3, 2e-3, np.nan])
def test_another_thread_period_is_refused(servo, period):
    rows, _, _ = circle(servo, n=5)
    rows["period"] = period
    out = servo.run(rows)
    assert_array_equal(out["fault"][1:], FAULTS.index("wrong thread period"))
    assert_array_equal(out["command"], 0.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("scale", 0.0),
        ("scale", np.nan),
        ("command_limit", -1.0),
        ("command_limit", np.nan),
        ("following_error_limit", np.nan),
        ("hold_speed", -1.0),
        ("minimum_radius", np.inf),
    ],
)
def test_a_setting_out_of_bounds_stops_it(servo, name, value):
    rows, _, _ = circle(servo, n=5)
    servo.settings[name] = value
    out = servo.run(rows)
    assert_array_equal(out["fault"][1:], FAULTS.index("bad setting"))
    assert_array_equal(out["command"], 0.0)


def test_gains_change_while_it_runs(servo):
    rows, _, _ = circle(servo, n=40)
    first = servo.run(rows[:20])
    servo.settings["law"]["kp"] *= 2.0
    second = servo.run(rows[20:])
    given = second["law_inputs"]
    expected = 2.0 * KP * (given["reference_position"] - given["position"]) + KD * (
        given["reference_velocity"] - given["velocity"]
    )
    assert_array_equal(second["command"], expected)
    assert first["law"]["steps"][-1] + 1 == second["law"]["steps"][0]


def test_preview_follows_the_planner_late(tmp_path):
    servo = layer(tmp_path, preview=3)
    rows, _, _ = circle(servo, n=60, pull=300.0)
    out = servo.run(rows)
    given = out["law_inputs"]
    reference = rows["reference_position"] * 1e-3
    assert_array_equal(given["reference_position"][4:], reference[1:-3])
    assert_array_equal(given["reference_position"][1:4], np.tile(reference[1], (3, 1)))
    for k in range(3):
        ahead = given["preview_position"].reshape(-1, 3, 2)[:, k]
        assert_array_equal(ahead[4:], reference[2 + k : len(reference) - 2 + k])
    rate = given["preview_parameter_rate"]
    assert_array_equal(rate[4:-1, 1], rate[5:, 0])
    # the trip is against the point that is followed, not against the planner's
    apart = np.abs(np.diff(reference, axis=0)).max() * 1e3  # in one cycle
    servo.settings["following_error_limit"] = 0.3 * apart
    servo.restart()
    rows["position"][4:] = rows["reference_position"][1:-3]
    rows["position"][:4] = rows["reference_position"][1]
    assert not servo.run(rows)["fault"].any()


def test_a_velocity_command_is_in_machine_units(tmp_path):
    servo = layer(tmp_path, command="velocity")
    assert_allclose(servo.settings["command_limit"], 100.0 / 1e-3)
    rows, _, _ = circle(servo, n=20)
    out = servo.run(rows)
    assert_array_equal(out["command"][1:], out["law"]["command"][1:] / 1e-3)


def test_a_position_command_holds_when_it_stops(tmp_path):
    servo = layer(tmp_path, command="position")
    rows, _, _ = circle(servo, n=30)
    servo.settings["command_limit"] = 0.05
    rows["position"][20] = np.nan
    out = servo.run(rows)
    reference, limit = rows["reference_position"], 0.05
    assert np.all(np.abs(out["command"][1:20] - reference[1:20]) <= limit * (1 + 1e-9))
    assert_array_equal(out["command"][20:], np.tile(out["command"][19], (10, 1)))
    assert_array_equal(out["command"][0], rows["position"][0])  # disabled: where it stands


def test_single_precision(tmp_path):
    servo = ServoLayer.made(probe(precision="single"), facts(), GPL, tmp_path)
    rows, _, _ = circle(servo)
    out = servo.run(rows)
    given = out["law_inputs"]
    assert given["reference_position"].dtype == np.float32
    assert_array_equal(given["reference_position"][1:],
                       (rows["reference_position"][1:] * 1e-3).astype(np.float32))  # fmt: skip
    assert out["running"][1:].all()


def test_three_axes(tmp_path):
    servo = ServoLayer.made(probe(3), facts(3), GPL, tmp_path)
    rows = servo.inputs(20, T)
    rows["enable"] = 1
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    rows["reference_velocity"] = 30.0 * direction
    geometry = servo.run(rows)["law_inputs"]["geometry"].reshape(-1, 5, 3)
    assert_allclose(geometry[:, 1], np.tile(direction, (20, 1)), rtol=1e-15)
