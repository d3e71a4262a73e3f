"""Splines of programs against SciPy's B-splines and de Casteljau's construction."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from contourlab.contours.gcode import Interpretation, Interpreter, read_gcode_text
from contourlab.contours.gcode.splines import is_straight, nurbs_pieces
from contourlab.errors import GcodeError


def run(program: str, **options: Any) -> Interpretation:
    return Interpreter(name="a.ngc", **options).run(program.split("\n"))


def casteljau(control: np.ndarray, u: float) -> np.ndarray:
    while len(control) > 1:
        control = (1 - u) * control[:-1] + u * control[1:]
    return control[0, :-1] / control[0, -1]


@pytest.mark.parametrize("order", [3, 4, 5, 8])
def test_nurbs_pieces_are_the_curve_of_scipy(order: int) -> None:
    rng = np.random.default_rng(order)
    points, weights = rng.uniform(-1, 1, (11, 3)), rng.uniform(0.2, 5, 11)
    homogeneous = np.hstack([points * weights[:, None], weights[:, None]])
    spans = 11 - order + 1
    knots = np.concatenate([np.zeros(order - 1), np.arange(spans + 1), np.full(order - 1, spans)])
    judge = BSpline(knots, homogeneous, order - 1)
    pieces = nurbs_pieces(homogeneous, order)
    assert len(pieces) == spans
    for span, piece in enumerate(pieces):
        for u in (0.0, 0.2, 0.5, 0.9, 1.0):
            value = judge(span + u)
            assert_allclose(casteljau(piece, u), value[:3] / value[3], atol=1e-14)
    for before, after in pairwise(pieces):
        assert np.array_equal(before[-1], after[0])


def test_g5_is_the_cubic_as_it_stands() -> None:
    moves = run("F60 G0 X1 Y2 Z3\nG5 X10 Y0 I3 J4 P-5 Q6\nG5 X20 P1 Q2").moves
    assert list(moves.spline) == [-1, 0, 1]
    first, second = (curve[:, :3] * 1e3 for curve in moves.control_points)
    assert_allclose(first, [[1, 2, 3], [4, 6, 3], [5, 6, 3], [10, 0, 3]], atol=1e-13)
    assert_allclose(second, [[10, 0, 3], [15, -6, 3], [21, 2, 3], [20, 0, 3]], atol=1e-13)
    assert_allclose(moves.feed[1:], 0.001)


def test_quadratics_and_incremental_handles() -> None:
    moves = run("F60 G91 G0 X1 Y1\nG5.1 X2 Y0 I1 J3").moves
    assert_allclose(moves.control_points[0][:, :2] * 1e3, [[1, 1], [2, 4], [3, 1]], atol=1e-13)


def test_a_rotated_nurbs() -> None:
    program = "F60\nG10 L2 P1 X5 R90\nG5.2 X1 Y0 P2\nX1 Y1 P3\nX0 Y1 P1\nG5.3"
    moves = run(program).moves
    assert list(moves.source_line) == [6, 6]
    assert_allclose(moves.end[-1] * 1e3, [4, 0, 0], atol=1e-13)
    assert_allclose(moves.control_points[0][-1, 3], 2.5)  # the middle of 2 and 3


def test_straight_splines_are_lines() -> None:
    moves = run("F60 G5 X3 Y3 I0 J0 P0 Q0\nG5.1 X6 Y6 I1 J1\nG5 X0 Y0 I1 J0 P0 Q1").moves
    assert list(moves.spline) == [-1, -1, 0]
    assert is_straight(np.array([[0, 0, 1.0], [0, 0, 1], [1, 0, 1]]))
    assert not is_straight(np.array([[0, 0, 1.0], [2, 0, 1], [1, 0, 1]]))


@pytest.mark.parametrize(
    ("program", "line", "says"),
    [
        ("F1 G5 X1 Y1 I1 J1", 1, "needs P and Q"), ("F1 G5 X1 Y1 P1 Q1", 1, "first of a row of G5"),
        ("F1 G5 X1 Y1 I1 P1 Q1", 1, "needs I and J"), ("F1 G5.1 X1 Y1 J1", 1, "needs I and J"),
        ("F1 G5 X1 Z1 I1 J1 P1 Q1", 1, "no motion in Z"), ("F1 G18 G5.1 X1 I1 J1", 1, "XY"),
        ("G5 X1 I1 J1 P1 Q1", 1, "no feed"), ("G93 G5 X1 I1 J1 P1 Q1 F1", 1, "inverse time"),
        ("F1 G5 I1 J1 P1 Q1", 1, "needs its end"), ("G5.3", 1, "no G5.2 before"),
        ("F1 G5.2 X1 Y1 P1\nG5.3", 2, "needs 3 control points"),
        ("F1 G5.2 X1 P1", 1, "needs X and Y"), ("F1 G5.2 X1 Y1", 1, "needs its weight"),
        ("F1 G5.2 X1 Y1 P0", 1, "weight must be > 0"), ("F1 G5.2 P1 L40", 1, "within 1 to 12"),
        ("F1 G5.2 X1 Y1 P1\nG1 X5", 2, "only G5.2 may stand"),
        ("F1 G5.2 X1 Y1 P1\nG20", 2, "only G5.2 may stand"),
        ("F1 G5.2 X1 Y1 P1\nM2", 2, "not closed by G5.3"),
        ("F1 G5.2 X1 Y1 P1\n(end)", 2, "ends before the G5.3"),
        ("F1 G5.1 X1 Y1 I1 J1\nX5", 2, "in force"), ("F1 G5 X5 Y5 I0 J0 P1 Q0", 1, "no length"),
        ("F1 G5 X5 I1 J1 P1 Q1\nG1 X9\nG5 X12 P1 Q1", 3, "first of a row of G5"),
    ],
)  # fmt: skip
def test_splines_refused(program: str, line: int, says: str) -> None:
    with pytest.raises(GcodeError, match=says) as caught:
        run(program)
    assert caught.value.line == line


def test_a_cusp_is_refused_with_its_line() -> None:
    with pytest.raises(GcodeError, match="cusp") as caught:
        read_gcode_text("F1 G0 X1\nG5 X0 Y0 I-1 J1 P1 Q1", name="a.ngc", start=(0, 0, 0))
    assert (caught.value.file, caught.value.line) == ("a.ngc", 2)


def test_splines_travel_through_to_the_path() -> None:
    program = (
        "F60 G1 X1\nG5 X4 Y0 I1 J2 P-1 Q2\nG4 P2\nG3 X6 I1\nG5.2 X7 Y3 P2 L4\nX9 Y3 P1\n"
        "X9 Y0 P1\nX12 Y1 P.5\nG5.3\nG0 X0"
    )
    part = read_gcode_text(program, axes=("X", "Y"), name="a.ngc")
    path = part.path
    assert path.kinds == "mixed"
    assert list(dict.fromkeys(part.source_line.tolist())) == [1, 2, 4, 9, 10]
    assert len(part.feed) == len(part.merge) == part.n_pieces == path.n_pieces
    last_of_g5 = int(np.flatnonzero(part.source_line == 2)[-1])
    assert part.dwell[last_of_g5] == 2.0
    assert part.dwell.sum() == 2.0
    moves = run(program).moves
    s = np.linspace(0, float(path.length), 4001)
    places = np.asarray(jax.vmap(path.position)(s))
    for k in np.flatnonzero(moves.spline >= 0):
        place = casteljau(moves.control_points[moves.spline[k]][:, [0, 1, 3]], 0.37)
        gap = np.linalg.norm(places - place, axis=1).min()
        assert gap < float(path.length) / 8000  # half the spacing of the samples


def test_a_planar_contour_of_another_plane_has_no_splines() -> None:
    with pytest.raises(GcodeError, match="Y moves"):
        run("F1 G5 X5 Y5 I1 J1 P1 Q1", axes=("X", "Z"))
