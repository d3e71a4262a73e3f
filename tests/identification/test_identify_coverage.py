"""Intervals of refined parameters hold the truth as often as they say, over many seeds."""

import numpy as np
import pytest

import contourlab as cl
from contourlab.identification import identify_machine
from contourlab.simulation import simulate_many

from .loops import TRUE, motions, recording, run
from .machines import log_of
from .published import CASES


def held(found, truth):
    """Whether each interval holds the truth, NaN where there is none: shape (n_axes, n_names)."""
    return np.array(
        [
            [
                axis[name].low < row[k] < axis[name].high if axis[name].identified else np.nan
                for name, row in truth.items()
            ]
            for k, axis in enumerate(found.axes)
        ]
    )


def over_many_seeds(name: str, runs: int, first: int) -> np.ndarray:
    """What ``held`` says of a published machine, shape (runs, n_axes, n_names)."""
    case = CASES[name]()
    reference = case.reference()
    many = simulate_many(
        case.machine, case.law(), reference, vary={"seed": first + np.arange(runs)},
        record=("measured", "command"), metrics=("tracking_error_max",),
    )  # fmt: skip
    rows = (many[name].values for name in ("measured", "command"))
    logs = [
        log_of(q, u, case.sample_time, case.machine.drive.command, np.asarray(reference.position))
        for q, u in zip(*rows, strict=True)
    ]
    return np.array([held(identify_machine(log, **case.options), case.truth()) for log in logs])


def test_every_published_machine_is_looked_at():
    """``el_khalick_feed_drive`` with its third axis."""
    assert set(CASES) == set(cl.machines.published.__all__)


@pytest.mark.overnight
@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_intervals_of_a_published_machine_hold_the_truth(name):
    """Two to five seconds of encoder noise; parameters of one log are not independent, logs are."""
    runs = 60
    hits = over_many_seeds(name, runs, first=1000)
    assert np.isfinite(hits[:, :, :2]).all()  # mass and viscous friction, in every log
    hits = hits[:, np.isfinite(hits).any(axis=0)]  # some motions do not tell the delay
    shares = np.nanmean(hits, axis=1)
    deviation = shares.std() / np.sqrt(runs)
    assert shares.mean() > 0.95 - 3.0 * deviation
    assert shares.mean() < 0.99
    # 95 % of 60 has a standard deviation of 2.8 %; the least of up to 24 parameters
    assert np.nanmin(np.nanmean(hits, axis=0)) > 0.95 - 4.0 * 0.028


@pytest.mark.overnight
@pytest.mark.slow
@pytest.mark.parametrize(("noise", "force"), [(1e-6, 0.0), (1e-6, 2.0)])
def test_another_loop_over_many_seeds(noise, force):
    """NumPy's own loop with sticking friction; noise, counts and a coloured force of 30 ms."""
    position, *_ = motion = motions()
    measured, command = run(motion, n_runs=40, noise=noise, force=force, time=0.03, seed=21)
    truth = {
        "mass": TRUE[0], "viscous": TRUE[1], "coulomb_forward": TRUE[2] - TRUE[3],
        "coulomb_backward": TRUE[2] + TRUE[3],
    }  # fmt: skip
    hits = [
        held(identify_machine(recording(q, u, position), known={"delay": 0.0}), truth)
        for q, u in zip(measured, command, strict=True)
    ]
    share = np.mean(hits, axis=0)
    assert share.min() > 0.8
    assert 0.90 < share.mean() < 0.99
