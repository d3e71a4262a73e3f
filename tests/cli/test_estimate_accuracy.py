"""``contourlab estimate-accuracy`` as a user runs it."""

import json

import pandas as pd
import pytest

from contourlab.cli.output import accuracy_contours

from .interrupts import interrupted

PART = "G21 G90 G17\nG1 X20 Y0 F3000\nG3 X25 Y5 I0 J5\nG1 Y20\nM2\n"
FEW = ("--estimators", "tangent,osculating-circle", "--points", "20")


@pytest.fixture
def contourlab(in_process):
    return lambda *arguments: in_process("estimate-accuracy", *arguments)


def test_json_has_the_promised_rows(contourlab):
    status, out, errors = contourlab(
        "--contours", "ellipse,helix", "--lag", "0.5 mm,1 mm", "--offset", "10 um", "--json",
        "--estimators", "tangent,variable-gain", "--points", "20",
    )  # fmt: skip
    assert status == 0, errors
    found = json.loads(out)
    assert found["schema"] == "contourlab.estimate-accuracy/1"
    assert [(r["contour"], r["estimator"], r["lag"]) for r in found["rows"]] == [
        ("ellipse", "tangent", 5e-4), ("ellipse", "tangent", 1e-3),
        ("ellipse", "variable_gain", 5e-4), ("ellipse", "variable_gain", 1e-3),
        ("helix", "tangent", 5e-4), ("helix", "tangent", 1e-3),
        ("helix", "variable_gain", 5e-4), ("helix", "variable_gain", 1e-3),
    ]  # fmt: skip
    for row in found["rows"]:
        assert row["offset"] == pytest.approx(1e-5, rel=1e-15)
        figures = [row[name] for name in ("error_mean", "error_max", "cost_ns")]
        if row["contour"] == "helix" and row["estimator"] == "variable_gain":
            assert figures == [None] * 3
            assert "2 coordinates" in row["note"]
        else:
            assert 0.0 < figures[0] <= figures[1] < 1e-3
            assert figures[2] > 0.0
    assert [c["description"] for c in found["contours"]] == [
        "Ellipse(semi_axes=(0.03, 0.01))", "Helix(radius=0.03, pitch=0.1, turns=2)"
    ]  # fmt: skip


def test_files_and_tables(contourlab, tmp_path):
    (tmp_path / "part.ngc").write_text(PART)
    options = ("--part", "part.ngc", "--axes", "xy", "--lag", "0.2 mm,1 mm", *FEW)
    status, out, errors = contourlab(*options, "--output", "out")
    assert status == 0, errors
    assert "part: Path(" in out
    assert "1 mm" in out
    assert "osculating_circle" in out
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "accuracy.json", "accuracy.csv", "accuracy.png"
    }  # fmt: skip
    table = pd.read_csv(tmp_path / "out" / "accuracy.csv")
    rows = json.loads((tmp_path / "out" / "accuracy.json").read_text())["rows"]
    assert table.error_max.tolist() == [row["error_max"] for row in rows]
    # across the joints a circle that has ended, or not begun, is off by no more than κ lag² / 2
    assert table.error_max.max() <= 200.0 * 1e-3**2 / 2
    assert (tmp_path / "out" / "accuracy.png").read_bytes().startswith(b"\x89PNG")
    status, _, errors = contourlab(*options, "--output", "out")
    assert status == 2, errors
    assert "exists already" in errors
    status, out, errors = contourlab(*options, "--output", "out", "--force", "--json")
    assert status == 0, errors
    assert len(json.loads(out)["files"]) == 3


def test_points_and_drawings_are_parts_too(tmp_path):
    (tmp_path / "a.csv").write_text("x_mm,y_mm\n0,0\n30,0\n30,40\n")
    (tmp_path / "b.svg").write_text(
        '<svg width="100mm" height="50mm" viewBox="0 0 100 50"><path d="M0 0H70"/></svg>'
    )
    for file, axes in (("a.csv", None), ("b.svg", None), ("b.svg", "xz")):
        chosen = accuracy_contours("line", tmp_path / file, axes)
        assert list(chosen) == ["line", file[0]]
        assert float(chosen[file[0]].length) == pytest.approx(0.07, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--contours", "elipse"], "unknown contour 'elipse'; did you mean ellipse? Allowed: arc,"),
        (["--estimators", "circle"], "unknown estimator 'circle'"),
        (["--lag", "1"], "lag = '1': the unit is missing"),
        (["--lag", "-1 mm"], "lag must be >= 0 m and finite, got -0.001"),
        (["--lag", "nan mm"], "lag must be a length, got 'nan mm'"),
        (["--offset", "10 s"], "unit 's' is not one of length"),
        (["--feed", "3000"], "feed = '3000': the unit is missing"),
        (["--feed", "0 mm/min"], "feed must be > 0 m/s"),
        (["--resolution", "-1 um"], "resolution must be >= 0 m"),
        (["--sample-time", "1 mm"], "unit 'mm' is not one of time"),
        (["--points", "0"], "points must be a whole number from 2 to"),
        (["--contours", "helix", "--estimators", "variable-gain"], "nothing can be judged"),
        (["--part", "none.ngc"], "none.ngc"),
        (["--part", "p.ngc", "--axes", "XQ"], "axes must be two or three different ones"),
        (["--contours", "line", "--axes", "XY"], "axes go with a part, got 'XY' and no part"),
        (["--part", "p.csv"], "p.csv: the unit of the coordinates is not known"),
    ],
)
def test_mistakes_give_one_sentence_and_status_2(contourlab, tmp_path, arguments, message):
    (tmp_path / "p.ngc").write_text(PART)
    (tmp_path / "p.csv").write_text("0,0\n1,0\n")
    status, out, errors = contourlab(*arguments, "--output", "out", "--json")
    assert status == 2, errors
    assert message in errors
    assert errors.count("\n") == 1
    assert out == ""
    assert not (tmp_path / "out").exists()


def test_an_interrupt_leaves_no_file(tmp_path):
    status, errors = interrupted(
        tmp_path, "estimate-accuracy", "--output", "out", "--sample-time", "0.01 ms"
    )
    assert status == 130, errors
    assert not (tmp_path / "out").exists()
