"""The interval holds the truth as often as it says, in loops with noisy, counting encoders."""

import numpy as np
import pytest

from contourlab.identification import identify

from .loops import TRUE, motions, recording, run

N_RUNS = 120
MOTION = motions()


def intervals(noise, force, time, seed, n_runs=N_RUNS, **options):
    """Values and ends of the intervals of many runs, shape (n_runs, 4, 2) each."""
    measured, command = run(MOTION, n_runs=n_runs, noise=noise, force=force, time=time, seed=seed)
    found = [
        identify(recording(q, u, MOTION[0]), **options)
        for q, u in zip(measured, command, strict=True)
    ]
    return tuple(
        np.array(
            [[[getattr(p, end) for p in a.parameters.values()] for a in f.axes] for f in found]
        ).swapaxes(1, 2)
        for end in ("value", "low", "high")
    )


@pytest.mark.parametrize(
    ("noise", "force", "time"),
    [(1e-6, 0.0, 1.0), (0.0, 0.0, 1.0), (1e-6, 3.0, 1e-4), (0.0, 2.0, 0.03)],
    ids=["noise and counts", "counts alone", "white force", "coloured force"],
)
def test_the_interval_holds_the_truth_in_95_of_100_runs(noise, force, time):
    """An encoder alone, of whose noise next to nothing is left at the motion's frequency; a white
    force; and one that is correlated over 30 ms, six times what the filter is."""
    values, low, high = intervals(noise, force, time, seed=11)
    held = (low < TRUE) & (high > TRUE)
    # 95 % of 120 has a standard deviation of 2.0 %; the eight parameters are not independent
    assert held.mean(axis=0).min() > (0.875 if noise or force else 0.85)
    assert 0.92 < held.mean() < 0.98
    # unbiased: the mean of 120 is within four of its standard deviations; but rounding alone is
    # not independent of the motion, which leaves half a standard deviation of a single run
    scatter = values.std(axis=0)
    share = 4.0 / np.sqrt(N_RUNS) if noise or force else 0.7
    assert np.all(np.abs(values.mean(axis=0) - TRUE) < share * scatter)
    # and no wider than Student's t with 12 degrees makes it: 2.2; rounding scatters a little less
    half = 0.5 * (high - low).mean(axis=0)
    assert np.all((half > 1.7 * scatter) & (half < (2.8 if noise or force else 3.2) * scatter))


def test_a_delayed_instrument_does_without_the_reference():
    values, low, high = intervals(1e-6, 1.0, 1e-4, seed=5, instrument="delayed")
    held = (low < TRUE) & (high > TRUE)
    assert held.mean(axis=0).min() > 0.875
    assert np.all(np.abs(values.mean(axis=0) - TRUE) < 4.0 * values.std(axis=0) / np.sqrt(N_RUNS))


def test_plain_least_squares_do_not_hold_the_mass():
    values, low, high = intervals(1e-6, 0.0, 1.0, seed=11, n_runs=20, instrument="none")
    held = (low < TRUE) & (high > TRUE)
    assert not held[:, 0].any()
    assert np.all(values[:, 0].mean(axis=0) < TRUE[0])


def test_a_higher_confidence_is_a_wider_interval_of_the_same_value():
    measured, command = run(MOTION, force=1.0, seed=2)
    record = recording(measured[0], command[0], MOTION[0])
    some, more = identify(record, confidence=0.8)["X"], identify(record, confidence=0.99)["X"]
    assert some["mass"].value == more["mass"].value
    assert more["mass"].low < some["mass"].low < some["mass"].high < more["mass"].high
