from __future__ import annotations

import pytest

from contourlab.contours.gcode.lexer import LONGEST_LINE, read_value, read_words, strip_comments
from contourlab.errors import GcodeError


def words(line: str) -> list[tuple[str, float]]:
    return [(word.letter, word.value) for word in read_words(strip_comments(line))]


def test_case_and_blanks_mean_nothing() -> None:
    assert words("g 1 x + 5.\tY-.25 z1 0 f1 00") == [
        ("G", 1.0), ("X", 5.0), ("Y", -0.25), ("Z", 10.0), ("F", 100.0),
    ]  # fmt: skip


def test_words_keep_their_text() -> None:
    assert [word.text for word in read_words("g01x-1.50")] == ["g01", "x-1.50"]


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
        ("G1 X", "X", "needs a number"),
        ("G1 XY2", "X", "needs a number"),
        ("X.", "X.", "needs a number"),
        ("X+-1", "X+-1", "needs a number"),
        ("X1.2.3", ".3", "begin with a letter"),
        ("X1 /Y2", "/", "block delete"),
        ("5X1", "5", "begin with a letter"),
        ("\x00", "\\x00", "begin with a letter"),
        ("X" + "9" * 400, "X" + "9" * 23 + "...", "too large"),
        ("XY" + "9" * 400, "X", "needs a number"),
        ("Y" + "9" * 400 + "[1]", "Y" + "9" * 23 + "...", "too large"),
        ("X[1+2]", "X[1+2]", "expressions"),
        ("X#5", "X#5", "parameters"),
        ("#5=3", "#5=3", "parameters"),
        ("G1 X-[2]", "X-[2]", "needs a number"),
        ("@1 ^90", "@1^90", "polar"),
        ("M3 $1", "$1", "spindle numbers"),
        ("o100 sub", "o100sub", "o-words"),
        ("O100", "O100", "o-words"),
        ("o<hole> call", "o<hole>call", "o-words"),
        ("G1 %", "%", "alone"),
    ],
)
def test_refusals(line: str, word: str, says: str) -> None:
    with pytest.raises(GcodeError, match=says) as caught:
        words(line)
    assert caught.value.word == word


def test_both_ways_of_reading_agree() -> None:
    line = "N10G1X1.5Y-2.F.5"
    assert words(line) == [("N", 10.0), ("G", 1.0), ("X", 1.5), ("Y", -2.0), ("F", 0.5)]
    at, slow = 0, []
    while at < len(line):
        value, end = read_value(line, at + 1)
        slow.append((line[at], value))
        at = end
    assert slow == words(line)


def test_an_exponent_is_a_letter() -> None:
    assert words("X1e2") == [("X", 1.0), ("E", 2.0)]
