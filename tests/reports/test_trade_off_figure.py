"""The figure of a trade-off: its rows, that it is drawn, what it refuses."""

import numpy as np
import pytest

from contourlab.errors import ConfigurationError, OutputError
from contourlab.reports import trade_off_rows, write_trade_off_figure


class _Run:
    """What a recording shows of itself here."""

    def __init__(self, time, errors):
        errors = np.asarray(errors)
        self.metrics = {
            "cycle_time": time, "contour_error_rms": np.sqrt(np.mean(errors**2)),
            "contour_error_max": np.max(np.abs(errors)),
        }  # fmt: skip
        self.errors = errors

    def __getitem__(self, name):
        assert name == "contour_error"
        return self.errors


RUNS = {5e-5: _Run(2.0, [1e-5, -6e-5, 2e-5, 0.0]), 1e-4: _Run(1.5, [9e-5, -9e-5, 0.0, 0.0])}


def test_rows_are_of_the_runs_with_the_loosest_bound_first():
    rows = trade_off_rows(RUNS)
    assert [row["bound"] for row in rows] == [1e-4, 5e-5]
    assert [row["cycle_time"] for row in rows] == [1.5, 2.0]
    assert [row["beyond"] for row in rows] == [0.0, 0.25]  # the size counts, not the sign
    assert rows[1]["contour_error_max"] == 6e-5


def test_it_is_drawn_and_does_not_overwrite(tmp_path):
    file = tmp_path / "trade.png"
    write_trade_off_figure(trade_off_rows(RUNS), file)
    assert file.read_bytes()[:8] == bytes([137, 80, 78, 71, 13, 10, 26, 10])
    with pytest.raises(OutputError):
        write_trade_off_figure(trade_off_rows(RUNS), file)
    with pytest.raises(ConfigurationError, match="two rows or more, got 1"):
        write_trade_off_figure(trade_off_rows(RUNS)[:1], tmp_path / "one.png")
