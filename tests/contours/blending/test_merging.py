"""Runs of lines merged: against a plain reading of the rule, and judged by distance."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Path, merge_lines
from contourlab.contours.blending.merging import MOST_SKIPPED
from contourlab.errors import GeometryError


def plain(points, tolerance, apart=()):
    """Return the first pieces of runs, point by point as LinuxCNC does it."""
    begin, chain, first = points[0], [], []
    for k, end in enumerate(points[1:]):
        fits = bool(chain) and len(chain) <= MOST_SKIPPED and k - 1 not in apart
        fits = fits and not np.array_equal(end, begin)
        if fits:
            line = end - begin
            for point in chain:
                t = np.clip(line @ (point - begin) / (line @ line), 0.0, 1.0)
                fits = fits and np.linalg.norm(point - begin - t * line) <= tolerance
        if not fits:
            if chain:
                begin = chain[-1]
            chain = []
            first.append(k)
        chain.append(end)
    return first


@pytest.mark.parametrize("n_axes", [2, 3, 4])
@pytest.mark.parametrize("noise", [1e-6, 1e-4])
def test_runs_are_those_of_the_plain_rule(n_axes, noise):
    rng = np.random.default_rng(n_axes)
    points = np.cumsum(rng.uniform(0.0, 1e-3, size=(400, n_axes)) * [1.0] + noise, axis=0)
    points += rng.normal(size=points.shape) * noise
    points[200:210, 0] = points[200, 0]  # back and forth
    apart = np.zeros(398, bool)
    apart[[50, 51, 300]] = True
    for tolerance in (1e-5, 1e-4, 1e-3):
        merged = merge_lines(Path.polyline(points), tolerance=tolerance, apart=apart)
        wanted = plain(points, tolerance, {50, 51, 300})
        assert merged.piece_first.tolist() == wanted
        assert merged.piece_last.tolist() == [*[k - 1 for k in wanted[1:]], 398]
        assert (merged.deviation <= tolerance).all()
        assert_allclose(merged.path.origin, points[wanted], rtol=0, atol=1e-15)


def test_a_straight_run_stops_after_a_hundred_points_skipped():
    points = np.stack([np.arange(301) * 1e-3, np.zeros(301)], axis=1)
    merged = merge_lines(Path.polyline(points, np.arange(1, 301)), tolerance=1e-6)
    assert merged.piece_first.tolist() == [0, 101, 202]
    # the line named is the last, as in LinuxCNC
    assert np.asarray(merged.path.source_line).tolist() == [101, 202, 300]
    assert merged.deviation.max() < 1e-15


def test_arcs_and_other_tolerances_end_a_run():
    line = Path.polyline([[0, 0], [1, 0], [2, 0], [3, 0.0]])
    arc = Path.from_helical([[3.0, 0.0]], [[1.0, 0.0]], [[0.0, 1.0]], [[0.0, 0.0]], [1.0], [np.pi])
    back = Path.polyline([[3, 2], [2, 2], [1, 2], [0, 2.0]])
    bend = Path.from_bezier([[[0, 2], [-1, 2], [-1, 3.0]]])
    path = Path.join([line, arc, back, bend])
    merged = merge_lines(path, tolerance=1e-3)
    assert merged.piece_first.tolist() == [0, 3, 4, *range(7, path.n_pieces)]
    assert_allclose(merged.path.length, path.length, rtol=1e-14)
    limit = np.full(path.n_pieces, 1e-3)
    limit[1] = 2e-3
    limit[5] = np.nan
    assert merge_lines(path, tolerance=limit).path.n_pieces == path.n_pieces
    for nothing in (0.0, np.nan):
        assert merge_lines(path, tolerance=nothing).path is path


def test_a_full_circle_of_chords_is_not_merged_to_a_point():
    angle = np.linspace(0.0, 2.0 * np.pi, 9)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[-1] = points[0]
    merged = merge_lines(Path.polyline(points), tolerance=10.0)
    assert merged.piece_first.tolist() == [0, 7]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": -1.0}, "tolerance must be >= 0 m and finite, got -1"),
        ({"tolerance": np.inf}, "tolerance must be >= 0 m and finite, got inf"),
        ({"tolerance": [1e-6]}, r"tolerance must be one number or of shape \(2,\), got \(1,\)"),
        ({"tolerance": 1e-6, "apart": [True, False, True]}, "apart must have one value"),
    ],
)
def test_mistakes_are_named(options, words):
    with pytest.raises(GeometryError, match=words):
        merge_lines(Path.polyline([[0, 0], [1, 0], [2, 0.0]]), **options)
