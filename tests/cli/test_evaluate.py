"""``contourlab evaluate`` as a user runs it."""

import json

import numpy as np
import pytest

from contourlab.recordings import Recording

N = 1500


@pytest.fixture
def folder(tmp_path):
    x = np.linspace(0.0, 60.0, N)
    rows = np.column_stack([x, 0.5 * x, x, 0.5 * x + 0.010 * np.sin(x)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=";", comments="", fmt="%.5f",
               header="X_SetPosition;Y_SetPosition;X_ActualPosition;Y_ActualPosition")  # fmt: skip
    text = (tmp_path / "log.csv").read_text().replace(".", ",")
    (tmp_path / "log.csv").write_text(text)
    return tmp_path


def test_json_and_files(folder, in_process):
    status, out, errors = in_process(
        "evaluate", "log.csv", "--unit", "mm", "--sample-time", "1 ms", "--measured", "tool",
        "--output", "out", "--json",
    )  # fmt: skip
    assert status == 0, errors
    found = json.loads(out)
    assert found["schema"] == "contourlab.evaluate/1"
    # a wave of 10 um on Y, seen across a line that rises by one half
    largest = found["metrics"]["contour_error_max"]
    np.testing.assert_allclose(largest, 10e-6 * 2 / np.sqrt(5), rtol=1e-2)
    assert all(isinstance(text, str) for text in found["warnings"])
    assert {"name", "rms", "max", "share", "remedy", "state"} <= set(found["causes"][0])
    assert found["columns"][0]["column"] == "X_SetPosition"
    assert not found["columns"][0]["column_stated"]
    assert (folder / found["report"]).read_text().startswith("<!DOCTYPE html>")
    kept = np.asarray(Recording.load(folder / "out" / "evaluated.nc")["contour_error"])
    np.testing.assert_allclose(np.nanmax(np.abs(kept)), largest, rtol=1e-12)
    status, _, errors = in_process("evaluate", "log.csv", "--output", "out")
    assert status == 2
    assert "exists already" in errors


def test_tables_show_what_was_guessed(folder, in_process):
    status, out, errors = in_process("evaluate", "log.csv")
    assert status == 0, errors
    for words in ("X_ActualPosition", "guessed", "contour error, largest", "Worst places"):
        assert words in out
    assert "warning: the unit of the positions is not stated: taken for mm" in errors
    assert "neither a column of time nor a sample time" in errors


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--commanded", "X_SetPositon,Y_SetPosition"], "did you mean X_SetPosition?"),
        (["--unit", "litre"], "unit must be a unit of length"),
        (["--sample-time", "10"], "the unit is missing"),
        (["--measured", "table"], "Allowed: motor, scale, tool"),
        (["--contour", "missing.ngc"], "missing.ngc"),
        (["--path", "curve"], "Allowed: polyline, spline"),
    ],
)
def test_mistakes_give_one_sentence_and_status_2(folder, in_process, arguments, message):
    status, _, errors = in_process("evaluate", "log.csv", *arguments)
    assert status == 2
    assert message in errors
    assert errors.count("\n") == 1
