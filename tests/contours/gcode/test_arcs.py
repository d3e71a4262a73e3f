"""Arc geometry in the plane against closed forms; lengths in metres."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contourlab.contours.gcode.arcs import (
    ArcPiece,
    arc_by_center,
    arc_by_radius,
    tolerances,
)
from contourlab.errors import GcodeError

MM = tolerances(inch=False)
INCH = tolerances(inch=True)


def turned(start: tuple[float, float], piece: ArcPiece) -> tuple[float, float]:
    """The start turned about the centre by the angle: an independent statement of the end."""
    x, y = start[0] - piece.center[0], start[1] - piece.center[1]
    c, s = math.cos(piece.angle), math.sin(piece.angle)
    return piece.center[0] + c * x - s * y, piece.center[1] + s * x + c * y


@pytest.mark.parametrize(("clockwise", "angle"), [(False, math.pi / 2), (True, -1.5 * math.pi)])
def test_quarter_and_its_complement(clockwise: bool, angle: float) -> None:
    pieces, moved = arc_by_center((0.01, 0.0), (0.0, 0.01), (0.0, 0.0), clockwise, 1, MM)
    (piece,) = pieces
    assert_allclose(piece.angle, angle, rtol=1e-15)
    assert_allclose(piece.center, (0.0, 0.0), atol=1e-18)
    assert moved < 1e-17


@pytest.mark.parametrize("turns", [1, 2, 7])
@pytest.mark.parametrize("clockwise", [False, True])
def test_full_circles_keep_the_programmed_centre(turns: int, clockwise: bool) -> None:
    pieces, moved = arc_by_center((1.0, 2.0), (1.0, 2.0), (0.5, 2.5), clockwise, turns, MM)
    sign = -1 if clockwise else 1
    assert pieces == [ArcPiece((0.5, 2.5), sign * 2 * math.pi * turns, (1.0, 2.0), 1.0)]
    assert moved == 0.0


def test_an_end_off_by_rounding_is_a_full_circle() -> None:
    pieces, _ = arc_by_center((0.3, 0.0), (0.1 + 0.2, 0.0), (0.2, 0.0), False, 1, MM)
    assert [piece.angle for piece in pieces] == [2 * math.pi]


def test_extra_turns() -> None:
    pieces, _ = arc_by_center((0.01, 0.0), (0.0, 0.01), (0.0, 0.0), True, 3, MM)
    assert_allclose(pieces[0].angle, -1.5 * math.pi - 4 * math.pi, rtol=1e-15)


@pytest.mark.parametrize(
    ("radius", "clockwise", "center", "angle"),
    [
        (0.01, False, (0.0, 0.0), math.pi / 2),
        (-0.01, False, (0.01, 0.01), 1.5 * math.pi),
        (0.01, True, (0.01, 0.01), -math.pi / 2),
        (-0.01, True, (0.0, 0.0), -1.5 * math.pi),
    ],
)
def test_the_four_arcs_of_a_radius(
    radius: float, clockwise: bool, center: tuple[float, float], angle: float
) -> None:
    piece = arc_by_radius((0.01, 0.0), (0.0, 0.01), radius, clockwise, 1, MM)
    assert_allclose(piece.center, center, atol=1e-17)  # rounding of 0.01
    assert_allclose(piece.angle, angle, rtol=1e-15)
    assert_allclose(
        arc_by_radius((0.01, 0.0), (0.0, 0.01), radius, clockwise, 2, MM).angle,
        angle + math.copysign(2 * math.pi, angle),
        rtol=1e-15,
    )


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_radius_a_little_short_is_stretched(clockwise: bool) -> None:
    piece = arc_by_radius((0.0, 0.0), (0.01, 0.0), 0.004999, clockwise, 1, MM)
    assert piece.center == (0.005, 0.0)
    assert abs(piece.angle) == math.pi


def test_a_radius_too_short() -> None:
    with pytest.raises(GcodeError, match=r"4\.998 mm is too small .* at least 5 mm"):
        arc_by_radius((0.0, 0.0), (0.01, 0.0), 0.004998, True, 1, MM)


def test_a_radius_needs_another_end() -> None:
    with pytest.raises(GcodeError, match="end away from its start"):
        arc_by_radius((0.1, 0.0), (0.1, 0.0), 0.01, True, 1, MM)


@pytest.mark.parametrize("radius", [0.0, -0.0, 1e-6])
def test_zero_radius(radius: float) -> None:
    with pytest.raises(GcodeError, match="radius of the arc is zero"):
        arc_by_radius((0.0, 0.0), (1e-6, 0.0), radius, True, 1, MM)
    with pytest.raises(GcodeError, match="radius of the arc is zero"):
        arc_by_center((0.0, 0.0), (1e-6, 0.0), (radius, 0.0), True, 1, MM)


@pytest.mark.parametrize(
    ("radius_mm", "difference_mm", "accepted"),
    [  # confirmed with rs274, which refuses the same
        (5.0, 0.028, True),
        (5.0, 0.029, False),
        (50.0, 0.049, True),
        (50.0, 0.0501, False),
        (5000.0, 2.8, True),
        (5000.0, 2.9, False),
    ],
)
def test_linuxcnc_tolerance(radius_mm: float, difference_mm: float, accepted: bool) -> None:
    start, center = (0.0, 0.0), (radius_mm * 1e-3, 0.0)
    end = ((2 * radius_mm + difference_mm) * 1e-3, 0.0)
    if accepted:
        _, moved = arc_by_center(start, end, center, True, 1, MM)
        assert_allclose(moved, difference_mm * 0.5e-3, rtol=0.01)
    else:
        with pytest.raises(GcodeError, match="differs from the radius to its start"):
            arc_by_center(start, end, center, True, 1, MM)


def test_the_tolerance_of_an_inch_program_is_wider() -> None:
    arguments = ((0.0, 0.0), (0.01006, 0.0), (0.005, 0.0), True, 1)
    with pytest.raises(GcodeError, match="differs"):
        arc_by_center(*arguments, MM)
    arc_by_center(*arguments, INCH)


def test_the_centre_moves_onto_the_bisector() -> None:
    start, end, center = (0.0, 0.0), (0.01, 0.01), (0.01001, 0.0)
    pieces, moved = arc_by_center(start, end, center, True, 1, MM)
    (piece,) = pieces
    to_start, to_end = math.dist(piece.center, start), math.dist(piece.center, end)
    assert_allclose(to_start, to_end, rtol=1e-15)
    assert_allclose(moved, math.dist(center, piece.center), rtol=1e-9)
    assert_allclose(moved, 1e-5 / math.sqrt(2), rtol=1e-9)


def test_a_long_arc_with_a_mismatch_is_two() -> None:
    """Nearly a full circle of 10 mm, its end 20 µm outside: one circle would be off by mm."""
    start, end, center = (0.01, 0.0), (0.01002, -0.0001), (0.0, 0.0)
    pieces, moved = arc_by_center(start, end, center, False, 1, MM)
    assert len(pieces) == 2
    assert moved < 2e-5
    place = start
    for piece in pieces:
        assert_allclose(turned(place, piece), piece.end, atol=1e-17)
        place = piece.end
    assert place == end
    assert_allclose(sum(piece.angle for piece in pieces), 2 * math.pi - 0.01, atol=2e-3)
    half_way = 0.5 * (0.01 + math.hypot(*end))  # along the spiral
    assert_allclose(math.hypot(*pieces[0].end), half_way, rtol=1e-12)
    assert_allclose(pieces[0].rise, 0.5, atol=1e-12)


def test_a_radial_chord_is_a_full_turn() -> None:
    pieces, moved = arc_by_center((0.01, 0.0), (0.01002, 0.0), (0.0, 0.0), False, 2, MM)
    assert_allclose(sum(piece.angle for piece in pieces), 4 * math.pi, atol=1e-5)
    assert moved < 2e-5


coordinate = st.floats(-1.0, 1.0)


@given(
    start=st.tuples(coordinate, coordinate),
    center=st.tuples(coordinate, coordinate),
    sweep=st.floats(1e-5, 2 * math.pi),
    mismatch=st.floats(-2.8e-5, 2.8e-5),
    clockwise=st.booleans(),
    turns=st.integers(1, 4),
)
def test_any_arc_by_its_centre(
    start: tuple[float, float], center: tuple[float, float], sweep: float, mismatch: float,
    clockwise: bool, turns: int,
) -> None:  # fmt: skip
    radius = math.dist(start, center)
    assume(radius > 1e-3)
    direction = math.atan2(start[1] - center[1], start[0] - center[0])
    direction += -sweep if clockwise else sweep
    end = (
        center[0] + (radius + mismatch) * math.cos(direction),
        center[1] + (radius + mismatch) * math.sin(direction),
    )
    pieces, moved = arc_by_center(start, end, center, clockwise, turns, MM)
    total = sum(abs(piece.angle) for piece in pieces)
    place = start
    for piece in pieces:
        assert (piece.angle < 0) == clockwise
        # the end is exact to rounding of the coordinates (1) times the angle
        assert_allclose(turned(place, piece), piece.end, atol=1e-14 * (1 + abs(piece.angle)))
        place = piece.end
    assert place == end
    turn = abs(total - sweep - 2 * math.pi * (turns - 1))
    chord = math.dist(start, end)
    assert turn < 4 * abs(mismatch) / max(chord, 1e-12) + 1e-5
    if len(pieces) == 2 or sweep > math.pi:
        assert moved <= max(1e-6, abs(mismatch)) * (1 + 1e-6)


@given(
    end=st.tuples(coordinate, coordinate),
    radius=st.floats(1e-3, 100.0),
    long_way=st.booleans(),
    clockwise=st.booleans(),
)
def test_any_arc_by_its_radius(
    end: tuple[float, float], radius: float, long_way: bool, clockwise: bool
) -> None:
    assume(1e-6 < math.hypot(*end) <= 2 * radius)
    start = (0.0, 0.0)
    piece = arc_by_radius(start, end, -radius if long_way else radius, clockwise, 1, MM)
    assert (piece.angle < 0) == clockwise
    assert (abs(piece.angle) > math.pi) == long_way or math.isclose(abs(piece.angle), math.pi)
    assert_allclose(math.dist(piece.center, start), radius, rtol=1e-9)
    assert_allclose(turned(start, piece), end, atol=1e-14 * radius + 1e-15)
