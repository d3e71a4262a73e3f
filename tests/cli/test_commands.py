"""The program as a user runs it: files, tables, JSON, exit statuses."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from contourlab.recordings import Recording

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


def test_compare_writes_report_figures_and_recordings(folder):
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
    again = contourlab(folder, "compare", "s.toml", "--output", "out")
    assert again.returncode == 2
    assert "exists already" in again.stderr
    forced = contourlab(folder, "compare", "s.toml", "--output", "out", "--force")
    assert forced.returncode == 0, forced.stderr
    assert "slow" in forced.stdout


def test_compare_without_output_prints_a_table_and_writes_nothing(folder):
    before = sorted(folder.iterdir())
    run = contourlab(folder, "compare", "s.toml")
    assert run.returncode == 0, run.stderr
    assert "[um]" in run.stdout
    assert "fast" in run.stdout
    assert sorted(folder.iterdir()) == before


def test_simulate_one_of_several(folder):
    run = contourlab(folder, "simulate", "s.toml", "--json")
    assert run.returncode == 2
    assert "choose one with --controller: slow, fast" in run.stderr
    run = contourlab(
        folder, "simulate", "s.toml", "--controller", "slow", "--output", "r.csv", "--json"
    )
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout)
    assert result["schema"] == "contourlab.simulate/1"
    assert result["controller"] == "slow"
    assert (folder / "r.csv").read_text().startswith("time,")


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
def test_mistakes_give_one_sentence_status_2_and_no_files(folder, change, message):
    (folder / "s.toml").write_text(SCENARIO.replace(*change, 1))
    run = contourlab(folder, "compare", "s.toml", "--output", "out")
    assert run.returncode == 2, run.stderr
    assert message in run.stderr
    assert run.stderr.count("\n") == 1
    assert "Traceback" not in run.stderr
    assert not (folder / "out").exists()


def test_usage_and_version(folder):
    assert contourlab(folder, "--help").returncode == 0
    assert contourlab(folder, "--version").stdout.startswith("contourlab 0.")
    assert contourlab(folder, "compar").returncode == 2
    assert contourlab(folder, "compare", "none.toml").returncode == 2


def test_an_interrupt_leaves_nothing_half_written(folder):
    long = SCENARIO.replace('"2 ms"', '"0.02 ms"')
    (folder / "s.toml").write_text(long)
    process = subprocess.Popen(
        [sys.executable, "-m", "contourlab", "compare", "s.toml", "--output", "out"],
        cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        # a shell that runs the tests in the background has them ignore the signal
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    maps = Path(f"/proc/{process.pid}/maps")
    for _ in range(600):  # until the command is at work: it has loaded JAX
        if not maps.exists() or "jaxlib" in maps.read_text():
            break
        time.sleep(0.1)
    time.sleep(0.5)
    for _ in range(100):  # one that falls into a destructor is lost, as for a user
        process.send_signal(signal.SIGINT)
        try:
            _, errors = process.communicate(timeout=2.0)
            break
        except subprocess.TimeoutExpired:
            continue
    if process.returncode == 0:
        pytest.skip("the run was over before the interrupt came")
    assert process.returncode == 130, errors
    assert (
        not list(folder.rglob("*.html")) or (folder / "out" / "report.html").stat().st_size > 1000
    )
    assert not [p for p in folder.rglob(".*") if p.is_file()]
