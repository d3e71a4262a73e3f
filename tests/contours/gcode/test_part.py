"""Moves become rows of a path, and a part says where its pieces come from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contourlab.contours.gcode import Interpreter, read_gcode_text
from contourlab.contours.part import axis_columns, helical_rows, make_part
from contourlab.errors import ConfigurationError, PartError

PROGRAM = """\
G21 G90 F1200
G0 X5 Y1 Z2
G1 X15 Z-3
G17 G3 X15 Y11 Z-1 I0 J5
G2 X20 Y16 R-5
G18 G2 X25 Z4 I5 K0
G19 G3 Y20 Z8 J0 K4 P2
G3 J3
G17 G3 X25.011 Y20 I5 Z12 P3
"""


def points(rows: tuple[np.ndarray, ...], share: float) -> np.ndarray:
    """The formula of Path, written out for one share of every length."""
    start, u, v, w, rate, length, _ = rows
    s = share * length
    angle = rate * s
    safe = np.where(angle == 0, 1.0, angle)
    sinc = np.where(angle == 0, 1.0, np.sin(angle) / safe)
    cosc = np.where(angle == 0, 0.0, (1 - np.cos(angle)) / safe)
    return start + u * (s * sinc)[:, None] + v * (s * cosc)[:, None] + w * s[:, None]


def test_rows_of_a_mixed_program() -> None:
    moves = Interpreter().run(PROGRAM.split("\n")).moves
    rows = helical_rows(moves)
    start, u, v, w, rate, length, source_line = rows
    assert_array_equal(start, moves.start)
    assert_array_equal(source_line, moves.source_line)
    assert_allclose(np.sum(u * u + w * w, axis=1), 1.0, rtol=1e-14)
    assert_allclose(np.sum(u * v, axis=1), 0.0, atol=1e-15)
    # coordinates are up to 0.03 m, angles up to 19 rad: 1e-16 * 0.03 * 19 is the rounding
    assert_allclose(points(rows, 0.0), moves.start, atol=0)
    assert_allclose(points(rows, 1.0), moves.end, atol=2e-16)
    assert_allclose(rate * length, np.abs(moves.angle), rtol=1e-15)
    turning = moves.angle != 0
    for share in (0.25, 0.5, 0.9):  # on the circle, at the right angle, rising evenly
        place = points(rows, share)[turning]
        normal, center = moves.normal[turning], moves.center[turning]
        radial = place - center
        height = np.sum(radial * normal, axis=1)
        rise = np.sum((moves.end - moves.start)[turning] * normal, axis=1)
        assert_allclose(height, share * rise, atol=1e-17)
        radial = radial - height[:, None] * normal
        before = moves.start[turning] - center
        radius = np.linalg.norm(before, axis=1)
        assert_allclose(np.linalg.norm(radial, axis=1), radius, rtol=1e-13)
        angle = share * moves.angle[turning]
        sine = np.sum(np.cross(before, radial) * normal, axis=1) / radius**2
        assert_allclose(sine, np.sin(angle), atol=1e-13)
        assert_allclose(np.sum(before * radial, axis=1) / radius**2, np.cos(angle), atol=1e-13)


def test_the_length_of_a_helix() -> None:
    moves = Interpreter().run(["F1 G3 I10 Z5 P3"]).moves
    *_, length, _ = helical_rows(moves)
    assert_allclose(length, math.hypot(3 * 2 * math.pi * 0.01, 0.005), rtol=1e-15)


def test_the_path_of_a_part_goes_where_the_program_goes() -> None:
    part = read_gcode_text(PROGRAM, name="mixed.ngc")
    moves = Interpreter().run(PROGRAM.split("\n")).moves
    breaks = np.asarray(part.path.breaks)
    ends = [np.asarray(part.path.position(s)) for s in breaks[1:]]
    assert_allclose(ends, moves.end, atol=1e-15)
    assert_array_equal(part.path.source_line, moves.source_line)


def test_a_planar_part() -> None:
    part = read_gcode_text("G0 X10 Y20\nG3 F600 X0 I-5\nG4 P2\n", axes=("X", "Y"))
    assert part.path.n_axes == 2
    assert part.axes == ("X", "Y")
    assert_allclose(part.path.position(part.path.length), [0, 0.02], atol=1e-17)
    assert_allclose(part.feed, [np.nan, 0.01])
    assert_array_equal(part.rapid, [True, False])
    assert_array_equal(part.dwell, [0, 2])
    assert np.isnan(part.blend).all()
    assert part.n_pieces == 2


def test_the_order_of_the_axes_is_the_users() -> None:
    part = read_gcode_text("G18 G3 F1 Z5 X5 K0 I5", axes=("Z", "X"))
    assert_allclose(part.path.position(part.path.length) * 1e3, [5, 5], atol=1e-14)


def test_describe() -> None:
    part = read_gcode_text("G21\n\n  G0 X10 (here)\r\nY5", name="b.ngc")
    assert part.describe(0) == "b.ngc:3: G0 X10 (here)"
    assert part.describe(-1) == "b.ngc:4: Y5"
    for piece in (2, -3):
        with pytest.raises(PartError, match="piece must be within 0 to 1"):
            part.describe(piece)


@pytest.mark.parametrize("axes", [(), ("X",), ("X", "X"), ("X", "A"), ("XY", "Z"), "XYZX"])
def test_axes_are_two_or_three_of_xyz(axes: tuple[str, ...]) -> None:
    with pytest.raises(ConfigurationError, match="two or three different ones of X, Y, Z"):
        axis_columns(axes)


def test_moves_outside_the_axes_are_refused() -> None:
    moves = Interpreter().run(["G0 X1", "G0 Z1"]).moves
    with pytest.raises(PartError, match="a:2: moves in Z"):
        make_part(moves, axes=("X", "Y"), source="a", lines=())


def test_no_moves_no_part() -> None:
    with pytest.raises(PartError, match="a: nothing moves"):
        make_part(Interpreter().run([]).moves, axes=("X", "Y"), source="a", lines=())
