"""Changes are found, and no more false ones than was asked for."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError, RecordingError
from contourlab.identification import Parameter, identify_machine, track_health
from contourlab.identification.false_alarms import LEAST_RATE, statistics, thresholds

from .loops import MASS, TRUE, motions, recording, run


def series(n, degrees, seed, n_times=20):
    """Estimates without a change, with standard deviations that are themselves estimates."""
    random = np.random.default_rng(seed)
    values = random.standard_normal((n, 4, n_times))
    spread = np.sqrt(random.chisquare(degrees, values.shape) / degrees)
    return values, spread


@pytest.mark.parametrize(("degrees", "n_times"), [(4, 20), (12, 20), (12, 4)])
def test_the_false_alarm_rate_is_the_one_asked_for(degrees, n_times):
    there = np.ones((4, n_times), bool)
    limits = thresholds(there, np.full(there.shape, degrees), 3, rate=0.1, draws=4000, seed=1)
    t, sums, _, _ = statistics(*series(4000, degrees, seed=2, n_times=n_times), 3)
    alarms = (np.abs(np.nan_to_num(t)) > limits.jump) | (np.nan_to_num(sums) > limits.drift)
    rate = alarms.any(axis=(1, 2)).mean()
    # 4000 draws leave 0.005 twice, three of which are allowed
    assert 0.08 < rate < 0.12


def test_a_jump_is_seen_at_once_and_a_drift_in_time():
    there = np.ones((1, 20), bool)
    limits = thresholds(there, np.full(there.shape, 12.0), 3, rate=0.01, seed=1)
    values, spread = np.zeros((1, 20)), np.ones((1, 20))
    values[0, 10:] = 2.0 * limits.jump
    t, sums, mean, deviation = statistics(values, spread, 3)
    assert np.flatnonzero(np.abs(np.nan_to_num(t[0])) > limits.jump)[0] == 10
    assert_allclose(mean, 0.0)
    assert_allclose(deviation, 1 / np.sqrt(3.0))
    values = np.linspace(0.0, 6.0, 20)[None]
    t, sums, *_ = statistics(values, spread, 3)
    seen = np.flatnonzero(np.nan_to_num(sums[0]) > limits.drift)
    jump = np.flatnonzero(np.abs(np.nan_to_num(t[0])) > limits.jump)
    assert len(seen)
    assert not len(jump) or seen[0] < jump[0]


def test_a_rate_that_cannot_be_held_is_refused():
    there, degrees = np.ones((1, 4), bool), np.full((1, 4), 6.0)
    with pytest.raises(ConfigurationError, match=r"rate must be >= 0.0005.* got 0.0001"):
        thresholds(there, degrees, 3, rate=1e-4)
    rare = thresholds(there, degrees, 3, rate=LEAST_RATE)
    assert rare.jump > thresholds(there, degrees, 3, rate=0.01).jump


def test_an_estimate_that_is_not_there_is_no_change():
    values, spread = np.zeros((1, 8)), np.ones((1, 8))
    values[0, 4:6] = np.nan
    t, sums, _, _ = statistics(values, spread, 2)
    assert np.isnan(t[0, :2]).all()
    assert np.isnan(t[0, 4:6]).all()
    assert np.isfinite(t[0, 6:]).all()
    assert sums[0, -1] == 0.0


FILTERED = {"known": {"delay": 0.0}, "simulate": False}
"""Least squares alone: what is looked at here is not how a record is identified."""


@pytest.fixture(scope="module")
def worn():
    """Five records of 3 s; in the last the first axis carries more."""
    records = []
    for k in range(5):
        motion = motions(3.0)
        heavier = 1.05 if k == 4 else 1.0
        measured, command = run(motion, noise=1e-6, force=1.0, time=1e-4, seed=40 + k)
        # commands of a heavier machine: the same motion asks for more
        position, _, acceleration = motion
        command[0][:, 0] += (heavier - 1.0) * MASS[0] * acceleration[:, 0]
        records.append(recording(measured[0], command[0], position))
    return records


def test_a_load_taken_on_is_found(worn):
    health = track_health(worn, options=FILTERED)
    found = {(c.axis, c.parameter): c for c in health.changes}
    assert ("X", "mass") in found
    assert all(axis == "X" for axis, _ in found)
    change = found["X", "mass"]
    assert change.label == "record 5"
    assert change.kind == "jump"
    assert_allclose(change.share, 0.05, rtol=0.2)
    assert "axis X: mass changed from" in str(health)
    plain = health.to_dict()
    assert len(plain["series"][0]["value"]) == 5
    assert plain["changes"][0]["record"] == "record 5"


def test_one_long_record_is_cut_into_windows():
    motion = motions(12.0)
    measured, command = run(motion, noise=1e-6, seed=3)
    long = recording(measured[0], command[0], motion[0])
    health = track_health(long, window=3.0, n_baseline=2, options=FILTERED)
    assert len(health.labels) == 4
    assert health.changes == ()
    mass = next(s for s in health.series if (s.axis, s.parameter) == ("Y", "mass"))
    assert_allclose(mass.value, TRUE[0, 1], rtol=1e-3)
    assert "no change in 4 records" in str(health)


def test_two_records_are_before_and_after(worn):
    health = track_health([worn[0], worn[4]], labels=("before", "after"), options=FILTERED)
    assert health.n_baseline == 1
    assert {(c.axis, c.parameter, c.label) for c in health.changes} == {("X", "mass", "after")}


def test_records_that_cannot_be_compared_are_refused(worn):
    volts = recording(*(np.asarray(worn[0][n]) for n in ("measured", "command", "reference")),
                      kind="voltage")  # fmt: skip
    with pytest.raises(RecordingError, match="record 2 has a command of voltage"):
        track_health([worn[0], volts], options=FILTERED)
    positions = recording(*(np.asarray(worn[0][n]) for n in ("measured", "reference", "reference")),
                          kind="position")  # fmt: skip
    for records, what in (
        ([worn[0], positions], "record 2 has a command of position, the records before of force"),
        ([positions, worn[0]], "record 2 has a command of force, the records before of position"),
    ):
        with pytest.raises(RecordingError, match=what):
            track_health(records, options=FILTERED)
    with pytest.raises(ConfigurationError, match="logs of positions have no option 'simulate'"):
        track_health([positions, positions], options=FILTERED)


def test_a_delay_that_one_record_does_not_tell_is_no_change(worn, monkeypatch):
    """Taken for 0 s there, it is mistaken for less viscous friction."""
    found = identify_machine(worn[0], simulate=False)
    delay = Parameter(value=1e-3, low=0.9e-3, high=1.1e-3, unit="s")
    told = replace(
        found, axes=tuple(replace(a, parameters={**a.parameters, "delay": delay})
                          for a in found.axes),
    )  # fmt: skip
    answers = iter((told, found))
    monkeypatch.setattr(
        "contourlab.identification.health.identify_machine", lambda _: next(answers)
    )
    health = track_health(worn[:2])
    for one in health.series:
        both = one.parameter.startswith("coulomb")
        assert list(one.excited) == [True, both], one.parameter
    assert any("viscous is not compared: other records show a delay" in n for n in health.notes)
    assert any("not compared" in note for note in health.to_dict()["notes"])


def test_options_that_make_no_sense_are_refused(worn):
    for options in ({"n_baseline": 0}, {"rate": 1.0}, {"rate": 4e-4}, {"least_change": -1.0},
                    {"window": 1.0}, {"n_baseline": 5}, {"labels": ["one"]}):  # fmt: skip
        with pytest.raises(ConfigurationError):
            track_health(worn, **options)
    still = recording(np.zeros((4001, 2)), np.zeros((4001, 2)), np.zeros((4001, 2)))
    with pytest.raises(RecordingError, match="nothing was found in any record"):
        track_health([still] * 4)
