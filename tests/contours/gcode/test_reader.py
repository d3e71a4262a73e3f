from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.gcode import read_gcode, read_gcode_text, reader, sources
from contourlab.errors import GcodeError

BRACKET = Path(__file__).parents[3] / "examples" / "bracket" / "bracket.ngc"


def write(folder: Path, data: bytes) -> Path:
    path = folder / "p.ngc"
    path.write_bytes(data)
    return path


def test_a_file(tmp_path: Path) -> None:
    path = write(tmp_path, b"\xef\xbb\xbfG0 X1 (M\xfcnchen)\r\nX2\r\n")
    part = read_gcode(path)
    assert part.source == str(path)
    assert part.lines == ("G0 X1 (M\ufffdnchen)", "X2")
    assert part.describe(1) == f"{path}:2: X2"


def test_options_reach_the_interpreter(tmp_path: Path) -> None:
    path = write(tmp_path, b"G0 X1\n/X2\n")
    part = read_gcode(
        path, axes=("X", "Y"), default_units="inch", block_delete=True, start=(0, 0.5, 0)
    )
    assert part.n_pieces == 1
    assert_allclose(part.path.position(0.0), [0, 0.5])
    assert_allclose(part.path.position(part.path.length), [0.0254, 0.5])


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"G0 X1\xff", "not ASCII"),
        (b"\x00\x01\x02", "begin with a letter"),
        ("G0 X1".encode("utf-16"), "not ASCII"),
        (b"\x7fELF", "begin with a letter"),
        (b"", "nothing moves"),
        (b"G21\n(no moves)\nM2\n", "nothing moves"),
    ],
)
def test_files_that_are_no_program(tmp_path: Path, data: bytes, says: str) -> None:
    path = write(tmp_path, data)
    with pytest.raises(GcodeError, match=says) as caught:
        read_gcode(path)
    assert caught.value.file == str(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(GcodeError, match="cannot be read: No such file"):
        read_gcode(tmp_path / "none.ngc")
    with pytest.raises(GcodeError, match="not a regular file"):
        read_gcode(tmp_path)
    with pytest.raises(GcodeError, match="not a regular file"):
        read_gcode("/dev/zero")
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    with pytest.raises(GcodeError, match="not a regular file"):
        read_gcode(fifo)
    with pytest.raises(GcodeError, match="cannot be read"):
        read_gcode("a\0b")


def test_large_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, b"G0 X1\n" * 10)
    monkeypatch.setattr(reader, "MOST_LINES", 9)
    with pytest.raises(GcodeError, match="more than 9 lines"):
        read_gcode(path)
    monkeypatch.setattr(sources, "LARGEST_FILE", 59)
    with pytest.raises(GcodeError, match="larger than"):
        read_gcode(path)


@pytest.mark.parametrize(
    "count", [5_000, pytest.param(100_000, marks=[pytest.mark.slow, pytest.mark.overnight])]
)
def test_many_lines(count: int) -> None:
    x = np.round(np.random.default_rng(1).uniform(-100, 100, (count // 2, 2)), 4)
    lines = ["G21 G90 G17 F3000"]
    for k, (a, b) in enumerate(x):
        lines += [f"N{k} G1 X{a} Y{b}", "G2 I5 J1 (a circle)"]
    part = read_gcode_text("\n".join(lines))
    assert part.n_pieces == count
    assert_allclose(part.path.position(part.path.length)[:2], x[-1] * 1e-3, atol=1e-9)


def test_the_bracket() -> None:
    part = read_gcode(BRACKET, axes=("X", "Y"))
    assert part.path.n_axes == 2
    assert part.n_pieces == 40
    assert not part.warnings
    assert {"M3", "M5"} <= set(part.ignored)
    assert part.largest_center_move < 1e-7  # the program has four decimals
    assert_allclose(part.feed[~part.rapid].max(), 0.05)
