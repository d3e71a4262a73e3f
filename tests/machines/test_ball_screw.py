"""Ball screws by their data sheets: the ratios of the lead, and the two physics they lead to."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contourlab.configuration import replace, replace_at
from contourlab.errors import ConfigurationError
from contourlab.machines import (
    BallScrewAxes,
    Drive,
    Friction,
    Machine,
    RigidAxes,
    TwoMassAxes,
    machining_centre,
)

SHEET = {
    "lead": 0.01, "motor_inertia": 1e-3, "screw_inertia": 5e-4, "table_mass": 200.0,
    "motor_viscous": 2e-3, "table_viscous": 300.0, "torque_constant": 1.1, "amplifier_gain": 2.5,
}  # fmt: skip
R = 0.01 / (2 * math.pi)


@jax.jit
def advance(bound, state, command):
    """Compiled once for a kind of machine: a step run piece by piece takes tens of ms."""
    return bound.advance(state, command, jnp.zeros(len(command)))


def machine(dynamics, n_axes=1, **parts):
    return Machine(
        names=("X", "Y", "Z")[:n_axes], dynamics=dynamics, drive=Drive(command="voltage"), **parts
    )


def test_a_rigid_screw_is_a_rigid_axis_with_reflected_inertia():
    dry = {
        "motor_friction": Friction(coulomb=0.5, breakaway=0.7),
        "table_friction": Friction(coulomb=100.0),
    }
    axes = BallScrewAxes(**SHEET, **dry)
    rigid = axes.translated
    assert type(rigid) is RigidAxes
    assert_allclose(rigid.mass, 1.5e-3 / R**2 + 200.0, rtol=1e-14)
    assert_allclose(rigid.viscous, 2e-3 / R**2 + 300.0, rtol=1e-14)
    assert_allclose(rigid.gain, 1.1 * 2.5 / R, rtol=1e-14)
    assert_allclose(rigid.friction.coulomb, 0.5 / R + 100.0, rtol=1e-14)
    assert_allclose(rigid.friction.breakaway, 0.7 / R + 100.0, rtol=1e-14)
    one, other = machine(axes).bind(1e-3), machine(rigid).bind(1e-3)
    a, b = one.init(jnp.zeros(1)), other.init(jnp.zeros(1))
    for k in range(20):
        u = jnp.full(1, 5.0 * math.sin(k / 3))
        a, b = advance(one, a, u), advance(other, b, u)
    assert np.array_equal(one.true_position(a), other.true_position(b))
    assert float(one.true_position(a)[0]) != 0.0


def test_the_motor_turns_by_the_lead():
    """Torque, speed and power are those of the motor's own equation, J w' = T - b w."""
    axes = BallScrewAxes(lead=0.01, motor_inertia=1e-3, table_mass=0.0, motor_viscous=2e-3,
                         torque_constant=1.1)  # fmt: skip
    bound = machine(axes).bind(1e-2)
    state = bound.init(jnp.zeros(1))
    for _ in range(10):
        state = advance(bound, state, jnp.full(1, 3.0))  # 3 A
    speed = 3.3 / 2e-3 * -math.expm1(-0.1 * 2e-3 / 1e-3)  # rad/s
    assert_allclose(bound.true_velocity(state), speed * R, rtol=1e-12)


def test_published_drive_has_the_published_polynomial():
    """A paper's two axes: lead 5 mm, 0.05 kg m², 0.31 N m s/rad, 1.4 N m/V, 8 and 2.5 kg, 5 ms."""
    axes = BallScrewAxes(
        lead=0.005, motor_inertia=0.05, table_mass=(8.0, 2.5), motor_viscous=0.31,
        torque_constant=1.4,
    )  # fmt: skip
    told = machine(axes, 2).nominal
    rate, push = told.viscous / told.mass, told.gain / told.mass
    # worked out on paper from (n + m r²) θ'' + z θ' = k v and x = r θ
    assert_allclose(rate, (6.199371872, 6.199803696), rtol=1e-9)
    assert_allclose(push, (0.02227943465, 0.02228098655), rtol=1e-9)
    decay = np.exp(-rate * 0.005)
    assert_allclose(decay, 0.97, rtol=0, atol=5e-3)  # A = 1 - 1.97 q⁻¹ + 0.97 q⁻² as printed
    bound = machine(axes, 2).bind(0.005)
    one = bound.advance(bound.init(jnp.zeros(2)), jnp.ones(2), jnp.zeros(2))
    assert_allclose(bound.true_position(one), 0.28e-6, rtol=0, atol=0.005e-6)  # b₀ as printed


def test_a_flexible_screw_is_two_masses():
    axes = BallScrewAxes(
        **SHEET, stiffness=8e7, damping_ratio=0.03, backlash=3e-6,
        motor_friction=Friction(coulomb=0.5, coulomb_backward=0.4),
        table_friction=Friction(coulomb=100.0),
    )  # fmt: skip
    pair = axes.translated
    assert type(pair) is TwoMassAxes
    assert_allclose(pair.motor_mass, 1.5e-3 / R**2, rtol=1e-14)
    assert_allclose(pair.load_mass, 200.0)
    assert_allclose(pair.anti_resonance_hz, math.sqrt(8e7 / 200.0) / 2 / math.pi, rtol=1e-14)
    assert_allclose(pair.damping_ratio, 0.03, rtol=1e-14)
    assert_allclose(pair.motor_viscous, 2e-3 / R**2, rtol=1e-14)
    assert_allclose(pair.load_viscous, 300.0)
    assert_allclose(pair.motor_friction.coulomb, 0.5 / R, rtol=1e-14)
    assert_allclose(pair.motor_friction.coulomb_backward, 0.4 / R, rtol=1e-14)
    assert_allclose(pair.load_friction.coulomb, 100.0)
    told = machine(axes).nominal
    assert_allclose(told.mass, 1.5e-3 / R**2 + 200.0, rtol=1e-14)
    assert_allclose(told.coulomb, 0.45 / R + 100.0, rtol=1e-14)


def test_numbers_of_the_sheet_are_those_that_vary():
    m = machining_centre()
    heavier = replace_at(m, "dynamics.table_mass", (500.0, 420.0, 280.0))
    assert_allclose(heavier.nominal.mass - m.nominal.mass, (250.0, 0.0, 0.0))
    told = m.nominal
    peak = np.asarray(told.gain) * 10.0
    assert_allclose(peak * np.array((12e-3, 12e-3, 10e-3)) / (2 * math.pi), 24.0)  # N m
    spare = peak - np.asarray(told.mass) * np.asarray(m.limits.acceleration)
    assert np.all(spare > np.asarray(told.coulomb) + told.viscous * m.limits.velocity)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"lead": 0.0}, "lead must be > 0 m, got 0"),
        ({"backlash": 1e-6}, "backlash goes with stiffness"),
        ({"damping_ratio": 0.1}, "damping_ratio goes with stiffness"),
        ({"stiffness": 1e7}, "stiffness needs damping_ratio"),
        ({"stiffness": 1e7, "damping_ratio": 0.1, "table_mass": 0.0}, "table_mass must be > 0"),
        ({"torque_constant": None}, "amplifier_gain goes with torque_constant"),
        ({"motor_inertia": 0.0, "screw_inertia": 0.0, "table_mass": 0.0}, "must not all be zero"),
        (
            {
                "motor_friction": Friction(coulomb=1.0, smoothing_velocity=1e-3),
                "table_friction": Friction(coulomb=1.0),
            },
            "smoothing_velocity must be the same",
        ),
    ],
    ids=lambda value: None if isinstance(value, str) else "-".join(value),
)
def test_wrong_sheets_are_named(wrong, words):
    with pytest.raises(ConfigurationError, match=words):
        BallScrewAxes(**(SHEET | wrong))


def test_another_number_of_axes_is_named():
    axes = BallScrewAxes(**SHEET)
    for name in ("lead", "table_mass", "torque_constant"):
        with pytest.raises(ConfigurationError, match=f"{name} must have one value per axis, 2"):
            machine(replace(axes, **{name: (1.0, 2.0, 3.0)}), 2)
