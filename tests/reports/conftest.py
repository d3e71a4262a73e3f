"""Hand-made comparisons: a bracket with smooth made-up errors, exactly as a simulation records."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path as FilePath
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from contourlab.contours import Circle, Line
from contourlab.contours.part import Part
from contourlab.contours.path import Path
from contourlab.machines import ball_screw_stage
from contourlab.recordings import Recording, Reference
from contourlab.simulation import Comparison
from contourlab.simulation.pairing import Refusal

PROGRAM = """\
%
(bracket, 6 mm plate)
G21 G90 G17 G64
F3000
G0 X0 Y0
G1 X50 Y0
G1 X60 Y0
G3 X70 Y10 I0 J10
G1 X70 Y40
G1 X40 Y40
G2 X30 Y30 I-10 J0
G1 X0 Y30
G1 X0 Y0
M2
%
""".splitlines()
SAMPLE_TIME = 1e-3
SCENARIO = '[part]\nfile = "bracket.ngc"\n\n[feed]\nrate = "3000 mm/min"\n'


def bracket_path() -> Path:
    mm = 1e-3
    pieces = [  # start, end, centre, source line
        ((0, 0), (60, 0), None, 7), ((60, 0), (70, 10), (60, 10), 8),
        ((70, 10), (70, 40), None, 9), ((70, 40), (40, 40), None, 10),
        ((40, 40), (30, 30), (30, 40), 11), ((30, 30), (0, 30), None, 12),
        ((0, 30), (0, 0), None, 13),
    ]  # fmt: skip
    start, tangent, normal, rate, length, line = [], [], [], [], [], []
    for a, b, c, number in pieces:
        a, b = np.array(a) * mm, np.array(b) * mm
        if c is None:
            size = np.linalg.norm(b - a)
            u, v, k = (b - a) / size, np.zeros(2), 0.0
        else:
            out = a - np.array(c) * mm
            radius = np.linalg.norm(out)
            left = np.array([-out[1], out[0]]) / radius
            turn = 1.0 if number == 8 else -1.0
            u, v, k, size = left * turn, -out / radius, 1 / radius, radius * np.pi / 2
        for held, value in zip(
            (start, tangent, normal, rate, length, line), (a, u, v, k, size, number), strict=True
        ):
            held.append(value)
    return Path.from_helical(start, tangent, normal, np.zeros_like(start), rate, length, line)


def bracket_part(path: Path, lines: list[str] = PROGRAM, source: str = "bracket.ngc") -> Part:
    n = path.n_pieces
    return Part(
        path=path, axes=("X", "Y"), source=source, lines=tuple(lines),
        source_line=np.asarray(path.source_line), feed=np.full(n, 0.05), rapid=np.zeros(n, bool),
        blend=np.full(n, np.nan), dwell=np.zeros(n), ignored=MappingProxyType({}),
    )  # fmt: skip


def travel(path: Path, feed: float) -> tuple[Reference, np.ndarray]:
    """Return a reference that stops at every sharp corner, and the times of the stops."""
    breaks = np.asarray(path.breaks)
    sharp = [*breaks[[0, 3, 4, 6, 7]]] if len(breaks) == 8 else [0.0, breaks[-1]]
    parameter, stops = [], []
    for a, b in pairwise(sharp):
        n = int(np.ceil(1.5 * (b - a) / feed / SAMPLE_TIME))
        x = np.linspace(0.0, 1.0, n, endpoint=False)
        parameter.append(a + (b - a) * (x - np.sin(2 * np.pi * x) / (2 * np.pi)))
        stops.append(n)
    parameter = np.concatenate([*parameter, [sharp[-1]]])
    rate = np.gradient(parameter, SAMPLE_TIME)
    acceleration = np.gradient(rate, SAMPLE_TIME)
    reference = Reference.along(
        path, sample_time=SAMPLE_TIME, parameter=parameter, parameter_rate=rate,
        parameter_acceleration=acceleration, parameter_jerk=np.zeros_like(rate),
    )  # fmt: skip
    return reference, np.cumsum(stops)[:-1] * SAMPLE_TIME


def made_up(
    reference: Reference, name: str, size: float, *, phase: float = 0.0,
    diverged: float | None = None, estimate: bool = False, limit: float = 10.0,
    warnings: tuple[str, ...] = (), names: str = "XY",
) -> Recording:  # fmt: skip
    """Return a recording whose contour error is waves and bumps of about ``size`` metres."""
    time, n_axes = np.asarray(reference.time), reference.n_axes
    parameter = np.asarray(reference.parameter)
    velocity = np.asarray(reference.velocity)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    tangent = np.where(speed > 1e-9, velocity / np.maximum(speed, 1e-9), np.eye(n_axes)[0])
    normal = np.zeros_like(tangent)
    normal[:, 0], normal[:, 1] = -tangent[:, 1], tangent[:, 0]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    turning = np.linalg.norm(np.asarray(reference.acceleration), axis=1)
    error = size * (
        0.35 * np.sin(11 * time + phase)
        + 0.25 * np.sin(37 * time + 2 * phase)
        + 0.8 * turning / turning.max() * np.cos(5 * time + phase)
    )
    if diverged is not None:
        growth = np.exp(np.minimum(18 * time / diverged, 40))
        error = error + size * 1e-3 * growth * np.sin(60 * time)
    foot = np.asarray(reference.position)  # the lag is along the path and shows in tracking only
    vector = error[:, None] * normal
    tool = foot - vector
    lagged = foot + 3.0 * size * tangent * speed / speed.max()
    command = 4.0 * np.asarray(reference.acceleration) + 60.0 * velocity + 2e4 * vector
    command = np.clip(command, -limit, limit)
    data = {
        "reference": (("time", "axis"), lagged, {"units": "m"}),
        "actual": (("time", "axis"), tool, {"units": "m"}),
        "measured": (("time", "axis"), tool, {"units": "m"}),
        "tracking_error": (("time", "axis"), lagged - tool, {"units": "m"}),
        "command": (("time", "axis"), command, {"units": "V", "kind": "voltage"}),
        "command_limit": (("axis",), np.full(n_axes, limit), {"units": "V"}),
        "tool": (("time", "coordinate"), tool, {"units": "m"}),
        "contour_error": (
            ("time",), error if n_axes == 2 else np.abs(error),
            {"units": "m", "sign": "along the left normal", "kind": "local"},
        ),
        "contour_error_vector": (("time", "coordinate"), vector, {"units": "m"}),
        "foot_parameter": (("time",), parameter),
        "reference_parameter": (("time",), parameter),
        "status": (("time",), np.zeros(len(time), np.int32), {"meaning": "normal"}),
    }  # fmt: skip
    if estimate:
        data["contour_error_estimate"] = (("time", "coordinate"), vector * 1.05, {"units": "m"})
    attrs = {
        "contourlab": "0.1.0", "controller": name, "controller_class": name,
        "configuration": f"{name}(\n  kp={1 / size:.4g},\n)",
        "machine": "Machine(\n  axes=('X', 'Y'),\n)",
        "contour": "Path", "disturbances": "()", "sample_time": SAMPLE_TIME, "seed": 0,
        "outcome": "normal",
    }  # fmt: skip
    warnings = list(warnings)
    if diverged is not None:
        keep = int(diverged / SAMPLE_TIME)
        data = {
            key: (dims, values[:keep] if dims[0] == "time" else values, *rest)
            for key, (dims, values, *rest) in data.items()
        }
        time = time[:keep]
        outcome = f"diverged at {diverged:.4g} s on axis Y"
        attrs |= {"outcome": outcome, "diverged_at": diverged, "diverged_axis": "Y"}
        warnings.append(f"the run {outcome}: it was stopped there and has no figures")
    attrs["warnings"] = json.dumps(warnings)
    labels = list(names[:n_axes])
    coords = {"time": ("time", time, {"units": "s"}), "axis": labels, "coordinate": labels}
    return Recording(xr.Dataset(data, coords=coords, attrs=attrs))


def bracket_comparison(**changes) -> Comparison:
    path = bracket_path()
    reference, stops = travel(path, 0.05)
    own = {
        "axis_pid": (40e-6, {"warnings": ("saturated during 3.1 % of the samples",)}),
        "cross_coupled": (11e-6, {"phase": 1.0, "estimate": True}),
        "integral_sliding_mode": (20e-6, {"diverged": 1.9}),
    }
    recordings = {
        name: made_up(reference, name, size, limit=6.0, **more)
        for name, (size, more) in own.items()
    }
    made = {
        "recordings": recordings, "reference": reference, "machine": ball_screw_stage(),
        "part": bracket_part(path), "stops": tuple(stops), "scenario": SCENARIO,
        "title": "Bracket on the example machine",
    }  # fmt: skip
    return Comparison(**{**made, **changes})


def circle_reference(duration: float = 1.0) -> Reference:
    n = int(duration / SAMPLE_TIME)
    parameter = np.linspace(0.0, 4 * np.pi, n)  # two laps
    rate = np.full(n, parameter[1] / SAMPLE_TIME)
    return Reference.along(
        Circle(radius=0.02), sample_time=SAMPLE_TIME, parameter=parameter, parameter_rate=rate,
        parameter_acceleration=np.zeros(n), parameter_jerk=np.zeros(n),
    )  # fmt: skip


def spatial_comparison(n_coordinates: int = 3) -> Comparison:
    turn = np.linspace(0, 3 * np.pi, 60)
    columns = [20 * np.cos(turn), 20 * np.sin(turn), 2 * turn, turn][:n_coordinates]
    path = Path.polyline(np.stack(columns, axis=1) * 1e-3, np.arange(1, len(turn)))
    reference, stops = travel(path, 0.2)
    recordings = {
        name: made_up(reference, name, size, names="XYZA")
        for name, size in (("axis_pid", 40e-6), ("cross_coupled", 11e-6))
    }
    return Comparison(recordings, reference, ball_screw_stage(), None, tuple(stops))


def lone_comparison() -> Comparison:
    """One axis alone: tracking errors, and a contour error past the end of the line only."""
    n = 400
    time = np.arange(n) * SAMPLE_TIME
    parameter = np.minimum(0.1 * time, 0.03)
    rate = np.where(parameter < 0.03, 0.1, 0.0)
    reference = Reference.along(
        Line(start=[0.0], end=[0.03]), sample_time=SAMPLE_TIME, parameter=parameter,
        parameter_rate=rate, parameter_acceleration=0.0 * time, parameter_jerk=0.0 * time,
    )  # fmt: skip
    over = (2e-5 * np.sin(40 * time) * (time > 0.3))[:, None]
    flat = made_up(bracket_comparison().reference, "pid", 1e-5).dataset
    data = {
        name: (rows.dims, np.asarray(rows)[:n, :1] if rows.ndim == 2 else np.asarray(rows)[:n])
        for name, rows in flat.data_vars.items()
    }
    data |= {
        "tool": (("time", "coordinate"), np.asarray(reference.position) + over),
        "contour_error": (("time",), np.abs(over[:, 0])),
        "contour_error_vector": (("time", "coordinate"), -over),
        "foot_parameter": (("time",), parameter), "reference_parameter": (("time",), parameter),
        "command_limit": (("axis",), np.full(1, 6.0)),
    }  # fmt: skip
    coords = {"time": ("time", time), "axis": ["X"], "coordinate": ["X"]}
    recording = Recording(xr.Dataset(data, coords=coords, attrs=flat.attrs))
    return Comparison({"pid": recording}, reference, ball_screw_stage())


def refused_comparison() -> Comparison:
    """Two laws that ran between one that was refused and one that failed."""
    whole = bracket_comparison()
    runs = {name: whole.recordings[name] for name in ("axis_pid", "cross_coupled")}
    refusals = {
        name: Refusal("machine", name, f"{name} <b>is for</b> lathes, which turn", failed=failed)
        for name, failed in (("turning", False), ("threading", True))
    }
    pairs = {name: ("machine", name) for name in ("turning", *runs, "threading")}
    return bracket_comparison(recordings=runs, refusals=refusals, pairs=pairs)


HOSTILE = (
    '<b>b</b></script><script>window.hit=1</script><img src=x onerror="hit=1">{{7*7}}%{x}$a$\u2028'
)


def hostile_comparison() -> Comparison:
    """Every text that comes from a file tries to get out of its place."""
    path = bracket_path()
    reference, stops = travel(path, 0.2)
    recording = made_up(reference, HOSTILE, 40e-6, warnings=(HOSTILE,))
    recording.dataset.attrs |= {"configuration": HOSTILE, "machine": HOSTILE, "note": HOSTILE}
    lines = [HOSTILE] * len(PROGRAM)
    return Comparison(
        {HOSTILE: recording, "_b": made_up(reference, "_b", 10e-6)}, reference, ball_screw_stage(),
        bracket_part(path, lines, HOSTILE), tuple(stops), HOSTILE, HOSTILE,
    )  # fmt: skip


@pytest.fixture(scope="session")
def comparison() -> Comparison:
    return bracket_comparison()


@pytest.fixture(scope="session")
def made() -> SimpleNamespace:
    """What the tests of this folder build comparisons with."""
    return SimpleNamespace(
        bracket=bracket_comparison, spatial=spatial_comparison, hostile=hostile_comparison,
        refused=refused_comparison, lone=lone_comparison,
        bracket_path=bracket_path, bracket_part=bracket_part, travel=travel, recording=made_up,
        circle=circle_reference, hostile_text=HOSTILE,
    )  # fmt: skip


@dataclass(frozen=True)
class Visit:
    """What came of opening a page in Chromium."""

    dom: str
    requests: tuple[str, ...]
    """Addresses that the page asked for, itself apart."""
    console: tuple[str, ...]

    def attribute(self, name: str) -> str | None:
        """Return an attribute of the root element."""
        match = re.search(rf'<html[^>]*?\b{name}="([^"]*)"', self.dom)
        return match.group(1) if match else None


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory):
    """Return a function that opens a page without a network and returns a Visit."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    program = program or shutil.which("google-chrome")
    if program is None:
        pytest.skip("Chromium is not installed")

    def visit(page: FilePath, *flags: str, fragment: str = "") -> Visit:
        folder = tmp_path_factory.mktemp("chromium")
        log = folder / "net.json"
        result = subprocess.run(
            [
                program, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                "--disable-background-networking", "--enable-unsafe-swiftshader",
                f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}",
                "--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=20000",
                "--enable-logging=stderr", *flags, page.resolve().as_uri() + fragment,
            ],
            capture_output=True, text=True, timeout=180, check=False,
        )  # fmt: skip
        console = [line for line in result.stderr.splitlines() if ":CONSOLE:" in line]
        return Visit(result.stdout, _page_requests(log, page), tuple(console))

    return visit


def _page_requests(log: FilePath, page: FilePath) -> tuple[str, ...]:
    # the browser's own errands have no initiator; a page from a file has the origin "null"
    found = []
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        if '"initiator":"' not in line or '"initiator":"not an origin"' in line:
            continue
        parameters = json.loads(line.rstrip(","))["params"]
        if "url" in parameters and not parameters["url"].startswith(page.resolve().as_uri()):
            found.append(parameters["url"])
    return tuple(found)
