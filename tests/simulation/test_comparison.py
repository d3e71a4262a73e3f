"""Several controllers on the same part."""

import pytest

import contourlab as cl
from contourlab.errors import RefusedError, SimulationError

from .loops import Proportional, line_reference, velocity_stage


def test_names_order_and_best():
    slow, fast = Proportional(k=20.0), Proportional(k=60.0)
    result = cl.compare(velocity_stage((0.01, 0.02)), [slow, fast], line_reference(n=800))
    assert result.names == ("proportional_1", "proportional_2")
    assert result.best("tracking_error_rms") == "proportional_2"
    table = result.table()
    assert list(table.index) == list(result.names)
    assert {"contour_error_rms", "command_max_X", "command_max_Y", "status"} <= set(table.columns)


def test_one_diverging_run_does_not_stop_the_others():
    result = cl.compare(
        velocity_stage(), {"wild": Proportional(k=5000.0), "good": Proportional(k=30.0)},
        line_reference(n=3000),
    )  # fmt: skip
    assert result.recordings["wild"].diverged
    assert result.best("contour_error_rms") == "good"


def test_every_controller_is_checked_before_the_first_runs():
    seen = []
    with pytest.raises(RefusedError, match="commands 3 axes"):
        cl.compare(
            velocity_stage(), {"good": Proportional(k=1.0), "bad": Proportional(k=1.0, axes=3)},
            line_reference(), progress=lambda name, done: seen.append(name),
        )  # fmt: skip
    assert seen == []


def test_nothing_to_compare():
    with pytest.raises(SimulationError, match="one controller or more"):
        cl.compare(velocity_stage(), [], line_reference())
