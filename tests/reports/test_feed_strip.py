"""The strip under the feed: what is drawn is what the plan says."""

import xml.etree.ElementTree as ElementTree

import numpy as np
from numpy.testing import assert_allclose

from contourlab.contours import read_gcode_text
from contourlab.feedrate import AxisLimits, plan_feed
from contourlab.reports.feed_strip import feed_figure, feed_strip, said, strip_svg

LIMITS = AxisLimits(velocity=[0.5, 0.4], acceleration=[5.0, 4.0], jerk=[100.0, 100.0])
PROGRAM = "G21 G90 F1200\nG0 X90\nG1 X150\nG4 P0.1\nG1 Y40 F600\nM2\n"


def made():
    part = read_gcode_text(PROGRAM, axes=("X", "Y"), name='a"<b>.ngc')
    plan = plan_feed(part, limits=LIMITS, sample_time=1e-3)
    return feed_strip(plan, part), plan


def test_columns_follow_the_plan():
    strip, plan = made()
    assert_allclose(strip.edges[[0, -1]], [0.0, 0.19])
    middle = 0.5 * (strip.edges[1:] + strip.edges[:-1])
    assert np.isnan(strip.programmed[middle < 0.09]).all()
    assert_allclose(strip.programmed[(middle > 0.091) & (middle < 0.149)], 0.02)
    assert_allclose(strip.programmed[middle > 0.151], 0.01)
    assert set(strip.line[middle < 0.089]) == {2}
    assert set(strip.line[middle > 0.151]) == {5}
    assert (strip.low <= strip.high).all()
    assert_allclose(strip.high.max(), np.abs(plan.reference.velocity).max(), rtol=1e-2)
    assert_allclose(sum(share for _, share in strip.shares), 1.0)
    runs = strip.runs()
    assert runs[0][0] == 0
    assert runs[-1][1] == len(strip.limit)


def test_rapids_far_above_the_feed_are_cut_off_and_said():
    strip, _ = made()
    assert_allclose(strip.top, 1.25 * 0.02)
    assert "rapids reach" in strip.note


def test_svg_is_well_formed_and_names_lines():
    strip, _ = made()
    root = ElementTree.fromstring(strip_svg(strip, 'a "label" & <more>'))
    assert root.attrib["aria-label"] == 'a "label" & <more>'
    titles = [title.text for title in root.iter("title")]
    assert any("programmed feed" in text and "line 3" in text for text in titles)
    rects = [float(rect.attrib["width"]) for rect in root.iter("rect")]
    assert_allclose(sum(rects), 1120 - 62 - 8, rtol=1e-2)


def test_figure_and_words():
    strip, _ = made()
    figure = feed_figure([("mill", strip)])
    assert len(figure.axes) == 2
    assert figure.axes[0].get_title(loc="left").startswith("mill: planned feed")
    assert said("acceleration X") == "acceleration of X"
    colours = {strip.colour(name) for name in strip.names}
    assert len(colours) == len(strip.names)
