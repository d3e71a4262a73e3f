"""DXF: exact rows, units, layers and chains; any bytes give a part or one of our errors."""

import math

import ezdxf
import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline as ScipySpline

from contourlab.contours.cad import read_dxf
from contourlab.errors import ConfigurationError, ContourlabError, PartError, UnitError


def saved(tmp_path, draw, units=4):
    document = ezdxf.new("R2010")
    document.units = units
    draw(document.modelspace(), document)
    file = tmp_path / "d.dxf"
    document.saveas(file)
    return file


def sampled(path, n=9):
    s = np.linspace(0.0, float(path.length), n)
    return np.asarray(jax.jit(jax.vmap(path.position))(s))


def test_lines_and_arcs_of_any_order_are_one_loop(tmp_path):
    def draw(space, _):
        space.add_line((10, 10), (0, 10))
        space.add_arc((10, 5), 5, 270, 90)
        space.add_line((10, 0), (0, 0))  # drawn the other way round
        space.add_line((0, 0), (0, 10))
        space.add_text("a note")

    part = read_dxf(saved(tmp_path, draw))
    assert part.path.closed
    assert_allclose(part.path.length, 0.03 + 0.005 * np.pi, rtol=1e-14)
    # begins with the first line, as it is drawn: round the other way than the arc
    assert_allclose(part.path.curvature, [0, 0, 0, 200.0], rtol=1e-12)
    assert_allclose(part.path.position(0.0), [0.01, 0.01], rtol=1e-15)
    assert part.warnings == ("entities that are no path were left out: TEXT (1)",)
    assert "ARC" in part.describe(3)
    assert np.isnan(part.feed).all()
    turned = read_dxf(saved(tmp_path, draw), reverse=True)
    assert_allclose(turned.path.curvature, [-200.0, 0, 0, 0], rtol=1e-12)


def test_bulges_ellipses_and_mirrored_arcs(tmp_path):
    def bulges(space, _):
        space.add_lwpolyline([(0, 0, 1.0), (10, 0, 0.0), (10, 5, math.tan(math.pi / 8)), (0, 5, 0)],
                             format="xyb", close=True)  # fmt: skip

    path = read_dxf(saved(tmp_path, bulges)).path
    assert path.closed
    # a half circle below the first chord, a quarter circle above the third
    assert_allclose(path.curvature, [200.0, 0, np.sqrt(2.0) / 0.01, 0], rtol=1e-12)
    assert_allclose(path.length, 0.005 * np.pi + 0.01 + 0.01 / np.sqrt(2.0) * np.pi / 2, rtol=1e-13)
    assert sampled(path, 200)[:, 1].min() == pytest.approx(-0.005, rel=1e-3)

    def ellipse(space, _):
        space.add_ellipse((1, 2), major_axis=(3, 4), ratio=0.4, start_param=0.3, end_param=4.0)

    path = read_dxf(saved(tmp_path, ellipse)).path
    at = (sampled(path, 40) - [1e-3, 2e-3]) @ np.array([[0.6, -0.8], [0.8, 0.6]])
    assert_allclose((at[:, 0] / 5e-3) ** 2 + (at[:, 1] / 2e-3) ** 2, 1.0, rtol=1e-13)
    t = np.array([0.3, 4.0])
    ends = np.stack([5e-3 * np.cos(t), 2e-3 * np.sin(t)], axis=1)
    assert_allclose(at[[0, -1]], ends, rtol=0, atol=1e-16)

    def mirrored(space, _):
        space.add_arc((3, 0), 2, 0, 90, dxfattribs={"extrusion": (0, 0, -1)})

    path = read_dxf(saved(tmp_path, mirrored)).path
    assert_allclose(sampled(path, 2), [[-0.005, 0], [-0.003, 0.002]], rtol=0, atol=1e-17)
    assert_allclose(path.curvature, [-500.0], rtol=1e-12)


@pytest.mark.parametrize("weighted", [False, True])
def test_splines_are_exact(tmp_path, weighted):
    rng = np.random.default_rng(0)
    p, w = rng.normal(size=(8, 3)) * [10, 10, 0], 1.0 + rng.uniform(size=8)
    t = np.array([0, 0, 0, 0, 1, 2.5, 2.5, 4, 5, 5, 5, 5.0])
    w = w if weighted else np.ones(8)

    def draw(space, _):
        spline = space.add_spline(degree=3)
        spline.control_points, spline.knots = p, t
        if weighted:
            spline.weights = w

    path = read_dxf(saved(tmp_path, draw)).path
    numerator, weight = ScipySpline(t, p * w[:, None], 3), ScipySpline(t, w[:, None], 3)
    dense = np.linspace(0.0, 5.0, 40_001)
    wanted = (numerator(dense) / weight(dense))[:, :2] * 1e-3
    chords = np.linalg.norm(np.diff(wanted, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(chords)])
    assert_allclose(path.length, s[-1], rtol=1e-7)
    got = np.asarray(jax.jit(jax.vmap(path.position))(s[::1000] * float(path.length) / s[-1]))
    # arc length from chords is good to 1e-8 of the whole
    assert_allclose(got, wanted[::1000], rtol=0, atol=1e-7 * s[-1])


def test_units_of_the_drawing_or_stated(tmp_path):
    def draw(space, _):
        space.add_line((0, 0), (1, 0))

    for units, size in ((1, 0.0254), (4, 1e-3), (6, 1.0), (13, 1e-6)):
        part = read_dxf(saved(tmp_path, draw, units), gap="1 nm")
        assert_allclose(part.path.length, size, rtol=1e-15)
    with pytest.raises(PartError, match="not longer than gap, 1e-06 m"):
        read_dxf(saved(tmp_path, draw, 13))
    with pytest.raises(UnitError, match=r"\$INSUNITS is 0\): give unit"):
        read_dxf(saved(tmp_path, draw, 0))
    part = read_dxf(saved(tmp_path, draw, 1), unit="0.5 mm")
    assert_allclose(part.path.length, 5e-4, rtol=1e-15)
    assert part.warnings == ("the drawing says that its unit is in; read as 0.5 mm",)


def test_layers_and_chains_are_chosen(tmp_path):
    def draw(space, document):
        document.layers.add("CUT")
        document.layers.add("OFF").off()
        space.add_circle((0, 0), 5, dxfattribs={"layer": "CUT"})
        space.add_line((20, 0), (30, 0))
        space.add_line((0, 0), (99, 0), dxfattribs={"layer": "OFF"})

    file = saved(tmp_path, draw)
    with pytest.raises(PartError, match=r"holds 2 chains .* 0: loop, 1 segments, 31\.42 mm"):
        read_dxf(file)
    assert_allclose(read_dxf(file, layers=["CUT"]).path.length, 0.01 * np.pi, rtol=1e-15)
    part = read_dxf(file, chain=1)
    assert_allclose(part.path.length, 0.01, rtol=1e-15)
    assert part.warnings == ("layers that are off or frozen were left out: OFF",)
    with pytest.raises(PartError, match="no layer 'CUTS'; did you mean CUT"):
        read_dxf(file, layers=["CUTS"])
    with pytest.raises(PartError, match="has no chain 2"):
        read_dxf(file, chain=2)


def test_small_gaps_are_closed_half_way(tmp_path):
    def draw(space, _):
        space.add_line((0, 0), (10, 0))
        space.add_arc((10, 5.0004), 5, 270, 90)
        space.add_line((10, 10), (0, 10))

    file = saved(tmp_path, draw)
    with pytest.raises(PartError, match="chains that do not meet"):
        read_dxf(file, gap="0.1 um")
    path = read_dxf(file, gap="1 um").path
    assert_allclose(path.position(0.01), [0.01, 2e-7], rtol=0, atol=1e-11)
    assert_allclose(path.length, 0.02 + np.pi * 0.005, rtol=1e-4)


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda s, d: s.add_text("x"), "nothing in it can be followed"),
        (lambda s, d: [s.add_line((0, 0), (1, k)) for k in range(3)], r"at \(0, 0\) mm more than"),
        (lambda s, d: s.add_blockref(d.blocks.new("B").name, (0, 0)), "INSERT .*explode them"),
        (lambda s, d: s.add_line((0, 0, 0), (1, 0, 1)), "moves in Z"),
        (lambda s, d: s.add_spline([(0, 0), (1, 1), (2, 0)]), "fit points alone"),
        (lambda s, d: s.add_circle((0, 0), 0), "radius must be > 0"),
        (lambda s, d: s.add_line((0, 0), (1e300, 0)), "not finite or beyond"),
    ],
)
def test_what_cannot_be_followed_is_named(tmp_path, draw, message):
    with pytest.raises(PartError, match=message):
        read_dxf(saved(tmp_path, draw))


def test_missing_extra_says_how_to_install(tmp_path, monkeypatch):
    import sys

    file = tmp_path / "d.dxf"
    file.write_text("0\nEOF\n")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(ConfigurationError, match=r"pip install contourlab\[cad\]"):
        read_dxf(file)


UNTIMED = settings(
    deadline=None, max_examples=60, suppress_health_check=list(HealthCheck), derandomize=False
)


def survives(tmp_path, data):
    file = tmp_path / "f.dxf"
    file.write_bytes(data)
    try:
        part = read_dxf(file, unit="mm")
    except ContourlabError:
        return
    assert np.isfinite(np.asarray(part.path.breaks)).all()


@UNTIMED
@given(st.binary(max_size=200), st.booleans())
def test_any_bytes(tmp_path, data, binary):
    survives(tmp_path, (b"AutoCAD Binary DXF\r\n\x1a\x00" if binary else b"") + data)


VALUES = st.one_of(
    st.integers(-3, 9).map(str), st.floats(-99, 99).map(repr),
    st.sampled_from(["nan", "inf", "1e308", "", "LINE", "AC1009", "9" * 40]),
)  # fmt: skip
GROUPS = st.tuples(
    st.sampled_from([5, 8, 10, 20, 30, 11, 21, 31, 40, 41, 42, 50, 51, 62, 67, 70, 71, 72, 73, 74,
                     90, 210, 220, 230, 100]),
    VALUES,
)  # fmt: skip
KINDS = st.sampled_from([
    "LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "VERTEX", "SEQEND", "SPLINE",
    "INSERT", "HELIX", "POINT",
])  # fmt: skip


@UNTIMED
@given(st.lists(st.tuples(KINDS, st.lists(GROUPS, max_size=14)), max_size=5))
def test_any_entities(tmp_path, entities):
    lines = ["0", "SECTION", "2", "HEADER", "9", "$ACADVER", "1", "AC1015", "0", "ENDSEC"]
    lines += ["0", "SECTION", "2", "ENTITIES"]
    for kind, groups in entities:
        lines += ["0", kind]
        for code, value in groups:
            lines += [str(code), value]
    survives(tmp_path, "\n".join([*lines, "0", "ENDSEC", "0", "EOF", ""]).encode())


def test_layers_have_no_case_and_what_is_invisible_is_said(tmp_path):
    def draw(space, document):
        document.layers.add("Cut")
        space.add_line((0, 0), (1, 0), dxfattribs={"layer": "CUT"})
        space.add_line((1, 0), (2, 0), dxfattribs={"layer": "Cut"})
        space.add_line((5, 0), (6, 0), dxfattribs={"layer": "other"})
        space.add_line((2, 0), (2, 1), dxfattribs={"layer": "Cut", "invisible": 1})

    part = read_dxf(saved(tmp_path, draw), layers=["cut"])
    assert_allclose(part.path.length, 2e-3, rtol=1e-14)
    assert part.warnings == ("entities that are no path were left out: LINE that is invisible (1)",)
    with pytest.raises(PartError, match=r"d\.dxf: has no layer 'cat'; "):
        read_dxf(saved(tmp_path, draw), layers=["cat"])


def test_bulges_that_are_all_but_straight(tmp_path):
    # a sagitta of bulge times half the chord: 0.5 um on 1 m, then none to rounding
    for bulge, most in ((1e-6, 0.5e-6), (-1e-6, 0.5e-6), (1e-12, 0.0), (-1e-300, 0.0)):

        def draw(space, _, bulge=bulge):
            space.add_lwpolyline([(0, 0, bulge), (1000, 0, 0)], format="xyb")

        path = read_dxf(saved(tmp_path, draw)).path
        middle = path.position(0.5 * path.length)
        assert_allclose(middle, [0.5, -np.sign(bulge) * most], rtol=0, atol=1e-12)
        assert_allclose(path.position(path.length), [1.0, 0.0], rtol=0, atol=1e-14)


def test_a_whole_turn_is_one_whatever_the_rounding(tmp_path):
    starts = [216.95, 311.59]
    rest = [math.radians(start + 360.0 - start) % (2.0 * math.pi) for start in starts]
    assert 0.0 < min(rest) < 1e-12
    assert 0.0 < 2.0 * math.pi - max(rest) < 1e-12

    def draw(space, _):
        for k, start in enumerate(starts):
            space.add_arc((20 * k, 0), 5, start, start + 360.0)

    file = saved(tmp_path, draw)
    for k in range(len(starts)):
        path = read_dxf(file, chain=k).path
        assert path.closed
        assert_allclose(path.length, 0.01 * np.pi, rtol=1e-13)
