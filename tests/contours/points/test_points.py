"""Points from tables and arrays: what is read, mended, refused, and how far the path is from it."""

import io

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from contourlab.contours.points import read_points
from contourlab.errors import ConfigurationError, ContourlabError, PartError, UnitError

ZIGZAG = np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 0.005], [0.03, 0.005]])


def written(tmp_path, text, name="p.csv"):
    file = tmp_path / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


@pytest.mark.parametrize(
    "text",
    [
        "x_mm,y_mm\n0,0\n10,0\n10,5\n30,5\n",
        "x [mm];y [mm]\n0,0;0,0\n10,0;0,0\n10,0;5,0\n30,0;5\n",
        "# probe 3\n\nX(mm)\tY(mm)\n0\t0\n10\t0 # start\n10\t5\n30\t5\n",
        '"x_um" "y_um"\r\n0 0\r\n1e4 0\r\n1.0e+4   5000\r\n30000 5000\r\n',
        "time;y_mm;x_mm\n0;0;0\n1;0;10\n2;5;10\n3;5;30\n",
        "\ufeffx_mm|y_mm\n0|0\n+10.|.0\n10|5.\n30|5|\n",
        "x_cm, y_mm\n0, 0\n1, 0\n1, 5\n3, 5\n",
    ],
)
def test_tables_of_every_kind_are_the_same_points(tmp_path, text):
    part = read_points(written(tmp_path, text), axes=("X", "Y"))
    assert_allclose(part.points, ZIGZAG, rtol=1e-15)
    assert part.axes == ("X", "Y")
    assert part.warnings == ()
    assert part.path.n_pieces == 3
    assert np.isnan(part.feed).all()


def test_pieces_say_their_line(tmp_path):
    part = read_points(written(tmp_path, "x_mm,y_mm\n0,0\n\n10,0\n10,5\n"))
    assert list(part.source_line) == [2, 4]
    assert part.describe(1).endswith("p.csv:4: 10,0")


def test_arrays_and_npy_files(tmp_path):
    file = tmp_path / "p.npy"
    for order in "CF":
        np.save(file, np.asarray(ZIGZAG * 1e3, order=order))
        part = read_points(file, unit="mm")
        assert_allclose(part.points, ZIGZAG, rtol=1e-15)
    part = read_points(np.column_stack([ZIGZAG[:, 0], ZIGZAG]), unit="m", columns=(0, 2))
    assert_allclose(part.path.length, 0.035, rtol=1e-15)
    assert read_points(ZIGZAG, unit="m", closed=True).path.closed


def test_repeats_are_left_out_and_said(tmp_path):
    text = "0 0\n0 0\n1 0\n1.0005 0\n2 0\n2 0\n50 0\n10 0.1\n10.0001 0.1\n"
    part = read_points(written(tmp_path, text), unit="mm", spacing="1 um")
    clean = part.cleaning
    assert (clean.points_read, clean.points_kept) == (9, 5)
    assert (clean.repeated, clean.first_repeated) == (2, 2)
    assert (clean.near, clean.first_near) == (2, 4)
    assert_allclose(part.points[-1], [0.0100001, 0.0001], rtol=1e-12)  # the end stays
    assert (clean.gap_line, clean.turns_back, clean.first_turn_back) == (0, 1, 7)
    assert len(part.warnings) == 3
    assert "the first in line 2" in part.warnings[0]
    far = read_points(written(tmp_path, "0 0\n1 0\n2 0\n3 0\n100 0\n"), unit="mm")
    assert far.cleaning.gap_line == 4
    assert "the step after line 4 is 97000 um" in far.warnings[0]


def arc(n, noise):
    turn = np.linspace(0.0, 1.5 * np.pi, n)
    clean = 0.02 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return clean + noise * np.random.default_rng(0).normal(size=clean.shape)


@pytest.mark.parametrize("tolerance", [None, "10 um"])
def test_splines_keep_to_the_points_and_say_how_closely(tolerance):
    points = arc(120, 2e-6)
    part = read_points(points, unit="m", spline=True, tolerance=tolerance)
    s = np.linspace(0.0, float(part.path.length), 20_001)
    dense = cKDTree(np.asarray(jax.jit(jax.vmap(part.path.position))(s)))
    distance = dense.query(points)[0]
    limit = 1e-12 if tolerance is None else 1e-5
    assert part.fit_error_max <= limit
    # places are 5 um apart
    assert_allclose(distance.max(), part.fit_error_max, rtol=0.05, atol=3e-6)
    assert "the spline is up to" in part.warnings[-1]
    assert (tolerance is None) == (part.path.n_pieces > 100)
    assert (np.diff(part.source_line) >= 0).all()
    assert part.source_line[-1] > 60


def test_corners_stay_corners_between_splines():
    side = np.linspace(0.0, 1.0, 30)
    wave = 0.02 * np.sin(2 * np.pi * side)
    square = np.concatenate([
        np.stack([side, wave], axis=1), np.stack([1 + wave, side], axis=1)[1:],
        np.stack([1 - side, 1 + wave], axis=1)[1:], np.stack([wave, 1 - side], axis=1)[1:-1],
    ])  # fmt: skip
    for shift in (0, 11):  # the seam at a corner and within a side
        part = read_points(
            np.roll(square, shift, axis=0), unit="m", spline=True, tolerance=1e-5,
            corner_angle=0.7, closed=True,
        )  # fmt: skip
        assert part.path.closed
        assert len(part.fits) == 4
        joints = part.path.joints()
        assert_allclose(np.sort(joints.turning_angle)[-4:], np.pi / 2, atol=0.3)
        assert np.sort(joints.turning_angle)[-5] < 1e-6
        assert part.fit_error_max <= 1e-5


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("0,0\n1,1\n", {}, "the unit of the coordinates is not known"),
        ("x,y_mm\n0,0\n1,1\n", {}, "the unit of the coordinates is not known"),
        ("x_mm,y_mm\n0,0\n1,1\n", {"unit": "in"}, "unit is 'in', but the heading says 'mm'"),
        ("0,0\n1,1\n", {"unit": "furlong"}, "unit must be a unit of length"),
        ("0,0\n1,nan\n", {"unit": "mm"}, "p.csv:2: column 1 is 'nan', which is not a finite"),
        ("x,y\n0,0\n\n1,\n", {"unit": "mm"}, "p.csv:4: y is missing"),
        ("0,0\n1,1e999\n", {"unit": "mm"}, "p.csv:2: a coordinate is not finite or beyond"),
        ("0,0\n1,1_0\n", {"unit": "mm"}, "p.csv:2: column 1 is '1_0'"),
        ("0,0\n1,1,1\n", {"unit": "mm"}, "p.csv:2: has 3 columns, the lines before have 2"),
        ("1,5 2,5\n2,5 3,5\n", {"unit": "mm"}, "give delimiter and decimal"),
        ("1,5;2.5\n2,5;3,5\n", {"unit": "mm"}, "column 1 is '2.5', .* decimal comma"),
        ("nan,nan\n1,1\n2,2\n", {"unit": "mm"}, "p.csv:1: column 0 is 'nan'"),
        ("# nothing\n\n", {"unit": "mm"}, "has no points"),
        ("x_mm,y_mm\n", {}, "has a heading and no points"),
        ("1,1\n1,1\n", {"unit": "mm"}, "all points are one"),
        ("0,0,0,0\n1,1,1,1\n", {"unit": "mm", "axes": ("X", "Y")}, "say which with columns"),
        ("x_mm,y_mm\n0,0\n1,1\n", {"columns": ("x", "w")}, "no column 'w'; Allowed: x_mm, y_mm"),
        ("0,0\n1,1\n", {"unit": "mm", "columns": (0, 2)}, "has no column 2, only 0 to 1"),
        ("0,0\n1,1\n", {"unit": "mm", "closed": True}, "needs three points or more"),
        (b"\x93NUMPY\x01\x00\x00", {"unit": "mm"}, "is not a valid .npy file"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_named(tmp_path, text, options, message):
    with pytest.raises((PartError, UnitError), match=message):
        read_points(written(tmp_path, text), **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 1e-6}, "tolerance goes with spline"),
        ({"corner_angle": 0.5}, "corner_angle goes with spline"),
        ({"spline": True, "tolerance": "5"}, "the unit is missing"),
        ({"spline": True, "corner_angle": 4.0}, "corner_angle must be"),
        ({"spline": True, "degree": 9}, "degree must be a whole number from 1 to 5"),
        ({"spline": True, "parametrisation": "arc"}, "unknown parametrisation"),
        ({"spacing": 0.0}, "spacing must be > 0 m"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(ConfigurationError, match=message):
        read_points(ZIGZAG, unit="m", **options)


def test_missing_files_and_folders(tmp_path):
    for file in (tmp_path, tmp_path / "none.csv"):
        with pytest.raises(PartError, match=r"regular file|cannot be read"):
            read_points(file, unit="mm")


def test_npy_files_cannot_claim_more_than_they_have(tmp_path):
    stream = io.BytesIO()
    np.save(stream, np.zeros((2, 2)))
    claims = stream.getvalue().replace(b"(2, 2)", b"(9999999999, 2)")
    with pytest.raises(PartError, match=r"size that it claims|valid"):
        read_points(written(tmp_path, claims, "p.npy"), unit="mm")
    np.save(tmp_path / "o.npy", np.array([[{}, 1]], dtype=object), allow_pickle=True)
    with pytest.raises(PartError, match="must hold numbers"):
        read_points(tmp_path / "o.npy", unit="mm")


def test_hundred_thousand_points(tmp_path):
    turn = np.linspace(0.0, 20.0, 100_000)
    points = np.stack([np.cos(turn), np.sin(turn)], axis=1) * (1.0 + turn[:, None])
    text = "x_mm;y_mm\n" + "\n".join(f"{x:.6f};{y:.6f}" for x, y in points)
    part = read_points(written(tmp_path, text))
    assert part.path.n_pieces == 99_999
    assert_allclose(part.points, points * 1e-3, rtol=0, atol=0.51e-9)


UNTIMED = settings(deadline=None, max_examples=150, suppress_health_check=list(HealthCheck))
OPTIONS = st.fixed_dictionaries(
    {"unit": st.sampled_from(["mm", None])},
    optional={
        "spline": st.just(True), "closed": st.booleans(),
        "delimiter": st.sampled_from([",", ";", " "]), "decimal": st.sampled_from([".", ","]),
        "axes": st.just(("X", "Y")), "corner_angle": st.just(0.5), "header": st.booleans(),
    },
)  # fmt: skip


def survives(tmp_path, data, options):
    try:
        part = read_points(written(tmp_path, data), **options)
    except ContourlabError:
        return
    assert np.isfinite(np.asarray(part.path.breaks)).all()


@UNTIMED
@given(st.binary(max_size=200), OPTIONS)
def test_any_bytes(tmp_path, data, options):
    survives(tmp_path, data, options)


@UNTIMED
@given(st.text(alphabet='0123456789.,;- e\n\t|#xy_m[]"+', max_size=200), OPTIONS)
def test_any_text_that_looks_like_a_table(tmp_path, text, options):
    survives(tmp_path, text, options)


@UNTIMED
@given(
    st.lists(st.tuples(st.integers(-3, 3), st.floats(-1e9, 1e9)), min_size=1, max_size=8), OPTIONS
)
def test_any_points(tmp_path, rows, options):
    survives(tmp_path, "\n".join(f"{x},{y!r}" for x, y in rows), options)


def test_a_column_that_is_no_length_is_refused_unless_it_is_chosen(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t_s,x_mm,y_mm\n0,0,0\n1,1,0\n2,2,0\n")
    for options in ({"unit": "mm"}, {}):
        with pytest.raises(UnitError, match=r"column 't_s' is in s, which is no length"):
            read_points(file, **options)
    for options in ({"axes": ("x", "y")}, {"columns": ["x_mm", "y_mm"]}):
        assert_allclose(read_points(file, **options).path.length, 2e-3, rtol=1e-15)
    file.write_text("x_mm,x_mm\n0,0\n1,1\n")
    with pytest.raises(PartError, match="axes must have different names"):
        read_points(file)


def test_quoted_numbers_and_the_text_that_spreadsheets_call_unicode(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text('"x_mm";"y_mm"\n"0,5";"0"\n"1,5";"0"\n')
    assert_allclose(read_points(file).points, [[0.5e-3, 0], [1.5e-3, 0]], rtol=1e-15)
    file.write_text('"x_mm","y_mm"\n"0,5","0"\n')  # which comma is the decimal one is not clear
    with pytest.raises(PartError, match="has 3 columns, the lines before have 2"):
        read_points(file)
    file.write_text('"x_mm","y_mm","z_mm"\n"0,5","0"\n')
    with pytest.raises(PartError, match="which is not a finite number"):
        read_points(file)
    for encoding in ("utf-16", "utf-16-le", "utf-16-be"):
        mark = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}.get(encoding, b"")
        file.write_bytes(mark + "x_mm\ty_mm\r\n0\t0\r\n1\t1\r\n".encode(encoding))
        assert_allclose(read_points(file).points, [[0, 0], [1e-3, 1e-3]], rtol=1e-15)
