"""Subprograms in other files: found beside the program, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from contourlab.contours.gcode import read_gcode, read_gcode_text, sources
from contourlab.errors import GcodeError

SUB = "(cut)\no<cut> sub\nG1 X#1 F60\nG1 Y#1\no<cut> endsub\n"


def program(folder: Path, text: str, **files: str) -> Path:
    for name, content in files.items():
        (folder / f"{name}.ngc").write_text(content)
    path = folder / "main.ngc"
    path.write_text(text)
    return path


def test_pieces_know_both_lines(tmp_path: Path) -> None:
    path = program(tmp_path, "G0 Z1\n\no<CUT> call [5]\nX9\n", cut=SUB)
    part = read_gcode(path)
    assert part.source_line.tolist() == [1, 3, 3, 4]
    assert part.file.tolist() == [0, 1, 1, 0]
    assert part.file_line.tolist() == [1, 3, 4, 4]
    assert part.files[1].name == str(tmp_path / "cut.ngc")
    assert part.describe(2) == f"{tmp_path / 'cut.ngc'}:4: G1 Y#1 (called at {path}:3)"
    assert part.describe(0) == f"{path}:1: G0 Z1"
    assert_allclose(part.path.position(part.path.length) * 1e3, [9, 5, 1], atol=1e-12)


def test_a_mistake_is_placed_in_its_file(tmp_path: Path) -> None:
    path = program(tmp_path, "o<cut> call [5]\n", cut=SUB.replace("Y#1", "Y#<oh>"))
    with pytest.raises(GcodeError, match="no value yet") as caught:
        read_gcode(path)
    assert (caught.value.file, caught.value.line) == (str(tmp_path / "cut.ngc"), 4)


@pytest.mark.parametrize("name", ["../cut", "/etc/cut", "a/b", "..", "a\\b", ".hidden", "a b\x00"])
def test_a_program_cannot_name_a_file_elsewhere(name: str, tmp_path: Path) -> None:
    (tmp_path / "cut.ngc").write_text(SUB)
    inner = tmp_path / "inner"
    inner.mkdir()
    path = program(inner, f"o<{name}> call\n")
    with pytest.raises(GcodeError, match="its name may have"):
        read_gcode(path)


def test_a_link_that_leads_out_is_refused(tmp_path: Path) -> None:
    (tmp_path / "secret.ngc").write_text(SUB)
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "cut.ngc").symlink_to(tmp_path / "secret.ngc")
    with pytest.raises(GcodeError, match="not in the folder"):
        read_gcode(program(inner, "o<cut> call [1]\n"))
    (inner / "dir.ngc").mkdir()
    with pytest.raises(GcodeError, match="regular file"):
        read_gcode(program(inner, "o<dir> call [1]\n"))


def test_text_without_a_folder_calls_no_file(tmp_path: Path) -> None:
    (tmp_path / "cut.ngc").write_text(SUB)
    with pytest.raises(GcodeError, match="no subprogram o<cut>"):
        read_gcode_text("o<cut> call [1]\n")
    assert read_gcode_text("o<cut> call [1]\n", folder=tmp_path).n_pieces == 2


def test_the_files_of_a_program_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = program(tmp_path, "o<cut> call [5]\n", cut=SUB)
    monkeypatch.setattr(sources, "LARGEST_FILE", 40)
    with pytest.raises(GcodeError, match="larger than"):
        read_gcode(path)
    monkeypatch.setattr(sources, "LARGEST_FILE", 1000)
    monkeypatch.setattr(sources, "MOST_FILES", 1)
    with pytest.raises(GcodeError, match="more than 1 files"):
        read_gcode(path)


def test_a_file_without_the_subprogram(tmp_path: Path) -> None:
    path = program(tmp_path, "G0 X1\no<cut> call\n", cut="o<other> sub\no<other> endsub\n")
    with pytest.raises(GcodeError, match="no subprogram o<cut>") as caught:
        read_gcode(path)
    assert (caught.value.file, caught.value.line) == (str(path), 2)
