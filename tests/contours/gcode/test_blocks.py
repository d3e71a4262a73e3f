from __future__ import annotations

import pytest

from contourlab.contours.gcode.blocks import Block
from contourlab.contours.gcode.lexer import plain_words as read_words
from contourlab.errors import GcodeError


def block(code: str) -> Block:
    return Block(read_words(code))


def test_words_of_different_groups_share_a_line() -> None:
    read = block("N1G0G17G21G40G49G54G61G80G90G91.1G94M3M8S100T1X1")
    assert {group: code for group, (code, _) in read.g.items()} == {
        "motion": 0, "plane": 170, "units": 210, "cutter compensation": 400, "tool length": 490,
        "coordinate system": 540, "path control": 610, "distance": 900, "arc distance": 911,
        "feed mode": 940,
    }  # fmt: skip
    assert read.values == {"S": 100.0, "T": 1.0, "X": 1.0}
    assert read.ignored == ["N", "M3", "M8"]


@pytest.mark.parametrize(
    ("code", "word"),
    [
        ("G0G1", "G1"), ("G1G1", "G1"), ("G2G3", "G3"), ("G17G18", "G18"), ("G20G21", "G21"),
        ("G90G91", "G91"), ("G90.1G91.1", "G91.1"), ("G61G64", "G64"), ("G61G61.1", "G61.1"),
        ("G80G80", "G80"), ("G4G4", "G4"), ("M3M5", "M5"), ("M0M2", "M2"), ("M7M8", "M8"),
        ("M48M49", "M49"), ("G4G53", "G53"), ("G10G92", "G92"), ("G92.1G92.2", "G92.2"),
        ("G54G55", "G55"), ("G93G94", "G94"), ("M70M72", "M72"), ("M3M73", "M73"),
    ],
)  # fmt: skip
def test_two_words_of_one_modal_group(code: str, word: str) -> None:
    with pytest.raises(GcodeError, match="same modal group") as caught:
        block(code)
    assert caught.value.word == word


@pytest.mark.parametrize("code", ["G1G80", "G80G1"])
def test_a_motion_word_wins_over_g80(code: str) -> None:
    assert block(code).g["motion"] == (10, "G1")


@pytest.mark.parametrize("letter", list("DEFHIJKLPQRSTXYZ"))
def test_a_letter_twice(letter: str) -> None:
    with pytest.raises(GcodeError, match=f"has {letter}1 already") as caught:
        block(f"{letter}1{letter}2")
    assert caught.value.word == f"{letter}2"


REFUSED = (
    "G6.2 G7 G17.1 G28 G28.1 G30 G30.1 G33 G33.1 G38.2 G38.3 G38.4 G38.5 G41 G41.1 G42 G42.1 "
    "G43.1 G43.2 G51 G70 G71 G72 G73 G74 G76 G81 G82 G83 G84 G85 G86 G87 G88 G89 G95 M98 M99 M100 "
    "M199 A1 B1 C1 U1 V1 W1"
)


@pytest.mark.parametrize("word", REFUSED.split())
def test_refused_by_name(word: str) -> None:
    with pytest.raises(GcodeError, match="not read") as caught:
        block(word)
    assert caught.value.word == word


@pytest.mark.parametrize(
    "word", ["G11", "G1.01", "G-1", "G99999999", "M10", "M3.5", "M-1", "M200", "G200"]
)
def test_unknown_g_and_m_words(word: str) -> None:
    with pytest.raises(GcodeError, match="word is not known") as caught:
        block(word)
    assert caught.value.word == word


def test_a_line_number_stands_at_the_start() -> None:
    with pytest.raises(GcodeError, match="only at the start") as caught:
        block("G1N5")
    assert caught.value.word == "N5"
    with pytest.raises(GcodeError, match=">= 0"):
        block("N-5")


@pytest.mark.parametrize("code", ["M2", "M30"])
def test_end_of_program(code: str) -> None:
    assert block(code).stop
    assert not block(code).ignored


def test_words_of_m_words() -> None:
    assert block("M67E1Q2").m_letters == "EQ"
    assert block("G96D200S100").m_letters == "D"
