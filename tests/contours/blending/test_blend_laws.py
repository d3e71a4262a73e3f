"""What holds for every blend: on random paths, judged by sampling and by invariance."""

import importlib.util
from pathlib import Path as FilePath

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours import Path, blend_corners
from contourlab.contours.blending.shape import handle_ratios

_SPEC = importlib.util.spec_from_file_location(
    "blend_judge", FilePath(__file__).with_name("blend_judge.py")
)
judge = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(judge)

CASES = [
    ("l", 2, 1e-5), ("l", 3, np.inf), ("la", 2, 1e-4), ("a", 3, 1e-6), ("lah", 3, 1e-3),
    ("lahb", 3, 1e-5), ("lab", 2, 1e-3), ("lahb", 3, np.inf), ("la", 5, 2e-5), ("la", 2, np.inf),
]  # fmt: skip


def check(path, tolerance, count=601):
    """Check everything that a blended path promises."""
    blended = blend_corners(path, tolerance=tolerance)
    joint, new = blended.joint, blended.path
    n = path.n_pieces
    # what asks is blended or left with a reason
    joints = path.joints()
    left, right = judge.two_sided(path, np.arange(n - 1))
    bend = np.maximum(*(np.linalg.norm(side[:, 2], axis=1) for side in (left, right)))
    asked = (joints.turning_angle > 1e-4) | (joints.curvature_jump > 2e-3 * bend + 1e-6)
    told = np.concatenate([joint, blended.left])
    assert set(np.flatnonzero(asked)) <= set(told.tolist())
    assert len(told) == len(np.unique(told))
    assert len(blended.reason) == len(blended.left)
    assert len(joint) > 0.9 * asked.sum(), blended.reason
    # nothing overlaps, the order is kept
    length = np.diff(path.breaks)
    used = np.zeros(n)
    np.add.at(used, joint, blended.trim[:, 0])
    np.add.at(used, joint + 1, blended.trim[:, 1])
    assert (used <= length * (1.0 + 1e-12)).all()
    assert (np.diff(blended.piece) >= 0).all()
    of_blend = blended.blend[blended.is_blend]
    assert (np.diff(of_blend) >= 0).all()
    assert np.array_equal(np.unique(of_blend), np.arange(len(joint)))
    assert np.array_equal(blended.piece[blended.is_blend], joint[of_blend] + 1)
    # both ends stay, and the path does not get longer
    ends = judge.derivatives(new, np.asarray(new.breaks)[[0, -1]], [0, new.n_pieces - 1])[:, 0]
    old = judge.derivatives(path, np.asarray(path.breaks)[[0, -1]], [0, n - 1])[:, 0]
    assert_allclose(ends, old, rtol=0, atol=1e-13)
    assert 0.5 * float(path.length) < float(new.length) < float(path.length) * (1.0 + 1e-9)
    # deviations: within tolerance, never below what sampling finds, and not much above it
    assert (blended.deviation <= tolerance).all()
    judged = judge.judged_deviations(path, blended, count)
    # the polyline that judges sags: short chords at the peak curvature
    breaks = np.asarray(new.breaks)
    rows = [np.flatnonzero(blended.blend == k) for k in range(len(joint))]
    first, last = breaks[[r[0] for r in rows]], breaks[[r[-1] + 1 for r in rows]]
    peak = judge.peak_curvatures(new, first, last)
    sag = ((last - first) / (count - 1)) ** 2 / 8.0 * peak
    assert (judged <= blended.deviation * (1.0 + 1e-9) + sag + 1e-13).all()
    assert (judged >= 0.97 * blended.deviation - sag - 1e-12).all()
    # position, tangent and curvature vector at both ends of every blend
    edges = np.concatenate([[r[0] - 1 for r in rows], [r[-1] for r in rows]])
    scale = np.concatenate([peak, peak])
    inside = (edges >= 0) & (edges < new.n_pieces - 1)
    edges, scale = edges[inside], scale[inside]
    left, right = judge.two_sided(new, edges)
    assert_allclose(left[:, 0], right[:, 0], rtol=0, atol=1e-13)
    kink = np.linalg.norm(left[:, 1] - right[:, 1], axis=1)
    jump = np.linalg.norm(left[:, 2] - right[:, 2], axis=1)
    # and what rounding of the coordinates makes of differences over the shorter handle
    handle = (1.0 - handle_ratios(joints.turning_angle[joint])[0]) * blended.trim.min(axis=1)
    # (of a blend, or of what is left of a Bézier piece)
    stub = np.where(np.asarray(new.bezier_row) >= 0, np.diff(breaks) / 5.0, np.inf)
    handle = np.where(blended.is_blend, handle[blended.blend], stub)
    shorter = np.minimum(handle[edges], handle[edges + 1])
    size = np.abs(np.asarray(path.origin)).max()
    assert (kink <= 1e-11 + 4e-15 * size / shorter).all()
    assert (jump <= 1e-9 * scale + 4e-15 * size / shorter**2).all()
    return blended, judged


@pytest.mark.parametrize(("kinds", "n_axes", "tolerance"), CASES)
def test_random_paths(kinds, n_axes, tolerance):
    rng = np.random.default_rng(len(kinds) * 10 + n_axes)
    check(judge.random_path(rng, 60, n_axes, kinds), tolerance)


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed",
    [k if k in (2, 7) else pytest.param(k, marks=pytest.mark.overnight) for k in range(8)],
)
def test_many_random_paths(seed):
    rng = np.random.default_rng(seed)
    kinds, n_axes, _ = CASES[seed]
    path = judge.random_path(rng, 500, n_axes, kinds)
    check(path, 10.0 ** rng.uniform(-6.5, -2.5))


@pytest.mark.parametrize("size", [1e-4, 1.0])
def test_small_and_large_parts(size):
    path = judge.random_path(np.random.default_rng(5), 40, 3, "lah", size=size)
    check(path, 0.01 * size)


def test_trims_turn_and_scale_and_reverse_with_the_path():
    rng = np.random.default_rng(11)
    path = judge.random_path(rng, 80, 3, "lah")
    plain = blend_corners(path, tolerance=1e-5)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    for factor, moved in ((1.0, lambda x: x @ turn.T), (7.0, lambda x: 7.0 * x)):
        other = blend_corners(judge.helical_moved(path, moved), tolerance=1e-5 * factor)
        assert np.array_equal(other.joint, plain.joint)
        assert_allclose(other.trim, factor * plain.trim, rtol=1e-6)
        assert_allclose(other.deviation, factor * plain.deviation, rtol=1e-5)
    back = blend_corners(judge.helical_reversed(path), tolerance=1e-5)
    assert np.array_equal(path.n_pieces - 2 - back.joint[::-1], plain.joint)
    assert_allclose(back.trim[::-1, ::-1], plain.trim, rtol=1e-6)
    assert_allclose(float(back.path.length), float(plain.path.length), rtol=1e-9)


def test_a_relief_of_short_lines_is_blended_row_for_row():
    x = np.arange(1001) * 2e-4
    points = np.stack([x, 1e-3 * np.sin(300 * x), 1e-3 * np.cos(200 * x)], axis=1)
    blended, judged = check(Path.polyline(points), 1e-5, count=61)
    assert blended.path.n_pieces < 1.5 * 1000
    assert blended.path.joints().turning_angle.max() < 1e-9
    assert judged.max() <= 1e-5
