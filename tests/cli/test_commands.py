"""The program as a user runs it: files, tables, JSON, exit statuses."""

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest

from contourlab import papers
from contourlab.export import find_compiler
from contourlab.papers import natural_local, natural_local_rows
from contourlab.recordings import Recording
from contourlab.reports import PaperFigure, Reproduction

from .interrupts import interrupted

SCENARIO = """
[part]
file = "part.ngc"
[machine]
name = "ball_screw_stage"
n_axes = 2
[[controller]]
name = "slow"
type = "cascade"
position_gain = 20
[[controller]]
name = "fast"
type = "cascade"
position_gain = 40
[simulation]
sample_time = "2 ms"
"""
PART = "G21 G90 G17\nG0 X10 Y10\nG1 X20 Y10 F3000\nG3 X25 Y15 I0 J5\nG1 Y20\nM2\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "s.toml").write_text(SCENARIO)
    (tmp_path / "part.ngc").write_text(PART)
    return tmp_path


def contourlab(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "contourlab", *arguments],
        capture_output=True, text=True, cwd=folder, timeout=300,
    )  # fmt: skip


def test_compare_writes_report_figures_and_recordings(folder, in_process):
    run = contourlab(folder, "compare", "s.toml", "--output", "out", "--json")
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout)
    assert result["schema"] == "contourlab.compare/1"
    assert [r["controller"] for r in result["runs"]] == ["slow", "fast"]
    rms = [r["metrics"]["contour_error_rms"] for r in result["runs"]]
    assert rms[1] < rms[0]
    assert len(result["runs"][0]["metrics"]["command_max"]) == 2
    assert result["runs"][0]["status"] == "normal"
    assert (folder / result["report"]).read_text().startswith("<!DOCTYPE html>")
    assert Recording.load(folder / "out" / "fast.nc").metrics["contour_error_rms"] == rms[1]
    assert list((folder / "out").glob("*.png"))
    status, _, errors = in_process("compare", "s.toml", "--output", "out")
    assert status == 2
    assert "exists already" in errors
    status, out, errors = in_process("compare", "s.toml", "--output", "out", "--force")
    assert status == 0, errors
    assert "slow" in out


def test_compare_without_output_prints_a_table_and_writes_nothing(folder, in_process):
    before = sorted(folder.iterdir())
    status, out, errors = in_process("compare", "s.toml")
    assert status == 0, errors
    assert "[um]" in out
    assert "fast" in out
    assert sorted(folder.iterdir()) == before


THREE = """
[[controller]]
name = "corners"
type = "first_order_task_frame"
bandwidth_hz = [15, 60]
"""


def test_a_law_that_is_refused_has_a_row_and_the_others_run(folder, in_process):
    (folder / "s.toml").write_text(SCENARIO.replace("[simulation]", f"{THREE}\n[simulation]"))
    status, out, errors = in_process("compare", "s.toml")
    assert status == 0, errors
    assert "corners refused: FirstOrderTaskFrame" in out
    assert "fast" in out
    status, _, errors = in_process("simulate", "s.toml", "--controller", "corners")
    assert status == 2
    assert "s.toml:16: controller[2]: FirstOrderTaskFrame" in errors
    start, end = SCENARIO.index("[[controller]]"), SCENARIO.index("[simulation]")
    (folder / "s.toml").write_text(SCENARIO[:start] + THREE + SCENARIO[end:])
    status, _, errors = in_process("compare", "s.toml")
    assert status == 2
    assert "s.toml:8: controller[0]: FirstOrderTaskFrame" in errors


def test_simulate_one_of_several(folder, in_process):
    status, _, errors = in_process("simulate", "s.toml", "--json")
    assert status == 2
    assert "choose one with --controller: slow, fast" in errors
    status, out, errors = in_process(
        "simulate", "s.toml", "--controller", "slow", "--output", "r.csv", "--json"
    )
    assert status == 0, errors
    result = json.loads(out)
    assert result["schema"] == "contourlab.simulate/1"
    assert result["controller"] == "slow"
    assert (folder / "r.csv").read_text().startswith("time,")


@pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler here")
def test_the_engine_of_the_scenario_and_of_the_command_line(folder, in_process):
    (folder / "s.toml").write_text(SCENARIO + 'engine = "c"\n')
    _, out, errors = in_process(
        "simulate", "s.toml", "--controller", "slow", "--output", "c.nc", "--json"
    )
    assert Recording.load(folder / "c.nc").dataset.attrs["engine"] == "c", errors
    rms = json.loads(out)["metrics"]["contour_error_rms"]
    _, out, errors = in_process(
        "simulate", "s.toml", "--controller", "slow", "--engine", "jax", "--output", "jax.nc",
        "--json",
    )  # fmt: skip
    assert Recording.load(folder / "jax.nc").dataset.attrs["engine"] == "jax", errors
    assert json.loads(out)["metrics"]["contour_error_rms"] == pytest.approx(rms, rel=1e-9)
    status, _, errors = in_process("compare", "s.toml", "--engine", "rust")
    assert status == 2
    assert "unknown engine 'rust'; Allowed: c, jax" in errors


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("position_gain = 20", "position_gian = 20"), "did you mean position_gain"),
        (("position_gain = 20", "position_gain = -20"), "position_gain must be >= 0"),
        (('type = "cascade"', 'type = "cascad"'), "did you mean cascade"),
        (('"2 ms"', '"2 mm"'), "unit 'mm' is not one of time"),
        (('"part.ngc"', '"other.ngc"'), "other.ngc"),
        (("n_axes = 2", "n_axes = 2\nset = { travel = ['0 mm', '15 mm'] }"), "travel of axis X"),
    ],
)  # fmt: skip
def test_mistakes_give_one_sentence_status_2_and_no_files(in_process, folder, change, message):
    (folder / "s.toml").write_text(SCENARIO.replace(*change, 1))
    status, _, errors = in_process("compare", "s.toml", "--output", "out")
    assert status == 2, errors
    assert message in errors
    assert errors.count("\n") == 1
    assert "Traceback" not in errors
    assert not (folder / "out").exists()


MACHINES = """
[[machine]]
label = "a"
name = "ball_screw_stage"
n_axes = 2
[[machine]]
label = "b c"
name = "ball_screw_stage"
n_axes = 2
computing_delay = "1 ms"
"""


def test_several_machines_and_values_that_vary(folder, in_process):
    start, end = SCENARIO.index("[machine]"), SCENARIO.index("[[controller]]")
    vary = '[vary]\nsamples = 3\n"machine.resolution" = { values = ["0 um", "1 um", "2 um"] }\n'
    (folder / "s.toml").write_text(SCENARIO[:start] + MACHINES + SCENARIO[end:] + vary)
    status, out, errors = in_process("compare", "s.toml", "--output", "out", "--json")
    assert status == 0, errors
    result = json.loads(out)
    assert [(r["machine"], r["controller"]) for r in result["runs"]] == [
        ("a", "slow"), ("a", "fast"), ("b c", "slow"), ("b c", "fast"),
    ]  # fmt: skip
    assert result["vary"]["samples"] == 3
    assert result["vary"]["changes"] == {"machine.resolution": "3 listed values"}
    for r in result["runs"]:
        rms = r["spread"]["metrics"]["contour_error_rms"]
        assert rms["p05"] <= rms["median"] <= rms["p95"] <= rms["worst"]
        assert set(rms["worst_values"]) == {"machine.resolution"}
        assert r["spread"]["diverged"] == 0
        assert r["corners"]["count"] >= 1
        assert set(r["corners"]["overshoot"]) == {"worst", "median", "line"}
    assert {p.name for p in (folder / "out").iterdir()} == {
        "report.html", "path.png", "contour_error.png", "tracking_error.png", "commands.png",
        "feed.png",
        "summary.png", "spread.png", "slow_on_a.nc", "fast_on_a.nc", "slow_on_b_c.nc",
        "fast_on_b_c.nc",
    }  # fmt: skip
    status, _, errors = in_process("simulate", "s.toml", "--controller", "slow", "--json")
    assert status == 2
    assert "choose one with --machine: a, b c" in errors
    status, out, errors = in_process(
        "simulate", "s.toml", "--machine", "b c", "--controller", "slow", "--json"
    )
    assert status == 0, errors
    single = json.loads(out)
    assert single["metrics"] == result["runs"][2]["metrics"]
    assert "[vary] is for compare" in single["warnings"][0]
    _, _, errors = in_process("simulate", "s.toml", "--machine", "a", "--controller", "slow")
    assert errors.count("warning: [vary] is for compare") == 1
    status, out, errors = in_process("compare", "s.toml")
    assert status == 0, errors
    assert "on b c" in out
    assert "3 samples: median [5 % .. 95 %] in um" in out


def test_recordings_never_share_a_file():
    from contourlab.cli.output import comparison_files
    from contourlab.errors import OutputError

    for names in (["a b", "a_b"], ["pid", "PID"]):
        with pytest.raises(OutputError, match="would both be written"):
            comparison_files(names)
    assert "spread.png" in comparison_files(["a"], vary=True)
    assert "spread.png" not in comparison_files(["a"])
    assert "feed.png" in comparison_files(["a"], planned=True)


def test_usage_and_version(folder, in_process):
    assert contourlab(folder, "--version").stdout.startswith("contourlab 0.")
    assert contourlab(folder, "compar").returncode == 2
    assert in_process("--help")[0] == 0
    assert in_process("compare", "none.toml")[0] == 2


def test_an_interrupt_leaves_nothing_half_written(folder):
    long = SCENARIO.replace('"2 ms"', '"0.02 ms"')
    (folder / "s.toml").write_text(long)
    status, errors = interrupted(folder, "compare", "s.toml", "--output", "out")
    if status == 0:
        pytest.skip("the run was over before the interrupt came")
    assert status == 130, errors
    assert (
        not list(folder.rglob("*.html")) or (folder / "out" / "report.html").stat().st_size > 1000
    )
    assert not [p for p in folder.rglob(".*") if p.is_file()]


def test_reproduce_refuses_an_unknown_paper_and_files_that_exist(folder, in_process):
    status, _, errors = in_process("reproduce", "natural-lokal")
    assert status == 2
    assert "did you mean natural-local?" in errors
    (folder / "natural_local_figure_5.png").write_text("mine")
    status, _, errors = in_process("reproduce", "natural-local", "--figures", ".")
    assert status == 2
    assert "exists already" in errors
    assert (folder / "natural_local_figure_5.png").read_text() == "mine"


def test_reproduce_prints_json(in_process, folder, monkeypatch):
    """With two of a paper's figures; its whole run is looked at in its own tests."""
    time = np.linspace(0.0, 1.0, 9)
    figure = PaperFigure(
        name="natural_local_figure_3", title="t", y_label="y", time=time, curves=(("a", time),)
    )

    def short(progress):
        progress("natural-local", 1.0)
        rows = tuple(natural_local_rows.speed_row(table) for table in natural_local_rows.TABLES)
        return Reproduction(
            paper="natural-local", title="title", rows=rows, figures=(figure,),
            assumed=("All is assumed.",),
        )  # fmt: skip

    paper = dataclasses.replace(natural_local.PAPER, figures=(figure.name,), run=short)
    monkeypatch.setattr(papers, "paper_named", {paper.slug: paper}.get)
    status, out, errors = in_process("reproduce", "natural-local", "--json", "--figures", "out")
    assert status == 0, errors
    result = json.loads(out)
    assert result["schema"] == "contourlab.reproduce/1"
    assert result["paper"] == "natural-local"
    assert [row["verdict"] for row in result["rows"]] == ["matched", "differs"]
    assert [file.name for file in (folder / "out").glob("*.png")] == [f"{figure.name}.png"]
    status, out, errors = in_process("reproduce", "natural-local")
    assert status == 0, errors
    assert "assumed: All is assumed." in out
