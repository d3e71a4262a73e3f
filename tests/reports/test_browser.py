"""The page in a real browser without a network."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from PIL import Image

from contourlab.reports import write_report

pytestmark = pytest.mark.browser

# appended to a copy of the page: waits until it is drawn, acts, then writes down what is drawn
PROBE = """
<script>
const probe = setInterval(() => {
  if (!document.documentElement.dataset.ready) return;
  clearInterval(probe);
  ACT
  setTimeout(() => {
    const figure = document.getElementById("path");
    const curve = figure.data.find((trace) => trace.mode === "lines" && trace.hovertext);
    const out = document.createElement("pre");
    out.id = "probe";
    out.textContent = JSON.stringify({
      x: Array.from(curve.x), y: Array.from(curve.y),
      visible: figure.data.map((t) => t.visible !== false),
      note: figure.layout.annotations.map((a) => a.text), hash: location.hash,
      ranges: Object.fromEntries(["error_time", "error_distance", "tracking_error", "command"].map(
        (id) => [id, document.getElementById(id).layout.xaxis.range])),
      hit: typeof window.hit, images: document.images.length,
      labels: [...document.querySelectorAll("#error_time .annotation-text")]
        .map((text) => text.textContent),
      types: figure.data.map((trace) => trace.type),
    });
    document.body.append(out);
  }, 500);
}, 50);
</script>
"""


def probed(chromium, report, tmp_path, act="", fragment="", *flags):
    copy = tmp_path / "probe.html"
    copy.write_text(
        report.read_text(encoding="utf-8") + PROBE.replace("ACT", act), encoding="utf-8"
    )
    visit = chromium(copy, "--dump-dom", *flags, fragment=fragment)
    assert visit.attribute("data-errors") is None, visit.attribute("data-errors")
    match = re.search(r'<pre id="probe">(.*?)</pre>', visit.dom, re.DOTALL)
    assert match, "the page did not get ready"
    text = match.group(1).replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
    return visit, json.loads(text)


@pytest.fixture(scope="module")
def report(comparison, tmp_path_factory):
    return write_report(comparison, tmp_path_factory.mktemp("browser") / "report.html")


def test_the_page_draws_without_an_error_and_asks_for_nothing(chromium, report):
    visit = chromium(report, "--dump-dom")
    assert visit.attribute("data-ready") == "1"
    assert visit.attribute("data-errors") is None
    assert visit.requests == ()
    assert not [line for line in visit.console if "ERROR" in line or "Refused" in line]
    # path, two error curves, two close-ups, commands, tracking errors
    assert visit.dom.count('class="main-svg" ') >= 7
    assert "deviation drawn 100 × larger" in visit.dom


def test_the_browser_check_sees_requests_and_errors(chromium, tmp_path):
    page = tmp_path / "bad.html"
    page.write_text('<img src="http://a.test/x.png"><script>console.error("no")</script>')
    visit = chromium(page, "--dump-dom")
    assert visit.requests == ("http://a.test/x.png",)
    assert visit.console


def test_the_policy_stops_a_request(chromium, report, tmp_path):
    copy = tmp_path / "asks.html"
    text = report.read_text(encoding="utf-8")
    asks = '<img src="http://a.test/x.png"><script>fetch("http://b.test/x")</script>'
    copy.write_text(text + asks, encoding="utf-8")
    visit = chromium(copy, "--dump-dom")
    assert visit.requests == ()
    assert any("a.test" in line for line in visit.console)
    assert any("b.test" in line for line in visit.console)


@pytest.fixture(scope="module")
def before(chromium, report, tmp_path_factory):
    """What is drawn before the reader does anything."""
    return probed(chromium, report, tmp_path_factory.mktemp("before"))[1]


@pytest.mark.parametrize("how", ["slider", "address"])
def test_the_reader_changes_the_factor(chromium, report, before, tmp_path, how):
    # the slider is logarithmic from 1 to 10 000: the middle is 100, three quarters 1000
    act = {
        "slider": "const s = document.getElementById('slider'); s.value = 750;"
        "s.dispatchEvent(new Event('input'));",
        "address": "",
    }[how]
    fragment = "#magnification=1000" if how == "address" else ""
    visit, after = probed(chromium, report, tmp_path, act, fragment)
    assert visit.attribute("data-magnification") == "1000"
    assert after["hash"] == "#magnification=1000"
    assert "deviation drawn 1,000 × larger" in after["note"]
    assert "deviation drawn 100 × larger" in before["note"]
    # from 100 to 1000 every point moves nine times its drawn deviation away from the path
    moved = np.hypot(np.subtract(after["x"], before["x"]), np.subtract(after["y"], before["y"]))
    assert moved.max() > 1.0


@pytest.mark.parametrize("over", ["time", "distance"])
def test_a_key_hides_a_controller_and_figures_zoom_together(chromium, report, tmp_path, over):
    """And the field of the factor is heard, beside the slider and the address above."""
    act = (
        "const f = document.getElementById('factor'); f.value = 1000;"
        "f.dispatchEvent(new Event('input'));"
        "document.querySelectorAll('.key')[0].click();"
        f"document.querySelector('[data-over={over}]').click();"
        f"Plotly.relayout('error_{over}', {{'xaxis.range[0]': 1, 'xaxis.range[1]': 2}});"
    )
    _, state = probed(chromium, report, tmp_path, act)
    assert state["visible"].count(False) == 1
    zoomed = {name for name, ends in state["ranges"].items() if ends == [1, 2]}
    assert zoomed == {f"error_{over}", "tracking_error", "command"}
    assert state["hash"] == "#magnification=1000"
    assert "deviation drawn 1,000 × larger" in state["note"]


def test_hostile_texts_do_nothing(chromium, made, tmp_path):
    file = write_report(made.hostile(), tmp_path / "report.html")
    visit, state = probed(chromium, file, tmp_path)
    assert state["hit"] == "undefined"
    assert state["images"] == 0
    assert any("<b>b</b></script><script>window.hit=1</script><img" in t for t in state["labels"])
    assert not [line for line in visit.console if "MathJax" in line]
    assert visit.requests == ()
    assert "&lt;/script&gt;&lt;script&gt;window.hit=1" in visit.dom


def test_paths_in_space(chromium, made, tmp_path):
    file = write_report(made.spatial(), tmp_path / "report.html")
    visit, state = probed(chromium, file, tmp_path)
    assert visit.requests == ()
    assert set(state["types"]) == {"scatter3d"}


def test_one_axis_alone_has_errors_and_commands_and_no_picture(chromium, made, tmp_path):
    visit = chromium(write_report(made.lone(), tmp_path / "report.html"), "--dump-dom")
    assert visit.attribute("data-errors") is None
    assert visit.attribute("data-ready") == "1"
    assert visit.dom.count('class="main-svg" ') >= 4
    assert "deviations magnified" not in visit.dom


def test_all_diverged(chromium, comparison, tmp_path):
    record = comparison.recordings["integral_sliding_mode"]
    lost = dataclasses.replace(comparison, recordings={"a": record, "b": record})
    visit = chromium(write_report(lost, tmp_path / "report.html"), "--dump-dom")
    assert visit.attribute("data-ready") == "1"
    assert visit.attribute("data-errors") is None
    assert "All 2 controllers diverged" in visit.dom


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_a_screenshot_is_not_blank(chromium, report, tmp_path, mode):
    picture = tmp_path / "page.png"
    flags = ["--blink-settings=preferredColorScheme=0"] if mode == "dark" else []
    chromium(report, "--window-size=1200,1600", f"--screenshot={picture}", *flags)
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    ground = pixels[0, 0]
    assert (ground.mean() < 60) == (mode == "dark")
    figure = pixels[800:1500]
    assert 0.005 < np.mean(np.abs(figure - ground).max(axis=2) > 40) < 0.5
    # the second controller's colour is on the page
    colour = np.array([0xF0, 0x89, 0x4A] if mode == "dark" else [0xD5, 0x5E, 0x00])
    assert np.sum(np.abs(pixels - colour).max(axis=2) < 12) > 200
