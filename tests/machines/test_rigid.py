"""Rigid axes against closed forms, another solver, and the laws of friction."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from contourlab.errors import ConfigurationError
from contourlab.machines import Drive, Friction, Machine, RigidAxes

T = 1e-3


def machine(n_axes=2, delay=0.0, substeps=10, limit=np.inf, **axes):
    return Machine(
        names=("X", "Y", "Z")[:n_axes], dynamics=RigidAxes(**axes), substeps=substeps,
        drive=Drive(command="force", command_limit=limit, computing_delay=delay),
    )  # fmt: skip


def run(m, commands, disturbance=0.0, velocity=None, sample_time=T):
    """True positions and velocities at t_0, t_1, ..."""
    bound = m.bind(sample_time)
    load = jnp.broadcast_to(jnp.asarray(disturbance, float), (m.n_axes,))

    @jax.jit
    def loop(bound, commands):
        def step(state, command):
            seen = bound.true_position(state), bound.true_velocity(state)
            return bound.advance(state, command, load), seen

        start = bound.init(jnp.zeros(m.n_axes), velocity=velocity)
        end, seen = jax.lax.scan(step, start, commands)
        return seen, (bound.true_position(end), bound.true_velocity(end))

    seen, end = loop(bound, jnp.asarray(commands))
    return [np.concatenate([a, b[None]]) for a, b in zip(seen, end, strict=True)]


def mass_damper(t, mass, viscous, effort):
    """Position and velocity under a constant effort from rest."""
    lag = mass / viscous
    v = effort / viscous * -np.expm1(-t / lag)
    return effort / viscous * t - lag * v, v


def test_step_response_of_a_mass_with_damper_is_exact():
    mass, viscous, gain, u = np.array((5.0, 0.7)), np.array((10.0, 300.0)), 2.0, 3.0
    q, v = run(machine(mass=mass, viscous=viscous, gain=gain), np.full((200, 2), u), 1.5)
    t = T * np.arange(201)[:, None]
    position, velocity = mass_damper(t, mass, viscous, gain * u + 1.5)
    assert_allclose(q, position, rtol=1e-12, atol=1e-15)  # rounding of 200 steps
    assert_allclose(v, velocity, rtol=1e-12, atol=1e-15)


def test_double_integrator_is_exact():
    q, v = run(machine(mass=(4.0, 2.0), viscous=0.0), np.full((100, 2), 6.0))
    t = T * np.arange(101)[:, None]
    acceleration = 6.0 / np.array((4.0, 2.0))
    assert_allclose(q, acceleration * t**2 / 2, rtol=1e-12, atol=1e-16)
    assert_allclose(v, acceleration * t, rtol=1e-12, atol=1e-16)


def test_vanishing_viscous_friction_is_a_smooth_limit():
    def end(viscous):
        bound = machine(1, mass=2.0, viscous=viscous).bind(0.1)
        state = bound.init(jnp.zeros(1))
        for _ in range(2):
            state = bound.advance(state, jnp.ones(1), jnp.zeros(1))
        return bound.true_position(state)[0]

    # from the closed form: q = f t² / (2 M) - f B t³ / (6 M²) + ...
    slope = jax.grad(end)(jnp.asarray(0.0))
    assert_allclose(slope, -(0.2**3) / (6 * 4), rtol=1e-12)
    assert_allclose(jax.grad(end)(jnp.asarray(1e-9)), slope, rtol=1e-9)
    assert_allclose(end(1e-9), end(0.0) + 1e-9 * slope, rtol=1e-13)


@pytest.mark.parametrize("friction", [None, Friction(coulomb=1e-300)])
@pytest.mark.parametrize("samples", [0.4, 1.0, 2.75])
def test_delay_splits_the_interval_exactly(samples, friction):
    mass, viscous = 2.0, 40.0
    u = np.array([1.0, -2.0, 0.5, 3.0, 0.0, -1.0])
    m = machine(1, delay=samples * T, mass=mass, viscous=viscous, friction=friction)
    q, _ = run(m, u[:, None])
    # superposition of steps that begin at (k + delay) T
    jumps = np.diff(u, prepend=0.0)
    t = T * np.arange(len(u) + 1)
    begins = T * (np.arange(len(u)) + samples)
    expected = sum(
        mass_damper(np.maximum(t - t0, 0.0), mass, viscous, jump)[0]
        for t0, jump in zip(begins, jumps, strict=True)
    )
    assert_allclose(q[:, 0], expected, rtol=1e-12, atol=1e-18)


FRICTION = {
    "coulomb": (2.0, 1.0), "coulomb_backward": (1.5, 1.0), "breakaway": (3.0, 1.4),
    "stribeck_velocity": 0.02, "smoothing_velocity": 0.01,
}  # fmt: skip


def judge(commands, mass, viscous, sample_time):
    """Another solver, on the formula of the docstring, axis 0."""

    def slope(t, y):
        u = commands[min(int(t / sample_time + 1e-9), len(commands) - 1)]
        v = y[1]
        level = 2.0 if v >= 0 else 1.5
        f = (level + (3.0 - level) * np.exp(-((v / 0.02) ** 2))) * np.tanh(v / 0.01)
        return [v, (u - viscous * v - f) / mass]

    y, out = np.zeros(2), [np.zeros(2)]
    for k in range(len(commands)):
        span = k * sample_time, (k + 1) * sample_time * (1 - 1e-15)
        y = solve_ivp(slope, span, y, rtol=1e-11, atol=1e-14).y[:, -1]
        out.append(y)
    return np.array(out)


def test_friction_converges_with_order_two():
    sample_time = 5e-3
    commands = 6.0 * np.sin(np.arange(40) / 6.0)
    true = judge(commands, 0.5, 4.0, sample_time)
    counts = np.array((4, 8, 16, 32))
    errors = []
    for substeps in counts:
        m = machine(mass=(0.5, 1.0), viscous=(4.0, 1.0), friction=Friction(**FRICTION),
                    substeps=int(substeps))  # fmt: skip
        q, v = run(m, np.stack([commands, commands], -1), sample_time=sample_time)
        errors.append((np.abs(q[:, 0] - true[:, 0]).max(), np.abs(v[:, 0] - true[:, 1]).max()))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert np.all(order > 1.8), (order, errors)
    assert errors[-1][0] < 1e-4 * np.ptp(true[:, 0])  # a substep of 0.16 ms


def test_friction_keeps_the_linear_part_exact():
    """Without dry friction any number of substeps gives the closed form."""
    m = machine(mass=(5.0, 0.7), viscous=(10.0, 300.0), friction=Friction(coulomb=0.0), substeps=3)
    q, v = run(m, np.full((50, 2), 3.0))
    t = T * np.arange(51)[:, None]
    position, velocity = mass_damper(t, np.array((5.0, 0.7)), np.array((10.0, 300.0)), 3.0)
    assert_allclose(q, position, rtol=1e-11, atol=1e-16)
    assert_allclose(v, velocity, rtol=1e-11, atol=1e-16)


@pytest.mark.parametrize("substeps", [1, 10])
@pytest.mark.parametrize("smoothing", [1e-3, 1e-7])
def test_energy_never_grows_without_input(substeps, smoothing):
    friction = Friction(coulomb=5.0, breakaway=8.0, smoothing_velocity=smoothing)
    m = machine(mass=(5.0, 0.5), viscous=(1.0, 0.0), friction=friction, substeps=substeps)
    _, v = run(m, np.zeros((300, 2)), velocity=jnp.array((0.1, -0.05)))
    speed = np.abs(v)
    rounding = 1e-16  # of 0.1 m/s
    assert np.all(np.diff(speed, axis=0) <= rounding)
    assert np.all(speed[-1] < 1e-6)  # 0.1 m/s ends after 100 ms at 1 m/s²: it has stopped
    assert np.all(v * np.sign(v[0]) >= -rounding), "an axis that stops must not swing through"


@pytest.mark.parametrize("substeps", [1, 10])
def test_below_breakaway_an_axis_creeps_no_faster_than_the_smoothing(substeps):
    friction = Friction(coulomb=5.0, breakaway=8.0, smoothing_velocity=1e-5)
    m = machine(1, mass=5.0, friction=friction, substeps=substeps)
    _, v = run(m, np.full((400, 1), 7.0))
    creep = 1e-5 * np.arctanh(7.0 / 8.0)  # the fixed point of the smoothed law, v << v_s
    assert_allclose(v[-1], creep, rtol=1e-3)
    assert np.max(v) < 1.01 * creep
    _, v = run(m, np.full((400, 1), 8.5))
    assert v[-1] > 0.1, "above breakaway it must slide"


def test_friction_asks_more_forwards_than_backwards():
    friction = Friction(coulomb=3.0, coulomb_backward=2.0)
    m = machine(1, mass=1.0, viscous=50.0, friction=friction)
    _, forward = run(m, np.full((300, 1), 10.0))
    _, backward = run(m, np.full((300, 1), -10.0))
    assert_allclose(forward[-1], (10.0 - 3.0) / 50.0, rtol=1e-5)
    assert_allclose(backward[-1], -(10.0 - 2.0) / 50.0, rtol=1e-5)


def test_steady_motion_goes_on():
    """A start in motion keeps its velocity while the commands from before t_0 still act."""
    m = machine(delay=2 * T, mass=(5.0, 3.0), viscous=20.0, friction=Friction(coulomb=2.0))
    bound = m.bind(T)
    state = bound.init(jnp.zeros(2), velocity=jnp.array((0.1, -0.2)))
    for _ in range(2):
        state = bound.advance(state, jnp.zeros(2), jnp.zeros(2))
    assert_allclose(bound.true_velocity(state), (0.1, -0.2), rtol=1e-9)
    state = bound.advance(state, jnp.zeros(2), jnp.zeros(2))
    assert abs(bound.true_velocity(state)[0]) < 0.0999


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"mass": -1.0}, ["mass", "> 0", "-1"]),
        ({"mass": (1.0, 2.0, 3.0)}, ["mass", "one value per axis, 2", "got 3"]),
        ({"mass": 1.0, "viscous": -2.0}, ["viscous", ">= 0", "-2"]),
        ({"mass": 1.0, "gain": (1.0, 2.0, 3.0)}, ["gain", "2", "got 3"]),
    ],
)
def test_wrong_values_are_named(wrong, words):
    with pytest.raises(ConfigurationError) as caught:
        machine(**wrong)
    for word in words:
        assert word in str(caught.value), str(caught.value)


def test_wrong_friction_is_named():
    with pytest.raises(ConfigurationError, match="breakaway must be >= coulomb"):
        Friction(coulomb=2.0, breakaway=1.0)
    with pytest.raises(ConfigurationError, match=r"smoothing_velocity must be > 0 m/s, got 0"):
        Friction(coulomb=2.0, smoothing_velocity=0.0)
    with pytest.raises(ConfigurationError, match=r"friction.coulomb.*2, got 3"):
        machine(mass=1.0, friction=Friction(coulomb=(1.0, 1.0, 1.0)))


def test_nominal_is_the_truth_without_details():
    m = machine(mass=(5.0, 3.0), viscous=20.0, gain=2.0, limit=7.0, friction=Friction(coulomb=2.0))
    assert_allclose(m.nominal.mass, (5.0, 3.0))
    assert_allclose(m.nominal.viscous, (20.0, 20.0))
    assert_allclose(m.nominal.coulomb, (2.0, 2.0))
    assert_allclose(m.nominal.gain, (2.0, 2.0))
    assert_allclose(m.nominal.command_limit, (7.0, 7.0))
    assert m.nominal.command == m.command == "force"
