"""The helix against an independent simulation, the rules of the verdicts, the registry."""

import dataclasses
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.errors import ConfigurationError, OutputError
from contourlab.papers import natural_local as paper
from contourlab.papers import natural_local_rows as rows_of
from contourlab.papers import natural_local_runs as runs
from contourlab.papers import paper_named, papers
from contourlab.reports import (
    PaperFigure,
    PaperRow,
    Reproduction,
    reproduction_json,
    reproduction_notes,
    reproduction_table,
    write_paper_figures,
)

# mean contour error [um], by a simulation of another author in NumPy (no shared code), 1 ms
INDEPENDENT = {
    (180.0, 1e-3, 0): (90.19, 88.78),
    (185.0, 1e-3, 0): (17.95, 9.27),
    (185.0, 1e-3, 1): (15.07, 5.33),
    (185.0, 2e-4, 1): (10.66, 1.83),
}


@pytest.mark.parametrize(
    ("viscous", "period", "gains"),
    [
        (180.0, 1e-3, 0),
        (185.0, 1e-3, 0),
        (185.0, 1e-3, 1),
        pytest.param(185.0, 2e-4, 1, marks=pytest.mark.slow),
    ],
)
def test_the_helix_agrees_with_an_independent_simulation(viscous, period, gains):
    found = [
        1e6
        * runs.helix_run(law, rows_of.GAINS[gains], viscous_z=viscous, sample_time=period).metrics[
            "contour_error_mean"
        ]
        for law in (runs.FIRST, runs.NATURAL)
    ]
    # that one is printed to 0.01 um
    assert_allclose(found, INDEPENDENT[viscous, period, gains], rtol=0, atol=0.006)


def test_the_contours_are_those_of_the_paper():
    t = np.linspace(0.0, 2.0, 7)
    helix = np.array([runs.MengHelix().position(2.0 * np.pi * x) for x in t])
    wave = 2.0 * np.pi * t
    wanted = np.stack([0.03 * np.cos(wave), 0.01 * np.sin(wave), 0.1 * t], axis=1)
    assert_allclose(helix, wanted, atol=1e-15)
    ellipse, eight = (runs.stage_reference(name) for name in rows_of.TABLES)
    for reference, omega, y in (
        (ellipse, 1.8 * np.pi, lambda a: 0.01 * np.sin(a)),
        (eight, np.pi, lambda a: 0.03 * np.sin(2.0 * a)),
    ):
        a = omega * reference.time
        wanted = np.stack([0.03 * (1.0 - np.cos(a)), y(a)], axis=1)
        assert_allclose(reference.position, wanted, atol=1e-13)
    # 10 and 12 m/min are printed; ω a at a vertex, and hypot(ω a, 2 ω b) at the crossing
    rows = [rows_of.speed_row(name) for name in rows_of.TABLES]
    wanted = 60.0 * np.pi * 0.03 * np.array([1.8, np.sqrt(5.0)])
    assert_allclose([row.reproduced for row in rows], wanted, rtol=1e-4)  # samples beside the top
    assert [(row.published, row.verdict) for row in rows] == [(10.0, "matched"), (12.0, "differs")]


def published_means():
    return {(case, law, k): v for case in rows_of.VARIANTS for (law, k), v in rows_of.HELIX.items()}


def test_verdicts_of_the_helix():
    rows = list(rows_of.helix_rows(published_means()))
    assert len(rows) == 8 * len(rows_of.VARIANTS)
    assert {row.verdict for row in rows if row.published is not None} == {"matched"}
    assert {row.verdict for row in rows if row.published is None} == {"relation"}
    equal = dict.fromkeys(published_means(), 50.0)
    for row in rows_of.helix_rows(equal):
        little = row.controller == runs.FIRST and row.quantity.startswith("reduction")
        assert row.verdict == ("relation" if little else "differs"), row


@pytest.mark.parametrize("contour", rows_of.TABLES)
def test_verdicts_of_the_tables(contour):
    table = rows_of.TABLES[contour]
    rows = list(rows_of.stage_rows(contour, table, table))
    assert len(rows) == 36 + 3
    assert {row.verdict for row in rows} == {"relation"}
    assert all("emulation" in row.note for row in rows)
    turned = dict(zip(table, reversed(list(table.values())), strict=True))
    wrong = [row for row in rows_of.stage_rows(contour, table, turned) if row.verdict == "differs"]
    assert {row.quantity for row in wrong} >= {"contour_error_max", "contour_error_rms"}
    assert any("in print" in row.note for row in wrong)


def test_an_order_that_breaks_is_named():
    keys = [("a", 60), ("a", 80), ("b", 60)]
    published = dict(zip(keys, (10.0, 5.0, 10.2), strict=True))
    assert rows_of.broken_order(published, dict(zip(keys, (30.0, 20.0, 31.0), strict=True))) == ""
    said = rows_of.broken_order(published, dict(zip(keys, (30.0, 31.0, 30.0), strict=True)))
    assert said == "a at 60 Hz to a at 80 Hz is 2.00 in print and 0.97 here"
    assert "b at 60 Hz" in rows_of.broken_order(
        published, dict(zip(keys, (30.0, 20.0, 40.0), strict=True))
    )


def test_papers_are_found_by_slug():
    assert papers()["natural-local"] is paper.PAPER
    assert paper_named("natural_local") is paper.PAPER
    with pytest.raises(
        ConfigurationError, match=r"unknown paper 'natural'; did you mean natural-l"
    ):
        cl.reproduce("natural")


def test_rows_have_a_known_verdict():
    row = next(iter(rows_of.helix_rows(published_means())))
    with pytest.raises(ValueError, match="verdict must be one of matched, relation, differs"):
        dataclasses.replace(row, verdict="close")


def test_the_table_leads_from_every_row_to_its_note():
    rows = list(rows_of.helix_rows(published_means()))
    found = Reproduction(paper="p", title="t", rows=tuple(rows))
    notes = reproduction_notes(found)
    assert len(set(notes)) == len(notes) < len(rows)
    numbers = [cell for cell in reproduction_table(found).columns[-1].cells if cell]
    # the first row of the table is the heading of the experiment
    assert [notes[int(number.plain[1:-1]) - 1] for number in numbers] == [r.note for r in rows]


def test_figures_are_written_and_never_over_others(tmp_path):
    time = np.linspace(0.0, 1.0, 50)
    figure = PaperFigure(
        name="f", title="t", y_label="y", time=time, curves=(("a", time), ("b $x$", 2.0 * time))
    )
    (file,) = write_paper_figures([figure], tmp_path / "out")
    assert file.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(OutputError, match="exists already"):
        write_paper_figures([figure], tmp_path / "out")
    with pytest.raises(OutputError, match="is a file"):
        write_paper_figures([figure], file)


@pytest.mark.slow
def test_the_whole_reproduction():
    """Which figures cannot be had as printed, and which relations hold."""
    seen = []
    found = cl.reproduce("natural-local", progress=lambda _, done: seen.append(done))
    assert_allclose(seen[-1], 1.0)
    body = json.loads(json.dumps(reproduction_json(found), allow_nan=False))
    assert body["paper"] == "natural-local"
    keys = {field.name for field in dataclasses.fields(PaperRow)}
    assert all(set(row) == keys for row in body["rows"])
    assert len(body["rows"]) == 8 * len(rows_of.VARIANTS) + 2 * 40

    def verdicts(case, quantity, experiment="helix"):
        return [
            row.verdict
            for row in found.rows
            if row.experiment.startswith(experiment)
            and row.case.startswith(case)
            and row.quantity == quantity
        ]

    assert set(verdicts("as printed", "contour_error_mean")) == {"differs"}
    for case in ("B of z 185;", "B of z 185, 0.2 ms;"):
        below = verdicts(case, "natural local below first order")
        gains = verdicts(case, "reduction by higher gains")
        assert set(below) | set(gains) <= {"relation", "matched"}
    for table in ("ellipse", "figure of eight"):
        assert set(verdicts("", "contour_error_rms", table)) == {"relation"}
        assert set(verdicts("", "command_rms_x", table)) == {"relation"}
    assert [figure.name for figure in found.figures] == list(paper.PAPER.figures)
