"""Figures of merit against values worked out by hand."""

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from contourlab.errors import RecordingError
from contourlab.recordings import METRICS, Recording


@pytest.fixture
def recording():
    time = np.array([0.0, 0.1, 0.2, 0.3])
    return Recording(
        xr.Dataset(
            {
                "contour_error": ("time", [0.0, -3e-6, 4e-6, 0.0]),
                "contour_error_vector": (("time", "coordinate"), np.zeros((4, 2))),
                "contour_error_estimate": (
                    ("time", "coordinate"), np.array([[0, 0], [3e-6, 4e-6], [0, 0], [0, 0]]),
                ),
                "tracking_error": (("time", "axis"), np.array([[0, 0], [3, 4], [0, 0], [0, 0.0]])),
                "command": (("time", "axis"), np.array([[1, -2], [1, 2], [-1, 10], [1, 2.0]])),
                "command_limit": ("axis", [np.inf, 10.0]),
            },
            coords={"time": time, "axis": ["X", "Y"], "coordinate": ["X", "Y"]},
        )
    )  # fmt: skip


def test_values_by_hand(recording):
    m = recording.metrics
    assert_allclose(m["contour_error_rms"], np.sqrt(25e-12 / 4), rtol=1e-15)
    assert m["contour_error_max"] == 4e-6  # of the absolute value
    assert_allclose(m["contour_error_mean"], 7e-6 / 4, rtol=1e-15)
    assert_allclose(m["tracking_error_rms"], 2.5, rtol=1e-15)
    assert m["tracking_error_max"] == 5.0
    assert m["command_rms"] == [1.0, np.sqrt(112 / 4)]
    assert m["command_max"] == [1.0, 10.0]
    assert_allclose(m["saturation_time"], 0.1, rtol=1e-12)  # one sample of four, 0.1 s each
    assert_allclose(m["cycle_time"], 0.3, rtol=1e-15)
    assert_allclose(m["estimate_error_max"], 5e-6, rtol=1e-12)
    assert_allclose(m["estimate_error_rms"], 2.5e-6, rtol=1e-12)
    assert set(m) == set(METRICS)


def test_a_negative_peak_counts(recording):
    recording.dataset["contour_error"][1] = -9e-6
    assert recording.metrics["contour_error_max"] == 9e-6


def test_window(recording):
    assert recording.metrics_between(0.1, 0.1)["contour_error_max"] == 3e-6
    assert recording.metrics_between(0.2, 5.0)["contour_error_max"] == 4e-6
    with pytest.raises(RecordingError, match="no sample between 7 s and 8 s"):
        recording.metrics_between(7.0, 8.0)


def test_a_metric_without_its_data(recording):
    short = Recording(recording.dataset.drop_vars("command"))
    assert "command_rms" not in set(short.metrics)
    with pytest.raises(RecordingError, match="command_rms needs command"):
        short.metrics["command_rms"]
    with pytest.raises(RecordingError, match="did you mean contour_error_rms"):
        short.metrics["contour_error_rmss"]


def test_a_diverged_run_has_no_figures(recording):
    recording.dataset.attrs["diverged_at"] = 0.3
    assert np.isnan(recording.metrics["contour_error_rms"])
    assert np.isnan(recording.metrics["command_max"]).all()


def test_nan_is_not_hidden(recording):
    recording.dataset["contour_error"][2] = np.nan
    assert np.isnan(recording.metrics["contour_error_max"])
    assert np.isnan(recording.metrics["contour_error_rms"])
