"""Coordinate systems by hand (LinuxCNC itself is asked in test_linuxcnc)."""

from __future__ import annotations

import math

import pytest
from numpy.testing import assert_allclose

from contourlab.contours.gcode import Interpreter
from contourlab.errors import GcodeError


def ends(program: str) -> list[list[float]]:
    return (Interpreter(name="a.ngc").run(program.split("\n")).moves.end * 1e3).tolist()


def test_a_rotated_system_turns_lines_and_arcs() -> None:
    program = "F1 G10 L2 P1 X1 Y2 R30\nG0 X10 Y0\nG3 X0 Y10 I-10\nG18 G2 X3 Z3 I3"
    moves = Interpreter().run(program.split("\n")).moves
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    assert_allclose(moves.end[0] * 1e3, [1 + 10 * c, 2 + 10 * s, 0], atol=1e-13)
    assert_allclose(moves.end[1] * 1e3, [1 - 10 * s, 2 + 10 * c, 0], atol=1e-13)
    assert_allclose(moves.center[1] * 1e3, [1, 2, 0], atol=1e-13)
    assert_allclose(moves.angle[1], math.pi / 2, rtol=1e-14)
    assert_allclose(moves.normal[1:], [[0, 0, 1], [-s, c, 0]], atol=1e-15)


def test_g92_g52_and_g53() -> None:
    assert_allclose(ends("G0 X5\nG92 X1 Y1\nX3\nG53 X2\nG92.2\nX1\nG92.3 X1\nG92.1\nX0"),
                    [[5, 0, 0], [7, 0, 0], [2, 0, 0], [1, 0, 0], [5, 0, 0], [0, 0, 0]])  # fmt: skip
    assert_allclose(ends("G0 X5\nG52 X10\nX1\nG52 X0\nX1"), [[5, 0, 0], [11, 0, 0], [1, 0, 0]])


def test_l20_gives_the_tool_its_coordinates() -> None:
    program = "G0 X5 Y6\nG10 L20 P2 X1 Y1\nG55 X2\nG10 L20 P0 Z3\nZ5\nG54 X0"
    assert_allclose(ends(program), [[5, 6, 0], [6, 6, 0], [6, 6, 2], [0, 6, 2]])


def test_tables_can_be_read_and_written() -> None:
    assert_allclose(ends("G10 L2 P3 X4.5 R10\nG0 X#5261 Y#5270\n#5241=7\nG55 X0"),
                    [[4.5, 10, 0], [7, 10, 0]])  # fmt: skip
    assert_allclose(ends("G20 G10 L2 P1 X1\nG0 X0 Y#5221"), [[25.4, 645.16, 0]])


def test_a_quarter_turn_is_exact() -> None:
    assert ends("G10 L2 P1 R-90\nG0 X3 Y1") == [[1.0, -3.0, 0.0]]


@pytest.mark.parametrize(
    ("program", "line", "word", "says"),
    [
        ("G10 L2 X1", 1, "G10", "needs P"), ("G10 L2 P10", 1, "P10", "from 0 to 9"),
        ("G10 L2 P1.5", 1, "P1.5", "whole number"), ("G10 L7 P1", 1, "L7", "L2 or L20"),
        ("G10 L1 P1", 1, "G10", "tool table"), ("G10 L20 P1 R5", 1, "R5", "cannot stand"),
        ("G92", 1, "G92", "axis word"), ("G52", 1, "G52", "axis word"),
        ("G53 G2 X1 R1 F1", 1, "G53", "G0 or G1"), ("G91 G0 G53 X1", 1, "G53", "not in G91"),
        ("G92 X1 G1", 1, "G1", "which takes axes"), ("G10 L2 P1 I1", 1, "I1", "nothing"),
        ("G92 X1\nG10 L2 P1 R5", 2, "P1", "loses the position"),
        ("#5221=99999999\nG55\nG54", 3, "", "farther than"),
        ("G10 L2 P1 X9000000\nG0 X9000000", 2, "", "farther than"),
    ],
)  # fmt: skip
def test_offsets_refused(program: str, line: int, word: str, says: str) -> None:
    with pytest.raises(GcodeError, match=says) as caught:
        ends(program)
    assert (caught.value.line, caught.value.word) == (line, word)
