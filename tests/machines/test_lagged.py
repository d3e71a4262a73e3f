"""A lagging drive: the conformance check, and the step response of the third-order axis."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError
from contourlab.machines import (
    Drive,
    Encoder,
    LaggedAxes,
    Machine,
    RigidAxes,
    TransferFunctionAxes,
    published,
)
from contourlab.testing.machines import check_machine

M, B, TAU = 2.0, 30.0, 2e-3


def lagged(pieces):
    return LaggedAxes(axes=RigidAxes(mass=M, viscous=B), time_constant=TAU, pieces=pieces)


def machine(dynamics):
    return Machine(
        names=("X",), dynamics=dynamics, drive=Drive(command="force"),
        sensor=Encoder(velocity="ideal"),
        nominal_model=RigidAxes(mass=M, viscous=B).nominal(1, Drive(command="force")),
    )  # fmt: skip


@jax.jit
def advance(bound, state, command):
    """Compiled once for a kind of machine: a step run piece by piece takes tens of ms."""
    return bound.advance(state, command, jnp.zeros(len(command)))


def positions(dynamics, n=40, dt=1e-3):
    bound = machine(dynamics).bind(dt)
    state = bound.init(np.zeros(1))
    found = []
    for k in range(n):
        command = np.array([1.0 if k % 10 < 5 else -0.5])
        state = advance(bound, state, command)
        found.append(float(bound.true_position(state)[0]))
    return np.array(found)


def test_conformance():
    check_machine(machine(lagged(3)))


def test_it_is_the_third_order_axis_to_second_order_in_the_pieces():
    third = TransferFunctionAxes(
        numerators=((1.0,),), denominators=((M * TAU, M + B * TAU, B, 0.0),)
    )
    exact = positions(third)
    errors = [np.max(np.abs(positions(lagged(p)) - exact)) for p in (2, 4, 8)]
    assert errors[1] < 1e-3 * np.max(np.abs(exact))
    assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


def test_the_nominal_model_does_not_know_of_the_lag():
    nominal = LaggedAxes(axes=RigidAxes(mass=M), time_constant=TAU).nominal(
        1, Drive(command="force")
    )
    assert_allclose(nominal.mass, M)
    with pytest.raises(ConfigurationError, match="time_constant"):
        LaggedAxes(axes=RigidAxes(mass=M), time_constant=(TAU, TAU)).check_axes(1)
    with pytest.raises(ConfigurationError, match="offers no linear model"):
        lagged(2).linear(1)


def test_the_emulated_stage_tells_laws_of_the_published_one():
    stage, emulated = published.meng_xy_stage(), published.meng_emulated_stage()
    for name in ("mass", "viscous", "coulomb", "command_limit"):
        assert_allclose(getattr(emulated.nominal, name), getattr(stage.nominal, name))
    assert any("fitted" in sentence for sentence in emulated.assumed)
