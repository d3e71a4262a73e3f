"""What varies: the same draws for all, within their bounds, and nothing out of bounds runs."""

import numpy as np
import pytest

from contourlab.errors import SimulationError
from contourlab.machines import Friction, RigidAxes
from contourlab.simulation import Listed, Normal, Uniform, Variation

from .loops import Proportional, velocity_stage

N = 4000


def lanes(changes, machine=None, controller=None, *, names=("machine", "law"), **more):
    machine = velocity_stage((0.01, 0.02)) if machine is None else machine
    loop = {
        "machine": machine, "controller": controller or Proportional(k=20.0), "disturbances": (),
    }  # fmt: skip
    every = more.pop("every", ((names[0],), (names[1],)))
    variation = Variation(changes=changes, **more)
    return variation.lanes(
        loop, machine=names[0], controller=names[1], machines=every[0], controllers=every[1], seed=5
    )


def test_uniform_draws():
    mass = lanes({"machine.mass": Uniform(relative=0.2)}, samples=N)["machine.mass"]
    assert mass.shape == (N, 2)
    share = mass / [0.01, 0.02]
    assert share.min() >= 0.8
    assert share.max() <= 1.2
    # mean and spread of 4000 draws: 5 standard errors
    np.testing.assert_allclose(share.mean(axis=0), 1.0, atol=5 * 0.2 / np.sqrt(3 * N))
    np.testing.assert_allclose(share.std(axis=0), 0.2 / np.sqrt(3), rtol=0.05)
    assert abs(np.corrcoef(share.T)[0, 1]) < 5 / np.sqrt(N)  # each axis its own
    absolute = lanes({"machine.mass": Uniform(absolute=1e-3)}, samples=N)["machine.mass"]
    assert np.abs(absolute - [0.01, 0.02]).max() <= 1e-3
    between = lanes({"machine.mass": Uniform(between=(0.5, 0.6))}, samples=N)["machine.mass"]
    assert between.min() >= 0.5
    assert between.max() <= 0.6
    assert between.shape == (N, 2)


def test_normal_draws():
    mass = lanes({"machine.mass": Normal(relative=0.05)}, samples=N)["machine.mass"]
    share = mass / [0.01, 0.02]
    np.testing.assert_allclose(share.mean(axis=0), 1.0, atol=5 * 0.05 / np.sqrt(N))
    np.testing.assert_allclose(share.std(axis=0), 0.05, rtol=0.06)
    spread = lanes({"controller.k": Normal(absolute=2.0)}, samples=N)["controller.k"]
    assert spread.shape == (N,)
    assert spread.std() == pytest.approx(2.0, rel=0.06)


def test_one_draw_for_all_axes():
    mass = lanes({"machine.mass": Uniform(relative=0.2, common=True)}, samples=9)["machine.mass"]
    share = mass / [0.01, 0.02]
    np.testing.assert_allclose(share[:, 0], share[:, 1])
    assert len(np.unique(share[:, 0])) == 9


def test_every_loop_meets_the_same_samples():
    first = {"machine.mass": Uniform(relative=0.2)}
    here = lanes(first, samples=20)["machine.mass"]
    there = lanes(first, controller=Proportional(k=90.0), samples=20)["machine.mass"]
    np.testing.assert_array_equal(here, there)
    heavier = lanes(first, machine=velocity_stage((0.1, 0.2)), samples=20)["machine.mass"]
    np.testing.assert_allclose(heavier, 10.0 * here)
    more = lanes({**first, "controller.k": Uniform(relative=0.1)}, samples=20)["machine.mass"]
    np.testing.assert_array_equal(more, here)
    other = lanes(first, samples=20, seed=1)["machine.mass"]
    assert not np.allclose(other, here)


def test_noise_differs_from_sample_to_sample_unless_listed():
    change = {"machine.mass": Uniform(relative=0.2)}
    np.testing.assert_array_equal(lanes(change, samples=4)["seed"], [5, 6, 7, 8])
    listed = lanes({"seed": Listed(values_of=[3, 3, 9])})
    np.testing.assert_array_equal(listed["seed"], [3, 3, 9])
    with pytest.raises(SimulationError, match="seeds must be whole numbers >= 0"):
        lanes({"seed": Listed(values_of=[1.5])})
    with pytest.raises(SimulationError, match="seeds can only be listed"):
        lanes({"seed": Uniform(relative=0.1)}, samples=3)


def test_listed_values_are_zipped_or_combined():
    changes = {
        "machine.mass": Listed(factors=[0.5, 1.0, 2.0]),
        "controller.k": Listed(values_of=[10.0, 20.0, 30.0]),
    }
    zipped = lanes(changes)
    np.testing.assert_allclose(zipped["machine.mass"], np.outer([0.5, 1, 2], [0.01, 0.02]))
    np.testing.assert_allclose(zipped["controller.k"], [10.0, 20.0, 30.0])
    grid = lanes(changes, grid=True)
    assert grid["seed"].shape == (9,)
    pairs = set(zip(grid["machine.mass"][:, 0] / 0.01, grid["controller.k"], strict=True))
    assert pairs == {(f, k) for f in (0.5, 1.0, 2.0) for k in (10.0, 20.0, 30.0)}


def test_names_limit_a_path():
    changes = {
        "controller.fast.k": Uniform(relative=0.1),
        "machine.mill.mass": Uniform(relative=0.5),
    }
    every = (("mill", "lathe"), ("fast", "slow"))
    both = lanes(changes, names=("mill", "fast"), every=every, samples=3)
    assert set(both) == {"seed", "controller.k", "machine.mass"}
    assert set(lanes(changes, names=("lathe", "slow"), every=every, samples=3)) == {"seed"}
    with pytest.raises(SimulationError, match=r"machine\.mass and machine\.mill\.mass name"):
        lanes(
            {"machine.mill.mass": Uniform(relative=0.1), "machine.mass": Uniform(relative=0.2)},
            names=("mill", "fast"), every=every, samples=3,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "more", "message"),
    [
        ({}, {"samples": 3}, "names nothing to vary"),
        ({"machine.mass": Uniform(relative=0.1)}, {}, "samples is missing"),
        ({"machine.mass": Uniform(relative=0.1)}, {"samples": 0}, "samples must be .* >= 1, got 0"),
        ({"machine.mass": Uniform(relative=0.1)}, {"samples": 3, "seed": -1}, "seed must be"),
        ({"machine.mass": Uniform(relative=0.1)}, {"grid": True}, "mass is drawn"),
        ({"machine.mass": Listed(factors=[1.0, 2.0])}, {"samples": 3}, "need one for each sample"),
        ({"mashine.mass": Uniform(relative=0.1)}, {"samples": 3}, "did you mean machine"),
        ({"machine": Uniform(relative=0.1)}, {"samples": 3}, "needs the name of a value"),
        ({"controller.kp": Uniform(relative=0.1)}, {"samples": 3}, r"\(controller law\): .*'kp'"),
        ({"machine.names": Uniform(relative=0.1)}, {"samples": 3}, "is not a number that can be"),
        ({"machine.mass": Normal(relative=0.9)}, {"samples": 50}, "normal distribution has no"),
        (
            {"machine.mass": Uniform(absolute=1.0)},
            {"samples": 9},
            r"\(machine machine\): mass must",
        ),
        ({"machine.gain": Listed(values_of=[[1, 2, 3]])}, {}, "lanes of shape"),
        ({"machine.command_limit": Uniform(relative=0.1)}, {"samples": 3}, "is not finite here"),
        ({"machine.resolution": Uniform(relative=0.1)}, {"samples": 3}, "is 0 here"),
        (
            {"machine.mass": Uniform(relative=0.1), "machine.dynamics.mass": Uniform(relative=0.2)},
            {"samples": 3},
            r"machine\.dynamics\.mass and machine\.mass name the same value",
        ),
        ({"machine.limits.velocity": Uniform(relative=0.1)}, {"samples": 3}, "limits cannot vary"),
        (
            {"disturbances.0.amplitude": Normal(absolute=2.0)},
            {"samples": 3},
            "there is no disturbance here$",
        ),
        (
            {"machine.mass": Listed(values_of=[[1.0, 2.0], [3.0, -4.0], [-5.0, 6.0]])},
            {},
            r"got -4 \(sample 1 of 0 to 2: machine\.mass = \[3, -4\]\)$",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_nonsense_is_refused(changes, more, message):
    with pytest.raises(SimulationError, match=message):
        lanes(changes, **more)


def test_a_change_is_one_thing():
    for wrong in (
        lambda: Uniform(), lambda: Uniform(relative=0.1, absolute=1.0), lambda: Normal(),
        lambda: Listed(), lambda: Listed(values_of=[1.0], factors=[1.0]),
    ):  # fmt: skip
        with pytest.raises(SimulationError, match="needs exactly one of"):
            wrong()
    for wrong in (
        lambda: Uniform(relative=0.0), lambda: Uniform(absolute=-1.0),
        lambda: Normal(relative=float("nan")), lambda: Normal(absolute=float("inf")),
    ):  # fmt: skip
        with pytest.raises(SimulationError, match="must be finite and > 0"):
            wrong()
    with pytest.raises(SimulationError, match="lower < upper"):
        Uniform(between=(2.0, 1.0))
    with pytest.raises(SimulationError, match="must not be empty"):
        Listed(values_of=[])
    for wrong in ([[1.0, 2.0], [1.0]], [[1.0, 2.0], 1.0], ["a"]):
        with pytest.raises(SimulationError, match="listed values must"):
            Listed(values_of=wrong)


def test_a_sample_out_of_bounds_by_several_values_names_those():
    machine = velocity_stage(dynamics=RigidAxes(
        mass=[0.01, 0.02], viscous=[1.0, 1.0], gain=[1.0, 1.0],
        friction=Friction(coulomb=[1.0, 1.0], breakaway=[2.0, 2.0]),
    ))  # fmt: skip
    changes = {
        "machine.mass": Uniform(relative=0.1),
        "machine.coulomb": Listed(values_of=[1.0, 1.0, 1.9]),
        "machine.breakaway": Listed(values_of=[2.0, 2.5, 1.5]),
    }
    with pytest.raises(SimulationError, match="sample 2 of 0 to 2: ") as caught:
        lanes(changes, machine=machine)
    assert "(sample 2 of 0 to 2: machine.coulomb = 1.9, machine.breakaway = 1.5)" in str(
        caught.value
    )
    assert "\n" not in str(caught.value)


def test_a_label_like_a_field_is_ambiguous():
    change = {"machine.dynamics.mass": Uniform(relative=0.1)}
    every = (("dynamics", "mill"), ("law",))
    for name in every[0]:
        with pytest.raises(SimulationError, match=r"labelled .* of every machine; rename"):
            lanes(change, names=(name, "law"), every=every, samples=3)
    named = {"machine.dynamics.dynamics.mass": Uniform(relative=0.1)}
    assert "machine.dynamics.mass" in lanes(
        named, names=("dynamics", "law"), every=every, samples=3
    )
