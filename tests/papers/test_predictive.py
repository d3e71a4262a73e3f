"""The closed loops against another author's, the printed model, the rules of the verdicts."""

import dataclasses
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.errors import ConfigurationError
from contourlab.machines.published import el_khalick_feed_drive
from contourlab.papers import papers
from contourlab.papers import predictive as paper
from contourlab.papers import predictive_rows as rows
from contourlab.papers import predictive_runs as runs
from contourlab.papers.predictive_runs import CONTOUR, EQUAL, FREE, LOWERED, PLAIN, RAISED, Case
from contourlab.reports import reproduction_json

INDEPENDENT = {
    Case("circle", PLAIN, EQUAL): (0.312632, 0.549545),
    Case("circle", PLAIN, CONTOUR): (0.133006, 0.228685),
    Case("circle", PLAIN, LOWERED): (0.0487573, 0.0842559),
    Case("figure of eight", PLAIN, EQUAL): (0.319083, 0.557215),
    Case("figure of eight", PLAIN, CONTOUR): (0.135356, 0.232837),
    Case("figure of eight", PLAIN, LOWERED): (0.0504609, 0.0998488),
    Case("circle", FREE, EQUAL): (0.0181292, 0.278304),
    Case("circle", FREE, CONTOUR): (0.010646, 0.14572),
    Case("figure of eight", FREE, LOWERED): (0.00641007, 0.0944782),
    Case("helix", PLAIN, CONTOUR): (0.1384, None),
}
"""Rms and largest contour error [um] by a simulation of another author in NumPy (no shared code),
with friction that sticks exactly."""
QUICK = (
    Case("circle", PLAIN, CONTOUR), Case("figure of eight", PLAIN, LOWERED),
    Case("circle", PLAIN, LOWERED),
)  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=() if c in QUICK else pytest.mark.slow) for c in INDEPENDENT],
)
def test_closed_loops_agree_with_an_independent_simulation(case):
    found = runs.judged(case, runs.run_case(case))
    for value, wanted in zip(found, INDEPENDENT[case], strict=True):
        if wanted is not None:
            # the sign of the velocity is smoothed here, over 0.1 um/s
            assert_allclose(value, wanted, rtol=5e-3)


def test_the_machine_is_table_1():
    nominal = el_khalick_feed_drive().nominal
    r = 0.005 / (2.0 * np.pi)
    inertia = 0.05 + np.array([8.0, 2.5]) * r**2
    assert_allclose(nominal.viscous / nominal.mass, 0.31 / inertia, rtol=1e-14)
    assert_allclose(nominal.gain / nominal.mass, 1.4 * r / inertia, rtol=1e-14)
    assert el_khalick_feed_drive(n_axes=3).names == ("X", "Y", "Z")
    heavy = el_khalick_feed_drive(workpiece_mass=50.0)
    assert_allclose(heavy.nominal.mass, nominal.mass, rtol=0)  # laws are not told
    with pytest.raises(ConfigurationError, match="n_axes must be 2 or 3, got 4"):
        el_khalick_feed_drive(n_axes=4)
    with pytest.raises(ConfigurationError, match="workpiece_mass must be >= 0 and finite, got -1"):
        el_khalick_feed_drive(workpiece_mass=-1.0)


def test_the_printed_polynomials():
    found = {(row.case, row.quantity): row for row in rows.model_rows()}
    assert len(found) == 8
    differs = {key for key, row in found.items() if row.verdict == "differs"}
    assert differs == {("axis X", "B, second"), ("axis Y", "B, second")}
    # by hand, from Table 1
    assert_allclose(found["axis X", "A, q^-1"].reproduced, -1.969478618, rtol=1e-9)
    assert_allclose(found["axis X", "B, first"].reproduced, 2.75637625e-7, rtol=1e-8)
    assert_allclose(found["axis Y", "B, second"].reproduced, 2.728229514e-7, rtol=1e-8)
    assert "0.27" not in found["axis X", "B, first"].note
    assert "2.7e-07" in found["axis X", "B, second"].note


@pytest.mark.parametrize("speed", [1.0, 10.0])
def test_the_trajectories_are_those_of_the_paper(speed):
    t = runs.paper_reference("circle", speed).time
    angle = np.pi / 10.0 * speed * t
    wanted = {
        "circle": np.stack([np.sin(angle), np.cos(angle)], 1),  # (22)
        "figure of eight": np.stack([np.sin(angle), np.sin(2.0 * angle)], 1),  # (23)
    }
    for name, position in wanted.items():
        reference = runs.paper_reference(name, speed)
        assert_allclose(reference.position, 0.005 * position, rtol=0, atol=1e-16 * 200)
        assert reference.duration >= 20.0 / speed + 30 * 0.005  # the horizon after the window


def test_every_case_is_run_once_and_every_row_finds_its_own():
    todo = list(runs.cases())
    assert len(set(todo)) == len(todo)
    fine = dict.fromkeys(todo, (1.0, 1.0))
    for case in todo:
        better = 0.5 if case.weights in (CONTOUR, LOWERED, RAISED) else 1.0
        fine[case] = (better, better)
    for case, change in zip(todo, [c.change for c in todo], strict=True):
        value = {"D = 1": 9.0, "D = 1 - 1/q": 4.0, "(6) and (21) as printed": 50.0}.get(change)
        if value is not None:
            fine[case] = (value, value)
        if change == "rho_n / 10":
            fine[case] = fine[Case(weights=CONTOUR)]
    fine[Case("circle", PLAIN)] = (3.0, 3.0)
    fine[Case("circle", PLAIN, axis=True)] = (3.0, 3.0)
    made = list(all_rows(fine))
    assert {row.verdict for row in made} == {"relation"}
    worse = dict.fromkeys(todo, (1.0, 1.0))  # nothing falls
    claims = [row for row in all_rows(worse) if row.quantity == "fall of the rms"]
    assert {row.verdict for row in claims} == {"differs"}
    assert all(row.reproduced == 0.0 for row in claims)


def all_rows(found):
    yield from rows.study_rows(found)
    yield from rows.bound_rows(found)
    yield from rows.robust_rows(found)
    yield from rows.space_rows(found)


def test_a_fall_of_the_rms_alone_is_no_relation():
    found = dict.fromkeys(runs.cases(), (1.0, 1.0))
    found[Case(weights=CONTOUR)] = (0.5, 1.1)
    claim = [
        row
        for row in rows.study_rows(found)
        if row.experiment.startswith("circle")
        and PLAIN in row.experiment
        and row.case.endswith(CONTOUR)
    ]
    assert [row.verdict for row in claim] == ["differs"] * 3
    assert claim[2].reproduced == 50.0


@pytest.mark.slow
def test_the_whole_reproduction():
    """Which claims hold, and that no row that differs lacks its reason."""
    assert papers()["predictive"] is paper.PAPER
    seen = []
    found = cl.reproduce("predictive", progress=lambda _, done: seen.append(done))
    assert_allclose(seen[-1], 1.0)
    body = json.loads(json.dumps(reproduction_json(found), allow_nan=False))
    assert body["paper"] == "predictive"
    assert not any("not explained" in row["note"] for row in body["rows"])
    verdicts = {}
    for row in found.rows:
        verdicts.setdefault((row.experiment, row.case), set()).add(row.verdict)
    for (experiment, case), seen_verdicts in verdicts.items():
        if "Figure" in experiment and "Figure" in case:
            wanted = "differs" if RAISED in case else "relation"
            assert seen_verdicts == {wanted}, (experiment, case)
        if experiment.startswith(("three axes", "circle: ")):
            assert seen_verdicts == {"relation"}, (experiment, case)
    assert [figure.name for figure in found.figures] == list(paper.PAPER.figures)
    assert dataclasses.is_dataclass(found)
