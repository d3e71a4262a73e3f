"""SVG: shapes, transformations and units; any bytes give a part or one of our errors."""

import math

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contourlab.contours.cad import read_svg
from contourlab.errors import ConfigurationError, ContourlabError, PartError, UnitError

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="50mm" viewBox="0 0 100 50">'


def written(tmp_path, body, head=HEAD):
    file = tmp_path / "d.svg"
    file.write_text(f'<?xml version="1.0"?>\n{head}\n{body}\n</svg>')
    return file


def path_of(tmp_path, body, **options):
    return read_svg(written(tmp_path, body), **options).path


def points(path, n):
    s = np.linspace(0.0, float(path.length), n)
    return np.asarray(jax.jit(jax.vmap(path.position))(s))


def test_y_points_up_from_the_lower_edge(tmp_path):
    part = read_svg(written(tmp_path, '<line id="l" x1="10" y1="50" x2="40" y2="10"/>'))
    assert_allclose(points(part.path, 2), [[0.01, 0.0], [0.04, 0.04]], rtol=0, atol=1e-17)
    assert part.describe(0).endswith('line "l" in line 3')


def test_every_command_of_a_path(tmp_path):
    d = "m10 40h10v-10l5 0c0-5 5-5 5-10s5-5 5-10q5 0 5-5t5-5a5 5 0 01-5-5L10 0Z"
    path = path_of(tmp_path, f'<path d="{d}"/>')
    assert path.closed
    curvature = np.abs(path.curvature)
    # the quarter circle turns counter-clockwise in the drawing, clockwise with y up
    assert_allclose(curvature[~np.isnan(curvature)], [0, 0, 0, 200.0, 0, 0], atol=1e-9)
    at = points(path, 4)[0]
    assert_allclose(at, [0.01, 0.01], rtol=0, atol=1e-17)


def test_cubic_is_its_bernstein_form(tmp_path):
    path = path_of(tmp_path, '<path d="M0 0C 10 0 10 20 30 20"/>')
    u = np.linspace(0.0, 1.0, 2001)[:, None]
    p = np.array([[0, 0], [10, 0], [10, 20], [30, 20.0]])
    wanted = (1 - u) ** 3 * p[0] + 3 * u * (1 - u) ** 2 * p[1] + 3 * u**2 * (1 - u) * p[2]
    wanted = (wanted + u**3 * p[3]) * [1e-3, -1e-3] + [0, 0.05]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(wanted, axis=0), axis=1))])
    got = np.asarray(jax.jit(jax.vmap(path.position))(s[::200]))
    assert_allclose(got, wanted[::200], rtol=0, atol=1e-8)  # chords of 20 um


def test_round_shapes_stay_round_and_ellipses_exact(tmp_path):
    circle = path_of(tmp_path, '<circle cx="20" cy="20" r="10" transform="rotate(30) scale(2)"/>')
    assert circle.closed
    assert_allclose(circle.curvature, [-50.0], rtol=1e-12)  # clockwise, y being turned round
    rect = path_of(tmp_path, '<rect x="10" y="10" width="40" height="20" rx="5"/>')
    assert rect.closed
    assert_allclose(rect.length, 0.06 + 0.02 + 0.01 * np.pi, rtol=1e-12)
    assert_allclose(np.abs(rect.curvature), [0, 200.0] * 4, atol=1e-9)
    assert np.sort(rect.joints().turning_angle)[-1] < 1e-9
    tilted = path_of(tmp_path, '<path d="M0 0A20 10 30 1 0 10 10" transform="skewX(20)"/>')
    raw = points(tilted, 60) @ np.array([[1, 0], [0, -1.0]]) + [0, 0.05]
    undone = raw @ np.array([[1.0, 0.0], [-math.tan(math.radians(20)), 1.0]])
    turn = math.radians(30)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    local = undone @ axes.T / [0.02, 0.01]  # on a unit circle, about some centre
    a = np.column_stack([2 * local, np.ones(len(local))])
    (x, y, rest), *_ = np.linalg.lstsq(a, np.sum(local**2, axis=1), rcond=None)
    radius = np.linalg.norm(local - [x, y], axis=1)
    assert_allclose(radius, 1.0, rtol=1e-11)
    assert_allclose(rest, 1.0 - x * x - y * y, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("head", "unit", "length"),
    [
        ('<svg width="100mm" viewBox="0 0 50 50">', None, 0.02),
        ('<svg width="1in" height="1in" viewBox="5 5 72 72">', None, 10 * 0.0254 / 72),
        ('<svg width="100" height="50" viewBox="0 0 100 50">', "mm", 0.01),
        ("<svg>", "0.1 in", 0.0254),
    ],
)
def test_units(tmp_path, head, unit, length):
    file = written(tmp_path, '<path d="M0 0H10"/>', head)
    assert_allclose(read_svg(file, unit=unit).path.length, length, rtol=1e-14)
    if unit is not None:
        with pytest.raises(UnitError, match="does not say how large a unit is"):
            read_svg(file)


def test_what_is_left_out_is_said_and_layers_are_chosen(tmp_path):
    body = """<defs><path d="M0 0H99"/></defs><text>a<tspan>b</tspan></text>
    <g id="cut"><path d="M0 0H10"/><path d="M10 0V5M20 5H10"/></g>
    <path d="M50 0H60" style="stroke: red; display : none"/><g id="marks"><path d="M30 9h1"/></g>"""
    part = read_svg(written(tmp_path, body), layers=["cut"])
    assert_allclose(part.path.length, 0.025, rtol=1e-14)
    assert part.path.n_pieces == 3
    assert part.warnings == (
        "entities that are no path were left out: path that is not displayed (1), text (1)",
    )
    with pytest.raises(PartError, match="holds 2 chains"):
        read_svg(written(tmp_path, body))
    with pytest.raises(PartError, match="no layer 'cuts'; did you mean cut"):
        read_svg(written(tmp_path, body), layers=["cuts"])


BOMB = """<?xml version="1.0"?><!DOCTYPE svg [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]><svg viewBox="0 0 1 1">&b;</svg>"""


@pytest.mark.parametrize(
    "text",
    [
        BOMB,
        '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/hostname">]><svg>&x;</svg>',
        '<!DOCTYPE svg [<!ENTITY % p SYSTEM "other.dtd"> %p;]><svg/>',
    ],
)
def test_entities_are_refused_and_nothing_else_is_opened(tmp_path, text):
    file = tmp_path / "bomb.svg"
    file.write_text(text)
    with pytest.raises(PartError, match=r"bomb.svg:\d+: declares the entity"):
        read_svg(file, unit="mm")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "nothing in it can be followed"),
        ('<path d="M0 0L1,x"/>', r"d.svg:3: path: path data has 'x'"),
        ('<path d="L1 1"/>', "must begin with M"),
        ('<path d="M0 0L1"/>', "path data cannot be read"),
        ('<use href="#a"/>', "copies are not read"),
        ('<svg><path d="M0 0H1"/></svg>', "a drawing within a drawing"),
        ('<circle r="10%"/>', "r must be a number of user units, got '10%'"),
        ('<polyline points="1 2 3"/>', "must be pairs"),
        ('<path d="M0 0H1" transform="spin(3)"/>', "transform: Unknown"),
        ('<circle r="5" transform="scale(1 0)"/>', "makes an arc flat"),
        ('<path d="M0 0H1e300"/>', "not finite or beyond"),
        ("<g>" * 300 + "</g>" * 300, "nested more than 200 deep"),
        ("<path", "is not valid XML"),
    ],
)
def test_what_cannot_be_followed_is_named(tmp_path, body, message):
    with pytest.raises(PartError, match=message):
        read_svg(written(tmp_path, body))


def test_missing_extra_says_how_to_install(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "svgpathtools", None)
    with pytest.raises(ConfigurationError, match=r"pip install contourlab\[cad\]"):
        read_svg(written(tmp_path, ""))


UNTIMED = settings(deadline=None, max_examples=100, suppress_health_check=list(HealthCheck))


def survives(file):
    try:
        part = read_svg(file, unit="mm")
    except ContourlabError:
        return
    assert np.isfinite(np.asarray(part.path.breaks)).all()


@UNTIMED
@given(st.binary(max_size=200))
def test_any_bytes(tmp_path, data):
    file = tmp_path / "f.svg"
    file.write_bytes(data)
    survives(file)


NUMBERS = st.one_of(
    st.integers(-9, 9).map(str), st.floats(-99, 99).map(repr),
    st.sampled_from(["1e300", "1e-300", "nan", "", "5mm", "-0", "1e5", "0"]),
)  # fmt: skip
COMMANDS = st.tuples(st.sampled_from(list("MmZLlHhVvCcSsQqTtAa")), st.lists(NUMBERS, max_size=8))


@UNTIMED
@given(st.lists(COMMANDS, max_size=8), st.lists(NUMBERS, min_size=1, max_size=6))
def test_any_path_data(tmp_path, commands, numbers):
    d = " ".join([c + " ".join(n) for c, n in commands])
    matrix = f"matrix({' '.join(numbers)})" if len(numbers) == 6 else ""
    survives(written(tmp_path, f'<path d="M0 0{d}" transform="{matrix}"/>'))


SHAPES = st.tuples(
    st.sampled_from(["rect", "circle", "ellipse", "line", "polygon", "g", "svg", "use", "text"]),
    st.dictionaries(
        st.sampled_from(
            [
                "x",
                "y",
                "width",
                "height",
                "rx",
                "ry",
                "r",
                "cx",
                "cy",
                "x1",
                "y1",
                "x2",
                "y2",
                "points",
                "transform",
            ]
        ),
        NUMBERS,
    ),
)


@UNTIMED
@given(st.lists(SHAPES, max_size=4))
def test_any_shapes(tmp_path, shapes):
    tags = ["<{} {}/>".format(tag, " ".join(f'{k}="{v}"' for k, v in given_.items()))
            for tag, given_ in shapes]  # fmt: skip
    survives(written(tmp_path, "\n".join(tags)))


def test_numbers_of_points_need_nothing_between_them(tmp_path):
    path = path_of(tmp_path, '<polyline points="10-10 20-10.5.5,3e0"/>')
    wanted = np.array([[10, -10], [20, -10.5], [0.5, 3.0]]) * [1e-3, -1e-3] + [0, 0.05]
    got = np.stack([path.position(s) for s in np.asarray(path.breaks)])
    assert_allclose(got, wanted, rtol=0, atol=1e-16)
    with pytest.raises(PartError, match="points must be numbers of user units"):
        path_of(tmp_path, '<polyline points="10,10 20x,10"/>')


@pytest.mark.parametrize(
    ("element", "message"),
    [
        ('<line x2="1" style="stroke: red; transform: translate(3px)"/>', "style sets 'transform'"),
        ('<circle r="1" style="r:3px"/>', "style sets 'r'"),
        ('<g style="rotate:3deg"><line x2="1"/></g>', "style sets 'rotate'"),
        ('<line x2="1" transform="rotate(9)" transform-origin="5 0"/>', "transform-origin is not"),
        ('<path d="M1 1A5 5 0 0 1 1 1"/>', "an arc ends where it begins"),
    ],
)
def test_what_would_move_the_drawing_unseen_is_refused(tmp_path, element, message):
    with pytest.raises(PartError, match=message):
        path_of(tmp_path, element)
    harmless = '<line x2="1" style="transform:none;stroke-width:3;line-height:1"/>'
    assert_allclose(path_of(tmp_path, harmless).length, 1e-3, rtol=1e-14)


def test_slice_fills_the_page(tmp_path):
    head = HEAD.replace('height="50mm"', 'height="100mm" preserveAspectRatio="xMidYMid slice"')
    part = read_svg(written(tmp_path, '<line x2="10"/>', head))
    assert_allclose(part.path.length, 0.02, rtol=1e-14)
    with pytest.raises(PartError, match=r"d\.svg: has no layer 'b'"):
        read_svg(written(tmp_path, '<line x2="10" id="a"/>', head), layers=["b"])
