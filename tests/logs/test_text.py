"""Text logs in every dialect give the same numbers, and every mistake names its line."""

from pathlib import Path

import numpy as np
import pytest

from contourlab.errors import ConfigurationError, LogError
from contourlab.evaluation.stretches import find_breaks
from contourlab.logs import open_log, read_log

RECORDED = Path(__file__).parent / "recorded"

N = 50
T = np.arange(N) * 1e-3
SET = np.column_stack([10.0 + 5.0 * np.cos(40.0 * T), -3.0 + 5.0 * np.sin(40.0 * T)]).round(6)
ACT = (SET - 0.01).round(6)


def table(delimiter=",", decimal=".", head="t,xs,ys,xa,ya", rows=None, end="\n", tail=""):
    lines = [head.replace(",", delimiter)] if head else []
    for t, s, a in zip(T, SET, ACT, strict=True) if rows is None else rows:
        fields = [f"{v:.6f}".replace(".", decimal) for v in (t, *s, *a)]
        lines.append(delimiter.join(fields) + tail)
    return end.join(lines) + end


def read(tmp_path, text, **options):
    file = tmp_path / "log.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    chosen = {"commanded": "xs,ys", "actual": "xa,ya", "time": "t", "time_unit": "s", "unit": "mm"}
    return read_log(file, **(chosen | options))


BY_NUMBER = {"commanded": "1,2", "actual": "3,4", "time": "0"}


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (table(), {}),
        (table(";", ","), {}),
        (table("\t", ","), {}),
        (table("\t"), {}),
        (table("|"), {}),
        (table(" "), {}),
        (table(" ", ","), {}),
        (table(end="\r\n"), {}),
        (table(tail=","), {}),
        (table(";", ",", tail=";"), {}),
        (table(head=""), BY_NUMBER),
        (table(" ", head=""), BY_NUMBER),
        ("# made by a logger\n% on a machine\n" + table(), {}),
        ("# t xs ys xa ya\n" + table(" ", head=""), {}),
        ("Recorder 2000;v3\nfile;test\n\n" + table(";", ","), {}),
        (table().replace("\n", "\ns,mm,mm,mm,mm\n", 1), {"unit": None, "time_unit": None}),
        (table(head="t [s],xs [mm],ys [mm],xa [mm],ya [mm]"), {"unit": None, "time_unit": None}),
        (table(head="t_s,xs_mm,ys_mm,xa_mm,ya_mm"), {"unit": None, "time_unit": None}),
        (table(head='"t","xs","ys","xa","ya"'), {}),
        (table().encode("utf-16"), {}),
        (table().encode("utf-16-le"), {}),
        (table(";", ",").encode("utf-16-be"), {}),
        (b"\xef\xbb\xbf" + table().encode(), {}),
        (table(head="t,xs,ys,xa,ya").replace("t,", "T,", 1), {}),
        ("\n\n" + table().replace("\n", "\n\n"), {}),
    ],
)  # fmt: skip
def test_every_dialect_gives_the_same_numbers(tmp_path, text, options):
    log = read(tmp_path, text, **options)
    np.testing.assert_allclose(log.commanded, SET * 1e-3, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.actual, ACT * 1e-3, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.time, T, rtol=0, atol=1e-12)
    assert log.timed
    np.testing.assert_allclose(log.sample_time, 1e-3, rtol=1e-9)
    assert log.scale == 1e-3


def test_text_columns_that_are_not_wanted_do_no_harm(tmp_path):
    rows = table().splitlines()
    text = "\n".join(
        [rows[0] + ",state", *(f"{row},Layer {k} Up" for k, row in enumerate(rows[1:]))]
    )
    np.testing.assert_allclose(read(tmp_path, text).actual, ACT * 1e-3, rtol=0, atol=1e-15)


def test_a_delimiter_in_quotes_or_a_remark_makes_no_field(tmp_path):
    rows = table().splitlines()
    rows = [f'{row},"as planned, nearly"' if k else f"{row},note" for k, row in enumerate(rows)]
    rows[7] += "  # chips, many"
    np.testing.assert_allclose(read(tmp_path, "\n".join(rows)).actual, 1e-3 * ACT, atol=1e-12)
    blanks = "\n".join(f'{row} "as planned"' for row in table(" ", head="").splitlines())
    found = read(tmp_path, blanks, **BY_NUMBER)
    np.testing.assert_allclose(found.actual, 1e-3 * ACT, atol=1e-12)


def test_halsampler(tmp_path):
    rows = [f"{k} " + " ".join(f"{v:.6f}" for v in (*s, *a)) + " "
            for k, (s, a) in enumerate(zip(SET, ACT, strict=True), 100)]  # fmt: skip
    text = "\n".join([*rows[:20], "overrun", *rows[25:]])
    options = {"commanded": "1,2", "actual": "3,4", "time": None, "sample_time": "1 ms"}
    log = read(tmp_path, text, **options)
    assert log.format == "halsampler"
    assert list(log.lost_after) == [19]
    # the numbers of the samples tell how many were lost
    np.testing.assert_allclose(log.time, np.delete(T, range(20, 25)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.actual, np.delete(ACT, range(20, 25), 0) * 1e-3, atol=1e-15)
    assert any("lost at 1 place" in warning for warning in log.warnings)


@pytest.mark.parametrize("name", ["halsampler", "halsampler_tagged"])
def test_what_halsampler_wrote(name):
    """A sine and a cosine of 12.5 mm at 3 Hz, a bit, -7 and 42, recorded from LinuxCNC."""
    file = RECORDED / f"{name}.txt"
    source = open_log(file)
    tagged = name.endswith("tagged")
    assert source.format == "halsampler"
    assert source.counter == ("0" if tagged else None)
    sine, cosine, bit, signed, unsigned = (str(k + tagged) for k in range(5))
    rest = source.read((bit, signed, unsigned)).values
    assert set(np.unique(rest[bit])) <= {0.0, 1.0}
    assert (rest[signed] == -7.0).all()
    assert (rest[unsigned] == 42.0).all()
    log = read_log(file, commanded=sine, actual=cosine, axes="X", unit="mm", sample_time="1 ms")
    assert log.n_samples == 80
    assert list(log.lost_after) == []  # the overrun in front of the first sample lost nothing
    np.testing.assert_allclose(log.time, np.arange(80) * 1e-3, atol=1e-12)
    angle = np.unwrap(np.arctan2(log.commanded[:, 0], log.actual[:, 0]))
    np.testing.assert_allclose(np.hypot(log.commanded, log.actual), 12.5e-3, rtol=1e-6)
    np.testing.assert_allclose(np.diff(angle), 2.0 * np.pi * 3.0 * 1e-3, rtol=1e-4)


def test_a_full_fifo_is_seen_by_the_jump_that_it_leaves():
    """The numbers of halsampler go on where samples were lost, so only the positions tell."""
    file = RECORDED / "halsampler_full.txt"
    log = read_log(file, actual="1,2", axes="XY", unit="mm", sample_time="1 ms")
    assert list(log.lost_after) == []
    assert list(find_breaks(log).jumps) == [48]


@pytest.mark.parametrize("newer", [True, False])
def test_halscope(tmp_path, newer):
    """As halscope writes it: semicolons without blanks; the newer one saves its screen too."""
    head = (
        "# Sampling period is 1000000 ns\n"
        "joint.0.pos-cmd;joint.1.pos-cmd;joint.0.pos-fb;joint.1.pos-fb;motion.in-position\n"
    )
    if newer:
        head += "# Position: 0.5;0.5;0.5;0.5;0.5\n# Scale: 1;1;1;1;1\n"
    rows = [";".join([*(f"{v:.14f}" for v in (*s, *a)), "1"])
            for s, a in zip(SET, ACT, strict=True)]  # fmt: skip
    file = tmp_path / "scope.csv"
    file.write_text(head + "\n".join(rows) + "\n")
    log = read_log(file, unit="mm")
    assert log.format == "halscope"
    assert [use.column for use in log.columns][:2] == ["joint.0.pos-cmd", "joint.1.pos-cmd"]
    np.testing.assert_allclose(log.time, T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.actual, ACT * 1e-3, rtol=0, atol=1e-15)
    assert all("by their names" in warning for warning in log.warnings)


def test_older_halscope(tmp_path):
    names = ("xc", "yc", "xf", "yf")
    rows = [" ".join(f"{n} {v:+.14f}" for n, v in zip(names, (*s, *a), strict=True))
            for s, a in zip(SET, ACT, strict=True)]  # fmt: skip
    file = tmp_path / "scope.log"
    file.write_text("Sampling period is 1000000 nSec \n\n" + " \n".join(rows))
    log = read_log(file, commanded="xc,yc", actual="xf,yf", unit="mm")
    np.testing.assert_allclose(log.actual, ACT * 1e-3, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.sample_time, 1e-3, rtol=1e-12)


def test_dates_are_times(tmp_path):
    rows = table().splitlines()
    dated = [rows[0]] + [
        f"2024-03-01T23:59:59.{980 + k:03d}Z,{row.split(',', 1)[1]}"
        if k < 20 else f"2024-03-02T00:00:00.{k - 20:03d}Z,{row.split(',', 1)[1]}"
        for k, row in enumerate(rows[1:])
    ]  # fmt: skip
    log = read(tmp_path, "\n".join(dated))
    np.testing.assert_allclose(log.time, T, rtol=0, atol=1e-7)  # 15 ns in a float of 1e8 s


@pytest.mark.parametrize("cell", ["", "NaN", "nan", "inf", "null"])
def test_missing_positions_are_left_out_and_said(tmp_path, cell):
    rows = table().splitlines()
    fields = rows[8].split(",")
    fields[3] = cell
    rows[8] = ",".join(fields)
    log = read(tmp_path, "\n".join(rows))
    assert log.n_missing == 1
    assert list(np.flatnonzero(np.diff(log.row) > 1)) == [6]
    np.testing.assert_allclose(log.time, np.delete(T, 7), rtol=0, atol=1e-12)
    assert any("1 of 50 samples lack a position" in warning for warning in log.warnings)


def mend(text, line, old, new):
    rows = text.splitlines()
    rows[line - 1] = rows[line - 1].replace(old, new, 1)
    return "\n".join(rows)


REPEATED = "\n".join([*table().splitlines()[:10], *table().splitlines()[9:]])
BACKWARDS = "\n".join([*table().splitlines()[:30], *table().splitlines()[5:]])


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (table(), {"actual": "xa,za"}, "no column 'za'; Allowed: t, xa, xs, ya, ys"),
        (table(), {"actual": "xa,9"}, "no column '9'"),
        (table(), {"commanded": "xs"}, "commanded has 1 columns and the log 2 axes"),
        (table(), {"commanded": "xa,ya"}, "cannot be the same column"),
        (table(), {"commanded": "xs,xs"}, "the same column twice"),
        (table(), {"time": "xa"}, "cannot be the time and a position too"),
        (mend(table(), 13, "0.011", "0.0l1"), {}, "log.csv:13: column 't' is '0.0l1000', not a"),
        (mend(table(";", ","), 13, "0,011", "0.0,1"), {}, "log.csv:13: column 't' is '0.0,1000'"),
        (mend(table(), 13, "0.011", "0,011"), {}, "log.csv:13: has 6 fields, the table has 5 col"),
        (BACKWARDS, {}, "time runs backwards"),
        (table(rows=[(0.0, SET[0], ACT[0])]), {}, "1 sample is left"),
        (table(rows=[(k, SET[0], ACT[0]) for k in range(9)]), {}, "nothing moves"),
        (table(rows=[(k, SET[k], ACT[0]) for k in range(9)]), {}, "'xa' is constant while 'xs'"),
        (table(rows=[(0, s, s) for s in SET]), {}, "is constant"),
        (table(rows=[(t, (np.nan, 1.0), s) for t, s in zip(T, SET, strict=True)]), {},
         "'xs' holds no numbers"),
        (table(), {"sample_time": "5 ms"}, "give one of them"),
        (table(), {"unit": "kg"}, "unit must be a unit of length"),
        (table(head="t,xs_mm,ys_mm,xa_mm,ya_mm"), {"unit": "m"}, "is in mm, but unit is 'm'"),
        (table(head="t,xs_mm,ys_mm,xa_um,ya_um"), {"unit": None}, "are in different units"),
        ("hello\nworld\n", {}, "no table of numbers"),
        ("", {}, "is empty"),
        ("a,b\n", {}, "no table of numbers"),
        ("# nothing\n", {}, "holds no samples"),
        (b"\x00\x01\x02" * 100, {}, "neither text nor"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path, text, options, message):
    with pytest.raises(Exception, match=message) as caught:
        read(tmp_path, text, **options)
    from contourlab.errors import ContourlabError

    assert isinstance(caught.value, ContourlabError)


def test_repeated_instants_are_left_out_and_said(tmp_path):
    log = read(tmp_path, REPEATED)
    assert log.n_repeated == 1
    assert log.n_samples == N
    assert any("repeat the instant" in warning for warning in log.warnings)


def test_no_time_is_said(tmp_path):
    text = table(head="a,xs,ys,xa,ya")
    log = read(tmp_path, text, time=None, time_unit=None)
    assert not log.timed
    np.testing.assert_array_equal(log.time, np.arange(N))
    assert any("neither a column of time nor a sample time" in w for w in log.warnings)


def test_units_that_are_not_stated_are_guessed_and_said(tmp_path):
    log = read(tmp_path, table(), unit=None, time_unit=None)
    assert log.scale == 1e-3
    assert any("taken for mm" in warning for warning in log.warnings)
    assert any("taken for s" in warning for warning in log.warnings)
    assert not any(use.unit_stated for use in log.columns)


@pytest.mark.parametrize(
    "names",
    [
        ("X_SetPosition", "Y_SetPosition", "X_ActualPosition", "Y_ActualPosition"),
        ("joint.0.pos-cmd", "joint.1.pos-cmd", "joint.0.pos-fb", "joint.1.pos-fb"),
        ("X soll", "Y soll", "X ist", "Y ist"),
        ("SetPosX", "SetPosY", "ActPosX", "ActPosY"),
        ("x_ref [mm]", "y_ref [mm]", "x_meas [mm]", "y_meas [mm]"),
    ],
)
def test_columns_are_guessed_by_their_names(tmp_path, names):
    text = table(head=",".join(("time_s", *names)))
    file = tmp_path / "log.csv"
    file.write_text(text)
    log = read_log(file, unit="mm")
    assert [use.column for use in log.columns] == ["time_s", *names]
    assert not log.columns[1].column_stated
    np.testing.assert_allclose(log.commanded, SET * 1e-3, rtol=0, atol=1e-15)


def test_velocities_are_not_taken_for_positions(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text(table(head="time,X_SetVelocity,Y_SetVelocity,X_ActVelocity,Y_ActVelocity"))
    with pytest.raises(LogError, match="cannot be guessed"):
        read_log(file, unit="mm")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"delimiter": "ab"}, "delimiter must be one character"),
        ({"decimal": ";"}, "decimal must be"),
        ({"delimiter": ",", "decimal": ","}, "must differ"),
    ],
)
def test_options_are_checked(tmp_path, options, message):
    (tmp_path / "log.csv").write_text(table())
    with pytest.raises(ConfigurationError, match=message):
        open_log(tmp_path / "log.csv", **options)


def test_stated_dialect_wins(tmp_path):
    log = read(tmp_path, table(";", ","), delimiter=";", decimal=",", header=True, comment="#")
    np.testing.assert_allclose(log.actual, ACT * 1e-3, rtol=0, atol=1e-15)
    with pytest.raises(LogError):
        read(tmp_path, table(";", ","), decimal=".")


def test_a_log_becomes_a_recording(tmp_path):
    log = read(tmp_path, table())
    recording = log.recording()
    np.testing.assert_allclose(
        np.asarray(recording["tracking_error"]), (SET - ACT) * 1e-3, atol=1e-15
    )
    assert recording.metrics["tracking_error_max"] == pytest.approx(np.sqrt(2) * 1e-5, rel=1e-9)
    assert list(np.asarray(recording["axis"])) == ["X", "Y"]
