from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from contourlab.errors import OutputError
from contourlab.reports import write_figures
from contourlab.reports.canvas import draw_path, literal, new_figure
from contourlab.reports.drawing import make_drawing

NAMES = ["path.png", "contour_error.png", "tracking_error.png", "commands.png", "summary.png"]


def inked(file) -> float:
    """Return the share of pixels that are not white."""
    with Image.open(file) as image:
        return float(np.mean(np.asarray(image.convert("L")) < 250))


def test_the_figures_are_written(comparison, tmp_path):
    files = write_figures(comparison, tmp_path / "new")
    assert [file.name for file in files] == NAMES
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == sorted(NAMES)
    for file in files:
        assert file.read_bytes().startswith(b"\x89PNG")
        assert 0.01 < inked(file) < 0.6


def test_nothing_is_written_if_one_exists(comparison, tmp_path):
    (tmp_path / "summary.png").write_text("mine")
    with pytest.raises(OutputError, match=r"summary\.png exists already"):
        write_figures(comparison, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["summary.png"]
    write_figures(comparison, tmp_path, force=True)
    assert (tmp_path / "summary.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("n_coordinates", [3, 4])
def test_paths_in_space(made, tmp_path, n_coordinates):
    files = write_figures(made.spatial(n_coordinates), tmp_path)
    assert all(inked(file) > 0.01 for file in files)


def test_one_axis_alone_has_no_picture_of_a_path(made, tmp_path):
    files = write_figures(made.lone(), tmp_path)
    assert [file.name for file in files] == NAMES[1:]
    assert all(inked(file) > 0.01 for file in files)


def test_hostile_names_are_drawn_as_they_are(made, tmp_path):
    write_figures(made.hostile(), tmp_path)


def test_text_is_no_formula_and_never_too_long():
    assert literal("a_b $x$ \x1b[0m\u00a0µ") == "a_b \\$x\\$ ?[0m\u00a0µ"
    assert literal("x" * 200, 20) == "x" * 19 + "…"


def test_all_diverged(comparison, tmp_path):
    record = comparison.recordings["integral_sliding_mode"]
    lost = dataclasses.replace(comparison, recordings={"a": record, "b": record})
    assert all(inked(file) > 0.01 for file in write_figures(lost, tmp_path))


def test_logs_without_commands_have_no_command_figure(comparison, tmp_path):
    recordings = {
        name: type(r)(r.dataset.drop_vars(["command", "command_limit"]))
        for name, r in comparison.recordings.items()
    }
    files = write_figures(dataclasses.replace(comparison, recordings=recordings), tmp_path)
    assert "commands.png" not in [file.name for file in files]


@pytest.mark.parametrize("factor", [1.0, 200.0])
def test_the_factor_moves_what_is_drawn(comparison, factor):
    drawing = make_drawing(comparison, factor)
    axes = new_figure(5.0, 5.0).add_subplot()
    draw_path(axes, drawing)
    run = drawing.runs[0]
    curve = next(line for line in axes.lines if line.get_color() == run.look.light)
    recording = comparison.recordings["axis_pid"]
    worst = int(np.argmax(np.abs(np.asarray(recording["contour_error"]))))
    tool = np.asarray(recording["tool"])[worst]
    vector = np.asarray(recording["contour_error_vector"])[worst]
    x, y = np.asarray(curve.get_data())
    wanted = (tool + vector - factor * vector) * 1e3
    # roundings of millimetres
    assert np.hypot(x - wanted[0], y - wanted[1]).min() < 1e-9


def test_importing_reports_is_cheap():
    code = (
        "import sys, contourlab.reports; "
        "print([m for m in ('jax', 'matplotlib', 'plotly', 'jinja2', 'rich', 'xarray') "
        "if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_pyplot_is_left_alone(comparison, tmp_path):
    code = (
        "import sys\n"
        "from contourlab.reports.canvas import new_figure, write_png\n"
        "from pathlib import Path\n"
        f"write_png(new_figure(1.0, 1.0), Path({str(tmp_path / 'x.png')!r}), force=False)\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "False"
