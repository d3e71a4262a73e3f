"""The stage and scanner of Cao and Zhang, and dry friction at the input of identified axes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.errors import ConfigurationError
from contourlab.machines import Drive, Friction, InputFriction, Machine, StateSpaceAxes
from contourlab.machines.published import (
    cao_zhang_emulated_stage,
    cao_zhang_stage,
    cao_zhang_stage_and_scanner,
)
from contourlab.machines.published.cao_zhang import cao_zhang_pulse_model
from contourlab.testing.machines import check_machine

T = 1e-3


@jax.jit
def advance(bound, state, command):
    """Compiled once for a kind of machine: a step run piece by piece takes tens of ms."""
    return bound.advance(state, command, jnp.zeros(len(command)))


def test_the_printed_matrices_are_what_moves():
    """(43), (44) by hand: y(k+2) + a1 y(k+1) + a2 y(k) = b1 u(k+1) + b2 u(k)."""
    machine = cao_zhang_stage_and_scanner().bind(T)
    rng = np.random.default_rng(3)
    u = rng.normal(size=(20, 4))
    state, y = machine.init(np.zeros(4)), []
    for row in u:
        y.append(np.asarray(machine.true_position(state)))
        state = advance(machine, state, row)
    y = np.array(y)
    g = np.array([[1.9734, -0.9735], [1.9581, -0.9583], [1.7387, -0.7529], [1.7261, -0.7405]])
    h = 1e-3 * np.array(
        [[2.5259e-4, 2.5034e-4], [6.8214e-4, 6.7253e-4], [0.0270, 0.0246], [0.0253, 0.0228]]
    )
    ahead = g[:, 0] * y[1:-1] + g[:, 1] * y[:-2] + h[:, 0] * u[1:-1] + h[:, 1] * u[:-2]
    assert_allclose(y[2:], ahead, atol=1e-14 * np.max(np.abs(y)))


def test_the_tool_is_stage_less_scanner():
    tool = cao_zhang_stage_and_scanner().tool
    assert_allclose(tool.tool_from_axes(np.array([5.0, 7.0, 1.0, 2.0])), [4.0, 5.0])


def test_laws_are_told_the_poles_and_the_gain():
    """The ZOH of the nominal model has the printed denominators; numerators to 2e-4 of the gain."""
    from contourlab.controllers.pulse_model import PulseModel

    top, bottom = cao_zhang_pulse_model(4)
    model = PulseModel.of_model(cao_zhang_stage_and_scanner().nominal, T)
    assert_allclose(model.denominator, bottom, atol=1e-10)
    assert_allclose(np.sum(model.numerator, 1), top.sum(1), rtol=1e-8)
    assert_allclose(model.numerator, top, rtol=0.02)  # four digits of b, and of a, are printed


def rigid(friction):
    """M = 1, no drag: x' = v, v' = u, as an identified state space."""
    return InputFriction(
        axes=StateSpaceAxes(
            state_matrix=[[0.0, 1.0], [0.0, 0.0]], input_matrix=[[0.0], [1.0]],
            output_matrix=[[1.0, 0.0]],
        ),
        friction=friction,
    )  # fmt: skip


def machine_with(friction, substeps=10):
    return Machine(
        names=("X",), dynamics=rigid(friction), drive=Drive(command="force"), substeps=substeps
    ).bind(T)


def test_friction_slows_a_coasting_axis_and_never_turns_it_round():
    """v falls by F t until it rests; a tenth of a substep's fall is the smoothing."""
    machine = machine_with(Friction(coulomb=2.0, smoothing_velocity=1e-6))
    state = machine.init(np.zeros(1), velocity=np.array([0.01]))
    speed = []
    for _ in range(10):
        state = machine.advance(state, np.zeros(1), np.zeros(1))
        speed.append(float(machine.true_velocity(state)[0]))
    assert_allclose(speed[:4], 0.01 - 2.0 * T * np.arange(1, 5), atol=1e-7)
    assert np.all(np.array(speed) >= 0.0)
    assert speed[-1] < 1e-8


def test_an_axis_sticks_below_the_level_and_slides_above():
    machine = machine_with(Friction(coulomb=2.0, smoothing_velocity=1e-6))
    for push, wanted in ((1.9, 0.0), (3.0, 1.0)):  # it creeps at v_0 atanh(0.95) at most
        state = machine.init(np.zeros(1))
        for _ in range(100):
            state = advance(machine, state, np.array([push]))
        assert_allclose(machine.true_velocity(state), wanted * 100 * T, atol=2e-6)


def test_what_friction_at_the_input_cannot_take():
    with pytest.raises(ConfigurationError, match="continuous"):
        InputFriction(axes=cao_zhang_stage().dynamics, friction=Friction(coulomb=1.0))
    crossed = StateSpaceAxes(
        state_matrix=np.kron(np.eye(2), [[0.0, 1.0], [0.0, -3.0]]),
        input_matrix=[[0.0, 0.0], [1.0, 0.5], [0.0, 0.0], [0.0, 1.0]],
        output_matrix=[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    )
    with pytest.raises(ConfigurationError, match="cross-talk"):
        InputFriction(axes=crossed, friction=Friction(coulomb=1.0))


@pytest.mark.overnight
@pytest.mark.slow
def test_conformance():
    for machine in (cao_zhang_stage_and_scanner(), cao_zhang_emulated_stage()):
        check_machine(machine)


def test_the_emulation_says_what_it_assumes():
    assert any("emulation" in text for text in cao_zhang_emulated_stage().assumed)
