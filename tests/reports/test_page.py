from __future__ import annotations

import dataclasses
import json
import re
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest

from contourlab.errors import OutputError
from contourlab.reports import write_report
from contourlab.reports.html import script_json

LINKS = {"src", "href", "srcset", "action", "data", "poster", "background", "cite", "formaction"}


class Reader(HTMLParser):
    """Elements, links and the text of scripts and styles."""

    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.links, self.scripts, self.styles, self.tags, self.words = [], [], [], [], []
        self.inside = None
        self.policy = ""

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.tags.append(tag)
        self.links += [value for name, value in attrs.items() if name in LINKS and value]
        if attrs.get("http-equiv") == "Content-Security-Policy":
            self.policy = attrs["content"]
        if tag in ("script", "style"):
            self.inside = tag
            (self.scripts if tag == "script" else self.styles).append("")

    def handle_endtag(self, tag):
        if tag == self.inside:
            self.inside = None

    def handle_data(self, text):
        if self.inside == "script":
            self.scripts[-1] += text
        elif self.inside == "style":
            self.styles[-1] += text
        else:
            self.words.append(text)

    @property
    def data(self):
        return json.loads(self.scripts[1])

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def read(text):
    reader = Reader()
    reader.feed(text)
    return reader


def asks_for_something(reader):
    """Return what in a page could make a browser ask for something."""
    own = [script for script in reader.scripts if "plotly.js v" not in script[:400]]
    found = [link for link in reader.links if not link.startswith(("#", "data:"))]
    for style in reader.styles:
        found += re.findall(r"@import[^;]*|url\([^)]*\)|https?://\S*", style)
    for script in own:
        found += re.findall(r"https?://\S*|\bfetch\(|XMLHttpRequest|\bimport\b", script)
    found += [tag for tag in reader.tags if tag in ("link", "iframe", "object", "embed", "base")]
    return found


@pytest.fixture(scope="module")
def page(comparison, tmp_path_factory):
    file = write_report(comparison, tmp_path_factory.mktemp("report") / "report.html")
    return read(file.read_text(encoding="utf-8"))


def test_the_page_asks_for_nothing(page):
    assert asks_for_something(page) == []
    assert "default-src 'none'" in page.policy
    assert "http" not in page.policy


@pytest.mark.parametrize("bad", [
    '<img src="https://a.test/x.png">', '<link href="x.css">', "<style>@import 'x';</style>",
    "<style>a{background:url(//a.test/x)}</style>", '<script>fetch("x")</script>',
    '<iframe srcdoc=""></iframe>',
])  # fmt: skip
def test_the_check_sees_a_page_that_asks(bad):
    assert asks_for_something(read(bad))


def test_plotly_is_in_the_page_once(page):
    assert sum("plotly.js v" in script[:400] for script in page.scripts) == 1
    assert len(page.scripts) == 4


def test_the_page_says_who_won_and_where(page):
    assert "cross_coupled keeps the tool closest to the path: 3.72" in page.text
    assert "line 11: G2 X30 Y30 I-10 J0" in page.text
    assert "integral_sliding_mode diverged at 1.9 s on axis Y." in page.text
    assert "saturated during 3.1 % of the samples" in page.text
    assert 'rate = "3000 mm/min"' in page.text
    assert "Bracket on the example machine" in page.text
    assert "limit 6" in page.text
    assert "★" in page.text


def decoded(packed):
    import base64

    return np.frombuffer(base64.b64decode(packed["data"]), f"<{packed['type']}")


def test_the_data_are_those_of_the_recordings(page, comparison):
    run = page.data["runs"][1]
    recording = comparison.recordings["cross_coupled"]
    row = run["worst"]["row"]
    worst = int(np.argmax(np.abs(np.asarray(recording["contour_error"]))))
    assert run["worst"]["where"] == "line 11"
    # single precision has 7 digits
    error, time = (float(recording[name][worst]) for name in ("contour_error", "time"))
    assert decoded(run["error"])[row] == pytest.approx(1e6 * error, 1e-6)
    assert decoded(run["time"])[row] == pytest.approx(time, 1e-6)
    foot = np.array([decoded(column)[row] for column in run["foot"]])
    vector = np.array([decoded(column)[row] for column in run["vector"]])
    tool = np.asarray(recording["tool"][worst]) * 1e3
    np.testing.assert_allclose(foot - vector, tool, rtol=1e-6)
    assert page.data["magnification"] == 100.0
    assert [panel["limit"] for panel in page.data["commands"]] == [6.0, 6.0]
    assert page.data["lines"]["8"] == "G3 X70 Y10 I0 J10"


def test_hostile_texts_stay_texts(made, tmp_path):
    file = write_report(made.hostile(), tmp_path / "x.html")
    reader = read(file.read_text(encoding="utf-8"))
    assert len(reader.scripts) == 4
    assert "img" not in reader.tags
    assert "49" not in reader.text.split("hit=1")[1][:10]
    assert reader.data["runs"][0]["name"] == made.hostile_text
    assert asks_for_something(reader) == []


def test_the_table_says_why_a_law_was_refused(made, tmp_path):
    text = write_report(made.refused(), tmp_path / "r.html").read_text(encoding="utf-8")
    body = text[text.index("<tbody>") : text.index("</tbody>")]
    rows = body.split("<tr")[1:]
    who = r'class="who[^>]*>(?:<span[^>]*></span>)?([^<]*)'
    names = [re.search(who, row).group(1) for row in rows]
    assert names == ["turning", "axis_pid", "cross_coupled", "threading"]
    assert '<b class="lost">refused</b>: turning &lt;b&gt;is for&lt;/b&gt; lathes' in rows[0]
    assert '<b class="lost">failed</b>: threading' in rows[3]
    assert "★" in rows[2]


def test_script_json_is_safe_and_strict():
    hostile = {"</script>": "<!--\u2028&"}
    text = script_json(hostile)
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == hostile
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_json({"x": float("nan")})


def test_an_existing_file_is_kept_without_force(comparison, tmp_path):
    file = tmp_path / "report.html"
    file.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        write_report(comparison, file)
    assert file.read_text() == "mine"
    assert write_report(comparison, file, force=True) == file
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_long_records_are_thinned_and_the_page_says_so(made, tmp_path):
    reference, _ = made.travel(made.bracket_path(), 0.01)
    recordings = {f"c{k}": made.recording(reference, f"c{k}", 1e-5) for k in range(3)}
    long = dataclasses.replace(made.bracket(), recordings=recordings, reference=reference, stops=())
    assert reference.n_samples > 30_000
    file = write_report(long, tmp_path / "report.html")
    assert file.stat().st_size < 10_000_000
    reader = read(file.read_text(encoding="utf-8"))
    assert f"c0 {reference.n_samples} samples" in reader.text
    error = decoded(reader.data["runs"][0]["error"])
    assert len(error) <= 12_002
    whole = np.asarray(recordings["c0"]["contour_error"]) * 1e6
    assert error.max() == pytest.approx(whole.max(), rel=1e-6)
    assert error.min() == pytest.approx(whole.min(), rel=1e-6)


def test_logs_without_commands_and_without_limits(comparison, tmp_path):
    bare = {
        name: type(r)(r.dataset.drop_vars(["command", "command_limit", "tracking_error"]))
        for name, r in comparison.recordings.items()
    }
    file = write_report(dataclasses.replace(comparison, recordings=bare), tmp_path / "a.html")
    assert "Commands" not in read(file.read_text(encoding="utf-8")).text
    free = {}
    for name, r in comparison.recordings.items():
        dataset = r.dataset.copy()
        dataset["command_limit"] = dataset["command_limit"] * np.inf
        free[name] = type(r)(dataset)
    file = write_report(dataclasses.replace(comparison, recordings=free), tmp_path / "b.html")
    reader = read(file.read_text(encoding="utf-8"))
    assert [panel["limit"] for panel in reader.data["commands"]] == [None, None]
    assert "no limit" in reader.text


def test_every_page_has_the_head_of_one_template():
    pages = [file for file in (files("contourlab.reports") / "templates").iterdir()
             if file.name.endswith(".html") and file.name != "page.html"]  # fmt: skip
    assert len(pages) == 3
    for page in pages:
        assert page.read_text(encoding="utf-8").startswith('{% extends "page.html" %}')
