"""The page of an identified log in a real browser."""

from pathlib import Path

import pytest

import contourlab as cl
from contourlab.identification import identify_machine
from contourlab.reports import write_identification_report

LOG = Path(__file__).parents[2] / "examples" / "logs" / "simulated_stage.csv"


@pytest.mark.browser
def test_the_page_draws_without_an_error_and_asks_for_nothing(chromium, tmp_path):
    log = cl.logs.read_log(LOG, commanded="X_set", actual="X_actual", command="X_force")
    found = identify_machine(log.recording(), window=(0.0, 1.0), known={"delay": 0.8e-3})
    page = write_identification_report(found, tmp_path / "report.html", notes=("<b>note</b>",))
    visit = chromium(page, "--dump-dom")
    assert visit.attribute("data-ready") == "1"
    assert visit.attribute("data-errors") is None
    assert visit.requests == ()
    assert not [line for line in visit.console if "ERROR" in line or "Refused" in line]
    # residuals and their correlation
    assert visit.dom.count('class="main-svg" ') >= 2
    assert "&lt;b&gt;note" in visit.dom
    assert " ± " in visit.dom
