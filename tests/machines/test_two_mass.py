"""Two masses against closed forms, another solver, and the laws of springs, gaps and friction."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from contourlab.configuration import replace
from contourlab.errors import ConfigurationError
from contourlab.machines import Cogging, Drive, Friction, Machine, RigidAxes, TwoMassAxes
from contourlab.machines.two_mass_motion import TwoMassState

T = 1e-3


def bound(axes, n_axes=1, substeps=10, sample_time=T, **others):
    machine = Machine(
        names=("X", "Y", "Z")[:n_axes], dynamics=axes, drive=Drive(command="force"),
        substeps=substeps, **others,
    )  # fmt: skip
    return machine.bind(sample_time)


@jax.jit
def march(dynamics, state, commands, loads):
    """States of the dynamics at t_0, t_1, ..."""

    def step(state, now):
        command, load = now
        return dynamics.advance(state, (command,), load), state

    end, seen = jax.lax.scan(step, state, (commands, loads))
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b[None]]), seen, end)


def run(axes, commands, *, loads=None, start=None, substeps=10, sample_time=T):
    commands = np.atleast_2d(np.asarray(commands, float).T).T
    n_axes = commands.shape[1]
    dynamics = bound(axes, n_axes, substeps, sample_time).dynamics
    if start is None:
        start = dynamics.steady(jnp.zeros(n_axes), jnp.zeros(n_axes))[0]
    loads = np.zeros_like(commands) if loads is None else np.broadcast_to(loads, commands.shape)
    seen = march(dynamics, start, jnp.asarray(commands), jnp.asarray(loads))
    return jax.tree.map(np.asarray, seen)


def state(position=0.0, stretch=0.0, velocity=0.0, motor_velocity=0.0):
    return TwoMassState(
        *(jnp.full(1, float(x)) for x in (position, stretch, velocity, motor_velocity))
    )


M, L, K, C = 60.0, 300.0, 6e7, 1500.0


def linear(**others):
    return TwoMassAxes(motor_mass=M, load_mass=L, stiffness=K, damping=C, **others)


def with_nothing_dry(**others):
    """The same linear axes by the substeps' road."""
    return linear(load_friction=Friction(coulomb=0.0), **others)


@pytest.mark.parametrize("axes", [linear, with_nothing_dry], ids=["exact", "substeps"])
def test_free_vibration_has_the_closed_form(axes):
    reduced = M * L / (M + L)
    zeta = C / (2.0 * math.sqrt(K * reduced))
    omega = math.sqrt(K / reduced)
    damped = omega * math.sqrt(1.0 - zeta**2)
    seen = run(axes(), np.zeros(200), start=state(stretch=1e-5))
    t = T * np.arange(201)
    wave = np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)
    # 176 Hz in substeps of 0.1 ms: 0.11^6 / 7200 per substep, 2000 of them
    assert_allclose(seen.stretch[:, 0], 1e-5 * np.exp(-zeta * omega * t) * wave, atol=1e-12, rtol=0)
    centre = L * seen.position[:, 0] + M * (seen.position + seen.stretch)[:, 0]
    assert_allclose(centre, M * 1e-5, rtol=1e-12)  # no force from outside
    assert_allclose(axes().resonance_hz, omega / 2 / math.pi, rtol=1e-14)
    assert_allclose(axes().damping_ratio, zeta, rtol=1e-14)


def test_a_held_force_is_integrated_exactly():
    axes = linear(motor_viscous=40.0, load_viscous=90.0, gain=2.0)
    a = np.array([[0, 0, 1, 0], [0, 0, -1, 1], [0, K / L, -(C + 90) / L, C / L],
                  [0, -K / M, C / M, -(C + 40) / M]])  # fmt: skip
    b = np.array([[0, 0], [0, 0], [0, 1 / L], [2.0 / M, 0]])
    rng = np.random.default_rng(1)
    commands, loads = rng.normal(size=(2, 50, 1)) * 100.0
    seen = run(axes, commands, loads=loads)
    whole = expm(np.block([[a, b], [np.zeros((2, 6))]]) * T)
    x = np.zeros(4)
    for k in range(50):
        x = whole[:4, :4] @ x + whole[:4, 4:] @ (commands[k, 0], loads[k, 0])
        now = [
            seen.position[k + 1],
            seen.stretch[k + 1],
            seen.velocity[k + 1],
            seen.motor_velocity[k + 1],
        ]
        assert_allclose(np.ravel(now), x, rtol=1e-9, atol=1e-15)


def test_a_constant_force_bends_the_drive_by_its_share():
    """Both masses accelerate together: the spring carries what moves the load."""
    seen = run(linear(), np.full(3000, 360.0))  # 1 m/s²
    assert_allclose(seen.stretch[-1], L * 1.0 / K, rtol=1e-6)


def test_a_load_bends_a_motor_that_is_held_by_f_over_k():
    axes = linear(motor_viscous=1e7, load_viscous=3e3)
    seen = run(axes, np.zeros(3000), loads=120.0)
    # it creeps, and the load's own drag takes a little
    through = 120.0 * 1e7 / (1e7 + 3e3)
    assert_allclose(seen.stretch[-1], -through / K, rtol=1e-9)


def test_the_frequencies_are_those_of_the_field():
    axes = TwoMassAxes.by_frequency(
        mass=360.0, mass_ratio=5.0, anti_resonance_hz=70.0, damping_ratio=0.03
    )
    assert_allclose(axes.motor_mass, 60.0)
    assert_allclose(axes.load_mass, 300.0)
    assert_allclose(axes.anti_resonance_hz, 70.0, rtol=1e-14)
    assert_allclose(axes.resonance_hz, 70.0 * math.sqrt(6.0), rtol=1e-14)
    assert_allclose(axes.damping_ratio, 0.03, rtol=1e-14)
    a, b, c, motor, _ = axes.linear(1)

    def response(f, output):
        s = 2j * math.pi * f
        return abs((output @ np.linalg.solve(s * np.eye(4) - a, b))[0, 0])

    f = np.linspace(60.0, 200.0, 14001)
    at_motor = [response(x, motor) for x in f]
    at_load = [response(x, c) for x in f]
    assert_allclose(f[np.argmin(at_motor[:4000])], 70.0, rtol=5e-3)  # the dip, a little damped
    assert_allclose(f[np.argmax(at_load)], 70.0 * math.sqrt(6.0), rtol=5e-3)


def test_a_mode_of_one_kilohertz_is_stable_in_one_substep_of_a_millisecond():
    stiff = TwoMassAxes.by_frequency(
        mass=10.0, mass_ratio=1.0, anti_resonance_hz=1000.0, damping_ratio=0.01,
        load_friction=Friction(coulomb=5.0, breakaway=8.0), backlash=1e-6,
    )  # fmt: skip
    seen = run(stiff, 20.0 * np.sin(np.arange(2000) / 7.0), substeps=1)
    assert np.max(np.abs(seen.stretch)) < 2e-6
    assert np.max(np.abs(seen.velocity)) < 0.2


ROUGH = {
    "motor_friction": Friction(
        coulomb=12.0, breakaway=16.0, stribeck_velocity=0.02, smoothing_velocity=5e-3
    ),
    "load_friction": Friction(
        coulomb=25.0, coulomb_backward=20.0, breakaway=30.0, stribeck_velocity=0.02,
        smoothing_velocity=5e-3,
    ),
    "backlash": 20e-6,
    "cogging": (
        Cogging(amplitude=8.0, period=2e-3, phase=0.4),
        Cogging(amplitude=3.0, period=1e-3),
    ),
}  # fmt: skip
SOFT = {"motor_mass": 6.0, "load_mass": 30.0, "stiffness": 2e6, "damping": 300.0,
        "motor_viscous": 40.0, "load_viscous": 60.0}  # fmt: skip


def judge(commands, loads, sample_time, start=(0.0, 0.0, 0.0, 0.0)):
    """Another solver, on the formulae of the docstrings."""
    p = SOFT

    def dry(v, forward, backward, breakaway):
        level = forward if v >= 0 else backward
        return (level + (breakaway - level) * math.exp(-((v / 0.02) ** 2))) * math.tanh(v / 5e-3)

    def slope(t, y, u, d):
        q, s, v, w = y
        excess = abs(s) - 10e-6
        through = 0.0
        if excess > 0.0:
            through = p["stiffness"] * math.copysign(excess, s)
            through += p["damping"] * (excess / abs(s)) * (w - v)
        x = q + s
        teeth = 8.0 * math.sin(2 * math.pi * x / 2e-3 + 0.4) + 3.0 * math.sin(
            2 * math.pi * x / 1e-3
        )
        motor = u + teeth - through - p["motor_viscous"] * w - dry(w, 12.0, 12.0, 16.0)
        load = d + through - p["load_viscous"] * v - dry(v, 25.0, 20.0, 30.0)
        return [v, w - v, load / p["load_mass"], motor / p["motor_mass"]]

    y, out = np.array(start), [np.array(start)]
    for k, (u, d) in enumerate(zip(commands, loads, strict=True)):
        span = k * sample_time, (k + 1) * sample_time
        y = solve_ivp(
            slope, span, y, args=(u, d), rtol=1e-9, atol=1e-13, method="LSODA",
            max_step=sample_time / 8,
        ).y[:, -1]  # fmt: skip
        out.append(y)
    return np.array(out)


def test_rough_axes_converge_to_another_solver_with_order_two():
    sample_time, n = 1e-3, 120
    commands = 90.0 * np.sin(np.arange(n) / 9.0)
    loads = 6.0 * np.cos(np.arange(n) / 5.0)
    true = judge(commands, loads, sample_time)
    assert np.ptp(true[:, 1]) > 40e-6, "the drive must cross its backlash"
    counts, errors = np.array((8, 16, 32, 64)), []
    for substeps in counts:
        seen = run(
            TwoMassAxes(**SOFT, **ROUGH), commands, loads=loads[:, None], start=state(),
            substeps=int(substeps), sample_time=sample_time,
        )  # fmt: skip
        made = np.stack([seen.position, seen.stretch, seen.velocity, seen.motor_velocity], -1)[:, 0]
        errors.append(np.sqrt(np.mean((made - true) ** 2, axis=0)) / np.ptp(true, axis=0))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # a crossing of the gap inside a substep costs O(h²) too, with a phase that wanders
    assert np.all(order > 1.7), (order, errors)
    assert np.max(errors[-1]) < 2e-4


def energy(axes, seen):
    """Kinetic energy and that of the spring, at every sample."""
    excess = np.maximum(np.abs(seen.stretch) - 0.5 * np.asarray(axes.backlash), 0.0)
    moving = axes.motor_mass * seen.motor_velocity**2 + axes.load_mass * seen.velocity**2
    return 0.5 * (moving + axes.stiffness * excess**2)[:, 0]


@pytest.mark.parametrize("substeps", [1, 10])
def test_energy_never_grows_without_input(substeps):
    dry = {
        "motor_friction": Friction(coulomb=0.2, breakaway=0.3, smoothing_velocity=1e-6),
        "load_friction": Friction(coulomb=0.5, smoothing_velocity=1e-6),
    }
    axes = TwoMassAxes(**(SOFT | {"damping": 30.0}), **dry, backlash=20e-6)
    start = state(stretch=60e-6, velocity=0.01, motor_velocity=-0.05)
    seen = run(axes, np.zeros(2000), start=start, substeps=substeps)
    left = energy(axes, seen)
    assert left[-1] < 1e-9 * left[0], "friction brings all to rest"
    # where contact closes or opens inside a substep, the rule is off by O(h²): 140 Hz at 1 ms is
    # as coarse as it gets
    allowed = {1: 0.05, 10: 2e-3}[substeps] * left[0]
    assert np.max(np.diff(left)) < allowed
    assert np.max(left) < left[0] + allowed


def test_no_force_passes_inside_the_gap():
    """Both sides coast at their own speed until they meet."""
    axes = TwoMassAxes(**(SOFT | {"motor_viscous": 0.0, "load_viscous": 0.0}), backlash=20e-6)
    seen = run(axes, np.zeros(40), start=state(stretch=-9e-6, velocity=0.0, motor_velocity=1e-3))
    free = np.abs(seen.stretch[:, 0]) < 10e-6
    ahead = np.argmin(free[1:]) + 1
    assert ahead == 19, "19 µm at 1 mm/s"
    assert np.array_equal(seen.velocity[:ahead], np.zeros((ahead, 1)))
    assert_allclose(seen.motor_velocity[:ahead], 1e-3, rtol=1e-12)
    assert seen.velocity[ahead + 3] > 1e-6, "then the load is pushed"
    momentum = 30.0 * seen.velocity + 6.0 * seen.motor_velocity
    assert_allclose(momentum, 6.0 * 1e-3, rtol=1e-12)  # and nothing is lost or made


def test_below_breakaway_the_load_stands_and_the_spring_carries():
    dry = Friction(coulomb=25.0, breakaway=30.0, smoothing_velocity=1e-6)
    axes = TwoMassAxes(**SOFT, load_friction=dry)
    seen = run(axes, np.full(2000, 20.0), substeps=4)
    assert_allclose(seen.stretch[-1], 20.0 / 2e6, rtol=1e-4)
    creep = 1e-6 * np.arctanh(20.0 / 30.0)
    assert_allclose(seen.velocity[-1], creep, rtol=1e-3)  # the fixed point of the smoothed law


def test_steady_motion_goes_on():
    axes = TwoMassAxes(**SOFT, **(ROUGH | {"cogging": ()}))
    dynamics = bound(axes).dynamics
    start, command = dynamics.steady(jnp.zeros(1), jnp.full(1, 0.1))
    seen = run(axes, np.broadcast_to(command, (100, 1)), start=start)
    assert_allclose(seen.velocity, 0.1, rtol=1e-12)
    assert_allclose(seen.motor_velocity, 0.1, rtol=1e-12)
    through = (60.0 * 0.1 + 25.0) / 2e6  # 0.1 m/s is far above the Stribeck velocity
    assert_allclose(seen.stretch, through + 10e-6, rtol=1e-9)


def test_a_fractional_delay_is_two_parts():
    axes = linear()
    late = Machine(
        names=("X",), dynamics=axes, drive=Drive(command="force", computing_delay=0.4e-3)
    ).bind(T)  # fmt: skip
    fine = Machine(names=("X",), dynamics=axes, drive=Drive(command="force")).bind(T / 5)
    slow, fast = late.init(jnp.zeros(1)), fine.init(jnp.zeros(1))
    quiet, none = jnp.full(1, 50.0), jnp.zeros(1)
    slow = late.advance(late.advance(slow, quiet, none), none, none)
    for k in range(10):
        fast = fine.advance(fast, quiet if 2 <= k < 7 else none, none)
    assert_allclose(late.true_position(slow), fine.true_position(fast), rtol=1e-10)


def test_a_very_stiff_drive_is_rigid():
    dry = Friction(coulomb=3.0, breakaway=4.0, stribeck_velocity=0.01)
    pair = TwoMassAxes(
        motor_mass=2.0, load_mass=3.0, stiffness=1e13, damping=1e3, load_viscous=20.0,
        load_friction=dry,
    )  # fmt: skip
    one = Machine(
        names=("X",), drive=Drive(command="force"),
        dynamics=RigidAxes(mass=5.0, viscous=20.0, friction=dry), substeps=100,
    ).bind(T)  # fmt: skip
    commands = 10.0 * np.sin(np.arange(300) / 20.0)[:, None]
    seen = run(pair, commands, substeps=100)
    start = one.dynamics.steady(jnp.zeros(1), jnp.zeros(1))[0]
    rigid = march(one.dynamics, start, jnp.asarray(commands), jnp.zeros((300, 1)))
    assert_allclose(seen.position, rigid.position, atol=1e-6 * np.ptp(rigid.position), rtol=0)


def test_the_nominal_model_is_one_rigid_body():
    axes = TwoMassAxes(**SOFT, **ROUGH, gain=3.0)
    told = Machine(names=("X", "Y"), dynamics=axes, drive=Drive(command="force")).nominal
    assert_allclose(told.mass, (36.0, 36.0))
    assert_allclose(told.viscous, (100.0, 100.0))
    assert_allclose(told.coulomb, (12.0 + 22.5,) * 2)
    assert_allclose(told.gain, (3.0, 3.0))


def test_derivatives_both_ways_are_those_of_finite_differences():
    """By a number that acts everywhere, the gap, and the commands, all at once."""
    base = TwoMassAxes(**SOFT, load_friction=ROUGH["load_friction"], backlash=20e-6)
    commands = jnp.asarray(90.0 * np.sin(np.arange(60) / 9.0)[:, None])

    def end(changes):
        axes = replace(
            base, stiffness=2e6 * (1 + changes[0]), backlash=20e-6 * (1 + changes[1]),
            load_friction=replace(base.load_friction, coulomb=25.0 * (1 + changes[2])),
        )  # fmt: skip
        dynamics = axes.bind(1, (T,), 10)
        start, _ = dynamics.steady(jnp.zeros(1), jnp.zeros(1))
        last = march(dynamics, start, commands * (1 + changes[3]), jnp.zeros((60, 1)))
        return 1e3 * last.position[-1, 0] + last.motor_velocity[-1, 0]

    zero = jnp.zeros(4)
    value = jax.jit(end)
    backward = jax.jit(jax.grad(end))(zero)
    forward = jax.jit(lambda x: jax.jvp(end, (x,), (jnp.ones(4),))[1])(zero)
    assert_allclose(forward, jnp.sum(backward), rtol=1e-8)
    for k in range(4):
        # a change moves the substep in which the gap closes, a kink of O(h²): small, not tiny steps
        ahead, behind = (float(value(zero.at[k].set(s * 1e-6))) for s in (1.0, -1.0))
        assert_allclose(backward[k], (ahead - behind) / 2e-6, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"motor_mass": 0.0}, "motor_mass must be > 0, got 0"),
        ({"stiffness": -1.0}, "stiffness must be > 0, got -1"),
        ({"backlash": -1e-6}, "backlash must be >= 0 m"),
        ({"load_mass": (1.0, 2.0, 3.0)}, "load_mass must have one value per axis, 2, got 3"),
        ({"backlash": (1.0, 2.0, 3.0)}, "backlash must have one value per axis, 2, got 3"),
        ({"load_friction": Friction(coulomb=(1.0,) * 3)}, "load_friction.coulomb .* 2, got 3"),
        ({"cogging": (Cogging(amplitude=(1.0,) * 3, period=0.01),)}, "cogging.amplitude .* 2, got"),
    ],
)
def test_wrong_values_are_named(wrong, words):
    with pytest.raises(ConfigurationError, match=words):
        bound(TwoMassAxes(**(SOFT | wrong)), 2)


def test_what_is_too_fast_for_the_exact_solution_is_said():
    with pytest.raises(ConfigurationError, match=r"too fast for the sample time.*RigidAxes"):
        bound(TwoMassAxes(motor_mass=1e-3, load_mass=1.0, stiffness=1e12))
    with pytest.raises(ConfigurationError, match=r"anti_resonance_hz must be > 0, got -5"):
        TwoMassAxes.by_frequency(
            mass=1.0, mass_ratio=1.0, anti_resonance_hz=-5.0, damping_ratio=0.1
        )
    with pytest.raises(ConfigurationError, match=r"damping_ratio must be >= 0, got -0\.1"):
        TwoMassAxes.by_frequency(
            mass=1.0, mass_ratio=1.0, anti_resonance_hz=5.0, damping_ratio=-0.1
        )
