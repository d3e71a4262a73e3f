from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contourlab.contours.gcode import Interpretation, Interpreter
from contourlab.contours.part import Ignored
from contourlab.errors import ConfigurationError, GcodeError

NAN = math.nan


def run(program: str, **options: object) -> Interpretation:
    return Interpreter(name="a.ngc", **options).run(program.split("\n"))  # type: ignore[arg-type]


def refused(program: str, line: int, word: str, says: str, **options: object) -> None:
    with pytest.raises(GcodeError, match=says) as caught:
        run(program, **options)
    error = caught.value
    assert (error.file, error.line, error.word) == ("a.ngc", line, word)
    assert str(error).startswith(f"a.ngc:{line}: ")


# -- lines, units, distance modes -----------------------------------------------------------------


def test_lines_and_rapids() -> None:
    moves = run("G21 G90\nG0 X10 Y5\nG1 Z-2 F300\nX20\nF600 Y0 (modal)").moves
    assert_array_equal(
        moves.end,
        [[0.01, 0.005, 0], [0.01, 0.005, -0.002], [0.02, 0.005, -0.002], [0.02, 0, -0.002]],
    )
    assert_array_equal(moves.start[1:], moves.end[:-1])
    assert_array_equal(moves.start[0], [0, 0, 0])
    assert_array_equal(moves.source_line, [2, 3, 4, 5])
    assert moves.source_line.dtype == np.int32
    assert_array_equal(moves.rapid, [True, False, False, False])
    assert_allclose(moves.feed, [NAN, 0.005, 0.005, 0.01], rtol=1e-15)
    assert_array_equal(moves.angle, 0.0)
    assert np.isnan(moves.center).all()


def test_ends_are_the_nearest_numbers_to_the_programs() -> None:
    """The quotient by 1000 is rounded once; a product with 0.001 would be rounded twice."""
    moves = run("G0 X3.1 Y12.3456\nG20 X0.1 Y1.2345").moves
    assert moves.end[0, 0] == 0.0031
    assert moves.end[0, 1] == 0.0123456
    assert_allclose(moves.end[1, :2], [0.00254, 0.0313563], rtol=2e-16)


def test_inches_and_default_units() -> None:
    program = "F60 G1 X1\nG20 X1\nG21 X1"
    assert_allclose(run(program).moves.end[:, 0], [0.001, 0.0254, 0.001])
    inch = run(program, default_units="inch").moves
    assert_allclose(inch.end[:, 0], [0.0254, 0.001])
    assert_allclose(inch.feed, 0.0254)
    assert len(inch) == 2  # the second line goes nowhere


def test_a_feed_keeps_its_meaning_when_the_units_change() -> None:
    assert_allclose(run("G21 F600 G1 X1\nG20 X1\nF60 X2").moves.feed, [0.01, 0.01, 0.0254])


def test_a_feed_in_the_line_of_a_change_of_units_is_in_the_old_ones() -> None:
    read = run("G20 G1 F600 X1")
    assert_allclose(read.moves.feed, [0.01])
    (warning,) = read.warnings
    assert "F600 at line 1" in warning
    assert "mm/min" in warning
    assert not run("G21 G1 F600 X1").warnings


def test_incremental_distances() -> None:
    moves = run("G91 G1 F100 X1 Y1\nX1\nG90 X5 Y5\nG91 X-1").moves
    assert_allclose(moves.end[:, :2] * 1e3, [[1, 1], [2, 1], [5, 5], [4, 5]])


def test_start() -> None:
    moves = run("G91 G0 X1", start=(0.1, 0.2, 0.3)).moves
    assert_allclose(moves.start, [[0.1, 0.2, 0.3]])
    assert_allclose(moves.end, [[0.101, 0.2, 0.3]])


def test_a_move_of_no_length_makes_no_piece() -> None:
    moves = run("F100 G1 X0\nX1\nX1 Y0\nG91 X0.1\nX0.2\nX-0.3\nG90 X1\nX2").moves
    assert_array_equal(moves.source_line, [2, 4, 5, 6, 8])


@pytest.mark.parametrize("value", ["fathom", "in"])
def test_units_are_mm_or_inch(value: str) -> None:
    with pytest.raises(ConfigurationError, match="default_units must be mm or inch"):
        Interpreter(default_units=value)


@pytest.mark.parametrize("start", [(0, 0), (0, 0, NAN), (0, 0, 2e4), (0, 0, 0, 0)])
def test_start_is_three_numbers(start: tuple[float, ...]) -> None:
    with pytest.raises(ConfigurationError, match="start must be three coordinates"):
        Interpreter(start=start)


# -- arcs -----------------------------------------------------------------------------------------

PLANES = {
    # word: first axis, second axis, normal axis, their letters
    "G17": (0, 1, 2, "XYZ", "IJ"),
    "G18": (2, 0, 1, "ZXY", "KI"),
    "G19": (1, 2, 0, "YZX", "JK"),
}


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("word", ["G2", "G3"])
@pytest.mark.parametrize("form", ["incremental", "absolute", "radius"])
def test_a_quarter_in_each_plane(plane: str, word: str, form: str) -> None:
    """From (10, 0) about the origin of the plane; G3 turns the first axis to the second."""
    _, second, normal, letters, centers = PLANES[plane]
    turn = 1.0 if word == "G3" else -1.0
    center = {
        "incremental": f"{centers[0]}-10 {centers[1]}0",
        "absolute": f"G90.1 {centers[0]}0 {centers[1]}0",
        "radius": "R10",
    }[form]
    end = f"{letters[0]}0 {letters[1]}{10 * turn} {letters[2]}3"
    moves = run(f"G0 {letters[0]}10\n{plane} {word} F100 {end} {center}").moves
    expected_end, expected_center, expected_normal = np.zeros((3, 3))
    expected_end[[second, normal]] = 0.01 * turn, 0.003
    expected_normal[normal] = 1.0
    assert_allclose(moves.end[1], expected_end, atol=1e-18)
    assert_allclose(moves.center[1], expected_center, atol=1e-17)
    assert_array_equal(moves.normal[1], expected_normal)
    assert_allclose(moves.angle[1], turn * math.pi / 2, rtol=1e-15)


def test_the_normals_are_right_handed() -> None:
    for first, second, normal, *_ in PLANES.values():
        axes = np.eye(3)
        assert_array_equal(np.cross(axes[first], axes[second]), axes[normal])


def test_arc_forms() -> None:
    moves = run(
        "F100 G2 X10 R-10\n"  # long way
        "X0 Y0 I-5 J0\n"  # modal, half a turn
        "I5\n"  # full circle, no axis word
        "G3 J5 P3\n"  # three full turns
        "I5 J0 X10 Y0 P2 Z4\n"  # a turn and a half, rising
    ).moves
    full = 2 * math.pi
    assert_allclose(moves.angle, [-full * 5 / 6, -full / 2, -full, 3 * full, 1.5 * full])
    assert_allclose(moves.center[3] * 1e3, [0, 5, 0], atol=1e-15)
    assert_allclose(moves.end[4] * 1e3, [10, 0, 4])
    assert_array_equal(moves.source_line, [1, 2, 3, 4, 5])


def test_a_mismatch_is_absorbed_and_reported() -> None:
    read = run("F100 G3 X10.005 Y10 I0 J10")
    moves = read.moves
    assert_allclose(moves.end[0], [0.010005, 0.01, 0], rtol=1e-15)
    radii = [math.dist(moves.center[0], p) for p in (moves.start[0], moves.end[0])]
    assert_allclose(radii[0], radii[1], rtol=1e-15)
    assert 1e-6 < read.largest_center_move < 5e-6
    assert_allclose(math.dist(moves.center[0], [0, 0.01, 0]), read.largest_center_move, rtol=1e-9)


def test_a_long_helix_with_a_mismatch_is_two_pieces_of_one_line() -> None:
    moves = run("F100 G3 X0.01 Y-0.2 I10 Z6 P2").moves
    assert_array_equal(moves.source_line, [1, 1])
    assert_array_equal(moves.end[0], moves.start[1])
    assert_array_equal(moves.end[1], [0.01 / 1000, -0.2 / 1000, 0.006])
    share = moves.angle[0] / moves.angle.sum()
    assert_allclose(moves.end[0, 2], 0.006 * share, rtol=1e-4)
    assert_array_equal(moves.center[:, 2], moves.start[:, 2])


ARC_REFUSALS = [
    ("G2 X1 F100", "G2", "centre .* or its radius"),
    ("G2 F100", "G2", "centre .* or its radius"),
    ("G3 X1 I1 R2 F100", "R2", "not both"),
    ("G2 X0 Y0 R5 F100", "G2", "end away from its start"),
    ("G2 Z1 R5 F100", "G2", "needs an end in the plane XY"),
    ("G2 X10 R4 F100", "G2", "too small"),
    ("G2 X1 R0 F100", "G2", "radius of the arc is zero"),
    ("G2 X1 I0 J0 F100", "G2", "radius of the arc is zero"),
    ("G2 X10.04 I5 F100", "G2", "differs from the radius to its start"),
    ("G2 X2 I1 K1 F100", "K1", "plane XY"),
    ("G18 G2 X2 I1 J1 F100", "J1", "plane ZX"),
    ("G19 G2 Y2 J1 I1 F100", "I1", "plane YZ"),
    ("G90.1 G2 X2 I1 F100", "G2", "J is missing"),
    ("G2 X2 I1", "G2", "no feed"),
    ("G2 X2 I1 F0", "G2", "no feed"),
    *[(f"G2 X2 I1 F1 P{p}", f"P{p}", "whole number from 1") for p in ("0", "-1", "1.5", "10001")],
]


@pytest.mark.parametrize(("line", "word", "says"), ARC_REFUSALS)
def test_arcs_refused(line: str, word: str, says: str) -> None:
    refused(f"G21\n{line}", 2, word, says)


def test_a_modal_arc_refused_names_the_mode() -> None:
    refused("G2 F100 X2 I1\nX5", 2, "G2", "centre")


# -- modes, dwells, words -------------------------------------------------------------------------


def test_path_control_is_kept_per_piece() -> None:
    read = run(
        "G1 F100 X1\nG64 X2\nG64 P0.1 X3\nG64 P0 X4\nG61 X5\nG20 G64 P0.1 Q.1\nX6\nG61.1 X7\nG64 X8"
    )
    inf = math.inf
    assert_allclose(read.moves.blend, [NAN, inf, 1e-4, inf, NAN, 0.00254, NAN, inf])
    assert_allclose(read.moves.merge, [NAN, NAN, 1e-4, NAN, NAN, 0.00254, NAN, NAN])
    assert_allclose(run("F1 G64 P1 Q.5 G1 X1\nG64 P1 Q0 X2\nG64 Q2 X3").moves.merge,
                    [5e-4, NAN, 2e-3])  # fmt: skip
    assert not read.warnings


def test_dwells_add_up_after_their_piece() -> None:
    moves = run("G4 P1\nG4 P.5 G0 X1\nG4 P2 X2\nG4P0.25\nG4P0.25").moves
    assert moves.dwell_before == 1.5
    assert_array_equal(moves.dwell, [2.0, 0.5])


def test_words_that_do_not_move_the_tool_are_listed_once() -> None:
    read = run("N1 T2 M6\nN2 S1000 M3\nS2000\nG97 G0 X1\nM5 M9\nM48\nM0\nM30")
    assert read.ignored == {
        "N": Ignored(1, 2), "M6": Ignored(1, 1), "T": Ignored(1, 1), "M3": Ignored(2, 1),
        "S": Ignored(2, 2), "G97": Ignored(4, 1), "M5": Ignored(5, 1), "M9": Ignored(5, 1),
        "M48": Ignored(6, 1), "M0": Ignored(7, 1),
    }  # fmt: skip


def test_words_that_change_nothing_are_accepted() -> None:
    read = run("G8 G17 G21 G40 G49 G54 G80 G90 G91.1 G92.1 G94 G98\nG0 X1")
    assert len(read.moves) == 1
    assert read.ignored == {"G98": Ignored(1, 1)}


@pytest.mark.parametrize("end", ["M2", "M30", "G0 X1 M2", "%"])
def test_the_end_of_the_program(end: str) -> None:
    moves = run(f"%\nG0 X1\n{end}\nX2\nnonsense #$&").moves
    assert len(moves) == 1


def test_percent_signs() -> None:
    assert len(run("\n%\nG0 X1\n").moves) == 1
    refused("G0 X1\n%\nG0 X2", 2, "%", "alone on the first line")
    refused("%1234", 1, "%", "alone")


def test_block_delete() -> None:
    program = "G0 X1\n /G0 Y1\n/ what is this"
    assert len(run(program, block_delete=True).moves) == 1
    refused(program, 3, "w", "a value is missing")
    refused("G0 X1 /Y2", 1, "/", "start of a line", block_delete=True)


LINE_REFUSALS = [
    ("X1", "X1", "no G0, G1, G2 or G3 is in force"),
    ("G4 P1 X1", "X1", "no G0, G1, G2 or G3 is in force"),
    ("G80 X1", "X1", "axis words cannot stand with G80"),
    ("G1 X1", "G1", "no feed is set"),
    ("G1", "G1", "no feed is set"),
    ("g1 f0 x1", "g1", "no feed is set"),
    ("F-1", "F-1", "feed must be >= 0"),
    ("F1000000000", "F1000000000", "too large"),
    ("G4", "G4", "needs its time"),
    ("G4 P-1", "P-1", "within 0 to 1e9 s"),
    ("G64 P-1", "P-1", "tolerance must be >= 0"),
    ("G64 Q-1", "Q-1", "tolerance must be >= 0"),
    ("G0 X1e2", "e2", "nothing in the line uses"),
    ("G1 F1 X1 I1", "I1", "nothing in the line uses"),
    ("R1", "R1", "nothing in the line uses"),
    ("P1", "P1", "nothing in the line uses"),
    ("Q1", "Q1", "nothing in the line uses"),
    ("G61 P1", "P1", "nothing in the line uses"),
    ("G0 H1", "H1", "nothing in the line uses"),
    ("G0 D1", "D1", "nothing in the line uses"),
    ("G0 L1", "L1", "nothing in the line uses"),
    ("M3 R1", "R1", "nothing in the line uses"),
    ("G4 P1 G2 F1 X1 R1", "P1", "two words of the line would use"),
    ("G64 P1 G2 F1 X1 R1", "P1", "two words of the line would use"),
    ("G64 P1 G4", "P1", "two words of the line would use"),
    ("G0 X10000001", "X10000001", "too large"),
    ("G28", "G28", "not read"),
    ("g43.1 z1", "g43.1", "not read"),
    ("G0 X#<a>", "X#<a>", "has no value yet"),
    ("o100 sub", "o100sub", "the end of o<100> is missing"),
]


@pytest.mark.parametrize(("line", "word", "says"), LINE_REFUSALS)
def test_lines_refused(line: str, word: str, says: str) -> None:
    refused(f"(header)\n\n{line}", 3, word, says)


def test_g80_ends_a_modal_motion() -> None:
    refused("G0 X1\nG80\nX2", 3, "X2", "in force")


def test_incremental_moves_cannot_run_away() -> None:
    refused("G91 G0 X9000000\nX9000000", 2, "", "farther than 10000 m")


def test_the_number_of_pieces_is_bounded() -> None:
    assert len(run("G0 X1\nX2\nX3", most_pieces=3).moves) == 3
    refused("G0 X1\nX2\nX3\nX4", 4, "", "more than 3 pieces", most_pieces=3)


# -- planar contours ------------------------------------------------------------------------------


def test_motion_outside_the_axes_is_refused() -> None:
    refused("G0 X1 Y1 Z0\nG0 Z5", 2, "Z5", "Z moves, .* X, Y only", axes=("X", "Y"))
    refused("G2 F1 X2 I1 Z.1", 1, "Z.1", "Z moves", axes=("X", "Y"))
    refused("G18 G2 F1 I1", 1, "G2", r"plane ZX \(G18\) leave X, Y", axes=("X", "Y"))
    refused("G0 X1", 1, "X1", "X moves", axes=("Y", "Z"))
    assert len(run("G18 G2 F1 I1", axes=("X", "Z")).moves) == 1


def test_words_that_name_the_place_are_no_motion() -> None:
    moves = run("G0 X1 Z300\nX2 Z300", axes=("X", "Y"), start=(0, 0, 0.1 + 0.2)).moves
    assert_array_equal(moves.end[:, 2], 0.1 + 0.2)


def test_a_program_without_moves() -> None:
    moves = run("(nothing)\nG21 M2").moves
    assert len(moves) == 0
    assert moves.start.shape == (0, 3)
