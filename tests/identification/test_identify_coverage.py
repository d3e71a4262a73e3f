"""Intervals of refined parameters hold the truth as often as they say, over many seeds."""

import numpy as np
import pytest

import contourlab as cl
from contourlab.identification import identify_machine
from contourlab.simulation import simulate_many

from .loops import TRUE, motions, recording, run
from .machines import log_of, varied_reference, with_sensor

NAMES = ("mass", "viscous", "coulomb_forward", "coulomb_backward")


def held(found, truth):
    """Whether each interval holds the truth, and the parameters' errors in half widths."""
    error = np.array(
        [
            [
                (axis[name].value - truth[name][k]) / (0.5 * (axis[name].high - axis[name].low))
                for name in truth
            ]
            for k, axis in enumerate(found.axes)
        ]
    )
    return np.abs(error) < 1.0


@pytest.mark.overnight
@pytest.mark.slow
def test_a_published_stage_over_many_seeds():
    """The XY stage of Meng, Lou and Zhou, counts of 1 µm and noise of half a count."""
    machine = with_sensor(cl.machines.published.meng_xy_stage(), 1e-6, 0.5e-6)
    law = cl.controllers.AxisPid.by_pole_placement(machine.nominal, bandwidth_hz=60.0)
    reference = varied_reference((0.012, 0.009), 1e-3, duration=4.0)
    runs = 48
    many = simulate_many(
        machine, law, reference, vary={"seed": np.arange(runs)}, record=("measured", "command"),
        metrics=("tracking_error_max",),
    )  # fmt: skip
    top = np.array((16.23, 17.58))
    truth = {
        "mass": 1.0 / top, "viscous": np.array((798.5, 862.75)) / top,
        "coulomb_forward": (0.12, 0.07), "coulomb_backward": (0.11, 0.06),
    }  # fmt: skip
    hits = []
    for lane in range(runs):
        log = log_of(
            many["measured"].values[lane], many["command"].values[lane], 1e-3, "voltage",
            np.asarray(reference.position),
        )  # fmt: skip
        hits.append(held(identify_machine(log, known={"delay": 0.0}), truth))
    share = np.mean(hits, axis=0)
    # 95 % of 48 has a standard deviation of 3.1 %
    assert share.min() > 0.83
    assert 0.91 < share.mean() < 0.99


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
