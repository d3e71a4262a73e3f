"""Contour errors that are known, against commands and parts; what a log cannot show."""

import dataclasses

import numpy as np
import pytest

import contourlab as cl
from contourlab.errors import ConfigurationError, ContourlabError, LogError
from contourlab.evaluation.grid import grid_step, grid_steps
from contourlab.logs import Log, read_log

DT = 1e-3
UP = np.array([0.0, 2e-6])
PART = """G21 G90 G17 G64
G0 X0 Y0
F3000
G1 X60 Y0
G3 X70 Y10 I0 J10
G1 X70 Y40
G1 X0 Y40
M2
"""


def along_part(spacing=5e-5):
    """Return points of the part's path and where they lie on it [m]."""
    line = [np.array([0, 0]), np.array([0.06, 0]), np.array([0.07, 0.04]), np.array([0, 0.04])]
    a = np.linspace(0, 1, int(0.06 / spacing))[:, None] * line[1]
    t = np.linspace(0, np.pi / 2, int(0.0157 / spacing))[1:]
    b = np.array([0.06, 0.01]) + 0.01 * np.column_stack([np.sin(t), -np.cos(t)])
    c = np.array([0.07, 0.01]) + np.linspace(0, 1, int(0.03 / spacing))[1:, None] * [0, 0.03]
    d = line[2] + np.linspace(0, 1, int(0.07 / spacing))[1:, None] * [-0.07, 0]
    return np.concatenate([a, b, c, d])


def write(tmp_path, commanded, actual, digits=9, name="log.csv"):
    file = tmp_path / name
    rows = np.column_stack([np.arange(len(actual)) * DT, commanded * 1e3, actual * 1e3])
    np.savetxt(file, rows, delimiter=",", header="t_s,xs_mm,ys_mm,xa_mm,ya_mm", comments="",
               fmt=["%.6f"] + 4 * [f"%.{digits}f"])  # fmt: skip
    return file


def log(tmp_path, commanded, actual, digits=9):
    return read_log(write(tmp_path, commanded, actual, digits), commanded="xs_mm,ys_mm",
                    actual="xa_mm,ya_mm")  # fmt: skip


def normals(points):
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    return np.column_stack([-tangent[:, 1], tangent[:, 0]]), tangent


def test_an_offset_and_a_lag_are_told_apart(tmp_path):
    # on a straight line: 7 um to the left, 120 um behind
    x = np.concatenate([np.zeros(50), np.linspace(0, 0.1, 2000) ** 1.0, np.full(50, 0.1)])
    commanded = np.column_stack([x, 0.5 * x])
    way = np.array([2.0, 1.0]) / np.sqrt(5.0)
    left = np.array([-way[1], way[0]])
    actual = commanded + 7e-6 * left
    actual[60:2040] -= 120e-6 * way
    found = cl.evaluate(log(tmp_path, commanded, actual))
    np.testing.assert_allclose(found.metrics["contour_error_max"], 7e-6, rtol=1e-3)
    np.testing.assert_allclose(found.metrics["lag_error_max"], 120e-6, rtol=1e-3)
    # to the left of the path: the vector to the path points right, along minus the left normal
    error = np.asarray(found.recording["contour_error"])[100:2000]
    np.testing.assert_allclose(error, -7e-6, rtol=1e-3)


def test_a_spline_through_the_commands_takes_the_chords_out(tmp_path):
    angle = np.linspace(0, 3.0, 60)
    commanded = 0.03 * np.column_stack([np.cos(angle), np.sin(angle)])
    between = 0.03 * np.column_stack([np.cos(angle - 0.02), np.sin(angle - 0.02)])
    lines = cl.evaluate(log(tmp_path, commanded, between), circular=False)
    spline = cl.evaluate(log(tmp_path, commanded, between), path="spline", circular=False)
    sagitta = 0.03 * (angle[1] ** 2) / 8
    assert lines.metrics["contour_error_max"] > 0.7 * sagitta
    # a spline through points 1.5 mm apart on a radius of 30 mm is right to a few nanometres,
    # apart from its ends
    assert np.nanmedian(np.abs(spline.recording["contour_error"])) < 5e-8
    np.testing.assert_allclose(lines.resolution.chord, sagitta, rtol=0.02)
    assert any("sampling rate is low" in warning for warning in lines.warnings)
    with pytest.raises(ConfigurationError, match="goes with path = 'spline'"):
        cl.evaluate(log(tmp_path, commanded, between), tolerance="1 um")
    loose = cl.evaluate(
        log(tmp_path, commanded, between), path="spline", tolerance="5 um", circular=False
    )
    assert loose.metrics["contour_error_max"] < 1e-5


@pytest.fixture
def part_file(tmp_path):
    (tmp_path / "part.ngc").write_text(PART)
    return tmp_path / "part.ngc"


def placed(points, angle=0.02, shift=(0.3, -0.2)):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]]) + shift


@pytest.mark.parametrize("turned", [0.0, 0.02, np.pi / 2])
def test_a_log_is_laid_on_the_part(tmp_path, part_file, turned):
    points = along_part()
    normal, _ = normals(points)
    bump = 20e-6 * np.exp(-(((np.arange(len(points)) - 1350) / 40.0) ** 2))  # on the arc
    commanded, actual = placed(points, turned), placed(points + bump[:, None] * normal, turned)
    found = cl.evaluate(log(tmp_path, commanded, actual), contour=part_file)
    np.testing.assert_allclose(found.metrics["contour_error_max"], 20e-6, rtol=0.02)
    np.testing.assert_allclose(found.alignment.angle, -turned, atol=1e-6)
    back = found.alignment.to_part(commanded)
    np.testing.assert_allclose(back, points, atol=1e-7)
    worst = found.worst[0]
    assert worst.where.endswith("part.ngc:5: G3 X70 Y10 I0 J10")
    np.testing.assert_allclose(worst.position, actual[1350], atol=1e-3)


def test_a_part_that_lies_far_away_behind_its_approach_is_found(tmp_path):
    """The rapid from home to the part is in the program and not in the log, or the reverse."""
    far = tmp_path / "far.ngc"
    program = PART.replace("G0 X0 Y0", "G0 X0 Y0\nG10 L2 P1 X500 Y200\nG0 X0 Y0")
    far.write_text(program)
    points = along_part()
    found = cl.evaluate(log(tmp_path, points, points + UP), contour=far)
    np.testing.assert_allclose(found.alignment.shift, [0.5, 0.2], atol=1e-8)
    np.testing.assert_allclose(found.metrics["contour_error_max"], 2e-6, rtol=1e-3)
    assert found.alignment.covered > 0.99
    near = tmp_path / "near.ngc"
    near.write_text(PART)
    home = np.linspace(0.0, 1.0, 100)[:, None] * [1.5, 0.7] - [1.5, 0.7]
    whole = np.concatenate([home, points]) + np.array([0.3, -0.1])
    found = cl.evaluate(log(tmp_path, whole, whole + UP), contour=near)
    np.testing.assert_allclose(found.alignment.shift, [-0.3, 0.1], atol=1e-8)


def test_without_aligning_the_log_counts_as_it_stands(tmp_path, part_file):
    points = along_part()
    moved = points + np.array([0.0, 10e-6])
    kept = cl.evaluate(log(tmp_path, moved, moved), contour=part_file, align_part=False)
    np.testing.assert_allclose(kept.metrics["contour_error_max"], 10e-6, rtol=1e-2)
    assert not kept.alignment.fitted
    laid = cl.evaluate(log(tmp_path, moved, moved), contour=part_file)
    assert laid.metrics["contour_error_max"] < 1e-6
    far = placed(points)
    with pytest.raises(LogError, match=r"does not match.*mm from it as it stands; it was not"):
        cl.evaluate(log(tmp_path, far, far), contour=part_file, align_part=False)


def test_a_part_that_is_another_one_is_said_with_the_distance(tmp_path, part_file):
    t = np.linspace(0, 6.2, 2000)
    heart = 0.03 * np.column_stack([np.sin(t) ** 3, np.cos(t) - 0.4 * np.cos(2 * t)])
    with pytest.raises(LogError, match=r"the part does not match the log: half .* more than .* mm"):
        cl.evaluate(log(tmp_path, heart, heart), contour=part_file)


def test_an_approach_is_not_judged(tmp_path, part_file):
    points = along_part()
    approach = np.linspace(0, 1, 400)[:, None] * np.array([0.02, -0.03]) - [0.02, -0.03]
    both = np.concatenate([approach[:-1], points])
    found = cl.evaluate(log(tmp_path, both, both), contour=part_file)
    assert found.metrics["contour_error_max"] < 0.006 * 0.07
    assert any("an approach, or the part is another one" in text for text in found.warnings)
    assert 0.7 < found.alignment.on_part < 0.95


def test_what_the_commands_leave_of_the_part_is_a_cause(tmp_path, part_file):
    points = along_part()
    normal, _ = normals(points)
    swerve = 15e-6 * np.sin(np.arange(len(points)) / 150.0)[:, None] * normal
    commanded = points + swerve
    found = cl.evaluate(
        log(tmp_path, commanded, commanded), contour=part_file, align_part=False, circular=False
    )
    cause = {c.name: c for c in found.causes}["commanded path"]
    assert cause.share > 0.95
    np.testing.assert_allclose(cause.rms, found.metrics["contour_error_rms"], rtol=0.05)


def test_a_part_with_other_axes_is_refused(tmp_path, part_file):
    points = along_part()
    read = log(tmp_path, points, points)
    with pytest.raises(ContourlabError):
        cl.evaluate(read, contour=tmp_path / "missing.ngc")
    three = cl.contours.Line(start=(0.0, 0.0, 0.0), end=(1.0, 0.0, 0.0))
    with pytest.raises(LogError, match="the part has 3 coordinates and the log 2 axes"):
        cl.evaluate(read, contour=three)
    with pytest.raises(ConfigurationError, match="contour must be"):
        cl.evaluate(read, contour=3)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 10])
def test_a_handful_of_samples_says_what_it_cannot_tell(tmp_path, n):
    angle = np.linspace(0.0, 1.0, n)
    commanded = 0.03 * np.column_stack([np.cos(angle), np.sin(angle)])
    actual = commanded + 1e-6
    few = Log(
        source="log", format="text", axes=("X", "Y"), time=np.arange(n) * DT, sample_time=DT,
        timed=True, commanded=commanded, actual=actual, scale=1e-3, row=np.arange(n),
    )  # fmt: skip
    if n < 3:
        with pytest.raises(LogError, match=f"{n} samples are left: a contour error takes 3 or"):
            cl.evaluate(few)
        return
    found = cl.evaluate(few)
    assert "samples can be judged" in found.warnings[0]
    assert "at best" in found.warnings[0]
    assert found.causes == ()
    assert any("too few connected samples" in text for text in found.warnings)
    still = dataclasses.replace(few, commanded=0.0 * commanded, actual=0.0 * actual)
    with pytest.raises(LogError, match="nothing moves"):
        cl.evaluate(still)


def turning(tmp_path, heads, columns, **options):
    file = tmp_path / "log.csv"
    t = np.arange(len(columns[0])) * DT
    np.savetxt(file, np.column_stack([t, *columns]), delimiter=",", header=f"t_s,{heads}",
               comments="", fmt="%.6f")  # fmt: skip
    names = heads.split(",")
    half = len(names) // 2
    return cl.evaluate(file, commanded=",".join(names[:half]), actual=",".join(names[half:]),
                       circular=False, **options)  # fmt: skip


def test_rotary_axes_are_tracked_beside_the_contour_error(tmp_path):
    t = np.arange(2000) * DT
    x, y = 30.0 * np.cos(2.0 * t), 30.0 * np.sin(2.0 * t)
    c = 200.0 * np.sin(3.0 * t)
    late = 200.0 * np.sin(3.0 * (t - 0.004))
    around = [np.mod(one + 180.0, 360.0) - 180.0 for one in (c, late)]  # wraps at half a turn
    found = turning(
        tmp_path, "x_set [mm],y_set [mm],c_set [deg],x_act [mm],y_act [mm],c_act [deg]",
        [x, y, around[0], x, y + 0.002, around[1]],
    )  # fmt: skip
    assert found.log.axes == ("X", "Y")
    np.testing.assert_allclose(found.metrics["contour_error_max"], 2e-6, rtol=1e-2)
    (one,) = found.rotary
    assert (one.axis, one.unit) == ("C", "deg")
    np.testing.assert_allclose(one.max, np.deg2rad(200.0 * 3.0 * 0.004), rtol=1e-3)
    np.testing.assert_allclose(one.lag, 0.004, rtol=1e-3)
    assert any("C: rotary, so tracked by itself" in text for text in found.warnings)
    # by its letter too, where only the lengths have a unit
    silent = turning(tmp_path, "x_set,y_set,c_set,x_act,y_act,c_act",
                     [x, y, around[0], x, y + 0.002, around[1]], unit="mm")  # fmt: skip
    np.testing.assert_allclose(silent.rotary[0].lag, 0.004, rtol=1e-3)
    assert any("taken for deg" in text for text in silent.warnings)
    # alone they have no contour error; what they have is said
    with pytest.raises(LogError, match=r"the kinematic chain.* C: .*2.4 deg at most, lag 4.00"):
        turning(tmp_path, "b_set,c_set,b_act,c_act", [c, c, late, late], unit="deg")
    with pytest.raises(LogError, match=r"got 1 \(X\).*C is rotary: .* deg rms"):
        turning(tmp_path, "x_set_mm,c_set_deg,x_act_mm,c_act_deg", [x, c, x, late])


def test_rotary_axes_at_rest_in_rad_or_with_gaps(tmp_path):
    t = np.arange(2000) * DT
    x, y = 30.0 * np.cos(2.0 * t), 30.0 * np.sin(2.0 * t)
    parked = turning(tmp_path, "x_set,y_set,a_set,x_act,y_act,a_act",
                     [x, y, 0 * t, x, y + 0.002, 0 * t], unit="mm")  # fmt: skip
    assert parked.rotary == ()
    assert any("A: rotary, and at rest" in text for text in parked.warnings)
    b = np.sin(3.0 * t)
    late = np.sin(3.0 * (t - 0.004))
    late[::5] = np.nan
    mixed = turning(tmp_path, "x_set_mm,y_set_mm,a_set,b_set_rad,x_act_mm,y_act_mm,a_act,b_act_rad",
                    [x, y, b, b, x, y + 0.002, b, late])  # fmt: skip
    np.testing.assert_allclose(mixed.rotary[1].max, 3.0 * 0.004, rtol=1e-3)
    assert any(text.startswith("A and B: 400 of 2000 samples") for text in mixed.warnings)
    assert any("a_set, a_act state no unit: taken for rad" in text for text in mixed.warnings)
    # columns that are guessed take the rotary ones along, and a guessed unit is shown as such
    found = cl.evaluate(tmp_path / "log.csv", circular=False)
    assert [axis.axis for axis in found.rotary] == ["A", "B"]
    with pytest.raises(LogError, match="is in rad, but unit is 'deg'"):
        turning(tmp_path, "a_set_rad,a_act_rad", [b, b], unit="deg")
    with pytest.raises(LogError, match="taken for deg by the letters A, B, C"):
        turning(tmp_path, "a_set,b_set,a_act,b_act", [b, b, b, 1.01 * b])


def test_there_and_back_at_one_speed_tells_no_lag(tmp_path):
    t = np.arange(4000) * DT
    c = 20.0 * np.abs(np.mod(t, 2.0) - 1.0)
    late = np.interp(t - 0.004, t, c)
    x, y = 30.0 * np.cos(2.0 * t), 30.0 * np.sin(2.0 * t)
    found = turning(tmp_path, "x_set_mm,y_set_mm,c_set_deg,x_act_mm,y_act_mm,c_act_deg",
                    [x, y, c, x, y + 0.002, late])  # fmt: skip
    assert np.isnan(found.rotary[0].lag)


def test_three_axes(tmp_path):
    t = np.linspace(0, 10, 3000)
    helix = np.column_stack([0.02 * np.cos(t), 0.02 * np.sin(t), 0.001 * t])
    away = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    file = tmp_path / "log.csv"
    np.savetxt(file, np.column_stack([t, helix, helix + 5e-6 * away]), delimiter=",", comments="",
               header="t_s,xs_m,ys_m,zs_m,xa_m,ya_m,za_m")  # fmt: skip
    found = cl.evaluate(file, commanded="xs_m,ys_m,zs_m", actual="xa_m,ya_m,za_m", circular=False)
    error = np.asarray(found.recording["contour_error"])
    np.testing.assert_allclose(error[found.judged], 5e-6, rtol=0.02)
    shares = [c.share for c in found.causes if np.isfinite(c.share)]
    np.testing.assert_allclose(sum(shares), 1.0, atol=1e-9)


# -- what a log cannot show


@pytest.mark.parametrize("step", [1e-3, 0.25, 1e-6])
def test_a_grid_is_found(step):
    values = np.round(np.random.default_rng(0).normal(size=2000) * 50 * step / step) * step
    np.testing.assert_allclose(grid_step(values), step, rtol=1e-6)


def test_what_lies_on_no_grid_has_none():
    rng = np.random.default_rng(1)
    assert grid_step(rng.normal(size=1000)) == 0.0
    assert grid_step(np.cos(np.arange(500) * 0.01)) == 0.0
    assert grid_step(np.ones(100)) == 0.0


def test_significant_digits_have_a_step_for_each_decade():
    values = np.concatenate([np.arange(10, 100) + 0.0, np.arange(100, 1000, 10) + 0.0])
    steps = grid_steps(np.repeat(values, 3))
    np.testing.assert_allclose(steps[:270], 1.0)
    np.testing.assert_allclose(steps[270:], 10.0)


def test_constant_speed_is_no_grid():
    way = np.linspace(0.0, 60.0, 1500)
    assert grid_step(way) == 0.0
    # but its digits are one
    np.testing.assert_allclose(grid_step(np.round(way, 5)), 1e-5, rtol=1e-6)


def test_a_coarse_log_gives_no_confident_micrometre(tmp_path):
    points = along_part()
    found = cl.evaluate(log(tmp_path, points, points + 3e-6, digits=1))
    half, largest = (found.metrics[f"contour_error_max{k}"] for k in ("_uncertainty", ""))
    # steps of 0.1 mm of both: half of each, along the axis across the path
    assert half >= 0.99e-4
    assert half >= 0.5 * largest
    np.testing.assert_allclose(found.resolution.actual_step, 1e-4, rtol=1e-6)
    assert any("lie on a grid of X 100.0 um" in text for text in found.warnings)
    assert any("without any error would show" in text for text in found.warnings)
    assert not [c for c in found.causes if c.state == "found"]


def test_the_floor_is_what_a_perfect_machine_shows(tmp_path):
    rng = np.random.default_rng(2)
    x = np.sort(rng.uniform(0.02, 0.08, 4000))
    commanded = np.column_stack([x, 0.3 * x + 0.01])
    # exact commands in the log, actual on a grid of 10 um
    rows = log(tmp_path, commanded, np.round(commanded / 1e-5) * 1e-5)
    found = cl.evaluate(rows, circular=False)
    np.testing.assert_allclose(
        found.metrics["contour_error_rms"], found.metrics["contour_error_floor_rms"], rtol=0.05
    )


def test_drop_outs_break_the_path_and_are_said(tmp_path):
    points = along_part()
    lost = points.copy()
    lost[600:700] = lost[0]
    lost[1500] = lost[0]
    found = cl.evaluate(log(tmp_path, lost, lost + UP))
    assert found.metrics["contour_error_max"] < 3e-6
    assert found.metrics["judged_samples"] <= len(points) - 101
    assert any("drop-outs and not judged" in text for text in found.warnings)
    assert any("jump at 4 places" in text for text in found.warnings)


def test_gaps_and_repeats_are_said(tmp_path):
    points = along_part()
    held = points.copy()
    held[1::2] = held[:-1:2][: len(held[1::2])]
    found = cl.evaluate(log(tmp_path, held, held + UP))
    assert any("repeat the one before although the axes move" in text for text in found.warnings)
    file = write(tmp_path, points, points + UP)
    rows = file.read_text().splitlines()
    del rows[500:520]
    file.write_text("\n".join(rows))
    gap = cl.evaluate(file, commanded="xs_mm,ys_mm", actual="xa_mm,ya_mm")
    assert any("samples are missing at 1 places, 0.02 s" in text for text in gap.warnings)


def test_a_limited_signal_is_said(tmp_path):
    points = along_part()
    actual = points.copy()
    actual[:, 0] = np.minimum(actual[:, 0], 0.065)
    found = cl.evaluate(log(tmp_path, points, actual))
    assert any("the actual position of X stands at its end, 65 mm" in t for t in found.warnings)


def test_mistakes_are_refused(tmp_path):
    points = along_part()
    read = log(tmp_path, points, points)
    with pytest.raises(ConfigurationError, match="unknown path 'curve'"):
        cl.evaluate(read, path="curve")
    with pytest.raises(ConfigurationError, match="unit go with a file"):
        cl.evaluate(read, unit="mm")
    file = write(tmp_path, points, points)
    with pytest.raises(LogError, match="takes 2 or 3 axes, got 1"):
        cl.evaluate(file, commanded="xs_mm", actual="xa_mm")
    with pytest.raises(LogError, match="without commanded positions there is no path"):
        cl.evaluate(file, actual="xs_mm,ys_mm")


def test_a_command_at_its_limit_is_said(tmp_path):
    points = along_part()
    read = log(tmp_path, points, points + UP)
    drive = np.clip(np.sin(np.arange(len(points)) / 50.0)[:, None] * [12.0, 3.0], -10.0, 10.0)
    limited = dataclasses.replace(read, command=drive, command_unit="V")
    found = cl.evaluate(limited, circular=False)
    assert any("the command of X is at its largest value, 10 V" in t for t in found.warnings)
    assert not any("the command of Y" in text for text in found.warnings)


def test_a_part_judges_actual_positions_without_commands(tmp_path, part_file):
    points = along_part()
    normal, _ = normals(points)
    bump = 30e-6 * np.exp(-(((np.arange(len(points)) - 600) / 60.0) ** 2))
    file = write(tmp_path, points, placed(points + bump[:, None] * normal))
    found = cl.evaluate(file, actual="xa_mm,ya_mm", axes="XY", contour=part_file)
    np.testing.assert_allclose(found.metrics["contour_error_max"], 30e-6, rtol=0.1)
    assert found.causes == ()
    assert "lag_error_max" not in found.metrics
    assert found.worst[0].where.endswith("part.ngc:4: G1 X60 Y0")


def test_rounding_is_not_explained():
    """A log that is exactly on its path leaves an error of 1e-20 m: no cause made that."""
    rng = np.random.default_rng(3)
    commanded = np.cumsum(rng.normal(size=(184, 3)) * 1e-4, axis=0)
    commanded[rng.random(184) < 0.1] = 0.0
    commanded = np.round(commanded / 1e-3) * 1e-3
    log = Log(
        source="log", format="text", axes=("X", "Y", "Z"), time=np.arange(184.0), sample_time=1.0,
        timed=False, commanded=commanded, actual=commanded.copy(), scale=1e-3, row=np.arange(184),
    )  # fmt: skip
    found = cl.evaluate(log)
    assert found.metrics["contour_error_rms"] < 1e-15
    assert found.causes == ()
    assert any("no more than rounding" in one for one in found.warnings)
