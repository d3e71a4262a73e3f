"""Any bytes give a log or an error of ours: no traceback, no hang."""

import io

import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from contourlab.errors import ContourlabError
from contourlab.logs import Log, read_log

SETTINGS = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "log.bin"


def judge(file, data, **options):
    file.write_bytes(data)
    try:
        log = read_log(file, **options)
    except ContourlabError:
        return None
    assert isinstance(log, Log)
    assert np.isfinite(log.actual).all()
    assert (np.diff(log.time) > 0).all()
    return log


@SETTINGS
@given(
    data=st.binary(max_size=300),
    magic=st.sampled_from(
        [b"", b"\x89HDF\r\n\x1a\n", b"MATLAB 5.0", b"MDF     4.10", b"\xff\xfe", b"CDF\x01"]
    ),
)
def test_bytes(file, data, magic):
    judge(file, magic + data)
    judge(file, magic + data, commanded="0", actual="1", sample_time=1e-3)


CELLS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(repr),
    st.sampled_from(
        ["", "nan", "1,5", "x", '"', "#", "overrun", "1e400", "9" * 30, "True", "\u2212"]
    ),
    st.text(max_size=5),
)


@SETTINGS
@given(
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=5), min_size=1, max_size=12),
    delimiter=st.sampled_from([",", ";", " ", "\t"]),
    options=st.sampled_from([
        {}, {"commanded": "0", "actual": "1"}, {"commanded": "0,1", "actual": "2,3", "unit": "mm"},
        {"actual": "0", "time": "1"}, {"actual": "0", "header": False, "comment": ""},
        {"actual": "0", "delimiter": ";", "decimal": ","},
    ]),
)  # fmt: skip
def test_tables(file, rows, delimiter, options):
    judge(
        file, "\n".join(delimiter.join(row) for row in rows).encode("utf-8", "replace"), **options
    )


@SETTINGS
@given(
    at=st.lists(st.tuples(st.integers(0, 599), st.integers(0, 255)), max_size=6),
    cut=st.integers(0, 600),
)
def test_damaged_mat_files(file, at, cut):
    stream = io.BytesIO()
    scipy.io.savemat(stream, {"a": np.arange(9.0), "b": {"c": np.eye(3)}}, do_compression=True)
    data = bytearray(stream.getvalue())
    for place, value in at:
        data[place % len(data)] = value
    judge(file, bytes(data[: cut or None]), commanded="a", actual="b.c.0")
