"""Values and parameters against a second reading in Python, and LinuxCNC's habits."""

from __future__ import annotations

import math
import operator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contourlab.contours.gcode import Interpreter
from contourlab.contours.gcode.expressions import read_value
from contourlab.contours.gcode.parameters import Parameters
from contourlab.errors import GcodeError


def value(code: str, **named: float) -> float:
    parameters = Parameters({}, {}, {"_tool": "the tool"})
    parameters.numbers.update({1: 3.0, 2: 1.0, 30: -2.5})
    parameters.call.update(named)
    result, end = read_value(code.replace(" ", ""), 0)
    assert end == len(code.replace(" ", ""))
    return result if isinstance(result, float) else result(parameters)


@pytest.mark.parametrize(
    ("code", "expected"),
    [  # printed by rs274
        ("[-2**2]", 4), ("[2**3**2]", 64), ("[10-3-2]", 5), ("[1+2*3 MOD 4]", 3),
        ("[1 LT 2+1]", 1), ("[1 OR 0 AND 0]", 0), ("[2 EQ 2.00009]", 1), ("[2 EQ 2.00011]", 0),
        ("[4 LE 3.99995]", 0), ("[2 NE 2.00009]", 0), ("ROUND[-2.5]", -3), ("FIX[-2.5]", -3),
        ("FUP[-2.5]", -2), ("ATAN[1]/[-1]", 135), ("-SIN[30]", -0.5), ("[5 MOD -3]", 2),
        ("[-5 MOD 3]", 1), ("[5--3]", 8), ("EXISTS[#<a>]", 1), ("EXISTS[#<b>]", 0),
        ("EXISTS[#5]", 1), ("EXISTS[#6000]", 0), ("##2", 3), ("#[#2+29]", -2.5), ("#<A>", 7),
        ("[1 XOR 2]", 0), ("[0 xor 2]", 1), ("ABS[-2]", 2), ("SQRT[LN[EXP[4]]]", 2),
        ("ACOS[0]", 90), ("ASIN[-1]", -90), ("TAN[45]", 1), ("COS[60]", 0.5), ("-#1", -3),
        ("-[#1+1]", -4), ("[0 GE -0]", 1), ("[2.00005 GT 2]", 1), ("[2 ** -1]", 0.5),
    ],
)  # fmt: skip
def test_values(code: str, expected: float) -> None:
    assert_allclose(value(code, a=7.0), expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("[1/0]", "division by zero"), ("[1/[#1-3]]", "division by zero"), ("[1 MOD 0]", "zero"),
        ("[-8**.5]", "not whole"), ("[0**-1]", "zero has no negative"), ("[9**999]", "too large"),
        ("EXP[1000]", "too large"), ("[1" + "0" * 200 + "*1" + "0" * 200 + "]", "too large"),
        ("LN[0]", "number > 0"), ("SQRT[-1]", "number >= 0"), ("ACOS[1.1]", "from -1 to 1"),
        ("ASIN[-2]", "from -1 to 1"), ("ATAN[1]", "two brackets"), ("#<b>", "has no value yet"),
        ("#5700", "from 1 to 5601"), ("#[0-1]", "from 1 to 5601"), ("#1.5", "whole number"),
        ("#5061", "probed"), ("#5399", "an input"), ("#5400", "the tool"), ("#5161", "stored"),
        ("#<_tool>", "the tool"), ("#<_ini[a]b>", "ini file"), ("#<_hal[a]>", "pins"),
        ("[1", "not closed"), ("[1 # 2]", "operator is missing"), ("[]", "value is missing"),
        ("[" * 60 + "1" + "]" * 60, "nest 50 deep"), ("#" * 60 + "1", "nest 50 deep"),
        ("EXISTS[1]", "takes a parameter"), ("#<>", "is empty"), ("#<a", "not closed"),
        ("SIN30", "value is missing"),
    ],
)  # fmt: skip
def test_values_refused(code: str, says: str) -> None:
    with pytest.raises(GcodeError, match=says):
        value(code)


OPERATORS: dict[str, tuple[int, Any]] = {
    "+": (1, operator.add), "-": (1, operator.sub), "*": (2, operator.mul),
    "LT": (0, operator.lt), "GT": (0, operator.gt), "LE": (0, operator.le),
}  # fmt: skip
numbers = st.integers(-99, 99)


@given(st.lists(st.tuples(st.sampled_from(sorted(OPERATORS)), numbers), max_size=8), numbers)
def test_precedence_by_a_second_reading(rest: list[tuple[str, int]], first: int) -> None:
    """Whole numbers, worked out by repeatedly folding the tightest operator from the left."""
    values, names = [float(first), *(float(v) for _, v in rest)], [name for name, _ in rest]
    code = "[" + str(first) + "".join(f"{name}{v}" for name, v in rest) + "]"
    while names:
        best = max(OPERATORS[name][0] for name in names)
        at = next(k for k, name in enumerate(names) if OPERATORS[name][0] == best)
        values[at : at + 2] = [float(OPERATORS[names.pop(at)][1](*values[at : at + 2]))]
    assert value(code) == values[0]


# -- parameters in programs -----------------------------------------------------------------------


def ends(program: str, **options: Any) -> list[list[float]]:
    moves = Interpreter(name="a.ngc", **options).run(program.split("\n")).moves
    return [[round(v * 1e3, 9) for v in end] for end in moves.end]


def test_assignments_take_effect_after_their_line() -> None:
    assert ends("#1=2 #2=[#1+4] G0 X#1 Y#2\nX#1 Y#2") == [[2, 4, 0]]
    assert ends("#3=6 #3=7\nG0 X#3") == [[7, 0, 0]]


def test_positions_and_modes_can_be_read() -> None:
    program = "G21 G0 X3.1 Y2\n#1=#5420 #<y>=#<_y>\nG20\nX#5420 Y[#<y>/25.4] Z[#<_imperial>]"
    assert ends(program)[1] == [3.1, 2, 25.4]
    assert ends("F100\nG0 X[#<_feed>] Y[#<_coord_system>] Z#5220") == [[100, 540, 1]]


def test_a_name_read_as_it_is_first_set_is_zero_and_warned_of() -> None:
    read = Interpreter().run(["#<a>=[#<a>+1]", "G0 X#<a>"])
    assert read.moves.end[0, 0] == 0.001
    assert "#<a> was read as 0" in read.warnings[0]


@pytest.mark.parametrize(
    ("line", "word", "says"),
    [
        ("#5420=1", "#5420=1", "read-only"), ("#<_x>=1", "#<_x>=1", "read-only"),
        ("#0=1", "#0=1", "from 1 to 5601"), ("G0 X[1/0]", "X[1/0]", "division by zero"),
        ("G0 X#<none> Y1", "X#<none>", "no value yet"), ("#<_ini[a]b>=1", "#<_ini[a]b>=1", "read-"),
        ("S[0-1]", "S[0-1]", ">= 0"), ("G[1/0]", "G[1/0]", "division"), ("G[11]", "G[11]", "known"),
        ("#<_rpm>=1", "#<_rpm>=1", "read-only"), ("#1=#<_rpm>", "#1=#<_rpm>", "the spindle"),
    ],
)  # fmt: skip
def test_lines_refused(line: str, word: str, says: str) -> None:
    with pytest.raises(GcodeError, match=says) as caught:
        ends(f"\n{line}")
    assert (caught.value.file, caught.value.line, caught.value.word) == ("a.ngc", 2, word)


def test_names_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contourlab.contours.gcode.parameters.MOST_NAMES", 5)
    with pytest.raises(GcodeError, match="more than 5 named parameters"):
        ends("\n".join(f"#<n{k}>=1" for k in range(6)))


def test_a_circle_by_expressions() -> None:
    program = ["o1 while [#1 LT 36]", "#1=[#1+1]", "G1 F9 X[5*COS[#1*10]] Y[5*SIN[#1*10]]",
               "o1 endwhile"]  # fmt: skip
    moves = Interpreter(start=(0.005, 0, 0)).run(program).moves
    expected = [[5 * math.cos(math.radians(10 * k)), 5 * math.sin(math.radians(10 * k)), 0]
                for k in range(1, 37)]  # fmt: skip
    assert_allclose(moves.end * 1e3, expected, atol=1e-12)
