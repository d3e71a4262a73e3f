"""Reports of several machines, of values that vary, and of corners."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
import xarray as xr

from contourlab.machines import ball_screw_stage, linear_motor_stage
from contourlab.reports import comparison_json, comparison_table, spread_table, write_figures
from contourlab.reports.drawing import make_drawing
from contourlab.reports.panels import command_panels
from contourlab.reports.provenance import provenance
from contourlab.reports.strips import strips_of
from contourlab.reports.wording import result_sentences, table_columns
from contourlab.simulation import Comparison, Normal, Spread, Uniform, Variation

from .test_page import decoded, read

SIZES = {"pid on mill": 40e-6, "cross on mill": 11e-6, "pid on lathe": 30e-6,
         "cross on lathe": 50e-6}  # fmt: skip


def spread_of(size, n=200, lost=0):
    values = size * (1.0 + 0.3 * np.sin(np.arange(n) ** 2))
    values[:lost] = np.nan
    data = {
        "machine.mass": (("lane", "machine.mass_0"), np.outer(np.arange(n), [1.0, 2.0])),
        "contour_error_rms": ("lane", values),
        "contour_error_max": ("lane", 3.0 * values),
        "tracking_error_rms": ("lane", 5.0 * values),
        "diverged_at": ("lane", np.where(np.isnan(values), 1.0, np.nan)),
    }
    return Spread(xr.Dataset(data), ("machine.mass",))


@pytest.fixture(scope="module")
def several(made) -> Comparison:
    single = made.bracket()
    recordings = {}
    for k, (name, size) in enumerate(SIZES.items()):
        limit = 6.0 if "mill" in name else 9.0
        recordings[name] = made.recording(single.reference, name, size, phase=k, limit=limit)
    return dataclasses.replace(
        single, recordings=recordings, title="Two machines",
        machines={"mill": ball_screw_stage(), "lathe": linear_motor_stage()},
        pairs={name: tuple(name.split(" on ")[::-1]) for name in SIZES},
        spread={name: spread_of(size, lost=15 * (k == 3))
                for k, (name, size) in enumerate(SIZES.items())},
        variation=Variation(
            changes={"machine.mass": Uniform(relative=0.2), "controller.kp": Normal(relative=0.1)},
            samples=200,
        ),
        notes=(("axis limits", "all the same"),),
    )  # fmt: skip


@pytest.fixture(scope="module")
def page(several, tmp_path_factory):
    from contourlab.reports import write_report

    file = write_report(several, tmp_path_factory.mktemp("report") / "report.html")
    assert file.stat().st_size < 10_000_000
    return read(file.read_text(encoding="utf-8"))


def shown(table):
    from rich.console import Console

    console = Console(file=io.StringIO(), width=80, legacy_windows=False)
    console.print(table)
    return console.file.getvalue()


def test_each_machine_has_its_own_best(several):
    rms = table_columns(several)[0]
    assert [cell.best for cell in rms.cells] == [False, True, True, False]
    first = result_sentences(make_drawing(several))[0]
    assert first.startswith("Closest to the path: on mill cross (")
    assert " and on lathe pid (" in first
    better = {**several.recordings, "cross on lathe": several.recordings["cross on mill"]}
    same = dataclasses.replace(several, recordings=better)
    first = result_sentences(make_drawing(same))[0]
    assert first.startswith("cross keeps the tool closest to the path on both machines: ")


def test_a_controller_keeps_its_colour_and_changes_its_dash(several):
    a, b, c, d = make_drawing(several).runs
    assert a.look.light == c.look.light != b.look.light == d.look.light
    assert a.look.dash == b.look.dash != c.look.dash == d.look.dash
    assert len({(run.look.light, run.look.marker) for run in (a, b, c, d)}) == 4


def test_commands_with_other_limits_have_panels_of_their_own(several, made):
    panels = command_panels(make_drawing(several))
    assert [panel.title for panel in panels] == ["X, mill", "X, lathe", "Y, mill", "Y, lathe"]
    assert [panel.limit for panel in panels] == [6.0, 9.0, 6.0, 9.0]
    assert [len(panel.runs) for panel in panels] == [2, 2, 2, 2]
    notes = {c.note for c in table_columns(several) if c.group == "command max"}
    assert notes == {"limits differ"}
    single = command_panels(make_drawing(made.bracket()))
    assert [(panel.title, len(panel.runs)) for panel in single] == [("X", 3), ("Y", 3)]


def test_units_that_differ_stand_in_the_cells(several):
    other = several.recordings["pid on lathe"].dataset.copy()
    other["command"].attrs["units"] = "N"
    recordings = {
        **several.recordings,
        "pid on lathe": type(several.recordings["pid on mill"])(other),
    }
    columns = table_columns(dataclasses.replace(several, recordings=recordings))
    column = next(c for c in columns if c.group == "command max")
    assert column.unit == ""
    assert column.cells[0].text.endswith("\u00a0V")
    assert column.cells[2].text.endswith("\u00a0N")


def test_the_page_groups_by_machine_and_shows_the_spread(several, page):
    assert page.text.index("mill") < page.text.index("lathe")
    assert "Spread over 200 samples" in page.text
    assert "cross on lathe diverged in 15 of 200 samples." in page.text
    assert "Over 200 samples on mill, cross bears variation best" in page.text
    assert "uniform, ±20 %" in page.text
    assert "normal, standard deviation 10 %" in page.text
    assert "axis limits all the same" in page.text
    assert "Machine mill" in page.text
    rows = page.data["spread"][0]["rows"]
    assert [row["run"] for row in rows] == [0, 1, 2, 3]
    assert rows[3]["diverged"] == 15
    assert rows[3]["high"] is None  # more than 5 % diverged
    values = np.sort(several.spread["pid on mill"].values("contour_error_rms")) * 1e6
    np.testing.assert_allclose(decoded(rows[0]["values"]), values, rtol=1e-6)
    assert rows[0]["median"] == pytest.approx(np.median(values))
    assert [panel["limit"] for panel in page.data["commands"]] == [6.0, 9.0, 6.0, 9.0]


def test_the_page_has_the_corners(several, page):
    # the bracket turns sharply at the ends of lines 9, 10 and 12
    assert "Over 3 corners, each with the path up to 1 mm" in page.text
    assert "overshoot [µm]" in page.text
    figures = several.corners["pid on mill"]
    assert [one.corner.line_before for one in figures] == [9, 10, 12]
    round_ = dataclasses.replace(several, corner_radius=2e-3)
    assert [one.corner.radius for one in round_.corners["pid on mill"]] == pytest.approx([2e-3] * 3)


def test_a_contour_without_corners_has_no_such_section(made, tmp_path):
    from contourlab.reports import write_report

    reference = made.circle()
    round_ = Comparison(
        {"pid": made.recording(reference, "pid", 1e-5)}, reference, ball_screw_stage()
    )
    file = write_report(round_, tmp_path / "a.html")
    assert "Corners" not in read(file.read_text(encoding="utf-8")).text
    (run,) = comparison_json(round_)["runs"]
    assert run["machine"] == "machine"
    assert "corners" not in run
    assert "spread" not in run


def test_many_samples_are_thinned_and_their_ends_kept(several):
    many = {name: spread_of(size, n=5000) for name, size in SIZES.items()}
    strips = strips_of(make_drawing(dataclasses.replace(several, spread=many)))
    row = strips[0].rows[0]
    whole = many["pid on mill"].values("contour_error_rms") * 1e6
    assert len(row.values) <= 800
    assert row.values[0] == whole.min()
    assert row.values[-1] == whole.max()
    assert np.abs(row.offset).max() <= 1.0


def test_terminal_and_json(several):
    text = shown(comparison_table(several))
    assert "on mill" in text
    assert "on lathe" in text
    assert text.count("pid") == 2
    text = shown(spread_table(several))
    assert all(len(line) <= 80 for line in text.splitlines())
    assert text.isascii() or "─" in text
    assert "200 samples: median [5 % .. 95 %] in um" in text
    body = comparison_json(several)
    assert [(r["machine"], r["controller"]) for r in body["runs"]] == [
        ("mill", "pid"), ("mill", "cross"), ("lathe", "pid"), ("lathe", "cross"),
    ]  # fmt: skip
    lost = body["runs"][3]["spread"]
    assert lost["diverged"] == 15
    assert lost["metrics"]["contour_error_rms"]["p95"] is None
    assert lost["metrics"]["contour_error_rms"]["worst"] is None
    assert lost["metrics"]["contour_error_rms"]["worst_values"] == {"machine.mass": [0.0, 0.0]}
    assert body["runs"][0]["corners"]["count"] == 3
    assert spread_table(dataclasses.replace(several, spread={}, variation=None)) is None


def test_the_figure_of_the_spread(several, tmp_path):
    files = [file.name for file in write_figures(several, tmp_path)]
    errors = ["contour_error.png", "tracking_error.png"]
    assert files == ["path.png", *errors, "commands.png", "summary.png", "spread.png"]
    assert (tmp_path / "spread.png").read_bytes()[:4] == b"\x89PNG"


def test_assumptions_and_configurations_of_all_machines(several):
    made_by = provenance(several)
    assert [name for name, _ in made_by.machines] == ["mill", "lathe"]
    assert ("samples", "200, the same ones for every controller; seed 0") in made_by.facts
