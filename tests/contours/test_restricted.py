"""A stretch of a part as a part of its own."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.gcode import read_gcode_text
from contourlab.contours.part import Part
from contourlab.errors import ConfigurationError, PartError

PROGRAM = """\
G4 P1
G0 X5 Y5
G0 Z2
G1 Z-1 F60
X10
G5 X20 Y5 I2 J3 P-2 Q3
G4 P.5
G0 X21
G3 X25 I2
G0 Z2
G0 X0 Y0
"""


def part(text: str = PROGRAM) -> Part:
    return read_gcode_text(text, name="a.ngc")


def test_the_cut_in_its_plane() -> None:
    whole = part()
    cut = whole.restricted(plane="XY")
    assert cut.axes == ("X", "Y")
    assert sorted(set(cut.source_line.tolist())) == [5, 6, 8, 9]
    assert_allclose(np.asarray(cut.path.position(0.0)) * 1e3, [5, 5], atol=1e-14)
    assert_allclose(np.asarray(cut.path.position(cut.path.length)) * 1e3, [25, 5], atol=1e-12)
    kept = np.isin(whole.source_line, [5, 6, 8, 9])
    lengths = np.diff(np.asarray(whole.path.breaks))[kept]
    assert_allclose(np.diff(np.asarray(cut.path.breaks)), lengths, rtol=1e-13)
    for name in ("feed", "rapid", "blend", "merge", "dwell", "file", "file_line"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name)[kept])
    assert cut.dwell_before == 0.0
    assert cut.describe(0) == "a.ngc:5: X10"
    s = np.linspace(0, float(cut.path.length), 17)
    begin = float(np.asarray(whole.path.breaks)[int(np.argmax(kept))])
    places = np.asarray(jax.vmap(whole.path.position)(begin + s))
    assert_allclose(np.asarray(jax.vmap(cut.path.position)(s)), places[:, :2], atol=1e-15)


def test_lines_and_rapids() -> None:
    whole = part()
    cut = whole.restricted(lines=(2, 9))
    assert cut.axes == ("X", "Y", "Z")
    assert cut.dwell_before == 1.0
    assert set(cut.source_line.tolist()) == {2, 3, 4, 5, 6, 8, 9}
    trimmed = whole.restricted(feed_only=True)
    assert set(trimmed.source_line.tolist()) == {4, 5, 6, 8, 9}
    assert whole.restricted(lines=(5, 5)).path.kinds == "helical"
    assert whole.restricted(lines=(6, 6)).path.kinds == "bezier"
    assert whole.restricted().n_pieces == whole.n_pieces


def test_another_plane_and_order() -> None:
    whole = part("F60 G18 G1 X5\nG3 X5 Z4 K2 P1\nG1 Y3\nG0 Y0")
    cut = whole.restricted(plane="ZX", feed_only=True)
    assert cut.axes == ("Z", "X")
    assert set(cut.source_line.tolist()) == {1, 2}
    assert_allclose(np.asarray(cut.path.position(cut.path.length)) * 1e3, [4, 5], atol=1e-13)
    assert cut.restricted(plane="ZX").n_pieces == cut.n_pieces


DEPTHS = "F60 G1 X5 Y5\nG0 Z1\nX0 Y0\nG1 Z-1\nX5 Y5\nG0 Z1\n"


def test_several_depths_are_named() -> None:
    whole = part(DEPTHS)
    with pytest.raises(PartError, match=r"2 separate stretches, in lines 1 to 1, 5 to 5; choose"):
        whole.restricted(plane="XY")
    assert whole.restricted(plane="XY", lines=(3, 6)).source_line.tolist() == [5]


def test_lines_that_are_not_connected_are_named() -> None:
    whole = part("o1 sub\nG1 F60 X[#5420+1]\no1 endsub\no1 call\nG1 Y5\no1 call\nY9")
    assert whole.source_line.tolist() == [2, 5, 2, 7]
    with pytest.raises(PartError, match="2 separate stretches, in lines 2 to 2, 2 to 2"):
        whole.restricted(lines=(2, 2))


def test_nothing_left() -> None:
    whole = part()
    with pytest.raises(PartError, match="lines 20 to 30 move nothing"):
        whole.restricted(lines=(20, 30))
    with pytest.raises(PartError, match="nothing of the pieces asked for cuts"):
        whole.restricted(lines=(2, 3), feed_only=True)
    with pytest.raises(PartError, match="nothing cuts in the plane XY"):
        part("G0 X1\nG1 Z1 F1\nG0 X5").restricted(plane="XY")


@pytest.mark.parametrize("lines", [(0, 3), (5, 4), (1,), "ab"])
def test_lines_are_two_numbers(lines: tuple[int, int]) -> None:
    with pytest.raises((ConfigurationError, Exception), match=r"lines|type"):
        part().restricted(lines=lines)


@pytest.mark.parametrize("plane", ["X", "XX", "XA", "XYZ", ""])
def test_planes_are_two_axes_of_the_part(plane: str) -> None:
    with pytest.raises(ConfigurationError, match="plane must name two different ones"):
        part().restricted(plane=plane)
