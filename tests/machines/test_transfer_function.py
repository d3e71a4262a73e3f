"""Transfer functions against SciPy's discretisation and simulation."""

from decimal import Decimal, localcontext

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal
from scipy.linalg import expm

from contourlab.errors import ConfigurationError
from contourlab.machines import Drive, Machine, RigidAxes, TransferFunctionAxes
from contourlab.machines.exponential import exponential, phi

T = 1e-3
W = 2 * np.pi * 150.0
RESONANT = ((W**2,), tuple(np.polymul((0.01, 1.0, 0.0), (1.0, 2 * 0.03 * W, W**2))))
FIRST = ((2.0,), (0.01, 1.0))
DRIVE = ((1.0,), (0.012, 1.0, 0.0))
ZERO = ((0.004, 1.0), (0.01, 1.0, 0.0))


def machine(*functions, delay=0.0, **parts):
    tops, bottoms = zip(*functions, strict=True)
    return Machine(
        names=tuple("XYZ"[: len(functions)]),
        dynamics=TransferFunctionAxes(numerators=tops, denominators=bottoms),
        drive=Drive(command="velocity", computing_delay=delay), **parts,
    )  # fmt: skip


def run(m, commands, **start):
    bound, n = m.bind(T), m.n_axes
    state = bound.init(start.pop("position", jnp.zeros(n)), **start)
    advance = jax.jit(lambda state, command, load: bound.advance(state, command, load))
    q, v = [], []
    for command in commands:
        state = advance(state, jnp.broadcast_to(jnp.asarray(command), (n,)), jnp.zeros(n))
        q.append(bound.true_position(state))
        v.append(bound.true_velocity(state))
    return np.array(q), np.array(v)


@pytest.mark.filterwarnings("ignore::scipy.signal.BadCoefficients")
def test_axes_of_different_order_agree_with_scipy():
    functions = (RESONANT, FIRST, ZERO)
    u = np.sin(np.arange(120) / 7.0)
    q, _ = run(machine(*functions), u)
    for axis, function in enumerate(functions):
        system = signal.cont2discrete(function, T)
        _, expected = signal.dlsim((np.squeeze(system[0]), system[1], T), np.append(u, 0.0))
        # 1e-10: SciPy's canonical form is not scaled and loses digits for the resonance
        scale = np.abs(expected).max()
        assert_allclose(q[:, axis], expected[1:, 0], rtol=0, atol=1e-10 * scale)


def test_first_order_is_the_closed_form():
    q, v = run(machine(FIRST), np.ones(30))
    t = T * np.arange(1, 31)
    assert_allclose(q[:, 0], 2.0 * -np.expm1(-t / 0.01), rtol=1e-12)
    assert_allclose(v[:, 0], 200.0 * np.exp(-t / 0.01), rtol=1e-12)


def test_a_mass_with_damper_is_the_same_as_rigid_axes():
    rigid = Machine(
        names=("X",), dynamics=RigidAxes(mass=0.012, viscous=1.0),
        drive=Drive(command="velocity", computing_delay=0.3 * T),
    )  # fmt: skip
    u = np.cos(np.arange(50) / 3.0)
    for a, b in zip(run(rigid, u), run(machine(DRIVE, delay=0.3 * T), u), strict=True):
        assert_allclose(b, a, rtol=1e-12, atol=1e-16)


def test_fractional_delay_is_the_two_interval_solution():
    a, b = np.array([[0.0, 1.0], [0.0, -1 / 0.012]]), np.array([0.0, 1 / 0.012])
    u = np.array([1.0, -2.0, 0.5, 3.0])
    q, _ = run(machine(DRIVE, delay=1.4 * T), u)
    held = np.concatenate([[0.0, 0.0], u])

    def over(x, h, u):
        block = np.zeros((3, 3))
        block[:2, :2], block[:2, 2] = a, b * u
        return (expm(block * h) @ np.append(x, 1.0))[:2]

    x, expected = np.zeros(2), []
    for k in range(len(u)):
        x = over(x, 0.4 * T, held[k])  # command k - 2
        x = over(x, 0.6 * T, held[k + 1])  # command k - 1
        expected.append(x[0])
    assert_allclose(q[:, 0], expected, rtol=1e-12, atol=1e-18)


def test_start_in_motion_is_steady():
    m = machine(RESONANT, DRIVE, ZERO)
    bound, velocity = m.bind(T), jnp.array((0.1, -0.2, 0.05))
    state = bound.init(jnp.array((0.3, 0.1, -0.2)), velocity=velocity)
    assert_allclose(bound.true_velocity(state), velocity, rtol=1e-12)
    for _ in range(20):
        state = bound.advance(state, velocity, jnp.zeros(3))
    expected = np.array((0.3, 0.1, -0.2)) + 0.02 * np.asarray(velocity)
    assert_allclose(bound.true_position(state), expected, rtol=1e-11)
    assert_allclose(bound.true_velocity(state), velocity, rtol=1e-9)


def test_without_integrator_rest_needs_a_command():
    """A position servo stands still under the command that holds it, from a delay too."""
    servo = ((100.0,), (1.0, 20.0, 100.0))
    q, v = run(
        machine(servo, FIRST, delay=3 * T), [(0.2, 0.1)] * 10, position=jnp.array((0.2, 0.2))
    )
    assert_allclose(q, np.full((10, 2), 0.2), rtol=1e-12)
    assert_allclose(v, np.zeros((10, 2)), atol=1e-12)


def test_disturbance_adds_to_the_command():
    bound = machine(DRIVE).bind(T)
    start = bound.init(jnp.zeros(1))
    a = bound.advance(start, jnp.full(1, 0.3), jnp.full(1, 0.2))
    b = bound.advance(start, jnp.full(1, 0.5), jnp.zeros(1))
    assert_allclose(bound.true_position(a), bound.true_position(b), rtol=1e-14)


def test_nominal_fits_low_frequency():
    m = machine(DRIVE, RESONANT, ZERO)
    s = 1j * 0.5
    for axis, (top, bottom) in enumerate((DRIVE, RESONANT, ZERO)):
        true = np.polyval(top, s) / np.polyval(bottom, s)
        nominal = m.nominal
        fit = nominal.gain[axis] / (s * (nominal.mass[axis] * s + nominal.viscous[axis]))
        assert abs(fit / true - 1) < 1e-4  # second order in ω T = 0.006


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (FIRST, "it is of first order"),
        (((1.0,), (1.0, 1.0, 1.0)), "no integrator"),
        (((1.0,), (1.0, 0.0, 0.0)), "integrates twice"),
        (((0.1, 1.0), (0.01, 1.0, 0.0)), "leads"),
        (((-1.0,), (0.01, 1.0, 0.0)), "gain at low frequency"),
    ],
)
def test_nominal_is_refused_with_the_reason(function, words):
    with pytest.raises(ConfigurationError, match=f"{words}.*give the machine a nominal_model"):
        _ = machine(function).nominal


@pytest.mark.parametrize(
    ("top", "bottom", "words"),
    [
        ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0), "strictly proper"),
        ((1.0, 0.0), (1.0, 1.0, 1.0), "must not end with zero"),
        ((1.0,), (0.0, 1.0, 0.0), "must not start with zero"),
        ((1.0,), (np.nan, 1.0, 0.0), "finite"),
    ],
)
def test_wrong_polynomials_are_refused(top, bottom, words):
    with pytest.raises(ConfigurationError, match=words):
        TransferFunctionAxes(numerators=(top,), denominators=(bottom,))


def test_counts_must_agree():
    with pytest.raises(ConfigurationError, match="got 2 and 1"):
        TransferFunctionAxes(numerators=((1.0,), (1.0,)), denominators=((1.0, 0.0),))
    axes = TransferFunctionAxes(numerators=((1.0,),), denominators=((1.0, 0.0),))
    with pytest.raises(ConfigurationError, match="one polynomial per axis, 2, got 1"):
        Machine(names=("X", "Y"), dynamics=axes, drive=Drive(command="velocity"))


def test_a_pole_beyond_the_sample_time_is_refused():
    with pytest.raises(ConfigurationError, match="too fast for the sample time"):
        machine(((1.0,), (1e-7, 1.0, 0.0))).bind(T)


def test_exponential_agrees_with_scipy():
    rng = np.random.default_rng(5)
    for size in (1e-9, 1e-2, 3.0, 40.0):
        a = rng.normal(size=(3, 4, 4)) - 2.0 * np.eye(4)
        a = size * a / np.abs(a).sum(-1).max()
        expected = np.array([expm(x) for x in a])
        # squaring amplifies rounding with the norm, in both
        tolerance = 1e-14 * max(1.0, size) * np.abs(expected).max()
        assert_allclose(exponential(a), expected, rtol=0, atol=10 * tolerance)
    # the part beside the identity keeps its digits
    assert_allclose(exponential(np.array([[1e-9]])) - 1.0, [[1e-9]], rtol=1e-6)


def test_phi_and_its_derivatives():
    z = np.array((0.0, 1e-12, -1e-6, -0.0499999, -0.0500001, 0.3, -3.0, -200.0))
    e, one, two = phi(z)

    def exact(x):
        with localcontext(prec=90):
            x = Decimal(float(x)) or Decimal("1e-30")
            first = (x.exp() - 1) / x
            return x.exp(), first, (first - 1) / x

    expected = np.array([[float(y) for y in exact(x)] for x in z]).T
    assert_allclose(e, expected[0], rtol=1e-14)
    assert_allclose(one, expected[1], rtol=1e-13, atol=1e-15)
    assert_allclose(two, expected[2], rtol=1e-12)
    slope = jax.vmap(jax.grad(lambda x: phi(x)[2]))(z)
    assert_allclose(slope[0], 1 / 6, rtol=1e-14)
    h = 1e-4
    centred = (phi(z + h)[2] - phi(z - h)[2]) / (2 * h)
    assert_allclose(slope, centred, rtol=1e-6)
