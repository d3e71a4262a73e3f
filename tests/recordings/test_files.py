"""Recordings survive the disk, and files are written whole or not at all."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from contourlab.errors import OutputError, RecordingError
from contourlab.recordings import Recording
from contourlab.recordings.files import atomic_file


@pytest.fixture
def recording():
    time = np.arange(5) * 1e-3
    return Recording(
        xr.Dataset(
            {
                "actual": (("time", "axis"), np.arange(10).reshape(5, 2) / 3.0, {"units": "m"}),
                "status": ("time", np.zeros(5, np.int32)),
                "command_limit": ("axis", [np.inf, 1.0]),
            },
            coords={"time": time, "axis": ["X", "Y"]},
            attrs={"controller": "pid", "seed": 3, "warnings": '["a", "b"]'},
        )
    )


def test_netcdf_round_trip(recording, tmp_path):
    file = tmp_path / "deep" / "run.nc"
    recording.save(file)
    again = Recording.load(file)
    xr.testing.assert_identical(again.dataset, recording.dataset)
    assert again.warnings == ("a", "b")
    assert again.dataset["actual"].attrs["units"] == "m"


def test_csv_and_pandas(recording, tmp_path):
    frame = recording.to_pandas()
    assert list(frame.columns) == ["actual_X", "actual_Y", "status"]
    assert frame.index.name == "time"
    recording.to_csv(tmp_path / "run.csv")
    read = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(read["actual_Y"], frame["actual_Y"])  # 17 digits: exact


def test_nothing_is_overwritten(recording, tmp_path):
    file = tmp_path / "run.nc"
    file.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        recording.save(file)
    assert file.read_text() == "mine"
    recording.save(file, force=True)
    assert Recording.load(file).n_samples == 5


def test_an_interrupted_write_leaves_nothing(tmp_path):
    def interrupted():
        with atomic_file(tmp_path / "x.txt") as temporary:
            Path(temporary).write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_recording(tmp_path):
    with pytest.raises(RecordingError, match="there is no such file"):
        Recording.load(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("hello")
    with pytest.raises(RecordingError, match="not a recording"):
        Recording.load(tmp_path / "text.nc")
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(RecordingError, match="no dimension time"):
        Recording.load(tmp_path / "other.nc")


def test_asking_for_what_is_not_there(recording):
    with pytest.raises(RecordingError, match="did you mean actual"):
        recording["actuall"]
