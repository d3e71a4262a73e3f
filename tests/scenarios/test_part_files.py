"""``[part]`` with points and drawings: they are read, planned with a feed, and refused in place."""

import ezdxf
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ContourlabError, ScenarioError
from contourlab.scenarios import read_scenario_text

REST = """
[feed]
feed = "1200 mm/min"
[machine]
name = "linear_motor_stage"
encoder = "0.1 um"
[[controller]]
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 20
"""


def scenario(said, folder, rest=REST, **options):
    return read_scenario_text(f"[part]\n{said}\n{rest}", name="s.toml", folder=folder, **options)


def wave(tmp_path):
    x = np.linspace(0.0, 20.0, 41)
    rows = "\n".join(f"{a:.6f},{3 * np.sin(a / 5):.6f}" for a in x)
    (tmp_path / "w.csv").write_text(f"x,y\n{rows}\n")


def test_points_become_a_smooth_motion(tmp_path):
    wave(tmp_path)
    read = scenario('file = "w.csv"\nunit = "mm"\nspline = true\ntolerance = "5 um"', tmp_path)
    assert read.part.axes == ("X", "Y")
    assert len(read.stops) == 1  # no corner on the way
    assert any("the spline is up to" in warning for warning in read.reference.warnings)
    reached = np.asarray(read.reference.position)[-1]
    assert_allclose(reached, [0.02, 0.003 * np.sin(4.0)], atol=1e-9)
    assert np.linalg.norm(read.reference.velocity, axis=1).max() <= 0.02 * (1 + 1e-9)


def test_corners_of_points_are_stops_unless_blended(tmp_path):
    (tmp_path / "z.csv").write_text("x_mm;y_mm\n0;0\n10;0\n10;10\n20;10\n")
    stops = scenario('file = "z.csv"', tmp_path)
    assert len(stops.stops) == 3
    blended = scenario('file = "z.csv"\nblend = "50 um"', tmp_path)
    assert len(blended.stops) == 1
    assert len(blended.reference.position) < len(stops.reference.position)


def test_drawings_are_followed(tmp_path):
    document = ezdxf.new("R2010")
    document.units = 4
    space = document.modelspace()
    space.add_lwpolyline([(0, 0, 0), (20, 0, 1), (20, 10, 0), (0, 10, 1)], "xyb", close=True)
    space.add_text("note")
    document.saveas(tmp_path / "d.dxf")
    (tmp_path / "d.svg").write_text(
        '<svg width="20mm" height="10mm" viewBox="0 0 20 10">'
        '<path d="M0 10H20A5 5 0 0 0 20 0H0A5 5 0 0 0 0 10Z"/></svg>'
    )
    for name in ("d.dxf", "d.svg"):
        read = scenario(f'file = "{name}"', tmp_path)
        assert read.part.path.closed
        assert_allclose(read.part.path.length, 0.04 + 0.01 * np.pi, rtol=1e-12)
        assert_allclose(read.part.path.position(0.01), [0.01, 0.0], atol=1e-15)
        assert len(read.stops) == 1


@pytest.mark.parametrize(
    ("part", "rest", "message"),
    [
        ('file = "w.csv"', REST, "s.toml:1: part: .*the unit of the coordinates is not known"),
        ('file = "w.csv"\nunits = "mm"', REST, "s.toml:3: part.units: unknown key .* unit"),
        ('file = "w.csv"\nunit = "mm"\nspacing = 3', REST, r"toml:4: part.spacing: .* no unit"),
        ('file = "w.csv"\nunit = 3', REST, "s.toml:3: part.unit: input should be a valid string"),
        ('file = "w.csv"\nunit = "mm"\nskip_rapids = true', REST, "goes with a part program"),
        ('file = "w.csv"\nunit = "mm"\ntolerance = "1 um"', REST, "tolerance goes with spline"),
        ('file = "w.csv"\nunit = "mm"', REST.replace('feed = "1200', '#'), "feed is missing"),
        ('file = "none.svg"', REST, "none.svg: cannot be read"),
        ('file = "w.ngc"\nunit = "mm"', REST, "unknown key 'unit'; with file the allowed keys"),
    ],
)  # fmt: skip
def test_mistakes_say_where_they_stand(tmp_path, part, rest, message):
    wave(tmp_path)
    with pytest.raises(ContourlabError, match=message):
        scenario(part, tmp_path, rest)


def test_another_file_takes_the_options_of_its_kind(tmp_path):
    wave(tmp_path)
    (tmp_path / "v.csv").write_text((tmp_path / "w.csv").read_text())
    text = 'file = "w.csv"\nunit = "mm"\nspline = true'
    read = scenario(text, tmp_path, part=tmp_path / "v.csv")
    assert read.part.source.endswith("v.csv")
    (tmp_path / "p.ngc").write_text("G1 F1200 X5\nM2\n")
    assert scenario(text, tmp_path, part=tmp_path / "p.ngc").part.source.endswith("p.ngc")
    with pytest.raises(ScenarioError, match="unit of the coordinates is not known"):
        scenario('file = "p.ngc"', tmp_path, part=tmp_path / "v.csv")


def test_splines_are_formulas_too():
    part = """formula = "bspline"
control_points = [["0 mm", "0 mm"], ["10 mm", "0 mm"], ["10 mm", "10 mm"], ["20 mm", "10 mm"]]
degree = 2"""
    read = read_scenario_text(f"[part]\n{part}\n{REST}", name="s.toml")
    assert_allclose(np.asarray(read.reference.position)[-1], [0.02, 0.01], atol=1e-12)
