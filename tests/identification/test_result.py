"""What becomes of the result: model, bounds, plain numbers, the on-line estimate over time."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.controllers import FilteredLeastSquares, filtered_regressors
from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification import estimate_trend, identify

from .loops import TRUE, T, motions, of_velocity, recording, run

MOTION = motions(6.0)


@pytest.fixture(scope="module")
def record():
    measured, command = run(MOTION, force=1.0, seed=3)
    return recording(measured[0], command[0], MOTION[0])


@pytest.fixture(scope="module")
def found(record):
    return identify(record)


def test_the_model_is_in_effort(found):
    model = found.model(gain=(2.0, 4.0), command_limit=50.0)
    assert_allclose(model.mass, found.values[0] * [2.0, 4.0])
    assert_allclose(model.viscous, found.values[1] * [2.0, 4.0])
    assert_allclose(model.coulomb, found.values[2] * [2.0, 4.0])
    assert_allclose(model.command_limit, 50.0)
    assert model.command == "force"
    law = cl.controllers.AxisPid.by_pole_placement(found.model(), bandwidth_hz=20.0)
    assert law.n_axes == 2


def test_bounds_and_values_are_those_of_an_adaptive_law(found):
    lower, upper = found.bounds()
    assert np.all((lower < found.values) & (found.values < upper))
    assert_allclose(found["X"]["mass"].low, lower[0, 0])
    wide = found.bounds(margin=0.1)
    assert_allclose(lower - wide[0], 0.1 * np.abs(found.values))
    law = cl.controllers.DirectAdaptiveRobust.by_bandwidth(
        found.model(command_limit=300.0), (10.0, 10.0), parameter_lower=lower,
        parameter_upper=upper, initial_parameters=found.values,
    )  # fmt: skip
    assert_allclose(law.bounds()[0], lower)
    with pytest.raises(RecordingError, match="margin must be >= 0"):
        found.bounds(margin=-0.1)


def test_plain_numbers_are_json(found):
    plain = json.loads(json.dumps(found.to_dict()))
    assert [axis["axis"] for axis in plain["axes"]] == ["X", "Y"]
    mass = plain["axes"][0]["parameters"]["mass"]
    assert mass["unit"] == "kg"
    assert mass["low"] < mass["value"] < mass["high"]
    assert set(plain["axes"][0]["parameters"]) == {"mass", "viscous", "coulomb", "disturbance"}


def test_the_table_names_every_parameter(found):
    text = str(found)
    assert "95 % interval" in text
    assert text.count(" kg") == 2
    half = 0.5 * (found["X"]["mass"].high - found["X"]["mass"].low)
    assert f"X     mass         {found['X']['mass'].value:.3f} +- {half:.3f} kg" in text
    with pytest.raises(RecordingError, match=r"no axis 'Z'; Allowed: X, Y"):
        found["Z"]


def test_what_was_not_found_becomes_no_model():
    motion = of_velocity(np.stack([np.full(3000, 0.1), np.full(3000, 0.2)], axis=1))
    measured, command = run(motion)
    blind = identify(recording(measured[0], command[0], motion[0]))
    for use in (blind.model, blind.bounds):
        with pytest.raises(RecordingError, match=r"axis X: mass, viscous, coulomb.* not be found"):
            use()
    assert blind.to_dict()["axes"][0]["parameters"]["mass"]["value"] is None
    given = identify(
        recording(measured[0], command[0], motion[0]),
        known={"mass": TRUE[0], "viscous": TRUE[1], "disturbance": TRUE[3]},
    )
    assert_allclose(given.model().coulomb, TRUE[2], rtol=1e-2)
    assert "given" in str(given)


def test_the_trend_ends_at_least_squares_and_follows_a_change(record):
    law = FilteredLeastSquares(
        cutoff_hz=50.0, friction_shape="tanh", friction_velocity=1e-4, initial_covariance=(1.0,) * 4
    )
    measured, command = (np.asarray(record[name]) for name in ("measured", "command"))
    still = estimate_trend(measured, command, T, law, forgetting=0.0, n_times=50)
    free = np.full((4, 2), np.inf)
    y, u = filtered_regressors(law.bind(-free, free, T), measured, command)
    for axis in range(2):
        batch = np.linalg.lstsq(y[:, :, axis], u[:, axis])[0]
        # it starts from nothing with a weight of 1e-6 of the record's
        assert_allclose(still.estimate[-1, :, axis], batch, rtol=1e-3, atol=1e-4)
    assert still.estimate.shape == (50, 4, 2)
    assert still.time[-1] == pytest.approx(6.0)
    # after half the record everything takes twice the command: all parameters double
    half = len(command) // 2
    measured, command = (rows[0] for rows in run(MOTION, seed=4))
    changed = np.concatenate([command[:half], 2 * command[half:]])
    trend = estimate_trend(measured, changed, T, law, forgetting=3.0)
    before = trend.estimate[np.searchsorted(trend.time, 2.9)]
    # the past weighs e^-9 by the end
    assert_allclose(trend.estimate[-1, :3] / before[:3], 2.0, rtol=0.02)


def test_the_result_carries_its_trend(found):
    assert found.trend.time[0] == 0.0
    assert_allclose(found.trend.estimate[-1, :3], found.values[:3], rtol=0.1)
    assert found.trend.forgetting == pytest.approx(5.0 / (6001 * T))
    with pytest.raises(ConfigurationError, match="n_times must be a whole number >= 2"):
        estimate_trend(MOTION[0], MOTION[0], T, FilteredLeastSquares(), n_times=1)
