"""Cogging against another solver, by its work, and at rest."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from contourlab.errors import ConfigurationError
from contourlab.machines import Cogging, Drive, Friction, Machine, RigidAxes

TEETH = (
    Cogging(amplitude=(6.0, 0.0), period=2e-3, phase=0.4),
    Cogging(amplitude=(2.0, 1.0), period=1e-3),
)


def machine(substeps=10, **axes):
    return Machine(
        names=("X", "Y"), dynamics=RigidAxes(mass=2.0, viscous=5.0, cogging=TEETH, **axes),
        drive=Drive(command="force"), substeps=substeps,
    )  # fmt: skip


def run(m, commands, velocity=None, position=(0.0, 0.0)):
    bound = m.bind(1e-3)

    @jax.jit
    def loop(bound, commands):
        def step(state, command):
            state = bound.advance(state, command, jnp.zeros(2))
            return state, (bound.true_position(state), bound.true_velocity(state))

        return jax.lax.scan(step, bound.init(position, velocity=velocity), commands)[1]

    return [np.asarray(x) for x in loop(bound, jnp.asarray(commands))]


def force(q):
    return 6.0 * math.sin(2 * math.pi * q / 2e-3 + 0.4) + 2.0 * math.sin(2 * math.pi * q / 1e-3)


@pytest.mark.parametrize(
    "friction", [None, Friction(coulomb=1.5, smoothing_velocity=5e-3)], ids=["smooth", "dry"]
)
def test_cogging_converges_to_another_solver_with_order_two(friction):
    commands = 20.0 * np.sin(np.arange(60) / 6.0)

    def slope(t, y, u):
        dry = 0.0 if friction is None else 1.5 * math.tanh(y[1] / 5e-3)
        return [y[1], (u + force(y[0]) - 5.0 * y[1] - dry) / 2.0]

    y, true = np.zeros(2), []
    for k, u in enumerate(commands):
        y = solve_ivp(slope, (k * 1e-3, k * 1e-3 + 1e-3), y, args=(u,), rtol=1e-11, atol=1e-15).y[
            :, -1
        ]
        true.append(y)
    true = np.array(true)
    assert np.ptp(true[:, 0]) > 2e-3, "it must pass a whole tooth"
    counts, errors = np.array((2, 4, 8, 16)), []
    for substeps in counts:
        q, v = run(machine(int(substeps), friction=friction), np.stack([commands] * 2, -1))
        errors.append((np.abs(q[:, 0] - true[:, 0]).max(), np.abs(v[:, 0] - true[:, 1]).max()))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert np.all(order > 1.8), (order, errors)
    assert errors[-1][0] < 1e-4 * np.ptp(true[:, 0])


def test_energy_goes_to_and_fro_in_a_tooth():
    """Without damping an axis swings in the well, and the sum of its energies stays."""
    m = Machine(
        names=("X", "Y"), dynamics=RigidAxes(mass=2.0, cogging=TEETH),
        drive=Drive(command="force"), substeps=20,
    )  # fmt: skip
    q, v = run(m, np.zeros((2000, 2)), velocity=(0.02, 0.0), position=(8e-4, 0.0))
    potential = 6.0 * 2e-3 / (2 * math.pi) * np.cos(2 * math.pi * q / 2e-3 + 0.4)
    potential = potential + 2.0 * 1e-3 / (2 * math.pi) * np.cos(2 * math.pi * q / 1e-3)
    total = (0.5 * 2.0 * v**2 + potential)[:, 0]
    depth = np.ptp(potential[:, 0])
    assert np.ptp(q[:, 0]) < 2e-3
    assert np.ptp(v[:, 0]) > 0.02
    # second order, and no method that keeps energy exactly: 40 000 substeps of a 6 ms swing
    assert np.max(np.abs(total - total[0])) < 0.05 * depth


def test_an_axis_starts_held_at_its_place_and_falls_into_a_tooth_if_let_go():
    bound = machine().bind(1e-3)
    at = jnp.array((3e-4, 0.0))
    _, held = bound.dynamics.steady(at, jnp.zeros(2))
    assert_allclose(held[0], -force(3e-4), rtol=1e-14)
    assert held[1] == 0.0
    q, _ = run(machine(), np.zeros((16000, 2)), position=at)
    settled = q[-1, 0]
    assert_allclose(force(settled), 0.0, atol=1e-6)
    assert force(settled + 1e-6) < 0.0, "a stable place"


def test_no_harmonics_cost_nothing_and_change_nothing():
    plain = RigidAxes(mass=2.0)
    assert not plain.uses_substeps
    assert plain.bind(2, (1e-3,), 10).cogging is None
    assert RigidAxes(mass=2.0, cogging=TEETH).uses_substeps


def test_wrong_values_are_named():
    with pytest.raises(ConfigurationError, match="amplitude must be >= 0, got -1"):
        Cogging(amplitude=-1.0, period=0.01)
    with pytest.raises(ConfigurationError, match="period must be > 0 m, got 0"):
        Cogging(amplitude=1.0, period=0.0)
    with pytest.raises(ConfigurationError, match=r"cogging.period must have one value per axis, 2"):
        Machine(
            names=("X", "Y"), drive=Drive(command="force"),
            dynamics=RigidAxes(mass=1.0, cogging=(Cogging(amplitude=1.0, period=(1.0,) * 3),)),
        )  # fmt: skip
