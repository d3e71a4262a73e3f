"""The public conformance check on every example, and each of its parts seen to fail."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError
from contourlab.machines import (
    BoundMachine,
    Drive,
    Encoder,
    GeometricErrors,
    Machine,
    NominalModel,
    PositionError,
    RigidAxes,
    Squareness,
    StateSpaceAxes,
    TransferFunctionAxes,
    ball_screw_stage,
    encoder,
    iron_core_stage,
    linear_motor_stage,
    machining_centre,
    published,
)
from contourlab.machines.base import IdentityTool
from contourlab.machines.rigid import BoundRigidAxes, RigidState
from contourlab.testing.machines import check_machine


def servo():
    return Machine(
        names=("X",),
        dynamics=TransferFunctionAxes(numerators=((1.0,),), denominators=((0.01, 1.0),)),
        drive=Drive(command="position"),
        sensor=Encoder(resolution=1e-6, noise=1e-6),
        travel=(0.0, 1.0),
        nominal_model=NominalModel(
            mass=np.ones(1), viscous=np.ones(1), coulomb=np.zeros(1), gain=np.ones(1),
            command_limit=np.ones(1), command="position",
        ),
    )  # fmt: skip


def identified():
    """Two axes with cross-talk, discrete, that give velocities; scales and errors besides."""
    return Machine(
        names=("X", "Y"),
        dynamics=StateSpaceAxes(
            state_matrix=((0.9, 0.01), (0.02, 0.85)), input_matrix=((0.1, 0.0), (0.0, 0.15)),
            output_matrix=((1.0, 0.0), (0.03, 1.0)), sample_time=1e-3, output="velocity",
        ),
        drive=Drive(command="velocity", command_limit=0.5),
        sensor=Encoder(resolution=1e-6),
        errors=GeometricErrors(
            scale=PositionError(scale=1e-5, amplitude=1e-7, period=2e-5),
            squareness=(Squareness(axes=("X", "Y"), angle=5e-5),),
        ),
        travel=((0.0, 0.3), (-0.1, 0.2)),
    )  # fmt: skip


MACHINES = {
    "linear motor": linear_motor_stage,
    "linear motor, late": lambda: linear_motor_stage(computing_delay=0.4e-3),
    "ball screw, late": lambda: ball_screw_stage(computing_delay=1.3e-3),
    "position servo": servo,
    "meng": published.meng_xy_stage,
    "meng, simulated": published.meng_simulated_axes,
    "el khalick": published.el_khalick_feed_drive,
    "iron core": iron_core_stage,
    "machining centre, late": lambda: machining_centre(computing_delay=0.4e-3),
    "identified": identified,
}


SLOW = {
    # two masses, rigid axes and a delay are in others too
    "machining centre, late": [pytest.mark.slow, pytest.mark.overnight],
    "linear motor, late": [pytest.mark.slow, pytest.mark.overnight],
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=SLOW.get(name, ())) for name in MACHINES]
)
def test_examples_conform(name):
    check_machine(MACHINES[name]())


def simple():
    """A machine of a type of its own: what is exchanged in it is not found compiled, nor kept."""
    own = type("OwnTool", (IdentityTool,), {})
    return Machine(
        names=("X", "Y"), dynamics=RigidAxes(mass=1.0, viscous=2.0), tool=own(),
        drive=Drive(command="force", command_limit=5.0), sensor=Encoder(resolution=1e-6),
    )  # fmt: skip


def drifts(self, state, commands, disturbance):
    return RigidState(state.position + 1e-9, state.velocity)


def forgets(self, state, commands, disturbance):
    return RigidState(state.position.astype(jnp.float32), state.velocity)


class Rounds:
    """Remembers what it did before, and answers otherwise the second time."""

    count = 0

    def __call__(self, axes, state, commands, disturbance):
        Rounds.count += 1
        return RigidState(state.position + 1e-3 * Rounds.count, state.velocity)


def test_the_check_sees_drift(monkeypatch):
    monkeypatch.setattr(BoundRigidAxes, "advance", drifts)
    with pytest.raises(AssertionError, match="drift"):
        check_machine(simple())


def test_the_check_sees_a_changed_shape(monkeypatch):
    monkeypatch.setattr(BoundRigidAxes, "advance", forgets)
    with pytest.raises(AssertionError, match=r"state.* became"):
        check_machine(simple())


def test_the_check_sees_hidden_state(monkeypatch):
    rounds = Rounds()
    monkeypatch.setattr(BoundRigidAxes, "advance", lambda *a: rounds(*a))
    with pytest.raises(AssertionError, match="two answers"):
        check_machine(simple())


def test_the_check_sees_a_drive_that_does_not_clip(monkeypatch):
    monkeypatch.setattr(BoundMachine, "_clip", lambda self, command: command)
    with pytest.raises(AssertionError, match="beyond the limit"):
        check_machine(simple())


def test_the_check_sees_a_rounding_that_cuts_the_gradient(monkeypatch):
    monkeypatch.setattr(encoder, "straight_through_round", jnp.round)
    with pytest.raises(AssertionError, match="gradient"):
        check_machine(simple())


def test_the_check_sees_positions_off_the_grid(monkeypatch):
    monkeypatch.setattr(encoder, "straight_through_round", lambda x: x)
    with pytest.raises(AssertionError, match="grid"):
        check_machine(simple())


def test_the_check_sees_a_delay_that_is_ignored(monkeypatch):
    monkeypatch.setattr(Drive, "split", lambda self, sample_time: (0, (1.0,)))
    with pytest.raises(AssertionError, match="delay"):
        check_machine(simple())


def test_the_check_sees_noise_that_stands_still(monkeypatch):
    from contourlab.machines import bound_machine as machine

    monkeypatch.setattr(machine, "_next", lambda words: (words, jax.random.key(0)))
    with pytest.raises(AssertionError, match="noise"):
        check_machine(simple())


def test_published_numbers_are_those_of_the_paper():
    nominal = published.meng_xy_stage().nominal
    assert_allclose(nominal.gain / nominal.mass, (16.23, 17.58), rtol=1e-15)
    assert_allclose(nominal.viscous / nominal.mass, (798.5, 862.75), rtol=1e-15)
    assert_allclose(nominal.coulomb, (0.115, 0.065))  # mean of 0.12, 0.11 and of 0.07, 0.06
    assert nominal.command == "voltage"
    assert np.all(np.asarray(nominal.command_limit) == 10.0)
    told = published.meng_simulated_axes(viscous_z=185.0).nominal
    assert_allclose(told.viscous, (205.0, 230.0, 185.0))


def test_ball_screw_stage_has_up_to_three_axes():
    assert ball_screw_stage(n_axes=2).names == ("X", "Y")
    with pytest.raises(ConfigurationError, match="n_axes must be 1, 2 or 3, got 4"):
        ball_screw_stage(n_axes=4)


def test_what_is_assumed_is_said_in_sentences():
    stages = (
        published.meng_xy_stage(),
        published.meng_simulated_axes(),
        published.el_khalick_feed_drive(),
        published.el_khalick_feed_drive(n_axes=3),
        ball_screw_stage(),
        linear_motor_stage(),
        machining_centre(),
        iron_core_stage(),
    )
    for machine in stages:
        assert machine.assumed
        assert all(s[0].isupper() and s.endswith(".") for s in machine.assumed)
    assert "not a measured product" in linear_motor_stage().assumed[0]
