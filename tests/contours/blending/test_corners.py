"""Corners of known shape: closed forms, limits, what is left and why."""

import importlib.util
from pathlib import Path as FilePath

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Path, blend_corners
from contourlab.contours.blending.shape import deviation_per_trim, handle_ratios
from contourlab.errors import GeometryError

_SPEC = importlib.util.spec_from_file_location(
    "blend_judge", FilePath(__file__).with_name("blend_judge.py")
)
judge = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(judge)

ANGLES = [0.01, 1.0, 10.0, 45.0, 90.0, 135.0, 160.0, 178.5]


def corner(degrees, first=0.1, last=0.1, n_axes=2):
    angle = np.radians(degrees)
    points = np.zeros((3, n_axes))
    points[1, 0] = first
    points[2, :2] = first + last * np.cos(angle), last * np.sin(angle)
    return Path.polyline(points, [4, 5])


def line_then_arc(radius=0.02, turned=0.0, length=0.02):
    """A line along x, then a left arc that begins after turning."""
    c, s = np.cos(turned), np.sin(turned)
    line = Path.polyline([[-length, 0.0], [0.0, 0.0]])
    arc = Path.from_helical(
        [[0.0, 0.0]], [[c, s]], [[-s, c]], [[0.0, 0.0]], [1.0 / radius], [length]
    )
    return Path.join([line, arc])


@pytest.mark.parametrize("degrees", ANGLES)
def test_two_lines_use_the_whole_tolerance_as_the_closed_form_says(degrees):
    tolerance = 20e-6 if degrees > 1.0 else 1e-7
    path = corner(degrees)
    blended = blend_corners(path, tolerance=tolerance)
    angle = np.radians(degrees)
    first, second = handle_ratios(np.array([angle]))
    trim = 16.0 * tolerance / ((1 + 5 * first + 10 * second) * np.sin(angle / 2))
    assert_allclose(blended.trim, [[trim[0], trim[0]]], rtol=5e-6)
    assert_allclose(blended.deviation, tolerance, rtol=5e-6)
    assert blended.deviation[0] <= tolerance
    # the same by sampling; the corner is a sample, so only the sag of the chords is missing
    assert_allclose(judge.judged_deviations(path, blended), blended.deviation, rtol=1e-4)
    # and the middle of the blend, which is the point nearest to the corner
    middle = 0.5 * float(np.asarray(blended.path.breaks)[[0, -1]].sum())
    gap = np.linalg.norm(np.asarray(blended.path.position(middle)) - [0.1, 0.0])
    assert_allclose(gap, blended.deviation[0], rtol=1e-6)


@pytest.mark.parametrize("degrees", [1.0, 30.0, 90.0, 150.0])
def test_curvature_of_a_corner_has_one_sign_and_turns_once(degrees):
    path = corner(degrees)
    blended = blend_corners(path, tolerance=5e-5)
    breaks = np.asarray(blended.path.breaks)
    rows = np.flatnonzero(blended.is_blend)
    at = np.linspace(breaks[rows[0]], breaks[rows[-1] + 1], 4000)
    piece = np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, blended.path.n_pieces - 1)
    d = judge.derivatives(blended.path, at, piece)
    curvature = d[:, 1, 0] * d[:, 2, 1] - d[:, 1, 1] * d[:, 2, 0]
    assert curvature.min() > -1e-9 * curvature.max()
    assert_allclose(np.trapezoid(curvature, at), np.radians(degrees), rtol=1e-5)
    assert (d[:, 1] @ [np.cos(np.radians(degrees) / 2), np.sin(np.radians(degrees) / 2)]).min() > 0


def test_handles_of_a_blend_are_better_than_others():
    """At equal deviation, the speed that jerk allows at 90° (the figures of the module's text)."""

    def speeds(first, second):
        u = np.linspace(0.0, 1.0, 2001)[:, None]
        along = np.array([1.0, first, second])
        points = np.concatenate([along[:, None] * [-1.0, 0.0], along[::-1, None] * [0.0, 1.0]])
        slopes = [points]
        for k in range(3):
            slopes.append((5 - k) * np.diff(slopes[-1], axis=0))
        r, r1, r2, r3 = (_bezier(points, u) for points in slopes)
        speed = np.linalg.norm(r1, axis=1)
        bend = (r1[:, 0] * r2[:, 1] - r1[:, 1] * r2[:, 0]) / speed**3
        rise = (r1[:, 0] * r3[:, 1] - r1[:, 1] * r3[:, 0]) / speed**4
        rise -= 3.0 * bend * np.sum(r1 * r2, axis=1) / speed**3
        e = np.linalg.norm(r[1000])
        return (np.abs(bend).max() * e) ** -0.5, np.hypot(rise, bend**2).max() ** (-1 / 3) * e ** (
            -2 / 3
        )

    first, second = (values[0] for values in handle_ratios(np.array([np.pi / 2])))
    v_a, v_j = speeds(first, second)
    assert_allclose([v_a, v_j], [1.43, 1.61], atol=0.006)
    for change in ((0.05, 0.0), (-0.05, 0.0), (0.0, 0.05), (0.0, -0.05)):
        assert speeds(first + change[0], second + change[1])[1] < v_j


def _bezier(points, u):
    while len(points) > 1:
        if points.ndim == 2:
            points = points[:, None, :]
        points = (1.0 - u) * points[:-1] + u * points[1:]
    return points[0]


def test_reach_and_short_pieces_limit_the_trim():
    assert_allclose(blend_corners(corner(90.0), tolerance=1e-3, reach=1e-4).trim, 1e-4, rtol=1e-12)
    short = blend_corners(corner(90.0, last=1e-3), tolerance=1.0)
    assert_allclose(short.trim, 1e-3, rtol=2e-6)
    assert short.deviation[0] < 1e-3
    assert short.piece[-1] == 1  # the blend ends the path: nothing is left of the last piece
    assert short.is_blend[-1]
    assert_allclose(short.path.position(short.path.length), [0.1, 1e-3], atol=1e-15)


def test_two_blends_share_a_piece_and_one_takes_what_the_other_leaves():
    # corners of 90° and of 1° on a middle piece of 1 mm, under a tolerance that one can use
    turned = np.cumsum([0.0, np.pi / 2, np.radians(1.0)])
    steps = np.array([0.1, 1e-3, 0.1])[:, None] * np.stack([np.cos(turned), np.sin(turned)], 1)
    path = Path.polyline(np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]))
    blended = blend_corners(path, tolerance=2e-5)
    need = 2e-5 / deviation_per_trim(np.array([np.pi / 2]))[0]
    assert_allclose(blended.trim[0], need, rtol=1e-5)
    assert_allclose(blended.trim[1], 1e-3 - need, rtol=1e-5)
    # both starved: half and half
    blended = blend_corners(path, tolerance=1e-2)
    assert_allclose(blended.trim, 5e-4, rtol=1e-5)


def test_swallowed_pieces_keep_curvature_continuous():
    angle = np.linspace(0.0, 1.0, 40)
    path = Path.polyline(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    blended = blend_corners(path, tolerance=1.0)
    assert blended.path.n_pieces == 38 + 2  # one row for a blend of a small angle
    assert blended.path.joints().curvature_jump.max() < 1e-6
    assert (np.diff(blended.piece) >= 0).all()


@pytest.mark.parametrize("tolerance", [1e-6, 1e-5, 1e-4])
def test_a_jump_of_curvature_is_smoothed(tolerance):
    path = line_then_arc()
    blended = blend_corners(path, tolerance=tolerance)
    assert len(blended.joint) == 1
    assert blended.deviation[0] <= tolerance
    assert blended.path.joints().curvature_jump.max() < 1e-6 * 50.0
    breaks = np.asarray(blended.path.breaks)
    rows = np.flatnonzero(blended.is_blend)
    peak = judge.peak_curvatures(blended.path, breaks[rows[:1]], breaks[rows[-1:] + 1])
    assert peak[0] < 1.1 * 50.0  # the transition overshoots the arc's curvature by 8 %
    same = blend_corners(path, tolerance=tolerance, curvature=False)
    assert len(same.joint) == 0
    assert same.path.n_pieces == 2


def test_a_trimmed_arc_stays_an_arc_and_gives_up_an_eighth_of_a_turn_at_most():
    path = line_then_arc(radius=5e-3, turned=0.3)
    blended = blend_corners(path, tolerance=np.inf)
    assert_allclose(blended.trim, 5e-3 * np.pi / 4, rtol=1e-12)
    assert_allclose(blended.path.curvature[-1], 200.0, rtol=1e-12)
    end = float(blended.path.length)
    assert_allclose(blended.path.position(end), path.position(0.04), atol=1e-15)


def test_reversals_and_the_seam_are_left_and_named():
    path = Path.polyline([[0, 0], [1, 0], [0.2, 0], [0.2, 1.0]])
    blended = blend_corners(path, tolerance=1e-5)
    assert blended.left.tolist() == [0]
    assert blended.reason == ("a reversal",)
    square = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1.0]], closed=True)
    blended = blend_corners(square, tolerance=1e-5)
    assert blended.joint.tolist() == [0, 1, 2]
    assert blended.reason == ("the seam of a closed path",)
    assert blended.path.closed
    # as a line into an arc that leaves backwards
    assert blend_corners(line_then_arc(turned=np.pi), tolerance=1e-5).reason == ("a reversal",)


def test_a_tolerance_below_rounding_is_named():
    blended = blend_corners(corner(90.0), tolerance=1e-13)
    assert blended.reason == ("no room on its pieces",)
    assert blended.path.n_pieces == 2


def test_joints_that_do_not_ask_are_left_alone():
    path = Path.polyline([[0, 0], [1, 0], [1, 1], [0, 1.0]], [7, 8, 9])
    blended = blend_corners(path, tolerance=[np.nan, 1e-5])
    assert blended.joint.tolist() == [1]
    assert blended.left.tolist() == []
    assert (
        np.asarray(blended.path.source_line).tolist() == np.array([7, 8, 9])[blended.piece].tolist()
    )
    for nothing in (np.nan, 0.0):
        assert blend_corners(path, tolerance=nothing).path.n_pieces == 3
    assert blend_corners(path, tolerance=1e-5, reach=0.0).path.n_pieces == 3
    bent = corner(np.degrees(5e-5))
    assert len(blend_corners(bent, tolerance=1e-9).joint) == 0
    assert len(blend_corners(bent, tolerance=1e-9, corner_angle=0.0).joint) == 1


def test_one_piece_has_no_joints():
    blended = blend_corners(Path.polyline([[0, 0], [1, 0.0]]), tolerance=1e-5)
    assert blended.path.n_pieces == 1
    assert blended.trim.shape == (0, 2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": -1e-6}, "tolerance must be >= 0 m, got -1e-06"),
        ({"tolerance": [1e-6, 1e-6]}, r"tolerance must be one number or of shape \(1,\)"),
        ({"tolerance": 1e-6, "reach": -1.0}, "reach must be >= 0 m, got -1"),
        ({"tolerance": 1e-6, "reach": np.nan}, "reach must be >= 0 m, got nan"),
    ],
)
def test_mistakes_are_named(options, words):
    with pytest.raises(GeometryError, match=words):
        blend_corners(corner(90.0), **options)


def test_a_bezier_piece_cut_at_both_ends_stays_on_its_curve():
    curve = Path.from_bezier([[[0.0, 0.0], [0.01, 0.0], [0.02, 0.002]]])
    assert curve.n_pieces == 1
    before = Path.polyline([[0.0, -0.01], [0.0, 0.0]])
    after = Path.polyline([[0.02, 0.002], [0.02, 0.02]])
    path = Path.join([before, curve, after])
    blended = blend_corners(path, tolerance=1e-4)
    row = np.flatnonzero((blended.piece == 1) & ~blended.is_blend)
    assert len(row) == 1
    start, end = np.asarray(blended.path.breaks)[[row[0], row[0] + 1]]
    old = 0.01 + blended.trim[0, 1]
    assert_allclose(end - start, float(curve.length) - blended.trim[0, 1] - blended.trim[1, 0])
    for at in np.linspace(0.0, end - start, 7):
        assert_allclose(blended.path.position(start + at), path.position(old + at), atol=1e-14)
