"""The page and the tables of an evaluated log."""

import io
import json
import re

import numpy as np
import pytest

import contourlab as cl
from contourlab.errors import OutputError
from contourlab.reports import evaluation_json, evaluation_tables, write_evaluation
from contourlab.reports.evaluation_table import with_half_width


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    t = np.linspace(0.0, 6.6, 3000)
    circle = 0.03 * np.column_stack([np.cos(t), np.sin(t)])
    wave = 1.0 + 1e-4 * np.cos(2.0 * t)
    file = tmp_path_factory.mktemp("log") / "<b>log.csv"
    np.savetxt(file, np.column_stack([t, circle, circle * wave[:, None]]), delimiter=",",
               header="t_s,xs_m,ys_m,xa_m,ya_m", comments="", fmt="%.9f")  # fmt: skip
    return cl.evaluate(file, commanded="xs_m,ys_m", actual="xa_m,ya_m", measured="tool")


def test_the_page_holds_everything_and_asks_nobody(found, tmp_path):
    page = write_evaluation(found, tmp_path / "report.html").read_text()
    assert "default-src 'none'" in page
    own = page.split('id="data"')[0]  # before plotly's own text
    assert not re.search(r"(?:src|href)=", own)
    assert "&lt;b&gt;log.csv" in own
    assert "<b>log" not in own
    for words in (
        "Where the contour error comes from",
        "magnification",
        "G = ",
        "radial deviation F",
    ):
        assert words in page
    data = json.loads(re.search(r'type="application/json">(.*?)</script>', page, re.S)[1])
    assert {cause["name"] for cause in data["causes"]} <= {c.name for c in found.causes}
    with pytest.raises(OutputError, match="exists already"):
        write_evaluation(found, tmp_path / "report.html")


@pytest.mark.browser
def test_the_page_draws_without_an_error_and_asks_for_nothing(chromium, found, tmp_path):
    visit = chromium(write_evaluation(found, tmp_path / "report.html"), "--dump-dom")
    assert visit.attribute("data-ready") == "yes"
    assert visit.attribute("data-errors") is None
    assert visit.requests == ()
    assert not [line for line in visit.console if "ERROR" in line or "Refused" in line]
    # path, causes, error over time, lag and tracking error
    assert visit.dom.count('class="main-svg" ') >= 4


def test_the_terminal_shows_signs_as_words(found):
    from rich.console import Console

    console = Console(width=120, record=True, file=io.StringIO())
    for table in evaluation_tables(found):
        console.print(table)
    text = console.export_text()
    assert "+-" in text  # the log has nanometres: no figure is exact
    assert "\\x" not in text


def test_json_is_finite_and_si(found):
    body = evaluation_json(found, None)
    text = json.dumps(body, allow_nan=False)
    assert body["metrics"]["contour_error_max"] == found.metrics["contour_error_max"]
    assert "NaN" not in text
    # an oval of 3 um about its mean radius has a circular deviation of 6 um
    np.testing.assert_allclose(
        body["circular_test"]["directions"][0]["circular_deviation"], 6e-6, rtol=2e-2
    )


def test_tables_name_their_units(found):
    titles = [str(table.title) for table in evaluation_tables(found)]
    assert titles[:2] == ["Columns", "Figures"]
    assert any("ISO 230-4" in title for title in titles)


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (12.34e-6, 0.0, "12.3"),
        (12.34e-6, 2e-6, "12 ± 2.00"),
        (12.34e-6, 0.3e-6, "12.3 ± 0.300"),
        (2e-6, 5e-6, "below 7.00"),
        (float("nan"), 0.0, "-"),
    ],
)
def test_a_figure_has_no_more_digits_than_it_is_worth(value, half, shown):
    assert with_half_width(value, half) == shown
