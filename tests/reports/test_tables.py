from __future__ import annotations

import dataclasses
import io
import json

import numpy as np
import pytest
from rich.console import Console

from contourlab.machines import ball_screw_stage
from contourlab.reports import comparison_json, print_table, run_json
from contourlab.reports.drawing import make_drawing
from contourlab.reports.wording import result_sentences, significant, table_columns
from contourlab.simulation import Comparison
from contourlab.units import to_um


def shown(comparison, width=100, encoding="ascii"):
    raw = io.BytesIO()
    text = io.TextIOWrapper(raw, encoding=encoding, newline="\n")
    print_table(Console(file=text, width=width, no_color=True), comparison)
    text.flush()
    return raw.getvalue().decode(encoding)


def test_table_prints_in_ascii_with_the_best_marked(comparison):
    text = shown(comparison)
    best = comparison.recordings["cross_coupled"].metrics["contour_error_rms"]
    (row,) = [line for line in text.splitlines() if "cross_coupled" in line]
    assert f"* {to_um(best)}" in row
    assert row.count("*") == 5
    (lost,) = [line for line in text.splitlines() if "integral_sliding_mode" in line]
    assert "diverged at 1.9 s on axis Y" in lost
    assert "*" not in lost
    assert "[um]" in text


def test_table_fits_eighty_columns(comparison):
    lines = shown(comparison, width=80).splitlines()
    assert max(map(len, lines)) <= 80
    assert any("integral_sliding_mode" in line for line in lines)


@pytest.mark.parametrize("width", [80, 40, 20])
def test_no_number_is_cut_however_narrow_the_terminal(made, width):
    """Long names, errors in mm, times, and a status of many words."""
    reference, _ = made.travel(made.bracket_path(), 0.2)
    names = ("integral_sliding_mode_of_the_2nd", "a name of many words that is long")
    recordings = {
        name: made.recording(reference, name, size, limit=1.0, diverged=diverged)
        for name, size, diverged in zip(names, (1.2345e-2, 2.3456e-3), (None, 1.9), strict=True)
    }
    comparison = Comparison(recordings, reference, ball_screw_stage())
    lines = shown(comparison, width=width).splitlines()
    assert width < 80 or max(map(len, lines)) <= 80
    columns = [c for c in table_columns(comparison) if not c.group.startswith("command")]
    numbers = [c.cells[0].text for c in columns if c.name != "cycle"]  # one cycle time for all
    assert numbers[0] == "4689"
    assert len(numbers) == 6
    (row,) = [line.split() for line in lines if "4689" in line]
    assert [word for word in row if word[0].isdigit()] == numbers
    assert "…" not in "".join(lines)
    # names over several lines, but all of them
    end = next(line.index("contour") for line in lines if "contour" in line)
    first = "".join(line[:end].strip("| ") for line in lines)
    assert names[0] in first
    assert names[1].replace(" ", "") in first.replace(" ", "")


def test_laws_that_were_refused_have_a_row_and_say_why(made):
    comparison = made.refused()
    text = shown(comparison, width=80)
    words = [line.replace("|", " ").split() for line in text.splitlines()]
    rows = [row for row in words if row and row[-1] in ("normal", "refused", "failed")]
    assert [row[0] for row in rows] == list(comparison.rows)
    assert rows[0][1:] == ["-"] * 5 + ["refused"]
    assert rows[3][1:] == ["-"] * 5 + ["failed"]
    assert "\nturning refused: turning <b>is for</b> lathes, which turn\n" in text
    assert "\nthreading failed: threading" in text
    runs = comparison_json(comparison)["runs"]
    assert [run["controller"] for run in runs] == list(comparison.rows)
    assert runs[0]["status"] == "refused: turning <b>is for</b> lathes, which turn"
    assert set(runs[1]["metrics"]) <= set(runs[0]["metrics"])
    assert set(runs[0]["metrics"].values()) == {None}
    assert result_sentences(make_drawing(comparison))[-2:] == [
        "turning was refused; the table says why.", "threading failed; the table says why.",
    ]  # fmt: skip


def test_equal_values_are_not_marked(made):
    reference, _ = made.travel(made.bracket_path(), 0.2)
    recordings = {n: made.recording(reference, n, 1e-5) for n in ("a", "b")}
    comparison = Comparison(recordings, reference, ball_screw_stage())
    assert not any(c.best for column in table_columns(comparison) for c in column.cells)
    assert "a and b keep the tool equally close" in result_sentences(make_drawing(comparison))[0]


def test_names_cannot_steer_the_terminal(made):
    reference, _ = made.travel(made.bracket_path(), 0.2)
    name = "[bold red]x\x1b[31m\nµ"
    comparison = Comparison(
        {name: made.recording(reference, name, 1e-5)}, reference, ball_screw_stage(), title=name
    )
    text = shown(comparison)
    assert "\x1b" not in text
    assert "[bold red]x?[31m?u" in text
    assert "*" not in text  # there is nothing to be best of


def test_json_is_strict_and_in_si(comparison):
    body = comparison_json(comparison, "out/report.html")
    assert json.loads(json.dumps(body, allow_nan=False)) == body
    assert body["schema"] == "contourlab.compare/1"
    assert body["report"] == "out/report.html"
    assert comparison_json(comparison)["report"] is None
    runs = {run["controller"]: run for run in body["runs"]}
    good, lost = runs["axis_pid"], runs["integral_sliding_mode"]
    assert (
        good["metrics"]["contour_error_rms"]
        == (comparison.recordings["axis_pid"].metrics["contour_error_rms"])
    )
    assert len(good["metrics"]["command_max"]) == 2
    assert lost["metrics"]["contour_error_rms"] is None
    assert lost["metrics"]["command_max"] == [None, None]
    assert lost["status"] == "diverged at 1.9 s on axis Y"
    assert "estimate_error_rms" in runs["cross_coupled"]["metrics"]
    assert "estimate_error_rms" not in good["metrics"]
    assert good["warnings"] == ["saturated during 3.1 % of the samples"]


def test_run_json_is_one_run(comparison):
    body = run_json(comparison.recordings["axis_pid"])
    assert body["schema"] == "contourlab.simulate/1"
    assert set(body) == {"schema", "controller", "metrics", "status", "warnings"}
    assert body["controller"] == "axis_pid"


def test_the_first_sentence_is_the_answer(comparison):
    first, *rest = result_sentences(make_drawing(comparison))
    metrics = comparison.recordings["cross_coupled"].metrics
    rms, most = (to_um(metrics[f"contour_error_{name}"]) for name in ("rms", "max"))
    assert first == (
        f"cross_coupled keeps the tool closest to the path: {rms}\u00a0µm rms, "
        f"{most}\u00a0µm at worst (line 11: G2 X30 Y30 I-10 J0)."
    )
    assert rest[-1] == "integral_sliding_mode diverged at 1.9 s on axis Y."


def only(comparison, *names):
    kept = {name: comparison.recordings[name] for name in names}
    return result_sentences(make_drawing(dataclasses.replace(comparison, recordings=kept)))


def test_sentences_of_one_controller_and_of_none_that_held(comparison):
    assert "keeps the tool within 35.6\u00a0µm of the path" in only(comparison, "axis_pid")[0]
    lost = only(comparison, "integral_sliding_mode")
    assert lost == ["integral_sliding_mode diverged at 1.9 s on axis Y: there are no figures."]
    left = only(comparison, "axis_pid", "integral_sliding_mode")
    assert "axis_pid is the only controller that did not diverge" in left[0]
    record = comparison.recordings["integral_sliding_mode"]
    both = dataclasses.replace(comparison, recordings={"a": record, "b": record})
    assert result_sentences(make_drawing(both))[0].startswith("All 2 controllers diverged")


def test_significant_digits():
    assert significant(0.012345, 3) == "0.0123"
    assert significant(1234.5, 3) == "1234"
    assert significant(np.nan, 3) == "–"
    assert significant(0.0, 3) == "0"
    assert significant(1e-9, 3) == "1.00e-09"
