from __future__ import annotations

import pytest

from contourlab.contours.gcode.lexer import LONGEST_LINE, plain_words, strip_comments
from contourlab.contours.gcode.statements import read_statement
from contourlab.errors import GcodeError


def words(line: str) -> list[tuple[str, float]]:
    code = strip_comments(line)
    read = plain_words(code)
    if read is None:
        read_statement(code)
        raise AssertionError("a line of plain words was expected")
    return [(word.letter, word.value) for word in read]


def test_case_and_blanks_mean_nothing() -> None:
    assert words("g 1 x + 5.\tY-.25 z1 0 f1 00") == [
        ("G", 1.0), ("X", 5.0), ("Y", -0.25), ("Z", 10.0), ("F", 100.0),
    ]  # fmt: skip


def test_words_keep_their_text() -> None:
    assert [word.text for word in plain_words("g01x-1.50") or []] == ["g01", "x-1.50"]


@pytest.mark.parametrize(
    ("line", "kept"),
    [
        ("G1 X1 (to the left; slowly) Y2", "G1X1Y2"),
        ("G1 ; X1 (never closed", "G1"),
        ("(a)(b)G1(c)", "G1"),
        ("; Grüße", ""),
        ("(\x00\ufffd)", ""),
        ("", ""),
    ],
)
def test_comments(line: str, kept: str) -> None:
    assert strip_comments(line) == kept


@pytest.mark.parametrize(
    ("line", "word", "says"),
    [
        ("G1 X1 (open", "(", "not closed"),
        ("(a (b) c)", "(", "hold another"),
        ("G1 X1)", ")", "closes no comment"),
        ("G1\rX1", "", "carriage return"),
        ("X1\xa0Y1", "'\\xa0'", "not ASCII"),
        ("ı5", "'\\u0131'", "not ASCII"),
        ("X" + "1" * LONGEST_LINE, "", "at most 4096"),
        ("G1 X", "X", "a value is missing"),
        ("G1 XY2", "X", "a value is missing"),
        ("X.", "X.", "a value is missing"),
        ("X+-1", "X+-1", "one sign only"),
        ("X1.2.3", ".3", "begin with a letter"),
        ("X1 /Y2", "/", "block delete"),
        ("5X1", "5", "begin with a letter"),
        ("\x00", "\\x00", "begin with a letter"),
        ("X" + "9" * 400, "X" + "9" * 23 + "...", "too large"),
        ("XY" + "9" * 400, "X", "a value is missing"),
        ("Y" + "9" * 400 + "[1]", "Y" + "9" * 23 + "...", "too large"),
        ("#5=3 o1 if [1]", "o1", "only at the start"),
        ("G1 X=3", "X=3", "a value is missing"),
        ("#5", "#5", "= is missing"),
        ("X[1+2", "X[1+2", "not closed"),
        ("X#<a", "X#<", "not closed"),
        ("o1 foo", "o1foo", "needs one of sub"),
        ("G1 %", "%", "alone"),
    ],
)
def test_refusals(line: str, word: str, says: str) -> None:
    with pytest.raises(GcodeError, match=says) as caught:
        words(line)
    assert caught.value.word == word


@pytest.mark.parametrize("comment", ["(abort,stop)", "( ABORT , x)", ";py,print(1)", "(pyrun,x)",
                                     "(PYRELOAD)"])  # fmt: skip
def test_comments_that_do_something_are_refused(comment: str) -> None:
    with pytest.raises(GcodeError, match=r"stops the program|runs Python"):
        strip_comments(f"G0 X1 {comment}")


@pytest.mark.parametrize("comment", ["(MSG, x)", "(DEBUG,#1)", "(print,#<a>)", "(LOGOPEN,a.txt)"])
def test_messages_are_comments(comment: str) -> None:
    assert strip_comments(f"G0 {comment}X1") == "G0X1"


def test_an_exponent_is_a_letter() -> None:
    assert words("X1e2") == [("X", 1.0), ("E", 2.0)]
