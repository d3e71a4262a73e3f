"""Every formula contour can be written in a scenario, with units; mistakes are named."""

import numpy as np
import pytest

from contourlab.contours import (
    Arc,
    FigureEight,
    Heart,
    Involute,
    Line,
    Lissajous,
    Parabola,
    Sinusoid,
    Spiral,
    Star,
)
from contourlab.errors import ScenarioError
from contourlab.scenarios import read_scenario_text
from contourlab.scenarios.registry import contours

REST = """
[feed]
kind = "constant_rate"
rate = 0.01
duration = "10 ms"

[machine]
name = "linear_motor_stage"

[[controller]]
type = "axis_pid"
tuning = "pole_placement"
bandwidth_hz = 20
"""

PARTS = {
    "line": (
        'start = ["1 cm", "0 mm"]\nend = ["30 mm", "20 mm"]',
        Line(start=(0.01, 0.0), end=(0.03, 0.02)),
    ),
    "arc": (
        'center = ["0 mm", "10 mm"]\nstart = ["0 mm", "0 mm"]\nangle = "90 deg"',
        Arc(center=(0.0, 0.01), start=(0.0, 0.0), angle=0.5 * np.pi),
    ),
    "figure_eight": (
        'half_sizes = ["30 mm", "3 cm"]\ncenter = ["30 mm", "0 m"]\nstart_angle = "90 deg"',
        FigureEight(half_sizes=(0.03, 0.03), center=(0.03, 0.0), start_angle=np.pi / 2),
    ),
    "heart": (
        'radius = "30 mm"\nsmoothing = 0.05\nrotation = "10 deg"',
        Heart(radius=0.03, smoothing=0.05, rotation=np.pi / 18),
    ),
    "involute": (
        'base_radius = "20 mm"\nstart_angle = "10 deg"\nend_angle = "1.5 rad"',
        Involute(base_radius=0.02, start_angle=np.pi / 18, end_angle=1.5),
    ),
    "lissajous": (
        'amplitudes = ["30 mm", "20 mm"]\nfrequencies = [2, 3]\nphases = ["0.3 rad", "0 rad"]',
        Lissajous(amplitudes=(0.03, 0.02), frequencies=(2, 3), phases=(0.3, 0.0)),
    ),
    "parabola": (
        'coefficient = 50.0\nhalf_width = "20 mm"',
        Parabola(coefficient=50.0, half_width=0.02),
    ),
    "sinusoid": (
        'amplitude = "30 mm"\nwavelength = "4 cm"\nperiods = 2.5\nphase = "0.1 rad"',
        Sinusoid(amplitude=0.03, wavelength=0.04, periods=2.5, phase=0.1),
    ),
    "spiral": (
        'start_radius = "5 mm"\npitch = "2 mm"\nturns = 3',
        Spiral(start_radius=0.005, pitch=0.002, turns=3.0),
    ),
    "star": (
        'outer_radius = "30 mm"\ninner_radius = "20 mm"\npoints = 6',
        Star(outer_radius=0.03, inner_radius=0.02, points=6),
    ),
}


def read(name, fields, rest=REST):
    return read_scenario_text(f'[part]\nformula = "{name}"\n{fields}\n{rest}', name="s.toml")


@pytest.mark.parametrize("name", PARTS)
def test_a_formula_in_a_scenario_is_the_contour(name):
    fields, expected = PARTS[name]
    contour = read(name, fields).reference.contour
    assert type(contour) is type(expected)
    at = expected.domain[0] + 0.01
    np.testing.assert_allclose(
        contour.derivatives(at, 2), expected.derivatives(at, 2), rtol=1e-13, atol=1e-15
    )


def test_no_wrapper_is_offered_as_a_formula():
    # a wrapped contour holds another, which a table of numbers cannot say
    others = {"bspline", "circle", "ellipse", "helix", "nurbs"}
    assert set(contours()) == {*PARTS, *others}


@pytest.mark.parametrize(
    ("name", "fields", "message"),
    [
        ("line", 'start = [0.0, 0.0]\nend = ["1 cm", "0 mm"]', "s.toml:3: part.start: .*no unit"),
        ("heart", 'radius = "30 mm"\nstart = ["0 mm"]', "s.toml:4: part.start: unknown key"),
        ("star", 'outer_radius = 30.0\ninner_radius = "20 mm"', "s.toml:3: part.outer_radius"),
        ("star", 'outer_radius = "3 cm"\ninner_radius = "2 cm"\npoints = 1', "s.toml:5: part.po"),
        ("lissajous", 'amplitudes = "3 cm"\nfrequencies = [1]', "s.toml:4: part.frequencies"),
        ("lissajous", 'amplitudes = "3 cm"\nfrequencies = 2', "s.toml:4: part.frequencies"),
        ("lissajous", 'amplitudes = "3 cm"\nfrequencies = [1, "2 Hz"]', "s.toml:4: part.freq"),
        ("heart", 'radius = "30 mm"\nsmoothing = 0.0', "s.toml:4: part.smoothing: .*must be > 0"),
        ("parabola", "coefficient = 50.0", "Parabola needs half_width"),
        ("spiral", 'start_radius = "5 mm"\npitch = "-4 mm"\nturns = 3', "s.toml:4: part.pitch"),
    ],
)
def test_mistakes_are_named(name, fields, message):
    with pytest.raises(ScenarioError, match=message):
        read(name, fields)
