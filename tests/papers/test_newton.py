"""The published figures, the rules of the verdicts, and the claims of the text."""

import dataclasses
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.controllers import AxisPid
from contourlab.machines.published import ghaffari_three_axes, ghaffari_two_axes
from contourlab.papers import newton as paper
from contourlab.papers import newton_claims as claims
from contourlab.papers import newton_runs as runs
from contourlab.papers import newton_theorem as theorem
from contourlab.papers import papers
from contourlab.reports import PaperRow, reproduction_json

A, B50, B100, C = runs.CASES


def found(case, law, **options):
    recording = runs.run_case(runs.CASES[case], law, **options)
    return [1e6 * recording.metrics[f"contour_error_{name}"] for name in ("max", "mean")]


@pytest.mark.parametrize("case", [A, B50, B100])
def test_the_variable_gain_scheme_gives_the_published_figures(case):
    """Six figures, to half a unit of the last digit printed; 23 um is printed to two."""
    last = {A: (0.05, 0.05), B50: (0.05, 0.05), B100: (0.5, 0.05)}[case]
    error = np.abs(np.subtract(found(case, "variable gain"), paper.PUBLISHED[case, paper.VARIABLE]))
    assert np.all(error <= last), error


def test_the_proposed_scheme_gives_the_published_figures_of_a():
    error = np.abs(np.subtract(found(A, "converged"), paper.PUBLISHED[A, paper.PROPOSED]))
    assert np.all(error <= (0.05, 0.5)), error  # 23.2 and 7 um


def test_the_sample_time_does_not_matter_for_them():
    """0.02 and 0.1 ms: within a percent, less than the last digit printed."""
    coarse, fine = (found(B50, "variable gain", sample_time=dt) for dt in (1e-4, 2e-5))
    assert_allclose(coarse, fine, rtol=1e-2)


@pytest.mark.slow
def test_k_per_millisecond_gives_errors_of_the_published_size():
    """One choice of a unit against six figures: each within a fifth, but the TACE of C."""
    for case in (B50, B100, C):
        ratio = np.divide(found(case, "k' in 1/ms"), paper.PUBLISHED[case, paper.PROPOSED])
        assert 0.9 < ratio[0] < 1.1
        assert 0.75 < ratio[1] < 1.05 or case == C


def test_what_is_kept_of_a_run():
    """The law's own estimate is the static one; the reference needs (τ a + V) / k + 0.15 V."""
    case = runs.CASES[B50]
    kept = runs.outcome(run := runs.run_case(case, "variable gain", sample_time=1e-4), case,
                        points=500)  # fmt: skip
    assert_allclose(kept.largest, 1e6 * run.metrics["contour_error_max"])
    assert_allclose(kept.static, kept.estimated, rtol=0, atol=1e-9 * kept.largest)
    assert kept.static_off == pytest.approx(kept.estimate_off)
    assert 0.0 < kept.estimate_off < 0.1  # third order in a lag of 0.4 mm
    # at the ends of y = h x²: V = 2 h 20 mm 20 mm/s = 40 mm/s, a = 2 h (20 mm/s)² = 40 mm/s²
    # on x: V = 20 mm/s, a = 0
    assert_allclose(
        kept.needed, [20.0 / 10.3 + 0.15, (0.045 * 40.0 + 40.0) / 10.0 + 0.15], rtol=1e-9
    )
    assert 500 <= len(kept.time) <= 510


def test_k_per_second_is_not_what_the_paper_shows():
    assert found(B50, "k' in 1/s", sample_time=1e-4)[0] > 1e3


def test_the_position_loops_have_the_printed_gains():
    model = ghaffari_two_axes().nominal
    law = runs.pid_loops(model)
    assert isinstance(law, AxisPid)
    assert_allclose(1e-3 * np.asarray(law.kp), [8.08, 9.36], atol=0.005)
    assert_allclose(1e-3 * np.asarray(law.ki), [93.2, 108.0], atol=0.05)
    assert_allclose(1e-3 * np.asarray(law.kd), [0.24, 0.30], atol=0.005)
    sliding = runs.sliding_mode(model)
    assert_allclose(sliding.error_rate, [12.5, 11.1], atol=0.05)
    assert_allclose(sliding.acceleration_rate, [25.0, 22.2], atol=0.05)
    bound = sliding.bind(runs.parabola_reference(50.0, 2.0, 1e-3).contour, 1e-4)
    assert_allclose(1e-3 * bound.switching_gain, [0.2985, 0.3], atol=5e-5)


def test_the_machine_is_the_printed_equation():
    """P' = V, V' = -V / τ + (k / τ) (T + D): steady velocity k (T + D), reached with τ."""
    machine = ghaffari_three_axes()
    state = machine.init(np.zeros(3))
    command, push = np.array([1.0, -2.0, 0.5]), np.array([-0.15, -0.15, 0.3])
    after = machine.advance(state, command, push, dt=0.04)
    gain, lag = np.array([10.3, 10.0, 9.7]), np.array([0.040, 0.045, 0.050])
    speed = 1e-3 * gain * (command + push)
    exact = speed * (0.04 - lag * (1.0 - np.exp(-0.04 / lag)))
    assert_allclose(machine.true_position(after), exact, rtol=1e-12)
    assert_allclose(
        np.asarray(machine.nominal.mass)[:2], np.asarray(ghaffari_two_axes().nominal.mass)
    )


def invented(case, controller, factor, **changes):
    """An outcome with the published figures times a factor."""
    published = paper.PUBLISHED[case, controller]
    line = np.ones(3)
    made = runs.Outcome(
        largest=factor * published[0], mean=factor * published[1], command=np.array((3.0, 5.0)),
        needed=np.array((2.0, 4.0)), time=line, exact=line, estimated=line, static=2.0 * line,
    )  # fmt: skip
    return dataclasses.replace(made, **changes)


def all_outcomes(factor, **changes):
    return {
        (case, law): invented(
            case, paper.VARIABLE if law == "variable gain" else paper.PROPOSED, factor, **changes
        )
        for case in runs.CASES
        for law in paper.LAWS
    }


def test_verdicts_of_the_tables():
    pid = invented(C, paper.VARIABLE, 1.0)
    rows = paper.table_rows(all_outcomes(1.0), pid)
    assert len(rows) == 2 * 3 * 4
    assert {row.verdict for row in rows} == {"matched"}
    for row in paper.table_rows(all_outcomes(0.9), pid):
        below = row.quantity == "contour_error_max" and row.controller == paper.PROPOSED
        below = below and row.case.startswith((B100, C))
        assert row.verdict == ("relation" if below else "differs"), row
        better = row.case.endswith("converged") and not below
        assert ("does better" in row.note) == better, row
    above = paper.table_rows(all_outcomes(1.1), pid)
    assert {row.verdict for row in above} == {"differs"}
    assert not any("does better" in row.note for row in above)


def test_a_reason_is_given_only_where_it_holds():
    """Figures six times as large, and loops of A that do not give 241 um: nothing is known."""
    pid = invented(C, paper.VARIABLE, 0.5)
    rows = paper.table_rows(all_outcomes(6.0), pid)
    assert {row.verdict for row in rows} == {"differs"}
    assert all(row.note.endswith("unexplained") for row in rows)
    # TACE of C twice the printed: its half is the printed figure
    halves = [row for row in paper.table_rows(all_outcomes(2.0), pid) if "mean over" in row.note]
    assert [(row.case[:1], row.quantity) for row in halves] == [("C", "contour_error_mean")] * 3


def test_the_order_of_magnitude_is_judged():
    rows = paper.order_rows(all_outcomes(1.0))
    verdicts = [row.verdict for row in rows]
    # 39.5 / 7 is 5.6 in print: the claim does not hold for A
    assert verdicts == ["differs"] * 2 + ["relation"] * 6
    assert all("in print too" in row.note for row in rows[:2])
    failing = all_outcomes(1.0)
    failing[B50, "variable gain"] = failing[B50, "converged"]
    row = paper.order_rows(failing)[3]
    assert row.verdict == "differs"
    assert row.note.endswith("Unexplained")
    assert_allclose([rows[0].published, rows[2].published], [39.5 / 7.0, 1.6 / 0.11])


def test_estimates_that_do_not_follow_are_called_so():
    """Newton's estimate off by all of the error, the static one by nothing."""
    rows = list(claims.estimate_rows(all_outcomes(1.0, estimated=300.0 * np.ones(3),
                                                  static=np.ones(3))))  # fmt: skip
    assert len(rows) == 2 + 2 * 6
    assert {row.verdict for row in rows} == {"differs"}
    assert not any("V / k' along" in row.note for row in rows)  # 299 um is more than that
    third = [row for row in rows if "third order" in row.note]
    assert len(third) == 3
    assert all(row.case.endswith("converged") for row in third)
    # 0.07 um: within V / k' = 0.09 um of B and 0.18 um of C
    off = all_outcomes(1.0, largest=1.0, estimated=1.07 * np.ones(3))
    rows = [row for row in claims.estimate_rows(off) if "along the path" in row.note]
    assert [row.verdict for row in rows] == ["differs"] * 3
    assert all(row.case.endswith("k' in 1/ms") for row in rows)


def test_a_peak_on_one_axis_is_not_hidden_by_the_other():
    """5 V against 2 V is a peak, also where another axis needs 4 V."""
    fine = list(claims.peak_rows(all_outcomes(1.0)))
    assert [row.verdict for row in fine] == ["relation"] * 6
    assert_allclose([row.reproduced for row in fine], 1.5)
    rows = list(claims.peak_rows(all_outcomes(1.0, command=np.array((5.0, 4.0)))))
    assert [row.verdict for row in rows] == ["differs"] * 6
    assert_allclose([row.reproduced for row in rows], 2.5)


def test_the_residual_is_for_two_forms():
    law = runs.sliding_mode(ghaffari_two_axes().nominal, "matched")
    with pytest.raises(cl.errors.ConfigurationError, match=r"'none' or 'corrected'.*'matched'"):
        theorem.residual(law, 2.0, "matched")


def test_the_order_of_magnitude_is_that_of_the_gain():
    """With the gain of the proposed scheme near the path, the variable gain is as good in B."""
    stiff, new = (
        found(B50, law, sample_time=5e-5)[1] for law in ("stiff variable gain", "converged")
    )
    printed = paper.PUBLISHED[B50, paper.VARIABLE][1]
    assert stiff < 1.5 * new < 0.1 * printed


def test_theorem_1_is_answered():
    """No error for a constant disturbance; for a sine the residual that the law states."""
    rows = list(theorem.theorem_rows())
    assert [row.verdict for row in rows] == ["relation"] * 4
    assert rows[0].reproduced < 1e-6
    assert rows[1].reproduced > 1.0


@pytest.mark.slow
def test_the_disturbance_estimate_helps_where_the_disturbance_varies():
    rows = list(claims.disturbance_rows())
    by_kind = {
        kind: [row.verdict for row in rows if f"{kind} disturbance" in row.case]
        for kind in ("constant", "sine")
    }
    assert by_kind == {"constant": ["differs"] * 4, "sine": ["relation"] * 4}


@pytest.mark.slow
def test_the_whole_reproduction():
    seen = []
    result = cl.reproduce("newton", progress=lambda _, done: seen.append(done))
    assert papers()["newton"] is paper.PAPER
    assert_allclose(seen[-1], 1.0)
    assert np.all(np.diff(seen) > 0.0)
    body = json.loads(json.dumps(reproduction_json(result), allow_nan=False))
    assert body["paper"] == "newton"
    keys = {field.name for field in dataclasses.fields(PaperRow)}
    assert all(set(row) == keys for row in body["rows"])

    def verdicts(case, controller):
        return [
            row.verdict
            for row in result.rows
            if row.experiment.startswith("section")
            and row.case.startswith(case)
            and row.controller == controller
        ]

    for case in (A, B50, B100):
        assert verdicts(case, paper.VARIABLE) == ["matched"] * 2
    assert set(verdicts(A, paper.PROPOSED)) == {"matched"}
    assert verdicts(C, paper.VARIABLE) == ["differs"] * 2

    def claimed(text):
        chosen = [row for row in result.rows if row.experiment == "claims"]
        return [row.verdict[0] for row in chosen if text in f"{row.case}; {row.quantity}"]

    # by case, the k' in 1/ms before the exact estimate; r: relation, d: differs
    expected = {
        "path; TACE of variable gain over proposed": "dddd",
        "1/ms; TACE of variable gain over proposed": "drrr",
        "converged; TACE of variable gain over proposed": "drrr",
        "T_r = 2 s; largest error of the law's own": "rr",
        "1/ms; largest error of the law's own": "ddd",
        "converged; largest error of the law's own": "rrr",
        "1/ms; largest error of the static": "drr",
        "converged; largest error of the static": "rrr",
        "largest command": "rrrrrr",
        "constant disturbance": "dddd",
        "sine disturbance": "rrrr",
        "off by 30 %": "rrrr",
        "Theorem 1": "rrrr",
        "three axes": "rdr",
    }
    for text, verdict in expected.items():
        assert "".join(claimed(text)) == verdict, text
    assert len(claimed("")) == sum(map(len, expected.values()))
    assert not any("nexplained" in row.note for row in result.rows if "static" not in row.quantity)
    assert [figure.name for figure in result.figures] == list(paper.PAPER.figures)
