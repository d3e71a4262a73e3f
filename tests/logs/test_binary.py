"""MAT, HDF5, MDF4 and our own netCDF."""

import h5py
import numpy as np
import pytest
import scipy.io

import contourlab as cl
from contourlab.errors import LogError
from contourlab.logs import open_log, read_log

N = 40
T = np.arange(N) * 2e-3
SET = np.column_stack([np.cos(20 * T), np.sin(20 * T)]) * 0.02
ACT = SET + 1e-5
CHOSEN = {"commanded": "r.0,r.1", "actual": "x,y", "time": "t"}


def check(log):
    np.testing.assert_allclose(log.commanded, SET, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.actual, ACT, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.time, T, rtol=0, atol=1e-12)


@pytest.mark.parametrize("shape", ["rows", "columns"])
def test_mat(tmp_path, shape):
    file = tmp_path / "log.mat"
    r = SET * 1e3 if shape == "rows" else SET.T * 1e3
    scipy.io.savemat(file, {"t": T, "r": r, "x": ACT[:, 0] * 1e3, "y": ACT[:, 1] * 1e3})
    check(read_log(file, **CHOSEN, unit="mm", time_unit="s"))


def test_structures_in_mat(tmp_path):
    file = tmp_path / "log.mat"
    scipy.io.savemat(file, {"log": {"t": T, "signals": {"set": SET, "act": ACT}, "title": "run"}})
    check(read_log(
        file, commanded="log.signals.set.0,log.signals.set.1",
        actual="log.signals.act.0,log.signals.act.1", time="log.t", unit="m", time_unit="s",
    ))  # fmt: skip


def write_hdf5(file, **options):
    with h5py.File(file, "w", **options) as h5:
        h5["t"] = T
        h5["r"] = SET.T * 1e3
        h5["x"] = ACT[:, 0] * 1e3
        h5["y"] = ACT[:, 1] * 1e3
        for name, unit in (("t", "s"), ("r", "mm"), ("x", "mm"), ("y", "mm")):
            h5[name].attrs["unit"] = unit


def test_hdf5_with_units(tmp_path):
    write_hdf5(tmp_path / "log.h5")
    log = read_log(tmp_path / "log.h5", **CHOSEN)
    check(log)
    assert all(use.unit_stated for use in log.columns)
    assert log.warnings == ()


def test_mat_7_3_is_hdf5_behind_a_user_block(tmp_path):
    write_hdf5(tmp_path / "log.mat", userblock_size=512)
    with (tmp_path / "log.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")
    log = read_log(tmp_path / "log.mat", **CHOSEN)
    check(log)
    assert log.format == "MAT 7.3"


def test_tables_in_hdf5(tmp_path):
    rows = np.zeros(N, [("t", float), ("xs", float), ("ys", float), ("xa", float), ("ya", float)])
    for name, values in zip(rows.dtype.names, (T, *SET.T, *ACT.T), strict=True):
        rows[name] = values
    with h5py.File(tmp_path / "log.h5", "w") as h5:
        h5["run"] = rows
    check(read_log(tmp_path / "log.h5", commanded="run.xs,run.ys", actual="run.xa,run.ya",
                   time="run.t", unit="m", time_unit="s"))  # fmt: skip


def test_other_files_are_not_followed(tmp_path):
    np.zeros(8).tofile(tmp_path / "secret")
    with h5py.File(tmp_path / "log.h5", "w") as h5:
        h5["x"] = np.arange(3.0)
        h5.create_dataset("stolen", (4,), float, external=[(tmp_path / "secret", 0, 32)])
        h5["linked"] = h5py.ExternalLink(tmp_path / "other.h5", "/x")
    assert open_log(tmp_path / "log.h5").names == ("x",)


def test_columns_of_different_length_are_refused(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as h5:
        h5["xs"], h5["xa"] = np.arange(5.0), np.arange(6.0)
    with pytest.raises(LogError, match="different numbers of samples: xs 5, xa 6"):
        read_log(tmp_path / "log.h5", commanded="xs", actual="xa", unit="mm", sample_time=1e-3)


@pytest.fixture(scope="module")
def recording():
    machine = cl.machines.ball_screw_stage(n_axes=2)
    contour = cl.contours.Circle(radius=0.01, center=(0.1, 0.1))
    reference = cl.feedrate.constant_rate(contour, rate=6.0, duration=0.3, sample_time=2e-3)
    law = cl.controllers.Cascade(model=machine.nominal, position_gain=30.0)
    return cl.simulate(machine, law, reference)


def test_our_own_recordings(tmp_path, recording):
    recording.save(tmp_path / "run.nc")
    log = read_log(tmp_path / "run.nc")
    np.testing.assert_array_equal(log.commanded, np.asarray(recording["reference"]))
    np.testing.assert_array_equal(log.actual, np.asarray(recording["measured"]))
    np.testing.assert_array_equal(log.command, np.asarray(recording["command"]))
    assert log.axes == ("X", "Y")
    assert log.warnings == ()
    true = read_log(tmp_path / "run.nc", commanded="reference_X,reference_Y",
                    actual="actual_X,actual_Y")  # fmt: skip
    np.testing.assert_array_equal(true.actual, np.asarray(recording["actual"]))
    # as CSV it is text with units nowhere: they are stated
    recording.to_csv(tmp_path / "run.csv")
    text = read_log(tmp_path / "run.csv", commanded="reference_X,reference_Y",
                    actual="measured_X,measured_Y", unit="m")  # fmt: skip
    np.testing.assert_array_equal(text.actual, log.actual)


def test_mdf4(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="MDF files need the extra logs")
    file = tmp_path / "log.mf4"
    signals = [
        asammdf.Signal(samples=v, timestamps=T, name=n, unit="mm")
        for n, v in (("xs", SET[:, 0] * 1e3), ("ys", SET[:, 1] * 1e3), ("xa", ACT[:, 0] * 1e3),
                     ("ya", ACT[:, 1] * 1e3))
    ]  # fmt: skip
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(signals)
        mdf.save(file)
    log = read_log(file, commanded="xs,ys", actual="xa,ya")
    check(log)
    assert log.format == "MDF"
    assert log.warnings == ()


def test_mdf_without_asammdf_says_what_to_install(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "asammdf", None)
    (tmp_path / "log.mf4").write_bytes(b"MDF     4.10    " + b"\0" * 200)
    with pytest.raises(LogError, match=r"pip install contourlab\[logs\]"):
        read_log(tmp_path / "log.mf4")


def test_netcdf_classic_is_named(tmp_path):
    (tmp_path / "log.nc").write_bytes(b"CDF\x01" + b"\0" * 100)
    with pytest.raises(LogError, match="netCDF classic"):
        read_log(tmp_path / "log.nc")
