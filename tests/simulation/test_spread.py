"""The spread of a comparison: its samples are single runs, its figures are their quantiles."""

import numpy as np
import pytest
import xarray as xr

import contourlab as cl
from contourlab.configuration import replace_at
from contourlab.errors import RecordingError, SimulationError
from contourlab.machines import Encoder
from contourlab.simulation import Listed, Spread, Uniform, Variation, spread

from .loops import Proportional, line_reference, velocity_stage

LAWS = {"slow": Proportional(k=20.0), "fast": Proportional(k=60.0)}
CHANGES = {"machine.mass": Uniform(relative=0.3)}


def test_each_sample_is_a_run_of_its_own():
    machine = velocity_stage((0.01, 0.02), sensor=Encoder(noise=1e-6, velocity="ideal"))
    variation = Variation(changes=CHANGES, samples=3)
    result = cl.compare(machine, LAWS, line_reference(), vary=variation, seed=4)
    assert set(result.spread) == set(LAWS)
    for name, law in LAWS.items():
        held = result.spread[name]
        assert held.n_samples == 3
        for k in range(3):
            masses = np.asarray(held.sample(k)["machine.mass"])
            alone = cl.simulate(
                replace_at(machine, "dynamics.mass", masses), law, line_reference(), seed=4 + k
            )
            for metric in ("contour_error_rms", "contour_error_max", "tracking_error_rms"):
                # the same computation in a batch: to rounding
                np.testing.assert_allclose(
                    held.values(metric)[k], alone.metrics[metric], rtol=1e-6, err_msg=metric
                )
    slow, fast = (result.spread[name].sample(1) for name in LAWS)
    assert slow == fast
    # the run as it stands is made as without variation
    plain = cl.compare(machine, LAWS, line_reference(), seed=4)
    for name in LAWS:
        assert dict(plain.recordings[name].metrics) == dict(result.recordings[name].metrics)
    assert plain.spread == {}


def made(values, **more):
    values = np.asarray(values, float)
    lost = np.where(np.isnan(values), 0.5, np.nan)
    data = {"contour_error_rms": ("lane", values), "diverged_at": ("lane", lost), **more}
    return Spread(xr.Dataset(data), ("machine.mass",) if "machine.mass" in more else ())


def test_statistics_are_numpys_where_nothing_diverged():
    values = np.random.default_rng(1).lognormal(size=73)
    found = made(values).statistic("contour_error_rms")
    wanted = np.quantile(values, [0.05, 0.5, 0.95])
    np.testing.assert_allclose([found.low, found.median, found.high], wanted, rtol=1e-12)
    assert found.worst == values.max()
    assert found.worst_sample == int(np.argmax(values))


def test_a_diverged_sample_is_infinitely_bad():
    few = made([*np.arange(1.0, 100.0), np.nan])
    found = few.statistic("contour_error_rms")
    assert few.n_diverged == 1
    assert found.high == pytest.approx(95.05)  # of 100 in order, the last of them infinite
    assert found.worst == np.inf
    assert found.worst_sample == 99
    many = made([1.0, 2.0, np.nan, np.nan]).statistic("contour_error_rms")
    assert many.median == np.inf
    assert many.low == pytest.approx(1.15)
    assert made([np.nan, np.nan]).statistic("contour_error_rms").low == np.inf


def test_metrics_per_axis_and_unknown_ones():
    held = made([1.0, 2.0], command_max=(("lane", "axis"), np.array([[1.0, 5.0], [3.0, 4.0]])))
    x, y = held.statistic("command_max")
    assert (x.worst, x.worst_sample, y.worst, y.worst_sample) == (3.0, 1, 5.0, 0)
    with pytest.raises(RecordingError, match="did you mean contour_error_rms"):
        held.statistic("contour_error_rm")
    with pytest.raises(RecordingError, match="sample must be within 0 to 1"):
        held.sample(2)


def test_a_path_that_one_controller_lacks_is_named_before_anything_runs():
    class Other(Proportional):
        """A law without that gain."""

    ran = []
    laws = {**LAWS, "other": Proportional(k=10.0)}
    with pytest.raises(SimulationError, match=r"controller\.kd \(controller slow\): .*'kd'"):
        cl.compare(
            velocity_stage(), laws, line_reference(), progress=lambda *a: ran.append(a),
            vary={"controller.kd": [1.0, 2.0]},
        )  # fmt: skip
    with pytest.raises(SimulationError, match=r"must be > 0"):
        cl.compare(
            velocity_stage(), laws, line_reference(), progress=lambda *a: ran.append(a),
            vary={"machine.mass": [0.01, -0.01]},
        )  # fmt: skip
    assert ran == []
    only = cl.compare(
        velocity_stage(), laws, line_reference(), vary={"controller.fast.k": [30.0, 60.0, 90.0]}
    )
    rms = only.spread["fast"].values("tracking_error_rms")
    assert rms[0] > rms[1] > rms[2]
    assert np.ptp(only.spread["slow"].values("tracking_error_rms")) == 0.0
    assert only.spread["slow"].sample(0) == {}


def test_many_samples_run_batch_after_batch(monkeypatch):
    values = np.linspace(0.005, 0.02, 7)
    one = cl.compare(velocity_stage(), LAWS, line_reference(), vary={"machine.mass": values})
    monkeypatch.setattr(spread, "LANES", 3)
    told = []
    more = cl.compare(
        velocity_stage(), LAWS, line_reference(), vary={"machine.mass": values},
        progress=lambda name, done: told.append((name, done)),
    )  # fmt: skip
    for name in LAWS:
        for metric in one.spread[name].metrics:
            # across batch shapes to rounding
            np.testing.assert_allclose(
                more.spread[name].values(metric), one.spread[name].values(metric), rtol=1e-9
            )
        done = [d for who, d in told if who == f"{name}, 7 samples"]
        assert done == sorted(done)
        assert done[-1] == 1.0
        assert done[0] < 0.5


def test_samples_that_diverge_are_counted():
    result = cl.compare(
        velocity_stage(), {"law": Proportional(k=30.0)}, line_reference(n=3000),
        vary=Variation(changes={"controller.k": Listed(values_of=[30.0, 5000.0, 40.0])}),
    )  # fmt: skip
    held = result.spread["law"]
    assert held.n_diverged == 1
    worst = held.statistic("contour_error_rms")
    assert worst.worst == np.inf
    assert held.sample(worst.worst_sample) == {"controller.k": 5000.0}
