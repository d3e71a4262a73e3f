"""Many loops at once are the loops one by one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contourlab as cl
from contourlab.contours import Ellipse
from contourlab.errors import ConfigurationError, RecordingError, SimulationError
from contourlab.machines import Encoder
from contourlab.simulation.many import MANY_METRICS

from .loops import Proportional, line_reference, velocity_stage

REFERENCE = cl.feedrate.constant_rate(
    Ellipse(semi_axes=(0.03, 0.01)), rate=6.0, duration=0.5, sample_time=1e-3
)


def test_lanes_are_single_runs():
    gains, lags = np.array([20.0, 30.0, 60.0]), np.array([[0.01, 0.02], [0.01, 0.01], [0.02, 0.01]])
    batch = cl.simulate_many(
        velocity_stage(), Proportional(k=1.0), REFERENCE,
        vary={"controller.k": gains, "machine.dynamics.mass": lags}, record=("actual", "command"),
    )  # fmt: skip
    for lane, (k, tau) in enumerate(zip(gains, lags, strict=True)):
        single = cl.simulate(velocity_stage(tuple(tau)), Proportional(k=k), REFERENCE)
        for name in MANY_METRICS[:7]:
            assert_allclose(
                np.asarray(batch[name])[lane], single.metrics[name], rtol=1e-9, err_msg=name
            )
        assert_allclose(batch["actual"][lane], single["actual"], atol=1e-16)
        assert_allclose(batch["command"][lane], single["command"], atol=1e-13)


def test_short_paths_are_found():
    values = [0.01, 0.02]
    short, full = (
        cl.simulate_many(velocity_stage(), Proportional(k=30.0), REFERENCE, vary={path: values})
        for path in ("machine.mass", "machine.dynamics.mass")
    )
    assert_array_equal(short["contour_error_rms"], full["contour_error_rms"])
    assert short["contour_error_rms"][0] != short["contour_error_rms"][1]


def test_seeds_draw_noise():
    machine = velocity_stage(sensor=Encoder(noise=1e-6, velocity="ideal"))
    batch = cl.simulate_many(
        machine, Proportional(k=30.0), line_reference(n=50), vary={"seed": [1, 1, 2]},
        record=("measured",),
    )  # fmt: skip
    assert_array_equal(batch["measured"][0], batch["measured"][1])
    assert not np.allclose(batch["measured"][0], batch["measured"][2], atol=0)
    single = cl.simulate(machine, Proportional(k=30.0), line_reference(n=50), seed=2)
    assert_allclose(batch["measured"][2], single["measured"], atol=1e-18)


def test_a_diverged_lane_freezes_and_the_others_go_on():
    batch = cl.simulate_many(
        velocity_stage(), Proportional(k=30.0), line_reference(n=3000),
        vary={"controller.k": np.array([[30.0, 30.0], [30.0, 5000.0], [20.0, 20.0]])},
    )  # fmt: skip
    assert_array_equal(np.isnan(batch["contour_error_rms"]), [False, True, False])
    assert_array_equal(np.isnan(batch["diverged_at"]), [True, False, True])
    assert list(np.asarray(batch["diverged_axis"])) == ["", "Y", ""]
    alone = cl.simulate(
        velocity_stage(), Proportional(k=np.array([30.0, 5000.0])), line_reference(n=3000)
    )
    assert_allclose(batch["diverged_at"][1], alone.dataset.attrs["diverged_at"])


def test_only_what_is_asked_for():
    batch = cl.simulate_many(
        velocity_stage(), Proportional(k=30.0), line_reference(n=50), vary={"seed": [0, 1]},
        metrics=["tracking_error_max"],
    )  # fmt: skip
    assert "contour_error_rms" not in batch
    assert "tracking_error_max" in batch
    assert "time" not in batch.dims


@pytest.mark.parametrize(
    ("vary", "error", "message"),
    [
        ({}, SimulationError, "nothing to vary"),
        ({"controller.k": 3.0}, SimulationError, "needs one value per lane"),
        ({"controller.k": [1.0, 2.0], "seed": [1]}, SimulationError, "zipped"),
        ({"controller.kk": [1.0]}, ConfigurationError, "did you mean k"),
        ({"control.k": [1.0]}, SimulationError, "did you mean controller"),
        ({"controller.k": [1.0, np.nan]}, ConfigurationError, "k must be finite"),
        ({"machine.mass": [0.01, -0.01]}, ConfigurationError, "mass must be > 0"),
        ({"machine.mass": np.ones((2, 3))}, SimulationError, "lanes of shape"),
        ({"controller.preview": [1, 2]}, SimulationError, "not a number that can be varied"),
    ],
)
def test_mistakes_are_named(vary, error, message):
    with pytest.raises(error, match=message):
        cl.simulate_many(velocity_stage(), Proportional(k=30.0), line_reference(), vary=vary)


def test_unknown_metrics_and_signals_are_named():
    arguments = (velocity_stage(), Proportional(k=30.0), line_reference())
    with pytest.raises(RecordingError, match="did you mean contour_error_rms"):
        cl.simulate_many(*arguments, vary={"seed": [1]}, metrics=["contour_error_rm"])
    with pytest.raises(RecordingError, match="does not report a contour_error_estimate"):
        cl.simulate_many(*arguments, vary={"seed": [1]}, metrics=["estimate_error_rms"])
    with pytest.raises(RecordingError, match="did you mean actual"):
        cl.simulate_many(*arguments, vary={"seed": [1]}, record=("actul",))
