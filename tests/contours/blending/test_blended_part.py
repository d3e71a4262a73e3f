"""Parts merged and blended as their G64 asks: who decides at a joint, and what rows inherit."""

import dataclasses

import numpy as np
import pytest
from jaxtyping import Float
from numpy.testing import assert_allclose

from contourlab.contours import Part, Path, blend_part, joint_tolerance, merge_part
from contourlab.contours.blending.parts import _arrays
from contourlab.errors import GeometryError, PartError

ZIGZAG = np.array([[0, 0], [1, 0], [1, 1], [2, 1], [2, 2], [3, 2], [3, 3.0]]) * 0.01


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Merging(Part):
    """A part with the tolerance of G64 Q and one more array, as later parts may have."""

    merge: Float[np.ndarray, " n"]
    load: Float[np.ndarray, "n 2"]


def part(points=ZIGZAG, kind=Part, **changes):
    n = len(points) - 1
    fields = {
        "path": Path.polyline(points, np.arange(1, n + 1)),
        "axes": ("X", "Y"),
        "source": "zigzag.ngc",
        "lines": tuple(f"G1 ; {k}" for k in range(n)),
        "source_line": np.arange(1, n + 1, dtype=np.int32),
        "feed": np.full(n, 0.01),
        "rapid": np.zeros(n, bool),
        "blend": np.full(n, 1e-5),
        "dwell": np.zeros(n),
    }
    return kind(**(fields | changes))


def array(*values):
    return np.array(values, float)


def test_the_earlier_move_decides_whether_and_the_smaller_tolerance_how_far():
    nan, inf = np.nan, np.inf
    given = part(blend=array(1e-5, 2e-5, nan, 3e-5, inf, 1e-6))
    assert_allclose(joint_tolerance(given), [1e-5, 2e-5, nan, 3e-5, 1e-6])
    assert blend_part(given).blended.joint.tolist() == [0, 1, 3, 4]
    assert_allclose(blend_part(given).blended.deviation, [1e-5, 2e-5, 3e-5, 1e-6], rtol=1e-5)


def test_no_blend_over_a_dwell_nor_between_rapid_and_feed():
    rapid = np.array([True, True, False, False, False, False])
    feed = np.where(rapid, np.nan, array(0, 0, 0.01, 0.02, 0.03, 0.01))
    given = part(rapid=rapid, feed=feed, dwell=array(0, 0, 0, 0.5, 0, 0.25))
    new = blend_part(given)
    assert new.blended.joint.tolist() == [0, 2, 4]
    rows = new.blended.is_blend
    first = np.flatnonzero(rows & (np.diff(new.blended.blend, prepend=-1) > 0))
    assert_allclose(new.part.feed[first], [np.nan, 0.01, 0.01])
    assert new.part.rapid[first].tolist() == [True, False, False]
    # the dwells stay at the ends of their pieces
    waits = np.flatnonzero(new.part.dwell)
    assert new.piece[waits].tolist() == [3, 5]
    assert_allclose(new.part.dwell[waits], [0.5, 0.25])
    assert_allclose(np.asarray(new.part.path.breaks)[waits[1] + 1], new.part.path.length)
    corner = np.asarray(new.part.path.position(np.asarray(new.part.path.breaks)[waits[0] + 1]))
    assert_allclose(corner, ZIGZAG[4], atol=1e-15)


def test_all_arrays_follow_and_the_rest_stays():
    load = np.arange(12.0).reshape(6, 2)
    given = part(kind=Merging, merge=np.full(6, np.nan), load=load)
    known = {"source_line", "feed", "rapid", "blend", "dwell", "merge", "load"}
    assert known <= set(_arrays(given))
    new = blend_part(given)
    assert isinstance(new.part, Merging)
    assert new.part.path is new.blended.path
    for name, values in _arrays(new.part).items():
        assert len(values) == new.part.path.n_pieces, name
    assert_allclose(new.part.load, load[new.piece])
    assert new.part.source_line.tolist() == np.asarray(new.part.path.source_line).tolist()
    assert new.part.lines == given.lines
    assert new.merged is None
    assert new.n_blends == 5
    assert new.largest_deviation <= 1e-5
    assert new.largest_line in range(2, 7)


def test_every_array_of_a_part_is_found():
    given = part()
    arrays = {f.name for f in dataclasses.fields(Part) if "np.ndarray" in str(f.type)}
    assert set(_arrays(given)) == arrays


def test_without_tolerance_the_reach_decides():
    given = part(blend=np.full(6, np.inf))
    wide, near = blend_part(given), blend_part(given, reach=[1e-3, 2e-3, 1e-3, 1e-3, 1e-4])
    assert_allclose(wide.blended.trim[1:-1], 5e-3, rtol=1e-5)
    assert_allclose(near.blended.trim[:, 0], [1e-3, 2e-3, 1e-3, 1e-3, 1e-4], rtol=1e-9)
    assert near.largest_line == 3


def test_corners_that_stay_are_named_by_line():
    points = np.array([[0, 0], [1, 0], [0.5, 0], [0.5, 1.0]])
    new = blend_part(part(points, dwell=np.zeros(3)))
    assert new.left == ((2, "a reversal"),)


def test_merging_respects_feed_dwell_and_mode():
    points = np.stack([np.arange(13) * 1e-3, np.zeros(13)], axis=1)
    n = 12
    feed, blend, dwell = np.full(n, 0.01), np.full(n, 1e-5), np.zeros(n)
    feed[3:] = 0.02
    dwell[5] = 1.0
    blend[8] = np.nan
    load = np.zeros((n, 2))
    load[11:, 1] = 1.0
    given = part(
        points, kind=Merging, merge=np.full(n, 1e-5), load=load, feed=feed, blend=blend, dwell=dwell
    )
    short, merged = merge_part(given)
    assert merged.piece_first.tolist() == [0, 3, 6, 8, 9, 11]
    assert_allclose(short.dwell, [0, 1, 0, 0, 0, 0])
    assert short.source_line.tolist() == [3, 6, 8, 9, 11, 12]
    # merging again would add a second tolerance to the first
    assert merge_part(short)[1] is None
    new = blend_part(given)
    assert new.piece.tolist() == [2, 5, 7, 8, 10, 11]
    assert merge_part(part())[1] is None


def test_merged_lines_are_blended():
    angle = np.linspace(0.0, np.pi / 2, 31)
    points = 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    given = part(
        points, kind=Merging, merge=np.full(30, 1e-4), load=np.zeros((30, 2)),
        blend=np.full(30, 2e-5),
    )  # fmt: skip
    new = blend_part(given)
    assert new.merged.path.n_pieces < 30
    assert new.n_blends == new.merged.path.n_pieces - 1
    assert new.part.path.joints().turning_angle.max() < 1e-9


def test_mistakes_are_named():
    with pytest.raises(GeometryError, match=r"zigzag.ngc: reach must be >= 0 m, got -1"):
        blend_part(part(), reach=-1.0)
    with pytest.raises(PartError, match=r"zigzag.ngc: load must have 6 rows"):
        blend_part(part(kind=Merging, merge=np.full(6, np.nan), load=np.zeros((4, 2))))
