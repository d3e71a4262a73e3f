"""Many loops at once are the loops one by one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contourlab as cl
from contourlab.configuration import replace_at, resolve
from contourlab.contour_errors import OsculatingCircleEstimator
from contourlab.contours import Ellipse
from contourlab.controllers import Cascade, CrossCoupled
from contourlab.errors import ConfigurationError, RecordingError, SimulationError
from contourlab.machines import Drive, Encoder, RigidAxes
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


def test_two_names_of_one_number_are_refused():
    vary = {"machine.mass": [0.01, 0.02], "machine.dynamics.mass": [0.03, 0.04]}
    with pytest.raises(
        SimulationError, match=r"machine\.mass and machine\.dynamics\.mass are the same"
    ):
        cl.simulate_many(velocity_stage(), Proportional(k=30.0), REFERENCE, vary=vary)


def test_unknown_metrics_and_signals_are_named():
    arguments = (velocity_stage(), Proportional(k=30.0), line_reference())
    with pytest.raises(RecordingError, match="did you mean contour_error_rms"):
        cl.simulate_many(*arguments, vary={"seed": [1]}, metrics=["contour_error_rm"])
    with pytest.raises(RecordingError, match="does not report a contour_error_estimate"):
        cl.simulate_many(*arguments, vary={"seed": [1]}, metrics=["estimate_error_rms"])
    with pytest.raises(RecordingError, match="did you mean actual"):
        cl.simulate_many(*arguments, vary={"seed": [1]}, record=("actul",))


@pytest.mark.parametrize("path", ["mass", "gain", "command_limit", "resolution"])
def test_one_number_for_all_axes_varies_over_any_number_of_lanes(path):
    machine = velocity_stage(
        dynamics=RigidAxes(mass=0.01, viscous=1.0, gain=1.0),
        drive=Drive(command="velocity", command_limit=0.2),
        sensor=Encoder(resolution=1e-6, velocity="ideal"),
    )
    values = np.array([1.0, 1.5, 2.0]) * {"mass": 0.01, "gain": 1.0, "command_limit": 0.1}.get(
        path, 1e-6
    )
    law = Proportional(k=30.0)
    batch = cl.simulate_many(machine, law, REFERENCE, vary={f"machine.{path}": values})
    full = resolve(machine, path)
    for lane, value in enumerate(values):
        single = cl.simulate(replace_at(machine, full, value), law, REFERENCE)
        for name in ("contour_error_rms", "saturation_time", "command_max", "cycle_time"):
            assert_allclose(
                batch[name][lane], single.metrics[name], rtol=1e-9, atol=1e-15, err_msg=name
            )


def test_every_metric_of_a_saturating_law_that_estimates():
    machine = velocity_stage(
        (0.01, 0.02), drive=Drive(command="velocity", command_limit=[0.12, 0.12])
    )
    law = CrossCoupled(
        axis=Cascade(model=machine.nominal, position_gain=25.0),
        estimator=OsculatingCircleEstimator(), kp=20.0,
    )  # fmt: skip
    gains = np.array([10.0, 20.0, 30.0])
    batch = cl.simulate_many(machine, law, REFERENCE, vary={"controller.kp": gains})
    assert set(MANY_METRICS) <= set(batch)
    for lane, kp in enumerate(gains):
        single = cl.simulate(machine, cl.replace(law, kp=kp), REFERENCE)
        assert single.metrics["saturation_time"] > 0.0
        for name in MANY_METRICS:
            assert_allclose(
                batch[name][lane], single.metrics[name], rtol=1e-9, atol=1e-15, err_msg=name
            )


def test_a_law_that_arrives_early_ends_its_lane():
    law = Proportional(k=30.0, stop_at=100)
    batch = cl.simulate_many(velocity_stage(), law, REFERENCE, vary={"controller.k": [20.0, 30.0]})
    single = cl.simulate(velocity_stage(), law, REFERENCE)
    assert single.n_samples == 100
    for name in ("contour_error_rms", "tracking_error_rms", "command_rms", "cycle_time"):
        assert_allclose(batch[name][1], single.metrics[name], rtol=1e-9, err_msg=name)


def test_seeds_are_whole_numbers():
    with pytest.raises(SimulationError, match="seed needs one whole number per lane"):
        cl.simulate_many(
            velocity_stage(), Proportional(k=1.0), REFERENCE, vary={"seed": [1.5, 2.5]}
        )
