"""LinuxCNC's own interpreter as the judge: same ends, centres, turns and feeds, same refusals.

It is asked through its Python module (full doubles, source lines, splines flattened) by the script
``linuxcnc_oracle.py``, which runs under the Python that LinuxCNC was built for. There a program
begins in inches.
"""

from __future__ import annotations

import json
import math
import os
import random
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.contours.gcode import Interpreter, read_gcode
from contourlab.contours.moves import Moves
from contourlab.errors import GcodeError

ORACLE = Path(__file__).with_name("linuxcnc_oracle.py")
SAMPLES = Path("/usr/share/linuxcnc/ncfiles")
BRACKET = Path(__file__).parents[3] / "examples" / "bracket" / "bracket.ngc"
PYTHON = "/usr/bin/python3"


@cache
def _available() -> bool:
    if shutil.which("rs274") is None or not os.access(PYTHON, os.X_OK):
        return False
    run = subprocess.run([PYTHON, "-c", "import gcode"], capture_output=True, check=False)
    return run.returncode == 0


pytestmark = [
    pytest.mark.linuxcnc,
    pytest.mark.skipif(not _available(), reason="LinuxCNC and its Python module are not installed"),
]

TOLERANCE = 2e-9
"""[mm]: LinuxCNC works in inches or mm and rounds at every change of units."""


def canonical(program: Path) -> tuple[list[list[Any]], str | None]:
    """Return LinuxCNC's moves in machine coordinates in mm, and why it refused the program."""
    run = subprocess.run(
        [PYTHON, str(ORACLE), str(program)],
        capture_output=True, text=True, timeout=60, cwd=program.parent, check=False,
        errors="replace",
    )  # fmt: skip
    assert run.stdout.strip(), run.stderr
    answer = json.loads(run.stdout.strip().split("\n")[-1])
    place, moves = np.zeros(3), []
    for move in answer["moves"]:
        end = np.array(move[3:6])
        if move[0] == "arc" or np.abs(end - place).max() > TOLERANCE:
            moves.append(move)
        place = end
    return moves, answer["refused"]


def turns_of(angle: float) -> int:
    """LinuxCNC's count: full and begun turns, with the sign of the sense."""
    return int(math.copysign(math.ceil(abs(angle) / (2 * math.pi) - 1e-6), angle))


def rows_of(moves: Moves) -> list[list[int]]:
    """The pieces that stand for one move of LinuxCNC: an arc of two pieces, a NURBS of several."""
    rows: list[list[int]] = []
    for k in range(len(moves)):
        same = bool(rows) and moves.source_line[k] == moves.source_line[k - 1]
        same = same and moves.file_line[k] == moves.file_line[k - 1]
        kinds = [(moves.angle[j] != 0, moves.spline[j] >= 0) for j in (k - 1, k)]
        if same and kinds[0] == kinds[1] and kinds[1] != (False, False):
            rows[-1].append(k)
        else:
            rows.append([k])
    return rows


def compare(program: Path, *, one_move_a_line: bool = True) -> int:
    expected, refused = canonical(program)
    assert refused is None or "no percent sign" in refused, refused
    text = program.read_text(encoding="utf-8", errors="replace")
    moves = Interpreter(default_units="inch", folder=program.parent).run(text.split("\n")).moves
    return compare_moves(expected, moves, one_move_a_line=one_move_a_line)


def compare_moves(expected: list[list[Any]], moves: Moves, *, one_move_a_line: bool) -> int:
    rows = rows_of(moves) if one_move_a_line else [[k] for k in range(len(moves))]
    at = 0
    for row in rows:
        first, last = row[0], row[-1]
        if moves.spline[first] >= 0:
            at = compare_spline(expected, at, moves, row, closely=first % 7 == 0 or len(moves) < 99)
            continue
        kind, _, feed, *end = expected[at]
        at += 1
        assert near(moves.end[last] * 1e3, end[:3], 1e-12), (moves.source_line[last], end)
        assert moves.rapid[first] == (kind == "G0")
        if kind != "G0":
            # the length of an arc with a mismatch is LinuxCNC's own estimate of its spiral
            rtol = 1e-9 if kind == "G1" or len(row) == 1 else 1e-3
            assert near(moves.feed[row] * 6e4, feed, rtol), moves.source_line[first]
        if kind == "arc":
            center, turns, normal = np.array(end[3:6]), end[6], end[7]
            own = moves.center[row] * 1e3
            across = moves.normal[row]
            if normal == 2:
                assert_allclose(across[:, 2], 1.0)
            gap = own - center
            gap -= np.sum(gap * across, axis=1)[:, None] * across
            # a centre may have moved, by the rounding of the program itself
            assert np.abs(gap).max() <= moved_at_most(moves, row) * 1e3 + TOLERANCE
            assert turns_of(float(moves.angle[row].sum())) == turns
        else:
            assert moves.angle[first] == 0.0
    assert at == len(expected)
    return len(rows)


def near(own: Any, other: Any, relative: float) -> bool:
    """As assert_allclose, which takes a millisecond."""
    other = np.asarray(other)
    return bool((np.abs(own - other) <= TOLERANCE + relative * np.abs(other)).all())


def moved_at_most(moves: Moves, row: list[int]) -> float:
    """How far a centre may be from the programmed one: the mismatch of its radii [m]."""
    return 3e-5 if moves.angle[row].any() else 0.0


def compare_spline(
    expected: list[list[Any]], at: int, moves: Moves, row: list[int], *, closely: bool
) -> int:
    """Every point that LinuxCNC flattens the spline to lies on the curve, and in order."""
    line = moves.source_line[row[0]]
    points = []
    while at < len(expected) and expected[at][1] == line and expected[at][0] == "G1":
        points.append(expected[at][3:6])
        assert near(moves.feed[row] * 6e4, expected[at][2], 1e-9)
        at += 1
        if np.abs(moves.end[row[-1]] * 1e3 - points[-1]).max() <= TOLERANCE:
            break  # a loop may run the line again
    assert len(points) > 3
    assert_allclose(moves.end[row[-1]] * 1e3, points[-1], atol=TOLERANCE)
    curves = [moves.control_points[moves.spline[k]] for k in row]
    for point in points[:: max(len(points) // 7, 1)] if closely else []:
        assert min(distance(curve, np.array(point) * 1e-3) for curve in curves) < 1e-9
    return at


def distance(control: np.ndarray, point: np.ndarray) -> float:
    """How far a point is from a rational Bézier curve [m]: samples, then Gauss-Newton steps."""
    n = len(control) - 1

    def at(u: Any) -> Any:
        basis = [math.comb(n, i) * u**i * (1 - u) ** (n - i) for i in range(n + 1)]
        value = np.stack(basis, axis=-1) @ control
        return value[..., :3] / value[..., 3:]

    samples = np.linspace(0, 1, 4000)
    away = np.linalg.norm(at(samples) - point, axis=1)
    best = float(away.min())
    padded = np.concatenate([[np.inf], away, [np.inf]])
    valleys = np.flatnonzero((away <= padded[:-2]) & (away <= padded[2:]))
    for u in samples[valleys]:  # a curve that turns back has a branch beside the other
        for _ in range(8):
            slope = (at(u + 1e-6) - at(u - 1e-6)) / 2e-6
            u = u - float((at(u) - point) @ slope / (slope @ slope + 1e-30))
            best = min(best, float(np.linalg.norm(at(u) - point)))
    return best


# -- programs of our own --------------------------------------------------------------------------

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

OFFSETS = """\
G21
F500 G0 X10 Y5 Z1
G10 L2 P1 X3 Y-2 Z.5 R30
G1 X0 Y0
G2 X5 Y5 I5 J0
G18 G3 X8 Z4 R3
G17 G92 X1 Y1
G1 X4
G91 X1 Y1
G90 G53 G0 X7 Z3
G53 G1 Y1
G55 G1 X1 Y2
G10 L20 P2 X5 Z9
X6 Y6
G52 X2 Y3
X6 Y6
G92.2
X6
G92.3
X6
G92.1
X6
G10 L2 P2 R-90 X1
Y3
G19 G2 Y5 Z10 J1 K.5
G17 G1 G54 X1 Y1
G59.3 X2
G20
G10 L20 P0 X1 Y1
X.5
G21
G10 L2 P9 R180
X1 Y7
G18 G2 X3 Z1 R40
G17
G1 @5 ^30
^60
G91 @2
^-10 Z1
G90 G10 L2 P0 R0
G54 X#5221 Y#5222 Z[#5220 + #5420]
X#5211 Y[#5421 * 2]
M2
"""

SPLINES = """\
G21
F300 G0 X2 Y3 Z1
G5 X10 Y0 I3 J3 P-3 Q3
G5 X20 Y1 P-3 Q-4
G91 G5 X5 Y5 P-1 Q-2
G90 G5.1 X40 Y3 I4 J6
G1 X41
G5.2 P2 L3
X42 Y8 P1
X45 Y2 P3
X50 Y3 P.5
X52 Y8 P1
G5.3
G1 X0 Y0
G10 L2 P1 X4 Y5 R20
G5.2 X1 Y5 P1 L4
X4 Y7 P2
X6 Y0 P1
X8 Y4 P1
X9 Y9 P2
G5.3
G91 G5.2 X1 Y1 P1 L5
X2 Y0 P1
X3 Y3 P1
X5 Y0 P1
G5.3
G90 G1 X0 Y0
M2
"""

FLOW = """\
%
G21
F600 G0 X0 Y0
o100 sub (spiral: #1 turns, #2 step)
  #<r> = #2
  o101 repeat [#1]
    G1 X[#<r> * COS[#<a>]] Y[#<r> * SIN[#<a>]]
    #<a> = [#<a> + 30] #<r> = [#<r> + #2]
    o102 if [#<r> GT 8]
      o100 return [#<r>]
    o102 endif
  o101 endrepeat
  o100 endsub [#<a>]
#<a> = 1
o200 while [#5 LT 4]
  #5 = [#5 + 1]
  o201 if [#5 EQ 2]
    o200 continue
  o201 elseif [#5 EQ 3]
    G1 Z[#5 / 10]
  o201 else
    G3 X[#5420] Y[#5421] I1 J[2 ** .5]
  o201 endif
  G91 G1 X.5 Y[EXISTS[#<a>] + EXISTS[#<b>]]
  G90
o200 endwhile
o300 do
  #6 = [#6 + 1]
  G1 X#6 Y[#6 MOD 3]
o300 while [#6 LT 5]
G1 X50
o103 sub
  #<a> = 7
  o104 if [#1 GT 0]
    G1 X#1 Y[#1 * #1]
    o103 call [#1 - 1]
  o104 endif
  G1 Z#1
o103 endsub
o103 call [4]
G1 X[#<_value> + #<_value_returned> + #1]
#1 = 3 #2 = #1
X#1 Y#2
#10 = 12 #12 = 5
X##10 Y[#[#10] / 2 - ATAN[1]/[1] / 45]
Z-SIN[30] X-#1
M73
G20 G91 F3
M72
X1 Y1
o<named> sub
  M73
  G91 G20
  G1 X.1
o<named> endsub
o<named> call
o<named> call
X1 Y[FIX[-2.5] + FUP[2.1] + ROUND[2.5] + ABS[-1] + SQRT[4] + LN[EXP[2]] + ACOS[0] / 90 + TAN[45]]
X[1 LT 2 OR 0 AND 0] Y[[3 GE 3] + [2 NE 2] + [1 XOR 1] + [4 LE 3.99995]]
X[#<_metric> + #<_absolute>] Y[#<_x> + #<_call_level> + #<_feed> / 100] Z[#<_plane> / 100]
X[#<_line>] Y[#<_motion_mode>] Z[#<_coord_system> / 100]
%
"""

INVERSE = """\
G21
G93 G1 X10 F2
G0 X5
G2 X15 I5 F.5
Z3 X25 I5 P2 F.25
G1 X25 Y1 F1000
G20 G1 X0 F3
G18 G3 X2 I1 F1
G94 F30 G1 X1
M2
"""

FANUC = """\
O1
G21
G0 X0
F100
M98 P200 L3
#1 = 200
M98 P#1
M98 P201 L0
X#3
M2
O200
G91 G1 X1 Y2
#3 = [#3 + 1]
G90
M99
O201
X500
M99
"""


@pytest.mark.parametrize(
    ("text", "count"),
    [(MIXED, 19), (OFFSETS, 27), (SPLINES, 11), (FLOW, 30), (INVERSE, 8), (FANUC, 4)],
    ids=["mixed", "offsets", "splines", "flow", "inverse_time", "fanuc"],
)
def test_our_programs(text: str, count: int, tmp_path: Path) -> None:
    path = tmp_path / "p.ngc"
    path.write_text(text)
    assert compare(path, one_move_a_line="repeat" not in text) >= count


def test_subprograms_in_other_files(tmp_path: Path) -> None:
    (tmp_path / "cut.ngc").write_text(
        "(a file)\no<cut> sub\nG91 G1 X#1 Y[#2 * 2] F50\no2 call\nG90\no<cut> endsub [#1 + 1]\n"
        "o2 sub\nG1 Y7\no2 endsub\nM2\n"
    )
    (tmp_path / "7.ngc").write_text("o7 sub\nG3 X[#5420] Y[#5421 + 4] J2\no7 endsub\n")
    path = tmp_path / "p.ngc"
    path.write_text(
        "G21\nG0 X1\no<Cut> call [2] [3]\no7 call\nG1 X#<_value>\no<CUT> call [1]\nM2\n"
    )
    assert compare(path) == 7


# -- LinuxCNC's sample programs --------------------------------------------------------------------

REFUSED = {
    "b-index.ngc": "b0: rotary axes",
    "comp-g1.ngc": "G41: cutter compensation",
    "comp.ngc": "g42: cutter compensation",
    "comp311.ngc": "g41: cutter compensation",
    "comp311_2.ngc": "g41: cutter compensation",
    "cone.ngc": "g28: returning to stored positions",
    "daisy.ngc": "A0: rotary axes",
    "g76.ngc": "g41: cutter compensation",
    "gmoccapy_2_tools_with_cutter_radius_compensation.ngc": "G41: cutter compensation",
    "gridprobe.ngc": "G38.2: probing",
    "hole-circle.ngc": "G81: canned cycles",
    "lathe-g76.ngc": "g41: cutter compensation",
    "lathe_g70_71_demo.ngc": "G71.1: lathe cycles",
    "lathe_g7x_face_boring.ngc": "G72: lathe cycles",
    "lathe_g7x_quadrants.ngc": "G70: lathe cycles",
    "lathecomp.ngc": "g42: cutter compensation",
    "mmount.ngc": "G81: canned cycles",
    "nestedcall.ngc": "does not belong behind call",
    "polar.ngc": "G81: canned cycles",
    "smartprobe.ngc": "G38.5: probing",
    "threading.ngc": "g33: spindle-synchronised motion",
    "tool-length-probe.ngc": "g30: returning to stored positions",
    "useful-subroutines.ngc": "g41: cutter compensation",
    "x-trim.ngc": "G38.2: probing",
}
"""Refused, and where and why, of the sample programs in the folder itself."""

CLASSES = re.compile(
    r"tool length offsets|cutter compensation|probing|canned cycles|lathe cycles|rotary axes"
    r"|spindle-synchronised|stored position|depends on the machine's pins|user-defined M words"
    r"|depends on the tool|depends on a probed|diameter mode"
)
"""Why programs in its other folders may be refused."""

NAMES = sorted(str(f.relative_to(SAMPLES)) for f in SAMPLES.rglob("*.ngc"))
MOVING = {"arcspiral.ngc": 999, "tort.ngc": 200, "spiral.ngc": 800, "flowsnake.ngc": 3000,
          "3D_Chips.ngc": 4600, "systems.ngc": 800,
          "plasmatest.ngc": 300, "3dtest.ngc": 40}  # fmt: skip
TOOLS = re.compile(
    r"(?<![(;A-Za-z<_])(?:T *(?:[0-9]+|#<\w+>)|M *0?6(?![0-9])|M *61 *Q *#<\w+>)"
    r"|(?<![(;A-Z<_a-z])G *43(?: *H *[0-9]+)?(?![.0-9])",
    re.I,
)


LONG = {"3D_Chips.ngc", "systems.ngc"}
"""Thousands of moves; others turn, branch and call too."""


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in NAMES]
)
def test_sample_programs(name: str, tmp_path: Path) -> None:
    """Every program that LinuxCNC ships moves the same way, or is refused for a reason we know."""
    path = tmp_path / Path(name).name
    for file in (SAMPLES / name).parent.glob("*.ngc"):
        shutil.copy(file, tmp_path)
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        moves = Interpreter(default_units="inch", folder=path.parent).run(text.split("\n")).moves
    except GcodeError as error:
        reason = str(error)
    else:
        reason = ""
    if reason:
        assert REFUSED[name] in reason if name in REFUSED else CLASSES.search(reason)
        return
    assert name not in REFUSED
    path.write_text(TOOLS.sub("", text))  # LinuxCNC's module needs a running machine for its tools
    expected, refused = canonical(path)
    if refused is not None:
        assert "no percent sign" in refused, refused  # a program may end without M2 here
    compare_moves(expected, moves, one_move_a_line=False)
    count = len(moves)
    assert count >= MOVING.get(name, 0)


def test_feed_length_of_a_sample() -> None:
    """The length cut by the arcs and lines of arcspiral, from LinuxCNC's own moves."""
    path = SAMPLES / "arcspiral.ngc"
    expected, _ = canonical(path)
    place, length = np.zeros(3), 0.0
    for kind, _, _, *rest in expected:
        end = np.array(rest[:3])
        if kind == "arc":
            center = np.array([*rest[3:5], 0.0])
            a, b = place - center, end - center
            swept = math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])
            turn = 2 * math.pi
            swept = swept % turn if rest[6] > 0 else swept % turn - turn
            swept += (abs(rest[6]) - 1) * math.copysign(turn, rest[6])
            radius = 0.5 * (np.hypot(*a[:2]) + np.hypot(*b[:2]))
            length += math.hypot(radius * swept, end[2] - place[2])
        elif kind == "G1":
            length += float(np.linalg.norm(end - place))
        place = end
    part = read_gcode(path, default_units="inch")
    pieces = np.diff(np.asarray(part.path.breaks))
    assert_allclose(pieces[~part.rapid].sum() * 1e3, length, rtol=1e-7)


def test_the_bracket() -> None:
    assert compare(BRACKET) == 40


# -- generated programs ----------------------------------------------------------------------------


class Generator:
    """Random programs: whatever the reader may meet, arcs made to fit by their radius."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.lines = ["G21", "F500 G0 X1 Y1 Z0 (seeded)"]
        self.label = 1000
        self.subs: list[int] = []

    def number(self, low: float = -20.0, high: float = 20.0) -> str:
        return f"{self.random.uniform(low, high):.3f}"

    def value(self, depth: int = 0) -> str:
        kind = self.random.randrange(4 if depth > 1 else 12)
        inner = lambda: self.value(depth + 1)  # noqa: E731
        if kind < 3:
            return self.number(-9, 9)
        if kind == 3:
            return f"#{self.random.randrange(1, 8)}"
        if kind == 4:
            return f"#<{self.random.choice(['_p', '_q', '_r'])}>"
        if kind < 8:
            operator = self.random.choice(["+", "-", "*", " MOD ", " AND ", " OR ", " XOR "])
            if operator == " MOD ":
                return f"[{inner()} MOD {self.number(1, 7)}]"
            return f"[{inner()} {operator} {inner()} {self.random.choice('+-')} {inner()}]"
        if kind == 8:
            comparison = self.random.choice(["EQ", "NE", "GT", "GE", "LT", "LE"])
            return f"[{inner()} {comparison} {inner()}]"
        if kind == 9:
            function = self.random.choice(["ABS", "COS", "SIN", "FIX", "FUP", "ROUND"])
            return f"{function}[{inner()}]"
        if kind == 10:
            return f"ATAN[{inner()}]/[{self.number(1, 5)}]"
        return f"[{inner()} / {self.number(1, 5)}]"

    def bounded(self) -> str:
        """A value that stays within the machine."""
        value = self.value()
        return f"[[{value if len(value) < 70 else 3}] MOD 40 - 20]"  # a line has 255 characters

    def block(self, depth: int) -> None:
        kind = self.random.randrange(15)
        add = self.lines.append
        if kind < 4:
            letters = self.random.sample("XYZ", self.random.randrange(1, 4))
            add(f"G{self.random.choice('01')} " + " ".join(f"{w}{self.bounded()}" for w in letters))
        elif kind < 6:
            plane, letters = self.random.choice([("17", "IJ"), ("18", "IK"), ("19", "JK")])
            add(f"G{plane} G{self.random.choice('23')} {letters[0]}{self.number(1, 5)} "
                f"{letters[1]}{self.number(1, 5)} P{self.random.randrange(1, 3)}")  # fmt: skip
            add("G17")
        elif kind == 6:
            add(f"G91 G1 X{self.number(1, 2)} Y{self.number(1, 2)}")
            add(f"G{self.random.choice('23')} X1 Y1 R{self.number(1, 3)} Z{self.number(-1, 1)}")
            add("G90")
        elif kind == 7:
            target = self.random.choice(["#1", "#2", "#5", "#7", "#<_p>", "#<_q>", "#[1 + 2]"])
            add(f"{target} = {self.bounded()} #6 = {self.bounded()}")
        elif kind == 8:
            add(self.random.choice([
                "G54", "G55", "G59.1", "G92.1", "G92.2", "G92.3", "G61", "G64 P.1 Q.02",
                f"G92.1\nG10 L2 P{self.random.randrange(3)} X{self.number()} "
                f"R{self.number(-90, 90)}",
                f"G10 L20 P{self.random.randrange(3)} Y{self.number()} Z{self.number()}",
                f"G92 X{self.number()} Z{self.number()}", f"G52 Y{self.number()}",
                f"G53 G0 X{self.number()} Y{self.number()}",
            ]))  # fmt: skip
        elif kind == 9:
            add(f"G1 Z{self.number()}")  # LinuxCNC's preview keeps Z from the last straight move
            add(f"G5 X{self.bounded()} Y{self.bounded()} I{self.number(1, 4)} J{self.number(1, 4)} "
                f"P{self.number(1, 4)} Q{self.number(1, 4)}")  # fmt: skip
        elif kind == 10 and depth < 2:
            self.label += 1
            label = self.label
            add(f"o{label} if [{self.value()}]")
            self.block(depth + 1)
            if self.random.random() < 0.5:
                add(f"o{label} elseif [{self.value()}]")
                self.block(depth + 1)
            if self.random.random() < 0.5:
                add(f"o{label} else")
                self.block(depth + 1)
            add(f"o{label} endif")
        elif kind == 11 and depth < 2:
            self.label += 1
            label = self.label
            add(f"o{label} repeat [{self.random.randrange(4)}]")
            self.block(depth + 1)
            add(f"o{label} endrepeat")
        elif kind == 12 and depth < 2:
            self.label += 1
            label, counter = self.label, f"#<_n{self.label}>"
            add(f"{counter} = 0")
            add(f"o{label} while [{counter} LT 3]")
            add(f"{counter} = [{counter} + 1]")
            self.block(depth + 1)
            if self.random.random() < 0.4:
                self.label += 1
                add(f"o{self.label} if [{self.value()}]")
                add(f"o{label} {self.random.choice(['break', 'continue'])}")
                add(f"o{self.label} endif")
            add(f"o{label} endwhile")
        elif kind == 13 and self.subs:
            arguments = " ".join(f"[{self.bounded()}]" for _ in range(self.random.randrange(4)))
            add(f"o{self.random.choice(self.subs)} call {arguments}")
        else:
            self.label += 1
            label, counter = self.label, f"#<_n{self.label}>"
            add(f"{counter} = 0")
            add(f"o{label} do")
            add(f"{counter} = [{counter} + 1]")
            add(f"G1 X{self.bounded()} F{self.number(100, 900)}")
            add(f"o{label} while [{counter} LT 2]")

    def program(self) -> str:
        self.lines.append("#<_p> = 1 #<_q> = 2 #<_r> = 3")
        for _ in range(self.random.randrange(3)):
            self.label += 1
            sub = self.label
            self.lines.append(f"o{sub} sub")
            for _ in range(self.random.randrange(1, 4)):
                self.block(1)
            self.lines.append(f"o{sub} endsub [{self.value()}]")
            self.subs.append(sub)
        for _ in range(self.random.randrange(5, 30)):
            self.block(0)
        self.lines.append("M2")
        return "\n".join(self.lines) + "\n"


def agree(seed: int, folder: Path) -> bool:
    """Return whether both refuse the program; fail unless they agree."""
    path = folder / f"p{seed}.ngc"
    path.write_text(Generator(seed).program())
    expected, refused = canonical(path)
    try:
        moves = Interpreter(default_units="inch").run(path.read_text().split("\n")).moves
    except GcodeError as error:
        reason = str(error)
    else:
        reason = ""
    assert bool(reason) == (refused is not None), (seed, reason, refused)
    if reason:
        return True
    compare_moves(expected, moves, one_move_a_line=False)
    return False


@pytest.mark.parametrize("seed", range(0, 200, 20))
def test_generated_programs(seed: int, tmp_path: Path) -> None:
    refused = sum(agree(seed + k, tmp_path) for k in range(4))
    assert refused < 4


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed",
    [
        k if k < 1500 else pytest.param(k, marks=pytest.mark.overnight)
        for k in range(1000, 3000, 100)
    ],
)
def test_many_generated_programs(seed: int, tmp_path: Path) -> None:
    refused = sum(agree(seed + k, tmp_path) for k in range(20))
    assert refused < 15


# -- refusals ----------------------------------------------------------------------------------

BAD = [
    "G1 X1", "G0 X1 G1", "G17 G18", "X1", "G2 F10 X1", "G2 F10 X0 Y0 R1", "G2 F10 X10 R4",
    "G2 F10 X10.04 I5", "G2 F10 X2 I1 K1", "G2 F10 X2 I1 R1", "G2 F10 X2 I0 J0", "G2 F10 X1 I.5 P0",
    "G2 F10 X1 I.5 P1.5", "G2 F10 Z1 R5", "G90.1 G2 F10 X2 I1", "G4", "F-1", "G1 F1 X1 X2",
    "G1 F1 X", "G1 F1 X.", "G1 F1 X1e2", "G1 F1 X1 (open", "G1 F1 X1 (a (b))", "G1 F1 X1)",
    "G80 X1", "M3 M5", "G12", "M10", "G1 F1 X1 I1", "R1", "G0 H1", "G1 F1 X1 /Y1", "G1 F1 X1 N5",
    "G0 X1\n%\n", "G61 G64", "G2 F1 X100.06 I50", "G1 F1 X1 P2", "M3.5",
    # values
    "G0 X[1/0]", "G0 X[1", "G0 X[1 FOO 2]", "G0 X1]", "G0 XSQRT[-1]", "G0 XLN[0]", "G0 XACOS[1.1]",
    "G0 XASIN[-2]", "G0 XATAN[1]", "G0 XSIN 30", "G0 X[-8 ** .5]", "G0 X#<nope>", "G0 X#[1.5]",
    "#5602 = 1", "#0 = 1", "#-1 = 2", "#5420 = 1", "#5400 = 1", "#<_x> = 1", "#1", "#1 = ",
    "#<a = 1", "G0 X#<a", "G0 X[EXP[1000]]", "G0 X[10 ** 400]", "G0 X[5 MOD 0]", "G0 X[]",
    "G0 X[1 +]", "G0 X[* 2]", "G0 XFOO[1]", "G0 XEXISTS[1]", "G0 X#[#1]", "[1]",
    "G[1.01] X1", "M[3.5]", "G0 X=1",
    # o-words
    "o1 endwhile", "o1 endif", "o1 else", "o1 elseif [1]", "o1 endrepeat", "o1 break",
    "o1 continue", "o1 endsub", "o1 return", "o1 if", "o1 while", "o1 repeat", "o1 foo",
    "o1 call", "o<none> call", "o1 if [1] G0 X1", "G0 X1 o1 if [1]", "#1=1 o1 if [1]",
    "o1 sub\no2 sub\no2 endsub\no1 endsub", "o1 sub\no1 endsub\no1 sub\no1 endsub",
    "o1 while [0]\no1 endif", "o1 if [1]\no1 endwhile", "o1 repeat [2]\no1 break\no1 endrepeat",
    "o1 if [1]\no1 endif\no1 if [1]\no1 endif", "o1 while [0]\no1 endwhile\no1 repeat [1]",
    "o1 sub\no1 call\no1 endsub\no1 call", "o1 call\no1 sub\nG0 X1\no1 endsub",
    "o1 sub\no1 endsub\no1 call [1/0]", "o1.5 if [1]", "o1 while [1]\no1 endwhile [2]",
    "o1 call" + " [1]" * 31, "o1 sub\nG0 X1", "o1 if [0]\nG0 X1", "(c) o1 if [1]",
    "M98", "M98 P9", "G0 X1 M98 P9", "M98 P7\nM2\nO7\no1 endsub",
    "o7 call\nM2\nO7\nM99", "M98 P7\nM2\no7 sub\nM99",
    # offsets, splines, modes
    "G10", "G10 L2 X1", "G10 L2 P10 X1", "G10 L2 P-1 X1", "G10 L3 P1", "G10 L20 P1 R5",
    "G10 L2 P1 I1", "G10 L2 P1 G0 X1", "G92", "G52", "G92 X1 G1", "G53 X1", "G53",
    "G91 G53 G0 X1", "G53 G2 X1 R1 F1", "G0 @1 X1", "G18 G0 @1", "G91 G0 @1", "G92 @1",
    "G10 L2 P1 @1 G0", "G93 G1 X1", "G94 F5 G93 G2 X1 R1", "G93 F3 G1 X1\nG94 G1 X5",
    "F5 G5 X1 Y1 I1 J1", "F5 G5 X1 Y1 I1 P1 Q1", "F5 G5 X1 Y1 I1 J1 P1", "F5 G5.1 X1 Y1 I1",
    "F5 G5.1 X1 Y1 I1 J1 P1", "F5 G5 X1 Y1 Z1 I1 J1 P1 Q1", "F5 G18 G5.1 X1 Y1 I1 J1",
    "G5 X1 Y1 I1 J1 P1 Q1", "F5 G5 I1 J1 P1 Q1", "F5 G5.1 I1 J1", "F5 G5.1 X5 I1 J1\nX3 I1 J1",
    "G5.3", "F5 G5.2 X1 Y1 P1\nG5.3", "F5 G5.2 X1 P1", "F5 G5.2 X1 Y1 P1\nX2 Y2",
    "F5 G5.2 X1 Y1 P1\nX2 Y2 P-1", "F5 G5.2 X1 Y1 P1\nG5.2 P2", "G5.2 X1 Y1 P1",
    "F5 G5.2 X1 Y1 P1\nX2 Y1 P1\nG5.3\nX5", "F5 G5.2 X1 Y1 P1\nX3 Y2 P1\nG1 X5\nG5.3",
    "M70 M71", "M72", "M70\nM71\nM72", "M73 M3", "S-1", "T-1", "G96 D5", "G95 F1 G1 X1",
    "(abort,stop)", "G93 G94", "G54 G55", "G92.1 G92.2", "G4 P1 G53 G0 X1", "M3 M70",
]  # fmt: skip


@pytest.mark.parametrize("line", BAD, ids=[f"{k}" for k in range(len(BAD))])
def test_both_refuse(line: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.ngc"
    path.write_text(f"G21\n{line}\nM2\n")
    with pytest.raises(GcodeError) as caught:
        Interpreter().run(path.read_text().split("\n"))
    assert caught.value.line > 0
    run = subprocess.run(["rs274", "-g", str(path)], capture_output=True, timeout=20, check=False,
                         cwd=tmp_path)  # fmt: skip
    assert run.returncode != 0
