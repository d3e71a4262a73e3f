"""LinuxCNC's own interpreter as the judge: same end points, centres and turns, same refusals.

``rs274 -g`` prints canonical commands with four decimals, in the units of the program.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.gcode import Interpreter
from contourlab.errors import GcodeError

pytestmark = [
    pytest.mark.linuxcnc,
    pytest.mark.skipif(shutil.which("rs274") is None, reason="LinuxCNC's rs274 is not installed"),
]

SAMPLES = Path("/usr/share/linuxcnc/ncfiles")
BRACKET = Path(__file__).parents[3] / "examples" / "bracket" / "bracket.ngc"
PRINTED = 0.5001e-4  # half of the last printed decimal

PLANES = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}

MIXED = """\
G21 G90 G17 G61 (all planes, R and centres, helices, turns, units, distance modes)
N10 G0 X5 Y1 Z2 S1000 M3
G1 X15 Z-3 F1200
G3 X15 Y11 Z-1 I0 J5
G2 X20 Y16 R-5
X25 Y21 R5.125 Z-2.5
G3 X30 Y16 R5
G18 G2 X35 Z4 I2.5 K3.25
G2 X38 Z7 R3
G3 X41 Z10 R-3.5 Y18 P2
G19 G3 Y22 Z14 J0 K4 P2
G2 J3
Y26 Z10 R4 X40
G17 G90.1 G3 X40 Y30 I40 J28 P3 Z12
G91.1 G91 G2 X1 Y-1 I1 J0
X2 Y0 R1.5
G20 G3 X.5 Y.25 R.4 Z.1
G90 G1 X1 Y1 F20
G2 X1 Y1 I.25 J-.125
G21 G80
G4 P.5
G0 X0 Y0 Z0
M5
M2
"""


def canonical(program: Path) -> tuple[list[tuple[str, np.ndarray]], bool]:
    """Return LinuxCNC's commands that move, in mm, and whether it refused the program."""
    run = subprocess.run(
        ["rs274", "-g", str(program)],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=program.parent if program.parent != SAMPLES else "/tmp",
        check=False,
    )
    plane, scale = "XY", 1.0
    place = np.zeros(3)
    moves = []
    for name, inside in re.findall(r"N[.0-9]* +([A-Z_0-9]+)\(([^)]*)\)", run.stdout):
        if name == "USE_LENGTH_UNITS":
            scale = 25.4 if "INCHES" in inside else 1.0
        elif name == "SELECT_PLANE":
            plane = inside.removeprefix("CANON_PLANE_")
        elif name in ("STRAIGHT_TRAVERSE", "STRAIGHT_FEED"):
            end = np.array([float(value) for value in inside.split(",")][:3]) * scale
            if np.abs(end - place).max() > 0:
                moves.append((name, np.array([*end, scale])))
            place = end
        elif name == "ARC_FEED":
            values = [float(value) for value in inside.split(",")]
            first, second, normal = PLANES[plane]
            row = np.zeros(8)
            row[[first, second, normal]] = np.array([values[0], values[1], values[5]]) * scale
            row[3], row[4 + first], row[4 + second] = scale, values[2] * scale, values[3] * scale
            row[4 + normal] = math.nan
            row[7] = values[4]
            moves.append((name, row))
            place = row[:3].copy()
    return moves, run.returncode != 0


def turns_of(angle: float) -> int:
    """LinuxCNC's count: full and begun turns, with the sign of the sense."""
    return int(math.copysign(math.ceil(abs(angle) / (2 * math.pi) - 1e-6), angle))


def compare(program: Path) -> int:
    expected, refused = canonical(program)
    assert not refused
    text = program.read_text(encoding="utf-8", errors="replace")
    moves = Interpreter().run(text.split("\n")).moves
    assert len(moves) == len(expected)
    for k, (name, row) in enumerate(expected):
        tolerance = PRINTED * row[3]
        assert moves.rapid[k] == (name == "STRAIGHT_TRAVERSE")
        assert_allclose(moves.end[k] * 1e3, row[:3], atol=tolerance, rtol=0)
        if name == "ARC_FEED":
            known = ~np.isnan(row[4:7])
            # the centre may have moved, by the rounding of the program itself
            center = moves.center[k, known] * 1e3
            assert_allclose(center, row[4:7][known], atol=tolerance, rtol=0)
            assert turns_of(moves.angle[k]) == row[7]
        else:
            assert moves.angle[k] == 0.0
    return len(expected)


def test_a_program_with_everything(tmp_path: Path) -> None:
    path = tmp_path / "mixed.ngc"
    path.write_text(MIXED)
    assert compare(path) == 19


@pytest.mark.parametrize("name", ["arcspiral.ngc", "tort.ngc"])
def test_sample_programs(name: str) -> None:
    path = SAMPLES / name
    if not path.exists():
        pytest.skip(f"{path} is not installed")
    assert compare(path) > 100


def test_the_bracket() -> None:
    assert compare(BRACKET) == 40


BAD = [
    "G1 X1", "G0 X1 G1", "G17 G18", "X1", "G2 F10 X1", "G2 F10 X0 Y0 R1", "G2 F10 X10 R4",
    "G2 F10 X10.04 I5", "G2 F10 X2 I1 K1", "G2 F10 X2 I1 R1", "G2 F10 X2 I0 J0", "G2 F10 X1 I.5 P0",
    "G2 F10 X1 I.5 P1.5", "G2 F10 Z1 R5", "G90.1 G2 F10 X2 I1", "G4", "F-1", "G1 F1 X1 X2",
    "G1 F1 X", "G1 F1 X.", "G1 F1 X1e2", "G1 F1 X1 (open", "G1 F1 X1 (a (b))", "G1 F1 X1)",
    "G80 X1", "M3 M5", "G12", "M10", "G1 F1 X1 I1", "R1", "G0 H1", "G1 F1 X1 /Y1", "G1 F1 X1 N5",
    "G0 X1\n%\n", "G61 G64", "G2 F1 X100.06 I50", "G1 F1 X1 P2", "M3.5",
]  # fmt: skip


@pytest.mark.parametrize("line", BAD)
def test_both_refuse(line: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.ngc"
    path.write_text(f"G21\n{line}\nM2\n")
    assert canonical(path)[1]
    with pytest.raises(GcodeError):
        Interpreter().run(path.read_text().split("\n"))
