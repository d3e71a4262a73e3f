from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.machines import ball_screw_stage
from contourlab.reports.closeup import closeup
from contourlab.reports.drawing import FAR_WORSE, make_drawing
from contourlab.simulation import Comparison


def test_magnified_path_is_the_actual_one_at_factor_one_and_the_path_at_factor_zero(comparison):
    run = make_drawing(comparison).runs[0]
    tool = np.asarray(run.recording["tool"])
    # one rounding of positions below 0.1 m
    assert_allclose(run.drawn(1.0), tool, rtol=0, atol=1e-16)
    assert_allclose(run.drawn(0.0), np.asarray(comparison.reference.position), rtol=0, atol=1e-15)
    moved = np.linalg.norm(run.drawn(50.0) - run.foot, axis=1)
    # the foot point is subtracted again: roundings of 0.1 m against moves of mm
    assert_allclose(moved, 50.0 * np.abs(run.error), rtol=0, atol=1e-15)


def test_default_factor_is_round_and_shows_the_largest_deviation(comparison):
    drawing = make_drawing(comparison)
    assert drawing.magnification == 100.0  # 36 µm on 70 mm: 1/15 of it would be 131
    largest = max(run.metrics["contour_error_max"] for run in drawing.good)
    assert drawing.extent / 40 < drawing.magnification * largest <= drawing.extent / 15


def test_a_run_far_worse_than_the_best_decides_nothing(made):
    reference, _ = made.travel(made.bracket_path(), 0.2)
    recordings = {n: made.recording(reference, n, s) for n, s in (("a", 1e-5), ("b", 1e-3))}
    drawing = make_drawing(Comparison(recordings, reference, ball_screw_stage()))
    alone = make_drawing(Comparison({"a": recordings["a"]}, reference, ball_screw_stage()))
    assert drawing.runs[1].largest > FAR_WORSE * drawing.runs[0].largest
    assert drawing.magnification == alone.magnification
    assert [run.name for run in drawing.framed] == ["a"]
    assert [run.name for run in drawing.worst_first] == ["b", "a"]


def test_no_error_at_all_is_drawn_at_true_scale(made):
    reference, _ = made.travel(made.bracket_path(), 0.2)
    recording = made.recording(reference, "a", 1e-5)
    still = recording.dataset.copy()
    for name in ("contour_error", "contour_error_vector"):
        still[name] = still[name] * 0.0
    drawing = make_drawing(Comparison({"a": type(recording)(still)}, reference, ball_screw_stage()))
    assert drawing.magnification == 1.0
    assert closeup(drawing, drawing.runs[0]) is None


def test_diverged_run_is_cut_where_it_leaves_the_picture(comparison):
    drawing = make_drawing(comparison)
    lost = drawing.runs[2]
    framed = max(run.largest for run in drawing.good)
    assert lost.diverged
    assert lost.worst is None
    assert 0 < len(lost.time) < lost.recording.n_samples
    assert lost.largest <= 2.0 * framed


def test_source_lines_come_from_the_foot_point(comparison):
    drawing = make_drawing(comparison)
    run = drawing.runs[0]
    assert sorted(set(run.line)) == [7, 8, 9, 10, 11, 12, 13]
    # 60 mm of line 7, then the arc of line 8: 5 π mm
    assert run.line[np.searchsorted(run.distance, 0.0599)] == 7
    assert run.line[np.searchsorted(run.distance, 0.0601)] == 8
    assert drawing.where(run, 0) == "line 7: G1 X60 Y0"
    assert drawing.where(run, 0, text=False) == "line 7"


def test_stops_lie_on_the_corners(comparison):
    stops = make_drawing(comparison).stops
    corners = np.array([[70, 40], [40, 40], [0, 30]]) * 1e-3
    # the reference is sampled every millisecond and slow at a stop
    assert_allclose(stops.position, corners, rtol=0, atol=1e-9)
    assert stops.line.tolist() == [10, 11, 13]


def test_distance_on_a_formula_goes_on_over_the_seam(made):
    reference = made.circle()
    recording = made.recording(reference, "a", 1e-5)
    drawing = make_drawing(Comparison({"a": recording}, reference, ball_screw_stage()))
    # two laps of radius 20 mm; chords of 4001 points fall short by (π/4000)²/6
    assert_allclose(drawing.runs[0].distance[-1], 2 * 2 * np.pi * 0.02, rtol=1e-6)
    back = drawing.parameter(drawing.distance(np.array([0.1, 3.0, 7.0, 12.0])))
    assert_allclose(back, [0.1, 3.0, 7.0, 12.0], rtol=1e-12)
    assert drawing.runs[0].line.max() == 0
    assert drawing.where(drawing.runs[0], 0) == "0 mm along the path"


@pytest.mark.parametrize("factor", [0.0, -1.0, np.inf, np.nan])
def test_factor_must_be_positive(comparison, factor):
    with pytest.raises(ConfigurationError, match="magnification must be finite and > 0"):
        make_drawing(comparison, factor)


def test_nothing_to_draw(comparison):
    with pytest.raises(RecordingError, match="one recording or more"):
        make_drawing(dataclasses.replace(comparison, recordings={}))


def test_closeup_holds_tool_path_and_reference_at_true_scale(comparison):
    drawing = make_drawing(comparison)
    for run in drawing.good:
        near = closeup(drawing, run)
        assert near is not None
        # the window's centre is the foot point: the tool is the contour error away from it
        assert_allclose(np.linalg.norm(near.actual), run.metrics["contour_error_max"], rtol=1e-9)
        assert np.abs(near.actual).max() < near.half
        assert np.linalg.norm(near.path, axis=1).min() < 0.02 * near.half
        track = near.tracks[run.name]
        assert np.linalg.norm(track - near.actual, axis=1).min() < 0.3 * near.half
    assert closeup(drawing, drawing.runs[2]) is None


def test_closeup_in_space_looks_along_and_off_the_path(made):
    drawing = make_drawing(made.spatial())
    run = drawing.runs[0]
    near = closeup(drawing, run)
    assert near is not None
    assert near.axes == ("along the path", "off the path")
    assert_allclose(np.linalg.norm(near.actual), run.metrics["contour_error_max"], rtol=1e-9)
    assert near.actual[1] > 0.99 * np.linalg.norm(near.actual)
