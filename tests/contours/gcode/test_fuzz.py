"""Any bytes give a part or a GcodeError; any valid program goes where a second reading says."""

from __future__ import annotations

import math
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contourlab.contours.gcode import Interpreter, control, read_gcode_text
from contourlab.errors import GcodeError

UNTIMED = settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.too_slow])


def survives(text: str, **options: object) -> None:
    refusal, part = None, None
    try:
        part = read_gcode_text(text, name="f", **options)  # type: ignore[arg-type]
    except GcodeError as error:
        refusal = error
    if part is None:
        assert refusal is not None
        assert refusal.message
        assert str(refusal).startswith("f:")
        return
    assert part.n_pieces > 0
    assert np.isfinite(np.asarray(part.path.breaks)).all()


@UNTIMED
@given(st.binary(max_size=300))
def test_any_bytes(data: bytes) -> None:
    survives(data.decode("utf-8-sig", errors="replace"))


@UNTIMED
@given(st.text(max_size=200), st.sampled_from([("X", "Y"), ("X", "Y", "Z")]))
def test_any_text(text: str, axes: tuple[str, ...]) -> None:
    survives(text, axes=axes)


ALPHABET = "GMXYZIJKRFPQSTNGGGXYXY0123456789.-+ ;()%/\n\n[]#oO=<>$@^ABe"


@UNTIMED
@given(st.text(alphabet=ALPHABET, max_size=200))
def test_any_text_that_looks_like_a_program(text: str) -> None:
    survives("F100 G1\n" + text, block_delete=True)


numbers = st.one_of(
    st.integers(-20, 20).map(str),
    st.decimals(-100, 100, places=4).map(lambda value: format(value, "f")),
    st.sampled_from(["0", "-0", ".5", "1e5", "99999999999", "0.00000000000001", "9" * 400]),
)
MODES = "G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G61 G64 G80 G90 G91 G90.1 G91.1 G28 M3 M5 M30"
words = st.builds(
    lambda letter, number: letter + number, st.sampled_from("XYZIJKRPQFSTDH"), numbers
) | st.sampled_from(MODES.split())


@UNTIMED
@given(st.lists(st.lists(words, max_size=6).map(" ".join), max_size=12))
def test_any_lines_of_words(lines: list[str]) -> None:
    survives("\n".join(["G1 F1", *lines]))


PIECES = """\
o1 o2 o<a> sub endsub call return if elseif else endif while endwhile do repeat endrepeat break
continue [1] [0] [#1] [#1+1] [#1 LT 3] #1=[#1+1] #<a>=2 #<_b>=#1 #2=#<a> M98P1 M99 O1 G5 G5.1 G5.2
G5.3 I1 J2 P1 Q2 L3 X1 Y[#1] Z#1 G10 L2 L20 P0 R30 G92 G52 G53 G92.1 G92.3 G54 G59.3 G93 G94 F9 G1
G0 G2 M70 M71 M72 M73 @2 ^30 [ ] # < > SIN[#1] ATAN[1]/[2] EXISTS[#<a>] [1/0] (c) / [2**#1] N5 G64
% M2"""
pieces = st.sampled_from(PIECES.split())


@UNTIMED
@given(st.lists(st.lists(pieces, max_size=5).map(" ".join), max_size=14), st.booleans())
def test_any_lines_of_control(lines: list[str], block_delete: bool) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(control, "MOST_REPEATED", 2000)
        survives("\n".join(["G1 F1 X3", *lines]), block_delete=block_delete)


@UNTIMED
@given(st.lists(st.sampled_from(["[", "]", "-", "#", "1", "+", "**", "SIN[", "/", "<a>", "MOD"]),
                max_size=40).map("".join))  # fmt: skip
def test_any_expression(code: str) -> None:
    survives(f"G0 X1\n#<a>=2\nG0 X{code}")


def test_deep_nesting_is_no_traceback() -> None:
    for code in ("[" * 3000, "#" * 3000, "-" * 3000, "SIN[" * 900):
        survives(f"G0 X1\nX{code}1")


# -- valid programs, read a second time with exact decimals ---------------------------------------

coordinates = st.decimals(-50, 50, places=3)
Step = tuple[str, dict[str, Decimal]]


@st.composite
def steps(draw: st.DrawFn) -> Step:
    kind = draw(st.sampled_from(["G0", "G1", "", "G2", "G3", "G20", "G21", "G90", "G91"]))
    if kind in ("G20", "G21", "G90", "G91"):
        return kind, {}
    letters = draw(st.sets(st.sampled_from("XYZ"), min_size=1))
    return kind, {letter: draw(coordinates) for letter in sorted(letters)}


@UNTIMED
@given(st.lists(steps(), max_size=20))
def test_end_points_of_valid_programs(program: list[Step]) -> None:
    """Lines, rapids and circles (whose radius is chosen to reach the end) with every mode."""
    lines = ["G21 G90 G17 F100 G1"]
    place = {letter: Decimal(0) for letter in "XYZ"}  # mm
    scale, absolute, mode = Decimal(1), True, "G1"
    expected: list[list[float]] = []
    for kind, given_words in program:
        if kind in ("G20", "G21"):
            scale = Decimal("25.4") if kind == "G20" else Decimal(1)
        elif kind in ("G90", "G91"):
            absolute = kind == "G90"
        mode_before, mode = mode, kind if kind in ("G0", "G1", "G2", "G3") else mode
        if not given_words:
            lines.append(kind)
            continue
        before = dict(place)
        for letter, value in given_words.items():
            place[letter] = value * scale + (0 if absolute else place[letter])
        text = " ".join(f"{letter}{value:f}" for letter, value in given_words.items())
        if mode in ("G2", "G3"):
            chord = math.hypot(*(float(place[k] - before[k]) for k in "XY"))
            if chord < 0.01 or not {"X", "Y"} & set(given_words):
                place, mode = before, mode_before
                continue
            text += f" R{(0.75 * chord / float(scale)) + 0.001:.4f}"
        lines.append(f"{kind} {text}")
        if place != before:
            expected.append([float(place[letter]) * 1e-3 for letter in "XYZ"])
    moves = Interpreter().run(lines).moves
    assert len(moves) == len(expected)
    if expected:
        # 20 increments of up to 1.3 m: rounding of the running sum
        assert_allclose(moves.end, expected, rtol=1e-15, atol=1e-14)
        assert_allclose(moves.start[1:], moves.end[:-1], atol=0)
