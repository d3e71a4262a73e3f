"""Presliding and arc tangent friction: conformance, closed forms, order of the rule; the gantry."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.errors import ConfigurationError
from contourlab.machines import ArctanFriction, Drive, Friction, Machine, PreslidingAxes, RigidAxes
from contourlab.machines.published import hu_gantry
from contourlab.testing.machines import check_machine


def axis(substeps=10, **changes):
    fields = {"mass": 0.5, "viscous": 1.0, "coulomb": 2.0, "presliding_distance": 1e-5}
    return Machine(
        names=("X",), dynamics=PreslidingAxes(**(fields | changes)), drive=Drive(command="force"),
        substeps=substeps,
    )  # fmt: skip


def test_it_conforms():
    dynamics = PreslidingAxes(
        mass=(0.5, 1.0), viscous=2.0, gain=1.5, coulomb=(2.0, 1.0), breakaway=(2.5, 1.5),
        stribeck_velocity=2e-2, presliding_distance=1e-4,
        cogging=(cl.machines.Cogging(amplitude=0.3, period=0.02),),
    )  # fmt: skip
    check_machine(
        Machine(
            names=("X", "Y"), dynamics=dynamics, drive=Drive(command="force", command_limit=9.0)
        )
    )


@jax.jit
def moved(plant, state, forces):
    def step(state, force):
        state = plant.advance(state, force, jnp.zeros(1))
        return state, (state.axes.position, state.axes.velocity, state.axes.bend)

    return jax.lax.scan(step, state, forces)[1]


def test_the_bend_is_that_of_the_displacement():
    """z = 1 - exp(-x / x_0) one way; turned round, from there back: whatever the velocity."""
    plant = axis().bind(1e-4)
    forces = np.concatenate([np.full((400, 1), 3.0), np.full((400, 1), -3.0)])
    q, v, z = map(np.asarray, moved(plant, plant.init(jnp.zeros(1)), forces))
    turn = int(np.argmax(v < 0.0))
    assert_allclose(z[:turn], 1.0 - np.exp(-q[:turn] / 1e-5), atol=1e-9)
    back = q[turn:] - q[turn - 1]
    # the turn itself lies within a sample
    assert_allclose(z[turn:], -1.0 + 2.0 * np.exp(back / 1e-5), atol=5e-3)


def test_at_speed_it_is_coulomb_friction():
    plant = axis().bind(1e-4)
    _, v, z = map(np.asarray, moved(plant, plant.init(jnp.zeros(1)), np.full((40000, 1), 3.0)))
    assert_allclose(z[-1], 1.0)
    assert_allclose(v[-1], 3.0 - 2.0, rtol=1e-3)  # (u - F_c) / B


def test_below_breakaway_it_holds():
    """Pushed slowly to half of it, the axis stands where the spring does, and does not creep."""
    plant = axis(viscous=40.0).bind(1e-4)
    forces = np.minimum(np.arange(40000) / 20000.0, 1.0)[:, None]
    q, _, _ = map(np.asarray, moved(plant, plant.init(jnp.zeros(1)), forces))
    assert_allclose(q[-1], 1e-5 * np.log(2.0), rtol=1e-2)  # z = 1/2, and a little swing
    assert np.ptp(q[-5000:]) < 1e-10


def test_the_rule_is_of_second_order():
    forces = 3.0 * np.sin(np.arange(200) * 0.2)[:, None]

    def end(substeps):
        plant = axis(substeps, breakaway=3.0, presliding_distance=1e-4).bind(2e-4)
        return np.asarray(moved(plant, plant.init(jnp.zeros(1)), forces)[0])

    exact = end(1280)
    errors = [np.abs(end(k) - exact).max() for k in (10, 20, 40)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    # the exponential has a kink where the axis turns, within one substep
    assert np.all(slopes > 1.6)


def test_breakaway_is_not_below_coulomb():
    with pytest.raises(ConfigurationError, match="breakaway must be >= coulomb"):
        PreslidingAxes(mass=1.0, coulomb=2.0, breakaway=1.0, presliding_distance=1e-5)
    with pytest.raises(ConfigurationError, match="presliding_distance must be > 0"):
        PreslidingAxes(mass=1.0, coulomb=2.0, presliding_distance=0.0)


def test_arctan_friction_is_its_formula():
    fields = {"coulomb": 2.0, "coulomb_backward": 1.5, "breakaway": 2.5,
              "stribeck_velocity": 1e-2, "smoothing_velocity": 1e-4}  # fmt: skip
    bound = ArctanFriction(**fields).bind(np.array([0.5]))
    v = np.array([-0.3, -1e-3, -1e-5, 0.0, 1e-5, 2e-3, 0.1])
    found = np.array([bound.deceleration(jnp.array([x]))[0] for x in v])
    level = np.where(v >= 0, 2.0, 1.5)
    level = level + (2.5 - level) * np.exp(-((v / 1e-2) ** 2))
    assert_allclose(found, level * 2 / np.pi * np.arctan(v / 1e-4) / 0.5, rtol=1e-12)
    scaled = ArctanFriction(**fields).scaled(2.0)
    assert isinstance(scaled, ArctanFriction)
    assert_allclose(scaled.coulomb, 4.0)


def test_the_gantry_is_that_of_the_paper():
    plain = hu_gantry()
    assert_allclose(plain.sensor.resolution, 0.5e-6)
    nominal = hu_gantry(payload=True, cogging=True, presliding=True).nominal
    assert_allclose(nominal.mass, [0.12, 0.55])  # laws are not told of the payload
    loaded = hu_gantry(payload=True)
    assert_allclose(loaded.dynamics.mass, [0.19, 0.62])
    assert isinstance(plain.dynamics, RigidAxes)
    full = hu_gantry(cogging=True, presliding=True, computing_delay=2e-4)
    assert isinstance(full.dynamics, PreslidingAxes)
    for word in ("presliding", "cogging", "delay"):
        assert not any(word in line for line in plain.assumed)
    said = " ".join(full.assumed)
    for word in ("slides", "cogging", "computing delay", "no prediction"):
        assert word in said
    check_machine(full, sample_time=2e-4)


def test_a_friction_that_a_file_cannot_hold_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="ArctanFriction cannot be written"):
        cl.scenarios.write_machine_file(hu_gantry(), tmp_path / "machine.toml")
    dynamics = RigidAxes(mass=1.0, friction=Friction(coulomb=1.0))
    machine = dataclasses.replace(hu_gantry(), dynamics=dynamics)
    cl.scenarios.write_machine_file(machine, tmp_path / "machine.toml")
