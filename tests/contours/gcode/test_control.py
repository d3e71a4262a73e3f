"""O-words: the order of lines, bounds and refusals (LinuxCNC itself is asked in test_linuxcnc)."""

from __future__ import annotations

from typing import Any

import pytest

from contourlab.contours.gcode import Interpretation, Interpreter, control, interpreter
from contourlab.contours.gcode.statements import read_statement
from contourlab.errors import GcodeError


def run(program: str, **options: Any) -> Interpretation:
    return Interpreter(name="a.ngc", **options).run(program.split("\n"))


def xs(program: str) -> list[float]:
    return [round(float(x) * 1e3, 9) for x in run(program).moves.end[:, 0]]


def refused(program: str, line: int, says: str) -> GcodeError:
    with pytest.raises(GcodeError, match=says) as caught:
        run(program)
    assert caught.value.line == line
    assert caught.value.file == "a.ngc"
    return caught.value


def test_branches() -> None:
    program = ("o1 while [#1 LT 4]\n#1=[#1+1]\no2 if [#1 EQ 1]\nG0 X10\no2 elseif [#1 EQ 2]\nX20\n"
               "nonsense\no2 else\nX30 Y#1\no2 endif\no1 endwhile")  # fmt: skip
    assert refused(program, 7, "value is missing").word == "n"
    assert xs(program.replace("nonsense\n", "")) == [10, 20, 30, 30]


def test_lines_that_are_skipped_may_hold_anything() -> None:
    assert xs("o1 if [0]\nG28 G41 nonsense #$& )(\no9 if [1/0]\no1 endif\nG0 X1") == [1]


def test_loops_leave_and_go_on() -> None:
    program = ("o1 while [1]\n#1=[#1+1]\no2 if [#1 EQ 2]\no1 continue\no2 endif\no3 if [#1 GT 4]\n"
               "o1 break\no3 endif\nG0 X#1\no1 endwhile\no4 repeat [2]\nX[#5420+1]\n"
               "o4 endrepeat")  # fmt: skip
    assert xs(program) == [1, 3, 4, 5, 6]


def test_subprograms() -> None:
    program = ("o<A b> sub\nG0 X#1 Y#2 Z#30\n#1=9 #31=5\no<ab> endsub [#1*2]\n#1=4\n"
               "o<ab> call [1] [2]\nX[#<_value>+#<_value_returned>]\nX[#1+#31]")  # fmt: skip
    assert xs(program) == [1, 19, 9]


def test_a_subprogram_further_down_and_names_of_a_call() -> None:
    program = "#<a>=1\no5 call [3]\nG0 X#<a>\nM2\no5 sub\n#<a>=#1 #<_g>=2\nG0 X[#<a>*2]\no5 endsub"
    assert xs(program) == [6, 1]
    assert list(run(program).moves.source_line) == [7, 3]


def test_computed_labels_and_block_delete() -> None:
    program = "o7 sub\nG0 X7\no7 endsub\n#1=6\n/o[#1+1] call\nN5 o[#1+1] call\nG0 X1"
    assert xs(program) == [7, 1]
    assert len(run(program, block_delete=True).moves) == 2
    assert len(run(program.replace("N5 ", "/"), block_delete=True).moves) == 1


def test_modal_state_is_saved_and_restored() -> None:
    program = ("G21 F60 G1 X1\no1 sub\nM73\nG20 G91 F9 G61\nG1 X1\no1 endsub\no1 call\nX30\nM70\n"
               "G91 G20\nM72\nX31\nM71")  # fmt: skip
    moves = run(program).moves
    assert [round(x * 1e3, 9) for x in moves.end[:, 0]] == [1, 26.4, 30, 31]
    assert [round(f * 6e4, 9) for f in moves.feed] == [60, 9, 60, 60]  # F is read before G20
    assert refused(program + "\nM72", 14, "nothing was saved").word == "M72"


def test_a_break_makes_the_next_do_loop_short_as_in_linuxcnc() -> None:
    program = "o1 while [1]\no1 break\no1 endwhile\no2 do\n#2=[#2+1]\nG0 X#2\no2 while [#2 LT 3]"
    assert xs(program) == [1]
    assert "ends at line 7" in run(program).warnings[0]


def test_calls_are_nine_deep() -> None:
    program = "o1 sub\no2 if [#1 GT 1]\no1 call [#1-1]\no2 endif\nG0 X#1\no1 endsub\no1 call [{}]"
    assert xs(program.format(9)) == [1, 2, 3, 4, 5, 6, 7, 8, 9]
    refused(program.format(10), 3, "9 deep")


@pytest.mark.parametrize(
    ("program", "line", "says"),
    [
        ("o1 while [1]\no1 endwhile", 2, "nothing in it changes anything"),
        ("o1 do\n(wait)\no1 while [1]", 3, "nothing in it changes anything"),
        ("o1 while [1]\no2 if [0]\n#1=1\no2 endif\no1 endwhile", 5, "nothing in it"),
        ("o1 while [1]\no1 continue\no1 endwhile", 3, "nothing in it changes anything"),
        ("o1 call", 1, "no subprogram o<1>"),
        ("G0 X1\no<x> call", 2, "no subprogram o<x>"),
        ("o1 sub\nG0 X1", 1, "end of o<1> is missing"),
        ("o1 if [0]", 1, "end of o<1> is missing"),
        ("o1 endwhile", 1, "without o<1> while before it"),
        ("o1 else", 1, "without o<1> if"),
        ("o1 repeat [2]\no1 break", 2, "without o<1> while or do"),
        ("o1 sub\no2 sub", 2, "inside another one"),
        ("o1 sub\no1 endsub\no1 sub", 3, "defined in line 1"),
        ("o1 if [1]\no1 endif\no1 while [1]", 3, "in use already, in line 1"),
        ("o1 return", 1, "stands in no subprogram"),
        ("M99", 1, "for ever"),
        ("o1 call [1] [2] x", 1, "does not belong behind call"),
        ("o1 if", 1, "needs its value"),
        ("o1 if [1] [2]", 1, "at most 1"),
        ("o1 call" + "[1]" * 31, 1, "at most 30"),
        ("o1 sub\nG0 X[1/0]\no1 endsub\no1 call", 2, "division by zero"),
        ("(here) o1 if [1]", 1, "comment stands before"),
        ("M98 X1", 1, "M98 takes P"),
        ("M98 P1 L-1", 1, ">= 0"),
    ],
)
def test_misuse(program: str, line: int, says: str) -> None:
    refused(program, line, says)


def test_an_endless_loop_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "MOST_REPEATED", 5000)
    refused("o1 while [1]\n#1=[#1+1]\no1 endwhile", 3, "has run 500[0-9] lines .* endless loop")
    refused("F1\no1 while [1]\nG91 G1 X1\nX-1\no1 endwhile", 5, "endless loop")


@pytest.mark.slow
@pytest.mark.overnight
def test_an_endless_loop_is_refused_at_the_bound_that_holds() -> None:
    """11 s on one idle core; the type checks of the test run take most of the time."""
    shown = f"has run {control.MOST_REPEATED // 10}[0-9] lines"
    refused("o1 while [1]\n#1=[#1+1]\no1 endwhile", 3, f"{shown} .* endless loop")


def test_the_bound_counts_lines_run_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "MOST_REPEATED", 100)
    assert len(run("\n".join(f"G0 X{k}" for k in range(1, 500))).moves) == 499
    refused("o1 sub\n#1=1\no1 endsub\no2 repeat [60]\no1 call\no2 endrepeat", 6, "endless loop")
    refused("M98 P1 L200\nM2\nO1\n#1=1\nM99", 5, "endless loop")


def test_lines_of_a_loop_are_parsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[str] = []
    monkeypatch.setattr(
        interpreter, "read_statement", lambda code: parsed.append(code) or read_statement(code)
    )
    program = ("o1 while [#1 LT 500]\n#1=[#1+1] #2=[10*SIN[#1]]\nG1 F9 X#2 Y[#1/[3+#2*#2]]\n"
               "o1 endwhile")  # fmt: skip
    assert len(run(program).moves) == 500
    assert len(parsed) == 4
