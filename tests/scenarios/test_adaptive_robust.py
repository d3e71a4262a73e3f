"""Adaptive robust laws by their names in a scenario, on free-form parts; corners are refused."""

import numpy as np
import pytest

from contourlab.errors import ContourlabError
from contourlab.scenarios import read_scenario

LAWS = """
[[controller]]
type = "integrated_adaptive_robust"
name = "C2"
tuning = "bandwidth"
bandwidth_hz = [6.0, 15.0]
uncertainty = 0.4
least_squares = { cutoff_hz = 120.0, forgetting = 0.2 }

[[controller]]
type = "integrated_adaptive_robust"
name = "C3"
tuning = "bandwidth"
bandwidth_hz = [6.0, 15.0]
frame = "local_task_frame"

[[controller]]
type = "direct_adaptive_robust"
name = "C1"
error_decay = [38.0, 94.0]
feedback_gain = [42.0, 104.0]
frame = { type = "global_task_frame", rate_from = "velocity" }
"""
MACHINE = '[machine]\nname = "hu_gantry"\n'


def scenario(folder, part, laws=LAWS, feed='[feed]\nfeed = "3000 mm/min"\n'):
    file = folder / "scenario.toml"
    text = f'{part}\n{feed}\n{MACHINE}\n{laws}\n[simulation]\nsample_time = "0.5 ms"\n'
    file.write_text(text)
    return file


def compared(file):
    return read_scenario(file).compare()


def free_form(folder):
    """A smooth curve through points, of no formula and no implicit form."""
    u = np.linspace(0.0, 1.0, 25)
    points = np.stack([40 * np.cos(4 * u) * (1 - 0.4 * u), 30 * np.sin(5 * u) + 20], 1)
    (folder / "part.csv").write_text("X,Y\n" + "\n".join(f"{x:.6f},{y:.6f}" for x, y in points))
    return '[part]\nfile = "part.csv"\nunit = "mm"\nspline = true\n'


@pytest.mark.parametrize("kind", ["figure of eight", "spline"])
def test_all_run_on_free_form_parts(tmp_path, kind):
    part = '[part]\nformula = "figure_eight"\nhalf_sizes = ["30 mm", "30 mm"]\n'
    if kind == "spline":
        part = free_form(tmp_path)
    comparison = compared(scenario(tmp_path, part))
    assert set(comparison.recordings) == {"C1", "C2", "C3"}
    for name, recording in comparison.recordings.items():
        assert recording.status == "normal", name
        assert recording.metrics["contour_error_max"] < 1e-4, name


def test_a_program_with_corners_is_refused_with_the_reason(tmp_path):
    (tmp_path / "part.ngc").write_text("G21 G61\nF3000\nG1 X20\nG1 Y20\nG1 X0\nM2\n")
    with pytest.raises(ContourlabError, match=r"turns by 90 degrees"):
        compared(scenario(tmp_path, '[part]\nfile = "part.ngc"\n'))


def test_the_gantry_takes_flags(tmp_path):
    part = '[part]\nformula = "circle"\nradius = "20 mm"\n'
    file = scenario(tmp_path, part)
    text = file.read_text()
    flags = f'{MACHINE}payload = true\ncogging = true\nencoder = "1 um"\n'
    file.write_text(text.replace(MACHINE, flags))
    machine = read_scenario(file).machine
    np.testing.assert_allclose(machine.dynamics.mass, [0.19, 0.62])
    assert len(machine.dynamics.cogging) == 1
    np.testing.assert_allclose(machine.sensor.resolution, 1e-6)
    file.write_text(text.replace(MACHINE, f"{MACHINE}payload = 1\n"))
    with pytest.raises(ContourlabError, match="payload must be true or false, got 1"):
        read_scenario(file)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('frame = "local"', "unknown frame 'local'.* local_task_frame"),
        ("least_squares = 3.0", "least_squares.* must be a table"),
        ("least_squares = { cutof_hz = 3.0 }", "unknown key.* cutoff_hz"),
        ('frame = { type = "global_task_frame", form = "foot" }', "form must be one of"),
    ],
)
def test_mistakes_are_placed(tmp_path, line, message):
    part = '[part]\nformula = "circle"\nradius = "20 mm"\n'
    law = (
        '[[controller]]\ntype = "integrated_adaptive_robust"\ntuning = "bandwidth"\n'
        f"bandwidth_hz = [6.0, 15.0]\n{line}\n"
    )
    with pytest.raises(ContourlabError, match=message):
        compared(scenario(tmp_path, part, law))
